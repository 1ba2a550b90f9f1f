//! What can be wrong with a scan on disk; every message names the file, the place in it and what to do.

use thiserror::Error;

/// Why a scan cannot be read.
#[derive(Debug, Error)]
pub enum ScanError {
    /// The file could not be read.
    #[error("{file}: cannot be read ({problem}): check the name and the rights")]
    Read {
        /// The file.
        file: String,
        /// What the system says.
        problem: std::io::Error,
    },
    /// The file is larger than the reader takes.
    #[error("{file}: {bytes} bytes are more than the {limit} that are read: thin the scan out first")]
    TooLarge {
        /// The file.
        file: String,
        /// Its size.
        bytes: u64,
        /// The most that is read.
        limit: u64,
    },
    /// The content breaks the rules of its format.
    #[error("{file}: {place}: {problem}")]
    Broken {
        /// The file.
        file: String,
        /// Line, byte or field where it breaks.
        place: String,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// Not a format that is read here.
    #[error("{file}: {what} is not read here: {advice}")]
    Unsupported {
        /// The file.
        file: String,
        /// What it is.
        what: String,
        /// What is read instead.
        advice: &'static str,
    },
}

/// What is wrong at a place inside a file; the file's name is added at the edge.
#[derive(Debug)]
pub(super) struct Problem {
    place: String,
    problem: String,
}

impl Problem {
    pub(super) fn at(place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { place: place.into(), problem: problem.into() }
    }

    pub(super) fn within(self, file: &str) -> ScanError {
        ScanError::Broken { file: file.into(), place: self.place, problem: self.problem }
    }
}
