//! The people behind the cameras: they see the play a little late, turn and zoom smoothly, and keep the horizon level.
//! Main camera over the halfway line, high camera behind a goal, close-ups from beside the main camera.

use glam::{DVec2, DVec3, Vec2, Vec3};
use protocol::{camera::Camera, pitch::Pitch};

use crate::{
    SynthesisError,
    render::Focus,
    trajectories::{Path2, smooth},
};

/// Where the main camera stands and how it frames the play.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tripod {
    /// World metres.
    pub position: DVec3,
    /// Wanted height of a player of 1.80 m at the middle of the picture, as a share of the picture's height.
    pub player_share: f64,
    /// How much tighter the play before a goal is framed, as a factor.
    pub tighter: f64,
    /// Seconds that the operator is behind the play.
    pub reaction_s: f64,
    /// How fast the operator turns after it: the angular frequency of a critically damped spring, 1/s.
    pub quickness: f64,
    /// The lens's radial distortion, as in [`Camera`].
    pub k1: f64,
    /// The other camera, behind the goals.
    pub behind: BehindGoal,
}

/// Where the high camera behind a goal stands, and how near to the goal it looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BehindGoal {
    /// Distance from the goal line, metres.
    pub beyond_m: f64,
    /// Height, metres.
    pub height_m: f64,
    /// Distance from the pitch's long axis, metres towards the main camera.
    pub aside_m: f64,
    /// 0 when it shows the pitch in its depth, 1 when the penalty area before it fills the picture.
    pub near: f64,
}

impl Default for BehindGoal {
    fn default() -> Self {
        Self { beyond_m: 34.0, height_m: 17.0, aside_m: 0.0, near: 0.0 }
    }
}

impl Default for Tripod {
    fn default() -> Self {
        Self {
            position: DVec3::new(0.0, 17.0, 62.0),
            player_share: 0.088,
            tighter: 1.0,
            reaction_s: 0.15,
            quickness: 4.5,
            k1: 0.0,
            behind: BehindGoal::default(),
        }
    }
}

/// A main camera as somebody has it: where it stands and how large it shows the players.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Platform {
    /// World metres.
    pub position_m: DVec3,
    /// Wanted height of a player of 1.80 m in the middle of the picture, pixels; as the drawn ground has it when absent.
    pub player_px: Option<f64>,
}

impl Platform {
    /// `tripod` moved here.
    pub fn tripod(&self, tripod: Tripod, size_px: (u32, u32)) -> Result<Tripod, SynthesisError> {
        let Self { position_m, player_px } = *self;
        let player_share = player_px.map_or(tripod.player_share, |px| px / f64::from(size_px.1));
        let far = position_m.x.abs() <= 150.0 && position_m.z.abs() <= 150.0 && position_m.z.abs() >= 1.0;
        if !(far && (1.0..=120.0).contains(&position_m.y) && (0.01..=0.6).contains(&player_share)) {
            return Err(SynthesisError::Options(format!(
                "a camera at {position_m} showing players {player_share:.3} of the picture high: it must stand within 150 m \
                 of the centre mark, beside the halfway line's axis by at least 1 m, 1 to 120 m high, and show players 0.01 to 0.6 of the picture high"
            )));
        }
        Ok(Tripod { position: position_m, player_share, ..tripod })
    }
}

/// The play that operators follow, one sample per frame.
#[derive(Clone, Copy)]
pub struct Play<'a> {
    /// Everybody's path.
    pub people: &'a [Path2],
    /// Middle of the ball.
    pub ball: &'a [Vec3],
    /// Size of the pitch.
    pub pitch: &'a Pitch,
    /// Frames per second.
    pub rate_hz: f32,
    /// Size of the picture.
    pub size_px: (u32, u32),
}

/// Players are drawn between these heights, as shares of the picture's height (25 and 150 px of 720).
const PLAYER_SHARES: [f64; 2] = [0.035, 0.208];

impl Play<'_> {
    /// Where the play is: the ball, and the people near it, on the ground.
    fn aims(&self) -> Vec<Vec2> {
        let raw: Vec<Vec2> = self
            .ball
            .iter()
            .enumerate()
            .map(|(k, ball)| {
                let at = Vec2::new(ball.x, ball.z);
                let (mut sum, mut weights) = (at * 4.5, 4.5);
                for person in self.people.iter().filter(|person| person.team.is_some()) {
                    let weight = (-(person.xz[k].distance(at) / 14.0).powi(2)).exp();
                    sum += person.xz[k] * weight;
                    weights += weight;
                }
                sum / weights
            })
            .collect();
        // Nobody follows the bounces of the ball.
        smooth(&raw, 0.2 * self.rate_hz)
    }

    /// A value as somebody follows it: seen late, looked ahead as much, caught up with like a critically damped spring.
    fn followed(&self, wanted: &[DVec2], reaction_s: f64, quickness: f64) -> Vec<DVec2> {
        let step = 1.0 / f64::from(self.rate_hz);
        let late = (reaction_s / step).round() as usize;
        let Some(&first) = wanted.first() else { return Vec::new() };
        let (mut at, mut speed) = (first, DVec2::ZERO);
        (0..wanted.len())
            .map(|k| {
                let seen = wanted[k.saturating_sub(late)];
                let before = wanted[k.saturating_sub(late + 3)];
                // What moves on steadily is led, by the time that hand and eye need.
                let ahead = (seen - before) / (3.0 * step) * (reaction_s + 1.0 / quickness);
                // Four small steps keep the spring stable at any frame rate.
                for _ in 0..4 {
                    let pull = (seen + ahead - at) * quickness * quickness - speed * 2.0 * quickness;
                    speed += pull * step / 4.0;
                    at += speed * step / 4.0;
                }
                at
            })
            .collect()
    }

    /// Cameras at `position` that follow ground points `aims` while players there are `shares` of the picture high.
    fn filmed(&self, tripod: &Tripod, aims: &[Vec2], shares: impl Fn(Vec2) -> f64) -> Vec<Camera> {
        let position = tripod.position;
        // The hand moves angles and the logarithm of the focal length, not points of the ground.
        let (mut angles, mut zooms) = (Vec::new(), Vec::new());
        for aim in aims {
            let way = DVec3::new(f64::from(aim.x), 0.6, f64::from(aim.y)) - position;
            angles.push(DVec2::new(way.x.atan2(-way.z), (-way.y).atan2(way.x.hypot(way.z))));
            let share = shares(*aim).clamp(PLAYER_SHARES[0], PLAYER_SHARES[1]);
            zooms.push(DVec2::new((share * f64::from(self.size_px.1) * way.length() / 1.8).ln(), 0.0));
        }
        // From one heading to the next the short way round.
        for k in 1..angles.len() {
            let turn = std::f64::consts::TAU;
            angles[k].x -= ((angles[k].x - angles[k - 1].x) / turn).round() * turn;
        }
        let angles = self.followed(&angles, tripod.reaction_s, tripod.quickness);
        let zooms = self.followed(&zooms, 2.0 * tripod.reaction_s, 0.35 * tripod.quickness);
        let camera = |(angle, zoom): (DVec2, DVec2)| {
            let (sin, cos) = angle.y.sin_cos();
            let ahead = DVec3::new(angle.x.sin() * cos, -sin, -angle.x.cos() * cos);
            let camera = Camera::looking_at(self.size_px, zoom.x.exp(), position, position + ahead);
            Camera { k1: tripod.k1, ..camera }
        };
        angles.into_iter().zip(zooms).map(camera).collect()
    }

    /// The main camera, one per frame.
    #[must_use]
    pub fn main_camera(&self, tripod: &Tripod) -> Vec<Camera> {
        let (half_x, half_z) = (self.pitch.length_m as f32 / 2.0, self.pitch.width_m as f32 / 2.0);
        let aims: Vec<Vec2> = self
            .aims()
            .iter()
            .map(|aim| {
                let x = aim.x.clamp(7.5 - half_x, half_x - 7.5);
                Vec2::new(x, (aim.y * 0.55).clamp(-0.47 * half_z, 0.38 * half_z))
            })
            .collect();
        self.filmed(tripod, &aims, |aim| {
            let before_goal = ((aim.x.abs() - half_x + 32.0) / 22.0).clamp(0.0, 1.0);
            tripod.player_share * (1.0 + (tripod.tighter - 1.0) * f64::from(before_goal))
        })
    }

    /// The camera high behind the goal on the side of `end` (−1 or 1).
    #[must_use]
    pub fn high_behind(&self, tripod: &Tripod, end: f64) -> Vec<Camera> {
        let half = self.pitch.length_m / 2.0;
        let BehindGoal { beyond_m, height_m, aside_m, near } = tripod.behind;
        let place = DVec3::new(end * (half + beyond_m), height_m, aside_m);
        let share = 0.8 * tripod.player_share * (1.0 + 0.8 * near);
        let behind = Tripod { position: place, player_share: share, ..*tripod };
        let aim = |aim: &Vec2| {
            let deep = Vec2::new(aim.x * 0.7 + end as f32 * 8.0, aim.y * 0.6);
            let close = Vec2::new((end * (half - 15.0)) as f32 + aim.x * 0.08, aim.y * 0.25);
            deep.lerp(close, near as f32)
        };
        let aims: Vec<Vec2> = self.aims().iter().map(aim).collect();
        // One zoom for all of it: it has the depth of the pitch in view.
        self.filmed(&behind, &aims, |_| behind.player_share)
    }

    /// A close-up of the player who is nearest to the ball at `frame`, from beside the main camera, with its focus.
    #[must_use]
    pub fn close_up(&self, tripod: &Tripod, frame: usize) -> Vec<(Camera, Focus)> {
        let ball = self.ball.get(frame).map_or(Vec2::ZERO, |ball| Vec2::new(ball.x, ball.z));
        let away = |path: &Path2| path.xz.get(frame).map_or(f32::MAX, |at| at.distance(ball));
        let players = self.people.iter().filter(|person| person.team.is_some());
        let Some(player) = players.min_by(|a, b| away(a).total_cmp(&away(b))) else { return Vec::new() };
        let position = tripod.position + DVec3::new(3.0, -0.35 * tripod.position.y, -3.0);
        let aims: Vec<DVec2> = player.xz.iter().map(|at| at.as_dvec2()).collect();
        // Close to a player the hand has no time to be late.
        let aims = self.followed(&aims, 0.0, 3.0 * tripod.quickness);
        aims.into_iter()
            .map(|aim| {
                let target = DVec3::new(aim.x, 1.15, aim.y);
                let distance = position.distance(target);
                // From knee to above the head.
                let focal = f64::from(self.size_px.1) * distance / 2.3;
                let camera = Camera { k1: 0.0, ..Camera::looking_at(self.size_px, focal, position, target) };
                let blur_px = 0.006 * self.size_px.1 as f32;
                (camera, Focus { beyond_m: distance as f32 + 5.0, blur_px })
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectories::Trajectories;

    #[test]
    fn the_main_camera_keeps_the_ball_in_the_picture_level_and_smooth() {
        let size_px = (1280, 720);
        for seed in 0..4 {
            let all = Trajectories::generated(seed, 12.0).resampled(0.0, 25.0, 290);
            let pitch = Pitch::default();
            let play = Play { people: &all.people, ball: &all.ball, pitch: &pitch, rate_hz: 25.0, size_px };
            let tripod = Tripod { tighter: 1.6, ..Tripod::default() };
            let cameras = play.main_camera(&tripod);
            let held = cameras.iter().zip(&all.ball).filter(|(camera, ball)| {
                camera.project(ball.as_dvec3()).is_some_and(|pixel| camera.contains(pixel))
            });
            assert!(held.count() >= 280, "seed {seed}: the ball leaves the picture");
            let mut last_turn = 0.0;
            for pair in cameras.windows(2) {
                assert!(pair[0].rotation.row(0).y.abs() < 1e-9, "the horizon is level");
                let turn = pair[0].forward().angle_between(pair[1].forward()) * pair[0].focal_px;
                assert!(turn < 60.0 && (turn - last_turn).abs() < 12.0, "{turn} px after {last_turn}");
                last_turn = turn;
            }
        }
    }

    #[test]
    fn close_ups_show_one_player_from_the_knees_up() {
        let all = Trajectories::generated(3, 4.0).resampled(0.0, 25.0, 90);
        let pitch = Pitch::default();
        let size_px = (1280, 720);
        let play = Play { people: &all.people, ball: &all.ball, pitch: &pitch, rate_hz: 25.0, size_px };
        for (camera, focus) in play.close_up(&Tripod::default(), 40).iter().skip(20) {
            let in_view = all.people.iter().filter(|_| camera.focal_px > 0.0).count();
            assert!(in_view > 0 && focus.beyond_m > 20.0);
            let high =
                camera.pixels_per_metre(camera.position + camera.forward() * f64::from(focus.beyond_m - 5.0));
            assert!((250.0..400.0).contains(&high), "{high} px per metre");
        }
    }
}
