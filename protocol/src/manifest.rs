//! `match.json`: what a stream holds and where.
//!
//! Reading checks everything that a reader relies on later: counts, paths that stay inside the stream, order of time.

mod check;
#[cfg(test)]
mod tests;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    limits::Limits,
    pitch::Pitch,
    time::{Ticks, Timescale},
};

/// The value of [`Manifest::format`].
pub const FORMAT: &str = "holopitch";
/// The format version that this crate writes; it reads every version with the same major number.
pub const VERSION: &str = "1.0";
/// Name of the manifest's file.
pub const FILE_NAME: &str = "match.json";
/// Major version this crate reads.
const MAJOR: u32 = 1;

/// Why a manifest cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ManifestError {
    /// Not JSON, or a field is missing or of the wrong type.
    #[error("match.json is not a Holopitch manifest: {message}")]
    Json {
        /// What the parser said, with line and column.
        message: String,
    },
    /// Some other format.
    #[error("match.json says format \"{found}\", expected \"holopitch\"")]
    Format {
        /// What it says.
        found: String,
    },
    /// Written for newer (or broken) readers.
    #[error(
        "match.json has format version {found}, this program reads version {MAJOR}.x: use a newer program"
    )]
    Version {
        /// What it says.
        found: String,
    },
    /// Larger than the reader is willing to spend.
    #[error("match.json has {found} {what}, the limit is {limit}: raise the limit if you trust the stream")]
    Limit {
        /// What there is too much of.
        what: &'static str,
        /// How much there is.
        found: u64,
        /// How much is allowed.
        limit: u64,
    },
    /// A path that could leave the stream's folder, or means different things to files and to URLs.
    #[error("match.json names the path {path:?}, which {problem}")]
    Path {
        /// The path.
        path: String,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A value that makes no sense.
    #[error("match.json: {field} {problem}")]
    Value {
        /// Where.
        field: String,
        /// What is wrong with it.
        problem: &'static str,
    },
}

/// Identity of a person within one stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
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
    /// The shots of the broadcast and the gaps between them, in order of time; empty when nothing is known of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub segments: Vec<Segment>,
    /// Present while the stream is still being written: this file will be replaced by one with more chunks. Absent in a
    /// stream that is complete.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub live: Option<Live>,
    /// The quality ladder, best last. All have chunks at the same times; while the stream is live some may have fewer.
    pub representations: Vec<Representation>,
}

impl Manifest {
    /// Reads and checks a manifest.
    ///
    /// # Errors
    /// When it is too large, not JSON, of another format or major version, or says something impossible.
    pub fn from_json(bytes: &[u8], limits: &Limits) -> Result<Self, ManifestError> {
        if bytes.len() > limits.manifest_bytes {
            let (found, limit) = (bytes.len() as u64, limits.manifest_bytes as u64);
            return Err(ManifestError::Limit { what: "bytes", found, limit });
        }
        let json = |error: serde_json::Error| ManifestError::Json { message: error.to_string() };
        // A newer major version may differ in anything but these two fields.
        let head: Head = serde_json::from_slice(bytes).map_err(json)?;
        head.check()?;
        let manifest: Self = serde_json::from_slice(bytes).map_err(json)?;
        manifest.validate(limits)?;
        Ok(manifest)
    }

    /// The manifest as readable JSON.
    ///
    /// # Errors
    /// When a number has no form in JSON.
    pub fn to_json(&self) -> Result<String, ManifestError> {
        let json = serde_json::to_string_pretty(self);
        json.map(|text| text + "\n").map_err(|error| ManifestError::Json { message: error.to_string() })
    }

    /// Checks what types cannot say; see [`ManifestError`].
    ///
    /// # Errors
    /// The first thing found wrong.
    pub fn validate(&self, limits: &Limits) -> Result<(), ManifestError> {
        Head { format: self.format.clone(), version: self.version.clone() }.check()?;
        check::manifest(self, limits)
    }

    /// The best representation of a profile that this reader knows.
    #[must_use]
    pub fn best(&self) -> Option<&Representation> {
        self.representations.iter().rfind(|representation| representation.profile != Profile::Other)
    }
}

impl Representation {
    /// Index of the chunk shown at `moment`: the last one that has started, or the first.
    #[must_use]
    pub fn chunk_at(&self, moment: Ticks) -> Option<usize> {
        if self.chunks.is_empty() {
            return None;
        }
        Some(self.chunks.partition_point(|chunk| chunk.start <= moment).saturating_sub(1))
    }
}

/// The two fields that every version has.
#[derive(Deserialize)]
struct Head {
    format: String,
    version: String,
}

impl Head {
    fn check(&self) -> Result<(), ManifestError> {
        if self.format != FORMAT {
            return Err(ManifestError::Format { found: self.format.clone() });
        }
        let major = self.version.split_once('.').and_then(|(major, minor)| {
            minor.parse::<u32>().ok()?;
            major.parse::<u32>().ok()
        });
        if major != Some(MAJOR) {
            return Err(ManifestError::Version { found: self.version.clone() });
        }
        Ok(())
    }
}

/// A file of the stream.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FileEntry {
    /// Path relative to the manifest: letters, digits, `.`, `_`, `-`, with `/` between folders; never `..`.
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
    /// Team, when known: `a` or `b` where it was found by the kits (nobody knows which one plays at home), `home` or `away` where it was given.
    pub team: Option<String>,
    /// How likely the team is right, 0..1, when it was estimated.
    pub team_confidence: Option<f32>,
    /// Role, when known: `player`, `goalkeeper`, `referee`, `assistant`.
    pub role: Option<String>,
    /// How likely the role is right, 0..1, when it was estimated.
    pub role_confidence: Option<f32>,
    /// Shirt number, when it was read.
    pub number: Option<u8>,
    /// How likely the number is right, 0..1, when it was read from the picture.
    pub number_confidence: Option<f32>,
    /// Main colour of the shirt, sRGB.
    pub shirt_rgb: Option<[u8; 3]>,
}

/// A stretch of the match that one camera showed, or that no camera showed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Segment {
    /// When it begins.
    pub start: Ticks,
    /// How long it lasts.
    pub duration: Ticks,
    /// What it is.
    pub kind: SegmentKind,
}

/// What a segment is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SegmentKind {
    /// One shot of a camera that saw the pitch. People may have other identities than in other shots: those of whom it is not sure who they are.
    Shot,
    /// The broadcast showed something else: a close-up, a replay, a dissolve. There are no frames.
    Gap,
    /// Of a kind that this reader does not know.
    #[serde(other)]
    Other,
}

/// What a reader needs to follow a stream that is still being written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Live {
    /// How long to wait before the manifest is read again; about the length of a chunk.
    pub update_after: Ticks,
}

/// One quality of the whole match.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Representation {
    /// Name, also the folder of its chunks.
    pub id: String,
    /// How its chunks are made.
    #[serde(default)]
    pub profile: Profile,
    /// Triangles that a body has at most.
    pub triangles_per_body: u32,
    /// Chunks in order of time.
    pub chunks: Vec<ChunkEntry>,
}

/// How chunks are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Profile {
    /// A mesh per person and frame, which every glTF viewer plays.
    #[default]
    Plain,
    /// A mesh per person, and how it moves.
    Compact,
    /// Of a kind that this reader does not know.
    #[serde(other)]
    Other,
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
