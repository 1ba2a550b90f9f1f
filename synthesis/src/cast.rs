//! Who plays: two teams, their goalkeepers and the officials of one match, each with a body, clothes and a movement.

use glam::Vec3;
use protocol::pitch::Pitch;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use crate::{
    SynthesisError,
    acts::Kind,
    body::{BaseBody, Build},
    course::ease,
    figure::{Detail, Figure, dress},
    motion::Motions,
    movement::{Habits, Movement},
    outfit::{Outfit, Sleeves},
    play::{self, Event},
    rig,
    trajectories::{Path2, Role, Trajectories},
    wardrobe::Wardrobe,
};

/// Somebody in the match.
pub struct Member {
    /// Path, team, role and number.
    pub path: Path2,
    /// Shape and clothes.
    pub figure: Figure,
    /// What the person does, frame by frame.
    pub movement: Movement,
}

/// Everybody in a match.
pub struct Cast {
    /// In the order of the paths; the index is the identity in the truth.
    pub members: Vec<Member>,
    /// What the teams and officials wear.
    pub wardrobe: Wardrobe,
    /// Middle of the ball at every frame: that of the paths, but in the hands of whoever throws it in.
    pub ball: Vec<Vec3>,
}

impl Cast {
    /// Dresses and moves everybody of `paths`, which are already at `rate_hz`; everything random follows from `seed`.
    pub fn new(paths: &Trajectories, rate_hz: f32, pitch: &Pitch, seed: u64) -> Result<Self, SynthesisError> {
        let base = BaseBody::load()?;
        let motions = Motions::shipped()?;
        let rng = &mut generator(seed, u64::MAX);
        let wardrobe = Wardrobe::draw(rng);
        // Now and then women play; teams are not mixed.
        let women = rng.random_bool(0.25);
        let events = play::events(&paths.people, &paths.ball, rate_hz, pitch);
        let member = |(index, path): (usize, &Path2)| {
            let rng = &mut generator(seed, index as u64);
            let kit = wardrobe.kit(path.team, path.role).clone();
            let official = path.team.is_none();
            let female = if official { rng.random_bool(0.25) } else { women };
            let build = Build::of(rng, female, path.role == Role::Goalkeeper);
            let mut outfit = Outfit::random(rng, kit, path.number.filter(|_| !official), female);
            if path.role == Role::Goalkeeper {
                outfit.sleeves = Sleeves::Long;
                outfit.gloves = Some(crate::outfit::GLOVES[rng.random_range(0..crate::outfit::GLOVES.len())]);
            }
            let figure = dress(&base, base.shape(&build), outfit, Detail::Close);
            let habits = Habits {
                mood: rng.random_range(0.0..1.0),
                phase: rng.random_range(0.0..1.0),
                size: build.height_m / 1.8,
            };
            let own: Vec<Event> =
                events.iter().filter(|(who, _)| *who == index).map(|&(_, event)| event).collect();
            let movement = Movement::along(path, &paths.ball, rate_hz, &motions, habits, &own, &figure)?;
            Ok(Member { path: path.clone(), figure, movement })
        };
        let members = paths
            .people
            .par_iter()
            .enumerate()
            .map(member)
            .collect::<Result<Vec<Member>, SynthesisError>>()?;
        let ball = in_hands(&paths.ball, &members, &events, rate_hz);
        Ok(Self { members, wardrobe, ball })
    }
}

/// Seconds before a throw-in at which the ball is in both hands, and after it until it is back on its path.
const HELD_S: [f32; 2] = [1.0, 0.2];

/// The ball's path with the hands of those who throw it in.
fn in_hands(ball: &[Vec3], members: &[Member], events: &[(usize, Event)], rate_hz: f32) -> Vec<Vec3> {
    let mut held = ball.to_vec();
    for (who, event) in events.iter().filter(|(_, event)| event.kind == Kind::ThrowIn) {
        let frames = |seconds: f32| ((event.time_s + seconds) * rate_hz).max(0.0) as usize;
        let member = &members[*who];
        for k in frames(-HELD_S[0] - 0.3)..frames(HELD_S[1]).min(ball.len()) {
            let step = &member.movement.steps[k];
            let landmarks = rig::landmarks_at(&member.figure, &step.pose, step.hips_m);
            // BlazePose's 19 and 20: the knuckles of both index fingers.
            let between = step.placement.place((landmarks[19] + landmarks[20]) / 2.0);
            let since = k as f32 / rate_hz - event.time_s;
            let share = ease(since, -HELD_S[0] - 0.3, -HELD_S[0]) * (1.0 - ease(since, 0.0, HELD_S[1]));
            held[k] = ball[k].lerp(between, share);
        }
    }
    held
}

/// One person's own generator, so that nobody's looks depend on how many others there are.
fn generator(seed: u64, index: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(
        seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ index.wrapping_mul(0xD6E8_FEB8_6659_FD93),
    )
}
