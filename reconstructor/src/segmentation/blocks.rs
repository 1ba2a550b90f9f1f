//! A player's crops over a block of frames: kept until the block is full, then decided together. What is in memory is bounded by the
//! people in view, the block's length and the size of a crop.

use std::collections::BTreeMap;

use glam::DVec2;
use protocol::manifest::PersonId;

use super::{
    crf::{self, Cell},
    grid::Grid,
};
use crate::{geometry::Mask, tracking::Sighting};

/// Frames that are decided together, as in the paper.
const BLOCK: usize = 15;
/// Crops of a block are in the same shot and follow each other within this many frames, else a new block begins.
const GAP_FRAMES: usize = 15;

/// One player in one frame.
#[derive(Clone, Debug)]
pub(super) struct Crop {
    pub(super) sighting: Sighting,
    pub(super) picture: (u32, u32),
    pub(super) grid: Grid,
    pub(super) colours: Vec<[f32; 3]>,
    /// The network's probability in every cell.
    pub(super) unary: Vec<f32>,
    /// What the result is multiplied by in every cell.
    pub(super) gate: Option<Vec<f32>>,
    /// The point that is brought to the same place in all crops, pixels of the clip, and the body's height there.
    pub(super) neck_px: DVec2,
    pub(super) height_px: f64,
}

impl Crop {
    /// The mask of decided cells.
    pub(super) fn mask(&self, values: &[f32]) -> Mask {
        let gated: Vec<f32> = match &self.gate {
            Some(gate) => values.iter().zip(gate).map(|(value, gate)| value * gate).collect(),
            None => values.to_vec(),
        };
        self.grid.mask(&gated, self.picture)
    }

    fn cells(&self, first_frame: usize) -> impl Iterator<Item = Cell> {
        let height = if self.height_px > 1.0 { self.height_px } else { 1.0 };
        let time_frames = (self.sighting.frame - first_frame) as f32;
        self.colours.iter().zip(&self.unary).enumerate().map(move |(i, (colour, unary))| {
            let place = (self.grid.centre(i) - self.neck_px) / height;
            Cell { place: [place.x as f32, place.y as f32], time_frames, colour: *colour, unary: *unary }
        })
    }
}

/// The open block of everybody.
#[derive(Clone, Debug, Default)]
pub(super) struct Blocks {
    open: BTreeMap<PersonId, Vec<Crop>>,
}

impl Blocks {
    /// Adds a crop; gives what is decided by that.
    pub(super) fn push(&mut self, person: PersonId, crop: Crop) -> Vec<(Sighting, Mask)> {
        let block = self.open.entry(person).or_default();
        let frame = crop.sighting.frame;
        let far = block
            .last()
            .is_some_and(|last| frame <= last.sighting.frame || frame - last.sighting.frame > GAP_FRAMES);
        let mut done = if far { decide(&std::mem::take(block)) } else { Vec::new() };
        block.push(crop);
        if block.len() >= BLOCK {
            done.extend(decide(&std::mem::take(block)));
        }
        done
    }

    /// Decides the blocks of people who were not seen for a while; all of them when `now` is `None`.
    pub(super) fn settle(&mut self, now: Option<usize>) -> Vec<(Sighting, Mask)> {
        let over = |block: &[Crop]| match (now, block.last()) {
            (Some(now), Some(last)) => now > last.sighting.frame + GAP_FRAMES,
            _ => true,
        };
        let gone: Vec<PersonId> =
            self.open.iter().filter(|(_, block)| over(block)).map(|(id, _)| *id).collect();
        gone.iter().filter_map(|id| self.open.remove(id)).flat_map(|block| decide(&block)).collect()
    }
}

fn decide(block: &[Crop]) -> Vec<(Sighting, Mask)> {
    let Some(first) = block.first() else { return Vec::new() };
    let cells: Vec<Cell> = block.iter().flat_map(|crop| crop.cells(first.sighting.frame)).collect();
    let mut belief = crf::infer(&cells).into_iter();
    block
        .iter()
        .map(|crop| {
            let own: Vec<f32> = belief.by_ref().take(crop.colours.len()).collect();
            (crop.sighting, crop.mask(&own))
        })
        .collect()
}
