//! Section 4.3: which pixels belong to a tracked player.

use serde::{Deserialize, Serialize};

use crate::{geometry::Mask, tracking::Sighting};

/// The pixels of one tracked person in one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlayerMask {
    /// Whose.
    pub sighting: Sighting,
    /// Which pixels.
    pub mask: Mask,
}
