//! Every figure that Holopitch states about itself is computed here, by the definitions of the design's section on
//! measures; one module per measure.

pub mod air;
pub mod ball;
mod baseline;
pub mod calibration;
pub mod depth;
pub mod detection;
pub mod flicker;
pub mod frame_truth;
pub mod jumps;
pub mod labelled;
pub mod matches;
pub mod npy;
pub mod planes;
pub mod realism;
pub mod segmentation;
pub mod simulated;
pub mod stream;
pub mod stream_plot;
pub mod tracking;
