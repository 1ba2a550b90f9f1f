//! What travels, in the order of its fields, as postcard writes it (<https://postcard.jamesmunns.com/wire-format>).

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::{
    camera::Camera,
    chunk::{Ball, BallSpread, ChunkFrame, FrameQuality},
    time::{Ticks, Timescale},
};

/// Anchors are whole multiples of this, metres.
pub(super) const ANCHOR_STEP_M: f32 = 1.0 / 1024.0;

/// Anchors farther away than this along an axis are nowhere near a pitch, metres.
pub(super) const FARTHEST_M: f32 = 10_000.0;

/// Everything that is not of one run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Head {
    pub(super) timescale: Timescale,
    pub(super) frames: Vec<Frame>,
    pub(super) runs: Vec<RunHead>,
    /// Shares of 4096 of the symbols of each entropy context.
    pub(super) tables: Vec<Vec<u16>>,
}

/// A frame without its bodies.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Frame {
    clip_frame: u32,
    start: Ticks,
    duration: Ticks,
    camera: Option<WireCamera>,
    quality: FrameQuality,
    ball: Option<WireBall>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct WireCamera {
    size_px: [u32; 2],
    focal_px: f64,
    k1: f64,
    rotation: [f64; 9],
    position: [f64; 3],
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct WireBall {
    position_m: [f64; 3],
    height_known: bool,
    spread_m: Option<[f32; 2]>,
}

/// Who a run is of, when, where, and how large its texture is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct RunHead {
    pub(super) person: u32,
    /// Place of the first frame in the chunk, then steps to the next ones.
    pub(super) frames: Vec<u16>,
    /// The first anchor, then the differences of those after, in [`ANCHOR_STEP_M`].
    pub(super) anchors: Vec<[i32; 3]>,
    pub(super) texture_px: [u16; 2],
    pub(super) guessed_from_u: Option<f32>,
}

/// How the mesh of a run moves.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Motion<'a> {
    /// Size of a step of the points' shares, metres; and of the texture's, of 255.
    pub(super) point_step_m: f32,
    pub(super) texture_step: f32,
    /// Values of the waves of points and of the texture: wave by wave, a value per frame, in 32767ths.
    pub(super) point_waves: Vec<i16>,
    pub(super) texture_waves: Vec<i16>,
    /// A bit per tile of the texture, row by row, lowest bit first: whether it is stored.
    pub(super) tiles: &'a [u8],
    /// The shares, entropy-coded.
    pub(super) coded: &'a [u8],
}

impl From<&ChunkFrame> for Frame {
    fn from(frame: &ChunkFrame) -> Self {
        Self {
            clip_frame: frame.clip_frame,
            start: frame.start,
            duration: frame.duration,
            camera: frame.camera.map(|camera| WireCamera {
                size_px: [camera.width_px, camera.height_px],
                focal_px: camera.focal_px,
                k1: camera.k1,
                rotation: camera.rotation.to_cols_array(),
                position: camera.position.to_array(),
            }),
            quality: frame.quality,
            ball: frame.ball.map(|ball| WireBall {
                position_m: ball.position_m.to_array(),
                height_known: ball.height_known,
                spread_m: ball.spread.map(|spread| [spread.along_m, spread.across_m]),
            }),
        }
    }
}

impl From<Frame> for ChunkFrame {
    fn from(frame: Frame) -> Self {
        Self {
            clip_frame: frame.clip_frame,
            start: frame.start,
            duration: frame.duration,
            camera: frame.camera.map(|camera| Camera {
                width_px: camera.size_px[0],
                height_px: camera.size_px[1],
                focal_px: camera.focal_px,
                k1: camera.k1,
                rotation: DMat3::from_cols_array(&camera.rotation),
                position: DVec3::from(camera.position),
            }),
            quality: frame.quality,
            ball: frame.ball.map(|ball| Ball {
                position_m: DVec3::from(ball.position_m),
                height_known: ball.height_known,
                spread: ball.spread_m.map(|[along_m, across_m]| BallSpread { along_m, across_m }),
            }),
            atlas: None,
            bodies: Vec::new(),
        }
    }
}
