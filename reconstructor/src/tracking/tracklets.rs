//! Sightings to tracklets: runs of one person in which no link between two pictures leaves a doubt.
//!
//! From picture to picture the nearest prediction and the nearest sighting find each other; where a second one is nearly as near, all that are
//! concerned end and begin anew. What to do about these is decided later, with both sides known. Where the looks change for good
//! within a tracklet, two people were taken for one, and it is split.

use super::{
    Sighting,
    appearance::MeanLooks,
    motion::{Place, State},
};
use crate::pose::Looks;

/// A tracklet waits this long for its next sighting, seconds.
const WAIT_S: f64 = 0.1;
/// Links must be this likely (logarithm of the density per square metre).
const LEAST_LOG: f64 = -5.5;
/// The second best is less likely than the best by this (logarithm), or there is a doubt.
const CLEAR_BY: f64 = 3.5;
/// Sightings before and after a place where a tracklet may be split, and how unlike they must be (logarithm).
const WINDOW: usize = 8;
const UNLIKE: f64 = -4.0;
/// What looks in two pictures may say at most for or against a link.
const LOOKS_WEIGHT: f64 = 5.0;

/// One sighting with all that linking needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) sighting: Sighting,
    pub(super) seconds: f64,
    pub(super) place: Place,
    pub(super) looks: Looks,
}

/// Sightings of one person in order of time, at most one per frame, never empty.
pub(super) type Tracklet = Vec<Seen>;

struct Growing {
    seen: Tracklet,
    state: State,
    seconds: f64,
}

/// The tracklets of a shot; `frames` in order of time.
pub(super) fn tracklets(frames: &[Vec<Seen>]) -> Vec<Tracklet> {
    let mut growing: Vec<Growing> = Vec::new();
    let mut done: Vec<Tracklet> = Vec::new();
    for frame in frames {
        let Some(now) = frame.first().map(|seen| seen.seconds) else { continue };
        let (waiting, late): (Vec<_>, Vec<_>) =
            growing.into_iter().partition(|tracklet| now - tracklet.seconds <= WAIT_S);
        done.extend(late.into_iter().map(|tracklet| tracklet.seen));
        growing = waiting;
        let log: Vec<Vec<f64>> = growing.iter().map(|tracklet| likelihoods(tracklet, frame, now)).collect();
        let of_sighting =
            |place: usize| log.iter().map(move |row| row.get(place).copied().unwrap_or(f64::NEG_INFINITY));
        let mut next: Vec<Growing> = Vec::new();
        let mut taken = vec![false; frame.len()];
        for (tracklet, row) in growing.into_iter().zip(&log) {
            let Some((best, likely, second)) =
                best_two(row.iter().copied()).filter(|(_, likely, _)| *likely >= LEAST_LOG)
            else {
                next.push(tracklet);
                continue;
            };
            let rival = best_two(of_sighting(best))
                .is_none_or(|(_, first, second)| first > likely || second > likely - CLEAR_BY);
            match frame.get(best) {
                Some(seen)
                    if !rival
                        && second <= likely - CLEAR_BY
                        && !std::mem::replace(&mut taken[best], true) =>
                {
                    let mut tracklet = tracklet;
                    tracklet.state = tracklet.state.after(now - tracklet.seconds).with(&seen.place);
                    tracklet.seconds = now;
                    tracklet.seen.push(*seen);
                    next.push(tracklet);
                }
                // In doubt it ends here.
                _ => done.push(tracklet.seen),
            }
        }
        let new = frame.iter().zip(taken).filter(|(_, taken)| !taken);
        next.extend(new.map(|(seen, _)| Growing {
            seen: vec![*seen],
            state: State::new(&seen.place),
            seconds: now,
        }));
        growing = next;
    }
    done.extend(growing.into_iter().map(|tracklet| tracklet.seen));
    let mut all: Vec<Tracklet> = done.into_iter().flat_map(split_where_looks_change).collect();
    all.sort_by_key(|tracklet| {
        tracklet.first().map(|seen| (seen.sighting.frame, seen.sighting.person_index))
    });
    all
}

/// How likely each sighting of a frame continues a tracklet.
fn likelihoods(tracklet: &Growing, frame: &[Seen], now: f64) -> Vec<f64> {
    let state = tracklet.state.after(now - tracklet.seconds);
    let last: Vec<Looks> = tracklet.seen.iter().rev().take(WINDOW).map(|seen| seen.looks).collect();
    let last = MeanLooks::of(last.iter());
    frame
        .iter()
        .map(|seen| {
            let looks = MeanLooks::of([seen.looks].iter()).log_same(&last).clamp(-LOOKS_WEIGHT, LOOKS_WEIGHT);
            state.log_density(&seen.place) + looks
        })
        .collect()
}

/// Place and value of the greatest, and the value of the second.
fn best_two(values: impl Iterator<Item = f64>) -> Option<(usize, f64, f64)> {
    let (mut best, mut second) = (None::<(usize, f64)>, f64::NEG_INFINITY);
    for (place, value) in values.enumerate() {
        match best {
            Some((_, greatest)) if value <= greatest => second = second.max(value),
            _ => {
                second = best.map_or(second, |(_, greatest)| greatest);
                best = Some((place, value));
            }
        }
    }
    best.map(|(place, value)| (place, value, second))
}

fn split_where_looks_change(tracklet: Tracklet) -> Vec<Tracklet> {
    if tracklet.len() < 2 * WINDOW {
        return vec![tracklet];
    }
    let mean = |part: &[Seen]| {
        let looks: Vec<Looks> = part.iter().map(|seen| seen.looks).collect();
        MeanLooks::of(looks.iter())
    };
    let unlike = (WINDOW..=tracklet.len() - WINDOW).filter_map(|at| {
        let (before, after) = (tracklet.get(at - WINDOW..at)?, tracklet.get(at..at + WINDOW)?);
        Some((at, mean(before).log_same(&mean(after))))
    });
    match unlike.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, log)| *log < UNLIKE) {
        Some((at, _)) => {
            let mut first = tracklet;
            let rest = first.split_off(at);
            // Both parts are shorter, so this ends.
            [first, rest].into_iter().flat_map(split_where_looks_change).collect()
        }
        None => vec![tracklet],
    }
}
