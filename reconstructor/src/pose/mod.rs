//! Section 4.2, second half: the pose and the instance mask of everybody who can stand on the pitch.

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::geometry::{Mask, PixelBox};

/// Joints of the pose network, in its order: BlazePose's 33 landmarks.
pub const JOINTS: usize = 33;

/// One joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// Where, pixels of the clip.
    pub pixel: DVec2,
    /// Along the line of sight relative to the middle of the hips, metres, positive away from the camera.
    pub depth_m: f32,
    /// Probability that it is in the picture and not hidden, 0..1.
    pub visibility: f32,
}

/// Somebody on the pitch in one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Person {
    /// The box, refined by the pose, pixels of the clip.
    pub bounds: PixelBox,
    /// Detector's confidence 0..1.
    pub score: f32,
    /// Pose network's confidence that it saw a whole person, 0..1.
    pub pose_score: f32,
    /// The joints, [`JOINTS`] of them.
    pub joints: Vec<Joint>,
    /// Instance mask of the pose network.
    pub mask: Mask,
    /// Middle between the shoulders: the paper's neck keypoint, pixels of the clip.
    pub neck_px: DVec2,
    /// The point of the pitch the person stands on, world metres.
    pub ground_m: DVec3,
    /// Neck lifted on the upright plane through `ground_m`, world metres.
    pub neck_m: DVec3,
}
