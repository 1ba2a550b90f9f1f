//! Clip to stream: the pipeline of "Soccer on Your Tabletop" (Rematas et al., CVPR 2018), one module per section.
//!
//! `ingest → shots → detection → calibration → pose → tracking → teams → numbers → jumps → ball → segmentation → depth → mesh → trajectory → motion → encode`.
//! A stage is one entry function with typed input and output; no stage imports a later one.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod assignment;
pub mod ball;
mod banded;
pub mod calibration;
pub mod depth;
pub mod detection;
pub mod encode;
pub mod evaluate;
pub mod geometry;
pub mod inference;
pub mod ingest;
pub mod jumps;
pub mod mesh;
pub mod motion;
pub mod numbers;
pub mod overlay;
pub mod pipeline;
pub mod pose;
pub mod report;
pub mod segmentation;
pub mod shots;
mod surface;
pub mod teams;
pub mod tracking;
pub mod trajectory;
