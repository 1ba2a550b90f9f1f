//! Where joints really are, from the whole pose: a small network of our own sees the joints that the pose network read, no picture. It mends
//! what that network gets wrong in the same way again and again on players of a few dozen pixels (hips too low, shoulders too high,
//! a far foot drawn to the near one).
//!
//! It was trained on numbers made in exactly this way by `training/joints/network.py`: change both or none.

use super::{JOINTS, Joint, index};
use crate::inference::{InferenceError, Model};

/// File name of the network in `assets/models`.
pub const MODEL: &str = "joints.onnx";

/// Numbers that the network sees: x and y of every joint, its visibility, and how large the person is.
const INPUTS: usize = 3 * JOINTS + 1;
/// Shifts come in tenths of the height that the joints span.
const SHIFT_UNIT: f64 = 0.1;
/// A joint is moved by a quarter of that height at most.
const SHIFT_MAX: f64 = 0.25;

/// Moves joints to where they really are. Poses that are none stay as they are.
///
/// # Errors
/// When the network fails.
pub(super) fn refine(model: &mut Model, joints: &mut [Joint]) -> Result<(), InferenceError> {
    let Some((input, span_px)) = network_input(joints) else { return Ok(()) };
    let outputs = model.run(&[(&[1, INPUTS], &input)])?;
    let shifts = match outputs.as_slice() {
        [shift] if shift.data.len() == 2 * JOINTS => &shift.data,
        _ => return Err(model.unexpected(&format!("one list of {} numbers", 2 * JOINTS), &outputs)),
    };
    for (joint, shift) in joints.iter_mut().zip(shifts.chunks_exact(2)) {
        let [x, y] = [0, 1].map(|axis| f64::from(shift.get(axis).copied().unwrap_or(0.0)) * SHIFT_UNIT);
        let shift = glam::DVec2::new(x, y);
        if shift.is_finite() {
            joint.pixel += shift.clamp_length_max(SHIFT_MAX) * span_px;
        }
    }
    Ok(())
}

/// What the network sees, and the height that the joints span in pixels.
fn network_input(joints: &[Joint]) -> Option<(Vec<f32>, f64)> {
    if joints.len() != JOINTS || !joints.iter().all(|joint| joint.pixel.is_finite()) {
        return None;
    }
    let (top, bottom) = joints.iter().fold((f64::MAX, f64::MIN), |(top, bottom), joint| {
        (top.min(joint.pixel.y), bottom.max(joint.pixel.y))
    });
    let span_px = (bottom - top).max(1.0);
    let middle = (joints.get(index::LEFT_HIP)?.pixel + joints.get(index::RIGHT_HIP)?.pixel) / 2.0;
    let mut input = Vec::with_capacity(INPUTS);
    for joint in joints {
        let place = (joint.pixel - middle) * 4.0 / span_px;
        input.extend([place.x as f32, place.y as f32]);
    }
    input.extend(joints.iter().map(|joint| 2.0 * joint.visibility - 1.0));
    input.push((span_px / 50.0).ln() as f32);
    Some((input, span_px))
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::inference::ready;

    /// Somebody who stands and faces the camera, `height_px` high.
    fn standing(height_px: f64, offset: DVec2) -> Vec<Joint> {
        let place = |i: usize| -> (f64, f64) {
            let side = if i % 2 == 1 { 1.0 } else { -1.0 };
            match i {
                0..=10 => (0.02 * side, 0.05),
                11 | 12 => (0.11 * side, 0.18),
                13 | 14 => (0.14 * side, 0.35),
                15..=22 => (0.14 * side, 0.5),
                23 | 24 => (0.07 * side, 0.52),
                25 | 26 => (0.07 * side, 0.75),
                _ => (0.07 * side, 0.97),
            }
        };
        (0..JOINTS)
            .map(|i| {
                let (x, y) = place(i);
                Joint { pixel: offset + DVec2::new(x, y) * height_px, depth_m: 0.0, visibility: 0.9 }
            })
            .collect()
    }

    #[test]
    fn the_input_is_the_one_of_the_training() {
        let joints = standing(100.0, DVec2::new(300.0, 200.0));
        let (input, span_px) = network_input(&joints).unwrap();
        assert_eq!(input.len(), INPUTS);
        assert!((span_px - 92.0).abs() < 1e-9);
        let of = |joint: usize| [input[2 * joint], input[2 * joint + 1]];
        assert!((of(23)[0] - 4.0 * 7.0 / 92.0).abs() < 1e-6 && of(23)[1].abs() < 1e-6);
        assert!((input[2 * JOINTS] - 0.8).abs() < 1e-6);
        assert!((input[INPUTS - 1] - (92.0f32 / 50.0).ln()).abs() < 1e-6);
        // Place does not matter.
        let (moved, _) = network_input(&standing(100.0, DVec2::new(-80.0, 900.0))).unwrap();
        assert!(moved.iter().zip(&input).all(|(a, b)| (a - b).abs() < 1e-5));
    }

    #[test]
    fn a_pose_that_is_none_stays() {
        let mut broken = standing(100.0, DVec2::ZERO);
        broken[5].pixel.x = f64::NAN;
        assert!(network_input(&broken).is_none());
        assert!(network_input(&broken[..20]).is_none());
        let flat = vec![Joint { pixel: DVec2::ONE, depth_m: 0.0, visibility: 0.0 }; JOINTS];
        let (input, span_px) = network_input(&flat).unwrap();
        assert!(input.iter().all(|value| value.is_finite()) && span_px > 0.0);
    }

    #[test]
    fn a_usual_pose_moves_a_little() {
        if !ready() {
            return;
        }
        let mut model = Model::load_shipped(MODEL).unwrap();
        let before = standing(60.0, DVec2::new(300.0, 200.0));
        let mut after = before.clone();
        refine(&mut model, &mut after).unwrap();
        let moved: Vec<f64> = before.iter().zip(&after).map(|(a, b)| a.pixel.distance(b.pixel)).collect();
        assert!(moved.iter().any(|moved| *moved > 0.05), "{moved:?}");
        assert!(moved.iter().all(|moved| *moved < 0.15 * 60.0), "{moved:?}");
    }
}
