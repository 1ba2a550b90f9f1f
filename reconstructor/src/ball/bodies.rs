//! Feet, heads and hands near the ball: who can have touched it, and how far away that places it.

use glam::{DVec2, DVec3};
use protocol::camera::Camera;

use crate::pose::{Person, index, lift_upright};

/// What of a body may play a ball.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Part {
    /// Ankle, heel or toe.
    Foot,
    /// Between foot and hip.
    Knee,
    /// Hip or shoulder.
    Trunk,
    /// Nose or ear.
    Head,
    /// Wrist or hand.
    Hand,
}

/// BlazePose's landmarks that stand for the parts; hands are those beyond the wrist, too.
const PARTS: [(Part, &[usize]); 5] = [
    (
        Part::Foot,
        &[
            index::LEFT_ANKLE,
            index::RIGHT_ANKLE,
            index::LEFT_HEEL,
            index::RIGHT_HEEL,
            index::LEFT_TOE,
            index::RIGHT_TOE,
        ],
    ),
    (Part::Knee, &[index::LEFT_KNEE, index::RIGHT_KNEE]),
    (Part::Trunk, &[index::LEFT_HIP, index::RIGHT_HIP, index::LEFT_SHOULDER, index::RIGHT_SHOULDER]),
    (Part::Head, &[index::NOSE, 7, 8]),
    (Part::Hand, &[index::LEFT_WRIST, index::RIGHT_WRIST, 19, 20]),
];

/// A part of a body near a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Near {
    pub(super) part: Part,
    /// From the joint to the pixel, metres at the body's distance.
    pub(super) apart_m: f64,
    /// The pixel lifted on the body's upright plane, world metres.
    pub(super) point: DVec3,
}

/// The nearest joint of each part of anybody, nearest first; only within `reach_m`.
pub(super) fn near(camera: &Camera, people: &[Person], pixel: DVec2, reach_m: f64) -> Vec<Near> {
    let mut found: Vec<Near> = Vec::new();
    for person in people {
        let scale = camera.pixels_per_metre(person.ground_m);
        let middle = person.bounds.centre();
        let size = person.bounds.size();
        let far = (pixel - middle).abs() - size / 2.0;
        if !scale.is_finite() || far.max_element() > reach_m * scale {
            continue;
        }
        let Some(point) = lift_upright(camera, pixel, person.ground_m) else { continue };
        for (part, joints) in PARTS {
            let apart_px = joints
                .iter()
                .filter_map(|&joint| person.joints.get(joint))
                .map(|joint| joint.pixel.distance(pixel))
                .fold(f64::INFINITY, f64::min);
            if apart_px < reach_m * scale {
                found.push(Near { part, apart_m: apart_px / scale, point });
            }
        }
    }
    found.sort_by(|a, b| a.apart_m.total_cmp(&b.apart_m).then(a.part.cmp(&b.part)));
    found
}
