//! From many looks to one number per person: evidence adds up over a track, and a team has every number once.

use std::collections::{BTreeMap, BTreeSet};

use protocol::manifest::PersonId;

use super::{
    Reading,
    evidence::{NumberEvidence, ShirtNumber},
};
use crate::{
    teams::{Member, Role, Team},
    tracking::{Sighting, Track},
};

/// What was read in which sighting.
pub type Readings = BTreeMap<Sighting, Reading>;

/// From this confidence on a number is given out. Chosen on rendered matches that the network was not trained on (`docs/tracking.md`).
const GIVEN_FROM: f64 = 0.99;
/// Of two team-mates with one number the surer keeps it when its odds are so many times those of the other; else neither has it.
const SURER: f64 = 5.0;

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
        let Some(read) = NumberEvidence::of(&looks).likeliest() else { continue };
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
    use super::{super::evidence::tests::look, *};

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
