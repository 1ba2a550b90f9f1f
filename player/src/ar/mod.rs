//! The match in a picture of a real room: the camera that took it, its depth, the light in it, and rooms drawn by rule.
//!
//! No GPU, file, thread or clock; [`crate::renderer::RealTable`] draws what is described here.

mod camera;
mod holes;
mod light;
mod picture;
#[cfg(any(test, feature = "sample"))]
pub mod synthetic;
mod warp;

pub use camera::{NEAR_M, RoomCamera};
pub use light::RoomLight;
pub use picture::{RoomPicture, RoomPictureError};
