//! What is accepted, what is refused and why, and the schema that ships with the crate.

use proptest::prelude::*;
use serde_json::{Value, json};

use super::*;
use crate::sample;

fn good() -> Manifest {
    sample::match_of(40, 2).unwrap().manifest
}

/// The sample's manifest with its JSON changed.
fn changed(change: impl Fn(&mut Value)) -> Result<Manifest, ManifestError> {
    let mut document: Value = serde_json::from_str(&good().to_json().unwrap()).unwrap();
    change(&mut document);
    Manifest::from_json(&serde_json::to_vec(&document).unwrap(), &Limits::default())
}

#[test]
fn it_comes_back_from_json() {
    let manifest = good();
    let text = manifest.to_json().unwrap();
    assert_eq!(Manifest::from_json(text.as_bytes(), &Limits::default()), Ok(manifest));
}

#[test]
fn newer_minor_versions_and_unknown_fields_are_read() {
    let manifest = changed(|document| {
        document["version"] = "1.7".into();
        document["weather"] = json!({ "rain": true });
        document["people"][0]["boots"] = "red".into();
        document["representations"][0]["chunks"][0]["priority"] = 3.into();
    });
    assert_eq!(manifest.unwrap().people, good().people);
}

#[test]
fn other_formats_and_major_versions_are_refused_even_if_all_else_differs() {
    let refused = |text: &str| Manifest::from_json(text.as_bytes(), &Limits::default()).unwrap_err();
    let newer = refused(r#"{ "format": "holopitch", "version": "2.0", "segments": [] }"#);
    assert_eq!(newer, ManifestError::Version { found: "2.0".to_owned() });
    assert!(newer.to_string().contains("newer program"));
    for version in ["1", "one.0", "1.x", "", "-1.0"] {
        let text = format!(r#"{{ "format": "holopitch", "version": "{version}" }}"#);
        assert!(matches!(refused(&text), ManifestError::Version { .. }), "{version}");
    }
    let other = refused(r#"{ "format": "dash", "version": "1.0" }"#);
    assert_eq!(other, ManifestError::Format { found: "dash".to_owned() });
    assert!(matches!(refused("{ \"format\": \"holo"), ManifestError::Json { .. }));
}

#[test]
fn paths_cannot_leave_the_stream() {
    for path in [
        "../secret.glb",
        "high/../../secret.glb",
        "/etc/passwd",
        "high//0.glb",
        "./0.glb",
        "C:\\0.glb",
        "C:/0.glb",
        "high\\0.glb",
        "http://example.org/0.glb",
        "0.glb?x",
        "0%2e.glb",
        "",
        "a\0b",
        "höhe.glb",
    ] {
        let result = changed(|document| document["representations"][0]["chunks"][0]["path"] = path.into());
        assert!(matches!(result, Err(ManifestError::Path { .. })), "{path:?} was accepted");
        let scene = json!({ "path": path, "bytes": 1, "blake3": "0".repeat(64) });
        let result = changed(|document| document["static_scene"] = scene.clone());
        assert!(matches!(result, Err(ManifestError::Path { .. })), "{path:?} was accepted");
    }
    let long = "a".repeat(201);
    let result = changed(|document| document["representations"][0]["id"] = long.as_str().into());
    assert!(matches!(result, Err(ManifestError::Path { .. })));
    assert!(
        changed(|document| document["representations"][0]["chunks"][0]["path"] = "a/b-2/c_3.glb".into())
            .is_ok()
    );
}

#[test]
fn segments_are_read_and_unknown_kinds_tolerated() {
    let manifest = changed(|document| {
        document["segments"] = json!([
            {"start": 0, "duration": 5, "kind": "shot"},
            {"start": 5, "duration": 2, "kind": "gap"},
            {"start": 9, "duration": 1, "kind": "advertisement"}
        ]);
    });
    let kinds: Vec<SegmentKind> = manifest.unwrap().segments.iter().map(|segment| segment.kind).collect();
    assert_eq!(kinds, [SegmentKind::Shot, SegmentKind::Gap, SegmentKind::Other]);
}

#[test]
fn impossible_values_are_named() {
    let named = |change: &dyn Fn(&mut Value)| changed(change).unwrap_err().to_string();
    let chunk = |document: &mut Value, index: usize, field: &str, value: Value| {
        document["representations"][0]["chunks"][index][field] = value;
    };
    /// How the document is broken, and what the error names.
    type Case<'a> = (&'a dyn Fn(&mut Value), &'a str);
    let cases: [Case<'_>; 19] = [
        (&|d| d["timescale"]["numerator"] = 0.into(), "timescale"),
        (&|d| d["timescale"]["denominator"] = 0.into(), "timescale"),
        (&|d| d["duration"] = (-1).into(), "duration"),
        (&|d| d["pitch"]["length_m"] = 0.0.into(), "pitch.length_m"),
        (&|d| d["pitch"]["width_m"] = 1e9.into(), "pitch.width_m"),
        (&|d| d["people"][1]["id"] = 0.into(), "people"),
        (&|d| d["people"][1]["team_confidence"] = 1.5.into(), "people[1].team_confidence"),
        (&|d| d["people"][0]["role_confidence"] = (-0.1).into(), "people[0].role_confidence"),
        (&|d| d["people"][0]["number_confidence"] = 1e300.into(), "people[0].number_confidence"),
        (&|d| d["segments"] = json!([{"start": 0, "duration": 0, "kind": "shot"}]), "segments[0]"),
        (&|d| d["segments"] = json!([{"start": -1, "duration": 5, "kind": "shot"}]), "segments[0]"),
        (&|d| d["segments"] = json!([{"start": 5, "duration": i64::MAX, "kind": "gap"}]), "segments[0]"),
        (
            &|d| {
                d["segments"] = json!([
                    {"start": 0, "duration": 5, "kind": "shot"},
                    {"start": 4, "duration": 5, "kind": "gap"}
                ]);
            },
            "segments[1]",
        ),
        (&|d| d["representations"] = json!([]), "representations"),
        (&|d| chunk(d, 1, "start", 5.into()), "high.chunks[1]"),
        (&|d| chunk(d, 0, "duration", 0.into()), "high.chunks[0]"),
        (&|d| chunk(d, 1, "duration", 9_999_999.into()), "high.chunks"),
        (&|d| chunk(d, 0, "blake3", "xyz".into()), "blake3"),
        (&|d| chunk(d, 0, "bytes", u64::MAX.into()), "bytes in one file"),
    ];
    for (change, field) in cases {
        let message = named(change);
        assert!(message.contains(field), "{message:?} does not name {field}");
    }
}

/// The sample's manifest with a second, lower representation, which is changed too.
fn with_a_second(change: impl Fn(&mut Value)) -> Result<Manifest, ManifestError> {
    changed(|document| {
        let mut low = document["representations"][0].clone();
        low["id"] = "low".into();
        document["representations"].as_array_mut().unwrap().insert(0, low);
        change(document);
    })
}

#[test]
fn representations_have_chunks_at_the_same_times() {
    assert_eq!(with_a_second(|_| ()).unwrap().representations.len(), 2);
    let shifted = with_a_second(|document| {
        document["representations"][0]["chunks"][1]["duration"] = 10.into();
    });
    let message = shifted.unwrap_err().to_string();
    assert!(message.contains("low.chunks[1]") || message.contains("high.chunks[1]"), "{message}");
    assert!(message.contains("another time"), "{message}");
    let shorten = |document: &mut Value| {
        document["representations"][0]["chunks"].as_array_mut().unwrap().pop();
    };
    let message = with_a_second(shorten).unwrap_err().to_string();
    assert!(message.contains("low.chunks are fewer"), "{message}");
    let live = with_a_second(|document| {
        shorten(document);
        document["live"] = json!({ "update_after": 30_000 });
    });
    assert_eq!(live.unwrap().live, Some(Live { update_after: Ticks(30_000) }));
}

#[test]
fn a_stream_is_complete_unless_it_says_that_it_is_live() {
    assert_eq!(good().live, None);
    assert!(!good().to_json().unwrap().contains("live"));
    let message =
        changed(|document| document["live"] = json!({ "update_after": 0 })).unwrap_err().to_string();
    assert!(message.contains("live.update_after"), "{message}");
}

#[test]
fn limits_come_before_everything() {
    let text = good().to_json().unwrap();
    let refused = |limits: Limits| match Manifest::from_json(text.as_bytes(), &limits) {
        Err(ManifestError::Limit { what, .. }) => what,
        other => panic!("not refused: {other:?}"),
    };
    let free = Limits::default();
    assert_eq!(refused(Limits { manifest_bytes: 10, ..free }), "bytes");
    assert_eq!(refused(Limits { people: 1, ..free }), "people");
    assert_eq!(refused(Limits { chunks: 1, ..free }), "chunks");
    assert_eq!(refused(Limits { triangles_per_body: 10, ..free }), "triangles per body");
}

#[test]
fn the_chunk_at_a_moment() {
    let manifest = good();
    let best = manifest.best().unwrap();
    assert_eq!(best.chunk_at(Ticks(-5)), Some(0));
    assert_eq!(best.chunk_at(Ticks(30 * 1001 - 1)), Some(0));
    assert_eq!(best.chunk_at(Ticks(30 * 1001)), Some(1));
    assert_eq!(best.chunk_at(Ticks(i64::MAX)), Some(1));
}

/// `HOLOPITCH_UPDATE_SCHEMA=1 cargo test -p protocol schema` writes the file anew.
#[test]
fn the_schema_in_the_crate_is_that_of_the_types() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/schema/match.schema.json");
    let current = serde_json::to_string_pretty(&schemars::schema_for!(Manifest)).unwrap() + "\n";
    if std::env::var_os("HOLOPITCH_UPDATE_SCHEMA").is_some() {
        std::fs::create_dir_all(concat!(env!("CARGO_MANIFEST_DIR"), "/schema")).unwrap();
        std::fs::write(path, &current).unwrap();
    }
    let shipped = std::fs::read_to_string(path).unwrap_or_default();
    assert_eq!(shipped, current, "run with HOLOPITCH_UPDATE_SCHEMA=1 and review the change to the format");
}

proptest! {
    #[test]
    fn arbitrary_text_never_panics(text in ".{0,200}") {
        let _ = Manifest::from_json(text.as_bytes(), &Limits::default());
    }

    #[test]
    fn a_flipped_byte_never_panics(at in 0..2000usize, bit in 0..8u8) {
        let mut bytes = good().to_json().unwrap().into_bytes();
        let at = at % bytes.len();
        bytes[at] ^= 1 << bit;
        let _ = Manifest::from_json(&bytes, &Limits::default());
    }
}
