//! Shirt numbers held against the truth: a track's number is right when it is that of the person whom the track shows most.

use std::collections::{BTreeMap, BTreeSet};

use protocol::manifest::PersonId;
use serde::Serialize;

use super::{scores::Matches, truth::Truth};
use crate::numbers::ShirtNumber;

/// Figures of shirt numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct NumberFigures {
    /// Tracks that were given a number.
    pub numbers_read: usize,
    /// Share of them whose number is right; a number of somebody who is not in the truth, or has none, is wrong. 1 of none.
    pub number_accuracy: f64,
    /// Share of the true people with a number, of those who count in some frame, whose number was given to a track of theirs.
    pub number_recall: f64,
}

pub(super) fn figures(
    truth: &Truth,
    read: &BTreeMap<PersonId, ShirtNumber>,
    matches: &Matches,
) -> NumberFigures {
    // Whom each track shows in most of its frames.
    let mut shows: BTreeMap<u32, (usize, u32)> = BTreeMap::new();
    for ((person, ours), frames) in matches {
        let most = shows.entry(*ours).or_insert((*frames, *person));
        if *frames > most.0 {
            *most = (*frames, *person);
        }
    }
    let true_number = |person: &u32| truth.people.get(person).and_then(|person| person.number);
    let shown = truth.frames.iter().filter(|frame| frame.shot.is_some()).flat_map(|frame| &frame.counts);
    let numbered: BTreeSet<u32> =
        shown.map(|person| person.id).filter(|id| true_number(id).is_some()).collect();
    let right = |(ours, number): (&PersonId, &ShirtNumber)| {
        let (_, person) = shows.get(&ours.0)?;
        (true_number(person)? == number.number).then_some(*person)
    };
    let right: Vec<u32> = read.iter().filter_map(right).collect();
    let found = numbered.iter().filter(|person| right.contains(person)).count();
    let share = |part: usize, whole: usize| if whole == 0 { 1.0 } else { part as f64 / whole as f64 };
    NumberFigures {
        numbers_read: read.len(),
        number_accuracy: share(right.len(), read.len()),
        number_recall: share(found, numbered.len()),
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;
    use protocol::pitch::Pitch;

    use super::*;
    use crate::{
        evaluate::{
            frame_truth::WhoTruth,
            tracking::{TrackedBox, truth::TrueFrame},
        },
        geometry::PixelBox,
    };

    /// People with their numbers; everybody counts in one frame.
    fn truth(numbers: &[(u32, Option<u8>)]) -> Truth {
        let who = |&(id, number): &(u32, Option<u8>)| {
            (id, WhoTruth { id, team: None, role: "player".to_owned(), number })
        };
        let bounds = PixelBox { min: DVec2::ZERO, max: DVec2::ONE };
        let counts = numbers.iter().map(|&(id, _)| TrackedBox { id, bounds }).collect();
        let frames = vec![TrueFrame { shot: Some(0), counts, ignored: Vec::new() }];
        Truth { pitch: Pitch::default(), people: numbers.iter().map(who).collect(), frames }
    }

    #[test]
    fn a_number_is_right_when_it_is_that_of_whom_the_track_shows_most() {
        let truth = truth(&[(0, Some(7)), (1, Some(10)), (2, Some(4)), (3, None)]);
        let read = |ours, number| (PersonId(ours), ShirtNumber { number, confidence: 0.95 });
        // Tracks 20 and 21 are of person 0, 22 of person 1 and a little of 2, 23 of the referee, 24 of nobody.
        let matches =
            BTreeMap::from([((0, 20), 50), ((0, 21), 9), ((1, 22), 40), ((2, 22), 5), ((3, 23), 30)]);
        let all = [read(20, 7), read(21, 7), read(22, 4), read(23, 1), read(24, 9)];
        let figures = figures(&truth, &BTreeMap::from(all), &matches);
        assert_eq!(figures.numbers_read, 5);
        assert!((figures.number_accuracy - 2.0 / 5.0).abs() < 1e-12);
        assert!((figures.number_recall - 1.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn nothing_read_is_no_mistake() {
        let figures = figures(&truth(&[(0, Some(3))]), &BTreeMap::new(), &BTreeMap::from([((0, 5), 10)]));
        assert_eq!((figures.numbers_read, figures.number_accuracy, figures.number_recall), (0, 1.0, 0.0));
    }
}
