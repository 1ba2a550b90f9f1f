//! From a path to poses: heading from the velocity and the ball, gait from the speed, steps tied to the distance run.

use std::f32::consts::{PI, TAU};

use glam::{Quat, Vec2, Vec3};

use crate::{
    SynthesisError, gait,
    motion::{Joint, Motions, Pose},
    rig::Placement,
    trajectories::{Path2, Role, smooth},
};

/// Where a person is, how it faces and what it does, frame by frame.
#[derive(Clone, Debug)]
pub struct Movement {
    /// One entry per frame.
    pub frames: Vec<(Placement, Pose)>,
}

/// Metres that a whole cycle (two steps) covers at a speed.
fn cycle_m(speed: f32) -> f32 {
    const TABLE: [(f32, f32); 6] = [(0.0, 1.0), (1.0, 1.25), (2.0, 1.65), (3.0, 2.4), (4.0, 3.0), (8.0, 4.5)];
    let last = TABLE[TABLE.len() - 1];
    TABLE.windows(2).find(|pair| speed <= pair[1].0).map_or(last.1, |pair| {
        let share = (speed - pair[0].0) / (pair[1].0 - pair[0].0);
        pair[0].1 + (pair[1].1 - pair[0].1) * share
    })
}

/// 0 below `low`, 1 above `high`, smooth between.
fn ease(value: f32, low: f32, high: f32) -> f32 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The nearest turn of `angle` to `reference`.
fn near(angle: f32, reference: f32) -> f32 {
    reference + (angle - reference + PI).rem_euclid(TAU) - PI
}

/// What one person's movement is made from.
#[derive(Clone, Copy, Debug)]
pub struct Habits {
    /// Chooses how the person stands, 0..1.
    pub mood: f32,
    /// Offset of the cycle, 0..1.
    pub phase: f32,
    /// Height compared with 1.80 m: taller people take longer steps.
    pub size: f32,
}

impl Movement {
    /// The movement along `path` at `rate_hz`; `kicks` are the frames in which the person strikes the ball.
    pub fn along(
        path: &Path2,
        ball: &[Vec3],
        rate_hz: f32,
        motions: &Motions,
        habits: Habits,
        kicks: &[usize],
    ) -> Result<Self, SynthesisError> {
        let (walk, run) = (motions.clip("walk")?, motions.clip("run")?);
        let count = path.xz.len();
        let velocity: Vec<Vec2> = (0..count)
            .map(|k| {
                let (before, after) = (k.saturating_sub(1), (k + 1).min(count - 1));
                (path.xz[after] - path.xz[before]) * rate_hz / (after - before).max(1) as f32
            })
            .collect();
        let calm = smooth(&velocity, 0.2 * rate_hz);

        // Heading: where one runs, but towards the ball when slow or when going backwards at an easy pace.
        let mut headings: Vec<Vec2> = Vec::with_capacity(count);
        for k in 0..count {
            let to_ball = (Vec2::new(ball[k].x, ball[k].z) - path.xz[k]).normalize_or(Vec2::Y);
            let speed = calm[k].length();
            let course = calm[k].normalize_or(to_ball);
            let backwards = ease(-course.dot(to_ball), 0.2, 0.8) * (1.0 - ease(speed, 2.2, 3.4));
            let run_share = ease(speed, 0.5, 1.9) * (1.0 - backwards);
            headings.push((to_ball * (1.0 - run_share) + course * run_share).normalize_or(course));
        }
        let mut yaw = headings[0].x.atan2(headings[0].y);
        let mut phase = habits.phase;
        let mut frames = Vec::with_capacity(count);
        for k in 0..count {
            let wanted = near(headings[k].x.atan2(headings[k].y), yaw);
            let most = 7.0 / rate_hz; // radians a body turns per frame
            yaw += ((wanted - yaw) * (9.0 / rate_hz).min(1.0)).clamp(-most, most);
            if k == 0 {
                yaw = wanted;
            }
            let facing = Vec2::new(yaw.sin(), yaw.cos());
            let speed = calm[k].length();
            let ahead = if speed > 0.05 { calm[k].dot(facing) / speed } else { 1.0 };
            let direction = if ahead < -0.25 { -1.0 } else { 1.0 };
            phase += direction * velocity[k].length() / rate_hz / (cycle_m(speed) * habits.size);

            let time = k as f32 / rate_hz;
            let still_mood = if path.role == Role::Goalkeeper { 0.55 } else { habits.mood };
            let stand = gait::stand(still_mood, time * 0.35 + habits.phase);
            let mut pose = stand.blend(&walk.pose(phase).facing_ahead(), ease(speed, 0.15, 0.75));
            let jog = run.pose(phase).facing_ahead().blend(&gait::stride(&gait::JOG, phase), 0.4);
            pose = pose.blend(&jog, ease(speed, 1.7, 2.7));
            pose = pose.blend(&gait::stride(&gait::SPRINT, phase), 0.75 * ease(speed, 4.2, 7.0));
            let sideways = (1.0 - ease(ahead.abs(), 0.4, 0.75)) * ease(speed, 0.5, 1.0);
            let shuffle = gait::sidestep(phase * 1.3);
            let left_of = Vec2::new(facing.y, -facing.x);
            let shuffle = if calm[k].dot(left_of) > 0.0 { shuffle } else { shuffle.mirrored() };
            pose = pose.blend(&shuffle, sideways);
            for &kick in kicks {
                pose = strike(pose, (k as f32 - kick as f32) / rate_hz);
            }
            // The head looks for the ball, as far as a neck turns.
            let to_ball = Vec2::new(ball[k].x, ball[k].z) - path.xz[k];
            let look = (near(to_ball.x.atan2(to_ball.y), yaw) - yaw).clamp(-0.9, 0.9);
            let neck = pose.joint(Joint::Neck);
            *neck = Quat::from_rotation_y(0.6 * look) * *neck;
            let place = Placement { anchor_m: Vec3::new(path.xz[k].x, 0.0, path.xz[k].y), yaw };
            frames.push((place, pose));
        }
        Ok(Self { frames })
    }
}

/// A kick with the right foot laid over a pose; `time` in seconds from the moment the ball is struck.
fn strike(mut pose: Pose, time: f32) -> Pose {
    let share = ease(time, -0.34, -0.16) * (1.0 - ease(time, 0.22, 0.5));
    if share <= 0.0 {
        return pose;
    }
    let swing = ease(time, -0.16, 0.10);
    let thigh = Quat::from_rotation_x(-(-0.55 + 1.55 * swing));
    let knee = Quat::from_rotation_x(1.35 * (1.0 - ease(time, -0.10, 0.04)) + 0.12);
    let trunk = Quat::from_rotation_y(0.35 - 0.6 * swing) * Quat::from_rotation_x(-0.1 + 0.2 * swing);
    for (joint, wanted) in [
        (Joint::ThighR, thigh),
        (Joint::CalfR, knee),
        (Joint::FootR, Quat::from_rotation_x(0.5)),
        (Joint::Chest, trunk),
        (Joint::UpperArmL, Quat::from_rotation_z(0.9) * Quat::from_rotation_x(-0.3 - 0.5 * swing)),
    ] {
        let rotation = pose.joint(joint);
        *rotation = rotation.lerp(wanted, share);
    }
    pose
}

/// Frames in which somebody strikes the ball, as (person, frame): its speed jumps while a player is at it.
#[must_use]
pub fn kicks(people: &[Path2], ball: &[Vec3], rate_hz: f32) -> Vec<(usize, usize)> {
    let mut found: Vec<(usize, usize)> = Vec::new();
    for k in 2..ball.len().saturating_sub(2) {
        let before = (ball[k] - ball[k - 2]) * rate_hz / 2.0;
        let after = (ball[k + 2] - ball[k]) * rate_hz / 2.0;
        if after.distance(before) < 6.0 || after.length() < 6.0 || ball[k].y > 0.9 {
            continue;
        }
        let at = Vec2::new(ball[k].x, ball[k].z);
        let nearest = people
            .iter()
            .enumerate()
            .filter(|(_, person)| person.team.is_some())
            .map(|(index, person)| (index, person.xz[k].distance(at)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((person, distance)) = nearest
            && distance < 1.6
            && found.iter().all(|&(p, frame)| p != person || k - frame > (0.6 * rate_hz) as usize)
        {
            found.push((person, k));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        body::{BaseBody, Build},
        figure::{Detail, dress},
        outfit::{Kit, Outfit},
        rig,
    };
    use rand::SeedableRng;

    fn straight(speed: f32) -> (Path2, Vec<Vec3>) {
        let xz = (0..60).map(|k| Vec2::new(k as f32 * speed / 25.0, 3.0)).collect();
        (
            Path2 { role: Role::Player, team: Some(0), number: Some(7), xz },
            vec![Vec3::new(300.0, 0.11, 3.0); 60],
        )
    }

    #[test]
    fn a_standing_foot_slides_little_and_feet_touch_the_ground() {
        let base = BaseBody::load().unwrap();
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(4);
        let build = Build { female: 0.0, origin: [0.3, 0.3, 0.4], muscle: 0.2, weight: 0.0, height_m: 1.8 };
        let kit = Kit::random(&mut rng, "k".into());
        let figure =
            dress(&base, base.shape(&build), Outfit::random(&mut rng, kit, None, false), Detail::Broadcast);
        let motions = Motions::shipped().unwrap();
        for speed in [1.2, 4.0] {
            let (path, ball) = straight(speed);
            let habits = Habits { mood: 0.9, phase: 0.0, size: 1.0 };
            let movement = Movement::along(&path, &ball, 25.0, &motions, habits, &[]).unwrap();
            let mut slides = Vec::new();
            let mut previous: Option<(usize, Vec3)> = None;
            for (placement, pose) in &movement.frames[10..50] {
                let posed = rig::pose(&figure, pose).placed(placement);
                let lowest = posed.positions.iter().map(|p| p.y).fold(f32::MAX, f32::min);
                assert!((-0.01..0.2).contains(&lowest), "lowest point at {lowest} m");
                let hips = (posed.landmarks[23] + posed.landmarks[24]) / 2.0;
                let aside = Vec2::new(hips.x - placement.anchor_m.x, hips.z - placement.anchor_m.z);
                assert!(aside.length() < 0.01, "the anchor is {} m from under the hips", aside.length());
                assert!((placement.yaw - PI / 2.0).abs() < 0.05, "runs along +x");
                // The toe that stands, and how far it moved since the frame before.
                let toe = if posed.landmarks[31].y < posed.landmarks[32].y { 31 } else { 32 };
                if let Some((before, place)) = previous
                    && before == toe
                {
                    slides.push(place.distance(posed.landmarks[toe]) * 25.0);
                }
                previous = Some((toe, posed.landmarks[toe]));
            }
            slides.sort_by(f32::total_cmp);
            let median = slides[slides.len() / 2];
            assert!(median < 0.5 * speed, "at {speed} m/s the standing toe slides at {median} m/s");
        }
    }

    #[test]
    fn a_kick_is_found_where_the_ball_leaves() {
        let (path, _) = straight(0.0);
        let ball: Vec<Vec3> =
            (0..60).map(|k| Vec3::new(0.4 + (k as f32 - 30.0).max(0.0) * 0.8, 0.11, 3.0)).collect();
        let found = kicks(&[path], &ball, 25.0);
        assert_eq!(found.len(), 1);
        assert!(found[0].1.abs_diff(30) <= 2, "{found:?}");
    }
}
