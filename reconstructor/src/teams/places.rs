//! Roles, from who wears which kit and where people stand: whoever wears neither kit is a keeper before a goal, an assistant on a
//! touchline, the referee elsewhere.

use std::collections::BTreeMap;

use protocol::pitch::Pitch;

use super::{
    Candidate, Role, Team,
    kits::{self, Kits},
};

/// An assistant stands at most this far inside the touchline, metres; positions err.
const TOUCHLINE_M: f64 = 1.5;
/// A keeper is mostly this near to the goal line and to the middle of the pitch's width, metres.
const KEEPER_DEEP_M: f64 = 24.0;
const KEEPER_WIDE_M: f64 = 22.0;
/// Tracks whose kits differ by less are taken to wear the same one (as of [`kits::distance`]).
const SAME_KIT: f64 = 5.0;
/// Mean distance between the teams along the pitch from which it is sure who defends which side, metres.
const SIDES_M: f64 = 2.0;

/// What was decided about a track, each with its confidence.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Decided {
    pub(super) team: Option<(Team, f64)>,
    pub(super) role: Option<(Role, f64)>,
}

/// Team and role of every track.
pub(super) fn roles(candidates: &[Candidate], kits: &Kits, pitch: &Pitch) -> Vec<Decided> {
    let left = left_team(candidates, kits);
    let groups = groups(candidates, kits);
    let mut decided = vec![Decided::default(); candidates.len()];
    for (track, (place, wears)) in decided.iter_mut().zip(&kits.wears).enumerate() {
        if let Some(team) = kits.team(track) {
            let sure = wears[team as usize];
            *place = Decided { team: Some((team, sure)), role: Some((Role::Player, sure)) };
        }
    }
    for group in groups {
        let stands: Vec<Stands> =
            group.iter().filter_map(|&t| Some(Stands::of(candidates.get(t)?, pitch))).collect();
        let weight =
            |kind: fn(&Stands) -> bool| stands.iter().filter(|s| kind(s)).map(|s| s.weight).sum::<f64>();
        // Where they stand and what each picture takes them for.
        let taken_for = |role: usize| -> f64 {
            group
                .iter()
                .filter_map(|&t| candidates.get(t))
                .map(|c| c.weight * c.taken_for.get(role).unwrap_or(&0.0))
                .sum()
        };
        let keeping = weight(Stands::keeps) + taken_for(0);
        let elsewhere = weight(|s| !s.keeps()) + taken_for(1);
        // One kit, one kind: a referee who comes near the goal for a while wears what the assistants wear.
        let keepers = keeping > elsewhere;
        for (&track, stands) in group.iter().zip(&stands) {
            let Some(place) = decided.get_mut(track) else { continue };
            let other = kits.wears.get(track).map_or(0.0, |wears| wears[2]);
            if keepers {
                let sure = other * keeping / (keeping + elsewhere).max(f64::MIN_POSITIVE);
                let team = left
                    .map(|(left, sides)| (if stands.x_m < 0.0 { left } else { left.other() }, sure * sides));
                *place = Decided { team, role: Some((Role::Goalkeeper, sure)) };
            } else if stands.on_touchline > 0.5 {
                *place = Decided { team: None, role: Some((Role::Assistant, other * stands.on_touchline)) };
            } else {
                *place =
                    Decided { team: None, role: Some((Role::Referee, other * (1.0 - stands.on_touchline))) };
            }
        }
    }
    decided
}

/// Where a track mostly stands.
struct Stands {
    /// Median place along the pitch.
    x_m: f64,
    on_touchline: f64,
    before_goal: f64,
    weight: f64,
}

impl Stands {
    fn of(candidate: &Candidate, pitch: &Pitch) -> Self {
        let share = |count: usize| count as f64 / candidate.places.len().max(1) as f64;
        let mut along: Vec<f64> = candidate.places.iter().map(|(_, place)| place.x).collect();
        along.sort_by(f64::total_cmp);
        let on_touchline =
            candidate.places.iter().filter(|(_, p)| p.y.abs() > pitch.width_m / 2.0 - TOUCHLINE_M).count();
        let before_goal = candidate
            .places
            .iter()
            .filter(|(_, p)| p.x.abs() > pitch.length_m / 2.0 - KEEPER_DEEP_M && p.y.abs() < KEEPER_WIDE_M)
            .count();
        Self {
            x_m: along.get(along.len() / 2).copied().unwrap_or(0.0),
            on_touchline: share(on_touchline),
            before_goal: share(before_goal),
            weight: candidate.weight,
        }
    }

    fn keeps(&self) -> bool {
        self.before_goal > 0.5
    }
}

/// Tracks that wear neither kit, by what they wear: each joins the first group it fits, the longest tracks first.
fn groups(candidates: &[Candidate], kits: &Kits) -> Vec<Vec<usize>> {
    let mut others: Vec<usize> = (0..candidates.len()).filter(|&track| kits.team(track).is_none()).collect();
    let weight = |track: usize| candidates.get(track).map_or(0.0, |c| c.weight);
    others.sort_by(|&a, &b| weight(b).total_cmp(&weight(a)));
    let worn = |track: usize| candidates.get(track).map(|c| kits::kit(&c.looks)).unwrap_or_default();
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for track in others {
        let near = |group: &Vec<usize>| -> Option<f64> {
            kits::distance(&worn(*group.first()?), &worn(track)).filter(|distance| *distance < SAME_KIT)
        };
        let nearest = groups
            .iter_mut()
            .filter_map(|group| Some((near(group)?, group)))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match nearest {
            Some((_, group)) => group.push(track),
            None => groups.push(vec![track]),
        }
    }
    groups
}

/// The team that defends the side of negative x, and how sure that is: in each frame the mean places of both teams are
/// compared, so that what the camera shows does not matter.
fn left_team(candidates: &[Candidate], kits: &Kits) -> Option<(Team, f64)> {
    let mut frames: BTreeMap<usize, [(f64, usize); 2]> = BTreeMap::new();
    for (track, candidate) in candidates.iter().enumerate() {
        let Some(team) = kits.team(track) else { continue };
        for (frame, place) in &candidate.places {
            let (sum, count) = &mut frames.entry(*frame).or_default()[team as usize];
            *sum += place.x;
            *count += 1;
        }
    }
    let differences: Vec<f64> = frames
        .values()
        .filter(|[a, b]| a.1 >= 2 && b.1 >= 2)
        .map(|[a, b]| a.0 / a.1 as f64 - b.0 / b.1 as f64)
        .collect();
    let mean = differences.iter().sum::<f64>() / differences.len().max(1) as f64;
    let sure = 0.5 + 0.5 * (mean.abs() / SIDES_M).min(1.0);
    (!differences.is_empty()).then_some((if mean < 0.0 { Team::A } else { Team::B }, sure))
}
