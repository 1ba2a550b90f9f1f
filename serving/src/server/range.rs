//! The one range of a `Range` header.

use std::ops::Range;

/// What a `Range` header asks of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Asked {
    /// Everything: no range, one in another unit, several, or one that makes no sense, which RFC 9110 lets a server ignore.
    All,
    /// These bytes.
    Part(Range<u64>),
    /// Bytes that the file does not have.
    Nothing,
}

/// Reads `header` for a file of `length` bytes.
pub(super) fn asked(header: &str, length: u64) -> Asked {
    let Some((unit, set)) = header.split_once('=') else { return Asked::All };
    let Some((first, last)) = set.split_once('-') else { return Asked::All };
    if !unit.trim().eq_ignore_ascii_case("bytes") || set.contains(',') {
        return Asked::All;
    }
    match (number(first), number(last)) {
        (Some(first), Some(last)) if first > last => Asked::All,
        (Some(first), _) if first >= length && (last.trim().is_empty() || number(last).is_some()) => {
            Asked::Nothing
        }
        (Some(first), Some(last)) => Asked::Part(first..length.min(last.saturating_add(1))),
        (Some(first), None) if last.trim().is_empty() => Asked::Part(first..length),
        // The last bytes of the file.
        (None, Some(count)) if first.trim().is_empty() => match count.min(length) {
            0 => Asked::Nothing,
            count => Asked::Part(length - count..length),
        },
        _ => Asked::All,
    }
}

/// Digits only: `parse` alone would take a sign. More than fits is as good as the end of any file.
fn number(text: &str) -> Option<u64> {
    let text = text.trim();
    if text.is_empty() || !text.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    Some(text.parse().unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_cut_to_the_file() {
        for (header, part) in [
            ("bytes=0-0", 0..1),
            ("bytes=3-5", 3..6),
            ("Bytes = 3-5 ", 3..6),
            ("bytes=3-", 3..10),
            ("bytes=3-99", 3..10),
            ("bytes=9-99999999999999999999999", 9..10),
            ("bytes=-4", 6..10),
            ("bytes=-400", 0..10),
        ] {
            assert_eq!(asked(header, 10), Asked::Part(part), "{header}");
        }
    }

    #[test]
    fn what_is_not_there_is_nothing() {
        for header in ["bytes=10-", "bytes=10-20", "bytes=-0", "bytes=99999999999999999999999-"] {
            assert_eq!(asked(header, 10), Asked::Nothing, "{header}");
        }
        assert_eq!(asked("bytes=0-", 0), Asked::Nothing);
        assert_eq!(asked("bytes=-1", 0), Asked::Nothing);
    }

    #[test]
    fn what_makes_no_sense_asks_for_everything() {
        for header in [
            "",
            "bytes",
            "bytes=",
            "bytes=-",
            "bytes=a-b",
            "bytes=5-3",
            "bytes=+1-2",
            "bytes=1--2",
            "bytes=0-1,3-4",
            "lines=0-1",
            "bytes=0x1-2",
            "bytes=1-2-3",
            "=0-1",
            "bytes=99-a",
        ] {
            assert_eq!(asked(header, 10), Asked::All, "{header}");
        }
    }
}
