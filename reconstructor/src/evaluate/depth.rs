//! How good the depth network is on rendered players it has not seen, through the same pose and depth code as a clip.
//!
//! Distances from the upright plane are compared on every true player pixel. The tilted plane is the best plane in
//! image x, y per player, fitted to the truth itself: what a perfect guess of position and lean without shape would get.

use std::{
    fs::File,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
};

use glam::{DVec2, DVec3};
use image::RgbImage;
use protocol::camera::Camera;
use serde::{Deserialize, Serialize};

use super::{
    npy::{NpyError, NpyFile, NpyType},
    planes::{Point, Squares, squares},
};
use crate::{
    depth::{DepthError, DepthEstimator, View},
    geometry::PixelBox,
    pose::{PoseError, PoseEstimator},
};

/// Side of a crop and its mask, pixels.
const CROP: usize = 256;
/// Side of the true distances: one per 2×2 pixels of the crop.
const TRUTH: usize = 128;
/// In the true distances: no player here.
const OUTSIDE: i16 = i16::MIN;
/// Players of whom fewer pixels of the crop are seen are left out: somebody else stands before them.
const FEWEST_PIXELS: usize = 64;
/// Longest line of `meta.jsonl`.
const MOST_LINE_BYTES: usize = 1 << 16;
/// Spread of the edges of the person's box that the pose network is given, of the box's larger side: a detector's.
const BOX_NOISE: f64 = 0.04;
/// Below this the pose has failed: the reconstructor drops such people.
const POSE_FAILED: f32 = 0.3;

/// The measures over all players, pooled over pixels (DESIGN: depth).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DepthFigures {
    /// Players measured.
    pub players: usize,
    /// Players whose pose or depth failed: not in the figures below.
    pub failed: usize,
    /// Root mean square error of the distance from the upright plane, metres.
    pub rmse_m: f64,
    /// The same after the best scale and translation per player (the paper's st-RMSE), metres.
    pub st_rmse_m: f64,
    /// Error of the upright plane itself, metres.
    pub flat_plane_rmse_m: f64,
    /// Error of the best plane per player, fitted to the truth, metres.
    pub tilted_plane_rmse_m: f64,
    /// Mean intersection over union of the depth map's mask and the true one.
    pub mask_iou: f64,
}

/// Why the measures could not be taken.
#[derive(Debug, thiserror::Error)]
pub enum DepthEvaluationError {
    /// A folder or file could not be read.
    #[error("{}: cannot read: {source}; run `cargo xtask dataset depth-test`", .path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A line of `meta.jsonl` is none of ours.
    #[error("{} line {line}: {reason}; make the data set again", .path.display())]
    Meta {
        /// The file.
        path: PathBuf,
        /// From 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// There is nothing to measure.
    #[error("{}: no player to measure below it; run `cargo xtask dataset depth-test`", .path.display())]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// An array is damaged.
    #[error(transparent)]
    Array(#[from] NpyError),
    /// The pose network could not be run.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// The depth network could not be run.
    #[error(transparent)]
    Depth(#[from] DepthError),
}

/// What is read of a line of `meta.jsonl`.
#[derive(Debug, Deserialize)]
struct Meta {
    camera: Camera,
    /// Clip pixel of the crop's first pixel centre, and clip pixels per crop pixel.
    crop: [f64; 3],
    anchor_m: [f64; 3],
}

/// One rendered player.
struct Sample {
    image: RgbImage,
    /// The box of the true mask, pixels of the crop.
    bounds: PixelBox,
    view: View,
    /// Metres, row by row; `None` outside.
    truth: Vec<Option<f64>>,
}

/// Measures the shipped networks on the rendered players below `data`; `progress` gets the number of finished players.
///
/// # Errors
/// [`DepthEvaluationError`]; a player that the pose network does not recognise is counted, not an error.
pub fn depth(data: &Path, progress: impl Fn(usize)) -> Result<DepthFigures, DepthEvaluationError> {
    let mut pose = PoseEstimator::load()?;
    let mut estimator = DepthEstimator::load()?;
    let (mut sums, mut iou_sum, mut players, mut failed) = (Squares::default(), 0.0, 0usize, 0usize);
    for folder in shards(data)? {
        let mut shard = Shard::open(&folder)?;
        for index in 0..shard.meta.len() {
            let Some(sample) = shard.sample(index)? else { continue };
            match measure(&mut pose, &mut estimator, &sample, (players + failed) as u64)? {
                Some((squares, iou)) => {
                    sums.add(squares);
                    iou_sum += iou;
                    players += 1;
                }
                None => failed += 1,
            }
            progress(players + failed);
        }
    }
    if players == 0 {
        return Err(DepthEvaluationError::Empty { path: data.to_path_buf() });
    }
    Ok(DepthFigures {
        players,
        failed,
        rmse_m: sums.root_mean(sums.error),
        st_rmse_m: sums.root_mean(sums.scaled),
        flat_plane_rmse_m: sums.root_mean(sums.flat),
        tilted_plane_rmse_m: sums.root_mean(sums.tilted),
        mask_iou: iou_sum / players as f64,
    })
}

/// Squares and mask overlap of one player; `None` when the pose or the depth failed.
fn measure(
    pose: &mut PoseEstimator,
    estimator: &mut DepthEstimator,
    sample: &Sample,
    seed: u64,
) -> Result<Option<(Squares, f64)>, DepthEvaluationError> {
    let bounds = as_detected(&sample.bounds, seed);
    let Some(look) = pose.look(&sample.image, &bounds)?.filter(|look| look.score >= POSE_FAILED) else {
        return Ok(None);
    };
    let surface = match estimator.surface(&sample.image, sample.view, &look.joints, &look.mask) {
        Ok(surface) => surface,
        Err(error @ DepthError::Inference(_)) => return Err(error.into()),
        Err(_) => return Ok(None),
    };
    let map = surface.on_mask(&look.mask);
    let mut points = Vec::new();
    let (mut both, mut either) = (0usize, 0usize);
    for (i, &truth) in sample.truth.iter().enumerate() {
        let (column, row) = (i % TRUTH, i / TRUTH);
        let pixel = DVec2::new(column as f64, row as f64) * 2.0 + 0.5;
        if let Some(truth_m) = truth {
            points.push(Point { pixel, truth_m, estimate_m: surface.offset_at(pixel) });
        }
        let kept = covered(&map.mask, 2 * column as i32, 2 * row as i32);
        both += usize::from(kept && truth.is_some());
        either += usize::from(kept || truth.is_some());
    }
    Ok(Some((squares(&points), both as f64 / either.max(1) as f64)))
}

/// Whether a block of 2×2 pixels belongs to the mask more than not.
fn covered(mask: &crate::geometry::Mask, x: i32, y: i32) -> bool {
    let sum: u32 =
        [(0, 0), (1, 0), (0, 1), (1, 1)].iter().map(|&(i, j)| u32::from(mask.at(x + i, y + j))).sum();
    sum >= 4 * 128
}

/// The true box with its edges moved as a detector's would be, the same way in every run.
fn as_detected(bounds: &PixelBox, seed: u64) -> PixelBox {
    let spread = BOX_NOISE * bounds.size().max_element();
    // The sum of uniform numbers: near enough to the normal distribution, and bounded.
    let noise = |edge: u64| {
        let parts = (0..12).map(|part| uniform(seed.wrapping_mul(97).wrapping_add(edge * 12 + part)));
        (parts.sum::<f64>() - 6.0) * spread
    };
    PixelBox {
        min: bounds.min + DVec2::new(noise(0), noise(1)),
        max: bounds.max + DVec2::new(noise(2), noise(3)),
    }
}

/// A number 0..1 from a seed (SplitMix64).
fn uniform(seed: u64) -> f64 {
    let mut z = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// The folders below `data` (itself included) that hold a `meta.jsonl`, in order of their names.
fn shards(data: &Path) -> Result<Vec<PathBuf>, DepthEvaluationError> {
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
struct Shard {
    meta: Vec<Meta>,
    crops: NpyFile,
    masks: NpyFile,
    offsets: NpyFile,
}

impl Shard {
    fn open(folder: &Path) -> Result<Self, DepthEvaluationError> {
        Ok(Self {
            meta: read_meta(&folder.join("meta.jsonl"))?,
            crops: NpyFile::open(&folder.join("crops.npy"), NpyType::U8, &[CROP, CROP, 3])?,
            masks: NpyFile::open(&folder.join("mask.npy"), NpyType::U8, &[CROP, CROP])?,
            offsets: NpyFile::open(&folder.join("offset_mm.npy"), NpyType::I16, &[TRUTH, TRUTH])?,
        })
    }

    /// `None` when the player is hidden or stands nowhere.
    fn sample(&mut self, index: usize) -> Result<Option<Sample>, DepthEvaluationError> {
        let Some(meta) = self.meta.get(index) else { return Ok(None) };
        let view = View::from_camera(&meta.camera, DVec3::from(meta.anchor_m));
        let Some(view) = view.filter(|_| meta.crop[2] > 0.0) else { return Ok(None) };
        let view = View { pixels_per_metre: view.pixels_per_metre / meta.crop[2], ..view };
        let mask = self.masks.sample(index)?;
        let mut bounds: Option<PixelBox> = None;
        let inside = mask.iter().enumerate().filter(|&(_, &c)| c >= 128);
        for (i, _) in inside.clone() {
            let pixel = DVec2::new((i % CROP) as f64, (i / CROP) as f64);
            let b = bounds.unwrap_or(PixelBox { min: pixel, max: pixel });
            bounds = Some(PixelBox { min: b.min.min(pixel), max: b.max.max(pixel) });
        }
        let Some(bounds) = bounds.filter(|_| inside.count() >= FEWEST_PIXELS) else { return Ok(None) };
        let crop = self.crops.sample(index)?;
        let Some(image) = RgbImage::from_raw(CROP as u32, CROP as u32, crop) else { return Ok(None) };
        let offsets = self.offsets.sample(index)?;
        let truth = offsets
            .chunks_exact(2)
            .map(|pair| match i16::from_le_bytes([pair[0], pair[1]]) {
                OUTSIDE => None,
                millimetres => Some(f64::from(millimetres) / 1000.0),
            })
            .collect();
        Ok(Some(Sample { image, bounds, view, truth }))
    }
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
    fn boxes_move_a_little_and_always_the_same_way() {
        let bounds = PixelBox { min: DVec2::splat(20.0), max: DVec2::new(120.0, 220.0) };
        let moved: Vec<PixelBox> = (0..200).map(|seed| as_detected(&bounds, seed)).collect();
        assert_eq!(moved[7], as_detected(&bounds, 7));
        let shifts: Vec<f64> = moved.iter().map(|b| b.min.x - 20.0).collect();
        let spread = (shifts.iter().map(|s| s * s).sum::<f64>() / 200.0).sqrt();
        assert!((spread - 8.0).abs() < 1.5, "spread {spread} px of 8 px expected");
    }

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
