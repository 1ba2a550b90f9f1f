//! Which names the files of a stream may have, on both ways: written and asked for.

/// Whether `path` is a plain path relative to the stream: no way up or out on any system, no hidden file (a file being
/// written is `.part-…`), nothing that cannot be seen.
pub(crate) fn is_plain(path: &str) -> bool {
    path.split('/').all(|segment| {
        !segment.is_empty()
            && !segment.starts_with('.')
            && !segment.chars().any(|letter| letter.is_control() || matches!(letter, '\\' | ':'))
    })
}
