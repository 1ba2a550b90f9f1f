//! Tracklets to tracks: the likeliest set of links between ends and starts, over all tracklets at once.
//!
//! A link's gain is the logarithm of how much likelier the two are one person than strangers: by motion, through the whole gap, and by looks. The
//! set with the greatest sum, at most one link per end and per start, is the min-cost flow of Zhang, Li & Nevatia (2008)
//! for tracklets that all count: an assignment. Short gaps and clear cases come first, because what is linked has a better
//! known motion and looks.

use super::{
    appearance::MeanLooks,
    motion::{self, State},
    tracklets::Tracklet,
};
use crate::assignment::{Pair, most_gain};

/// Nobody runs faster, metres per second; and the error of two places together, metres.
const SPEED_MAX_M_S: f64 = 10.0;
const PLACES_M: f64 = 2.5;
/// With more possible links than this a link is only weighed against those that it rules out, not against every other set of links: a bound on the work.
const WEIGHED_MAX: usize = 2_000;
/// Links of one end at most, the best: a bound on the work.
const RIVALS_MAX: usize = 24;

/// One round of linking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Round {
    /// From the last sighting to the next at most, seconds.
    pub(super) gap_s: f64,
    /// A link must gain this much more than every other one that it rules out; −∞ takes the best set of links as it is.
    pub(super) clear_by: f64,
    /// People nobody has linked yet, per square metre: where they are many, chance explains more.
    pub(super) others_per_m2: f64,
    /// A further standard deviation between places before and after the gap, metres.
    pub(super) apart_m: f64,
    /// Loss of a second without a sighting: people who are there are mostly seen.
    pub(super) unseen_per_s: f64,
}

/// A run of sightings as linking sees it.
pub(super) struct Node {
    pub(super) first_s: f64,
    pub(super) last_s: f64,
    pub(super) start: State,
    pub(super) end: State,
    pub(super) looks: MeanLooks,
}

impl Node {
    pub(super) fn of(tracklet: &Tracklet) -> Option<Self> {
        let places: Vec<_> = tracklet.iter().map(|seen| (seen.seconds, seen.place)).collect();
        let (start, end) = motion::ends(&places)?;
        let looks: Vec<_> = tracklet.iter().map(|seen| seen.looks).collect();
        Some(Self {
            first_s: places.first()?.0,
            last_s: places.last()?.0,
            start,
            end,
            looks: MeanLooks::of(looks.iter()),
        })
    }

    /// What linking the end of this one to the start of `later` gains; `None` when it cannot be.
    fn gain(&self, later: &Self, round: &Round) -> Option<f64> {
        let gap = later.first_s - self.last_s;
        let far = self.end.place_m().distance(later.start.place_m());
        if gap <= 0.0 || gap > round.gap_s || far > PLACES_M + round.apart_m + SPEED_MAX_M_S * gap {
            return None;
        }
        let motion = self.end.log_same(&later.start, gap, round.others_per_m2, round.apart_m);
        Some(motion + self.looks.log_same(&later.looks) - round.unseen_per_s * gap)
    }
}

/// The links of one round: `(from, to)` by place in `nodes`, of which those in doubt are left out. `extra` says what else speaks for a link
/// or against it.
pub(super) fn links(
    nodes: &[Node],
    round: &Round,
    extra: &dyn Fn(usize, usize) -> Option<f64>,
) -> Vec<(usize, usize)> {
    let mut starts: Vec<(f64, usize)> = nodes.iter().enumerate().map(|(i, node)| (node.first_s, i)).collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut pairs: Vec<Pair> = Vec::new();
    for (row, node) in nodes.iter().enumerate() {
        let after = starts.partition_point(|(seconds, _)| *seconds <= node.last_s);
        let mut of_row: Vec<Pair> = starts
            .iter()
            .skip(after)
            .take_while(|(seconds, _)| seconds - node.last_s <= round.gap_s)
            .filter_map(|&(_, column)| {
                let gain = node.gain(nodes.get(column)?, round)? + extra(row, column)?;
                (gain > 0.0).then_some(Pair { row, column, gain })
            })
            .collect();
        of_row.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        of_row.truncate(RIVALS_MAX);
        pairs.extend(of_row);
    }
    let best_of = |pairs: &[Pair]| -> Vec<Pair> {
        let chosen = most_gain(nodes.len(), nodes.len(), pairs);
        pairs.iter().filter(|pair| chosen.get(pair.row) == Some(&Some(pair.column))).copied().collect()
    };
    let total = |pairs: &[Pair]| pairs.iter().map(|pair| pair.gain).sum::<f64>();
    let chosen = best_of(&pairs);
    let best = total(&chosen);
    let clear = |pair: &Pair| {
        if round.clear_by == f64::NEG_INFINITY {
            return true;
        }
        if pairs.len() <= WEIGHED_MAX {
            // The best set of links without this one: others may move up.
            let others: Vec<Pair> =
                pairs.iter().filter(|p| (p.row, p.column) != (pair.row, pair.column)).copied().collect();
            return best - total(&best_of(&others)) >= round.clear_by;
        }
        let rival = pairs
            .iter()
            .filter(|other| (other.row == pair.row) != (other.column == pair.column))
            .map(|other| other.gain)
            .fold(0.0, f64::max);
        pair.gain >= rival + round.clear_by
    };
    chosen.iter().filter(|pair| clear(pair)).map(|pair| (pair.row, pair.column)).collect()
}

/// Joins runs by links; runs that were appended to another are left empty.
pub(super) fn join<T>(runs: &mut [Vec<T>], links: &[(usize, usize)], starts: impl Fn(&[T]) -> f64) {
    let mut ordered: Vec<(f64, usize, usize)> =
        links.iter().filter_map(|&(from, to)| Some((starts(runs.get(to)?), from, to))).collect();
    // Later starts first: then a run that is appended already holds what was appended to it.
    ordered.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, from, to) in ordered {
        let tail = runs.get_mut(to).map(std::mem::take).unwrap_or_default();
        if let Some(head) = runs.get_mut(from) {
            head.extend(tail);
        }
    }
}
