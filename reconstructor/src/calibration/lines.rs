//! The set E of section 4.1: pixels of painted lines, found as thin bright ridges with grass on both sides.
//!
//! Needs no camera, so that frames can be done in parallel. People are left out by their boxes; the crowd, boards and most
//! graphics because they have no grass beside them.

use glam::{DVec2, Vec2};
use image::RgbImage;

use super::{distance::NearestMap, grass::Grass};
use crate::geometry::PixelBox;

/// Least brightness of a line above the grass on both of its sides, of 255.
const LEAST_CONTRAST: f32 = 7.0;
/// A ridge shorter than this is a speck, pixels.
const LEAST_RUN_PX: usize = 14;
/// Half-widths of the ridge filter at 720 rows: thin far lines and broad near ones.
const HALF_WIDTHS_PX: [f32; 2] = [3.0, 6.0];
/// Boxes of people are widened by this, pixels: feet and ball.
pub(super) const BOX_MARGIN_PX: f64 = 3.0;
/// Most line pixels kept of one frame.
const MOST_PIXELS: usize = 40_000;
/// Farther than this from every line pixel, a point has no match, at 720 rows.
const REACH_PX: f64 = 40.0;

/// The four directions across a line that are looked at: (step across, step along).
const DIRECTIONS: [((i32, i32), (i32, i32)); 4] =
    [((1, 0), (0, 1)), ((0, 1), (1, 0)), ((1, 1), (1, -1)), ((1, -1), (1, 1))];

/// A pixel on a painted line.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinePixel {
    /// The line's middle, to a fraction of a pixel.
    pub(super) middle: Vec2,
    /// Index into the directions: 0 a line that runs down the picture, 1 across it, 2 and 3 slanting.
    direction: u8,
}

/// The line pixels of one frame, and how much grass there is.
#[derive(Clone, Debug)]
pub(super) struct LinePixels {
    size: (u32, u32),
    /// In no particular order.
    pub(super) pixels: Vec<LinePixel>,
    /// Share of the picture that is grass.
    pub(super) grass_share: f64,
}

impl LinePixels {
    /// Finds the line pixels of a picture outside the boxes of people.
    pub(super) fn find(image: &RgbImage, people: &[PixelBox]) -> Self {
        let grass = Grass::learn(image);
        let grass_share = grass.share;
        let (width, height) = (image.width() as usize, image.height() as usize);
        let mut brightness = Vec::with_capacity(width * height);
        let mut green = Vec::with_capacity(width * height);
        for pixel in image.pixels() {
            let [r, g, b] = pixel.0;
            brightness.push((f32::from(r) + 2.0 * f32::from(g) + f32::from(b)) / 4.0);
            green.push(grass.contains(pixel.0));
        }
        let ridges = Ridges { width, height, brightness, green };
        let mut marks = ridges.marks();
        hide_people(&mut marks, width, height, people);
        let mut kept = longer_runs(&marks, width, height);
        kept.truncate(MOST_PIXELS);
        let pixels = kept
            .into_iter()
            .map(|at| {
                let direction = marks[at].unwrap_or(0);
                LinePixel { middle: ridges.middle(at, direction), direction }
            })
            .collect();
        Self { size: image.dimensions(), pixels, grass_share }
    }

    /// Rows of the picture.
    pub(super) fn height_px(&self) -> f64 {
        f64::from(self.size.1)
    }

    /// The distance maps of these pixels.
    pub(super) fn map(&self) -> LineMap<'_> {
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let reach = REACH_PX * f64::from(self.size.1) / 720.0;
        let build = |skipped: u8| {
            let of_direction =
                self.pixels.iter().enumerate().filter(move |(_, pixel)| pixel.direction != skipped);
            let places = of_direction.map(|(i, pixel)| {
                let cell = pixel.middle.round().max(Vec2::ZERO);
                (i as u32, cell.x as usize, cell.y as usize)
            });
            NearestMap::new(width, height, places, reach.ceil() as usize)
        };
        LineMap { pixels: &self.pixels, upright: build(1), level: build(0), reach_px: reach }
    }
}

/// Squared-distance maps of a frame: one for lines that run down the picture, one for lines that run across it, so that a
/// touchline is not drawn to the halfway line where they cross.
pub(super) struct LineMap<'a> {
    pixels: &'a [LinePixel],
    upright: NearestMap,
    level: NearestMap,
    /// Farther points have no match, pixels.
    pub(super) reach_px: f64,
}

impl LineMap<'_> {
    /// Middle of the nearest line whose direction can be that of a line with this normal in the picture.
    pub(super) fn nearest(&self, position: DVec2, normal: DVec2) -> Option<DVec2> {
        let map = if normal.x.abs() > normal.y.abs() { &self.upright } else { &self.level };
        let pixel = self.pixels.get(map.at(position)?)?;
        Some(pixel.middle.as_dvec2())
    }

    /// Distance from a point to the middle of the nearest line of any direction, at most the reach.
    pub(super) fn distance_px(&self, position: DVec2) -> f64 {
        let of = |map: &NearestMap| {
            let pixel = self.pixels.get(map.at(position)?)?;
            Some(pixel.middle.as_dvec2().distance(position))
        };
        let found = [of(&self.upright), of(&self.level)].into_iter().flatten();
        found.fold(self.reach_px, f64::min)
    }
}

struct Ridges {
    width: usize,
    height: usize,
    brightness: Vec<f32>,
    green: Vec<bool>,
}

impl Ridges {
    /// Steps of the filter at this picture size, for a direction: diagonal steps are longer.
    fn steps(&self, direction: usize) -> [i32; 2] {
        let scale = self.height as f32 / 720.0;
        let diagonal = if direction >= 2 { std::f32::consts::FRAC_1_SQRT_2 } else { 1.0 };
        HALF_WIDTHS_PX.map(|half| ((half * scale * diagonal).round() as i32).max(2))
    }

    fn offset(&self, (dx, dy): (i32, i32), times: i32) -> isize {
        (dy * times) as isize * self.width as isize + (dx * times) as isize
    }

    /// For every pixel the direction across the line whose crest it is on.
    fn marks(&self) -> Vec<Option<u8>> {
        let mut best = vec![LEAST_CONTRAST; self.width * self.height];
        let mut marks = vec![None; self.width * self.height];
        let margin = self.steps(0)[1] as usize + 2;
        if self.width <= 2 * margin || self.height <= 2 * margin {
            return marks;
        }
        let mut smooth = vec![0.0_f32; self.width * self.height];
        for (number, &(across, along)) in DIRECTIONS.iter().enumerate() {
            // Averaging along the line leaves the line and halves the noise.
            let next = self.offset(along, 1);
            for y in 1..self.height - 1 {
                for x in 1..self.width - 1 {
                    let at = y * self.width + x;
                    let (a, b) = (at.wrapping_add_signed(next), at.wrapping_add_signed(-next));
                    smooth[at] = (self.brightness[a] + 2.0 * self.brightness[at] + self.brightness[b]) / 4.0;
                }
            }
            let beside = self.offset(across, 1);
            for half in self.steps(number) {
                let side = self.offset(across, half);
                let grass_at = self.offset(across, half + 1);
                for y in margin..self.height - margin {
                    for x in margin..self.width - margin {
                        let at = y * self.width + x;
                        let value = smooth[at];
                        let (a, b) = (at.wrapping_add_signed(side), at.wrapping_add_signed(-side));
                        let contrast = value - smooth[a].max(smooth[b]);
                        if contrast <= best[at]
                            || value < smooth[at.wrapping_add_signed(beside)]
                            || value < smooth[at.wrapping_add_signed(-beside)]
                        {
                            continue;
                        }
                        let (ga, gb) = (at.wrapping_add_signed(grass_at), at.wrapping_add_signed(-grass_at));
                        if (self.green[ga] || self.green[a]) && (self.green[gb] || self.green[b]) {
                            best[at] = contrast;
                            marks[at] = Some(number as u8);
                        }
                    }
                }
            }
        }
        marks
    }

    /// Centre of the bright profile across the line at a crest.
    fn middle(&self, at: usize, direction: u8) -> Vec2 {
        let place = Vec2::new((at % self.width) as f32, (at / self.width) as f32);
        let Some(&(across, _)) = DIRECTIONS.get(usize::from(direction)) else { return place };
        let half = self.steps(usize::from(direction))[0] + 1;
        let value = |k: i32| {
            let i = at.wrapping_add_signed(self.offset(across, k));
            self.brightness.get(i).copied().unwrap_or(0.0)
        };
        let base = value(-half).max(value(half));
        let (mut sum, mut moment) = (0.0, 0.0);
        for k in -half..=half {
            let above = (value(k) - base).max(0.0);
            sum += above;
            moment += above * k as f32;
        }
        let shift = if sum > 0.0 { moment / sum } else { 0.0 };
        place + Vec2::new(across.0 as f32, across.1 as f32) * shift
    }
}

fn hide_people(marks: &mut [Option<u8>], width: usize, height: usize, people: &[PixelBox]) {
    for person in people {
        let clamp = |v: f64, side: usize| v.clamp(0.0, side as f64) as usize;
        let (x0, x1) =
            (clamp(person.min.x - BOX_MARGIN_PX, width), clamp(person.max.x + BOX_MARGIN_PX + 1.0, width));
        let (y0, y1) =
            (clamp(person.min.y - BOX_MARGIN_PX, height), clamp(person.max.y + BOX_MARGIN_PX + 1.0, height));
        for y in y0..y1 {
            marks[y * width + x0.min(x1)..y * width + x1].fill(None);
        }
    }
}

/// Indices of marks that belong to connected runs of some length.
fn longer_runs(marks: &[Option<u8>], width: usize, height: usize) -> Vec<usize> {
    let mut seen = vec![false; marks.len()];
    let mut kept = Vec::new();
    let mut run = Vec::new();
    for first in 0..marks.len() {
        if marks[first].is_none() || seen[first] {
            continue;
        }
        seen[first] = true;
        run.clear();
        run.push(first);
        let mut next = 0;
        let (mut low, mut high) = ((usize::MAX, usize::MAX), (0, 0));
        while let Some(&at) = run.get(next) {
            next += 1;
            let (x, y) = (at % width, at / width);
            low = (low.0.min(x), low.1.min(y));
            high = (high.0.max(x), high.1.max(y));
            // Two pixels' reach bridges the gaps that coding makes in faint lines.
            for ny in y.saturating_sub(2)..=(y + 2).min(height - 1) {
                for nx in x.saturating_sub(2)..=(x + 2).min(width - 1) {
                    let neighbour = ny * width + nx;
                    if marks[neighbour].is_some() && !seen[neighbour] {
                        seen[neighbour] = true;
                        run.push(neighbour);
                    }
                }
            }
        }
        let extent = (high.0 - low.0).max(high.1 - low.1) + 1;
        if extent >= LEAST_RUN_PX {
            kept.extend_from_slice(&run);
        }
    }
    kept
}
