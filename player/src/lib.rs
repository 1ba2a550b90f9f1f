//! Holopitch stream to pixels.
//!
//! [`scene`], [`renderer`], [`camera`] and [`timeline`] use no file, socket, thread or clock and compile for the web.
//! [`source`] fetches and decodes streams, [`app`] is the desktop window, [`offscreen`] draws without a window,
//! [`xr`] draws on a headset.

// Tests may panic: that is how they fail.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod ar;
pub mod camera;
pub mod placement;
pub mod renderer;
pub mod scene;
pub mod timeline;

#[cfg(not(target_arch = "wasm32"))]
pub mod app;
#[cfg(not(target_arch = "wasm32"))]
pub mod offscreen;
#[cfg(not(target_arch = "wasm32"))]
pub mod scan;
#[cfg(not(target_arch = "wasm32"))]
pub mod session;
#[cfg(not(target_arch = "wasm32"))]
pub mod source;
#[cfg(not(target_arch = "wasm32"))]
pub mod xr;
