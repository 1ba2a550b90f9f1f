//! From many looks to one number per person: evidence adds up over a track, and a team has every number once.

use std::collections::{BTreeMap, BTreeSet};

use protocol::manifest::PersonId;

use super::{Reading, TENS, UNITS};
use crate::{
    teams::{Member, Role, Team},
    tracking::{Sighting, Track},
};

/// What was read in which sighting.
pub type Readings = BTreeMap<Sighting, Reading>;

/// Numbers run from 1 to this.
const NUMBERS: usize = 99;
/// From this confidence on a number is given out. Chosen on rendered matches that the network was not trained on (`docs/tracking.md`).
const GIVEN_FROM: f64 = 0.99;
/// How alike looks at one person err: they share kit, lettering and light. Many looks count as 1 / ALIKE, however many there are.
const ALIKE: f64 = 0.25;
/// Most players of a match wear one of the first 30 numbers.
const COMMON: usize = 30;
const COMMON_WEIGHT: f64 = 3.0;
/// Of two team-mates with one number the surer keeps it when its odds are so many times those of the other; else neither has it.
const SURER: f64 = 5.0;
/// No look rules a number out for good.
const PROBABILITY_MIN: f64 = 1e-4;

/// A shirt number, and how sure it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShirtNumber {
    /// 1 to 99.
    pub number: u8,
    /// Probability that it is right, 0..1.
    pub confidence: f64,
}

/// A number that somebody may have.
struct Claim<'a> {
    track: &'a Track,
    team: Option<Team>,
    number: ShirtNumber,
    contested: bool,
}

/// The numbers of those whose number is sure enough. Officials have none.
#[must_use]
pub fn decide(tracks: &[Track], members: &[Member], readings: &Readings) -> BTreeMap<PersonId, ShirtNumber> {
    let member_of: BTreeMap<PersonId, &Member> =
        members.iter().map(|member| (member.person, member)).collect();
    let mut claims: Vec<Claim<'_>> = Vec::new();
    for track in tracks {
        let member = member_of.get(&track.person);
        if member.is_some_and(|m| matches!(m.role, Some(Role::Referee | Role::Assistant))) {
            continue;
        }
        let looks: Vec<&Reading> =
            track.sightings.iter().filter_map(|sighting| readings.get(sighting)).collect();
        let Some(read) = likeliest(&looks) else { continue };
        tracing::debug!(
            "person {}: {} with {:.4} after {} looks",
            track.person.0,
            read.number,
            read.confidence,
            looks.len()
        );
        if read.confidence < GIVEN_FROM {
            continue;
        }
        claims.push(Claim { track, team: member.and_then(|m| m.team), number: read, contested: false });
    }
    claims.sort_by(|a, b| b.number.confidence.total_cmp(&a.number.confidence));
    let mut kept: Vec<Claim<'_>> = Vec::new();
    for claim in claims {
        match kept.iter_mut().find(|other| other.excludes(&claim)) {
            Some(surer) => surer.contested |= surer.odds() < SURER * claim.odds(),
            None => kept.push(claim),
        }
    }
    let given = kept.into_iter().filter(|claim| !claim.contested);
    given.map(|claim| (claim.track.person, claim.number)).collect()
}

/// The number that explains all looks best, and its probability; `None` without looks.
fn likeliest(looks: &[&Reading]) -> Option<ShirtNumber> {
    // Looks that show no number do not make the others count less.
    let legible: f64 = looks.iter().map(|look| f64::from(look.legible)).sum();
    let weight = 1.0 / (1.0 + ALIKE * (legible - 1.0).max(0.0));
    let evidence: Vec<f64> = (1..=NUMBERS)
        .map(|number| {
            let prior = if number <= COMMON { COMMON_WEIGHT.ln() } else { 0.0 };
            prior + weight * looks.iter().map(|look| likelihood(look, number).ln()).sum::<f64>()
        })
        .collect();
    let (place, most) = evidence.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let all: f64 = evidence.iter().map(|value| (value - most).exp()).sum();
    (!looks.is_empty()).then(|| ShirtNumber { number: place as u8 + 1, confidence: 1.0 / all })
}

/// How much likelier a look is with this number on the back than with any other. A look that may show no number says little.
fn likelihood(look: &Reading, number: usize) -> f64 {
    let of = |digits: &[f32], digit: usize| f64::from(digits.get(digit).copied().unwrap_or(0.0));
    let both = of(&look.tens, number / 10) * of(&look.units, number % 10) * (TENS * UNITS) as f64;
    let legible = f64::from(look.legible);
    (legible * both + 1.0 - legible).max(PROBABILITY_MIN)
}

impl Claim<'_> {
    fn odds(&self) -> f64 {
        self.number.confidence / (1.0 - self.number.confidence).max(1e-12)
    }

    /// Whether both cannot be right: one number, one team, and both on the pitch at a time.
    fn excludes(&self, other: &Self) -> bool {
        self.number.number == other.number.number
            && self.team.is_some()
            && self.team == other.team
            && together(self.track, other.track)
    }
}

/// Whether two tracks share a frame.
fn together(a: &Track, b: &Track) -> bool {
    let frames: BTreeSet<usize> = a.sightings.iter().map(|sighting| sighting.frame).collect();
    b.sightings.iter().any(|sighting| frames.contains(&sighting.frame))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A look at a number of which the network is so sure, digit by digit.
    fn look(number: usize, sure: f32, legible: f32) -> Reading {
        let peak = |digit: usize| {
            let mut ten = [(1.0 - sure) / 9.0; 10];
            ten[digit] = sure;
            ten
        };
        Reading { tens: peak(number / 10), units: peak(number % 10), legible }
    }

    fn track(person: u32, frames: std::ops::Range<usize>) -> Track {
        let sightings = frames.map(|frame| Sighting { frame, person_index: person as usize });
        Track { person: PersonId(person), sightings: sightings.collect() }
    }

    fn member(person: u32, team: Option<Team>, role: Role) -> Member {
        let team_confidence = f64::from(u8::from(team.is_some()));
        Member {
            person: PersonId(person),
            team,
            team_confidence,
            role: Some(role),
            role_confidence: 1.0,
            shirt_rgb: None,
        }
    }

    /// Every sighting of the tracks reads as `looks` says.
    fn readings(tracks: &[(&Track, Reading)]) -> Readings {
        let all = tracks
            .iter()
            .flat_map(|(track, look)| track.sightings.iter().map(move |sighting| (*sighting, look.clone())));
        all.collect()
    }

    #[test]
    fn several_fair_looks_agree_on_a_number_and_one_is_not_enough() {
        let fair = look(17, 0.8, 0.9);
        let one = likeliest(&[&fair]).unwrap();
        let six = likeliest(&[&fair; 6]).unwrap();
        assert_eq!((one.number, six.number), (17, 17));
        assert!(one.confidence < GIVEN_FROM && six.confidence > GIVEN_FROM, "{one:?} {six:?}");
        assert_eq!(likeliest(&[]), None);
    }

    #[test]
    fn looks_that_contradict_each_other_or_show_nothing_give_no_number() {
        let (a, b) = (look(6, 0.9, 0.9), look(8, 0.9, 0.9));
        let torn = likeliest(&[&a, &b, &a, &b]).unwrap();
        assert!(torn.confidence < 0.6, "{torn:?}");
        let nothing = look(10, 1.0, 0.02);
        let seen = likeliest(&[&nothing; 4]).unwrap();
        assert!(seen.confidence < GIVEN_FROM, "{seen:?}");
        // One wild look does not undo ten good ones.
        let good = look(23, 0.9, 0.95);
        let wild = look(7, 1.0, 1.0);
        let mixed = likeliest(&[[&good; 10].as_slice(), &[&wild]].concat()).unwrap();
        assert!(mixed.number == 23 && mixed.confidence > GIVEN_FROM, "{mixed:?}");
    }

    #[test]
    fn of_two_team_mates_with_one_number_the_surer_keeps_it() {
        let (a, b, c) = (track(1, 0..8), track(2, 4..8), track(3, 0..8));
        let seen = readings(&[(&a, look(9, 0.9, 0.95)), (&b, look(9, 0.7, 0.9)), (&c, look(9, 0.9, 0.95))]);
        let tracks = [a, b, c];
        let members = [
            member(1, Some(Team::A), Role::Player),
            member(2, Some(Team::A), Role::Player),
            member(3, Some(Team::B), Role::Player),
        ];
        let given = decide(&tracks, &members, &seen);
        let people: Vec<u32> = given.keys().map(|person| person.0).collect();
        assert_eq!(people, [1, 3], "{given:?}");
        assert!(given.values().all(|number| number.number == 9));
    }

    #[test]
    fn when_neither_is_surer_neither_has_it_but_one_after_the_other_may() {
        let equal = |second: std::ops::Range<usize>| {
            let (a, b) = (track(1, 0..8), track(2, second));
            let seen = readings(&[(&a, look(5, 0.9, 0.95)), (&b, look(5, 0.9, 0.95))]);
            let members =
                [member(1, Some(Team::A), Role::Player), member(2, Some(Team::A), Role::Goalkeeper)];
            decide(&[a, b], &members, &seen).len()
        };
        assert_eq!(equal(0..8), 0);
        assert_eq!(equal(20..28), 2);
    }

    #[test]
    fn officials_have_no_number() {
        let a = track(1, 0..8);
        let seen = readings(&[(&a, look(5, 0.9, 0.95))]);
        for role in [Role::Referee, Role::Assistant] {
            assert!(decide(std::slice::from_ref(&a), &[member(1, None, role)], &seen).is_empty());
        }
        assert_eq!(decide(std::slice::from_ref(&a), &[], &seen).len(), 1);
    }
}
