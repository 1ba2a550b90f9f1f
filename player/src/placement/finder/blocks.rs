//! Planes of an organised cloud: flat blocks of pixels, grown into regions of one plane.
//!
//! After Feng, Taguchi and Kamat, "Fast plane extraction in organized point clouds using agglomerative hierarchical
//! clustering", ICRA 2014: sums over small blocks first, so that growing never touches single points.

use std::collections::VecDeque;

use glam::DVec3;

use super::{
    moments::{Fit, Moments},
    noise::Noise,
};
use crate::placement::{Plane, PointCloud};

/// Blocks along the longer side of the picture.
const BLOCKS_ACROSS: usize = 80;

/// Fewest blocks of a region that is worth fitting.
const LEAST_BLOCKS: usize = 12;

/// Most regions that are looked at, largest first.
const MOST_REGIONS: usize = 20;

/// Times a Kinect's noise, at most, that is read from a cloud.
const MOST_FACTOR: f64 = 6.0;

/// Share of a block's points that has to be measured, and of those that have to lie on one plane.
const LEAST_SHARE: f64 = 0.6;

/// Cosine of the most grazing angle at which a block is believed.
const LEAST_SLANT: f64 = 0.1;

/// Trios of points that are tried for a block with wild points.
const TRIOS: usize = 16;

#[derive(Clone, Default)]
struct Block {
    moments: Moments,
    fit: Option<Fit>,
    /// Standard deviation of a point across the block's plane, metres.
    sigma_m: f64,
    /// How far its normal may be off, radians.
    turn: f64,
}

/// The picture in blocks.
pub(super) struct BlockGrid {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// The noise that was given, or that the blocks show.
    pub(super) noise: Noise,
    blocks: Vec<Block>,
    /// Against gravity as far as the rows of the picture tell: from its bottom to its top.
    pub(super) picture_up: Option<DVec3>,
}

impl BlockGrid {
    /// Sums up the blocks; `None` for a cloud without rows and columns. Without a given noise the cloud tells
    /// how many times a Kinect's it is.
    pub(super) fn new(cloud: &PointCloud, given: Option<Noise>) -> Option<Self> {
        let (width, height) = cloud.layout()?;
        let side = width.max(height).div_ceil(BLOCKS_ACROSS).max(3);
        let (columns, rows) = (width / side, height / side);
        if columns == 0 || rows == 0 {
            return None;
        }
        let viewpoint = cloud.viewpoint_m();
        let points_of = |index: usize| {
            let first = index / columns * side * width + index % columns * side;
            (0..side).flat_map(move |row| {
                let start = first + row * width;
                let line = cloud.points_m().get(start..start + side).unwrap_or_default();
                line.iter().filter(|point| point.is_finite()).map(|point| point.as_dvec3())
            })
        };
        let full = (side * side) as f64;
        let sums: Vec<Moments> = (0..columns * rows)
            .map(|index| {
                let mut moments = Moments::default();
                points_of(index).for_each(|point| moments.add(point, 1.0));
                moments
            })
            .collect();
        let fit = |moments: &Moments| {
            (moments.weight >= LEAST_SHARE * full).then(|| moments.fit(viewpoint)).flatten()
        };
        let fits: Vec<Option<Fit>> = sums.iter().map(fit).collect();
        let noise = given.unwrap_or_else(|| Noise::Triangulated(measured_factor(cloud, width)));
        let mut wild = Vec::new();
        let blocks = sums
            .into_iter()
            .zip(fits)
            .enumerate()
            .map(|(index, (moments, fit))| {
                let block = Block::new(moments, fit, noise, viewpoint);
                if block.fit.is_some() || fit.is_none() {
                    return block;
                }
                // Wild points or an edge: the plane that most of the points share.
                wild.clear();
                wild.extend(points_of(index));
                match shared_plane(&wild, LEAST_SHARE * full, noise, viewpoint) {
                    Some(moments) => Block::new(moments, moments.fit(viewpoint), noise, viewpoint),
                    None => block,
                }
            })
            .collect();
        let mut grid = Self { columns, rows, noise, blocks, picture_up: None };
        grid.picture_up = grid.find_picture_up(viewpoint);
        Some(grid)
    }

    /// Mean of a block's points; `None` when there are none.
    pub(super) fn mean(&self, index: usize) -> Option<DVec3> {
        self.blocks.get(index).filter(|block| block.moments.weight > 0.0).map(|block| block.moments.mean())
    }

    /// Whether a block's points lie on a plane.
    pub(super) fn is_flat(&self, index: usize) -> bool {
        self.blocks.get(index).is_some_and(|block| block.fit.is_some())
    }

    /// Columns of the picture are upright as far as the camera is: the rays of the upper blocks minus those of the lower.
    fn find_picture_up(&self, viewpoint: DVec3) -> Option<DVec3> {
        let half = self.rows / 2;
        let mut up = DVec3::ZERO;
        for column in 0..self.columns {
            for row in 0..half {
                // The same distance above and below the middle, so that sideways parts cancel.
                let above = self.mean(row * self.columns + column);
                let below = self.mean((self.rows - 1 - row) * self.columns + column);
                if let (Some(above), Some(below)) = (above, below) {
                    up += (above - viewpoint).normalize_or_zero() - (below - viewpoint).normalize_or_zero();
                }
            }
        }
        up.try_normalize()
    }

    /// Neighbours of a block: left, right, above, below.
    pub(super) fn neighbours(&self, index: usize) -> impl Iterator<Item = usize> + use<> {
        let (columns, rows) = (self.columns, self.rows);
        let (column, row) = (index % columns, index / columns);
        [
            (column > 0).then(|| index - 1),
            (column + 1 < columns).then(|| index + 1),
            (row > 0).then(|| index - columns),
            (row + 1 < rows).then(|| index + columns),
        ]
        .into_iter()
        .flatten()
    }

    /// Whether a block lies within the outermost `width` blocks.
    pub(super) fn is_at_border(&self, index: usize, width: usize) -> bool {
        let (column, row) = (index % self.columns, index / self.columns);
        column < width || row < width || column + width >= self.columns || row + width >= self.rows
    }

    /// The first block with points on the way from `from` over its neighbour `next`, at most `steps` on.
    pub(super) fn beyond(&self, from: usize, next: usize, steps: usize) -> Option<usize> {
        let step = next as i64 - from as i64;
        (0..steps as i64)
            .filter_map(|count| usize::try_from(next as i64 + step * count).ok())
            // A step along a row must not wrap into the next one.
            .take_while(|index| {
                step.unsigned_abs() as usize == self.columns || index / self.columns == next / self.columns
            })
            .find(|index| self.mean(*index).is_some())
    }

    /// Grows regions from the flattest blocks; the planes of the larger ones, largest first.
    pub(super) fn planes(&self, viewpoint: DVec3) -> Vec<Fit> {
        let mut seeds: Vec<(usize, f64)> = self
            .blocks
            .iter()
            .enumerate()
            .filter_map(|(index, block)| block.fit.map(|fit| (index, fit.rms_m / block.sigma_m)))
            .collect();
        seeds.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        let mut taken = vec![false; self.blocks.len()];
        let mut regions: Vec<(usize, Fit)> = Vec::new();
        for (seed, _) in seeds {
            if taken.get(seed).copied().unwrap_or(true) {
                continue;
            }
            if let Some((count, fit)) = self.grow(seed, &mut taken, viewpoint)
                && count >= LEAST_BLOCKS
            {
                regions.push((count, fit));
            }
        }
        regions.sort_by_key(|entry| std::cmp::Reverse(entry.0));
        regions.truncate(MOST_REGIONS);
        regions.into_iter().map(|(_, fit)| fit).collect()
    }

    fn grow(&self, seed: usize, taken: &mut [bool], viewpoint: DVec3) -> Option<(usize, Fit)> {
        let first = self.blocks.get(seed)?;
        let mut fit = first.fit?;
        let mut moments = first.moments;
        let (mut count, mut next_fit) = (1_usize, 2_usize);
        let mut front = VecDeque::from([seed]);
        *taken.get_mut(seed)? = true;
        while let Some(index) = front.pop_front() {
            for neighbour in self.neighbours(index) {
                let (Some(block), Some(taken)) = (self.blocks.get(neighbour), taken.get_mut(neighbour))
                else {
                    continue;
                };
                let Some(own) = block.fit else { continue };
                let turned = own.plane.normal.dot(fit.plane.normal).clamp(-1.0, 1.0).acos();
                let off_m = fit.plane.distance_m(own.centroid).abs();
                if *taken || turned > 0.16 + block.turn || off_m > 2.5 * block.sigma_m + 0.003 {
                    continue;
                }
                *taken = true;
                moments.merge(&block.moments);
                count += 1;
                front.push_back(neighbour);
                if count >= next_fit {
                    fit = moments.fit(viewpoint)?;
                    next_fit = count + (count / 4).max(1);
                }
            }
        }
        moments.fit(viewpoint).map(|fit| (count, fit))
    }
}

impl Block {
    fn new(moments: Moments, fit: Option<Fit>, noise: Noise, viewpoint: DVec3) -> Self {
        let mut block = Self { moments, ..Self::default() };
        let Some(fit) = fit else { return block };
        block.sigma_m = noise.across_m(&fit.plane, fit.centroid, viewpoint);
        // A block's width follows from the distance only roughly: a picture of 80 blocks spans about 60 degrees.
        let width_m = fit.centroid.distance(viewpoint) / BLOCKS_ACROSS as f64;
        block.turn = (2.0 * block.sigma_m / width_m).min(0.45);
        let is_flat = fit.rms_m < flat_m(block.sigma_m) && is_seen(&fit.plane, fit.centroid, viewpoint);
        block.fit = is_flat.then_some(fit);
        block
    }
}

/// Root mean square distance up to which points with a standard deviation are flat.
fn flat_m(sigma_m: f64) -> f64 {
    2.0 * sigma_m + 0.0005
}

/// Whether a plane is seen at more than a grazing angle. A block is narrow: one wild point on its ray and the plane along
/// that ray would pass for flat.
fn is_seen(plane: &Plane, point: DVec3, viewpoint: DVec3) -> bool {
    plane.normal.dot((viewpoint - point).normalize_or_zero()).abs() > LEAST_SLANT
}

/// How many times a Kinect's the noise is, at least one: the second difference of three neighbours in a row is nearly free
/// of the shape of what they lie on, and the median of many is free of edges and wild points (Immerkær, "Fast noise
/// variance estimation", CVIU 1996, uses the same idea on pictures).
fn measured_factor(cloud: &PointCloud, width: usize) -> f64 {
    let viewpoint = cloud.viewpoint_m();
    let kinect = Noise::Triangulated(1.0);
    let mut ratios: Vec<f64> = Vec::new();
    for line in cloud.points_m().chunks_exact(width).step_by(5) {
        for trio in line.as_chunks::<3>().0.iter().filter(|trio| trio.iter().all(|point| point.is_finite())) {
            let [a, b, c] = trio.map(|point| point.as_dvec3().distance(viewpoint));
            // The second difference of equal noises has √6 times their deviation; its median size is 0.6745 of that.
            ratios.push((a - 2.0 * b + c).abs() / (1.652 * kinect.along_view_m(b)));
        }
    }
    if ratios.is_empty() {
        return 1.0;
    }
    let place = ratios.len() / 2;
    let (_, ratio, _) = ratios.select_nth_unstable_by(place, f64::total_cmp);
    ratio.clamp(1.0, MOST_FACTOR)
}

/// The moments of those points of a block that lie on one plane, if they are at least `least`: the best of a few planes
/// through three points each, chosen the same way every time.
fn shared_plane(points: &[DVec3], least: f64, noise: Noise, viewpoint: DVec3) -> Option<Moments> {
    let count = points.len();
    let mut best: Option<(usize, Plane, f64)> = None;
    for trio in 0..TRIOS {
        // Steps without a common divisor visit all of the block.
        let at = |place: usize| points.get((trio * 7 + place * (count / 3 + 1)) % count.max(1)).copied();
        let (Some(a), Some(b), Some(c)) = (at(0), at(1), at(2)) else { continue };
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let plane = Plane::through(a, normal);
        if !is_seen(&plane, a, viewpoint) {
            continue;
        }
        let reach_m = flat_m(noise.across_m(&plane, a, viewpoint));
        let on = points.iter().filter(|point| plane.distance_m(**point).abs() < reach_m).count();
        if best.is_none_or(|(most, _, _)| on > most) {
            best = Some((on, plane, reach_m));
        }
    }
    let (_, plane, reach_m) = best.filter(|(on, _, _)| *on as f64 >= least)?;
    let mut moments = Moments::default();
    for point in points.iter().filter(|point| plane.distance_m(**point).abs() < reach_m) {
        moments.add(*point, 1.0);
    }
    Some(moments)
}
