//! Every figure that Holopitch states about itself is computed here, by the definitions of the design's section on
//! measures; one module per measure.

pub mod calibration;
pub mod depth;
pub mod detection;
pub mod labelled;
pub mod matches;
pub mod npy;
pub mod planes;
pub mod realism;
mod surface;
