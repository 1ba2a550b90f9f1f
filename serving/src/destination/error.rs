//! What can go wrong when a stream is written, and what to do about it.

use std::{
    error::Error,
    io::{self, ErrorKind},
    path::PathBuf,
};

/// Why a stream cannot be written somewhere.
#[derive(Debug, thiserror::Error)]
pub enum DestinationError {
    /// The text names no place.
    #[error(
        "`{text}` is no place for a stream: {reason}; give a folder, s3://BUCKET/PREFIX, gs://BUCKET/PREFIX or az://CONTAINER/PREFIX"
    )]
    Address {
        /// What was given.
        text: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A path that would lead out of the place, or to a hidden file.
    #[error("`{path}` is no path in a stream: give a relative one of plain names with / between them")]
    Path {
        /// What was given, control characters made visible.
        path: String,
    },
    /// The folder or a file in it cannot be used.
    #[error("cannot {action} {}: {source}; {}", path.display(), file_advice(source.kind()))]
    File {
        /// What was tried: `write`, `read`, `list`, `remove`.
        action: &'static str,
        /// Which file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Object storage refused, or could not be reached until retries ran out.
    #[error("cannot {action} {object}: {}; {}", summary(source), object_advice(source))]
    Object {
        /// What was tried: `write`, `read`, `list`, `remove`.
        action: &'static str,
        /// URL of the object or of the prefix.
        object: String,
        /// What the storage said.
        source: object_store::Error,
    },
    /// The manifest of a stream with a missing file.
    #[error("{manifest} is not written, because {missing} could not be: write that again first")]
    Incomplete {
        /// The manifest.
        manifest: String,
        /// One file that could not be written.
        missing: String,
    },
    /// No runtime for uploads.
    #[error("cannot start uploads: {0}; close other programs and run the command again")]
    Start(io::Error),
}

impl DestinationError {
    pub(super) fn file(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::File { action, path, source }
    }
}

fn file_advice(kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "free some space there and run the command again: finished stages are kept in the work folder"
        }
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "choose a folder that you may write to, or change its permissions"
        }
        ErrorKind::NotFound => "check the path",
        ErrorKind::NotADirectory | ErrorKind::IsADirectory | ErrorKind::AlreadyExists => {
            "something else has that name: move it away or choose another folder"
        }
        _ => "check the disk and run the command again",
    }
}

fn object_advice(error: &object_store::Error) -> &'static str {
    use object_store::Error;
    const NAME: &str = "check the name of the bucket and that the object is there";
    const CREDENTIALS: &str = "check the credentials (AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, GOOGLE_… or AZURE_…) and what they are allowed there";
    match error {
        Error::NotFound { .. } => NAME,
        Error::PermissionDenied { .. } | Error::Unauthenticated { .. } => CREDENTIALS,
        // Where the library does not tell them apart, as when listing, the storage's own words do.
        other => {
            let words = other.to_string();
            let says = |codes: &[&str]| codes.iter().any(|code| words.contains(code));
            if says(&["NoSuchBucket", "ContainerNotFound", "404 Not Found"]) {
                NAME
            } else if says(&["AccessDenied", "InvalidAccessKeyId", "SignatureDoesNotMatch", "403 Forbidden"])
            {
                CREDENTIALS
            } else {
                "check the endpoint (AWS_ENDPOINT, …), the credentials and the network, and run the command again: finished stages are kept in the work folder"
            }
        }
    }
}

/// The innermost reasons in one bounded line: storage answers with pages of XML, which come from outside.
pub(super) fn summary(error: &object_store::Error) -> String {
    const LONGEST: usize = 400;
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let inner_text = inner.to_string();
        if !text.contains(&inner_text) {
            text.push_str(": ");
            text.push_str(&inner_text);
        }
        cause = inner.source();
    }
    let mut line: String =
        text.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).take(LONGEST).collect();
    if text.chars().nth(LONGEST).is_some() {
        line.push('…');
    }
    line
}
