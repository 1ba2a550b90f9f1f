//! Who and what a shard draws from: dressed bodies and stadiums of one split.

use protocol::pitch::Pitch;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use super::{DepthOptions, Split};
use crate::{
    body::{BaseBody, Build},
    figure::{Detail, Figure, dress},
    outfit::{Kit, Outfit},
    stadium::Stadium,
    venue::Venue,
};

/// Everything a shard draws from.
pub(super) struct Cast {
    pub(super) figures: Vec<(Figure, u32)>,
    pub(super) stadiums: Vec<Stadium>,
}

impl Cast {
    pub(super) fn new(base: &BaseBody, options: &DepthOptions, shard: usize, size: usize) -> Self {
        let [lowest, highest] = options.numbers;
        let figures = (0..size)
            .into_par_iter()
            .map(|k| {
                let mut rng = rng(options.seed, &[7, shard as u64, k as u64]);
                let mut pick = |count: u32| loop {
                    let id = rng.random_range(0..count);
                    if split_of(id) == options.split {
                        break id;
                    }
                };
                let (body_id, kit_id) = (pick(4000), pick(1200));
                let build = Build::random(&mut Pcg64Mcg::seed_from_u64(0xB0D1_0000 + u64::from(body_id)));
                let mut kit_rng = Pcg64Mcg::seed_from_u64(0x5117_0000 + u64::from(kit_id));
                let kit = Kit::random(&mut kit_rng, format!("kit{kit_id}"));
                let number = rng.random_bool(0.85).then(|| rng.random_range(lowest..=highest));
                let outfit = Outfit::random(&mut rng, kit, number, build.female > 0.5);
                (dress(base, base.shape(&build), outfit, Detail::Close), body_id)
            })
            .collect();
        let stadiums = (0..12)
            .map(|k| {
                let mut rng = rng(options.seed, &[8, shard as u64, k]);
                let supporters = [0; 2].map(|_| [0; 3].map(|_| rng.random_range(0.02..0.98f32)));
                Venue::drawn(rng.random(), Pitch::default(), supporters).stadium
            })
            .collect();
        Self { figures, stadiums }
    }
}

/// One body in four and one kit in four belong to the test split, one in eight to validation.
fn split_of(id: u32) -> Split {
    match id % 8 {
        3 | 7 => Split::Test,
        6 => Split::Validation,
        _ => Split::Train,
    }
}

/// The generator of one thing: the seed and the way to it.
pub(super) fn rng(seed: u64, path: &[u64]) -> Pcg64Mcg {
    let mix = path.iter().fold(seed ^ 0x9E37_79B9_7F4A_7C15, |state, &step| {
        (state ^ step.wrapping_mul(0xD6E8_FEB8_6659_FD93)).wrapping_mul(0xA076_1D64_78BD_642F).rotate_left(29)
    });
    Pcg64Mcg::seed_from_u64(mix)
}
