//! The truth of a rendered clip as masks and joints are measured on: who is where, which joints, and whose every pixel is.

use std::path::Path;

use glam::{DVec2, DVec3};
use image::GrayImage;
use protocol::camera::Camera;
use serde::Deserialize;

use super::super::frame_truth::{ShotLine, TruthError};
use crate::geometry::PixelBox;

/// One frame.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct TrueFrame {
    pub(super) frame: u32,
    pub(super) camera: Camera,
    pub(super) shot: ShotLine,
    pub(super) people: Vec<TruePerson>,
}

/// Somebody in a frame.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct TruePerson {
    pub(super) id: u32,
    box_px: [f64; 4],
    pub(super) in_view: bool,
    pub(super) visible_share: f64,
    pub(super) anchor_m: DVec3,
    pub(super) joints_px: Vec<DVec2>,
}

impl TruePerson {
    /// The box of the whole person, hidden or not.
    pub(super) fn bounds(&self) -> PixelBox {
        let [left, top, right, bottom] = self.box_px;
        PixelBox { min: DVec2::new(left, top), max: DVec2::new(right, bottom) }
    }

    /// The value of the person's pixels in the map.
    pub(super) fn label(&self) -> Option<u8> {
        u8::try_from(self.id).ok()?.checked_add(1)
    }
}

/// Whose every pixel of a frame is: 0, or id + 1.
pub(super) fn people_map(data: &Path, frame: u32, size: (u32, u32)) -> Result<GrayImage, TruthError> {
    let path = data.join(format!("maps/{frame:06}-people.png"));
    let failed = |reason: String| TruthError::read(&path, format!("{reason} (maps come with --maps)"));
    let reader = image::ImageReader::open(&path).map_err(|error| failed(error.to_string()))?;
    let map = reader.decode().map_err(|error| failed(error.to_string()))?.into_luma8();
    if map.dimensions() != size {
        let (width, height) = map.dimensions();
        return Err(failed(format!("{width}x{height} px, but the clip has {}x{}", size.0, size.1)));
    }
    Ok(map)
}
