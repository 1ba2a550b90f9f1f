//! Putting the match on a table: finding surfaces, fitting the pitch, and the gestures that place it.
//!
//! No GPU, headset, file, thread or clock: sensor data and gestures come in as values, poses go out. Everything is in the
//! *room frame*: metres, right-handed, whatever axes the sensor or the runtime has; `up` is against gravity.

mod cloud;
mod finder;
pub mod fit;
pub mod gesture;
mod map;
mod raster;
mod scanner;
mod source;
mod surface;
#[cfg(any(test, feature = "sample"))]
pub mod synthetic;
mod tabletop;

pub use cloud::{DepthPicture, Intrinsics, PointCloud};
pub use finder::{Finder, Finding, FoundSurface, Noise, Refusal, Up, UpSource};
pub use map::{Change, SurfaceMap};
pub use scanner::Scanner;
pub use source::PlaneSource;
pub use surface::{Plane, Surface, SurfaceId, SurfaceKind};
pub use tabletop::{PITCH_SCALE_LIMITS, TabletopPose};
