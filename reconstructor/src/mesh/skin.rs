//! What a person looks like all round, gathered over the frames of a track: where the camera saw a place of the body at another time, its far
//! side needs no guessing.
//!
//! A place is a limb, how far along it, and the angle round it from where the person faces. Trunk and head have finer cells than arms
//! and legs, so that a number can be read.

use std::f64::consts::{PI, TAU};

use glam::DVec2;
use image::RgbImage;
use protocol::camera::Camera;

use crate::{
    depth::{DepthMap, LAST_TRUNK_LIMB, LIMBS, Place, Side, Skeleton, View},
    pose::{Joint, Person, index},
};

/// A part of the body with cells of its own.
#[derive(Clone, Copy)]
struct Part {
    first: usize,
    along: usize,
    around: usize,
}

/// Cells along and around a part.
const HEAD: [usize; 2] = [20, 36];
const TRUNK: [usize; 2] = [48, 96];
const LIMB: [usize; 2] = [12, 18];
/// The limb of [`LIMBS`] that is the head.
const HEAD_LIMB: usize = 0;
/// Cells of a person.
const CELLS: usize =
    HEAD[0] * HEAD[1] + TRUNK[0] * TRUNK[1] + (LIMBS.len() - 1 - LAST_TRUNK_LIMB) * LIMB[0] * LIMB[1];
/// Weight at which what was seen counts as much as a guess.
const TRUSTED: f32 = 1.5;
/// A body thinner than this along the sight has no side that could be told from the other, metres.
const THIN_M: f64 = 0.03;
/// Shoulders and hips nearer to each other than this do not tell where somebody faces, metres.
const NARROW_M: f64 = 0.08;

/// What one frame shows of a cell: which, its colour, and how much that counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinSample {
    cell: u32,
    colour: [u8; 3],
    weight: f32,
}

/// The colours of one person, all round.
#[derive(Clone, Debug, PartialEq)]
pub struct Skin {
    /// Sums of weighted colours and of the weights.
    cells: Vec<[f32; 4]>,
}

impl Default for Skin {
    fn default() -> Self {
        Self { cells: vec![[0.0; 4]; CELLS] }
    }
}

impl Skin {
    /// Adds what a frame shows.
    pub fn add(&mut self, samples: &[SkinSample]) {
        for SkinSample { cell, colour, weight } in samples {
            if let Some(sum) = self.cells.get_mut(*cell as usize) {
                let part = [f32::from(colour[0]), f32::from(colour[1]), f32::from(colour[2]), 1.0];
                *sum = std::array::from_fn(|i| sum[i] + weight * part[i]);
            }
        }
    }

    /// The colour of a place and how sure it is, 0..1; `None` when the place was never seen.
    fn colour(&self, place: SkinPlace) -> Option<([f32; 3], f32)> {
        let SkinPlace { part, along, around } = place;
        let (u, v) = (along * part.along as f64 - 0.5, around * part.around as f64 - 0.5);
        let (low_u, low_v) = (u.floor(), v.floor());
        let mut sum = [0.0f32; 4];
        for (du, dv) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let share = (if du == 1 { u - low_u } else { 1.0 - u + low_u })
                * (if dv == 1 { v - low_v } else { 1.0 - v + low_v });
            let row = (low_u as i64 + du).clamp(0, part.along as i64 - 1) as usize;
            let column = (low_v as i64 + dv).rem_euclid(part.around as i64) as usize;
            if let Some(cell) = self.cells.get(part.first + row * part.around + column) {
                sum = std::array::from_fn(|i| sum[i] + share as f32 * cell[i]);
            }
        }
        let weight = sum[3];
        (weight > 1e-3).then(|| ([0, 1, 2].map(|i| sum[i] / weight), weight / (weight + TRUSTED)))
    }
}

/// A place on a person: the part, the share of the way along it, the share of the turn round it (half is straight ahead).
#[derive(Clone, Copy)]
struct SkinPlace {
    part: Part,
    along: f64,
    around: f64,
}

fn part_of(limb: usize) -> Part {
    let part = |first, [along, around]: [usize; 2]| Part { first, along, around };
    let trunk = HEAD[0] * HEAD[1];
    match limb {
        HEAD_LIMB => part(0, HEAD),
        1..=LAST_TRUNK_LIMB => part(trunk, TRUNK),
        _ => part(trunk + TRUNK[0] * TRUNK[1] + (limb - LAST_TRUNK_LIMB - 1) * LIMB[0] * LIMB[1], LIMB),
    }
}

/// Somebody in one frame, to find places on.
pub(super) struct Wearer<'a> {
    skeleton: Skeleton,
    depth: &'a DepthMap,
    view: View,
    /// Where the person's left is: right of the picture, and away from the camera.
    left: DVec2,
    /// Rows of the picture where the trunk begins and ends.
    trunk_px: [f64; 2],
}

impl<'a> Wearer<'a> {
    /// `None` when the pose does not tell where the person faces.
    pub(super) fn new(person: &Person, camera: &Camera, depth: &'a DepthMap) -> Option<Self> {
        Self::of(&person.joints, depth, View::from_camera(camera, person.ground_m)?)
    }

    fn of(joints: &[Joint], depth: &'a DepthMap, view: View) -> Option<Self> {
        let skeleton = Skeleton::of(joints, view)?;
        let at = |joint: usize| joints.get(joint);
        let across = |left: usize, right: usize| {
            let (left, right) = (at(left)?, at(right)?);
            let x_m = (left.pixel.x - right.pixel.x) / view.pixels_per_metre;
            Some(DVec2::new(x_m, f64::from(left.depth_m - right.depth_m)))
        };
        let shoulders = across(index::LEFT_SHOULDER, index::RIGHT_SHOULDER)?;
        let hips = across(index::LEFT_HIP, index::RIGHT_HIP)?;
        let left = shoulders + hips;
        let middle_y = |a: usize, b: usize| Some((at(a)?.pixel.y + at(b)?.pixel.y) / 2.0);
        let top = middle_y(index::LEFT_SHOULDER, index::RIGHT_SHOULDER)?;
        let bottom = middle_y(index::LEFT_HIP, index::RIGHT_HIP)?;
        let told = left.length() > 2.0 * NARROW_M && bottom > top + 1.0;
        told.then(|| Self { skeleton, depth, view, left: left.normalize(), trunk_px: [top, bottom] })
    }

    /// The place of a side of the body that is at a pixel, and the cosine of the angle at which the surface meets the sight.
    fn place(&self, pixel: DVec2, side: Side) -> Option<(SkinPlace, f64)> {
        let cell = self.depth.place(pixel).round();
        let [front, back] = self.depth.surfaces_m(cell.x as i64, cell.y as i64)?;
        let Place { limb, along, .. } = self.skeleton.place(pixel, side)?;
        let part = part_of(limb);
        let trunk = (1..=LAST_TRUNK_LIMB).contains(&limb);
        // The trunk is one part; its limbs only say that it is there.
        let (axis, along) = if trunk {
            let [top, bottom] = self.trunk_px;
            let share = ((pixel.y - top) / (bottom - top)).clamp(-0.15, 1.15);
            (self.skeleton.trunk_at(share.clamp(0.0, 1.0))?, (share + 0.15) / 1.3)
        } else {
            (self.skeleton.at(limb, along)?, along)
        };
        let depth_m = (back - front).max(THIN_M) / 2.0;
        let away_m = if side == Side::Front { -depth_m } else { depth_m };
        let off = DVec2::new((pixel.x - axis.x) / self.view.pixels_per_metre, away_m);
        let ahead = DVec2::new(self.left.y, -self.left.x);
        let angle = off.dot(self.left).atan2(off.dot(ahead));
        let around = ((angle + PI) / TAU).rem_euclid(1.0);
        Some((SkinPlace { part, along, around }, depth_m / off.length().max(1e-6)))
    }

    /// What the frame shows of the person.
    pub(super) fn samples(&self, image: &RgbImage) -> Vec<SkinSample> {
        let mut samples = Vec::new();
        for row in 1..i64::from(self.depth.height) - 1 {
            for column in 1..i64::from(self.depth.width) - 1 {
                // At the outline colours mix with what is behind.
                let inside = |dx: i64, dy: i64| self.depth.surfaces_m(column + dx, row + dy).is_some();
                if !(inside(0, 0) && inside(-1, 0) && inside(1, 0) && inside(0, -1) && inside(0, 1)) {
                    continue;
                }
                let pixel = self.depth.pixel(DVec2::new(column as f64, row as f64));
                let Some((SkinPlace { part, along, around }, cosine)) = self.place(pixel, Side::Front) else {
                    continue;
                };
                let nearest = pixel.round();
                let within = nearest.cmpge(DVec2::ZERO).all();
                let Some(colour) =
                    image.get_pixel_checked(nearest.x as u32, nearest.y as u32).filter(|_| within)
                else {
                    continue;
                };
                let cell_along = ((along * part.along as f64) as usize).min(part.along - 1);
                let cell_around = ((around * part.around as f64) as usize).min(part.around - 1);
                let cell = (part.first + cell_along * part.around + cell_around) as u32;
                samples.push(SkinSample { cell, colour: colour.0, weight: cosine.powi(4) as f32 });
            }
        }
        samples
    }

    /// The colour of the far side at a pixel, as it was seen at other times, and how sure that is.
    pub(super) fn far_side(&self, skin: &Skin, pixel: DVec2) -> Option<([f32; 3], f32)> {
        skin.colour(self.place(pixel, Side::Back)?.0)
    }
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;
    use crate::pose::JOINTS;

    const VIEW: View = View { pixels_per_metre: 50.0, descent: 0.0 };

    /// Somebody upright in the middle of 100 × 120 pixels who faces the camera, or turns his back.
    fn pose(back: bool) -> Vec<Joint> {
        let joint = |i: usize| {
            let side = if (i % 2 == 1) == back { -1.0 } else { 1.0 };
            let (dx, y) = match i {
                0..=10 => (0.0, 18.0),
                11 | 12 => (9.0, 30.0),
                13..=22 => (14.0, 45.0),
                23 | 24 => (6.0, 60.0),
                25 | 26 => (6.0, 80.0),
                _ => (6.0, 100.0),
            };
            Joint { pixel: DVec2::new(50.0 + side * dx, y), depth_m: 0.0, visibility: 1.0 }
        };
        (0..JOINTS).map(joint).collect()
    }

    fn slab() -> DepthMap {
        DepthMap {
            first_px: DVec2::new(30.0, 10.0),
            cell_px: 1.0,
            width: 40,
            height: 100,
            coverage: vec![255; 4_000],
            front_mm: vec![-120; 4_000],
            back_mm: vec![120; 4_000],
        }
    }

    #[test]
    fn the_back_seen_at_another_time_is_on_the_far_side() {
        let map = slab();
        // Seen from behind: red on his left, which is left in the picture then; blue on his right.
        let behind =
            RgbImage::from_fn(100, 120, |x, _| if x < 50 { Rgb([250, 0, 0]) } else { Rgb([0, 0, 250]) });
        let mut skin = Skin::default();
        for _ in 0..90 {
            skin.add(&Wearer::of(&pose(true), &map, VIEW).unwrap().samples(&behind));
        }
        // Seen from the front his left is right in the picture, and so is the far side's.
        let facing = pose(false);
        let wearer = Wearer::of(&facing, &map, VIEW).unwrap();
        let at = |x: f64, y: f64| wearer.far_side(&skin, DVec2::new(x, y)).unwrap();
        let (left, sure) = at(56.0, 45.0);
        assert!(left[0] > 200.0 && left[2] < 50.0 && sure > 0.7, "{left:?} {sure}");
        let (right, _) = at(44.0, 45.0);
        assert!(right[2] > 200.0 && right[0] < 50.0, "{right:?}");
        let own = wearer.place(DVec2::new(50.0, 45.0), Side::Front).unwrap().0;
        assert_eq!(skin.colour(own), None, "his chest was never seen");
    }

    #[test]
    fn every_place_has_a_cell_and_wild_poses_have_none() {
        let last = part_of(LIMBS.len() - 1);
        assert_eq!(last.first + last.along * last.around, CELLS);
        let mut edgewise = pose(false);
        edgewise.iter_mut().for_each(|joint| joint.pixel.x = 50.0);
        assert!(Wearer::of(&edgewise, &slab(), VIEW).is_none());
        assert!(Wearer::of(&edgewise[..7], &slab(), VIEW).is_none());
    }
}
