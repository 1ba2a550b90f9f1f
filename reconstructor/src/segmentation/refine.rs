//! Masks by a small network of our own: it sees a window around one person (picture, the pose network's mask and skeleton of that person, and
//! those of everybody in front and behind) and says which cells are that person's and not hidden.
//!
//! It was trained on windows made in exactly this way by `training/masks/view.py`: change both or none.

use super::{
    FrameSeen, PlayerMask, SegmentationError, Segmenter,
    energy::feet_px,
    exclusive::{Claim, boxes_touch},
    grid::Grid,
};
use crate::{
    geometry::{Mask, PixelBox},
    inference::Model,
    pose::Person,
    tracking::Sighting,
};

/// File name of the network in `assets/models`.
pub const MODEL: &str = "masks.onnx";

const ROWS: usize = 96;
const COLUMNS: usize = 64;
/// The window is this much larger than the person's box.
const MARGIN: f64 = 1.25;
/// Red, green, blue; own mask and bones; those of people in front; of people behind.
const CHANNELS: usize = 9;
const OWN: usize = 3;
const FRONT: usize = 5;
const BEHIND: usize = 7;

/// The network, ready to run on one thread. It looks at each frame alone: masks come with their frame.
#[derive(Debug)]
pub struct RefiningSegmenter {
    model: Model,
}

impl RefiningSegmenter {
    /// Loads the shipped network.
    ///
    /// # Errors
    /// When ONNX Runtime or the model file is missing or unusable.
    pub fn load() -> Result<Self, SegmentationError> {
        Ok(Self { model: Model::load_shipped(MODEL)? })
    }

    fn mask(
        &mut self,
        seen: &FrameSeen<'_>,
        index: usize,
        person: &Person,
    ) -> Result<Mask, SegmentationError> {
        let Some(grid) = window(&person.bounds) else { return Ok(Mask::default()) };
        let input = network_input(&grid, seen, index, person);
        let outputs = self.model.run(&[(&[1, CHANNELS, ROWS, COLUMNS], &input)])?;
        match outputs.as_slice() {
            [own] if own.data.len() == grid.len() => Ok(grid.mask(&own.data, seen.picture.dimensions())),
            _ => Err(self.model.unexpected(&format!("one map of {ROWS}×{COLUMNS}"), &outputs).into()),
        }
    }
}

impl Segmenter for RefiningSegmenter {
    fn push(&mut self, seen: &FrameSeen<'_>) -> Result<Vec<PlayerMask>, SegmentationError> {
        let masks = seen.tracked().map(|(_, person_index, person)| {
            let mask = self.mask(seen, person_index, person)?;
            Ok(PlayerMask { sighting: Sighting { frame: seen.index, person_index }, mask })
        });
        masks.collect()
    }
}

/// The window around a box; `None` when the box is empty or broken.
fn window(bounds: &PixelBox) -> Option<Grid> {
    let size = bounds.size() * MARGIN;
    let cell_px = (size.y / ROWS as f64).max(size.x / COLUMNS as f64);
    let half = glam::DVec2::new(COLUMNS as f64, ROWS as f64) * cell_px / 2.0;
    let corner = bounds.centre() - half;
    let usable =
        corner.is_finite() && cell_px.is_finite() && cell_px > 0.01 && corner.abs().max_element() < 1e6;
    usable.then_some(Grid { corner, cell_px, width: COLUMNS, height: ROWS })
}

fn network_input(grid: &Grid, seen: &FrameSeen<'_>, index: usize, person: &Person) -> Vec<f32> {
    let cells = grid.len();
    let mut input = vec![0.0; CHANNELS * cells];
    for (i, colour) in grid.colours(seen.picture).into_iter().enumerate() {
        for (channel, value) in colour.into_iter().enumerate() {
            input[channel * cells + i] = value;
        }
    }
    let bounds = grid.bounds();
    paint(&mut input, grid, OWN, person);
    for other in seen.others(index).filter(|other| boxes_touch(&other.bounds, &bounds)) {
        // Whose feet are lower in the picture stands nearer to the camera.
        let side = if feet_px(other) > feet_px(person) { FRONT } else { BEHIND };
        paint(&mut input, grid, side, other);
    }
    input
}

/// Somebody's mask and bones into a pair of channels, over what is there by the maximum.
fn paint(input: &mut [f32], grid: &Grid, channel: usize, person: &Person) {
    let cells = grid.len();
    let claim = Claim::of(person);
    let coverage = grid.coverage(&person.mask);
    for (i, coverage) in coverage.into_iter().enumerate() {
        let near = claim.near(grid.centre(i)) as f32;
        for (offset, value) in [(0, coverage), (1, near)] {
            if let Some(place) = input.get_mut((channel + offset) * cells + i) {
                *place = place.max(value);
            }
        }
    }
}
