//! Poses smoothed along a track: on the upright plane through the person, where the camera's motion is gone.
//!
//! The pose network looks at every frame alone: joints jitter by a few centimetres, now and then left and right are mistaken
//! for each other or a joint jumps to a neighbour, and in some frames there is no pose at all. A track tells what fits.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use protocol::camera::Camera;

use crate::{
    calibration::CameraEstimate,
    pose::{JOINTS, Joint, POSE_SCORE_MIN, Person, lift_upright, upright_normal},
    tracking::{Sighting, Track},
};

/// A joint is smoothed over this many frames before and after: a fifth of a second in all, in which a kick is still a parabola.
const REACH_FRAMES: usize = 2;
/// A joint farther than this from its median over the frames around is a mistake of the network, metres.
const OUTLIER_M: f64 = 0.35;
/// A missing pose is made from those before and after when they are at most this many frames apart.
const GAP_FRAMES: usize = 12;
/// Exchanging left and right costs this much, and a joint's step from frame to frame counts up to this, metres: how far a
/// foot comes in a frame at most.
const EXCHANGE_M: f64 = 0.03;
const STEP_M: f64 = 0.5;
/// Unseen joints count this much at least.
const WEIGHT_MIN: f64 = 0.05;

/// A joint on the upright plane through the person: metres to the right and up from the ground point, and into depth.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Placed {
    at_m: DVec2,
    depth_m: f64,
    weight: f64,
}

/// The pose of one sighting.
struct Posed {
    frame: usize,
    joints: Vec<Placed>,
}

/// What was changed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PoseChanges {
    /// Poses whose left and right were exchanged.
    pub exchanged: usize,
    /// Whose pose was made from those before and after.
    pub filled: Vec<Sighting>,
    /// Joints that were moved to where the frames around put them.
    pub outliers: usize,
}

/// Smooths the joints of everybody along their tracks; `people` and `cameras` have an entry per frame.
pub fn smooth_poses(people: &mut [Vec<Person>], tracks: &[Track], cameras: &[CameraEstimate]) -> PoseChanges {
    let mut changes = PoseChanges::default();
    for track in tracks {
        let planes: BTreeMap<usize, (Sighting, Plane)> = track
            .sightings
            .iter()
            .filter_map(|sighting| {
                let person = people.get(sighting.frame)?.get(sighting.person_index)?;
                let camera = cameras.get(sighting.frame)?.camera?;
                Some((sighting.frame, (*sighting, Plane::of(camera, person.ground_m))))
            })
            .collect();
        let mut poses: Vec<Posed> = planes
            .values()
            .filter_map(|(sighting, plane)| {
                let person = people.get(sighting.frame)?.get(sighting.person_index)?;
                let seen = person.pose_score >= POSE_SCORE_MIN && person.joints.len() == JOINTS;
                let joints = person.joints.iter().map(|joint| plane.place(joint));
                Some(Posed { frame: sighting.frame, joints: seen.then(|| joints.collect()).flatten()? })
            })
            .collect();
        changes.exchanged += set_sides_right(&mut poses);
        changes.outliers += settle_outliers(&mut poses);
        for (frame, (sighting, plane)) in &planes {
            let person = people.get_mut(*frame).and_then(|people| people.get_mut(sighting.person_index));
            let Some(person) = person else { continue };
            let joints: Option<Vec<Placed>> = match poses.binary_search_by_key(frame, |pose| pose.frame) {
                Ok(index) => Some(smoothed(&poses, index)),
                Err(next) => {
                    let filled = between(&poses, next, *frame);
                    changes.filled.extend(filled.is_some().then_some(*sighting));
                    filled
                }
            };
            for (joint, placed) in person.joints.iter_mut().zip(joints.into_iter().flatten()) {
                if let Some(pixel) = plane.pixel(placed.at_m) {
                    let visibility = (placed.weight as f32).clamp(0.0, 1.0);
                    *joint = Joint { pixel, depth_m: placed.depth_m as f32, visibility };
                }
            }
        }
    }
    changes
}

/// The upright plane through a person that faces the camera.
struct Plane {
    camera: Camera,
    ground_m: DVec3,
    right: DVec3,
}

impl Plane {
    fn of(camera: Camera, ground_m: DVec3) -> Self {
        let right = DVec3::Y.cross(upright_normal(&camera, ground_m));
        Self { camera, ground_m, right }
    }

    fn place(&self, joint: &Joint) -> Option<Placed> {
        let point = lift_upright(&self.camera, joint.pixel, self.ground_m)? - self.ground_m;
        let weight = f64::from(joint.visibility).max(WEIGHT_MIN);
        Some(Placed {
            at_m: DVec2::new(point.dot(self.right), point.y),
            depth_m: f64::from(joint.depth_m),
            weight,
        })
    }

    fn pixel(&self, at_m: DVec2) -> Option<DVec2> {
        self.camera.project(self.ground_m + self.right * at_m.x + DVec3::Y * at_m.y)
    }
}

/// The joint on the other side of the body; BlazePose's order.
fn opposite(joint: usize) -> usize {
    match joint {
        0 => 0,
        1..=3 => joint + 3,
        4..=6 => joint - 3,
        _ if joint % 2 == 1 => joint + 1,
        _ => joint - 1,
    }
}

/// Exchanges left and right where the poses before and after say so: the cheapest course through all poses, by dynamic
/// programming. Returns how many were exchanged.
fn set_sides_right(poses: &mut [Posed]) -> usize {
    // Two states per pose: as seen, exchanged.
    let mut costs: Vec<[f64; 2]> = Vec::with_capacity(poses.len());
    let mut from: Vec<[usize; 2]> = Vec::with_capacity(poses.len());
    for (index, pose) in poses.iter().enumerate() {
        let mut cost = [0.0, EXCHANGE_M];
        let mut best = [0, 1];
        if let (Some(before), Some(known)) = (index.checked_sub(1).and_then(|i| poses.get(i)), costs.last()) {
            let frames = (pose.frame - before.frame).max(1) as f64;
            let (same, crossed) = (step(before, pose, false), step(before, pose, true));
            for state in 0..2 {
                let come = |other: usize| known[other] + if other == state { same } else { crossed } / frames;
                best[state] = usize::from(come(1) < come(0));
                cost[state] += come(best[state]);
            }
        }
        costs.push(cost);
        from.push(best);
    }
    let mut state = costs.last().map_or(0, |last| usize::from(last[1] < last[0]));
    let mut exchanged = 0;
    for (pose, from) in poses.iter_mut().zip(from).rev() {
        if state == 1 {
            exchanged += 1;
            pose.joints = (0..JOINTS).filter_map(|joint| pose.joints.get(opposite(joint)).copied()).collect();
        }
        state = from[state];
    }
    exchanged
}

/// Mean step of a joint between two poses, metres; of each to its opposite when `crossed`.
fn step(before: &Posed, after: &Posed, crossed: bool) -> f64 {
    let pairs = before.joints.iter().enumerate().filter_map(|(joint, placed)| {
        let other = after.joints.get(if crossed { opposite(joint) } else { joint })?;
        Some(placed.at_m.distance(other.at_m).min(STEP_M))
    });
    pairs.sum::<f64>() / JOINTS as f64
}

/// Puts joints that jump for a frame to the median of the frames around; they hardly count from then on. Returns how many.
fn settle_outliers(poses: &mut [Posed]) -> usize {
    let mut jumped: Vec<(usize, usize, DVec2)> = Vec::new();
    for (index, pose) in poses.iter().enumerate() {
        let window: Vec<&Posed> = around(poses, index).collect();
        if window.len() <= REACH_FRAMES {
            continue;
        }
        for (joint, raw) in pose.joints.iter().enumerate() {
            let places = window.iter().filter_map(|pose| pose.joints.get(joint)).map(|placed| placed.at_m);
            let middle = median(places);
            if middle.distance(raw.at_m) > OUTLIER_M {
                jumped.push((index, joint, middle));
            }
        }
    }
    for &(index, joint, middle) in &jumped {
        if let Some(placed) = poses.get_mut(index).and_then(|pose| pose.joints.get_mut(joint)) {
            *placed = Placed { at_m: middle, weight: WEIGHT_MIN * WEIGHT_MIN, ..*placed };
        }
    }
    jumped.len()
}

/// The poses within [`REACH_FRAMES`] of one, itself included.
fn around(poses: &[Posed], index: usize) -> impl Iterator<Item = &Posed> {
    let window = poses.get(index.saturating_sub(REACH_FRAMES)..(index + REACH_FRAMES + 1).min(poses.len()));
    let frame = poses.get(index).map_or(0, |own| own.frame);
    window.into_iter().flatten().filter(move |pose| pose.frame.abs_diff(frame) <= REACH_FRAMES)
}

/// The median of each coordinate.
fn median(places: impl Iterator<Item = DVec2>) -> DVec2 {
    let (mut x, mut y): (Vec<f64>, Vec<f64>) = places.map(|place| (place.x, place.y)).unzip();
    let middle = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    DVec2::new(middle(&mut x), middle(&mut y))
}

/// One pose smoothed with its neighbours: each joint on a parabola over time.
fn smoothed(poses: &[Posed], index: usize) -> Vec<Placed> {
    let Some(own) = poses.get(index) else { return Vec::new() };
    let joints = own.joints.iter().enumerate().map(|(joint, raw)| {
        let points: Vec<(f64, Placed)> = around(poses, index)
            .filter_map(|pose| Some((pose.frame as f64 - own.frame as f64, *pose.joints.get(joint)?)))
            .collect();
        parabola(&points).map_or(*raw, |placed| Placed { weight: raw.weight, ..placed })
    });
    joints.collect()
}

/// The value at 0 of the weighted least-squares parabola through at least four points on both sides (a line in depth, which is
/// noisier); `None` with fewer.
fn parabola(points: &[(f64, Placed)]) -> Option<Placed> {
    let both = points.iter().any(|(t, _)| *t < 0.0) && points.iter().any(|(t, _)| *t > 0.0);
    if points.len() < 4 || !both {
        return None;
    }
    let (mut normal, mut right) = (nalgebra::Matrix3::zeros(), nalgebra::Matrix3x2::zeros());
    let (mut depth, mut weights) = (0.0, 0.0);
    for (t, placed) in points {
        let row = nalgebra::Vector3::new(1.0, *t, t * t);
        normal += row * row.transpose() * placed.weight;
        right += row * nalgebra::RowVector2::new(placed.at_m.x, placed.at_m.y) * placed.weight;
        depth += placed.weight * placed.depth_m;
        weights += placed.weight;
    }
    let solved = normal.cholesky()?.solve(&right);
    let at_m = DVec2::new(solved[(0, 0)], solved[(0, 1)]);
    (at_m.is_finite() && weights > 0.0).then(|| Placed {
        at_m,
        depth_m: depth / weights,
        weight: weights / points.len() as f64,
    })
}

/// The pose of a frame without one, between the poses before and after; `None` when they are far.
fn between(poses: &[Posed], next: usize, frame: usize) -> Option<Vec<Placed>> {
    let before = next.checked_sub(1).and_then(|index| poses.get(index));
    let (before, after) = match (before, poses.get(next)) {
        (Some(before), Some(after)) => (before, after),
        (Some(only), None) | (None, Some(only)) => (only, only),
        (None, None) => return None,
    };
    let apart = frame.abs_diff(before.frame).max(frame.abs_diff(after.frame));
    if apart > GAP_FRAMES {
        return None;
    }
    let span = (after.frame - before.frame).max(1) as f64;
    let part = (frame.saturating_sub(before.frame) as f64 / span).min(1.0);
    let mix = |a: f64, b: f64| a + (b - a) * part;
    let joints = before.joints.iter().zip(&after.joints).map(|(a, b)| Placed {
        at_m: a.at_m.lerp(b.at_m, part),
        depth_m: mix(a.depth_m, b.depth_m),
        // Not seen: joints of such a pose are a guess.
        weight: WEIGHT_MIN,
    });
    Some(joints.collect())
}

#[cfg(test)]
mod tests {
    use protocol::manifest::PersonId;

    use super::*;

    fn camera() -> Camera {
        Camera::looking_at((1280, 720), 1800.0, DVec3::new(0.0, 18.0, 75.0), DVec3::new(5.0, 0.0, 0.0))
    }

    /// Where joint `joint` truly is in frame `frame`, metres right and up: an arm and a leg that swing.
    fn truth(joint: usize, frame: usize) -> DVec2 {
        let side = if joint % 2 == 1 { 1.0 } else { -1.0 };
        let swing = (frame as f64 * 0.3 + joint as f64).sin();
        DVec2::new(side * 0.2 + 0.15 * swing, 0.1 + 0.05 * joint as f64)
    }

    fn scene(frames: usize, noise_m: f64) -> (Vec<Vec<Person>>, Vec<Track>, Vec<CameraEstimate>) {
        let mut state = 7_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 40) as f64 / f64::from(1 << 23) - 1.0) * noise_m
        };
        let ground_m = DVec3::new(4.0, 0.0, -3.0);
        let plane = Plane::of(camera(), ground_m);
        let people = (0..frames)
            .map(|frame| {
                let joints = (0..JOINTS)
                    .map(|joint| {
                        let at = truth(joint, frame) + DVec2::new(noise(), noise());
                        Joint { pixel: plane.pixel(at).unwrap(), depth_m: 0.0, visibility: 0.9 }
                    })
                    .collect();
                vec![Person { joints, ground_m, neck_m: ground_m, ..Person::blank() }]
            })
            .collect();
        let sightings = (0..frames).map(|frame| Sighting { frame, person_index: 0 }).collect();
        let cameras = vec![CameraEstimate { camera: Some(camera()), ..CameraEstimate::default() }; frames];
        (people, vec![Track { person: PersonId(1), sightings }], cameras)
    }

    /// Root mean square distance of the joints from the truth, metres.
    fn error_m(people: &[Vec<Person>], frames: impl Iterator<Item = usize>) -> f64 {
        let plane = Plane::of(camera(), people[0][0].ground_m);
        let squares: Vec<f64> = frames
            .flat_map(|frame| {
                let joints = people[frame][0].joints.iter().enumerate();
                let square = |(joint, seen): (usize, &Joint)| {
                    plane.place(seen).unwrap().at_m.distance_squared(truth(joint, frame))
                };
                joints.map(square).collect::<Vec<f64>>()
            })
            .collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }

    #[test]
    fn noise_shrinks_and_motion_stays() {
        let (mut people, tracks, cameras) = scene(30, 0.04);
        let before = error_m(&people, 2..28);
        let changes = smooth_poses(&mut people, &tracks, &cameras);
        assert!(error_m(&people, 2..28) < 0.8 * before, "{} of {before}", error_m(&people, 2..28));
        assert_eq!((changes.exchanged, changes.filled.len()), (0, 0));
        let (mut still, tracks, cameras) = scene(30, 0.0);
        smooth_poses(&mut still, &tracks, &cameras);
        assert!(error_m(&still, 0..30) < 0.005, "{}", error_m(&still, 0..30));
    }

    #[test]
    fn exchanged_sides_jumping_joints_and_missing_poses_are_mended() {
        let (mut people, tracks, cameras) = scene(30, 0.0);
        for frame in [9, 10] {
            let seen = people[frame][0].joints.clone();
            people[frame][0].joints = (0..JOINTS).map(|joint| seen[opposite(joint)]).collect();
        }
        people[15][0].joints[27].pixel.x += 60.0;
        for frame in people.iter_mut().take(23).skip(20) {
            frame[0].pose_score = 0.0;
            frame[0].joints.iter_mut().for_each(|joint| joint.pixel = DVec2::ZERO);
        }
        let changes = smooth_poses(&mut people, &tracks, &cameras);
        let filled: Vec<usize> = changes.filled.iter().map(|sighting| sighting.frame).collect();
        assert_eq!((changes.exchanged, filled, changes.outliers), (2, vec![20, 21, 22], 1));
        assert!(error_m(&people, 0..20) < 0.02, "{}", error_m(&people, 0..20));
        assert!(error_m(&people, 20..23) < 0.08, "{}", error_m(&people, 20..23));
    }

    #[test]
    fn tracks_that_point_nowhere_change_nothing() {
        let (mut people, _, cameras) = scene(5, 0.0);
        let before = people.clone();
        let lost = Track { person: PersonId(1), sightings: vec![Sighting { frame: 9, person_index: 4 }] };
        assert_eq!(smooth_poses(&mut people, &[lost], &cameras), PoseChanges::default());
        assert_eq!(smooth_poses(&mut [], &[], &[]), PoseChanges::default());
        assert_eq!(people, before);
    }
}
