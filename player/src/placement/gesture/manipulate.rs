//! A match in the hand: dragged by one pointer, turned and scaled by two or by a handle at a corner.
//!
//! Every grip remembers the pose it started from, so that a move is a function of where the pointers are now: nothing
//! drifts, and cancelling is going back.

use glam::{DVec2, DVec3};

use super::{Pointer, Ray, stand::Ground};
use crate::placement::{TabletopPose, fit::Chart};

/// A press becomes a drag when the pointer has turned by this much, radians: hands shake when they pinch.
const DRAG_STARTS: f64 = 0.015;
/// Handles lie outside the turf's corners by this share of its size, and are this large at least, metres.
const HANDLE_OUTSIDE: f64 = 1.06;
const HANDLE_SHARE: f64 = 0.07;
const HANDLE_LEAST_M: f64 = 0.025;
/// The turf may be taken hold of a little outside too.
const TURF_SLACK: f64 = 1.04;
/// Two pointers closer than this tell no direction, metres.
const LEAST_SPAN_M: f64 = 0.01;
/// The farthest that a match in the air can be pushed from the one who pushes, metres.
const MOST_REACH_M: f64 = 4.0;

/// What is being done to the match by hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Grip {
    /// Nothing.
    #[default]
    None,
    /// Pressed, not yet moved.
    Pressed { pointer: Pointer, ray: Ray, at_m: DVec3, start: TabletopPose },
    /// Follows a pointer that took it at `at_m`.
    Drag { pointer: Pointer, at_m: DVec3, start: TabletopPose },
    /// Turned and scaled about its centre.
    Handle { pointer: Pointer, at_m: DVec3, start: TabletopPose },
    /// Moved, turned and scaled by both; left, then right.
    Both { at_m: [DVec3; 2], start: TabletopPose },
}

impl Grip {
    /// The pose to go back to.
    pub(super) fn start(&self) -> Option<TabletopPose> {
        match *self {
            Self::None => None,
            Self::Pressed { start, .. }
            | Self::Drag { start, .. }
            | Self::Handle { start, .. }
            | Self::Both { start, .. } => Some(start),
        }
    }

    /// Whether a pointer takes part.
    pub(super) fn holds(&self, pointer: Pointer) -> bool {
        match *self {
            Self::None => false,
            Self::Pressed { pointer: holder, .. }
            | Self::Drag { pointer: holder, .. }
            | Self::Handle { pointer: holder, .. } => holder == pointer,
            Self::Both { .. } => true,
        }
    }
}

/// Middles of the handles, room metres on the ground.
pub(super) fn handles(pose: &TabletopPose, half_turf_m: [f64; 2]) -> [DVec3; 4] {
    let [x, z] = half_turf_m.map(|half| half * HANDLE_OUTSIDE * pose.scale);
    [(x, z), (x, -z), (-x, -z), (-x, z)]
        .map(|(x, z)| pose.foot_m() + pose.orientation * DVec3::new(x, 0.0, z))
}

/// Where a ray meets the ground, within reach.
pub(super) fn on_ground(ground: &Ground, ray: &Ray) -> Option<DVec3> {
    let along = ground.plane().hit(ray.origin_m, ray.direction)?;
    let way = ray.direction * along;
    let reach = if ground.surface().is_some() { 100.0 } else { MOST_REACH_M };
    (way.is_finite() && way.length() < reach).then(|| ray.origin_m + way)
}

/// A new grip of a match that nobody holds; `None` when the ray passes it.
pub(super) fn grip(
    pointer: Pointer,
    ray: &Ray,
    ground: &Ground,
    pose: &TabletopPose,
    half_turf_m: [f64; 2],
) -> Option<Grip> {
    let at_m = on_ground(ground, ray)?;
    let handle_m = (HANDLE_SHARE * pose.scale * 2.0 * half_turf_m[0]).max(HANDLE_LEAST_M);
    if handles(pose, half_turf_m).iter().any(|handle| handle.distance(at_m) <= handle_m) {
        return Some(Grip::Handle { pointer, at_m, start: *pose });
    }
    let on_pitch = pose.to_pitch(at_m).abs();
    let inside = on_pitch.x <= half_turf_m[0] * TURF_SLACK && on_pitch.z <= half_turf_m[1] * TURF_SLACK;
    inside.then_some(Grip::Pressed { pointer, ray: *ray, at_m, start: *pose })
}

/// The grip after a pointer moved: a press that has moved far enough is a drag.
pub(super) fn after_move(grip: Grip, pointer: Pointer, ray: &Ray) -> Grip {
    match grip {
        Grip::Pressed { pointer: holder, ray: pressed, at_m, start }
            if holder == pointer && pressed.direction.angle_between(ray.direction) > DRAG_STARTS =>
        {
            Grip::Drag { pointer, at_m, start }
        }
        other => other,
    }
}

/// The pose that a grip asks for with the pointers (left, right) where they are; `None` to leave it.
pub(super) fn held(
    grip: &Grip,
    rays: [Option<Ray>; 2],
    ground: &Ground,
    scale_limits: [f64; 2],
) -> Option<TabletopPose> {
    let hit = |pointer: Pointer| on_ground(ground, rays[pointer as usize].as_ref()?);
    let [least, most] = scale_limits;
    match *grip {
        Grip::None | Grip::Pressed { .. } => None,
        Grip::Drag { pointer, at_m, start } => {
            let foot = ground.nearest_place(start.foot_m() + hit(pointer)? - at_m);
            Some(placed(ground, &start, foot, 0.0, start.scale))
        }
        Grip::Handle { pointer, at_m, start } => {
            let foot = start.foot_m();
            let (growth, turn) = compared(ground, &start, at_m - foot, hit(pointer)? - foot)?;
            Some(placed(ground, &start, foot, turn, (start.scale * growth).clamp(least, most)))
        }
        Grip::Both { at_m: [left_0, right_0], start } => {
            let (left, right) = (hit(Pointer::Left)?, hit(Pointer::Right)?);
            let (growth, turn) = compared(ground, &start, right_0 - left_0, right - left)?;
            let scale = (start.scale * growth).clamp(least, most);
            // The point between the hands stays between the hands, also when the scale is at its limit.
            let from_middle = start.foot_m() - (left_0 + right_0) / 2.0;
            let turned = glam::DQuat::from_axis_angle(ground.plane().normal, turn) * from_middle;
            let foot = (left + right) / 2.0 + turned * (scale / start.scale);
            Some(placed(ground, &start, ground.nearest_place(foot), turn, scale))
        }
    }
}

/// Growth and turn (about the ground's normal) that take one span on the ground to another.
fn compared(ground: &Ground, start: &TabletopPose, from: DVec3, to: DVec3) -> Option<(f64, f64)> {
    let chart = Chart::new(ground.plane(), start.foot_m(), start.orientation * DVec3::X);
    let flat = |span: DVec3| DVec2::new(span.dot(chart.along()), span.dot(chart.towards()));
    let (from, to) = (flat(from), flat(to));
    if from.length() < LEAST_SPAN_M || to.length() < LEAST_SPAN_M {
        return None;
    }
    // z is to the right of x seen from above, so a positive angle in (x, z) is clockwise.
    Some((to.length() / from.length(), -from.angle_to(to)))
}

fn placed(ground: &Ground, start: &TabletopPose, foot_m: DVec3, turn: f64, scale: f64) -> TabletopPose {
    let normal = ground.plane().normal;
    let along = glam::DQuat::from_axis_angle(normal, turn) * (start.orientation * DVec3::X);
    TabletopPose::standing_on(ground.plane().project(foot_m), normal, along, scale)
}
