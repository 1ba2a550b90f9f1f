//! The grass and what is painted on it: mowing, wear, blotches, lines of the laws' width that fade with use.
//! Everything is filtered over the pixel's footprint, so that it neither crawls nor breaks; slow variation is precomputed.

use std::f32::consts::TAU;

use glam::Vec2;
use glam::Vec3;
use protocol::pitch::{LINE_WIDTH_M, Marking, PENALTY_MARK_M, Pitch};

use crate::{
    noise,
    outfit::{Srgb, linear},
};

/// How the grass was cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mowing {
    /// One colour.
    None,
    /// Stripes from touchline to touchline.
    Across,
    /// Stripes from goal to goal.
    Along,
    /// Both, laid over each other.
    Checks,
    /// Stripes at this angle to the touchline, radians.
    Diagonal(f32),
    /// Rings round the centre mark.
    Circles,
}

/// How grass and lines look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurfLook {
    /// Colour of the grass.
    pub grass: Srgb,
    /// How it was cut.
    pub mowing: Mowing,
    /// How much lighter every other stripe is.
    pub contrast: f32,
    /// Width of a stripe, metres.
    pub stripe_m: f32,
    /// Wear of goal mouths, marks and the assistants' paths: 0 (new) to 1 (bare).
    pub wear: f32,
    /// Strength of the slow variation of brightness.
    pub blotches: f32,
    /// Width of the lines, metres (Law 1: at most 0.12).
    pub line_m: f32,
    /// How much of the paint is left, 0..1.
    pub paint: f32,
    /// Colour of the ground outside the grass.
    pub apron: Srgb,
    /// Grass beyond the lines, metres.
    pub margin_m: f32,
}

impl Default for TurfLook {
    fn default() -> Self {
        Self {
            grass: [0.33, 0.47, 0.16],
            mowing: Mowing::Across,
            contrast: 0.16,
            stripe_m: 5.25,
            wear: 0.1,
            blotches: 1.0,
            line_m: LINE_WIDTH_M as f32,
            paint: 0.94,
            apron: [0.20, 0.33, 0.16],
            margin_m: 3.2,
        }
    }
}

/// A marking in single precision with what its distance needs.
#[derive(Clone, Copy, Debug)]
enum Stroke {
    Line { from: Vec2, along: Vec2, length: f32 },
    Arc { centre: Vec2, radius: f32, start: f32, sweep: f32 },
    Spot { centre: Vec2, radius: f32 },
}

/// The ground of one stadium.
#[derive(Clone, Debug)]
pub struct Turf {
    /// How it looks.
    pub look: TurfLook,
    grass: Vec3,
    apron: Vec3,
    half: Vec2,
    seed: u32,
    strokes: Vec<Stroke>,
    /// Which strokes can touch each cell of one square metre: places in `near`.
    cells: Vec<[u32; 2]>,
    near: Vec<u8>,
    cells_across: usize,
    /// Brightness, warmth and wear on a grid of [`TEXEL_M`].
    slow: Vec<Vec3>,
    slow_size: [usize; 2],
}

const TEXEL_M: f32 = 0.25;
/// The slow map and the cells reach this far beyond the lines.
const REACH_M: f32 = 6.0;

impl Turf {
    /// Width of the painted lines, metres.
    #[must_use]
    pub fn line_m(&self) -> f64 {
        f64::from(self.look.line_m)
    }

    /// Prepares the ground of a pitch.
    #[must_use]
    pub fn new(pitch: &Pitch, look: TurfLook, seed: u32) -> Self {
        let half = Vec2::new(pitch.length_m as f32, pitch.width_m as f32) / 2.0;
        let strokes: Vec<Stroke> = pitch.markings().iter().map(stroke).collect();
        let cells_across = (2.0 * (half.x + REACH_M)).ceil() as usize;
        let cells_down = (2.0 * (half.y + REACH_M)).ceil() as usize;
        let mut lists = vec![Vec::new(); cells_across * cells_down];
        for (index, marking) in pitch.markings().iter().enumerate() {
            for point in marking.sample(0.5) {
                let at = (point.as_vec2() + half + REACH_M).floor();
                // Footprints of far pixels are long: a stroke is known two cells around it.
                for dy in -2i32..=2 {
                    for dx in -2i32..=2 {
                        let (x, y) = (at.x as i32 + dx, at.y as i32 + dy);
                        if x >= 0 && y >= 0 && (x as usize) < cells_across && (y as usize) < cells_down {
                            let list: &mut Vec<u8> = &mut lists[y as usize * cells_across + x as usize];
                            if list.last() != Some(&(index as u8)) {
                                list.push(index as u8);
                            }
                        }
                    }
                }
            }
        }
        let mut near = Vec::new();
        let cells = lists
            .iter_mut()
            .map(|list| {
                list.dedup();
                let first = near.len() as u32;
                near.extend_from_slice(list);
                [first, near.len() as u32]
            })
            .collect();
        let slow_size = [half.x, half.y].map(|h| (2.0 * (h + REACH_M) / TEXEL_M).ceil() as usize + 2);
        let mut turf = Self {
            look,
            grass: linear(look.grass),
            apron: linear(look.apron),
            half,
            seed,
            strokes,
            cells,
            near,
            cells_across,
            slow: Vec::with_capacity(slow_size[0] * slow_size[1]),
            slow_size,
        };
        for y in 0..slow_size[1] {
            for x in 0..slow_size[0] {
                let p = Vec2::new(x as f32, y as f32) * TEXEL_M - half - REACH_M;
                let slow = turf.slow_at(p);
                turf.slow.push(slow);
            }
        }
        turf
    }

    /// Brightness, warmth and wear at a place, as the map stores them.
    fn slow_at(&self, p: Vec2) -> Vec3 {
        let seed = self.seed;
        let blotch = 0.9 * noise::value(p * 1.1, seed ^ 1)
            + 1.2 * noise::value(p * 0.21, seed ^ 2)
            + 1.0 * noise::value(p * Vec2::new(0.05, 0.08), seed ^ 4);
        let warmth = noise::value(p * 0.13, seed ^ 3);
        let heap = |centre: Vec2, radii: Vec2| (-((p - centre) / radii).length_squared()).exp();
        let side = p.x.signum();
        let mouth = heap(Vec2::new(side * (self.half.x - 1.0), 0.0), Vec2::new(2.4, 4.2));
        let area = heap(Vec2::new(side * (self.half.x - 5.0), 0.0), Vec2::new(5.0, 8.0));
        let mark = heap(Vec2::new(side * (self.half.x - PENALTY_MARK_M as f32), 0.0), Vec2::splat(1.1));
        let centre = heap(Vec2::ZERO, Vec2::splat(2.0));
        // Each assistant runs along one half of a touchline.
        let run = if p.x * p.y.signum() < 0.0 {
            (-((p.y.abs() - self.half.y - 0.9) / 0.5).powi(2)).exp()
        } else {
            0.0
        };
        let worn = mouth.max(0.45 * area).max(0.7 * mark).max(0.5 * centre).max(0.5 * run);
        let ragged = 0.65 + 0.5 * noise::value(p * 1.7, seed ^ 5) + 0.35 * noise::value(p * 0.6, seed ^ 6);
        let thin = (noise::value(p * 0.17, seed ^ 8) - 0.35).max(0.0) * 0.5;
        let wear = (self.look.wear * (worn * ragged * 1.3 + thin)).clamp(0.0, 1.0);
        Vec3::new(1.0 + 0.035 * self.look.blotches * blotch, warmth, wear)
    }

    fn slow(&self, p: Vec2) -> Vec3 {
        let at = ((p + self.half + REACH_M) / TEXEL_M).max(Vec2::ZERO);
        let [width, height] = self.slow_size;
        let (x, y) = ((at.x as usize).min(width - 2), (at.y as usize).min(height - 2));
        let (fx, fy) = ((at.x - x as f32).min(1.0), (at.y - y as f32).min(1.0));
        let first = y * width + x;
        let top = self.slow[first].lerp(self.slow[first + 1], fx);
        top.lerp(self.slow[first + width].lerp(self.slow[first + width + 1], fx), fy)
    }

    /// How light the mown stripe at a place is, −0.5..0.5, filtered over the footprint.
    fn stripe(&self, p: Vec2, reach: &impl Fn(Vec2) -> f32) -> f32 {
        let wide = self.look.stripe_m;
        let wave = |place: f32, soft: f32| {
            // 1 at the middle of one stripe, 0 at the middle of the other.
            // (Positive and small, so that cutting to a whole number rounds down.)
            let pairs = place / wide * 0.5 + 500.0;
            let edge = ((pairs - (pairs as i32) as f32) * 2.0 - 1.0).abs();
            ((edge - 0.5) / (soft / wide).max(0.04)).clamp(-0.5, 0.5)
        };
        match self.look.mowing {
            Mowing::None => 0.0,
            Mowing::Across => wave(p.x + self.half.x, reach(Vec2::X)),
            Mowing::Along => wave(p.y + self.half.y, reach(Vec2::Y)),
            Mowing::Checks => {
                0.6 * (wave(p.x + self.half.x, reach(Vec2::X)) + wave(p.y + self.half.y, reach(Vec2::Y)))
            }
            Mowing::Diagonal(angle) => {
                let normal = Vec2::from_angle(angle);
                wave(p.dot(normal), reach(normal))
            }
            Mowing::Circles => wave(p.length(), reach(p.normalize_or(Vec2::X))),
        }
    }

    /// Colour of the ground without light. `steps` is how far the hit moves per pixel across and down, metres.
    #[must_use]
    pub fn albedo(&self, p: Vec2, steps: [Vec2; 2]) -> Vec3 {
        let reach =
            |normal: Vec2| (normal.dot(steps[0]).powi(2) + normal.dot(steps[1]).powi(2)).sqrt().max(1e-5);
        let beyond = (p.abs() - self.half).max_element();
        if beyond > self.look.margin_m {
            let grain = 1.0 + 0.05 * noise::value(p * 3.0, self.seed);
            return self.apron * grain;
        }
        let slow = self.slow(p);
        let blade = steps[1].length().max(steps[0].length());
        let grain = if blade < 0.4 {
            noise::value(p * Vec2::new(7.0, 4.0), self.seed) * (0.10 / (0.10 + blade))
        } else {
            0.0
        };
        let stripe = self.look.contrast * self.stripe(p, &reach);
        let tint = Vec3::new(1.0 + 0.03 * slow.y, 1.0, 1.0);
        let grass = self.grass * tint * ((1.0 + stripe) * (slow.x + 0.035 * grain));
        let grass = grass.lerp(Vec3::new(0.165, 0.135, 0.062), slow.z * 0.85);
        let paint = self.paint_at(p, &reach);
        if paint <= 0.0 {
            return grass;
        }
        let left =
            self.look.paint * (1.0 - 0.5 * slow.z) * (0.94 + 0.06 * noise::value(p * 2.3, self.seed ^ 7));
        grass.lerp(Vec3::new(0.79, 0.85, 0.79), paint * left)
    }

    /// Share of a pixel that is covered by line paint.
    fn paint_at(&self, p: Vec2, reach: &impl Fn(Vec2) -> f32) -> f32 {
        let cell = p + self.half + REACH_M;
        if cell.x < 0.0 || cell.y < 0.0 || cell.x as usize >= self.cells_across {
            return 0.0;
        }
        let Some(&[first, end]) = self.cells.get(cell.y as usize * self.cells_across + cell.x as usize)
        else {
            return 0.0;
        };
        let half_line = self.look.line_m / 2.0;
        let ramp = |t: f32| (t + 0.5).clamp(0.0, 1.0);
        let band = |signed: f32, normal: Vec2, half: f32| {
            let step = reach(normal);
            ramp((signed + half) / step) - ramp((signed - half) / step)
        };
        let mut paint: f32 = 0.0;
        for &index in &self.near[first as usize..end as usize] {
            let cover = match self.strokes[usize::from(index)] {
                Stroke::Line { from, along, length } => {
                    let normal = along.perp();
                    let middle = (p - from).dot(along) - length / 2.0;
                    band((p - from).dot(normal), normal, half_line)
                        * band(middle, along, length / 2.0 + half_line)
                }
                Stroke::Arc { centre, radius, start, sweep } => {
                    let offset = p - centre;
                    let turn = (offset.to_angle() - start).rem_euclid(TAU);
                    if turn <= sweep + 1e-4 {
                        band(offset.length() - radius, offset.normalize_or(Vec2::X), half_line)
                    } else {
                        0.0
                    }
                }
                Stroke::Spot { centre, radius } => {
                    let offset = p - centre;
                    band(offset.length(), offset.normalize_or(Vec2::X), radius)
                }
            };
            paint = paint.max(cover);
        }
        paint
    }
}

fn stroke(marking: &Marking) -> Stroke {
    match *marking {
        Marking::Line { from, to } => {
            let (from, to) = (from.as_vec2(), to.as_vec2());
            Stroke::Line { from, along: (to - from).normalize_or(Vec2::X), length: from.distance(to) }
        }
        Marking::Arc { centre, radius_m, start, sweep } => Stroke::Arc {
            centre: centre.as_vec2(),
            radius: radius_m as f32,
            start: start as f32,
            sweep: sweep as f32,
        },
        Marking::Spot { centre, radius_m } => {
            Stroke::Spot { centre: centre.as_vec2(), radius: radius_m as f32 }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_is_painted_as_wide_as_asked_and_nothing_else_is() {
        let look = TurfLook { line_m: 0.10, ..TurfLook::default() };
        for pitch in [Pitch::default(), Pitch { length_m: 91.0, width_m: 46.0 }] {
            let turf = Turf::new(&pitch, look, 3);
            let fine = |_: Vec2| 0.002;
            for marking in pitch.markings() {
                for point in marking.sample(0.7) {
                    let p = point.as_vec2();
                    assert!(turf.paint_at(p, &fine) > 0.99, "{marking:?} at {p}");
                }
            }
            let half = pitch.width_m as f32 / 2.0;
            assert!(turf.paint_at(Vec2::new(20.0, half + 0.045), &fine) > 0.99);
            assert!(turf.paint_at(Vec2::new(20.0, half + 0.055), &fine) < 0.01);
            assert!(turf.paint_at(Vec2::new(20.0, half - 3.0), &fine) < 0.01);
        }
    }

    #[test]
    fn a_long_footprint_sees_its_share_of_a_line() {
        let turf = Turf::new(&Pitch::default(), TurfLook::default(), 3);
        // A footprint one metre deep across the far touchline, which is 0.12 m wide.
        let share = turf.paint_at(Vec2::new(20.0, -34.0), &|normal: Vec2| normal.y.abs().max(1e-3));
        assert!((share - 0.12).abs() < 0.01, "{share}");
    }

    #[test]
    fn worn_goal_mouths_are_browner_than_the_wings() {
        let turf = Turf::new(&Pitch::default(), TurfLook { wear: 1.0, ..TurfLook::default() }, 3);
        let steps = [Vec2::X * 0.05, Vec2::Y * 0.1];
        let greenness = |p: Vec2| {
            let colour = turf.albedo(p, steps);
            colour.y / colour.x
        };
        assert!(greenness(Vec2::new(-51.0, 0.6)) + 0.2 < greenness(Vec2::new(-30.0, 25.0)));
    }
}
