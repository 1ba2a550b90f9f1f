//! The match on a headset through OpenXR: stereo pictures at the runtime's pace, on a table of the room.
//!
//! The loader is found at run time: without one, or without a runtime or a headset, [`run()`] fails with one line and
//! everything else of the player works. Foreign interfaces are in `ffi`; what can be decided without a headset is in
//! modules without one ([`lifecycle`], [`figures`]) and tested there.

mod anchors;
mod connection;
mod cost;
mod error;
mod eyes;
mod ffi;
pub mod figures;
pub mod follow;
pub mod frame_log;
mod frames;
mod headset;
mod input;
pub mod lifecycle;
pub mod panel;
mod panel_layer;
pub mod pinch;
mod planes;
mod profiles;
mod room;
mod run;
mod table;

pub use cost::Cost;
pub use error::XrError;
pub use ffi::clock::thread_cpu_time;
pub use run::{XrFigures, XrOptions, run};
