//! The address of a stream, and how a file of it is fetched.

use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
    time::Duration,
};

use protocol::manifest::FILE_NAME;
use tokio::io::AsyncReadExt;

use super::SourceError;

/// A server that does not answer for this long is taken to be away.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// The longest pause between two pieces of an answer.
const READ_TIMEOUT: Duration = Duration::from_secs(10);

/// Where a stream is: every file of it lies beside or below its manifest.
#[derive(Clone, Debug)]
pub enum Location {
    /// A folder of this machine.
    Folder(PathBuf),
    /// An address that ends in `/`, and the client that keeps its connections.
    Http(reqwest::Url, reqwest::Client),
}

impl Location {
    /// Understands a folder, a path to `match.json`, or an `http://` or `https://` address of either. The certificates of
    /// the system are trusted, or those of the file that `SSL_CERT_FILE` names.
    pub fn parse(text: &str) -> Result<Self, SourceError> {
        let Some((scheme, _)) = text.split_once("://") else {
            let path = Path::new(text);
            let folder = if path.file_name().is_some_and(|name| name == FILE_NAME) {
                path.parent().unwrap_or(Path::new("")).to_owned()
            } else {
                path.to_owned()
            };
            return Ok(Self::Folder(folder));
        };
        let wrong = |reason: String| SourceError::Address { url: text.to_owned(), reason };
        let encrypted = match scheme.to_ascii_lowercase().as_str() {
            "http" => false,
            "https" => true,
            _ => return Err(wrong(format!("unknown scheme {scheme}"))),
        };
        let mut url = reqwest::Url::parse(text).map_err(|error| wrong(error.to_string()))?;
        let path = url.path().trim_end_matches(FILE_NAME).trim_end_matches('/');
        let path = format!("{path}/");
        url.set_path(&path);
        // reqwest is built without cryptography of its own and takes the process's; one that is there already is as good.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let mut client =
            reqwest::Client::builder().connect_timeout(CONNECT_TIMEOUT).read_timeout(READ_TIMEOUT);
        if !encrypted {
            // Otherwise a machine without certificates could not even play over http.
            client = client.tls_certs_only([]);
        }
        let client = client.build().map_err(|error| wrong(innermost(&error).to_string()))?;
        Ok(Self::Http(url, client))
    }

    /// The full name of a file of the stream, for messages.
    #[must_use]
    pub fn name_of(&self, relative: &str) -> String {
        match self {
            Self::Folder(folder) => folder.join(relative).display().to_string(),
            Self::Http(url, _) => format!("{url}{relative}"),
        }
    }

    /// Reads a file of the stream, at most `limit` bytes of it. `relative` was checked by the manifest's reader: it
    /// stays inside the stream.
    pub async fn fetch(&self, relative: &str, limit: usize) -> Result<Vec<u8>, SourceError> {
        let file = self.name_of(relative);
        match self {
            Self::Folder(folder) => read_file(&folder.join(relative), file, limit).await,
            Self::Http(url, client) => {
                let reason = |error: url_parse::Error| error.to_string();
                let url = url
                    .join(relative)
                    .map_err(|error| SourceError::Address { url: file, reason: reason(error) })?;
                download(client, url, limit).await
            }
        }
    }
}

/// `reqwest` shows this type without naming it.
mod url_parse {
    pub(super) type Error = <reqwest::Url as std::str::FromStr>::Err;
}

async fn read_file(path: &Path, file: String, limit: usize) -> Result<Vec<u8>, SourceError> {
    let advice = |problem: &std::io::Error| match problem.kind() {
        ErrorKind::NotFound => "give the folder that holds match.json",
        ErrorKind::PermissionDenied => "check the permissions of the file",
        _ => "check the disk",
    };
    let failed = |problem: std::io::Error| {
        let advice = advice(&problem);
        SourceError::Read { file: file.clone(), problem, advice }
    };
    let opened = tokio::fs::File::open(path).await.map_err(failed)?;
    let mut bytes = Vec::new();
    // One byte more than allowed tells a file that is too large from one that just fits.
    opened.take(limit as u64 + 1).read_to_end(&mut bytes).await.map_err(failed)?;
    if bytes.len() > limit {
        return Err(SourceError::TooLarge { file, limit });
    }
    Ok(bytes)
}

async fn download(client: &reqwest::Client, url: reqwest::Url, limit: usize) -> Result<Vec<u8>, SourceError> {
    let failed = |error: reqwest::Error| SourceError::Unreachable {
        url: url.to_string(),
        reason: innermost(&error).to_string(),
    };
    let mut response = client.get(url.clone()).send().await.map_err(failed)?;
    if !response.status().is_success() {
        return Err(SourceError::Status { url: url.to_string(), status: response.status().as_u16() });
    }
    let too_large = || SourceError::TooLarge { file: url.to_string(), limit };
    if response.content_length().is_some_and(|length| length > limit as u64) {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    while let Some(piece) = response.chunk().await.map_err(failed)? {
        if bytes.len() + piece.len() > limit {
            return Err(too_large());
        }
        bytes.extend_from_slice(&piece);
    }
    Ok(bytes)
}

/// The cause that says most: "connection refused" and not "error sending request".
fn innermost(error: &dyn std::error::Error) -> &dyn std::error::Error {
    let mut cause = error;
    while let Some(next) = cause.source() {
        cause = next;
    }
    cause
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_and_addresses_are_told_apart() {
        for (text, name) in [
            ("match", "match/high/1.glb"),
            ("some/match.json", "some/high/1.glb"),
            ("http://localhost:8080", "http://localhost:8080/high/1.glb"),
            ("http://h/streams/a/match.json", "http://h/streams/a/high/1.glb"),
            ("http://h/streams/a", "http://h/streams/a/high/1.glb"),
        ] {
            assert_eq!(Location::parse(text).unwrap().name_of("high/1.glb"), name, "{text}");
        }
        assert!(matches!(Location::parse("ftp://h/x").unwrap_err(), SourceError::Address { .. }));
    }

    #[tokio::test]
    async fn a_missing_folder_is_named_with_advice() {
        let folder = Location::parse("no-such-folder").unwrap();
        let error = folder.fetch(FILE_NAME, 100).await.unwrap_err().to_string();
        assert!(error.contains("no-such-folder/match.json") && error.contains("give the folder"), "{error}");
    }

    #[tokio::test]
    async fn a_file_beyond_the_limit_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a"), [0; 11]).unwrap();
        let location = Location::Folder(folder.path().to_owned());
        assert!(matches!(location.fetch("a", 10).await, Err(SourceError::TooLarge { limit: 10, .. })));
        assert_eq!(location.fetch("a", 11).await.unwrap().len(), 11);
    }

    #[tokio::test]
    async fn a_server_that_is_away_is_temporary() {
        // Port 9 (discard) of this machine: nobody listens.
        let location = Location::parse("http://127.0.0.1:9/").unwrap();
        let error = location.fetch(FILE_NAME, 100).await.unwrap_err();
        assert!(error.is_temporary() && error.to_string().contains("does not answer"), "{error}");
    }
}
