//! Who takes no part: coaches, substitutes, stewards and photographers beside the pitch, and what only looked like a person for a moment.

use protocol::pitch::Pitch;

use super::{Candidate, kits};
use crate::{pose::Person, tracking::Track};

/// Always farther outside the lines than this, nobody plays and no assistant stands, metres.
const FAR_M: f64 = 1.9;
/// Always farther outside than this is nobody who wears a team's kit, metres: a throw-in is taken nearer to the line.
const NEAR_M: f64 = 0.8;
/// "Always" leaves out this share of the sightings.
const STRAY: f64 = 0.1;
/// A track is doubtful when fewer than this share of its frames have a sighting, and
const SEEN_SHARE: f64 = 0.55;
/// its detections are this much less sure than the median track's.
const SURENESS_SHARE: f64 = 0.7;

/// The tracks of those who take part.
#[must_use]
pub fn on_the_pitch(tracks: Vec<Track>, people: &[Vec<Person>], pitch: &Pitch) -> Vec<Track> {
    let candidates: Vec<Candidate> = tracks.iter().map(|track| super::candidate(track, people)).collect();
    let kits = kits::find(&candidates);
    let sure: Vec<f64> = tracks.iter().map(|track| sureness(track, people)).collect();
    let mut sorted = sure.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let mut place = 0..;
    let mut kept = tracks;
    kept.retain(|track| {
        let Some(i) = place.next() else { return true };
        let Some((candidate, sure)) = candidates.get(i).zip(sure.get(i)) else { return true };
        let outside = outside_m(candidate, pitch);
        let [_, official, bystander] = candidate.taken_for;
        let looks_beside = outside > 0.0 && bystander > 0.5 && bystander > official;
        let beside = outside > FAR_M || (outside > NEAR_M && kits.team(i).is_some()) || looks_beside;
        let doubtful = seen_share(track) < SEEN_SHARE && *sure < SURENESS_SHARE * median;
        !beside && !doubtful
    });
    kept
}

/// How far outside the lines somebody always is, metres; negative inside.
fn outside_m(candidate: &Candidate, pitch: &Pitch) -> f64 {
    let mut outside: Vec<f64> = candidate
        .places
        .iter()
        .map(|(_, place)| (place.y.abs() - pitch.width_m / 2.0).max(place.x.abs() - pitch.length_m / 2.0))
        .collect();
    outside.sort_by(f64::total_cmp);
    outside.get((STRAY * outside.len() as f64) as usize).copied().unwrap_or(0.0)
}

/// Mean confidence of a track's sightings.
fn sureness(track: &Track, people: &[Vec<Person>]) -> f64 {
    let seen = track.sightings.iter().filter_map(|s| people.get(s.frame)?.get(s.person_index));
    seen.map(|person| f64::from(person.score)).sum::<f64>() / track.sightings.len().max(1) as f64
}

/// Share of a track's frames with a sighting.
fn seen_share(track: &Track) -> f64 {
    let frames = track
        .sightings
        .first()
        .zip(track.sightings.last())
        .map_or(1, |(first, last)| last.frame + 1 - first.frame);
    track.sightings.len() as f64 / frames as f64
}
