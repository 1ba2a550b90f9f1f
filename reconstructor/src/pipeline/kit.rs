//! Shirt colours: what a player's torso looks like in the picture, for the people of the manifest.

use glam::DVec2;
use image::RgbImage;

use crate::{
    geometry::Mask,
    pose::{Person, index},
};

/// The corners of the torso, round it.
const TORSO: [usize; 4] = [index::LEFT_SHOULDER, index::RIGHT_SHOULDER, index::RIGHT_HIP, index::LEFT_HIP];
/// Samples across and down the torso.
const GRID: usize = 8;
/// Fewer samples inside the mask than this say nothing.
const LEAST_SAMPLES: usize = 6;

/// The middle colour of the torso in one frame, sRGB; `None` when the torso is hidden or its joints are missing.
pub(super) fn shirt_rgb(image: &RgbImage, person: &Person, mask: &Mask) -> Option<[u8; 3]> {
    let mut corners = [DVec2::ZERO; 4];
    for (corner, joint) in corners.iter_mut().zip(TORSO) {
        let joint = person.joints.get(joint).filter(|joint| joint.visibility >= 0.3)?;
        *corner = joint.pixel;
    }
    let [left_shoulder, right_shoulder, right_hip, left_hip] = corners;
    let mut samples = Vec::new();
    for down in 0..GRID {
        for across in 0..GRID {
            // The inner part: arms and shorts stay out.
            let (u, v) =
                (0.2 + 0.6 * across as f64 / (GRID - 1) as f64, 0.1 + 0.65 * down as f64 / (GRID - 1) as f64);
            let pixel = left_shoulder.lerp(right_shoulder, u).lerp(left_hip.lerp(right_hip, u), v).round();
            if !pixel.is_finite()
                || mask.at(pixel.x as i32, pixel.y as i32) < 128
                || pixel.min_element() < 0.0
            {
                continue;
            }
            samples.extend(image.get_pixel_checked(pixel.x as u32, pixel.y as u32).map(|pixel| pixel.0));
        }
    }
    (samples.len() >= LEAST_SAMPLES).then(|| middle_rgb(&samples)).flatten()
}

/// The median of each channel.
pub(super) fn middle_rgb(samples: &[[u8; 3]]) -> Option<[u8; 3]> {
    let channel = |index: usize| {
        let mut values: Vec<u8> = samples.iter().map(|sample| sample[index]).collect();
        values.sort_unstable();
        values.get(values.len() / 2).copied()
    };
    Some([channel(0)?, channel(1)?, channel(2)?])
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use image::Rgb;

    use super::*;
    use crate::{
        geometry::PixelBox,
        pose::{JOINTS, Joint},
    };

    #[test]
    fn the_shirt_is_seen_between_shoulders_and_hips() {
        let mut image = RgbImage::from_pixel(60, 80, Rgb([0, 120, 0]));
        for (x, y) in (20..40).flat_map(|x| (20..45).map(move |y| (x, y))) {
            image.put_pixel(x, y, Rgb([10, 20, 200]));
        }
        let mask = Mask { x0: 18, y0: 10, width: 24, height: 60, coverage: vec![255; 24 * 60] };
        let mut joints = vec![Joint { pixel: DVec2::ZERO, depth_m: 0.0, visibility: 0.9 }; JOINTS];
        for (joint, x, y) in [(11, 39.0, 20.0), (12, 20.0, 20.0), (23, 37.0, 44.0), (24, 22.0, 44.0)] {
            joints[joint].pixel = DVec2::new(x, y);
        }
        let mut person = Person {
            bounds: PixelBox { min: DVec2::ZERO, max: DVec2::ONE },
            score: 1.0,
            pose_score: 1.0,
            joints,
            mask: Mask::default(),
            neck_px: DVec2::ZERO,
            ground_m: DVec3::ZERO,
            neck_m: DVec3::ZERO,
        };
        assert_eq!(shirt_rgb(&image, &person, &mask), Some([10, 20, 200]));
        assert_eq!(shirt_rgb(&image, &person, &Mask::default()), None, "hidden");
        person.joints.clear();
        assert_eq!(shirt_rgb(&image, &person, &mask), None, "no pose");
    }

    #[test]
    fn one_odd_frame_does_not_change_the_kit() {
        assert_eq!(middle_rgb(&[[200, 0, 0], [202, 2, 0], [0, 120, 0]]), Some([200, 2, 0]));
        assert_eq!(middle_rgb(&[]), None);
    }
}
