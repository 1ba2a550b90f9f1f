//! The two kits that most people wear, and how likely somebody wears one of them.
//!
//! The two tracks whose looks explain all others best (the medoids of two clusters, with a limit on what one track can cost, so that keepers
//! and officials do not pull) begin; medians over those who wear them follow.

use super::{Candidate, Team};
use crate::{pose::Lab, tracking::appearance::MeanLooks};

/// How much shirt, shorts and socks say.
const WEIGHTS: [f64; 3] = [1.0, 0.5, 0.5];
/// Standard deviations of a track's median colour within a team: lightness, a*, b*.
const SPREAD: [f64; 3] = [10.0, 6.0, 6.0];
/// Whoever is farther than this from both kits wears another one (distance as of [`distance`]).
pub(super) const OTHER: f64 = 9.0;
/// Tracks that may stand for a kit: the longest.
const MEDOIDS_MAX: usize = 120;
/// Rounds of taking medians.
const ROUNDS: usize = 5;

/// Median colours of shirt, shorts and socks.
pub(super) type Kit = [Option<Lab>; 3];

/// How likely a track wears the kit of team a, of team b, or another one; sums to 1.
pub(super) type Wears = [f64; 3];

/// The two kits and who wears them.
pub(super) struct Kits {
    /// By track; all of it "another" when there are no kits.
    pub(super) wears: Vec<Wears>,
}

impl Kits {
    /// The team whose kit a track wears, if any.
    pub(super) fn team(&self, track: usize) -> Option<Team> {
        match self.wears.get(track)? {
            [a, b, other] if a >= b && a > other => Some(Team::A),
            [_, b, other] if b > other => Some(Team::B),
            _ => None,
        }
    }
}

/// The colours of a track.
pub(super) fn kit(looks: &MeanLooks) -> Kit {
    looks.kit.map(|garment| garment.map(|(colour, _)| colour))
}

/// Mean squared difference of two kits in standard deviations; `None` when no shirt was seen of one.
pub(super) fn distance(a: &Kit, b: &Kit) -> Option<f64> {
    a[0].zip(b[0])?;
    let (mut sum, mut weights) = (0.0, 0.0);
    for ((a, b), weight) in a.iter().zip(b).zip(WEIGHTS) {
        let (Some(a), Some(b)) = (a, b) else { continue };
        let differences = [a.l - b.l, a.a - b.a, a.b - b.b].map(f64::from);
        let squares: f64 = differences.iter().zip(SPREAD).map(|(d, s)| (d / s).powi(2)).sum();
        sum += weight * squares;
        weights += weight;
    }
    Some(sum / weights)
}

/// Finds the kits.
pub(super) fn find(candidates: &[Candidate]) -> Kits {
    let all: Vec<Kit> = candidates.iter().map(|candidate| kit(&candidate.looks)).collect();
    let Some(mut kits) = medoids(candidates, &all) else {
        return Kits { wears: vec![[0.0, 0.0, 1.0]; candidates.len()] };
    };
    for _ in 0..ROUNDS {
        let wears: Vec<Wears> = all.iter().map(|worn| wears(worn, &kits)).collect();
        for (team, kit) in kits.iter_mut().enumerate() {
            let worn: Vec<(&Kit, f64)> = wears
                .iter()
                .zip(all.iter().zip(candidates))
                .filter(|(wears, _)| wears[team] > 0.5)
                .map(|(_, (kit, candidate))| (kit, candidate.weight))
                .collect();
            for (garment, colour) in kit.iter_mut().enumerate() {
                *colour = median(&worn, garment).or(*colour);
            }
        }
    }
    let mut wears: Vec<Wears> = all.iter().map(|worn| self::wears(worn, &kits)).collect();
    let seen = |team: usize| wears.iter().zip(candidates).map(|(w, c)| w[team] * c.weight).sum::<f64>();
    if seen(1) > seen(0) {
        wears.iter_mut().for_each(|w| w.swap(0, 1));
    }
    Kits { wears }
}

/// The two tracks that explain all others best.
fn medoids(candidates: &[Candidate], all: &[Kit]) -> Option<[Kit; 2]> {
    let mut order: Vec<usize> =
        (0..all.len()).filter(|&i| all.get(i).is_some_and(|kit| kit[0].is_some())).collect();
    let weight = |i: usize| candidates.get(i).map_or(0.0, |c| c.weight);
    order.sort_by(|&a, &b| weight(b).total_cmp(&weight(a)));
    let worn: Vec<(Kit, f64)> = order.iter().filter_map(|&i| Some((*all.get(i)?, weight(i)))).collect();
    let able = worn.len().min(MEDOIDS_MAX);
    // What each track costs with each medoid.
    let costs: Vec<Vec<f64>> = worn
        .iter()
        .take(able)
        .map(|(medoid, _)| {
            worn.iter()
                .map(|(kit, weight)| weight * distance(kit, medoid).unwrap_or(OTHER).min(OTHER))
                .collect()
        })
        .collect();
    let mut best: Option<(f64, usize, usize)> = None;
    for (i, of_i) in costs.iter().enumerate() {
        for (j, of_j) in costs.iter().enumerate().skip(i + 1) {
            let cost: f64 = of_i.iter().zip(of_j).map(|(a, b)| a.min(*b)).sum();
            if best.is_none_or(|(least, _, _)| cost < least) {
                best = Some((cost, i, j));
            }
        }
    }
    let (_, i, j) = best?;
    Some([worn.get(i)?.0, worn.get(j)?.0])
}

fn wears(worn: &Kit, kits: &[Kit; 2]) -> Wears {
    let far = |kit: &Kit| distance(worn, kit);
    let [Some(a), Some(b)] = [far(&kits[0]), far(&kits[1])] else { return [0.0, 0.0, 1.0] };
    let likely = [a, b, OTHER].map(|distance| (-distance / 2.0).exp().max(f64::MIN_POSITIVE));
    let sum: f64 = likely.iter().sum();
    likely.map(|l| l / sum)
}

/// The weighted median of a garment, channel by channel.
fn median(worn: &[(&Kit, f64)], garment: usize) -> Option<Lab> {
    let seen: Vec<(Lab, f64)> =
        worn.iter().filter_map(|(kit, weight)| Some(((*kit.get(garment)?)?, *weight))).collect();
    let channel = |of: fn(&Lab) -> f32| -> Option<f32> {
        let mut values: Vec<(f32, f64)> = seen.iter().map(|(colour, weight)| (of(colour), *weight)).collect();
        values.sort_by(|a, b| a.0.total_cmp(&b.0));
        let half = values.iter().map(|(_, weight)| weight).sum::<f64>() / 2.0;
        let mut sum = 0.0;
        values
            .iter()
            .find(|(_, weight)| {
                sum += weight;
                sum >= half
            })
            .map(|(value, _)| *value)
    };
    Some(Lab { l: channel(|c| c.l)?, a: channel(|c| c.a)?, b: channel(|c| c.b)? })
}
