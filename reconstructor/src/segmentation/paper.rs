//! The paper's segmentation and its parts: the mask network's probability, times the energy's mask, smoothed by the temporal CRF.

use super::{
    FrameSeen, PlayerMask, SegmentationError, Segmenter,
    blocks::{Blocks, Crop},
    energy, exclusive,
};
use crate::{geometry::Mask, pose::Person, tracking::Sighting};

/// Rows of a crop at most: the larger players of a close view are solved on coarser cells.
const ROWS_MAX: usize = 96;

/// What is used besides the mask network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parts {
    /// The pose-seeded energy, Mₒ.
    pub energy: bool,
    /// The CRF over 15 frames, M_CNN.
    pub crf: bool,
}

/// The paper's method, streaming: up to 15 crops of everybody in view are kept.
#[derive(Clone, Debug)]
pub struct PaperSegmenter {
    parts: Parts,
    blocks: Blocks,
}

impl PaperSegmenter {
    /// With some of its parts.
    #[must_use]
    pub fn new(parts: Parts) -> Self {
        Self { parts, blocks: Blocks::default() }
    }

    fn crop(&self, seen: &FrameSeen<'_>, person_index: usize, person: &Person) -> Option<Crop> {
        let (grid, colours) = energy::crop(seen.picture, person, ROWS_MAX)?;
        let bounds = grid.bounds();
        let near = seen.others(person_index).filter(|other| exclusive::boxes_touch(&other.bounds, &bounds));
        let gate = self.parts.energy.then(|| {
            // Without a seed of its own nothing can grow; the mask network's word stays.
            let values = energy::association(&grid, &colours, person, near)?;
            Some(values.iter().map(|o| f32::from(u8::from(*o < energy::THRESHOLD))).collect())
        });
        Some(Crop {
            sighting: Sighting { frame: seen.index, person_index },
            picture: seen.picture.dimensions(),
            grid,
            colours,
            unary: grid.coverage(&person.mask),
            gate: gate.flatten(),
            neck_px: person.neck_px,
            height_px: person.bounds.size().y,
        })
    }
}

impl Segmenter for PaperSegmenter {
    fn push(&mut self, seen: &FrameSeen<'_>) -> Result<Vec<PlayerMask>, SegmentationError> {
        let mut done = player_masks(self.blocks.settle(Some(seen.index)));
        for (id, person_index, person) in seen.tracked() {
            let sighting = Sighting { frame: seen.index, person_index };
            match self.crop(seen, person_index, person) {
                Some(crop) if self.parts.crf => done.extend(player_masks(self.blocks.push(id, crop))),
                Some(crop) => done.push(PlayerMask { sighting, mask: crop.mask(&crop.unary) }),
                None => done.push(PlayerMask { sighting, mask: Mask::default() }),
            }
        }
        Ok(done)
    }

    fn finish(&mut self) -> Result<Vec<PlayerMask>, SegmentationError> {
        Ok(player_masks(self.blocks.settle(None)))
    }
}

fn player_masks(decided: Vec<(Sighting, Mask)>) -> Vec<PlayerMask> {
    decided.into_iter().map(|(sighting, mask)| PlayerMask { sighting, mask }).collect()
}
