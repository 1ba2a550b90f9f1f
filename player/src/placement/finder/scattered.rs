//! Planes of points without order, by random sampling.
//!
//! After Schnabel, Wahl and Klein, "Efficient RANSAC for point-cloud shape detection", Computer Graphics Forum 2007: one
//! point with its normal is a hypothesis. With gravity known, a level plane through a point is one too: the normals of a
//! phone's sparse points are too noisy to propose the table. The generator is seeded: the same cloud, the same answer.

use glam::DVec3;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{footprint::Survey, moments::Fit, neighbours::Neighbourhood, robust};
use crate::placement::Plane;

const SEED: u64 = 3;

/// Hypotheses of each kind in a round.
const HYPOTHESES: usize = 160;

/// Points that hypotheses are counted on.
const SAMPLE: usize = 2500;

/// Most planes that are taken out of a cloud.
const MOST_PLANES: usize = 10;

/// The planes with the most points, in the order in which they are found.
pub(super) fn planes(survey: &Survey<'_>, up: Option<DVec3>) -> Vec<Fit> {
    let mut random = Pcg64Mcg::seed_from_u64(SEED);
    let near = Neighbourhood::new(survey.points, survey.gap_m);
    let mut left: Vec<DVec3> = survey.points.to_vec();
    let least = (survey.points.len() / 100).max(40);
    let mut found = Vec::new();
    while found.len() < MOST_PLANES && left.len() >= least {
        let sample: Vec<DVec3> = pick(&left, SAMPLE, &mut random);
        let mut scored: Vec<(usize, Plane)> = hypotheses(&left, &near, up, survey.viewpoint, &mut random)
            .into_iter()
            .map(|plane| (supporters(&sample, &plane, survey), plane))
            .collect();
        scored.sort_by_key(|entry| std::cmp::Reverse(entry.0));
        let best = scored.into_iter().take(4).filter_map(|(_, plane)| {
            let widest_m = 2.0 * survey.reach_m(&plane, survey.viewpoint - plane.normal);
            robust::refine(&left, plane, survey.noise, survey.viewpoint, widest_m)
        });
        let Some((fit, _)) = best.max_by_key(|(_, counted)| *counted) else { break };
        let before = left.len();
        left.retain(|point| fit.plane.distance_m(*point).abs() > survey.reach_m(&fit.plane, *point));
        if before - left.len() < least {
            break;
        }
        found.push(fit);
    }
    found
}

fn pick(points: &[DVec3], count: usize, random: &mut Pcg64Mcg) -> Vec<DVec3> {
    if points.len() <= count {
        return points.to_vec();
    }
    (0..count).filter_map(|_| points.get(random.random_range(0..points.len())).copied()).collect()
}

fn hypotheses(
    left: &[DVec3],
    near: &Neighbourhood<'_>,
    up: Option<DVec3>,
    viewpoint: DVec3,
    random: &mut Pcg64Mcg,
) -> Vec<Plane> {
    let mut planes = Vec::new();
    for point in pick(left, HYPOTHESES, random) {
        planes.extend(near.normal(point, viewpoint).map(|normal| Plane::through(point, normal)));
    }
    if let Some(up) = up {
        for point in pick(left, HYPOTHESES, random) {
            let normal = if up.dot(viewpoint - point) < 0.0 { -up } else { up };
            planes.push(Plane::through(point, normal));
        }
    }
    planes
}

fn supporters(sample: &[DVec3], plane: &Plane, survey: &Survey<'_>) -> usize {
    sample
        .iter()
        .filter(|point| plane.distance_m(**point).abs() < 0.5 * survey.reach_m(plane, **point))
        .count()
}
