//! Rendered football with ground truth: bodies, motion, stadium and broadcast camera.
//!
//! [`dataset`] writes training pictures of single players with their depth; [`synthesize`] renders a whole broadcast
//! clip with the truth of every frame. Everything is deterministic: the same options give the same bytes.

// Tests may panic: that is how they fail.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

use std::path::PathBuf;

pub mod acts;
pub mod body;
pub mod bystanders;
pub mod cast;
pub mod chain;
pub mod clip;
pub mod correspondences;
mod course;
pub mod crowd;
pub mod dataset;
mod daylight;
pub mod figure;
pub mod fixture;
pub mod flight;
mod footing;
pub mod furniture;
pub mod gait;
pub mod generated;
mod grounds;
mod landmarks;
pub mod legs;
pub mod lettering;
pub mod limits;
pub mod motion;
pub mod movement;
pub mod nets;
mod noise;
mod npy;
pub mod operator;
pub mod outfit;
pub mod output;
pub mod overlay;
mod packed;
pub mod paint;
pub mod play;
pub mod props;
pub mod raster;
pub mod rays;
pub mod recordings;
pub mod render;
pub mod rig;
pub mod sensor;
mod shading;
mod shadows;
pub mod shots;
pub mod shutter;
pub mod stadium;
mod stands;
pub mod trajectories;
pub mod truth;
pub mod turf;
pub mod venue;
pub mod video;
pub mod view;
pub mod wardrobe;

pub use clip::{Options, Synthesized, synthesize};

/// Why something could not be rendered or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SynthesisError {
    /// A baked asset is broken.
    #[error("{what}: {reason}")]
    Asset {
        /// Which file or array.
        what: String,
        /// What is wrong with it and what to do.
        reason: String,
    },
    /// A file could not be read or written.
    #[error("cannot {doing} {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// "read", "write" or "create".
        doing: &'static str,
        /// Why.
        source: std::io::Error,
    },
    /// A picture could not be encoded or decoded.
    #[error("cannot encode a picture: {0}")]
    Picture(image::ImageError),
    /// The video encoder could not be used.
    #[error("cannot encode the video with the program `ffmpeg`: {0}; install it (`cargo xtask setup` does)")]
    Encoder(std::io::Error),
    /// The options contradict each other.
    #[error("{0}")]
    Options(String),
}
