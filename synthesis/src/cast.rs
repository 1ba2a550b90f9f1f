//! Who plays: two teams, their goalkeepers and the officials of one match, each with a body, clothes and a movement.

use protocol::pitch::Pitch;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use crate::{
    SynthesisError,
    body::{BaseBody, Build},
    figure::{Detail, Figure, dress},
    motion::Motions,
    movement::{Habits, Movement},
    outfit::{Outfit, Sleeves},
    play::{self, Event},
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
        let members =
            paths.people.par_iter().enumerate().map(member).collect::<Result<_, SynthesisError>>()?;
        Ok(Self { members, wardrobe })
    }
}

/// One person's own generator, so that nobody's looks depend on how many others there are.
fn generator(seed: u64, index: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(
        seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ index.wrapping_mul(0xD6E8_FEB8_6659_FD93),
    )
}
