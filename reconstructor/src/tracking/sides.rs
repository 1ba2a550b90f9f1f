//! Which goal a camera stands behind. Nothing in its picture tells the two ends of the pitch apart, so `calibration` takes the left one; but where people
//! stood just before a cut they stand just after it, and that decides.
//!
//! Comes before tracking: it only asks whether there are people at the same places, not who they are.

use glam::{DMat3, DVec3};
use protocol::pitch::Pitch;

use crate::{
    assignment::{Pair, most_gain},
    calibration::CameraEstimate,
    pose::Person,
    shots::{Shot, ShotList},
};

/// Shots with more frames between them tell nothing: people have run on.
const BETWEEN_MAX: usize = 15;
/// Frames at either side of a cut of which the one with most people is taken.
const AT_CUT: usize = 5;
/// Two cameras put somebody at places this near to each other, metres.
const NEAR_M: f64 = 1.5;
/// A shot is turned when so many people are found again then, and so many times more than as it is.
const FOUND_MIN: usize = 4;
const FOUND_TIMES: usize = 2;

/// Shots from behind a goal, by number.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Sides {
    /// Those that were turned.
    pub(crate) turned: Vec<usize>,
    /// Those of which no neighbour tells the goal: they stand as they stood.
    pub(crate) open: Vec<usize>,
}

/// Turns shots from behind a goal by half, cameras and people alike, where the shot before or after shows that they stand the wrong way round.
pub(crate) fn settle(
    people: &mut [Vec<Person>],
    cameras: &mut [CameraEstimate],
    shots: &ShotList,
    pitch: &Pitch,
) -> Sides {
    let mut turned = Vec::new();
    // Forward, then back: a shot between two from behind goals may be settled by either neighbour.
    let pairs = (1..shots.shots.len()).map(|next| (next - 1, next));
    let mut settled: Vec<bool> =
        shots.shots.iter().map(|shot| !behind_a_goal(cameras, shot, pitch)).collect();
    for (first, second) in pairs.clone().chain(pairs.rev()) {
        let (Some(before), Some(after)) = (shots.shots.get(first), shots.shots.get(second)) else { continue };
        let open = match (settled.get(first), settled.get(second)) {
            (Some(true), Some(false)) => second,
            (Some(false), Some(true)) => first,
            _ => continue,
        };
        if after.frames.start.saturating_sub(before.frames.end) > BETWEEN_MAX {
            continue;
        }
        let end = before.frames.end.saturating_sub(AT_CUT).max(before.frames.start)..before.frames.end;
        let start = after.frames.start..(after.frames.start + AT_CUT).min(after.frames.end);
        let (here, there) = (places(people, end), places(people, start));
        let as_it_is = found_again(&here, &there);
        let other: Vec<DVec3> = there.iter().copied().map(turn).collect();
        let around = found_again(&here, &other);
        let (most, least) = (as_it_is.max(around), as_it_is.min(around));
        if most < FOUND_MIN || most < FOUND_TIMES * least + 1 {
            continue;
        }
        if let Some(settled) = settled.get_mut(open) {
            *settled = true;
        }
        if around > as_it_is
            && let Some(shot) = shots.shots.get(open)
        {
            turn_shot(people, cameras, shot);
            turned.push(open);
        }
    }
    turned.sort_unstable();
    let open = settled.iter().enumerate().filter(|(_, settled)| !**settled).map(|(shot, _)| shot).collect();
    Sides { turned, open }
}

fn behind_a_goal(cameras: &[CameraEstimate], shot: &Shot, pitch: &Pitch) -> bool {
    let mut seen =
        cameras.get(shot.frames.clone()).into_iter().flatten().filter_map(|estimate| estimate.camera);
    seen.next().is_some_and(|camera| camera.position.x.abs() > pitch.length_m / 2.0)
}

/// Where people stand in the one of these frames that shows most.
fn places(people: &[Vec<Person>], frames: std::ops::Range<usize>) -> Vec<DVec3> {
    let fullest = people.get(frames).unwrap_or_default().iter().max_by_key(|people| people.len());
    fullest.into_iter().flatten().map(|person| person.ground_m).filter(|at| at.is_finite()).collect()
}

/// How many people of two pictures can be the same.
fn found_again(here: &[DVec3], there: &[DVec3]) -> usize {
    let pairs: Vec<Pair> = here
        .iter()
        .enumerate()
        .flat_map(|(row, a)| {
            there.iter().enumerate().map(move |(column, b)| Pair {
                row,
                column,
                gain: NEAR_M - a.distance(*b),
            })
        })
        .collect();
    most_gain(here.len(), there.len(), &pairs).into_iter().flatten().count()
}

/// By half about the centre mark.
fn turn(at: DVec3) -> DVec3 {
    DVec3::new(-at.x, at.y, -at.z)
}

fn turn_shot(people: &mut [Vec<Person>], cameras: &mut [CameraEstimate], shot: &Shot) {
    let half = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0));
    for estimate in cameras.get_mut(shot.frames.clone()).into_iter().flatten() {
        if let Some(camera) = &mut estimate.camera {
            camera.rotation *= half;
            camera.position = turn(camera.position);
        }
    }
    for person in people.get_mut(shot.frames.clone()).into_iter().flatten().flatten() {
        person.ground_m = turn(person.ground_m);
        person.neck_m = turn(person.neck_m);
    }
}

#[cfg(test)]
mod tests {
    use protocol::camera::Camera;

    use super::*;

    const PLACES: [(f64, f64); 8] = [
        (3.0, 4.0),
        (-12.0, 9.0),
        (20.0, -3.0),
        (31.0, 14.0),
        (8.0, -17.0),
        (-5.0, -8.0),
        (15.0, 22.0),
        (40.0, 1.0),
    ];

    fn seen_at(sign: f64) -> Vec<Person> {
        let at = |(x, z): (f64, f64)| Person {
            ground_m: DVec3::new(sign * x + 0.2, 0.0, sign * z),
            neck_m: DVec3::new(sign * x + 0.2, 1.5, sign * z),
            ..Person::blank()
        };
        PLACES.into_iter().map(at).collect()
    }

    fn from(position: DVec3) -> CameraEstimate {
        let camera = Camera::looking_at((1280, 720), 2000.0, position, DVec3::new(0.0, 0.0, 1.0));
        CameraEstimate { camera: Some(camera), ..CameraEstimate::unsolved("") }
    }

    fn turned(shot: usize) -> Sides {
        Sides { turned: vec![shot], open: Vec::new() }
    }

    fn two_shots() -> ShotList {
        let shots = vec![Shot { frames: 0..10 }, Shot { frames: 10..20 }];
        ShotList { shots, transitions: Vec::new() }
    }

    fn clip(second: f64) -> (Vec<Vec<Person>>, Vec<CameraEstimate>) {
        let people = [vec![seen_at(1.0); 10], vec![seen_at(second); 10]].concat();
        let cameras =
            [vec![from(DVec3::new(0.0, 18.0, 75.0)); 10], vec![from(DVec3::new(-95.0, 22.0, 3.0)); 10]]
                .concat();
        (people, cameras)
    }

    #[test]
    fn a_shot_that_stands_the_wrong_way_round_is_turned() {
        let (mut people, mut cameras) = clip(-1.0);
        let before = cameras[12].camera.unwrap();
        assert_eq!(settle(&mut people, &mut cameras, &two_shots(), &Pitch::default()), turned(1));
        let camera = cameras[12].camera.unwrap();
        assert!((camera.position - DVec3::new(95.0, 22.0, -3.0)).length() < 1e-9);
        // The picture stays as it was: the turned world is where the world was.
        let at = DVec3::new(-20.0, 1.0, 7.0);
        assert!(before.project(at).unwrap().distance(camera.project(turn(at)).unwrap()) < 1e-9);
        assert!((people[15][0].ground_m - DVec3::new(2.8, 0.0, 4.0)).length() < 1e-9);
        assert!((people[15][0].neck_m - DVec3::new(2.8, 1.5, 4.0)).length() < 1e-9);
        assert!((people[5][0].ground_m.x - 3.2).abs() < 1e-9, "the other shot stays");
    }

    #[test]
    fn the_first_shot_is_settled_by_the_second() {
        let (mut people, mut cameras) = clip(-1.0);
        people.reverse();
        cameras.reverse();
        assert_eq!(settle(&mut people, &mut cameras, &two_shots(), &Pitch::default()), turned(0));
    }

    #[test]
    fn a_shot_that_is_right_or_cannot_be_told_stays() {
        let open = Sides { turned: Vec::new(), open: vec![1] };
        let (mut people, mut cameras) = clip(1.0);
        assert_eq!(settle(&mut people, &mut cameras, &two_shots(), &Pitch::default()), Sides::default());
        // A replay shows other places; too few people say nothing; a main camera is never turned.
        let (mut people, mut cameras) = clip(-1.0);
        for (index, person) in people[10..].iter_mut().flatten().enumerate() {
            person.ground_m += DVec3::new(6.0, 0.0, 5.0 + 3.0 * (index % 8) as f64);
        }
        assert_eq!(settle(&mut people, &mut cameras, &two_shots(), &Pitch::default()), open);
        let (mut people, mut cameras) = clip(-1.0);
        people.iter_mut().for_each(|people| people.truncate(3));
        assert_eq!(settle(&mut people, &mut cameras, &two_shots(), &Pitch::default()), open);
        let (mut people, _) = clip(-1.0);
        let mut cameras = vec![from(DVec3::new(0.0, 18.0, 75.0)); 20];
        assert_eq!(settle(&mut people, &mut cameras, &two_shots(), &Pitch::default()), Sides::default());
        assert_eq!(settle(&mut [], &mut [], &two_shots(), &Pitch::default()), Sides::default());
    }
}
