//! Where a stream is written: a folder, or object storage of the S3, Google or Azure kind.
//!
//! Reconstruction is synchronous, so this is too; uploads run on a small runtime inside. Not for use from async code.
//!
//! A viewer that finds a manifest must find every file in it. So the manifest goes last: [`Destination::put`] returns once the
//! file is stored, a manifest waits for the files being stored by other threads, and it is refused as long as a file has failed.

mod error;
mod folder;
mod objects;

use std::{
    collections::BTreeSet,
    fmt,
    path::PathBuf,
    sync::{Mutex, PoisonError, RwLock},
};

use protocol::manifest::FILE_NAME;

pub use error::DestinationError;

use folder::Folder;
use objects::Objects;

/// What a file is: it decides how it is labelled in object storage and when it may be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// A manifest: makes the files before it a stream.
    Manifest,
    /// A chunk or the static scene, glTF binary.
    Geometry,
}

impl FileKind {
    /// Media type of the file.
    #[must_use]
    pub fn content_type(self) -> &'static str {
        match self {
            FileKind::Manifest => "application/json",
            FileKind::Geometry => "model/gltf-binary",
        }
    }

    /// What caches may do: keep it, but ask whether it is still the same, since a rebuilt stream has the same names.
    #[must_use]
    pub fn cache_control(self) -> &'static str {
        "no-cache"
    }
}

/// A place for one stream.
#[derive(Debug)]
pub struct Destination {
    place: Place,
    /// Files hold it shared while they are stored, a manifest alone.
    order: RwLock<()>,
    /// Files that could not be stored and have not been since.
    missing: Mutex<BTreeSet<String>>,
}

#[derive(Debug)]
enum Place {
    Folder(Folder),
    Objects(Objects),
}

impl Destination {
    /// Reads a place as a person writes it: a folder, `s3://BUCKET/PREFIX`, `gs://BUCKET/PREFIX`, `az://CONTAINER/PREFIX`, or
    /// `memory:` for tests. Credentials, endpoint and region come from the usual environment variables: `AWS_ACCESS_KEY_ID`,
    /// `AWS_SECRET_ACCESS_KEY`, `AWS_REGION`, `AWS_ENDPOINT`, `AWS_ALLOW_HTTP`, …; `GOOGLE_…`; `AZURE_…`.
    ///
    /// # Errors
    /// When `text` is none of these or the variables make no sense. Nothing is contacted or created yet.
    pub fn parse(text: &str) -> Result<Self, DestinationError> {
        let variables = std::env::vars_os()
            .filter_map(|(key, value)| Some((key.into_string().ok()?, value.into_string().ok()?)));
        Self::with_settings(text, variables)
    }

    /// Like [`Destination::parse`], with these variables instead of the environment's.
    ///
    /// # Errors
    /// As [`Destination::parse`].
    pub fn with_settings(
        text: &str,
        settings: impl IntoIterator<Item = (String, String)>,
    ) -> Result<Self, DestinationError> {
        let place = match Objects::parse(text, settings)? {
            Some(objects) => Place::Objects(objects),
            None if text.is_empty() => {
                return Err(DestinationError::Address {
                    text: text.to_owned(),
                    reason: "it is empty".to_owned(),
                });
            }
            None => Place::Folder(Folder::new(PathBuf::from(text))),
        };
        Ok(Self { place, order: RwLock::default(), missing: Mutex::default() })
    }

    /// Stores a file whole: readers see the old one, the new one or none, never a part. Returns once it is there.
    ///
    /// # Errors
    /// When `path` is not a plain relative path, when the file cannot be stored (after retries, for object storage), and for a
    /// manifest while another file is missing.
    pub fn put(&self, path: &str, bytes: &[u8], kind: FileKind) -> Result<(), DestinationError> {
        check(path)?;
        match kind {
            FileKind::Geometry => {
                let _shared = self.order.read().unwrap_or_else(PoisonError::into_inner);
                let stored = self.store(path, bytes, kind);
                match &stored {
                    Ok(()) => self.missing().remove(path),
                    Err(_) => self.missing().insert(path.to_owned()),
                };
                stored
            }
            FileKind::Manifest => {
                let _alone = self.order.write().unwrap_or_else(PoisonError::into_inner);
                if let Some(missing) = self.missing().first().cloned() {
                    return Err(DestinationError::Incomplete { manifest: self.name(path), missing });
                }
                self.store(path, bytes, kind)
            }
        }
    }

    /// Removes a file; one that is not there is fine.
    ///
    /// # Errors
    /// When `path` is not a plain relative path or the file cannot be removed.
    pub fn delete(&self, path: &str) -> Result<(), DestinationError> {
        check(path)?;
        self.missing().remove(path);
        match &self.place {
            Place::Folder(folder) => folder.delete(path),
            Place::Objects(objects) => objects.delete(path),
        }
    }

    /// The paths of all files there, sorted; none when nothing was written yet. Hidden files are left out.
    ///
    /// # Errors
    /// When the place cannot be listed.
    pub fn list(&self) -> Result<Vec<String>, DestinationError> {
        let mut paths = match &self.place {
            Place::Folder(folder) => folder.list()?,
            Place::Objects(objects) => objects.list()?,
        };
        paths.retain(|path| crate::paths::is_plain(path));
        paths.sort();
        Ok(paths)
    }

    /// Reads a file back, for checks.
    ///
    /// # Errors
    /// When there is no such file or it cannot be read.
    pub fn read(&self, path: &str) -> Result<Vec<u8>, DestinationError> {
        check(path)?;
        match &self.place {
            Place::Folder(folder) => folder.read(path),
            Place::Objects(objects) => objects.read(path),
        }
    }

    /// Removes what an older stream left: every file for which `is_stale` holds, the manifest before all others, so that no
    /// reader sees a manifest without its files. Returns how many there were.
    ///
    /// # Errors
    /// When the place cannot be listed or a file cannot be removed.
    pub fn remove_stale(&self, is_stale: impl Fn(&str) -> bool) -> Result<usize, DestinationError> {
        let mut stale = self.list()?;
        stale.retain(|path| is_stale(path));
        stale.sort_by_key(|path| path != FILE_NAME);
        for path in &stale {
            self.delete(path)?;
        }
        Ok(stale.len())
    }

    /// What `path` is called outside: a file name or a URL.
    #[must_use]
    pub fn name(&self, path: &str) -> String {
        match &self.place {
            Place::Folder(folder) => folder.name(path),
            Place::Objects(objects) => objects.name(path),
        }
    }

    fn store(&self, path: &str, bytes: &[u8], kind: FileKind) -> Result<(), DestinationError> {
        match &self.place {
            Place::Folder(folder) => folder.put(path, bytes),
            Place::Objects(objects) => objects.put(path, bytes, kind),
        }
    }

    fn missing(&self) -> std::sync::MutexGuard<'_, BTreeSet<String>> {
        self.missing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Display for Destination {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.name(""))
    }
}

fn check(path: &str) -> Result<(), DestinationError> {
    if crate::paths::is_plain(path) {
        Ok(())
    } else {
        Err(DestinationError::Path { path: path.escape_debug().to_string() })
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
