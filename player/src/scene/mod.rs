//! What stands on the table: turf, goals, nets, table, people and ball as plain vertex data.
//!
//! World metres as everywhere (origin at the centre mark, x along the touchline, y up, z towards the main camera).
//! The table is built at the pitch's scale around it, so that nothing here knows about the GPU or the tabletop.

mod atlas;
mod ball;
mod frame;
mod goal;
mod primitives;
mod stage;

pub use atlas::{Atlas, AtlasError};
pub use frame::{BodyVertex, FrameScene, Shadow};
pub use primitives::{SolidMesh, SolidVertex};
pub use stage::{GroundMesh, GroundVertex, NetMesh, NetVertex, Stage};

use protocol::pitch::Pitch;

/// A 105 m pitch becomes 1.05 m long: the scale of a table football pitch, 1:100.
pub const TABLETOP_SCALE: f64 = 0.01;

/// Grass around the lines, metres.
pub const APRON_M: f64 = 4.5;

/// Thickness of the turf that lies on the table, metres of the pitch.
pub const TURF_THICKNESS_M: f64 = 0.8;

/// Sizes of the things built around a pitch, metres of the pitch; `x` along its length, `z` along its width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layout {
    /// The pitch itself.
    pub pitch: Pitch,
    /// Half length and half width inside the lines.
    pub half_pitch_m: [f64; 2],
    /// Half length and half width of the turf.
    pub half_turf_m: [f64; 2],
    /// Corner radius of the turf.
    pub turf_corner_m: f64,
    /// Half length and half width of the table top.
    pub half_table_m: [f64; 2],
    /// Corner radius of the table top.
    pub table_corner_m: f64,
    /// Thickness of the table top.
    pub table_thickness_m: f64,
}

impl Layout {
    /// The turf and a table to hold it.
    #[must_use]
    pub fn around(pitch: Pitch) -> Self {
        let half_pitch_m = [pitch.length_m / 2.0, pitch.width_m / 2.0];
        let half_turf_m = half_pitch_m.map(|half| half + APRON_M);
        Self {
            pitch,
            half_pitch_m,
            half_turf_m,
            turf_corner_m: 2.5,
            half_table_m: [half_turf_m[0] + 17.0, half_turf_m[1] + 15.0],
            table_corner_m: 5.0,
            table_thickness_m: 3.6,
        }
    }
}
