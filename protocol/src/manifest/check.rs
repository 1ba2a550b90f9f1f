//! What a manifest must satisfy beyond its types.

use std::collections::BTreeSet;

use super::{ChunkEntry, FileEntry, Manifest, ManifestError, Representation};
use crate::{limits::Limits, time::Ticks};

/// Longest path, in bytes.
const PATH_BYTES: usize = 200;
/// Shortest and longest believable side of a pitch, metres; small-sided pitches included.
const PITCH_SIDE_M: std::ops::RangeInclusive<f64> = 5.0..=500.0;

/// Everything, cheapest first.
pub(super) fn manifest(manifest: &Manifest, limits: &Limits) -> Result<(), ManifestError> {
    limit("people", manifest.people.len(), limits.people)?;
    let chunks = manifest.representations.iter().map(|representation| representation.chunks.len());
    limit("chunks", chunks.max().unwrap_or(0), limits.chunks)?;
    limit("representations", manifest.representations.len(), 16)?;
    let scale = manifest.timescale;
    let too_fine = u64::from(scale.numerator) > u64::from(scale.denominator) * 1_000_000_000;
    if scale.numerator == 0 || scale.denominator == 0 || too_fine {
        return Err(value("timescale", "must have 1 to 1,000,000,000 ticks per second"));
    }
    if manifest.duration < Ticks(0) {
        return Err(value("duration", "is negative"));
    }
    for (field, side) in
        [("pitch.length_m", manifest.pitch.length_m), ("pitch.width_m", manifest.pitch.width_m)]
    {
        if !PITCH_SIDE_M.contains(&side) {
            return Err(value(field, "is not the side of a pitch (5 to 500 m)"));
        }
    }
    let mut ids = BTreeSet::new();
    if !manifest.people.iter().all(|person| ids.insert(person.id)) {
        return Err(value("people", "names an id twice"));
    }
    for (index, person) in manifest.people.iter().enumerate() {
        let told = [
            ("team_confidence", person.team_confidence),
            ("role_confidence", person.role_confidence),
            ("number_confidence", person.number_confidence),
        ];
        let outside = |confidence: f32| !(0.0..=1.0).contains(&confidence);
        if let Some((field, _)) = told.into_iter().find(|(_, told)| told.is_some_and(outside)) {
            return Err(value(format!("people[{index}].{field}"), "is not between 0 and 1"));
        }
    }
    limit("segments", manifest.segments.len(), limits.chunks)?;
    let mut earliest = Ticks(0);
    for (index, segment) in manifest.segments.iter().enumerate() {
        // Differences cannot overflow where sums could.
        let room = manifest.duration.0.checked_sub(segment.start.0);
        if segment.start < earliest
            || segment.duration <= Ticks(0)
            || room.is_none_or(|room| segment.duration.0 > room)
        {
            return Err(value(
                format!("segments[{index}]"),
                "overlaps the segment before, goes on after the match's duration or lasts no time",
            ));
        }
        earliest = segment.start + segment.duration;
    }
    if let Some(entry) = &manifest.static_scene {
        file("static_scene", entry, limits)?;
    }
    if manifest.representations.is_empty() {
        return Err(value("representations", "is empty: there is nothing to play"));
    }
    let mut names = BTreeSet::new();
    for item in &manifest.representations {
        if !names.insert(item.id.as_str()) {
            return Err(value("representations", "names an id twice"));
        }
        representation(item, manifest.duration, limits)?;
    }
    if manifest.live.is_some_and(|live| live.update_after <= Ticks(0)) {
        return Err(value("live.update_after", "is not a time to wait"));
    }
    same_times(manifest)
}

/// Playback changes the representation from chunk to chunk: chunk *n* of all of them must be the same part of the match.
fn same_times(manifest: &Manifest) -> Result<(), ManifestError> {
    let Some(longest) = manifest.representations.iter().max_by_key(|item| item.chunks.len()) else {
        return Ok(());
    };
    for item in &manifest.representations {
        let differs = |(a, b): (&ChunkEntry, &ChunkEntry)| (a.start, a.duration) != (b.start, b.duration);
        if let Some(index) = item.chunks.iter().zip(&longest.chunks).position(differs) {
            let field = format!("{}.chunks[{index}]", item.id);
            return Err(value(field, "is at another time than in the other representations"));
        }
        if item.chunks.len() < longest.chunks.len() && manifest.live.is_none() {
            let field = format!("{}.chunks", item.id);
            return Err(value(
                field,
                "are fewer than in another representation: only in a live stream may they",
            ));
        }
    }
    Ok(())
}

fn representation(item: &Representation, duration: Ticks, limits: &Limits) -> Result<(), ManifestError> {
    path(&item.id)?;
    if item.id.contains('/') {
        return Err(ManifestError::Path { path: item.id.clone(), problem: "must be a single folder" });
    }
    limit("triangles per body", item.triangles_per_body as usize, limits.triangles_per_body)?;
    let mut earliest = Ticks(0);
    for (index, chunk) in item.chunks.iter().enumerate() {
        let name = format!("{}.chunks[{index}]", item.id);
        file(&name, &chunk.file, limits)?;
        if chunk.start < earliest || chunk.duration <= Ticks(0) {
            return Err(value(name, "overlaps the chunk before, starts before 0 or lasts no time"));
        }
        earliest = chunk.start + chunk.duration;
    }
    if earliest > duration {
        return Err(value(format!("{}.chunks", item.id), "go on after the match's duration"));
    }
    Ok(())
}

fn file(field: &str, entry: &FileEntry, limits: &Limits) -> Result<(), ManifestError> {
    path(&entry.path)?;
    let bytes = usize::try_from(entry.bytes).unwrap_or(usize::MAX);
    limit("bytes in one file", bytes, limits.chunk_bytes)?;
    let hexadecimal = entry.blake3.bytes().all(|digit| matches!(digit, b'0'..=b'9' | b'a'..=b'f'));
    if entry.blake3.len() != 64 || !hexadecimal {
        return Err(value(format!("{field}.blake3"), "is not 64 lower-case hexadecimal digits"));
    }
    Ok(())
}

/// A path that means the same inside a folder and under a URL, and stays inside.
fn path(path: &str) -> Result<(), ManifestError> {
    let fail = |problem| {
        let shown: String = path.chars().take(PATH_BYTES).collect();
        Err(ManifestError::Path { path: shown, problem })
    };
    if path.len() > PATH_BYTES {
        return fail("is longer than 200 bytes");
    }
    if path.starts_with('/') {
        return fail("is not relative to the stream");
    }
    if !path.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._-/".contains(&byte)) {
        return fail("has a character other than letters, digits, `.`, `_`, `-` and `/`");
    }
    if path.split('/').any(|part| part.is_empty() || part == "." || part == "..") {
        return fail("has an empty part, `.` or `..`: it could leave the stream");
    }
    Ok(())
}

fn limit(what: &'static str, found: usize, limit: usize) -> Result<(), ManifestError> {
    if found > limit {
        return Err(ManifestError::Limit { what, found: found as u64, limit: limit as u64 });
    }
    Ok(())
}

fn value(field: impl Into<String>, problem: &'static str) -> ManifestError {
    ManifestError::Value { field: field.into(), problem }
}
