//! How good the depth network is on rendered players it has not seen, through the same pose, mask and depth code as a clip.
//!
//! Distances from the upright plane are compared on every true player pixel. The tilted plane is the best plane in
//! image x, y per player, fitted to the truth itself: what a perfect guess of position and lean without shape would get.

mod figures;
mod samples;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use glam::DVec2;
use protocol::manifest::PersonId;

use super::{
    npy::NpyError,
    planes::{Point, squares},
};
use crate::{
    depth::{DepthError, DepthEstimator, PoseLifter},
    geometry::{Mask, PixelBox},
    pose::{PoseError, PoseEstimator},
    segmentation::{FrameSeen, PlayerMask, RefiningSegmenter, SegmentationError, Segmenter},
};

use figures::Tally;
pub use figures::{DepthFigures, DepthReport};
use samples::{Sample, Shard, TRUTH};

/// Spread of the edges of the person's box that the pose network is given, of the box's larger side: a detector's.
const BOX_NOISE: f64 = 0.04;

/// Pairs of joints of which one side may be nearer to the camera: elbows, wrists, knees, ankles (left, right).
const LIMBS: [(usize, usize); 4] = [(13, 14), (15, 16), (25, 26), (27, 28)];
/// Limbs that differ by less than this in depth have no order, metres.
const ORDER_M: f64 = 0.1;
/// A joint is seen when the surface before it is at most this far before it, metres.
const FLESH_M: f64 = 0.12;
/// Heights that figures are given for, pixels, each up to the geometric mean with the next.
const HEIGHTS_PX: [f64; 4] = [35.0, 60.0, 100.0, 150.0];

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
    /// The mask network could not be run.
    #[error(transparent)]
    Segmentation(#[from] SegmentationError),
    /// The depth network could not be run.
    #[error(transparent)]
    Depth(#[from] DepthError),
}

/// The networks from the box to the depth map.
struct Networks {
    pose: PoseEstimator,
    masks: RefiningSegmenter,
    lifter: PoseLifter,
    depth: DepthEstimator,
}

/// Measures the shipped networks on the rendered players below `data`; `progress` gets the number of finished players.
///
/// # Errors
/// [`DepthEvaluationError`]; a player that the pose network does not recognise is counted, not an error.
pub fn depth(data: &Path, progress: impl Fn(usize)) -> Result<DepthReport, DepthEvaluationError> {
    let mut networks = Networks {
        pose: PoseEstimator::load()?,
        masks: RefiningSegmenter::load()?,
        lifter: PoseLifter::load()?,
        depth: DepthEstimator::load()?,
    };
    let (mut all, mut failed) = (Tally::default(), 0usize);
    let (mut by_height, mut by_motion) = (BTreeMap::<u32, Tally>::new(), BTreeMap::<String, Tally>::new());
    for folder in samples::shards(data)? {
        let mut shard = Shard::open(&folder)?;
        for index in 0..shard.len() {
            let Some(sample) = shard.sample(index)? else { continue };
            match measure(&mut networks, &sample, (all.players + failed) as u64)? {
                Some(tally) => {
                    all.add(&tally);
                    by_height.entry(height_class(sample.height_px)).or_default().add(&tally);
                    by_motion.entry(sample.motion).or_default().add(&tally);
                }
                None => failed += 1,
            }
            progress(all.players + failed);
        }
    }
    if all.players == 0 {
        return Err(DepthEvaluationError::Empty { path: data.to_path_buf() });
    }
    Ok(DepthReport {
        all: all.figures(),
        failed,
        by_height_px: by_height.into_iter().map(|(height, tally)| (height, tally.figures())).collect(),
        by_motion: by_motion.into_iter().map(|(motion, tally)| (motion, tally.figures())).collect(),
    })
}

/// The one of [`HEIGHTS_PX`] that a height is nearest to by ratio.
fn height_class(height_px: f64) -> u32 {
    let off = |class: f64| (height_px.max(1.0) / class).ln().abs();
    HEIGHTS_PX.into_iter().min_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or_default() as u32
}

/// The tally of one player; `None` when the pose or the depth failed.
fn measure(
    networks: &mut Networks,
    sample: &Sample,
    seed: u64,
) -> Result<Option<Tally>, DepthEvaluationError> {
    let mut people = Vec::new();
    for (place, bounds) in sample.bounds.iter().enumerate() {
        let bounds = as_detected(bounds, seed.wrapping_mul(16).wrapping_add(place as u64));
        match networks.pose.person_in(&sample.image, &bounds)? {
            Some(person) => people.push(person),
            None if place == 0 => return Ok(None),
            None => {}
        }
    }
    let followed = [(PersonId(0), 0)];
    let seen = FrameSeen { index: 0, picture: &sample.image, people: &people, followed: &followed };
    let masks = networks.masks.push(&seen)?;
    let (Some(person), Some(PlayerMask { mask, .. })) = (people.first(), masks.first()) else {
        return Ok(None);
    };
    let Networks { lifter, depth, .. } = networks;
    let (image, view) = (&sample.image, sample.view);
    let surface = lifter.lift(image, view, &person.joints, mask);
    let surface = match surface.and_then(|joints| depth.surface(image, view, &joints, mask)) {
        Ok(surface) => surface,
        Err(error @ DepthError::Inference(_)) => return Err(error.into()),
        Err(_) => return Ok(None),
    };
    let kept = surface.on_mask(mask).mask();
    let mut tally = Tally { players: 1, ..Tally::default() };
    let mut points = Vec::new();
    let (mut ours, mut given) = (Overlap::default(), Overlap::default());
    for (i, &truth) in sample.seen_m.iter().enumerate() {
        let (column, row) = (i % TRUTH, i / TRUTH);
        let pixel = DVec2::new(column as f64, row as f64) * 2.0 + 0.5;
        if let (Some(truth_m), Some(Some(back_m))) = (truth, sample.back_m.get(i)) {
            let [front, back] = surface.offsets_at(pixel);
            points.push(Point { pixel, truth_m, estimate_m: front });
            tally.back += (back - back_m).powi(2);
        }
        let (x, y) = (2 * column as i32, 2 * row as i32);
        ours.count(covered(&kept, x, y), truth.is_some());
        given.count(covered(mask, x, y), truth.is_some());
    }
    tally.squares = squares(&points);
    (tally.iou, tally.given_iou) = (ours.share(), given.share());
    for (left, right) in LIMBS {
        let limb = |joint: usize| {
            let joint = sample.joints.get(joint)?.as_ref()?;
            let truth_m = sample.seen_at(joint.pixel)?;
            (joint.offset_m - truth_m < FLESH_M).then(|| (truth_m, surface.offsets_at(joint.pixel)[0]))
        };
        if let (Some((left_m, ours_left_m)), Some((right_m, ours_right_m))) = (limb(left), limb(right))
            && (left_m - right_m).abs() >= ORDER_M
        {
            tally.limbs += 1;
            tally.limbs_right += usize::from((left_m < right_m) == (ours_left_m < ours_right_m));
        }
    }
    Ok(Some(tally))
}

/// Intersection and union of two masks.
#[derive(Default)]
struct Overlap {
    both: usize,
    either: usize,
}

impl Overlap {
    fn count(&mut self, estimate: bool, truth: bool) {
        self.both += usize::from(estimate && truth);
        self.either += usize::from(estimate || truth);
    }

    fn share(&self) -> f64 {
        self.both as f64 / self.either.max(1) as f64
    }
}

/// Whether a block of 2×2 pixels belongs to the mask more than not.
fn covered(mask: &Mask, x: i32, y: i32) -> bool {
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
}
