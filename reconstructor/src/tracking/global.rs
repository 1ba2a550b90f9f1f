//! Offline tracking of one shot: tracklets without doubt, linked over gaps all at once, and then cleaned of what is nobody.

use glam::DVec2;

use super::{
    Sighting,
    appearance::MeanLooks,
    links::{Node, Round, join, links},
    motion::Place,
    tracklets::{Seen, Tracklet, tracklets},
};
use crate::pose::Person;

/// Rounds of linking within a shot, from short and clear to long and likeliest.
const ROUNDS: [(f64, f64); 5] = [(0.13, 4.0), (0.4, 3.0), (1.0, 2.0), (2.5, 1.0), (2.5, f64::NEG_INFINITY)];
/// A round is repeated while it links anything, at most so many times.
const REPEATS: usize = 6;
/// People on a pitch, per square metre.
const OTHERS_PER_M2: f64 = 0.005;
/// Loss of a second without a sighting.
const UNSEEN_PER_S: f64 = 0.8;
/// Two tracks are one person seen twice when for most of the shorter's time they are this near on the pitch and their boxes overlap this much.
const TWICE_M: f64 = 0.8;
const TWICE_OVERLAP: f64 = 0.5;
const TWICE_SHARE: f64 = 0.6;
/// Somebody who is seen twice may change from one track to another within this time, seconds; in this share of the frames that both show they are then
/// at most so far apart on the pitch, metres, and their boxes overlap by so much. Rougher than for doubles: two looks at one person in a
/// tangle differ in how low they put the feet.
const HANDOVER_S: f64 = 1.0;
const HANDOVER_SHARE: f64 = 0.5;
const HANDOVER_M: f64 = 1.5;
const HANDOVER_OVERLAP: f64 = 0.3;
/// Looks of both tracks must not be less alike than this (logarithm).
const HANDOVER_LOOKS: f64 = -1.0;

/// Who is who within one shot; every list by frame.
pub(super) fn chains(
    people: &[Vec<Person>],
    seconds: &[f64],
    cameras: &[Option<DVec2>],
    gap_s: f64,
) -> Vec<Vec<Sighting>> {
    let frames: Vec<Vec<Seen>> = people
        .iter()
        .enumerate()
        .map(|(frame, people)| {
            let from = cameras.get(frame).copied().flatten();
            let seconds = seconds.get(frame).copied().unwrap_or(f64::NAN);
            let seen = people.iter().enumerate().map(|(person_index, person)| Seen {
                sighting: Sighting { frame, person_index },
                seconds,
                place: Place::seen(DVec2::new(person.neck_m.x, person.neck_m.z), from),
                looks: person.looks,
            });
            seen.filter(|seen| seen.place.at.is_finite() && seen.seconds.is_finite()).collect()
        })
        .collect();
    let mut runs = tracklets(&frames);
    for (round_gap_s, clear_by) in ROUNDS {
        let round = Round {
            gap_s: round_gap_s.min(gap_s),
            clear_by,
            others_per_m2: OTHERS_PER_M2,
            apart_m: 0.0,
            unseen_per_s: UNSEEN_PER_S,
        };
        for _ in 0..REPEATS {
            let nodes: Vec<Node> = runs.iter().filter_map(Node::of).collect();
            let found = links(&nodes, &round, &|_, _| Some(0.0));
            if found.is_empty() {
                break;
            }
            join(&mut runs, &found, |run| run.first().map_or(0.0, |seen| seen.seconds));
            runs.retain(|run| !run.is_empty());
        }
    }
    let runs = without_doubles(hand_over(runs, people), people);
    runs.into_iter().map(|run| run.into_iter().map(|seen| seen.sighting).collect()).collect()
}

/// Joins tracks of which one begins just before the other ends, where both are sightings of one person in the frames that they share.
fn hand_over(mut runs: Vec<Tracklet>, people: &[Vec<Person>]) -> Vec<Tracklet> {
    runs.sort_by_key(|run| run.first().map(|seen| seen.sighting));
    let mut kept: Vec<Tracklet> = Vec::new();
    for run in runs {
        let before = kept.iter_mut().filter_map(|earlier| Some((shared(earlier, &run, people)?, earlier)));
        match before.min_by_key(|(shared, _)| *shared) {
            Some((shared, earlier)) => earlier.extend(run.into_iter().skip(shared)),
            None => kept.push(run),
        }
    }
    kept
}

/// How many sightings at the start of `later` come before the end of `earlier`, whom it goes on with; `None` when it does not.
fn shared(earlier: &[Seen], later: &[Seen], people: &[Vec<Person>]) -> Option<usize> {
    let (end, start) = (earlier.last()?, later.first()?);
    let goes_on = earlier.first()?.sighting.frame < start.sighting.frame
        && later.last()?.sighting.frame > end.sighting.frame;
    if !goes_on || !(0.0..=HANDOVER_S).contains(&(end.seconds - start.seconds)) {
        return None;
    }
    let from = earlier.partition_point(|seen| seen.sighting.frame < start.sighting.frame);
    let (mut pairs, mut near) = (0_usize, 0_usize);
    for seen in earlier.get(from..)? {
        if let Some(other) = later.iter().find(|other| other.sighting.frame == seen.sighting.frame) {
            pairs += 1;
            near +=
                usize::from(coincide(people, (seen.sighting, other.sighting), HANDOVER_M, HANDOVER_OVERLAP));
        }
    }
    let looks = |run: &[Seen]| {
        let looks: Vec<_> = run.iter().map(|seen| seen.looks).collect();
        MeanLooks::of(looks.iter())
    };
    let alike = pairs > 0
        && near as f64 >= HANDOVER_SHARE * pairs as f64
        && looks(earlier).log_same(&looks(later)) > HANDOVER_LOOKS;
    alike.then(|| later.partition_point(|seen| seen.sighting.frame <= end.sighting.frame))
}

/// Leaves out tracks that are a second sighting of somebody for most of their time.
fn without_doubles(mut runs: Vec<Tracklet>, people: &[Vec<Person>]) -> Vec<Tracklet> {
    runs.sort_by_key(|run| std::cmp::Reverse(run.len()));
    let frames = people.len();
    let mut kept: Vec<Tracklet> = Vec::new();
    // Place in `kept` of everybody in a frame.
    let mut by_frame: Vec<Vec<(usize, Sighting)>> = vec![Vec::new(); frames];
    for run in runs {
        let mut twice = vec![0_usize; kept.len()];
        for seen in &run {
            for (place, other) in by_frame.get(seen.sighting.frame).into_iter().flatten() {
                if let Some(count) = twice.get_mut(*place) {
                    *count += usize::from(coincide(people, (seen.sighting, *other), TWICE_M, TWICE_OVERLAP));
                }
            }
        }
        let most = twice.into_iter().max().unwrap_or(0);
        if most as f64 >= TWICE_SHARE * run.len() as f64 {
            continue;
        }
        for seen in &run {
            if let Some(frame) = by_frame.get_mut(seen.sighting.frame) {
                frame.push((kept.len(), seen.sighting));
            }
        }
        kept.push(run);
    }
    kept
}

/// Whether two sightings of a frame are at most so far apart, metres, and overlap by more than so much.
fn coincide(people: &[Vec<Person>], pair: (Sighting, Sighting), far_m: f64, overlap: f64) -> bool {
    let person = |s: Sighting| people.get(s.frame)?.get(s.person_index);
    let (Some(a), Some(b)) = (person(pair.0), person(pair.1)) else { return false };
    a.ground_m.distance(b.ground_m) < far_m && a.bounds.iou(&b.bounds) > overlap
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{geometry::PixelBox, pose::Looks};

    /// Somebody who runs, in two runs of sightings: frames 0 to 30, and 29 to 59 as `beside_px` to the right.
    fn seen_twice(beside_px: f64) -> (Vec<Tracklet>, Vec<Vec<Person>>) {
        let person = |frame: usize, beside_px: f64| {
            let min = DVec2::new(5.0 * frame as f64 + beside_px, 100.0);
            Person {
                bounds: PixelBox { min, max: min + DVec2::new(25.0, 60.0) },
                ground_m: DVec3::new((5.0 * frame as f64 + beside_px) / 35.0, 0.0, 0.0),
                ..Person::blank()
            }
        };
        let (first, second) = (0..31, 29..60);
        let people: Vec<Vec<Person>> = (0..60)
            .map(|frame| {
                let of_first = first.contains(&frame).then(|| person(frame, 0.0));
                of_first
                    .into_iter()
                    .chain(second.contains(&frame).then(|| person(frame, beside_px)))
                    .collect()
            })
            .collect();
        let run = |frames: std::ops::Range<usize>, later: bool| -> Tracklet {
            let seen = frames.map(|frame| {
                let person_index = usize::from(later && frame < 31);
                let at = people[frame][person_index].ground_m;
                let place = Place::seen(DVec2::new(at.x, at.z), None);
                let sighting = Sighting { frame, person_index };
                Seen { sighting, seconds: frame as f64 / 25.0, place, looks: Looks::default() }
            });
            seen.collect()
        };
        (vec![run(first.clone(), false), run(second.clone(), true)], people)
    }

    #[test]
    fn a_track_that_takes_over_from_another_of_the_same_person_goes_on_with_it() {
        let (runs, people) = seen_twice(4.0);
        let joined = hand_over(runs, &people);
        assert_eq!(joined.len(), 1);
        let frames: Vec<usize> = joined[0].iter().map(|seen| seen.sighting.frame).collect();
        assert_eq!(frames, (0..60).collect::<Vec<_>>());
    }

    #[test]
    fn two_who_stand_beside_each_other_when_one_goes_and_one_comes_stay_two() {
        let (runs, people) = seen_twice(20.0);
        assert_eq!(hand_over(runs, &people).len(), 2);
        // Nor is who was there all the time taken for the one who comes.
        let (mut runs, people) = seen_twice(4.0);
        runs[1].truncate(2);
        assert_eq!(hand_over(runs, &people).len(), 2);
    }
}
