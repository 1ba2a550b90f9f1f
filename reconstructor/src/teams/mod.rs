//! Whose side everybody is on: the two kits are found among the tracks without labels, and who wears neither of them is a keeper or an
//! official by where that person stands.
//!
//! Nothing is known of the kits beforehand. What cannot be told stays `None`, and every answer has a confidence.

mod beside;
mod kits;
mod places;
#[cfg(test)]
mod tests;

pub use beside::on_the_pitch;

use glam::DVec2;
use protocol::{manifest::PersonId, pitch::Pitch};
use serde::{Deserialize, Serialize};

use crate::{
    detection::RoleChances,
    numbers::Readings,
    pose::{Looks, Person},
    tracking::{
        Track,
        across::{self, Clip, Marks},
        appearance::MeanLooks,
    },
};

/// From this confidence teams and roles tell people apart.
const SURE: f64 = 0.8;

/// One of the two teams. Team `a` is the one whose kit was seen more; nobody knows which one plays at home.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Team {
    /// Seen more.
    A,
    /// The other.
    B,
}

impl Team {
    /// Its id in the manifest.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::A => "a",
            Self::B => "b",
        }
    }

    /// The opponents.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }
}

/// What somebody does on the pitch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// In the field.
    Player,
    /// In goal.
    Goalkeeper,
    /// The referee.
    Referee,
    /// Assistant referee on a touchline.
    Assistant,
}

impl Role {
    /// Its name in the manifest.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Player => "player",
            Self::Goalkeeper => "goalkeeper",
            Self::Referee => "referee",
            Self::Assistant => "assistant",
        }
    }
}

/// Who somebody is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Member {
    /// Identity of the track.
    pub person: PersonId,
    /// The team; `None` for officials and when it cannot be told.
    pub team: Option<Team>,
    /// How likely the team is right, 0..1; 0 without a team.
    pub team_confidence: f64,
    /// The role, when it can be told.
    pub role: Option<Role>,
    /// How likely the role is right, 0..1; 0 without a role.
    pub role_confidence: f64,
    /// Main colour of the shirt, sRGB.
    pub shirt_rgb: Option<[u8; 3]>,
}

/// A track as teams see it.
struct Candidate {
    looks: MeanLooks,
    /// Pictures.
    weight: f64,
    /// What the detector takes the person for, mean: goalkeeper, official, bystander.
    taken_for: [f64; 3],
    /// Frame and place on the pitch (world x, z) of every sighting.
    places: Vec<(usize, DVec2)>,
}

/// Who everybody is, in the order of the tracks.
#[must_use]
pub fn assign(tracks: &[Track], people: &[Vec<Person>], pitch: &Pitch) -> Vec<Member> {
    let candidates: Vec<Candidate> = tracks.iter().map(|track| candidate(track, people)).collect();
    let kits = kits::find(&candidates);
    let roles = places::roles(&candidates, &kits, pitch);
    let all = tracks.iter().zip(&candidates).zip(roles);
    all.map(|((track, candidate), decided)| Member {
        person: track.person,
        team: decided.team.map(|(team, _)| team),
        team_confidence: decided.team.map_or(0.0, |(_, confidence)| confidence),
        role: decided.role.map(|(role, _)| role),
        role_confidence: decided.role.map_or(0.0, |(_, confidence)| confidence),
        shirt_rgb: candidate.looks.kit[0].map(|(colour, _)| colour.to_srgb()),
    })
    .collect()
}

/// Joins tracks of one person over cuts and spells out of the picture, with the help of who is on whose side and of shirt numbers, and says
/// who everybody is then.
pub(crate) fn join_tracks(
    tracks: &[Track],
    clip: &Clip<'_>,
    pitch: &Pitch,
    readings: &Readings,
) -> (Vec<Track>, Vec<Member>) {
    let members = assign(tracks, clip.people, pitch);
    let side = |person: PersonId| {
        let member = members.iter().find(|member| member.person == person)?;
        let role = member.role.filter(|_| member.role_confidence > SURE)?;
        let team = member.team.filter(|_| member.team_confidence > SURE);
        Some(role as u8 * 3 + team.map_or(0, |team| team as u8 + 1))
    };
    let joined = across::join_tracks(tracks, clip, &Marks { side: &side, backs: readings });
    let members = assign(&joined, clip.people, pitch);
    (joined, members)
}

fn candidate(track: &Track, people: &[Vec<Person>]) -> Candidate {
    let seen =
        || track.sightings.iter().filter_map(|s| Some((s.frame, people.get(s.frame)?.get(s.person_index)?)));
    let looks: Vec<Looks> = seen().map(|(_, person)| person.looks).collect();
    Candidate {
        looks: MeanLooks::of(looks.iter()),
        weight: looks.len() as f64,
        taken_for: {
            let mean = |chance: fn(&RoleChances) -> f32| {
                let sum: f64 = seen().map(|(_, person)| f64::from(chance(&person.roles))).sum();
                sum / looks.len().max(1) as f64
            };
            [mean(|r| r.goalkeeper), mean(|r| r.official), mean(|r| r.bystander)]
        },
        places: seen()
            .map(|(frame, person)| (frame, DVec2::new(person.ground_m.x, person.ground_m.z)))
            .collect(),
    }
}
