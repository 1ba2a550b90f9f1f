//! Rendered players as `dataset depth` wrote them.

use std::{
    fs::File,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
};

use glam::{DVec2, DVec3};
use image::RgbImage;
use protocol::camera::Camera;
use serde::Deserialize;

use super::{
    super::npy::{NpyFile, NpyType},
    DepthEvaluationError,
};
use crate::{depth::View, geometry::PixelBox, mesh::VirtualPlane};

/// Side of a crop and its mask, pixels.
const CROP: usize = 256;
/// Side of the true distances: one per 2×2 pixels of the crop.
pub(super) const TRUTH: usize = 128;
/// In the true distances: no player here.
const OUTSIDE: i16 = i16::MIN;
/// Players of whom fewer pixels of the crop are seen are left out: somebody else stands before them.
const FEWEST_PIXELS: usize = 64;
/// Longest line of `meta.jsonl`.
const MOST_LINE_BYTES: usize = 1 << 16;
/// Others in a crop that are looked at.
const MOST_OTHERS: usize = 8;

/// What is read of a line of `meta.jsonl`.
#[derive(Debug, Deserialize)]
struct Meta {
    camera: Camera,
    /// Clip pixel of the crop's first pixel centre, and clip pixels per crop pixel.
    crop: [f64; 3],
    anchor_m: [f64; 3],
    motion: String,
    height_px: f64,
    others_px: Vec<[f64; 4]>,
    joints_px: Vec<[f64; 2]>,
    joints_m: Vec<[f64; 3]>,
}

impl Meta {
    /// A pixel of the clip as one of the crop.
    fn to_crop(&self, pixel: DVec2) -> DVec2 {
        let [x, y, scale] = self.crop;
        (pixel - DVec2::new(x, y)) / scale
    }
}

/// A joint of the truth.
pub(super) struct TrueJoint {
    /// Pixel of the crop.
    pub(super) pixel: DVec2,
    /// Behind the upright plane, metres.
    pub(super) offset_m: f64,
}

/// One rendered player.
pub(super) struct Sample {
    pub(super) image: RgbImage,
    /// The boxes of the whole player and of the others in the crop, pixels of the crop.
    pub(super) bounds: Vec<PixelBox>,
    pub(super) view: View,
    /// Distance of what is seen of the player, metres, row by row; `None` outside.
    pub(super) seen_m: Vec<Option<f64>>,
    /// Distance of the player's last surface.
    pub(super) back_m: Vec<Option<f64>>,
    pub(super) joints: Vec<Option<TrueJoint>>,
    pub(super) motion: String,
    pub(super) height_px: f64,
}

impl Sample {
    /// Distance of what is seen of the player at a pixel of the crop.
    pub(super) fn seen_at(&self, pixel: DVec2) -> Option<f64> {
        let cell = ((pixel - 0.5) / 2.0).round();
        let inside = cell.cmpge(DVec2::ZERO).all() && cell.cmplt(DVec2::splat(TRUTH as f64)).all();
        inside.then(|| self.seen_m.get(cell.y as usize * TRUTH + cell.x as usize).copied().flatten())?
    }
}

/// The folders below `data` (itself included) that hold a `meta.jsonl`, in order of their names.
pub(super) fn shards(data: &Path) -> Result<Vec<PathBuf>, DepthEvaluationError> {
    let io = |source| DepthEvaluationError::Io { path: data.to_path_buf(), source };
    let mut folders = vec![data.to_path_buf()];
    for entry in std::fs::read_dir(data).map_err(io)? {
        folders.push(entry.map_err(io)?.path());
    }
    folders.retain(|folder| folder.join("meta.jsonl").is_file());
    folders.sort();
    if folders.is_empty() {
        return Err(DepthEvaluationError::Empty { path: data.to_path_buf() });
    }
    Ok(folders)
}

/// A folder of samples.
pub(super) struct Shard {
    meta: Vec<Meta>,
    crops: NpyFile,
    masks: NpyFile,
    offsets: NpyFile,
    fronts: NpyFile,
    backs: NpyFile,
}

impl Shard {
    /// Players in it, whoever is hidden too.
    pub(super) fn len(&self) -> usize {
        self.meta.len()
    }

    /// Opens the files of a folder.
    pub(super) fn open(folder: &Path) -> Result<Self, DepthEvaluationError> {
        Ok(Self {
            meta: read_meta(&folder.join("meta.jsonl"))?,
            crops: NpyFile::open(&folder.join("crops.npy"), NpyType::U8, &[CROP, CROP, 3])?,
            masks: NpyFile::open(&folder.join("mask.npy"), NpyType::U8, &[CROP, CROP])?,
            offsets: NpyFile::open(&folder.join("offset_mm.npy"), NpyType::I16, &[TRUTH, TRUTH])?,
            fronts: NpyFile::open(&folder.join("front_mm.npy"), NpyType::I16, &[TRUTH, TRUTH])?,
            backs: NpyFile::open(&folder.join("back_mm.npy"), NpyType::I16, &[TRUTH, TRUTH])?,
        })
    }

    /// `None` when the player is hidden or stands nowhere.
    pub(super) fn sample(&mut self, index: usize) -> Result<Option<Sample>, DepthEvaluationError> {
        let Some(meta) = self.meta.get(index) else { return Ok(None) };
        let view = View::from_camera(&meta.camera, DVec3::from(meta.anchor_m));
        let Some(view) = view.filter(|_| meta.crop[2] > 0.0) else { return Ok(None) };
        let view = View { pixels_per_metre: view.pixels_per_metre / meta.crop[2], ..view };
        let mask = self.masks.sample(index)?;
        if mask.iter().filter(|&&coverage| coverage >= 128).count() < FEWEST_PIXELS {
            return Ok(None);
        }
        let mut bounds: Option<PixelBox> = None;
        for (i, _) in metres(&self.fronts.sample(index)?).iter().enumerate().filter(|(_, m)| m.is_some()) {
            let pixel = DVec2::new((i % TRUTH) as f64, (i / TRUTH) as f64) * 2.0;
            let b = bounds.unwrap_or(PixelBox { min: pixel, max: pixel + 1.0 });
            bounds = Some(PixelBox { min: b.min.min(pixel), max: b.max.max(pixel + 1.0) });
        }
        let Some(bounds) = bounds else { return Ok(None) };
        let others = meta.others_px.iter().take(MOST_OTHERS).map(|&[left, top, right, bottom]| PixelBox {
            min: meta.to_crop(DVec2::new(left, top)),
            max: meta.to_crop(DVec2::new(right, bottom)),
        });
        let plane = VirtualPlane::new(&meta.camera, DVec3::from(meta.anchor_m));
        let joints = meta.joints_px.iter().zip(&meta.joints_m).map(|(&pixel, &world)| {
            let (_, offset_m) = plane.as_ref()?.offset(DVec3::from(world))?;
            Some(TrueJoint { pixel: meta.to_crop(DVec2::from(pixel)), offset_m })
        });
        let (bounds, joints) = (std::iter::once(bounds).chain(others).collect(), joints.collect());
        let (motion, height_px) = (meta.motion.clone(), meta.height_px);
        let crop = self.crops.sample(index)?;
        let Some(image) = RgbImage::from_raw(CROP as u32, CROP as u32, crop) else { return Ok(None) };
        let seen_m = metres(&self.offsets.sample(index)?);
        let back_m = metres(&self.backs.sample(index)?);
        Ok(Some(Sample { image, bounds, view, seen_m, back_m, joints, motion, height_px }))
    }
}

/// Little-endian millimetres as metres.
fn metres(bytes: &[u8]) -> Vec<Option<f64>> {
    let values = bytes.chunks_exact(2).map(|pair| match i16::from_le_bytes([pair[0], pair[1]]) {
        OUTSIDE => None,
        millimetres => Some(f64::from(millimetres) / 1000.0),
    });
    values.collect()
}

fn read_meta(path: &Path) -> Result<Vec<Meta>, DepthEvaluationError> {
    let io = |source| DepthEvaluationError::Io { path: path.to_path_buf(), source };
    let mut lines = Vec::new();
    for (i, line) in BufReader::new(File::open(path).map_err(io)?).lines().enumerate() {
        let line = line.map_err(io)?;
        let wrong =
            |reason: String| DepthEvaluationError::Meta { path: path.to_path_buf(), line: i + 1, reason };
        if line.len() > MOST_LINE_BYTES {
            return Err(wrong(format!("longer than {MOST_LINE_BYTES} bytes")));
        }
        lines.push(serde_json::from_str(&line).map_err(|e| wrong(e.to_string()))?);
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_without_samples_and_a_broken_line_are_named() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(shards(folder.path()), Err(DepthEvaluationError::Empty { .. })));
        let path = folder.path().join("meta.jsonl");
        std::fs::write(&path, "{\"camera\": 3}\n").unwrap();
        let message = read_meta(&path).unwrap_err().to_string();
        assert!(message.contains("meta.jsonl line 1"), "{message}");
    }
}
