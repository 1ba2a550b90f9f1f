//! Section 3.2: the depth map of each player, by a network trained on rendered players.

use serde::{Deserialize, Serialize};

use crate::geometry::Mask;

/// Depth of one player, on the pixels of the clip.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DepthMap {
    /// The player's pixels; the network may have removed some from the segmentation's mask.
    pub mask: Mask,
    /// Signed distance in metres along the camera's optical axis from the upright virtual plane to the surface, positive
    /// away from the camera; one per pixel of the mask's rectangle, row by row, 0 where the mask is empty.
    pub offset_m: Vec<f32>,
}
