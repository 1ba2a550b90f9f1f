//! Which files of the folder a request may have, and what is told about them.

use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
    time::{SystemTime, UNIX_EPOCH},
};

use cap_std::{ambient_authority, fs::Dir};
use percent_encoding::percent_decode_str;

/// A file that may be served, open, with what was true of it when it was opened. As writers replace files and never
/// change them, it stays true whatever becomes of the name.
#[derive(Debug)]
pub(super) struct Served {
    pub(super) file: std::fs::File,
    pub(super) length: u64,
    pub(super) modified: SystemTime,
    /// Strong: another length, time (to the nanosecond) or inode is another file. Without quotes.
    pub(super) tag: String,
    pub(super) content_type: &'static str,
}

/// Why a file is not served.
#[derive(Debug)]
pub(super) enum Refusal {
    /// There is none, or none that is anybody's business.
    NotFound,
    /// There is, but the system does not give it out now; the error is for the server's own log.
    Unavailable(std::io::Error),
}

/// The path below the folder that a URL's path means, when it can mean one at all.
pub(super) fn relative(url_path: &str) -> Option<PathBuf> {
    let decoded = percent_decode_str(url_path.strip_prefix('/')?).decode_utf8().ok()?;
    crate::paths::is_plain(&decoded).then(|| PathBuf::from(decoded.as_ref()))
}

/// Opens the file at `path` in `folder`. Links are followed only as long as they stay inside; the system checks that while
/// it walks the path, so no change of the folder in between can undo it.
pub(super) fn open(folder: &Path, path: &Path) -> Result<Served, Refusal> {
    // Opened anew each time: a stream rebuilt in a new folder of the same name is found.
    let folder = Dir::open_ambient_dir(folder, ambient_authority()).map_err(refusal)?;
    // Opening a pipe would wait for a writer.
    if !folder.metadata(path).map_err(refusal)?.is_file() {
        return Err(Refusal::NotFound);
    }
    let file = folder.open(path).map_err(refusal)?.into_std();
    let metadata = file.metadata().map_err(refusal)?;
    if !metadata.is_file() {
        return Err(Refusal::NotFound);
    }
    let modified = metadata.modified().map_err(refusal)?;
    Ok(Served {
        length: metadata.len(),
        modified,
        tag: tag(&metadata, modified),
        content_type: kind(path),
        file,
    })
}

fn tag(metadata: &std::fs::Metadata, modified: SystemTime) -> String {
    let nanoseconds = modified.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
    #[cfg(unix)]
    let inode = std::os::unix::fs::MetadataExt::ino(metadata);
    #[cfg(not(unix))]
    let inode = 0;
    format!("{:x}-{nanoseconds:x}-{inode:x}", metadata.len())
}

fn refusal(error: std::io::Error) -> Refusal {
    match error.kind() {
        ErrorKind::NotFound
        | ErrorKind::PermissionDenied
        | ErrorKind::NotADirectory
        | ErrorKind::IsADirectory
        | ErrorKind::InvalidInput
        | ErrorKind::InvalidFilename => Refusal::NotFound,
        // A circle of links has no stable kind, and must not look like trouble of the server's own.
        _ if error.to_string().contains("symbolic links") => Refusal::NotFound,
        _ => Refusal::Unavailable(error),
    }
}

/// What browsers must be told of a file. Besides a stream's own files, those of a player beside it.
fn kind(path: &Path) -> &'static str {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    match extension.to_ascii_lowercase().as_str() {
        "json" => JSON,
        "glb" => "model/gltf-binary",
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "wasm" => "application/wasm",
        "png" => "image/png",
        "jpg" | "jpeg" => "image/jpeg",
        _ => "application/octet-stream",
    }
}

/// The one type that is worth compressing: geometry and pictures are compressed already.
pub(super) const JSON: &str = "application/json";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_paths_are_read() {
        for (url, path) in [
            ("/match.json", "match.json"),
            ("/high/00000.glb", "high/00000.glb"),
            ("/%6datch.json", "match.json"),
            ("/caf%C3%A9/a%20b.glb", "café/a b.glb"),
            ("/100%", "100%"),
        ] {
            assert_eq!(relative(url), Some(PathBuf::from(path)), "{url}");
        }
    }

    #[test]
    fn ways_out_and_hidden_files_are_not() {
        for url in [
            "",
            "*",
            "match.json",
            "/",
            "//",
            "/high/",
            "//etc/passwd",
            "/../secret",
            "/high/../../secret",
            "/./match.json",
            "/%2e%2e/secret",
            "/%2e%2e%2fsecret",
            "/high%2f..%2f..%2fsecret",
            "/..%5csecret",
            "/C:/secret",
            "/a\\b",
            "/match.json%00.glb",
            "/.part-123",
            "/.git/config",
            "/high/.part-1",
            "/%ff%fe",
            "/a%0d%0ab",
            "/a%7f",
            "/%2fetc/passwd",
        ] {
            assert_eq!(relative(url), None, "{url}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_inside_and_only_files_are_opened() {
        use std::os::unix::fs::symlink;
        let outside = tempfile::tempdir().unwrap();
        std::fs::write(outside.path().join("secret"), b"no").unwrap();
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("a.glb"), b"yes").unwrap();
        std::fs::create_dir(at("high")).unwrap();
        symlink("a.glb", at("inside.glb")).unwrap();
        symlink("../a.glb", at("high/up.glb")).unwrap();
        symlink(outside.path().join("secret"), at("absolute")).unwrap();
        symlink(outside.path(), at("folder")).unwrap();
        symlink("circle", at("circle")).unwrap();
        let pipe = std::process::Command::new("mkfifo").arg(at("pipe")).status().unwrap();
        assert!(pipe.success());

        for name in ["a.glb", "inside.glb", "high/up.glb"] {
            assert_eq!(open(folder.path(), Path::new(name)).unwrap().length, 3, "{name}");
        }
        for name in
            ["absolute", "folder/secret", "circle", "pipe", "high", "a.glb/b", "none", &"x".repeat(5000)]
        {
            let refused = open(folder.path(), Path::new(name));
            assert!(matches!(refused, Err(Refusal::NotFound)), "{name}: {refused:?}");
        }
    }

    #[test]
    fn a_replaced_file_has_another_tag() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        let mut tags = std::collections::BTreeSet::new();
        for content in [b"one", b"two", b"six"] {
            let mut new = tempfile::NamedTempFile::new_in(folder.path()).unwrap();
            std::io::Write::write_all(&mut new, content).unwrap();
            new.persist(&path).unwrap();
            tags.insert(open(folder.path(), Path::new("a.glb")).unwrap().tag);
        }
        assert_eq!(tags.len(), 3, "{tags:?}");
    }
}
