//! Greedy merging of tracks: the nearest end and start first, short gaps before long ones.
//!
//! Within the merges of one gap those come first that leave no doubt; they give the tracks a speed, and where several
//! people are close the speed then tells who is who.

use std::collections::HashMap;

use glam::DVec2;

use super::{Sighting, TrackingLimits};

/// Nobody runs faster, metres per second.
const SPEED_MAX_M_S: f64 = 10.0;
/// The speed at the end of a track is that over this time, seconds.
const SPEED_OVER_S: f64 = 0.4;
/// Speed is believed this long into a gap, seconds; people turn.
const SPEED_HOLDS_S: f64 = 0.5;
/// A link leaves no doubt when every other one that it rules out is this many times as long, and longer by
/// [`CLEAR_BY_M`].
const CLEAR_TIMES: f64 = 2.0;
const CLEAR_BY_M: f64 = 0.3;
/// A link from a track too short to have a speed waits for those that have one, metres added to its length.
const NO_SPEED_M: f64 = 0.3;

/// A possible merge: the end of chain `from` with the start of chain `to`.
struct Link {
    from: usize,
    to: usize,
    /// Distance between the predicted and the seen place, metres, with penalties.
    cost_m: f64,
}

/// Sightings linked to chains, in order of time; `places` (x, z on the pitch) per frame and person, `seconds` per frame.
pub(super) fn chains(places: &[Vec<DVec2>], seconds: &[f64], limits: &TrackingLimits) -> Vec<Vec<Sighting>> {
    let mut state = Chains::of_single_sightings(places, seconds);
    for gap in 1..=limits.max_gap_frames.min(places.len()) {
        state.merge_clear_links(gap, limits);
        while state.merge_nearest_links(gap, limits) {}
    }
    state.chains.into_iter().filter(|chain| !chain.is_empty()).collect()
}

struct Chains<'a> {
    places: &'a [Vec<DVec2>],
    seconds: &'a [f64],
    /// A chain that was merged into another is empty.
    chains: Vec<Vec<Sighting>>,
}

impl<'a> Chains<'a> {
    fn of_single_sightings(places: &'a [Vec<DVec2>], seconds: &'a [f64]) -> Self {
        let sightings = places.iter().enumerate().flat_map(|(frame, people)| {
            people
                .iter()
                .enumerate()
                .filter(|(_, place)| place.is_finite())
                .map(move |(person_index, _)| vec![Sighting { frame, person_index }])
        });
        Self { places, seconds, chains: sightings.collect() }
    }

    fn place(&self, sighting: Sighting) -> Option<DVec2> {
        self.places.get(sighting.frame)?.get(sighting.person_index).copied()
    }

    fn moment(&self, sighting: Sighting) -> Option<f64> {
        self.seconds.get(sighting.frame).copied()
    }

    /// Every possible link over exactly `gap` frames, shortest first; equal ones in the order of the people.
    fn links(&self, gap: usize, limits: &TrackingLimits) -> Vec<Link> {
        let mut starts: HashMap<usize, Vec<usize>> = HashMap::new();
        for (i, chain) in self.chains.iter().enumerate() {
            if let Some(first) = chain.first() {
                starts.entry(first.frame).or_default().push(i);
            }
        }
        let mut links = Vec::new();
        for (from, chain) in self.chains.iter().enumerate() {
            let Some(last) = chain.last() else { continue };
            for &to in starts.get(&(last.frame + gap)).into_iter().flatten() {
                if let Some(cost_m) = self.cost(from, to, limits) {
                    links.push(Link { from, to, cost_m });
                }
            }
        }
        links.sort_by(|a, b| a.cost_m.total_cmp(&b.cost_m).then((a.from, a.to).cmp(&(b.from, b.to))));
        links
    }

    /// How badly two chains fit together, metres; `None` when nobody could have moved so.
    fn cost(&self, from: usize, to: usize, limits: &TrackingLimits) -> Option<f64> {
        let (before, after) = (self.chains.get(from)?, self.chains.get(to)?);
        let (last, first) = (*before.last()?, *after.first()?);
        let (end, start) = (self.place(last)?, self.place(first)?);
        let wait = self.moment(first)? - self.moment(last)?;
        if end.distance(start) > limits.max_distance_m + SPEED_MAX_M_S * wait {
            return None;
        }
        let held = wait.min(SPEED_HOLDS_S);
        let forwards = self.speed(before.iter().rev()).map(|speed| (end + speed * held).distance(start));
        let backwards = self.speed(after.iter()).map(|speed| (start - speed * held).distance(end));
        Some(match (forwards, backwards) {
            (Some(f), Some(b)) => (f + b) / 2.0,
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => end.distance(start) + NO_SPEED_M,
        })
    }

    /// Speed over the first [`SPEED_OVER_S`] of `sightings` (in either direction of time), metres per second.
    fn speed<'s>(&self, sightings: impl Iterator<Item = &'s Sighting>) -> Option<DVec2> {
        let mut points = sightings.filter_map(|&s| Some((self.moment(s)?, self.place(s)?)));
        let (t0, p0) = points.next()?;
        let near = points.take_while(|(t, _)| (t - t0).abs() <= SPEED_OVER_S);
        // Least squares through the first point: one bad position does not turn the runner round.
        let (mut products, mut squares, mut count) = (DVec2::ZERO, 0.0, 0);
        for (t, p) in near {
            products += (p - p0) * (t - t0);
            squares += (t - t0) * (t - t0);
            count += 1;
        }
        (count >= 3 && squares > 0.0).then(|| (products / squares).clamp_length_max(SPEED_MAX_M_S))
    }

    /// Merges links that have no rival of similar length at either end.
    fn merge_clear_links(&mut self, gap: usize, limits: &TrackingLimits) {
        let links = self.links(gap, limits);
        let mut nearest: [HashMap<usize, [f64; 2]>; 2] = [HashMap::new(), HashMap::new()];
        for link in &links {
            for (map, end) in nearest.iter_mut().zip([link.from, link.to]) {
                // Links come shortest first, so the first two of an end are its two nearest.
                let two = map.entry(end).or_insert([f64::INFINITY; 2]);
                if two[0].is_infinite() {
                    two[0] = link.cost_m;
                } else if two[1].is_infinite() {
                    two[1] = link.cost_m;
                }
            }
        }
        let clear = |map: &HashMap<usize, [f64; 2]>, end: usize, cost: f64| {
            map.get(&end).is_some_and(|&[first, second]| {
                cost <= first && second > CLEAR_TIMES * cost && second > cost + CLEAR_BY_M
            })
        };
        let [by_from, by_to] = &nearest;
        let sure = |l: &Link| clear(by_from, l.from, l.cost_m) && clear(by_to, l.to, l.cost_m);
        let chosen: Vec<Link> = links.into_iter().filter(sure).collect();
        self.merge_all(&chosen);
    }

    /// Merges the shortest links, one per end and per start at most, and tells whether there were any.
    fn merge_nearest_links(&mut self, gap: usize, limits: &TrackingLimits) -> bool {
        let (mut used_from, mut used_to) = (vec![false; self.chains.len()], vec![false; self.chains.len()]);
        let mut chosen = Vec::new();
        for link in self.links(gap, limits) {
            // A chain that grew at one end in this round waits at the other: its speed has changed.
            let taken = [&used_from, &used_to].iter().any(|used| {
                used.get(link.from).copied().unwrap_or(true) || used.get(link.to).copied().unwrap_or(true)
            });
            if !taken {
                used_from[link.from] = true;
                used_to[link.to] = true;
                chosen.push(link);
            }
        }
        self.merge_all(&chosen);
        !chosen.is_empty()
    }

    /// Appends chain `to` to chain `from` for each link; a chain may be the end of one and the start of another.
    fn merge_all(&mut self, links: &[Link]) {
        // Later starts first: then a chain that is appended already holds what was appended to it.
        let mut ordered: Vec<&Link> = links.iter().collect();
        let start = |link: &Link| self.chains.get(link.to).and_then(|c| c.first()).map(|s| s.frame);
        ordered.sort_by_key(|link| std::cmp::Reverse(start(link)));
        for (from, to) in ordered.into_iter().map(|l| (l.from, l.to)).collect::<Vec<_>>() {
            let tail = self.chains.get_mut(to).map(std::mem::take).unwrap_or_default();
            if let Some(head) = self.chains.get_mut(from) {
                head.extend(tail);
            }
        }
    }
}
