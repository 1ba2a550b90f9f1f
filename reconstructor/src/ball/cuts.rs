//! Moments at which the ball may have been touched or have met the grass: where its way over the picture bends.

use glam::{DVec2, DVec3};

use super::{
    bodies::{self, Near},
    fit::PIXEL_SIGMA,
    sight::{Moment, Sight},
};
use crate::pose::Person;

/// Sights on either side of a moment that its change of way is measured on, and the seconds they may span.
const WINDOW: usize = 4;
const WINDOW_S: f64 = 0.3;
/// A change of way of less than this many standard deviations is none.
const CHANGE_MIN: f64 = 2.5;
/// Frames between two cuts at least.
const APART_FRAMES: usize = 2;
/// Without any cut for so many sights, one is offered.
const STEADY_SIGHTS: usize = 20;
/// Frames without a sight from which on a gap has cuts inside, and the frames between them.
const GAP_FRAMES: usize = 3;
const GAP_STEP: usize = 2;
/// Bodies farther from the ball than this have not touched it, metres.
const REACH_M: f64 = 1.6;

/// A moment between two frames at which one law of motion may hand over to another.
#[derive(Clone, Debug)]
pub(super) struct Cut {
    /// From the start of the clip.
    pub(super) seconds: f64,
    /// The first sight after it.
    pub(super) sight: usize,
    /// The time between the frames around it.
    pub(super) slack_s: f64,
    /// Who is near, nearest first.
    pub(super) near: Vec<Near>,
}

/// Cuts through a run of sights, in order; the first lies before the first sight, the last after the last one.
pub(super) fn between(sights: &[Sight], moments: &[Moment], people: &[Vec<Person>]) -> Vec<Cut> {
    let changes: Vec<f64> = (0..sights.len()).map(|index| change(sights, index)).collect();
    let mut places: Vec<usize> = Vec::new();
    let mut strongest: Vec<usize> = (1..sights.len()).filter(|&k| changes[k] > CHANGE_MIN).collect();
    strongest.sort_by(|&a, &b| changes[b].total_cmp(&changes[a]).then(a.cmp(&b)));
    let far = |places: &[usize], k: usize, least: usize| {
        places.iter().all(|&other: &usize| sights[other].frame.abs_diff(sights[k].frame) >= least)
    };
    for k in strongest {
        if far(&places, k, APART_FRAMES) {
            places.push(k);
        }
    }
    places.sort_unstable();
    let mut last = 0;
    for k in places.clone().into_iter().chain([sights.len()]) {
        while k - last > STEADY_SIGHTS * 3 / 2 {
            last += STEADY_SIGHTS;
            places.push(last);
        }
        last = k;
    }
    places.sort_unstable();
    places.dedup();
    let mut cuts: Vec<Cut> = Vec::new();
    for index in 0..=sights.len() {
        let Some((before, after)) = neighbours(sights, index) else {
            let Some(sight) = sights.get(index).or(sights.last()) else { continue };
            // Half a frame beyond the first and the last sight.
            let half = 0.02 * if index == 0 { -1.0 } else { 1.0 };
            cuts.push(Cut { seconds: sight.seconds + half, sight: index, slack_s: 0.04, near: Vec::new() });
            continue;
        };
        let missed = after.frame - before.frame - 1;
        let frame_s = (after.seconds - before.seconds) / (missed + 1) as f64;
        let mut moments_s = Vec::new();
        let mut slack_s = after.seconds - before.seconds;
        if missed >= GAP_FRAMES {
            // The touch may be anywhere in the gap.
            slack_s = frame_s * GAP_STEP as f64;
            let steps = (0..=missed).step_by(GAP_STEP);
            moments_s.extend(steps.map(|k| before.seconds + frame_s * (k as f64 + 0.5)));
        } else if places.binary_search(&index).is_ok() {
            moments_s.push((before.seconds + after.seconds) / 2.0);
        }
        for seconds in moments_s {
            cuts.push(Cut { seconds, sight: index, slack_s, near: Vec::new() });
        }
    }
    for cut in &mut cuts {
        cut.near = near(cut, sights, moments, people);
    }
    cuts
}

fn neighbours(sights: &[Sight], index: usize) -> Option<(&Sight, &Sight)> {
    Some((sights.get(index.checked_sub(1)?)?, sights.get(index)?))
}

/// Bodies near the ball at a cut, the ball taken to go straight between the sights around it.
pub(super) fn near(cut: &Cut, sights: &[Sight], moments: &[Moment], people: &[Vec<Person>]) -> Vec<Near> {
    let direction = |sight: &Sight| sight.camera.ray(sight.pixel).direction;
    let way = match neighbours(sights, cut.sight) {
        Some((before, after)) => {
            let share = (cut.seconds - before.seconds) / (after.seconds - before.seconds).max(1e-6);
            direction(before).lerp(direction(after), share)
        }
        None => match sights.get(cut.sight).or(sights.last()) {
            Some(sight) => direction(sight),
            None => DVec3::ZERO,
        },
    };
    let frame = moments.partition_point(|moment| moment.seconds < cut.seconds);
    // The frames just before and after; bodies are where they are in either.
    let around = frame.saturating_sub(1)..(frame + 1).min(moments.len());
    let mut found: Vec<Near> = Vec::new();
    for frame in around {
        let (Some(camera), Some(people)) = (moments[frame].camera, people.get(frame)) else { continue };
        let Some(pixel) = camera.project(camera.position + way * 50.0) else { continue };
        for candidate in bodies::near(&camera, people, pixel, REACH_M) {
            match found
                .iter_mut()
                .find(|other| other.part == candidate.part && other.point.distance(candidate.point) < 0.7)
            {
                Some(other) if other.apart_m <= candidate.apart_m => {}
                Some(other) => *other = candidate,
                None => found.push(candidate),
            }
        }
    }
    found.sort_by(|a, b| a.apart_m.total_cmp(&b.apart_m).then(a.part.cmp(&b.part)));
    found.truncate(4);
    found
}

/// How much the way over the picture bends before a sight, in standard deviations of what noise does.
fn change(sights: &[Sight], index: usize) -> f64 {
    let Some((before, after)) = neighbours(sights, index) else { return 0.0 };
    let middle_s = (before.seconds + after.seconds) / 2.0;
    let reference = after.camera;
    // Directions as pixels of one camera, so that its own motion does not count.
    let line = |part: &mut dyn Iterator<Item = &Sight>| -> Option<(DVec2, f64)> {
        let places: Vec<(f64, DVec2)> = part
            .take(WINDOW)
            .filter(|sight| (sight.seconds - middle_s).abs() < WINDOW_S)
            .filter_map(|sight| {
                let direction = sight.camera.ray(sight.pixel).direction;
                Some((sight.seconds, reference.project(reference.position + direction * 50.0)?))
            })
            .collect();
        let count = places.len() as f64;
        if places.len() < 2 {
            return None;
        }
        let mean_s = places.iter().map(|(s, _)| s).sum::<f64>() / count;
        let spread: f64 = places.iter().map(|(s, _)| (s - mean_s).powi(2)).sum();
        let slope = places.iter().map(|(s, p)| *p * (s - mean_s)).sum::<DVec2>() / spread.max(1e-9);
        Some((slope, PIXEL_SIGMA * PIXEL_SIGMA / spread.max(1e-9)))
    };
    let left = line(&mut sights[..index].iter().rev());
    let right = line(&mut sights[index..].iter());
    match (left, right) {
        (Some((v, a)), Some((w, b))) => v.distance(w) / (a + b).sqrt(),
        _ => 0.0,
    }
}
