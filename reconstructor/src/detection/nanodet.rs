//! NanoDet-g on one tile: picture in, boxes of people out.
//!
//! For each cell of three grids the network gives 80 class scores (0 is "person") and, for each side of the box, a
//! distribution over 11 distances in units of the cell; see `assets/models/nanodet_g_416.md`.

use glam::DVec2;
use image::RgbImage;

use super::{
    Detection,
    merge::{self, Found},
    tiles::{Edges, TILE_PX, Tile},
};
use crate::{
    geometry::PixelBox,
    inference::{InferenceError, Model, Tensor},
};

const CLASSES: usize = 80;
const PERSON: usize = 0;
const BINS: usize = 11;
const STRIDES_PX: [usize; 3] = [8, 16, 32];
/// Mean and spread of each channel in the training pictures, blue first.
const MEAN_BGR: [f32; 3] = [103.53, 116.28, 123.675];
const SPREAD_BGR: [f32; 3] = [57.375, 57.12, 58.395];
/// A box that comes this near to a tile's edge is taken as cut by it, pixels.
const CUT_PX: f64 = 3.0;
/// Overlap above which two boxes of a tile are the same person.
const SAME_IOU: f64 = 0.5;

/// People in a tile of `picture`, boxes in pixels of `picture`.
pub(super) fn detect(
    model: &mut Model,
    picture: &RgbImage,
    tile: &Tile,
    score_min: f32,
) -> Result<Vec<Found>, InferenceError> {
    let side = TILE_PX as usize;
    let outputs = model.run(&[(&[1, 3, side, side], &network_input(picture, tile))])?;
    let boxes = decode(model, &outputs, score_min)?;
    Ok(merge::suppress(boxes, SAME_IOU).into_iter().map(|d| place(d, tile)).collect())
}

/// The tile as the network wants it: planes blue, green, red, normalised; black outside the picture.
fn network_input(picture: &RgbImage, tile: &Tile) -> Vec<f32> {
    let side = TILE_PX as usize;
    let plane = side * side;
    let mut input = vec![0.0; 3 * plane];
    for (channel, values) in input.chunks_exact_mut(plane).enumerate() {
        let (mean, spread) = (MEAN_BGR[channel], SPREAD_BGR[channel]);
        values.fill(-mean / spread);
        for (row, line) in values.chunks_exact_mut(side).enumerate() {
            let y = tile.y + row as u32;
            if y >= picture.height() {
                break;
            }
            for (column, value) in line.iter_mut().enumerate() {
                let Some(pixel) = picture.get_pixel_checked(tile.x + column as u32, y) else { break };
                *value = (f32::from(pixel.0[2 - channel]) - mean) / spread;
            }
        }
    }
    input
}

/// Boxes of people in pixels of the tile.
fn decode(model: &Model, outputs: &[Tensor], score_min: f32) -> Result<Vec<Detection>, InferenceError> {
    let mut boxes = Vec::new();
    for stride in STRIDES_PX {
        let cells = TILE_PX as usize / stride;
        let find = |width: usize| {
            let shape = [1, cells * cells, width];
            outputs
                .iter()
                .find(|t| t.shape == shape && t.data.len() == cells * cells * width)
                .ok_or_else(|| model.unexpected(&format!("a tensor {shape:?}"), outputs))
        };
        let (scores, distances) = (find(CLASSES)?, find(4 * BINS)?);
        let rows = scores.data.chunks_exact(CLASSES).zip(distances.data.chunks_exact(4 * BINS));
        for (cell, (scores, distances)) in rows.enumerate() {
            let score = scores.get(PERSON).copied().unwrap_or(0.0);
            // NaN fails this comparison too.
            if score >= score_min {
                boxes.push(Detection { bounds: cell_box(cell, cells, stride, distances), score });
            }
        }
    }
    Ok(boxes)
}

/// The box of one cell; `distances` has the bins of left, top, right and bottom one after the other.
fn cell_box(cell: usize, cells: usize, stride: usize, distances: &[f32]) -> PixelBox {
    let stride = stride as f64;
    // The network counts from the edge of the first pixel; our pixel centres are whole numbers.
    let centre = DVec2::new((cell % cells) as f64 + 0.5, (cell / cells) as f64 + 0.5) * stride - 0.5;
    let mut sides = [0.0; 4];
    for (side, bins) in sides.iter_mut().zip(distances.chunks_exact(BINS)) {
        *side = expectation(bins) * stride;
    }
    let [left, top, right, bottom] = sides;
    PixelBox { min: centre - DVec2::new(left, top), max: centre + DVec2::new(right, bottom) }
}

/// Mean bin number under the softmax of `logits`.
fn expectation(logits: &[f32]) -> f64 {
    let largest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let (mut sum, mut weighted) = (0.0, 0.0);
    for (bin, &logit) in logits.iter().enumerate() {
        let weight = f64::from((logit - largest).exp());
        sum += weight;
        weighted += weight * bin as f64;
    }
    if sum > 0.0 { weighted / sum } else { 0.0 }
}

/// Moves a box from its tile to the picture, noting the inner edges of the tile that it touches.
fn place(detection: Detection, tile: &Tile) -> Found {
    let (min, max) = (detection.bounds.min, detection.bounds.max);
    let far = f64::from(TILE_PX) - 1.0 - CUT_PX;
    let cut = Edges {
        left: tile.inner.left && min.x < CUT_PX,
        top: tile.inner.top && min.y < CUT_PX,
        right: tile.inner.right && max.x > far,
        bottom: tile.inner.bottom && max.y > far,
    };
    let offset = DVec2::new(f64::from(tile.x), f64::from(tile.y));
    let bounds = PixelBox { min: min + offset, max: max + offset };
    Found { detection: Detection { bounds, ..detection }, cut }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sure_distance_is_its_bin_and_an_unsure_one_the_middle() {
        let mut sure = [-20.0; BINS];
        sure[7] = 20.0;
        assert!((expectation(&sure) - 7.0).abs() < 1e-6);
        assert!((expectation(&[0.0; BINS]) - 5.0).abs() < 1e-6);
    }

    #[test]
    fn a_cell_box_lies_round_the_middle_of_its_cell() {
        let mut distances = [-50.0; 4 * BINS];
        for (side, bin) in [1, 2, 3, 4].into_iter().enumerate() {
            distances[side * BINS + bin] = 50.0;
        }
        let found = cell_box(13 + 2, 13, 32, &distances);
        let centre = DVec2::new(2.5 * 32.0 - 0.5, 1.5 * 32.0 - 0.5);
        assert!((found.min - (centre - DVec2::new(32.0, 64.0))).length() < 1e-6);
        assert!((found.max - (centre + DVec2::new(96.0, 128.0))).length() < 1e-6);
    }

    #[test]
    fn the_input_is_blue_first_and_black_outside() {
        let picture = RgbImage::from_pixel(10, 10, image::Rgb([200, 100, 50]));
        let tile = Tile { x: 0, y: 0, inner: Edges::default() };
        let input = network_input(&picture, &tile);
        let plane = (TILE_PX * TILE_PX) as usize;
        assert!((input[0] - (50.0 - MEAN_BGR[0]) / SPREAD_BGR[0]).abs() < 1e-6);
        assert!((input[2 * plane] - (200.0 - MEAN_BGR[2]) / SPREAD_BGR[2]).abs() < 1e-6);
        assert!((input[10] + MEAN_BGR[0] / SPREAD_BGR[0]).abs() < 1e-6);
    }

    #[test]
    fn only_an_edge_inside_the_picture_cuts() {
        let bounds = PixelBox { min: DVec2::new(0.0, 100.0), max: DVec2::new(30.0, 414.5) };
        let inner = Edges { left: false, top: false, right: true, bottom: true };
        let found = place(Detection { bounds, score: 0.5 }, &Tile { x: 0, y: 304, inner });
        assert_eq!(found.cut, Edges { bottom: true, ..Edges::default() });
        assert_eq!(found.detection.bounds.min, DVec2::new(0.0, 404.0));
    }
}
