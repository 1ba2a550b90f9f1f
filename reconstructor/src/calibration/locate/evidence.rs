//! What the pitch network says of a picture: named points and pixels of named lines, each with how sure it is.

use glam::DVec2;
use image::{RgbImage, imageops};

use super::names::{CHANNELS, LINES, POINTS};
use crate::inference::{InferenceError, Model};

/// Width and height of the network's picture.
const INPUT: (u32, u32) = (512, 288);
/// Pixels of it per cell of the maps.
const STRIDE: usize = 4;
const COLUMNS: usize = INPUT.0 as usize / STRIDE;
const ROWS: usize = INPUT.1 as usize / STRIDE;
/// Points and cells of lines below this probability are not believed.
const POINT_MIN: f32 = 0.15;
const LINE_MIN: f32 = 0.35;
/// Cells round a peak that tell where the point is.
const PEAK_REACH: usize = 2;
/// Most cells of one kind of line that are kept, evenly thinned.
const LINE_CELLS_MAX: usize = 32;
/// Where a line that must be there is looked for, less is enough.
const SHOWN_MIN: f32 = 0.12;

/// A named point seen in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FoundPoint {
    /// Which, in the order of [`super::names::points`].
    pub(super) name: usize,
    /// Where, pixels of the picture.
    pub(super) pixel: DVec2,
    /// Probability 0..1.
    pub(super) score: f64,
}

/// A place on a named line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FoundLine {
    /// Which, in the order of [`super::names::lines`].
    pub(super) name: usize,
    /// Where, pixels of the picture: the middle of the line in its neighbourhood.
    pub(super) pixel: DVec2,
    /// Probability 0..1.
    pub(super) score: f64,
}

/// Everything found in one picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Evidence {
    /// Width and height of the picture, pixels.
    pub(super) size_px: (u32, u32),
    /// At most one place for each name.
    pub(super) points: Vec<FoundPoint>,
    /// Places of all lines.
    pub(super) lines: Vec<FoundLine>,
    /// For every kind of line the cells that may show it.
    pub(super) shown: Vec<bool>,
    /// How the picture lies in the network's input.
    pub(super) fitted: Fitted,
}

impl Evidence {
    /// Lets every cell that may show the line `from` also show the line `to`.
    pub(super) fn also_shown(&mut self, from: usize, to: usize) {
        let plane = ROWS * COLUMNS;
        for cell in 0..plane {
            if self.shown.get(from * plane + cell) == Some(&true)
                && let Some(place) = self.shown.get_mut(to * plane + cell)
            {
                *place = true;
            }
        }
    }

    /// Whether the network sees a line of this name at a pixel, to a cell.
    pub(super) fn shows(&self, name: usize, pixel: DVec2) -> bool {
        let cell = self.fitted.cell(pixel).round();
        let around = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)];
        around.into_iter().any(|(dx, dy)| {
            let (x, y) = (cell.x + dx, cell.y + dy);
            let inside = x >= 0.0 && y >= 0.0 && x < COLUMNS as f64 && y < ROWS as f64;
            inside && self.shown.get((name * ROWS + y as usize) * COLUMNS + x as usize).is_some_and(|&s| s)
        })
    }
}

/// How the picture lies in the network's input: scaled to fit, the rest filled with black.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Fitted {
    scale: f64,
    offset: DVec2,
}

impl Fitted {
    fn of((width, height): (u32, u32)) -> Self {
        let input = DVec2::new(f64::from(INPUT.0), f64::from(INPUT.1));
        let picture = DVec2::new(f64::from(width.max(1)), f64::from(height.max(1)));
        let scale = (input / picture).min_element();
        Self { scale, offset: (input - picture * scale) / 2.0 }
    }

    /// The pixel of the picture at a place of the maps, in cells.
    fn pixel(&self, cell: DVec2) -> DVec2 {
        let input_edge = (cell + 0.5) * STRIDE as f64;
        (input_edge - self.offset) / self.scale - 0.5
    }

    /// The place of the maps, in cells, of a pixel of the picture.
    fn cell(&self, pixel: DVec2) -> DVec2 {
        ((pixel + 0.5) * self.scale + self.offset) / STRIDE as f64 - 0.5
    }
}

/// Runs the network on a picture.
pub(super) fn find(model: &mut Model, picture: &RgbImage) -> Result<Evidence, InferenceError> {
    let fitted = Fitted::of(picture.dimensions());
    let input = network_input(picture, &fitted);
    let (width, height) = (INPUT.0 as usize, INPUT.1 as usize);
    let outputs = model.run(&[(&[1, 3, height, width], &input)])?;
    let shape = [1, CHANNELS, ROWS, COLUMNS];
    let maps = outputs
        .iter()
        .find(|tensor| tensor.shape == shape && tensor.data.len() == CHANNELS * ROWS * COLUMNS)
        .ok_or_else(|| model.unexpected(&format!("a tensor {shape:?}"), &outputs))?;
    Ok(read(&maps.data, &fitted, picture.dimensions()))
}

/// Planes red, green, blue, 0..1.
fn network_input(picture: &RgbImage, fitted: &Fitted) -> Vec<f32> {
    let size = |side: u32| ((f64::from(side) * fitted.scale).round() as u32).max(1);
    let small = imageops::resize(
        picture,
        size(picture.width()).min(INPUT.0),
        size(picture.height()).min(INPUT.1),
        imageops::FilterType::Triangle,
    );
    let (left, top) = (fitted.offset.x.round() as usize, fitted.offset.y.round() as usize);
    let (width, plane) = (INPUT.0 as usize, (INPUT.0 * INPUT.1) as usize);
    let mut input = vec![0.0; 3 * plane];
    for (x, y, pixel) in small.enumerate_pixels() {
        let at = (y as usize + top) * width + x as usize + left;
        for (channel, value) in pixel.0.into_iter().enumerate() {
            if let Some(place) = input.get_mut(channel * plane + at) {
                *place = f32::from(value) / 255.0;
            }
        }
    }
    input
}

fn read(maps: &[f32], fitted: &Fitted, size_px: (u32, u32)) -> Evidence {
    let lines = maps.get(POINTS * ROWS * COLUMNS..(POINTS + LINES) * ROWS * COLUMNS).unwrap_or_default();
    let shown = lines.iter().map(|&value| value >= SHOWN_MIN).collect();
    let mut evidence = Evidence { size_px, shown, fitted: *fitted, ..Evidence::default() };
    let inside = |pixel: DVec2| {
        let limit = DVec2::new(f64::from(size_px.0), f64::from(size_px.1)) - 0.5;
        pixel.cmpge(DVec2::splat(-0.5)).all() && pixel.cmple(limit).all()
    };
    for (channel, data) in maps.chunks_exact(ROWS * COLUMNS).enumerate() {
        let map = Map(data);
        if channel < POINTS {
            let found = map.peak().filter(|(_, score)| *score >= POINT_MIN);
            let point = found.map(|(cell, score)| (fitted.pixel(cell), score));
            if let Some((pixel, score)) = point.filter(|(pixel, _)| inside(*pixel)) {
                evidence.points.push(FoundPoint { name: channel, pixel, score: f64::from(score) });
            }
        } else if channel < POINTS + LINES {
            let cells = map.crest();
            let step = cells.len().div_ceil(LINE_CELLS_MAX).max(1);
            evidence.lines.extend(cells.into_iter().step_by(step).filter_map(|(cell, score)| {
                let pixel = fitted.pixel(cell);
                inside(pixel).then_some(FoundLine { name: channel - POINTS, pixel, score: f64::from(score) })
            }));
        }
    }
    evidence
}

/// One map of probabilities, `ROWS` × `COLUMNS`.
struct Map<'a>(&'a [f32]);

impl Map<'_> {
    fn at(&self, x: usize, y: usize) -> f32 {
        self.0.get(y * COLUMNS + x).copied().unwrap_or(0.0)
    }

    /// The highest place, to a fraction of a cell, and its height.
    fn peak(&self) -> Option<(DVec2, f32)> {
        let (place, &top) = self.0.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
        let centre = (place % COLUMNS, place / COLUMNS);
        Some((self.middle(centre, PEAK_REACH, PEAK_REACH), top))
    }

    /// Middle of what lies within `reach` cells of a cell.
    fn middle(&self, (x, y): (usize, usize), reach_x: usize, reach_y: usize) -> DVec2 {
        let (mut sum, mut moment) = (0.0, DVec2::ZERO);
        for row in y.saturating_sub(reach_y)..=(y + reach_y).min(ROWS - 1) {
            for column in x.saturating_sub(reach_x)..=(x + reach_x).min(COLUMNS - 1) {
                let weight = f64::from(self.at(column, row));
                sum += weight;
                moment += weight * DVec2::new(column as f64, row as f64);
            }
        }
        if sum > 0.0 { moment / sum } else { DVec2::new(x as f64, y as f64) }
    }

    /// Cells on the crest of a line: higher than their neighbours across it, moved to the line's middle.
    fn crest(&self) -> Vec<(DVec2, f32)> {
        let mut cells = Vec::new();
        for y in 0..ROWS {
            for x in 0..COLUMNS {
                let value = self.at(x, y);
                // NaN fails this comparison too.
                if value.is_nan() || value < LINE_MIN {
                    continue;
                }
                // Beyond the edge nobody knows: what lies there never makes a crest.
                let left = if x > 0 { self.at(x - 1, y) } else { f32::INFINITY };
                let right = if x + 1 < COLUMNS { self.at(x + 1, y) } else { f32::INFINITY };
                let up = if y > 0 { self.at(x, y - 1) } else { f32::INFINITY };
                let down = if y + 1 < ROWS { self.at(x, y + 1) } else { f32::INFINITY };
                let steep_x = 2.0 * value - left - right;
                let steep_y = 2.0 * value - up - down;
                // Across the line the map falls off faster than along it.
                if steep_y >= steep_x && value >= up && value > down {
                    cells.push((self.middle((x, y), 0, 1), value));
                } else if steep_x > steep_y && value >= left && value > right {
                    cells.push((self.middle((x, y), 1, 0), value));
                }
            }
        }
        cells
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_pictures_of_any_shape_come_back_as_pixels() {
        // 1280×720 fits exactly: the middle of the first cell is 1.5 input pixels, 2.5 times as many in the picture.
        let whole = Fitted::of((1280, 720));
        assert_eq!(whole.offset, DVec2::ZERO);
        assert!((whole.pixel(DVec2::ZERO) - DVec2::splat(2.0 * 2.5 - 0.5)).length() < 1e-9);
        assert!((whole.cell(whole.pixel(DVec2::new(7.0, 9.5))) - DVec2::new(7.0, 9.5)).length() < 1e-9);
        let tall = Fitted::of((720, 720));
        let middle = DVec2::new((COLUMNS - 1) as f64, (ROWS - 1) as f64) / 2.0;
        assert!((tall.pixel(middle) - DVec2::splat(359.5)).length() < 1e-9);
    }

    #[test]
    fn a_peak_between_cells_and_a_slanting_line_are_read_to_a_fraction_of_a_cell() {
        let mut maps = vec![0.0_f32; CHANNELS * ROWS * COLUMNS];
        let place = DVec2::new(40.3, 20.8);
        for y in 0..ROWS {
            for x in 0..COLUMNS {
                let away = DVec2::new(x as f64, y as f64) - place;
                maps[5 * ROWS * COLUMNS + y * COLUMNS + x] = (-away.length_squared() / 2.88).exp() as f32;
                let across = (y as f64 - (10.0 + 0.3 * x as f64)) / 1.044;
                maps[(POINTS + 2) * ROWS * COLUMNS + y * COLUMNS + x] =
                    (1.0 - across.abs() / 1.5).max(0.0) as f32;
            }
        }
        let fitted = Fitted { scale: 0.25, offset: DVec2::ZERO };
        // With this scale a cell is 16 pixels.
        let evidence = read(&maps, &fitted, (2048, 1152));
        assert_eq!(evidence.points.len(), 1);
        let found = evidence.points[0];
        assert!(found.name == 5 && (found.pixel - ((place + 0.5) * 16.0 - 0.5)).length() < 3.0, "{found:?}");
        assert!(evidence.lines.len() > 20 && evidence.lines.iter().all(|line| line.name == 2));
        for line in &evidence.lines {
            let cell = (line.pixel + 0.5) / 16.0 - 0.5;
            assert!((cell.y - (10.0 + 0.3 * cell.x)).abs() < 0.3, "{cell}");
        }
    }

    #[test]
    fn nothing_is_found_in_empty_or_broken_maps() {
        for value in [0.0, f32::NAN] {
            let evidence =
                read(&vec![value; CHANNELS * ROWS * COLUMNS], &Fitted::of((1280, 720)), (1280, 720));
            assert!(evidence.points.is_empty() && evidence.lines.is_empty());
        }
    }
}
