//! Where a match is played, drawn from a seed: size of the pitch, turf, stands, boards, crowd, light, camera platform.
//! What can be drawn follows real grounds and the laws of the game; the ranges are written where they are drawn.

use std::str::FromStr;

use glam::{DVec3, Vec3};
use protocol::pitch::Pitch;
use rand::{Rng, SeedableRng, seq::IndexedRandom};
use rand_pcg::Pcg64Mcg;

use crate::{
    SynthesisError,
    crowd::CrowdLook,
    daylight::light,
    grounds::{TEXTS, sides, surroundings, turf},
    nets::NetLook,
    operator::{BehindGoal, Tripod},
    outfit::{Srgb, linear},
    overlay::Style,
    paint::Lights,
    stadium::{Board, BoardRow, Side, Stadium, Surroundings, Tier},
    turf::TurfLook,
};

/// How freely the place, the camera and its chain are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Setting {
    /// One plain evening ground with a quiet camera: for demonstrations and for tests that vary something else.
    Plain,
    /// Everything from the seed.
    #[default]
    Drawn,
}

impl FromStr for Setting {
    type Err = SynthesisError;

    fn from_str(text: &str) -> Result<Self, SynthesisError> {
        match text {
            "plain" => Ok(Self::Plain),
            "drawn" => Ok(Self::Drawn),
            _ => Err(SynthesisError::Options(format!("`{text}` is no setting: write plain or drawn"))),
        }
    }
}

/// A place to play and the platform it is filmed from.
#[derive(Clone, Debug)]
pub struct Venue {
    /// Everything that does not move.
    pub stadium: Stadium,
    /// The main camera's place.
    pub tripod: Tripod,
    /// The goals' nets.
    pub net: NetLook,
    /// The broadcaster's graphics.
    pub style: Style,
}

impl Venue {
    /// The plain evening ground.
    #[must_use]
    pub fn plain(seed: u64, pitch: Pitch, supporters: [Srgb; 2]) -> Self {
        let rng = &mut Pcg64Mcg::seed_from_u64(seed ^ 0x9_1ACE);
        let board = |text: &str, ground, ink| Board { text: text.into(), ground, ink };
        let boards = vec![
            board(TEXTS[0], [0.02, 0.42, 0.36], [0.95, 0.98, 0.97]),
            board(TEXTS[1], [0.93, 0.93, 0.95], [0.10, 0.14, 0.35]),
            board(TEXTS[2], [0.10, 0.22, 0.62], [0.96, 0.96, 0.98]),
            board(TEXTS[3], [0.96, 0.78, 0.10], [0.12, 0.10, 0.10]),
            board(TEXTS[4], [0.62, 0.08, 0.14], [0.97, 0.95, 0.92]),
        ];
        let row = BoardRow { gap_m: 4.5, high_m: [0.0, 0.95], led: false };
        let tiers = vec![
            Tier { from_m: 0.0, low_m: 1.4, slope: 0.52, deep_m: 24.0 },
            Tier { from_m: 22.0, low_m: 17.5, slope: 0.66, deep_m: 34.0 },
        ];
        let sides = sides(&pitch, [4.5, 5.0], |index, line_m, outward, half_m| Side {
            outward,
            line_m,
            half_m,
            boards: if index == 3 {
                vec![]
            } else {
                vec![BoardRow { gap_m: if index == 0 { 4.5 } else { 5.0 }, ..row }]
            },
            foot_m: 8.0,
            barrier_m: 1.4,
            tiers: if index == 3 { vec![Tier { slope: 0.3, ..tiers[0] }] } else { tiers.clone() },
            roof: None,
        });
        let around = Surroundings {
            sides,
            boards,
            crowd: CrowdLook {
                colours: vec![[0.90, 0.90, 0.92], supporters[0], supporters[1], [0.10, 0.11, 0.16]],
                supporters: 0.25,
                full: 0.93,
                seats: [0.16, 0.20, 0.34],
                light: 0.5,
            },
            roof: Vec3::new(0.012, 0.013, 0.017),
            structure: Vec3::new(0.16, 0.17, 0.19),
            sky: Vec3::new(0.01, 0.012, 0.018),
        };
        let turf = TurfLook { grass: [0.37, 0.50, 0.22], ..TurfLook::default() };
        let stadium = Stadium::new(pitch, turf, around, Lights::floodlights(), false, rng.random());
        Self { stadium, tripod: Tripod::default(), net: NetLook::default(), style: Style::plain() }
    }

    /// A ground drawn from the seed round a pitch of the given size.
    #[must_use]
    pub fn drawn(seed: u64, pitch: Pitch, supporters: [Srgb; 2]) -> Self {
        let rng = &mut Pcg64Mcg::seed_from_u64(seed ^ 0xD_9A4A);
        let turf = turf(rng);
        let tripod = Tripod { behind: behind_goal(seed), ..platform(rng, &pitch) };
        let around = surroundings(rng, &pitch, &tripod, supporters);
        let sky = light(rng);
        let around =
            Surroundings { sky: sky.above, crowd: CrowdLook { light: sky.stands, ..around.crowd }, ..around };
        let net = net(rng);
        let stadium = Stadium::new(pitch, turf, around, sky.lights, sky.sunny, rng.random());
        Self { stadium, tripod, net, style: Style::drawn(rng) }
    }
}

/// The size of the pitch that belongs to a seed.
#[must_use]
pub fn pitch_of(seed: u64) -> Pitch {
    pitch_size(&mut Pcg64Mcg::seed_from_u64(seed ^ 0x517E))
}

/// A size that Law 1 allows (90–120 × 45–90 m, longer than wide); most grounds have 105 × 68 m, or lie in the range of
/// international matches (100–110 × 64–75 m).
fn pitch_size(rng: &mut impl Rng) -> Pitch {
    let whole = |value: f64| value.round();
    match rng.random_range(0..10) {
        0..5 => Pitch::default(),
        5..8 => Pitch {
            length_m: whole(rng.random_range(100.0..110.0)),
            width_m: whole(rng.random_range(64.0..75.0)),
        },
        _ => {
            let length_m = whole(rng.random_range(90.0..120.0));
            Pitch { length_m, width_m: whole(rng.random_range(45.0..f64::min(90.0, length_m - 2.0))) }
        }
    }
}

/// Cameras behind the goals stand 8 to 45 m behind the line. Half of them look at the depth of the pitch, half at the goal.
fn behind_goal(seed: u64) -> BehindGoal {
    let rng = &mut Pcg64Mcg::seed_from_u64(seed ^ 0xB_E41D);
    let beyond_m = rng.random_range(10.0..45.0);
    BehindGoal {
        beyond_m,
        height_m: (beyond_m * rng.random_range(0.35..0.8)).clamp(6.0, 30.0),
        aside_m: rng.random_range(-6.0..6.0),
        near: if rng.random_bool(0.5) { rng.random_range(0.0..0.4) } else { rng.random_range(0.5..1.0) },
    }
}

/// Main cameras stand on the halfway line or some metres beside it, 10–30 m high, 40–90 m from the centre mark.
fn platform(rng: &mut impl Rng, pitch: &Pitch) -> Tripod {
    let beyond = rng.random_range(14.0..40.0);
    let back = (pitch.width_m / 2.0 + beyond).clamp(40.0, 90.0);
    // Seen from the near touchline the platform is 20° to 40° up.
    let height = ((back - pitch.width_m / 2.0) * rng.random_range(0.38..0.80)).clamp(10.0, 30.0);
    let aside =
        if rng.random_bool(0.7) { rng.random_range(-2.0..2.0) } else { rng.random_range(-14.0..14.0) };
    Tripod {
        position: DVec3::new(aside, height, back),
        // Players of 42 to 80 px at 720 lines at the middle of the picture; the zoom takes it from there. One camera in
        // three shows both teams whole, as tacticians want it.
        player_share: if rng.random_bool(0.67) {
            rng.random_range(0.058..0.110)
        } else {
            rng.random_range(0.036..0.058)
        },
        tighter: rng.random_range(1.0..1.7),
        reaction_s: rng.random_range(0.10..0.28),
        quickness: rng.random_range(3.2..5.5),
        k1: if rng.random_bool(0.25) { 0.0 } else { rng.random_range(-0.10..0.06) },
        behind: BehindGoal::default(),
    }
}

fn net(rng: &mut impl Rng) -> NetLook {
    let white = Vec3::splat(rng.random_range(0.5..0.75));
    let mut colours = [white; 2];
    if rng.random_bool(0.2) {
        let stripe: [Srgb; 4] = [[0.75, 0.1, 0.1], [0.1, 0.2, 0.65], [0.08, 0.08, 0.09], [0.9, 0.75, 0.1]];
        colours[1] = linear(*stripe.choose(rng).unwrap_or(&stripe[0]));
    }
    let bottom = rng.random_range(1.6..2.4f32);
    let top = if rng.random_bool(0.6) { bottom } else { rng.random_range(0.8..1.4) };
    NetLook {
        deep_m: [top, bottom],
        cell_m: *[0.10, 0.12, 0.145].choose(rng).unwrap_or(&0.12),
        cord_m: rng.random_range(0.006..0.014),
        colours,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pitch_sizes_are_legal_and_varied() {
        let rng = &mut Pcg64Mcg::seed_from_u64(1);
        let sizes: Vec<Pitch> = (0..500).map(|_| pitch_size(rng)).collect();
        for pitch in &sizes {
            assert!((90.0..=120.0).contains(&pitch.length_m) && (45.0..=90.0).contains(&pitch.width_m));
            assert!(pitch.length_m > pitch.width_m);
        }
        let usual = sizes.iter().filter(|p| **p == Pitch::default()).count();
        assert!((200..300).contains(&usual), "{usual} of 500 are 105 × 68 m");
        assert!(sizes.iter().any(|p| p.width_m < 55.0) && sizes.iter().any(|p| p.width_m > 80.0));
    }

    #[test]
    fn the_same_seed_builds_the_same_place_and_platforms_see_the_near_touchline() {
        let teams = [[0.9, 0.1, 0.1], [0.1, 0.1, 0.9]];
        for seed in 0..40 {
            let venue = Venue::drawn(seed, pitch_of(seed), teams);
            let again = Venue::drawn(seed, pitch_of(seed), teams);
            assert_eq!(venue.stadium.around, again.stadium.around);
            assert_eq!((venue.tripod, venue.net), (again.tripod, again.net));
            let position = venue.tripod.position;
            assert!((10.0..=30.0).contains(&position.y) && (40.0..=90.0).contains(&position.z));
            let near = &venue.stadium.around.sides[3];
            let beyond = position.z as f32 - near.line_m;
            for tier in &near.tiers {
                for out in [0.0, tier.deep_m / 2.0, tier.deep_m] {
                    let sight = position.y as f32 * (near.foot_m + tier.from_m + out) / beyond;
                    assert!(
                        tier.low_m + tier.slope * out < sight,
                        "seed {seed}: the stand hides the touchline"
                    );
                }
            }
        }
    }
}
