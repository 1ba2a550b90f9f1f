//! The truth beside a rendered clip, read: `truth.json` and the lines of `frames.jsonl` (`docs/datasets.md`). Each measure names the fields
//! that it needs.

use std::{
    fs::File,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
};

use protocol::pitch::Pitch;
use serde::{
    Deserialize,
    de::{DeserializeOwned, IgnoredAny},
};
use thiserror::Error;

/// File name of the lines in a clip's folder.
pub const FILE_NAME: &str = "frames.jsonl";

/// The shot of a frame.
#[derive(Clone, Debug, Deserialize)]
pub struct ShotLine {
    /// Its number.
    pub shot: usize,
    /// The other shot of a dissolve, whatever its share.
    #[serde(default)]
    mixed_with: Option<IgnoredAny>,
}

impl ShotLine {
    /// Whether the frame shows two pictures.
    #[must_use]
    pub fn is_mixed(&self) -> bool {
        self.mixed_with.is_some()
    }
}

/// Who somebody is.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub struct WhoTruth {
    /// As in the tracks and lines.
    pub id: u32,
    /// `home`, `away`; none of officials.
    pub team: Option<String>,
    /// As in the manifest.
    pub role: String,
    /// Shirt number; none of officials.
    #[serde(default)]
    pub number: Option<u8>,
}

/// What holds for the whole clip.
#[derive(Clone, Debug, Deserialize)]
pub struct ClipTruth {
    /// The pitch.
    pub pitch: Pitch,
    /// Everybody.
    pub people: Vec<WhoTruth>,
}

/// Why the truth cannot be read.
#[derive(Debug, Error)]
pub enum TruthError {
    /// A file is missing or cannot be read.
    #[error("{}: {reason}; --data names a folder that `reconstructor synthesize` wrote", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A line is not what `reconstructor synthesize` writes.
    #[error("{}, line {line}: {reason}; write the clip again with `reconstructor synthesize`", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Its line, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
}

impl TruthError {
    pub(super) fn read(path: &Path, reason: impl ToString) -> Self {
        Self::Read { path: path.to_owned(), reason: reason.to_string() }
    }

    pub(super) fn line(path: &Path, line: usize, reason: impl ToString) -> Self {
        Self::Line { path: path.to_owned(), line, reason: reason.to_string() }
    }
}

/// What holds for the whole clip in `folder`.
///
/// # Errors
/// When the file cannot be read or is broken.
pub fn clip(folder: &Path) -> Result<ClipTruth, TruthError> {
    let path = folder.join("truth.json");
    let text = std::fs::read_to_string(&path).map_err(|error| TruthError::read(&path, error))?;
    serde_json::from_str(&text).map_err(|error| TruthError::line(&path, error.line(), error))
}

/// The frames of the clip in `folder`, in order.
///
/// # Errors
/// When the file cannot be read or a line is broken.
pub fn frames<T: DeserializeOwned>(folder: &Path) -> Result<Vec<T>, TruthError> {
    let path = folder.join(FILE_NAME);
    let file = File::open(&path).map_err(|error| TruthError::read(&path, error))?;
    let mut frames = Vec::new();
    for (number, line) in BufReader::new(file).lines().enumerate() {
        let line = line.map_err(|error| TruthError::read(&path, error))?;
        let frame =
            serde_json::from_str(&line).map_err(|error| TruthError::line(&path, number + 1, error))?;
        frames.push(frame);
    }
    Ok(frames)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct Line {
        shot: ShotLine,
    }

    #[test]
    fn the_demo_clip_reads_and_broken_lines_are_named() {
        let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/demo");
        let lines: Vec<Line> = frames(&demo).unwrap();
        assert!(lines.len() > 50 && lines.iter().all(|line| !line.shot.is_mixed()));
        assert!(clip(&demo).unwrap().people.len() > 20);
        let folder = tempfile::tempdir().unwrap();
        let error = || frames::<Line>(folder.path()).unwrap_err().to_string();
        assert!(error().contains("frames.jsonl") && error().contains("--data"), "{}", error());
        assert!(clip(folder.path()).unwrap_err().to_string().contains("truth.json"));
        std::fs::write(folder.path().join(FILE_NAME), "{\"shot\":{\"shot\":0,\"mixed_with\":[1,0.5]}}\nno\n")
            .unwrap();
        assert!(error().contains("line 2"), "{}", error());
        std::fs::write(folder.path().join(FILE_NAME), "{\"shot\":{\"shot\":0,\"mixed_with\":[1,0.5]}}\n")
            .unwrap();
        assert!(frames::<Line>(folder.path()).unwrap()[0].shot.is_mixed());
    }
}
