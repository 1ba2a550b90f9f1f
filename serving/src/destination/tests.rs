//! Destinations without a network: folders and memory. `tests/object_storage.rs` has a real server.

use super::*;

fn everywhere() -> (tempfile::TempDir, [Destination; 2]) {
    let folder = tempfile::tempdir().unwrap();
    let stream = folder.path().join("new/stream");
    let destinations = [stream.to_str().unwrap(), "memory:"].map(|text| Destination::parse(text).unwrap());
    (folder, destinations)
}

#[test]
fn files_are_written_listed_read_and_removed() {
    let (_folder, destinations) = everywhere();
    for place in destinations {
        assert_eq!(place.list().unwrap(), Vec::<String>::new(), "{place}");
        place.put("high/00001.glb", b"one", FileKind::Geometry).unwrap();
        place.put("high/00000.glb", b"nought", FileKind::Geometry).unwrap();
        place.put("high/00000.glb", b"zero", FileKind::Geometry).unwrap();
        place.put(FILE_NAME, b"{}", FileKind::Manifest).unwrap();
        assert_eq!(place.list().unwrap(), ["high/00000.glb", "high/00001.glb", FILE_NAME], "{place}");
        assert_eq!(place.read("high/00000.glb").unwrap(), b"zero");
        place.delete("high/00000.glb").unwrap();
        place.delete("high/00000.glb").unwrap();
        let error = place.read("high/00000.glb").unwrap_err().to_string();
        assert!(error.contains("high/00000.glb") && error.contains("check"), "{error}");
    }
}

#[test]
fn stale_files_go_and_others_stay() {
    let (_folder, destinations) = everywhere();
    for place in destinations {
        for path in ["high/00000.glb", "low/00000.glb", "notes/mine.glb"] {
            place.put(path, b"old", FileKind::Geometry).unwrap();
        }
        place.put(FILE_NAME, b"{}", FileKind::Manifest).unwrap();
        let removed = place.remove_stale(|path| path == FILE_NAME || path.ends_with("00000.glb")).unwrap();
        assert_eq!(removed, 3, "{place}");
        assert_eq!(place.list().unwrap(), ["notes/mine.glb"], "{place}");
    }
}

#[test]
fn paths_that_lead_out_are_refused() {
    let (folder, destinations) = everywhere();
    for place in destinations {
        for path in ["", "/etc/passwd", "../x", "a/../../x", "a//b", ".hidden", "a\\b", "C:x", "a\0b", "a/"] {
            let error = place.put(path, b"", FileKind::Geometry).unwrap_err();
            assert!(matches!(error, DestinationError::Path { .. }), "{path}: {error}");
            assert!(matches!(place.delete(path), Err(DestinationError::Path { .. })), "{path}");
        }
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_manifest_is_refused_while_a_file_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let place = Destination::parse(folder.path().to_str().unwrap()).unwrap();
    // A file where a folder should be.
    std::fs::write(folder.path().join("high"), b"").unwrap();
    let error = place.put("high/00000.glb", b"zero", FileKind::Geometry).unwrap_err().to_string();
    assert!(error.contains("high/00000.glb") && error.contains("move it away"), "{error}");
    let error = place.put(FILE_NAME, b"{}", FileKind::Manifest).unwrap_err();
    assert!(
        matches!(&error, DestinationError::Incomplete { missing, .. } if missing == "high/00000.glb"),
        "{error}"
    );
    assert!(!folder.path().join(FILE_NAME).exists());

    std::fs::remove_file(folder.path().join("high")).unwrap();
    place.put("high/00000.glb", b"zero", FileKind::Geometry).unwrap();
    place.put(FILE_NAME, b"{}", FileKind::Manifest).unwrap();
}

#[cfg(unix)]
#[test]
fn files_in_a_folder_are_for_everybody_to_read_and_leave_no_parts() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let place = Destination::parse(folder.path().to_str().unwrap()).unwrap();
    place.put(FILE_NAME, b"{}", FileKind::Manifest).unwrap();
    let mode = std::fs::metadata(folder.path().join(FILE_NAME)).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o644);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn what_is_no_place_is_refused_in_words() {
    for text in
        ["", "ftp://host/a", "s3://", "s3:///a", "s3://bucket/../a", "gs://bucket/a//b", "s3://bucket/.a"]
    {
        let error = Destination::with_settings(text, []).unwrap_err();
        assert!(matches!(error, DestinationError::Address { .. }), "{text}: {error}");
        assert!(error.to_string().contains("s3://BUCKET/PREFIX"), "{error}");
    }
}
