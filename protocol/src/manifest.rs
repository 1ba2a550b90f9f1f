//! `match.json`: what a stream holds and where.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    pitch::Pitch,
    time::{Ticks, Timescale},
};

/// Identity of a person within one stream.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(transparent)]
pub struct PersonId(pub u32);

/// The manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Manifest {
    /// Always `"holopitch"`.
    pub format: String,
    /// `major.minor`; readers refuse a major version they do not know.
    pub version: String,
    /// Ticks per second of every time in the stream.
    pub timescale: Timescale,
    /// How long the match is.
    pub duration: Ticks,
    /// The size of the pitch.
    pub pitch: Pitch,
    /// The things that never move (pitch, goals), once.
    pub static_scene: Option<FileEntry>,
    /// Everybody who appears.
    pub people: Vec<Person>,
    /// The quality ladder, best last.
    pub representations: Vec<Representation>,
}

/// A file of the stream.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FileEntry {
    /// Path relative to the manifest.
    pub path: String,
    /// Length of the file.
    pub bytes: u64,
    /// BLAKE3 of the file, 64 hexadecimal digits.
    pub blake3: String,
}

/// Somebody on the pitch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Person {
    /// Used by the chunks.
    pub id: PersonId,
    /// Team, when known.
    pub team: Option<String>,
    /// Role, when known: `player`, `goalkeeper`, `referee`, `assistant`.
    pub role: Option<String>,
    /// Shirt number, when it was read.
    pub number: Option<u8>,
    /// Main colour of the shirt, sRGB.
    pub shirt_rgb: Option<[u8; 3]>,
}

/// One quality of the whole match.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Representation {
    /// Name, also the folder of its chunks.
    pub id: String,
    /// Triangles that a body has at most.
    pub triangles_per_body: u32,
    /// Chunks in order of time.
    pub chunks: Vec<ChunkEntry>,
}

/// Where a chunk is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChunkEntry {
    /// The file.
    #[serde(flatten)]
    pub file: FileEntry,
    /// When its first frame is shown.
    pub start: Ticks,
    /// How long it lasts.
    pub duration: Ticks,
}
