//! Where on the picture somebody's number is: a square over the upper back, upright by the trunk.
//!
//! The network was trained on squares made in exactly this way by `training/numbers/view.py`: change both or none.

use glam::DVec2;
use image::RgbImage;

use crate::{
    geometry::bilinear,
    pose::{Person, index},
};

/// Cells along a side of the square.
pub(super) const CELLS: usize = 32;
/// Side of the square, in lengths of the trunk.
const SIDE: f64 = 1.15;
/// Its middle below the middle of the shoulders, in lengths of the trunk.
const DOWN: f64 = 0.40;
/// The trunk is at least so long, of the shoulders' width and of the height of the box: who bends has no shorter number.
const OF_SHOULDERS: f64 = 1.2;
const OF_HEIGHT: f64 = 0.20;
/// In smaller ones a digit has two pixels.
const TRUNK_MIN_PX: f64 = 8.0;
/// Larger ones come from broken joints: nobody fills the picture several times.
const SIDE_MAX_PX: f64 = 8192.0;
const PLACE_MAX_PX: f64 = 1e6;
/// Width between the shoulders as seen from behind, in lengths of the trunk, from which the back counts as turned to the camera: 0.7 in full
/// view. Of who shows the chest it is negative.
const TURN_MIN: f64 = 0.25;
/// Samples along a side of a cell at most.
const SAMPLES_MAX: usize = 16;

/// The square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Patch {
    /// Its middle, pixels of the clip.
    pub(super) middle: DVec2,
    /// Unit vector down the back.
    down: DVec2,
    /// Side of a cell, pixels.
    cell_px: f64,
    /// How far the back is turned to the camera.
    pub(super) turn: f64,
}

impl Patch {
    /// Of somebody with joints; `None` when the trunk is a point.
    pub(super) fn of(person: &Person) -> Option<Self> {
        let joint = |joint: usize| person.joints.get(joint).map(|joint| joint.pixel);
        let (left, right) = (joint(index::LEFT_SHOULDER)?, joint(index::RIGHT_SHOULDER)?);
        let (left_hip, right_hip) = (joint(index::LEFT_HIP)?, joint(index::RIGHT_HIP)?);
        let shoulders = (left + right) / 2.0;
        let spine = (left_hip + right_hip) / 2.0 - shoulders;
        let down = spine.try_normalize().filter(|_| spine.length() > 1e-3)?;
        let wide = right - left;
        let trunk = spine.length().max(OF_SHOULDERS * wide.length()).max(OF_HEIGHT * person.bounds.size().y);
        let patch = Self {
            middle: shoulders + down * DOWN * trunk,
            down,
            cell_px: SIDE * trunk / CELLS as f64,
            turn: wide.dot(across(down)) / trunk,
        };
        let sound = patch.middle.abs().max_element() < PLACE_MAX_PX && patch.turn.is_finite();
        (sound && patch.side_px() < SIDE_MAX_PX).then_some(patch)
    }

    /// Whether a number may be read here.
    pub(super) fn shows_the_back(&self) -> bool {
        self.turn >= TURN_MIN && self.side_px() >= TRUNK_MIN_PX * SIDE
    }

    pub(super) fn side_px(&self) -> f64 {
        self.cell_px * CELLS as f64
    }

    /// Colours of the cells, 0..1, row by row: bilinear between pixels, averaged where cells are larger; beyond the border the nearest pixel.
    pub(super) fn sample(&self, picture: &RgbImage) -> Vec<[f32; 3]> {
        let n = (self.cell_px.ceil() as usize).clamp(1, SAMPLES_MAX);
        let step = self.cell_px / n as f64;
        let (right, below) = (across(self.down) * step, self.down * step);
        let first = self.middle - (right + below) * ((CELLS * n - 1) as f64 / 2.0);
        let cell = |index: usize| {
            let corner = DVec2::new((index % CELLS * n) as f64, (index / CELLS * n) as f64);
            let mut sum = [0.0; 3];
            for sub in 0..n * n {
                let at = corner + DVec2::new((sub % n) as f64, (sub / n) as f64);
                let colour = bilinear(picture, first + right * at.x + below * at.y);
                sum.iter_mut().zip(colour).for_each(|(sum, value)| *sum += value / 255.0);
            }
            sum.map(|sum| sum / (n * n) as f32)
        };
        (0..CELLS * CELLS).map(cell).collect()
    }
}

/// To the right when `down` is down.
fn across(down: DVec2) -> DVec2 {
    DVec2::new(down.y, -down.x)
}

#[cfg(test)]
mod tests {
    use image::Rgb;
    use proptest::prelude::*;

    use super::*;
    use crate::{
        geometry::PixelBox,
        pose::{JOINTS, Joint},
    };

    /// Somebody upright with the back to the camera, whose trunk is 40 px long and 28 px wide, turned by an angle about the neck.
    fn from_behind(angle: f64) -> Person {
        let joint = |pixel| Joint { pixel, depth_m: 0.0, visibility: 1.0 };
        let mut joints = vec![joint(DVec2::ZERO); JOINTS];
        let places = [
            (index::LEFT_SHOULDER, -14.0, 0.0),
            (index::RIGHT_SHOULDER, 14.0, 0.0),
            (index::LEFT_HIP, -8.0, 40.0),
            (index::RIGHT_HIP, 8.0, 40.0),
        ];
        for (place, x, y) in places {
            joints[place] =
                joint(DVec2::new(100.0, 60.0) + DVec2::from_angle(angle).rotate(DVec2::new(x, y)));
        }
        let bounds = PixelBox { min: DVec2::new(80.0, 35.0), max: DVec2::new(120.0, 177.0) };
        Person { joints, bounds, ..Person::blank() }
    }

    #[test]
    fn the_square_lies_on_the_back_and_turns_with_it() {
        let upright = Patch::of(&from_behind(0.0)).unwrap();
        assert!(upright.middle.distance(DVec2::new(100.0, 76.0)) < 1e-9, "{upright:?}");
        assert!((upright.side_px() - 46.0).abs() < 1e-9 && (upright.turn - 0.7).abs() < 1e-9);
        let lying = Patch::of(&from_behind(std::f64::consts::FRAC_PI_2)).unwrap();
        assert!(lying.middle.distance(DVec2::new(84.0, 60.0)) < 1e-9, "{lying:?}");
        assert!((lying.turn - 0.7).abs() < 1e-9 && lying.shows_the_back());
    }

    #[test]
    fn chests_and_the_far_away_are_not_looked_at() {
        let mut facing = from_behind(0.0);
        facing.joints.swap(index::LEFT_SHOULDER, index::RIGHT_SHOULDER);
        assert!(!Patch::of(&facing).unwrap().shows_the_back());
        let mut far = from_behind(0.0);
        far.joints.iter_mut().for_each(|joint| joint.pixel *= 0.15);
        far.bounds = PixelBox { min: far.bounds.min * 0.15, max: far.bounds.max * 0.15 };
        assert!(!Patch::of(&far).unwrap().shows_the_back());
        assert_eq!(Patch::of(&Person::blank()), None);
    }

    #[test]
    fn what_is_left_on_the_back_is_left_in_the_cells() {
        // Red left of the spine, blue right of it.
        let colour = |x: u32| if x < 100 { Rgb([255, 0, 0]) } else { Rgb([0, 0, 255]) };
        let picture = RgbImage::from_fn(200, 200, |x, _| colour(x));
        let cells = Patch::of(&from_behind(0.0)).unwrap().sample(&picture);
        assert_eq!(cells.len(), CELLS * CELLS);
        assert_eq!((cells[0], cells[CELLS - 1]), ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]));
        // Head down, the other way round.
        let cells = Patch::of(&from_behind(std::f64::consts::PI)).unwrap().sample(&picture);
        assert_eq!((cells[0], cells[CELLS - 1]), ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]));
    }

    proptest! {
        #[test]
        fn any_joints_give_a_bounded_square_or_none(
            at in prop::collection::vec((prop::num::f64::ANY, -1e5..1e5_f64), 4),
        ) {
            let mut person = from_behind(0.0);
            let places = [index::LEFT_SHOULDER, index::RIGHT_SHOULDER, index::LEFT_HIP, index::RIGHT_HIP];
            for (place, (x, y)) in places.into_iter().zip(at) {
                person.joints[place].pixel = DVec2::new(x, y);
            }
            if let Some(patch) = Patch::of(&person) {
                prop_assert_eq!(patch.sample(&RgbImage::new(3, 2)).len(), CELLS * CELLS);
            }
        }
    }
}
