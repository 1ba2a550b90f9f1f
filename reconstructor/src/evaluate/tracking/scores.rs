//! HOTA (Luiten et al. 2021), CLEAR MOT (Bernardin & Stiefelhagen 2008) and identity measures (Ristani et al. 2016) of tracks
//! of boxes, by the definitions of the package TrackEval, which the test at the end holds them against.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::{
    assignment::{Pair, most_gain},
    geometry::PixelBox,
};

/// Overlap (intersection over union) from which a box is of a person, for CLEAR, the identity measures and teams.
const OVERLAP: f64 = 0.5;
/// HOTA is the mean over these least overlaps: 0.05, 0.10, … 0.95.
const ALPHAS: usize = 19;
/// TrackEval compares with the machine's epsilon of slack.
const SLACK: f64 = f64::EPSILON;

/// Somebody's box in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedBox {
    /// Who.
    pub id: u32,
    /// Where.
    pub bounds: PixelBox,
}

/// One frame: the true boxes that count and ours. No identity twice on a side.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameBoxes {
    /// The truth.
    pub truth: Vec<TrackedBox>,
    /// What is measured.
    pub ours: Vec<TrackedBox>,
}

impl FrameBoxes {
    /// Leaves out those of ours that fit best to people who do not count (`ignored`): neither right nor wrong.
    #[must_use]
    pub fn without(mut self, ignored: &[TrackedBox]) -> Self {
        if !ignored.is_empty() {
            let everybody: Vec<TrackedBox> = self.truth.iter().chain(ignored).copied().collect();
            let overlaps = overlaps(&everybody, &self.ours);
            let pairs = overlaps.pairs(|overlap| if overlap >= OVERLAP - SLACK { overlap } else { 0.0 });
            let found = most_gain(everybody.len(), self.ours.len(), &pairs);
            let gone: Vec<usize> = found.into_iter().skip(self.truth.len()).flatten().collect();
            let mut place = 0..;
            self.ours.retain(|_| place.next().is_some_and(|place| !gone.contains(&place)));
        }
        self
    }
}

/// How well tracks fit the truth.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Scores {
    /// Higher order tracking accuracy, 0..1: √(detection · association), mean over the least overlaps 0.05 … 0.95.
    pub hota: f64,
    /// Its detection accuracy.
    pub deta: f64,
    /// Its association accuracy.
    pub assa: f64,
    /// Its localisation accuracy: mean overlap of matched boxes.
    pub loca: f64,
    /// F1 of boxes under the best one-to-one assignment of our identities to the true ones, at an overlap of 0.5.
    pub idf1: f64,
    /// CLEAR's accuracy: 1 − (missed + false + switches) / true boxes, at an overlap of 0.5.
    pub mota: f64,
    /// Times that a true person is matched by another of our identities than the last one.
    pub id_switches: usize,
    /// Share of the true boxes that are matched at an overlap of 0.5.
    pub recall: f64,
    /// Share of our boxes that are.
    pub precision: f64,
    /// True boxes.
    pub true_boxes: usize,
    /// Identities in the truth, and ours.
    pub identities: [usize; 2],
}

/// Frames in which a true person (first) was matched by one of ours (second).
pub type Matches = BTreeMap<(u32, u32), usize>;

/// All measures of a sequence, and who was matched with whom in how many frames at an overlap of 0.5 (CLEAR's matches).
#[must_use]
pub fn scores(frames: &[FrameBoxes]) -> (Scores, Matches) {
    let frames: Vec<Overlaps> = frames.iter().map(|frame| overlaps(&frame.truth, &frame.ours)).collect();
    let counts = Counts::of(&frames);
    let mut scores = hota(&frames, &counts);
    scores.idf1 = idf1(&frames, &counts);
    let clear = clear(&frames);
    let (true_boxes, our_boxes) = (counts.truth.values().sum::<usize>(), counts.ours.values().sum::<usize>());
    let matched: usize = clear.matches.values().sum();
    let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
    let right = matched as f64 - (our_boxes - matched) as f64 - clear.switches as f64;
    let scores = Scores {
        mota: right / true_boxes.max(1) as f64,
        id_switches: clear.switches,
        recall: share(matched, true_boxes),
        precision: share(matched, our_boxes),
        true_boxes,
        identities: [counts.truth.len(), counts.ours.len()],
        ..scores
    };
    (scores, clear.matches)
}

/// A frame's identities and the overlap of every true box with each of ours.
struct Overlaps {
    truth: Vec<u32>,
    ours: Vec<u32>,
    /// Those that overlap at all: place in `truth`, place in `ours`, intersection over union.
    some: Vec<(usize, usize, f64)>,
}

impl Overlaps {
    fn pairs(&self, gain: impl Fn(f64) -> f64) -> Vec<Pair> {
        self.some.iter().map(|&(row, column, overlap)| Pair { row, column, gain: gain(overlap) }).collect()
    }

    /// The identities of the overlapping, with their overlap.
    fn identities(&self) -> impl Iterator<Item = ((u32, u32), f64)> {
        self.some
            .iter()
            .filter_map(|&(t, o, overlap)| Some(((*self.truth.get(t)?, *self.ours.get(o)?), overlap)))
    }

    /// The best assignment by a gain of places and overlap: identities and overlap of each pair.
    fn assign(&self, gain: impl Fn((u32, u32), f64) -> f64) -> Vec<((u32, u32), f64)> {
        let found: Vec<((u32, u32), f64)> = self.identities().collect();
        let pairs: Vec<Pair> = self
            .some
            .iter()
            .zip(&found)
            .map(|(&(row, column, overlap), (who, _))| Pair { row, column, gain: gain(*who, overlap) })
            .collect();
        let columns = most_gain(self.truth.len(), self.ours.len(), &pairs);
        let chosen = self.some.iter().zip(found).filter(|((t, o, _), _)| columns.get(*t) == Some(&Some(*o)));
        chosen.map(|(_, found)| found).collect()
    }
}

fn overlaps(truth: &[TrackedBox], ours: &[TrackedBox]) -> Overlaps {
    let mut some = Vec::new();
    for (t, true_box) in truth.iter().enumerate() {
        for (o, our_box) in ours.iter().enumerate() {
            let overlap = true_box.bounds.iou(&our_box.bounds);
            if overlap > 0.0 {
                some.push((t, o, overlap));
            }
        }
    }
    let ids = |boxes: &[TrackedBox]| boxes.iter().map(|b| b.id).collect();
    Overlaps { truth: ids(truth), ours: ids(ours), some }
}

/// Boxes of every identity.
struct Counts {
    truth: BTreeMap<u32, usize>,
    ours: BTreeMap<u32, usize>,
}

impl Counts {
    fn of(frames: &[Overlaps]) -> Self {
        let mut counts = Self { truth: BTreeMap::new(), ours: BTreeMap::new() };
        for frame in frames {
            frame.truth.iter().for_each(|id| *counts.truth.entry(*id).or_default() += 1);
            frame.ours.iter().for_each(|id| *counts.ours.entry(*id).or_default() += 1);
        }
        counts
    }

    /// Boxes that a true person and one of ours have together, those that they share counted once.
    fn either(&self, (truth, ours): (u32, u32), shared: f64) -> f64 {
        let of = |counts: &BTreeMap<u32, usize>, id| counts.get(&id).copied().unwrap_or(0) as f64;
        of(&self.truth, truth) + of(&self.ours, ours) - shared
    }
}

fn hota(frames: &[Overlaps], counts: &Counts) -> Scores {
    // How well each pair of identities fits over the whole sequence decides who is matched in a frame where several could be.
    let mut potential: BTreeMap<(u32, u32), f64> = BTreeMap::new();
    for frame in frames {
        let (mut by_truth, mut by_ours) = (BTreeMap::new(), BTreeMap::new());
        for ((truth, ours), overlap) in frame.identities() {
            *by_truth.entry(truth).or_insert(0.0) += overlap;
            *by_ours.entry(ours).or_insert(0.0) += overlap;
        }
        for ((truth, ours), overlap) in frame.identities() {
            let all = by_truth.get(&truth).unwrap_or(&0.0) + by_ours.get(&ours).unwrap_or(&0.0) - overlap;
            *potential.entry((truth, ours)).or_default() += overlap / all;
        }
    }
    let alignment =
        |who: (u32, u32)| potential.get(&who).map_or(0.0, |shared| shared / counts.either(who, *shared));
    let mut matched: Vec<BTreeMap<(u32, u32), usize>> = vec![BTreeMap::new(); ALPHAS];
    let mut overlap_sums = [0.0; ALPHAS];
    for frame in frames {
        for (who, overlap) in frame.assign(|who, overlap| alignment(who) * overlap) {
            for (place, (matched, sum)) in matched.iter_mut().zip(&mut overlap_sums).enumerate() {
                if overlap >= 0.05 * (place + 1) as f64 - SLACK {
                    *matched.entry(who).or_default() += 1;
                    *sum += overlap;
                }
            }
        }
    }
    let boxes = (counts.truth.values().sum::<usize>() + counts.ours.values().sum::<usize>()) as f64;
    let mut mean = Scores::default();
    for (matched, overlap_sum) in matched.iter().zip(overlap_sums) {
        let right = matched.values().sum::<usize>() as f64;
        let detection = right / (boxes - right).max(1.0);
        let association: f64 = matched
            .iter()
            .map(|(who, frames)| {
                *frames as f64 * *frames as f64 / counts.either(*who, *frames as f64).max(1.0)
            })
            .sum::<f64>()
            / right.max(1.0);
        mean.deta += detection / ALPHAS as f64;
        mean.assa += association / ALPHAS as f64;
        mean.hota += (detection * association).sqrt() / ALPHAS as f64;
        mean.loca += f64::max(1e-10, overlap_sum) / right.max(1e-10) / ALPHAS as f64;
    }
    mean
}

fn idf1(frames: &[Overlaps], counts: &Counts) -> f64 {
    let mut together: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for frame in frames {
        for (who, _) in frame.identities().filter(|(_, overlap)| *overlap >= OVERLAP) {
            *together.entry(who).or_default() += 1;
        }
    }
    let place =
        |ids: &BTreeMap<u32, usize>| -> BTreeMap<u32, usize> { ids.keys().copied().zip(0..).collect() };
    let (rows, columns) = (place(&counts.truth), place(&counts.ours));
    let pairs: Vec<Pair> = together
        .iter()
        .filter_map(|((truth, ours), frames)| {
            Some(Pair { row: *rows.get(truth)?, column: *columns.get(ours)?, gain: *frames as f64 })
        })
        .collect();
    let chosen = most_gain(rows.len(), columns.len(), &pairs);
    let right: f64 =
        pairs.iter().filter(|p| chosen.get(p.row) == Some(&Some(p.column))).map(|p| p.gain).sum();
    let boxes = counts.truth.values().sum::<usize>() + counts.ours.values().sum::<usize>();
    right / (boxes as f64 / 2.0).max(1.0)
}

struct Clear {
    matches: Matches,
    switches: usize,
}

fn clear(frames: &[Overlaps]) -> Clear {
    let mut clear = Clear { matches: Matches::new(), switches: 0 };
    let mut last: BTreeMap<u32, u32> = BTreeMap::new();
    // Who was matched in the frame before stays matched while the boxes overlap enough.
    let mut before: BTreeMap<u32, u32> = BTreeMap::new();
    for frame in frames.iter().filter(|frame| !frame.truth.is_empty() && !frame.ours.is_empty()) {
        let matched = frame.assign(|(truth, ours), overlap| {
            let stays = before.get(&truth) == Some(&ours);
            if overlap < OVERLAP - SLACK {
                0.0
            } else if stays {
                1000.0 + overlap
            } else {
                overlap
            }
        });
        before = matched.iter().map(|(who, _)| *who).collect();
        for ((truth, ours), _) in matched {
            *clear.matches.entry((truth, ours)).or_default() += 1;
            clear.switches += usize::from(last.insert(truth, ours).is_some_and(|last| last != ours));
        }
    }
    clear
}

#[cfg(test)]
#[path = "scores_tests.rs"]
mod tests;
