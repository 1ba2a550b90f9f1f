//! Section 4.2, last paragraph: who is who over time.

use protocol::manifest::PersonId;
use serde::{Deserialize, Serialize};

/// One person over the clip.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Track {
    /// Identity in the stream.
    pub person: PersonId,
    /// Where it was seen, in order of time.
    pub sightings: Vec<Sighting>,
}

/// A link from a track to a person of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sighting {
    /// Index in `ClipInfo::frames`.
    pub frame: usize,
    /// Index in that frame's people.
    pub person_index: usize,
}
