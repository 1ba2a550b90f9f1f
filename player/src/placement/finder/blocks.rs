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
use crate::placement::PointCloud;

/// Blocks along the longer side of the picture.
const BLOCKS_ACROSS: usize = 80;

/// Fewest blocks of a region that is worth fitting.
const LEAST_BLOCKS: usize = 12;

/// Most regions that are looked at, largest first.
const MOST_REGIONS: usize = 20;

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
    blocks: Vec<Block>,
    /// Against gravity as far as the rows of the picture tell: from its bottom to its top.
    pub(super) picture_up: Option<DVec3>,
}

impl BlockGrid {
    /// Sums up the blocks; `None` for a cloud without rows and columns.
    pub(super) fn new(cloud: &PointCloud, noise: Noise) -> Option<Self> {
        let (width, height) = cloud.layout()?;
        let side = width.max(height).div_ceil(BLOCKS_ACROSS).max(3);
        let (columns, rows) = (width / side, height / side);
        if columns == 0 || rows == 0 {
            return None;
        }
        let viewpoint = cloud.viewpoint_m();
        let mut sums = vec![Moments::default(); columns * rows];
        for (row, line) in cloud.points_m().chunks_exact(width).enumerate().take(rows * side) {
            let first = row / side * columns;
            let row_of_blocks = sums.get_mut(first..first + columns).unwrap_or_default();
            for (moments, points) in row_of_blocks.iter_mut().zip(line.chunks_exact(side)) {
                for point in points.iter().filter(|point| point.is_finite()) {
                    moments.add(point.as_dvec3(), 1.0);
                }
            }
        }
        let full = (side * side) as f64;
        let blocks = sums.into_iter().map(|moments| Block::new(moments, full, noise, viewpoint)).collect();
        let mut grid = Self { columns, rows, blocks, picture_up: None };
        grid.picture_up = grid.find_picture_up(viewpoint);
        Some(grid)
    }

    /// Mean of a block's points; `None` when there are none.
    pub(super) fn mean(&self, index: usize) -> Option<DVec3> {
        self.blocks.get(index).filter(|block| block.moments.weight > 0.0).map(|block| block.moments.mean())
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
    fn new(moments: Moments, full: f64, noise: Noise, viewpoint: DVec3) -> Self {
        let mut block = Self { moments, ..Self::default() };
        if moments.weight < 0.6 * full {
            return block;
        }
        let Some(fit) = moments.fit(viewpoint) else { return block };
        block.sigma_m = noise.across_m(&fit.plane, fit.centroid, viewpoint);
        // A block's width follows from the distance only roughly: a picture of 80 blocks spans about 60 degrees.
        let width_m = fit.centroid.distance(viewpoint) / BLOCKS_ACROSS as f64;
        block.turn = (2.0 * block.sigma_m / width_m).min(0.45);
        block.fit = (fit.rms_m < 2.0 * block.sigma_m + 0.0005).then_some(fit);
        block
    }
}
