//! A stream in a folder.

use std::{
    fs,
    io::{self, ErrorKind, Write},
    path::{Path, PathBuf},
};

use super::DestinationError;

/// How deep a stream's folders go at most.
const DEEPEST: usize = 8;

#[derive(Debug)]
pub(super) struct Folder {
    root: PathBuf,
}

impl Folder {
    pub(super) fn new(root: PathBuf) -> Self {
        Self { root }
    }

    pub(super) fn name(&self, path: &str) -> String {
        self.at(path).display().to_string()
    }

    fn at(&self, path: &str) -> PathBuf {
        if path.is_empty() { self.root.clone() } else { self.root.join(path) }
    }

    /// Beside its place and then renamed, so that a reader never sees a part.
    pub(super) fn put(&self, path: &str, bytes: &[u8]) -> Result<(), DestinationError> {
        let path = self.at(path);
        let folder = path.parent().unwrap_or(&self.root);
        let attempt = || -> io::Result<()> {
            fs::create_dir_all(folder)?;
            let mut file = tempfile::Builder::new().prefix(".part-").tempfile_in(folder)?;
            file.write_all(bytes)?;
            file.as_file().sync_data()?;
            #[cfg(unix)]
            {
                // Temporary files are private; a stream is for a web server to read.
                use std::os::unix::fs::PermissionsExt;
                file.as_file().set_permissions(fs::Permissions::from_mode(0o644))?;
            }
            file.persist(&path).map_err(|error| error.error)?;
            Ok(())
        };
        attempt().map_err(DestinationError::file("write", &path))
    }

    pub(super) fn delete(&self, path: &str) -> Result<(), DestinationError> {
        let path = self.at(path);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(DestinationError::file("remove", path)(error))
            }
            _ => Ok(()),
        }
    }

    pub(super) fn read(&self, path: &str) -> Result<Vec<u8>, DestinationError> {
        let path = self.at(path);
        fs::read(&path).map_err(DestinationError::file("read", path))
    }

    pub(super) fn list(&self) -> Result<Vec<String>, DestinationError> {
        let mut paths = Vec::new();
        match fs::symlink_metadata(&self.root) {
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            _ => walk(&self.root, "", DEEPEST, &mut paths)?,
        }
        Ok(paths)
    }
}

/// Adds the files of `folder`. Links are not followed: what is behind them is not the stream's to remove.
fn walk(folder: &Path, prefix: &str, depth: usize, paths: &mut Vec<String>) -> Result<(), DestinationError> {
    let wrong = |error| DestinationError::file("list", folder)(error);
    for entry in fs::read_dir(folder).map_err(wrong)? {
        let entry = entry.map_err(wrong)?;
        // A name that is not Unicode is none that we wrote.
        let Ok(name) = entry.file_name().into_string() else { continue };
        let path = format!("{prefix}{name}");
        let kind = entry.file_type().map_err(wrong)?;
        if kind.is_file() {
            paths.push(path);
        } else if kind.is_dir() && depth > 0 && !name.starts_with('.') {
            walk(&entry.path(), &format!("{path}/"), depth - 1, paths)?;
        }
    }
    Ok(())
}
