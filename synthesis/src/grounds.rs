//! Turf, stands and boards of a ground, drawn at random within what real grounds have.

use glam::Vec3;
use protocol::pitch::Pitch;
use rand::{Rng, seq::IndexedRandom};

use crate::{
    crowd::CrowdLook,
    operator::Tripod,
    outfit::{Srgb, linear},
    stadium::{Board, BoardRow, Roof, Side, Surroundings, Tier},
    turf::{Mowing, TurfLook},
};

/// What stands on boards.
pub(crate) const TEXTS: [&str; 16] = [
    "HOLOPITCH",
    "TABLETOP FC",
    "NORTH BANK TEA",
    "EXTRA TIME",
    "OPEN GOAL",
    "FAIR PLAY",
    "KICK OFF 20",
    "LINESMAN",
    "OFFSIDE AIR",
    "HALF TIME PIES",
    "RAIL 1867",
    "GREEN MILL",
    "MERIDIAN BANK",
    "CORNER SHOP",
    "VOLT",
    "SEA AND SKY",
];

/// Grass and lines.
pub(crate) fn turf(rng: &mut impl Rng) -> TurfLook {
    // Red and blue as shares of green, from what broadcasts show of grass.
    let green = rng.random_range(0.40..0.56f32);
    let grass = [green * rng.random_range(0.70..0.85), green, green * rng.random_range(0.34..0.54)];
    let mowing = match rng.random_range(0..20) {
        0..9 => Mowing::Across,
        9..12 => Mowing::Checks,
        12..14 => Mowing::Along,
        14..16 => {
            Mowing::Diagonal(rng.random_range(0.4..1.2) * if rng.random_bool(0.5) { 1.0 } else { -1.0 })
        }
        16 => Mowing::Circles,
        _ => Mowing::None,
    };
    let track = rng.random_bool(0.12);
    TurfLook {
        grass,
        mowing,
        contrast: rng.random_range(0.06..0.36),
        // Stripes usually divide the penalty area's 16.5 m or the five metres and a half of the goal area.
        stripe_m: *[3.0, 4.5, 5.25, 5.5, 5.5, 8.25, 9.0].choose(rng).unwrap_or(&5.5),
        wear: rng.random_range(0.0..1.0f32).powi(2) * 0.9,
        blotches: rng.random_range(0.4..1.8),
        line_m: rng.random_range(0.08..0.12),
        paint: rng.random_range(0.70..1.0),
        apron: if track {
            [0.52, 0.27, 0.22]
        } else {
            *[[0.22, 0.35, 0.18], [0.25, 0.42, 0.16], [0.36, 0.36, 0.35], [0.16, 0.22, 0.45]]
                .choose(rng)
                .unwrap_or(&grass)
        },
        margin_m: rng.random_range(1.5..5.0),
    }
}

/// The four sides of a pitch, each made by `side` from its index, line, outward direction and half length.
pub(crate) fn sides(
    pitch: &Pitch,
    gaps: [f32; 2],
    side: impl Fn(usize, f32, Vec3, f32) -> Side,
) -> [Side; 4] {
    let (half_x, half_z) = (pitch.length_m as f32 / 2.0, pitch.width_m as f32 / 2.0);
    let (long, short) = (half_x + gaps[1], half_z + gaps[0]);
    [
        side(0, half_z, Vec3::NEG_Z, long),
        side(1, half_x, Vec3::X, short),
        side(2, half_x, Vec3::NEG_X, short),
        side(3, half_z, Vec3::Z, long),
    ]
}

/// Everything round the grass but the sky. The near stand stays below the sight of the camera on `tripod`.
pub(crate) fn surroundings(
    rng: &mut impl Rng,
    pitch: &Pitch,
    tripod: &Tripod,
    supporters: [Srgb; 2],
) -> Surroundings {
    let gaps = [rng.random_range(3.0..6.0f32), rng.random_range(4.0..8.0f32)];
    let led = rng.random_bool(0.5);
    let high = rng.random_range(0.75..1.05f32);
    let second = rng.random_bool(0.22);
    let rows = |gap: f32| {
        let first = BoardRow { gap_m: gap, high_m: [0.0, high], led };
        let behind = BoardRow { gap_m: gap + 1.6, high_m: [high * 0.9, high * 1.8], led: false };
        if second { vec![first, behind] } else { vec![first] }
    };
    // Usually a few metres of ground behind the boards; now and then a running track.
    let ground =
        if rng.random_bool(0.12) { rng.random_range(12.0..22.0) } else { rng.random_range(1.8..6.0f32) };
    let barrier_m =
        if rng.random_bool(0.85) { rng.random_range(0.5..1.2) } else { rng.random_range(1.2..2.4f32) };
    let two = rng.random_bool(0.6);
    let roofed = rng.random_bool(0.8);
    let first = Tier {
        from_m: 0.0,
        low_m: barrier_m + 0.1,
        slope: rng.random_range(0.36..0.58),
        deep_m: rng.random_range(13.0..30.0),
    };
    let stand = |lower: f32| {
        let first = Tier { deep_m: first.deep_m * lower, ..first };
        let top = first.low_m + first.slope * first.deep_m;
        let upper = Tier {
            from_m: first.deep_m - 2.0,
            low_m: top + 4.6,
            slope: first.slope + 0.16,
            deep_m: 22.0 * lower,
        };
        let tiers = if two { vec![first, upper] } else { vec![first] };
        let last = if two { upper } else { first };
        let (height, deep) = (last.low_m + last.slope * last.deep_m + 5.0, last.from_m + last.deep_m);
        (tiers, height, deep)
    };
    let lower = [1.0, rng.random_range(0.6..1.15f32), rng.random_range(0.6..1.15f32)];
    let reach = rng.random_range(-1.0..6.0f32);
    let near_boards = rng.random_bool(0.3);
    let sides = sides(pitch, gaps, |index, line_m, outward, half_m| {
        let gap = if index == 0 || index == 3 { gaps[0] } else { gaps[1] };
        let foot_m = gap + if second { 1.6 } else { 0.0 } + ground;
        let half_roof = half_m + 14.0;
        if index == 3 {
            // The stand that the camera is on must not hide the touchline from it.
            let beyond = tripod.position.z as f32 - line_m;
            let sight = tripod.position.y as f32 / beyond;
            let low_m = (0.55 * sight * foot_m).clamp(0.3, 1.4);
            let slope = (0.8 * sight).min(0.5);
            let boards = if near_boards { rows(gap) } else { vec![] };
            let roof = roofed.then_some(Roof {
                edge_m: 2.0,
                height_m: tripod.position.y as f32 + 9.0,
                deep_m: 40.0,
                half_m: half_roof,
            });
            let tiers = vec![Tier { from_m: 0.0, low_m, slope, deep_m: (beyond - foot_m - 2.0).max(2.0) }];
            return Side { outward, line_m, half_m, boards, foot_m, barrier_m: low_m, tiers, roof };
        }
        let (tiers, height_m, deep) = stand(lower[index]);
        let roof = roofed.then_some(Roof {
            edge_m: reach,
            height_m,
            deep_m: deep - reach + 2.0,
            half_m: half_roof + 4.0,
        });
        Side { outward, line_m, half_m, boards: rows(gap), foot_m, barrier_m, tiers, roof }
    });
    let boards = (0..rng.random_range(3..9)).map(|_| board(rng)).collect();
    let seats: Srgb =
        *[[0.12, 0.2, 0.5], [0.6, 0.1, 0.12], [0.45, 0.45, 0.47], [0.1, 0.35, 0.2], [0.2, 0.2, 0.22]]
            .choose(rng)
            .unwrap_or(&[0.2; 3]);
    let mut colours = vec![supporters[0], supporters[0], supporters[1]];
    colours.push(if rng.random_bool(0.5) { [0.9, 0.9, 0.92] } else { [0.1, 0.11, 0.16] });
    let grey = rng.random_range(0.03..0.22f32);
    // Barriers and fascias are of concrete, or painted like the seats.
    let painted = rng.random_bool(0.35);
    Surroundings {
        sides,
        boards,
        crowd: CrowdLook {
            colours,
            supporters: rng.random_range(0.05..0.42),
            full: if rng.random_bool(0.12) {
                rng.random_range(0.02..0.3)
            } else {
                rng.random_range(0.55..0.98)
            },
            seats,
            light: 0.5,
        },
        roof: Vec3::splat(rng.random_range(0.008..0.06)),
        structure: if painted {
            linear(seats) * 0.6
        } else {
            Vec3::new(grey, grey, grey * rng.random_range(0.95..1.15))
        },
        sky: Vec3::ZERO,
    }
}

fn board(rng: &mut impl Rng) -> Board {
    const GROUNDS: [Srgb; 9] = [
        [0.93, 0.93, 0.95],
        [0.04, 0.05, 0.07],
        [0.62, 0.08, 0.14],
        [0.10, 0.22, 0.62],
        [0.02, 0.42, 0.36],
        [0.96, 0.78, 0.10],
        [0.90, 0.40, 0.08],
        [0.05, 0.12, 0.28],
        [0.30, 0.62, 0.85],
    ];
    let ground = *GROUNDS.choose(rng).unwrap_or(&GROUNDS[0]);
    let bright = 0.3 * ground[0] + 0.59 * ground[1] + 0.11 * ground[2] > 0.5;
    let dark_ink = [[0.08, 0.08, 0.10], [0.10, 0.14, 0.45], [0.62, 0.06, 0.10]];
    let ink = if bright { *dark_ink.choose(rng).unwrap_or(&dark_ink[0]) } else { [0.96, 0.96, 0.97] };
    Board { text: (*TEXTS.choose(rng).unwrap_or(&TEXTS[0])).into(), ground, ink }
}
