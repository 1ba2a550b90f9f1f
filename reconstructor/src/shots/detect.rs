//! From the differences between frames to shots. Works frame by frame with a bounded memory of pictures; decisions that need
//! what comes after are taken at the end.

use std::{collections::VecDeque, ops::Range};

use super::{
    Shot, ShotList, Transition, TransitionKind,
    measure::{Pattern, difference, energy, pattern},
    motion::Motion,
    thumbnail::Thumbnail,
};

/// Two frames differ as two scenes do. Views of one stadium have crowd above and grass below in common: rendered ones, on which
/// this was set, differ by 0.055 and more, frames of one shot by 0.01 and less, in close-ups up to 0.025.
const OTHER_SCENE: f32 = 0.04;
/// A cut stands out from the steps around it by this factor; a camera that is swept about makes many large steps.
const STANDS_OUT: f32 = 3.0;
/// Two views of mostly grass differ by less (0.024 was seen), but that stands out all the more: by nine and more, where steps of this size
/// within a shot, of a camera that pans, are at most 1.7 times those around them.
const GRASS_TO_GRASS: f32 = 0.015;
const STANDS_FAR_OUT: f32 = 5.0;
/// Steps on each side that a cut is compared with.
const NEIGHBOURS: usize = 3;
/// Most steps of a dissolve: two seconds at 25 frames per second.
const LONGEST_DISSOLVE: usize = 50;
/// Fewest steps of a dissolve: what moves fast can look alike over two or three of them.
const SHORTEST_DISSOLVE: usize = 4;
/// Coherence of a dissolve, see [`coherence`]: between 1 / steps for differences that have nothing to do with each other, and 1
/// for equal ones; coding noise and moving players take some of it.
const LEAST_COHERENCE: f32 = 0.35;
/// What the steps of a dissolve add up to at least (squared length times coherence), as a share of both scenes' variances.
const LEAST_ADDED: f32 = 0.02;
/// Share of the difference between the first and the last frame that they explain at least: about 1 where little else moves.
const LEAST_EXPLAINED: f32 = 0.4;
/// Share of the common pattern that a step at the edge of a dissolve adds at least, of an even share.
const EDGE_SHARE: f32 = 0.2;
/// Flashes of cameras last so many frames at most.
const LONGEST_FLASH: usize = 2;
/// Fewer frames than this between two breaks are no shot.
const LEAST_SHOT: usize = 5;

/// Finds the shots of frames that come one after the other.
#[derive(Debug, Default)]
pub struct ShotDetector {
    /// The latest thumbnails, at most one more than [`LONGEST_DISSOLVE`].
    thumbnails: VecDeque<Thumbnail>,
    /// The latest steps, at most [`LONGEST_DISSOLVE`].
    steps: VecDeque<Step>,
    /// Difference from the frame before, of every frame; 0 of the first.
    changes: Vec<f32>,
    /// Whether the step to this frame is part of a flash.
    flashes: Vec<bool>,
    dissolves: Vec<Candidate>,
}

/// From one frame to the next.
#[derive(Debug)]
struct Step {
    motion: Motion,
    pattern: Pattern,
}

/// Steps that may be a dissolve.
#[derive(Debug)]
struct Candidate {
    /// Frames that these steps lead to.
    steps: Range<usize>,
    score: f32,
}

impl ShotDetector {
    /// Before the first frame.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes the next frame's thumbnail: RGB, row by row, [`crate::ingest::THUMBNAIL_SIZE`].
    pub fn push(&mut self, rgb: &[u8]) {
        let next = Thumbnail::from_rgb(rgb);
        let mut change = 0.0;
        if let Some(last) = self.thumbnails.back() {
            let motion = Motion::between(last, &next);
            // A motion that leaves hardly anything in common was found between two scenes: it explains nothing.
            let compared =
                difference(last, &next, &motion).or_else(|| difference(last, &next, &Motion::NONE));
            change = compared.unwrap_or(0.0);
            self.steps.push_back(Step { motion, pattern: pattern(last, &next, &motion) });
        }
        self.changes.push(change);
        self.flashes.push(false);
        self.thumbnails.push_back(next);
        if self.steps.len() > LONGEST_DISSOLVE {
            self.steps.pop_front();
            self.thumbnails.pop_front();
        }
        self.look_for_flash();
        self.look_for_dissolve();
    }

    /// The shots of all frames taken.
    #[must_use]
    pub fn finish(self) -> ShotList {
        let frames = self.changes.len();
        let cuts: Vec<usize> = (1..frames).filter(|&frame| self.is_cut(frame)).collect();
        let mut dissolves = self.dissolves;
        // A window round a cut is as coherent as a short dissolve; the cut explains it better.
        dissolves.retain(|candidate| !cuts.iter().any(|cut| candidate.steps.contains(cut)));
        dissolves.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut kept: Vec<Range<usize>> = Vec::new();
        for Candidate { steps, .. } in dissolves {
            if kept.iter().all(|other| steps.end <= other.start || other.end <= steps.start) {
                kept.push(steps);
            }
        }
        let mut breaks: Vec<(Range<usize>, TransitionKind)> = kept
            .into_iter()
            // The last step leads to the first frame of the new shot.
            .map(|steps| (steps.start..steps.end - 1, TransitionKind::Dissolve))
            .chain(cuts.into_iter().map(|frame| (frame..frame, TransitionKind::Effect)))
            .collect();
        breaks.sort_by_key(|(range, _)| (range.start, range.end));
        assemble(frames, breaks)
    }

    /// A frame that differs from the last one but one of few frames back does not: a flash is no break.
    fn look_for_flash(&mut self) {
        let last = self.changes.len() - 1;
        let newest = self.thumbnails.len() - 1;
        for length in 1..=LONGEST_FLASH {
            let Some(begin) = last.checked_sub(length).filter(|&begin| begin > 0) else { return };
            let Some(before) = newest.checked_sub(length + 1).and_then(|at| self.thumbnails.get(at)) else {
                return;
            };
            if self.changes[begin] < GRASS_TO_GRASS || self.changes[last] < GRASS_TO_GRASS {
                continue;
            }
            let after = &self.thumbnails[newest];
            let motion = Motion::between(before, after);
            if difference(before, after, &motion).is_some_and(|d| d < GRASS_TO_GRASS) {
                self.flashes[begin..=last].fill(true);
            }
        }
    }

    /// Whether the latest steps, any number of them, are a dissolve; the likeliest number is kept.
    fn look_for_dissolve(&mut self) {
        let Some(newest) = self.thumbnails.back() else { return };
        let mut sum: Pattern = Vec::new();
        let (mut energies, mut best) = (0.0, None::<(f32, usize)>);
        for (back, step) in self.steps.iter().rev().enumerate() {
            if sum.is_empty() {
                sum = vec![0.0; step.pattern.len()];
            }
            sum.iter_mut().zip(&step.pattern).for_each(|(s, v)| *s += v);
            energies += energy(&step.pattern);
            let (count, whole) = (back + 1, energy(&sum));
            let coherent = coherence(whole, energies, count);
            if count >= SHORTEST_DISSOLVE
                && coherent >= LEAST_COHERENCE
                && best.is_none_or(|(score, _)| score < whole * coherent)
            {
                best = Some((whole * coherent, count));
            }
        }
        let Some((score, count)) = best else { return };
        let first = self.thumbnails.len() - 1 - count;
        let motion = self
            .steps
            .iter()
            .skip(self.steps.len() - count)
            .fold(Motion::NONE, |all, step| all.then(&step.motion));
        let Some(before) = self.thumbnails.get(first) else { return };
        if score < LEAST_ADDED * (before.contrast() + newest.contrast()) {
            return;
        }
        // The steps of a dissolve add up to the difference of the scenes; a camera's own motion, badly followed, leaves something
        // at every step that does not.
        if score < LEAST_EXPLAINED * energy(&pattern(before, newest, &motion)) {
            return;
        }
        // The motion along the way may be wrong in a dissolve: a direct search may find that it is one scene after all.
        let other = |motion: &Motion| difference(before, newest, motion).is_some_and(|d| d >= OTHER_SCENE);
        if !(other(&motion) && other(&Motion::between(before, newest))) {
            return;
        }
        if let Some(steps) = self.trimmed(count) {
            self.dissolves.push(Candidate { steps, score });
        }
    }

    /// The latest `count` steps without those at either end that add little to the whole.
    fn trimmed(&self, count: usize) -> Option<Range<usize>> {
        let steps: Vec<&Step> = self.steps.iter().skip(self.steps.len() - count).collect();
        let cells = steps.first()?.pattern.len();
        let whole: Vec<f32> =
            (0..cells).map(|cell| steps.iter().map(|step| step.pattern[cell]).sum()).collect();
        let squared: f32 = whole.iter().map(|v| v * v).sum();
        let shares: Vec<f32> = steps
            .iter()
            .map(|step| step.pattern.iter().zip(&whole).map(|(a, b)| a * b).sum::<f32>() / squared)
            .collect();
        let even = EDGE_SHARE / count as f32;
        let first = shares.iter().position(|&share| share >= even)?;
        let last = shares.iter().rposition(|&share| share >= even)?;
        let end = self.changes.len();
        let range = end - count + first..end - count + last + 1;
        (range.len() >= SHORTEST_DISSOLVE).then_some(range)
    }

    fn is_cut(&self, frame: usize) -> bool {
        let change = self.changes[frame];
        if change < GRASS_TO_GRASS || self.flashes[frame] {
            return false;
        }
        let low = frame.saturating_sub(NEIGHBOURS).max(1);
        let mut around: Vec<f32> = (low..(frame + NEIGHBOURS + 1).min(self.changes.len()))
            .filter(|&other| other != frame)
            .map(|other| self.changes[other])
            .collect();
        around.sort_by(f32::total_cmp);
        // The second largest: a flash beside the cut does not hide it.
        around.pop();
        let factor = if change >= OTHER_SCENE { STANDS_OUT } else { STANDS_FAR_OUT };
        around.last().is_none_or(|other| change >= factor * other)
    }
}

/// How well steps add up: squared length of their sum over the most that it could be for their squared lengths.
fn coherence(whole: f32, energies: f32, steps: usize) -> f32 {
    if energies > 0.0 { whole / (energies * steps as f32) } else { 0.0 }
}

/// Shots between breaks; breaks with hardly anything between them become one.
fn assemble(frames: usize, breaks: Vec<(Range<usize>, TransitionKind)>) -> ShotList {
    let mut joined: Vec<(Range<usize>, TransitionKind)> = Vec::new();
    for (range, kind) in breaks {
        match joined.last_mut() {
            Some((last, last_kind)) if range.start < last.end + LEAST_SHOT => {
                last.end = last.end.max(range.end);
                *last_kind = TransitionKind::Effect;
            }
            _ => joined.push((range, kind)),
        }
    }
    let (mut list, mut start) = (ShotList::default(), 0);
    for (range, kind) in joined {
        if start < range.start {
            list.shots.push(Shot { frames: start..range.start });
        }
        start = range.end;
        if !range.is_empty() {
            list.transitions.push(Transition { frames: range, kind });
        }
    }
    if start < frames {
        list.shots.push(Shot { frames: start..frames });
    }
    list
}
