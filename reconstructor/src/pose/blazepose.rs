//! BlazePose on one person: a square of the picture in, joints and instance mask on the pixels of the clip out.
//!
//! The depth network was trained on poses read in exactly this way (`training/POSE_CONVENTION.md`): change both or none.

use glam::DVec2;
use image::RgbImage;

use super::{JOINTS, Joint};
use crate::{
    geometry::{Mask, PixelBox, bilinear},
    inference::{InferenceError, Model, Tensor},
};

/// Side of the network's picture and of its mask.
const SIDE: usize = 256;
/// Landmarks the network gives; the last six are helpers for the next frame's crop.
const LANDMARKS: usize = 39;
/// Numbers per landmark: x, y, z in pixels of the square, visibility and presence as logits.
const LANDMARK_VALUES: usize = 5;
/// The square is this much larger than the longer side of the box. On players of 35 to 85 px the network's own score is
/// best at 1.4 to 1.6, and legs that reach out of a detector's tight box are read better than at the usual 1.25.
const MARGIN: f64 = 1.5;
const LEFT_HIP: usize = 23;
const RIGHT_HIP: usize = 24;

/// A square of the picture; pixels of the clip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Square {
    pub(super) centre: DVec2,
    pub(super) side: f64,
}

impl Square {
    /// The square the network wants for a person's box; `None` when the box is empty or not a number.
    pub(super) fn round(bounds: &PixelBox) -> Option<Self> {
        let square = Self { centre: bounds.centre(), side: MARGIN * bounds.size().max_element() };
        (square.side >= 1.0 && square.centre.is_finite()).then_some(square)
    }

    /// From pixels of the square (corner of the first pixel at 0) to pixels of the clip.
    fn to_clip(self, x: f64, y: f64) -> DVec2 {
        self.centre + (DVec2::new(x, y) / SIDE as f64 - 0.5) * self.side
    }
}

/// What the network saw.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Estimate {
    /// [`JOINTS`] of them.
    pub(super) joints: Vec<Joint>,
    /// Probability that a whole person was seen, 0..1.
    pub(super) score: f32,
    /// On the whole pixels of the clip inside the square and the picture.
    pub(super) mask: Mask,
}

impl Estimate {
    /// The pixel between the hips.
    pub(super) fn hips_px(&self) -> Option<DVec2> {
        Some((self.joints.get(LEFT_HIP)?.pixel + self.joints.get(RIGHT_HIP)?.pixel) / 2.0)
    }

    /// Whether the hips lie well inside the detector's box, so that this is the person that the box was drawn round.
    pub(super) fn is_of(&self, bounds: &PixelBox) -> bool {
        let reach = bounds.size() * DVec2::new(0.25, 0.4);
        self.hips_px().is_some_and(|hips| (hips - bounds.centre()).abs().cmple(reach).all())
    }
}

/// Runs the network on a square of `picture`.
pub(super) fn estimate(
    model: &mut Model,
    picture: &RgbImage,
    square: Square,
) -> Result<Estimate, InferenceError> {
    let input = network_input(picture, square);
    let outputs = model.run(&[(&[1, SIDE, SIDE, 3], &input)])?;
    let find = |name: &str, length: usize| -> Result<&Tensor, InferenceError> {
        outputs
            .iter()
            .find(|t| t.name == name && t.data.len() == length)
            .ok_or_else(|| model.unexpected(&format!("{name} of {length} numbers"), &outputs))
    };
    let landmarks = &find("Identity", LANDMARKS * LANDMARK_VALUES)?.data;
    let score = find("Identity_1", 1)?.data.first().copied().unwrap_or(0.0);
    let logits = &find("Identity_2", SIDE * SIDE)?.data;
    let metres = &find("Identity_4", LANDMARKS * 3)?.data;
    Ok(Estimate {
        joints: joints(landmarks, metres, square),
        score: if score.is_finite() { score.clamp(0.0, 1.0) } else { 0.0 },
        mask: mask(logits, square, picture.dimensions()),
    })
}

/// The square sampled at 256 × 256 points, RGB 0..1; outside the picture the border pixel is repeated.
fn network_input(picture: &RgbImage, square: Square) -> Vec<f32> {
    let mut input = Vec::with_capacity(SIDE * SIDE * 3);
    // Larger squares are averaged, so that a close-up does not alias.
    let samples = (square.side / SIDE as f64).ceil().clamp(1.0, 16.0) as usize;
    let weight = 1.0 / ((samples * samples) as f32 * 255.0);
    for row in 0..SIDE {
        for column in 0..SIDE {
            let mut sum = [0.0f32; 3];
            for sub in 0..samples * samples {
                let inside = |cell: usize, sub: usize| cell as f64 + (sub as f64 + 0.5) / samples as f64;
                let at = square.to_clip(inside(column, sub % samples), inside(row, sub / samples));
                let colour = bilinear(picture, at);
                for (total, value) in sum.iter_mut().zip(colour) {
                    *total += value;
                }
            }
            input.extend(sum.map(|total| total * weight));
        }
    }
    input
}

fn joints(landmarks: &[f32], metres: &[f32], square: Square) -> Vec<Joint> {
    let depth = |joint: usize| metres.get(joint * 3 + 2).copied().unwrap_or(0.0);
    let hips = (depth(LEFT_HIP) + depth(RIGHT_HIP)) / 2.0;
    let read = |(index, values): (usize, &[f32])| {
        let [x, y, _, visibility, _] = *values else { return None };
        Some(Joint {
            pixel: square.to_clip(f64::from(x), f64::from(y)),
            depth_m: depth(index) - hips,
            visibility: sigmoid(visibility),
        })
    };
    landmarks.chunks_exact(LANDMARK_VALUES).take(JOINTS).enumerate().filter_map(read).collect()
}

fn sigmoid(logit: f32) -> f32 {
    // Logits reach −1700; NaN becomes 0.
    if logit.is_nan() { 0.0 } else { 1.0 / (1.0 + (-logit.clamp(-30.0, 30.0)).exp()) }
}

/// The network's mask sampled at the pixels of the clip.
fn mask(logits: &[f32], square: Square, picture: (u32, u32)) -> Mask {
    let probability: Vec<f32> = logits.iter().map(|&l| sigmoid(l)).collect();
    let half = DVec2::splat(square.side / 2.0);
    let low = (square.centre - half).ceil().max(DVec2::ZERO);
    let last = DVec2::new(f64::from(picture.0) - 1.0, f64::from(picture.1) - 1.0);
    let high = (square.centre + half).floor().min(last);
    if !(high.cmpge(low).all()) {
        return Mask::default();
    }
    let (x0, y0) = (low.x as i32, low.y as i32);
    let (width, height) = ((high.x - low.x) as u32 + 1, (high.y - low.y) as u32 + 1);
    let mut coverage = Vec::with_capacity(width as usize * height as usize);
    let at = |column: usize, row: usize| {
        probability.get(row.min(SIDE - 1) * SIDE + column.min(SIDE - 1)).copied().unwrap_or(0.0)
    };
    for y in 0..height {
        for x in 0..width {
            let clip = low + DVec2::new(f64::from(x), f64::from(y));
            let cell = ((clip - square.centre) / square.side + 0.5) * SIDE as f64 - 0.5;
            let cell = cell.clamp(DVec2::ZERO, DVec2::splat(SIDE as f64 - 1.0));
            let (column, row) = (cell.x as usize, cell.y as usize);
            let (fx, fy) = ((cell.x - column as f64) as f32, (cell.y - row as f64) as f32);
            let top = at(column, row) * (1.0 - fx) + at(column + 1, row) * fx;
            let bottom = at(column, row + 1) * (1.0 - fx) + at(column + 1, row + 1) * fx;
            coverage.push((255.0 * (top * (1.0 - fy) + bottom * fy)).round() as u8);
        }
    }
    Mask { x0, y0, width, height, coverage }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_square_is_half_as_large_again_as_the_box() {
        let bounds = PixelBox { min: DVec2::new(10.0, 20.0), max: DVec2::new(30.0, 100.0) };
        let square = Square::round(&bounds).unwrap();
        assert_eq!(square, Square { centre: DVec2::new(20.0, 60.0), side: 120.0 });
        assert_eq!(square.to_clip(128.0, 128.0), square.centre);
        assert_eq!(square.to_clip(0.0, 256.0), DVec2::new(-40.0, 120.0));
    }

    #[test]
    fn a_square_of_256_pixels_is_copied_exactly() {
        let picture = RgbImage::from_fn(400, 300, |x, y| image::Rgb([x as u8, y as u8, 7]));
        // Sample points of this square are pixel centres: columns 10.., rows 20...
        let square = Square { centre: DVec2::new(10.0 + 127.5, 20.0 + 127.5), side: 256.0 };
        let input = network_input(&picture, square);
        let at =
            |column: usize, row: usize, channel: usize| input[(row * 256 + column) * 3 + channel] * 255.0;
        assert!((at(0, 0, 0) - 10.0).abs() < 1e-3 && (at(0, 0, 1) - 20.0).abs() < 1e-3);
        assert!((at(100, 50, 0) - 110.0).abs() < 1e-3 && (at(100, 50, 1) - 70.0).abs() < 1e-3);
    }

    #[test]
    fn the_mask_of_a_square_of_256_pixels_is_the_sigmoid_of_the_logits() {
        let mut logits = vec![-1700.0; SIDE * SIDE];
        logits[5 * SIDE + 9] = 1700.0;
        let square = Square { centre: DVec2::splat(127.5), side: 256.0 };
        let mask = mask(&logits, square, (1000, 1000));
        assert_eq!((mask.x0, mask.y0, mask.width, mask.height), (0, 0, 256, 256));
        assert_eq!((mask.at(9, 5), mask.at(8, 5), mask.at(9, 6)), (255, 0, 0));
    }

    #[test]
    fn joint_depths_are_relative_to_the_middle_of_the_hips() {
        let landmarks = vec![128.0; LANDMARKS * LANDMARK_VALUES];
        let mut metres = vec![0.0; LANDMARKS * 3];
        metres[LEFT_HIP * 3 + 2] = 0.3;
        metres[RIGHT_HIP * 3 + 2] = 0.1;
        metres[27 * 3 + 2] = 0.5;
        let square = Square { centre: DVec2::ZERO, side: 100.0 };
        let joints = joints(&landmarks, &metres, square);
        assert_eq!(joints.len(), JOINTS);
        assert!((joints[27].depth_m - 0.3).abs() < 1e-6 && (joints[0].depth_m + 0.2).abs() < 1e-6);
        assert_eq!(joints[0].pixel, DVec2::ZERO);
    }

    proptest! {
        #[test]
        fn masks_stay_in_the_picture(x in -500.0..2000.0, y in -500.0..1500.0, side in 0.5..900.0) {
            let logits = vec![3.0; SIDE * SIDE];
            let mask = mask(&logits, Square { centre: DVec2::new(x, y), side }, (1280, 720));
            prop_assert_eq!(mask.coverage.len(), mask.width as usize * mask.height as usize);
            prop_assert!(mask.x0 >= 0 && mask.y0 >= 0);
            prop_assert!(mask.x0 as u32 + mask.width <= 1280 && mask.y0 as u32 + mask.height <= 720);
        }
    }
}
