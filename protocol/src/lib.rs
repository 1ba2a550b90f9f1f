//! The Holopitch stream: what is in it, how it is written and read, and how it is played back.
//!
//! No I/O, no clock, no GPU: bytes and moments come in from the caller. Compiles for `wasm32-unknown-unknown`.

// Tests may panic: that is how they fail.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod atlas;
pub mod camera;
pub mod chunk;
pub mod compact;
pub mod content;
pub mod glb;
pub mod gltf;
pub mod hash;
pub mod limits;
pub mod manifest;
pub mod mesh;
pub mod pitch;
pub mod playback;
#[cfg(any(test, feature = "sample"))]
pub mod sample;
pub mod time;
