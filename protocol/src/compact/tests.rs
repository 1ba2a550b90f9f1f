//! Runs there and back, what they lose, what an ordinary viewer sees, and what hostile bytes cannot do.

use proptest::prelude::*;
use serde_json::Value;

use super::*;
use crate::{
    chunk::{Atlas, Body, ChunkError},
    content::AnyChunk,
    glb::Glb,
    limits::Limits,
    sample,
    time::Ticks,
};

const LIMITS: Limits = Limits {
    manifest_bytes: 1 << 20,
    chunk_bytes: 1 << 20,
    chunk_json_bytes: 1 << 20,
    decoded_bytes_per_chunk: 64 << 20,
    chunks: 100,
    people: 100,
    frames_per_chunk: 100,
    bodies_per_frame: 30,
    vertices_per_body: 2_000,
    triangles_per_body: 4_000,
    texture_side_px: 2048,
};

fn encoded(sequence: &Sequence) -> Vec<u8> {
    encode(sequence, sample::TIMESCALE, &Quality::HIGH).unwrap()
}

/// How far the farthest vertex of a body is from the nearest of another, metres; vertices have no order.
fn farthest(body: &Body, given: &Body) -> f32 {
    let nearest = |position: &[f32; 3]| {
        let apart = |other: &[f32; 3]| (Vec3::from(*other) - Vec3::from(*position)).length();
        given.mesh.positions_m.iter().map(apart).fold(f32::INFINITY, f32::min)
    };
    body.mesh.positions_m.iter().map(nearest).fold(0.0, f32::max)
}

#[test]
fn a_sample_sequence_comes_back() {
    let sequence = sample::sequence_of(0, 30, 5);
    let chunk = CompactChunk::decode(&encoded(&sequence), &LIMITS).unwrap();
    assert_eq!(chunk.frames(), sequence.frames);
    for index in 0..30 {
        let (frame, given) = (chunk.frame(index).unwrap(), sample::frame_of(index as u32, 5));
        assert_eq!(frame.bodies.len(), 5);
        let Some(Atlas::Pixels(atlas)) = &frame.atlas else { panic!("no pixels") };
        for (body, given) in frame.bodies.iter().zip(&given.bodies) {
            assert_eq!(body.person, given.person);
            assert!((body.anchor_m - given.anchor_m).abs().max_element() < 0.001);
            assert_eq!(body.mesh.triangles.len(), given.mesh.triangles.len());
            let off_m = farthest(body, given);
            assert!(off_m < 0.012, "a vertex is {off_m} m from where it was");
            // The sample's people are skin above and shirt in the middle: the atlas has both.
            let colours = body.mesh.uvs.iter().map(|[u, v]| {
                let x = ((u * atlas.width_px as f32) as u32).min(atlas.width_px - 1);
                let y = ((v * atlas.height_px as f32) as u32).min(atlas.height_px - 1);
                let at = ((y * atlas.width_px + x) * 4) as usize;
                [atlas.rgba[at], atlas.rgba[at + 1], atlas.rgba[at + 2]]
            });
            let near = |colour: [u8; 3], to: [u8; 3]| colour.iter().zip(to).all(|(a, b)| a.abs_diff(b) < 12);
            let shirt = if body.person.0.is_multiple_of(2) { [200, 30, 40] } else { [40, 70, 200] };
            let found: Vec<[u8; 3]> = colours.collect();
            for wanted in [[205, 150, 120], shirt, [235, 235, 240]] {
                assert!(found.iter().any(|colour| near(*colour, wanted)), "{wanted:?} is not in {found:?}");
            }
        }
    }
    assert_eq!(chunk.frame(30), None);
    // Frames do not depend on those before them.
    assert_eq!(chunk.frame(17), CompactChunk::decode(&encoded(&sequence), &LIMITS).unwrap().frame(17));
}

#[test]
fn people_come_and_go_and_change_their_mesh() {
    let whole = sample::sequence_of(0, 10, 2);
    let part = |run: &Run, frames: std::ops::Range<usize>| Run {
        frames: frames.clone().collect(),
        anchors_m: run.anchors_m[frames.clone()].to_vec(),
        positions_m: run.positions_m[frames.clone()].to_vec(),
        textures: run.textures[frames].to_vec(),
        guessed_from_u: Some(0.25),
        ..run.clone()
    };
    let runs = vec![part(&whole.runs[0], 0..4), part(&whole.runs[0], 6..10), part(&whole.runs[1], 2..3)];
    let sequence = Sequence { runs, ..whole };
    let chunk = CompactChunk::decode(&encoded(&sequence), &LIMITS).unwrap();
    let people: Vec<Vec<u32>> = (0..10)
        .map(|index| chunk.frame(index).unwrap().bodies.iter().map(|body| body.person.0).collect())
        .collect();
    let expected: [&[u32]; 10] = [&[0], &[0], &[0, 1], &[0], &[], &[], &[0], &[0], &[0], &[0]];
    assert_eq!(people, expected);
    assert_eq!(chunk.frame(4).unwrap().atlas, None);
    // What is guessed begins at the same texel wherever the texture lies in the atlas.
    for body in &chunk.frame(2).unwrap().bodies {
        let low = body.mesh.uvs.iter().map(|uv| uv[0]).fold(f32::INFINITY, f32::min);
        assert!(body.guessed_from_u.is_some_and(|from| from < low + 0.2 && from > 0.0));
    }
}

#[test]
fn who_only_runs_along_costs_a_mesh_and_little_more() {
    let mut sequence = sample::sequence_of(0, 30, 1);
    let still = encoded(&Sequence { runs: Vec::new(), ..sequence.clone() }).len();
    let rest = sequence.runs[0].positions_m[0].clone();
    sequence.runs[0].positions_m.fill(rest.clone());
    sequence.runs[0].mesh.positions_m = rest;
    let one = encoded(&sequence).len() - still;
    assert!(one < 3_500, "{one} bytes for a second of somebody who does not move");
}

#[test]
fn a_finer_step_is_nearer_and_larger() {
    let sequence = sample::sequence_of(0, 20, 3);
    let coarse = Quality { point_step_m: 0.1, texture_step: 60.0, ..Quality::HIGH };
    let given = &sample::frame_of(13, 3).bodies[1];
    let [fine, coarse] = [Quality::HIGH, coarse].map(|quality| {
        let bytes = encode(&sequence, sample::TIMESCALE, &quality).unwrap();
        let chunk = CompactChunk::decode(&bytes, &LIMITS).unwrap();
        (bytes.len(), farthest(&chunk.frame(13).unwrap().bodies[1], given))
    });
    assert!(fine.0 > coarse.0 && 2.0 * fine.1 < coarse.1, "{fine:?} and {coarse:?}");
}

#[test]
fn an_ordinary_viewer_finds_a_mesh_at_rest_for_everybody() {
    let bytes = encoded(&sample::sequence_of(0, 5, 3));
    let document: Value = serde_json::from_slice(Glb::parse(&bytes).unwrap().json).unwrap();
    assert_eq!(document["extensionsUsed"][0], EXTENSION);
    assert!(document["extensionsRequired"].as_array().unwrap().iter().all(|name| name != EXTENSION));
    assert_eq!(document["scenes"][0]["nodes"].as_array().unwrap().len(), 3);
    assert_eq!(document["nodes"][1]["name"], "person-001");
    let parts = byte_parts(&bytes, &LIMITS).unwrap();
    assert_eq!(parts.rest + parts.motion + parts.head + parts.index, bytes.len());
    assert!(matches!(AnyChunk::decode(&bytes, &LIMITS), Ok(AnyChunk::Compact(_))));
    let plain = crate::chunk::encode(&sample::chunk_of(0, 2, 1), sample::TIMESCALE).unwrap();
    assert!(matches!(AnyChunk::decode(&plain, &LIMITS), Ok(AnyChunk::Plain(_))));
    assert!(CompactChunk::decode(&plain, &LIMITS).is_err());
}

#[test]
fn what_does_not_fit_together_is_not_written() {
    let good = sample::sequence_of(0, 4, 2);
    let refused = |change: &dyn Fn(&mut Sequence)| {
        let mut sequence = good.clone();
        change(&mut sequence);
        encode(&sequence, sample::TIMESCALE, &Quality::HIGH).is_err()
    };
    assert!(!refused(&|_| ()));
    assert!(refused(&|sequence| sequence.frames.clear()));
    assert!(refused(&|sequence| sequence.frames[2].start = Ticks(0)));
    assert!(refused(&|sequence| sequence.runs[0].frames[3] = 4));
    assert!(refused(&|sequence| sequence.runs[0].frames[3] = 1));
    assert!(refused(&|sequence| sequence.runs[1].person = PersonId(0)));
    assert!(refused(&|sequence| sequence.runs[0].anchors_m[1].x = f32::NAN));
    assert!(refused(&|sequence| sequence.runs[0].positions_m[1][5][0] = f32::INFINITY));
    assert!(refused(&|sequence| sequence.runs[0].positions_m[1].truncate(7)));
    assert!(refused(&|sequence| sequence.runs[0].textures[2].width_px = 5));
    assert!(refused(&|sequence| sequence.runs[0].guessed_from_u = Some(1.5)));
    assert!(refused(&|sequence| sequence.runs[0].mesh.triangles.clear()));
}

#[test]
fn a_chunk_beyond_the_limits_is_refused_before_it_is_decoded() {
    let bytes = encoded(&sample::sequence_of(0, 12, 4));
    let refused =
        |limits: Limits| matches!(CompactChunk::decode(&bytes, &limits), Err(ChunkError::Limit { .. }));
    assert!(refused(Limits { chunk_bytes: bytes.len() - 1, ..LIMITS }));
    assert!(refused(Limits { frames_per_chunk: 11, ..LIMITS }));
    assert!(refused(Limits { bodies_per_frame: 3, ..LIMITS }));
    assert!(refused(Limits { vertices_per_body: 40, ..LIMITS }));
    assert!(refused(Limits { texture_side_px: 10, ..LIMITS }));
    assert!(refused(Limits { decoded_bytes_per_chunk: 20_000, ..LIMITS }));
}

/// A chunk without people whose head is `head`.
fn with_head(head: &[u8]) -> Vec<u8> {
    let json = format!(
        "{{\"bufferViews\":[{{\"buffer\":0,\"byteLength\":{}}}],\"extensions\":{{\"{EXTENSION}\":{{\"layout\":1,\"head\":0,\"runs\":[]}}}}}}",
        head.len()
    );
    Glb { json: json.as_bytes(), bin: head }.write().unwrap()
}

#[test]
fn a_head_of_many_empty_lists_is_refused_before_they_are_made() {
    // One tick per second, one short frame, no run, and tables without end: a byte each, twenty-four in memory.
    let mut head = vec![1, 1, 1, 0, 0, 2, 0, 0, 0, 0, 0];
    let good = CompactChunk::decode(&with_head(&[head.as_slice(), &[0]].concat()), &LIMITS);
    assert_eq!(good.map(|chunk| chunk.frames().len()), Ok(1));
    head.extend([0xFF, 0xFF, 0xFF, 0x7F]);
    head.resize(8 << 20, 0);
    let limits = Limits { chunk_bytes: 16 << 20, ..LIMITS };
    let refused = CompactChunk::decode(&with_head(&head), &limits);
    assert!(matches!(refused, Err(ChunkError::Limit { what: "bytes of the head", .. })), "{refused:?}");
}

#[test]
fn a_camera_that_is_no_number_is_refused() {
    let mut sequence = sample::sequence_of(0, 2, 1);
    let bytes = encoded(&sequence);
    let camera = sequence.frames[1].camera.as_mut().unwrap();
    let focal = camera.focal_px.to_le_bytes();
    camera.focal_px = f64::NAN;
    assert!(encode(&sequence, sample::TIMESCALE, &Quality::HIGH).is_err());
    let mut hostile = bytes.clone();
    let at = bytes.windows(8).position(|eight| eight == focal).unwrap();
    hostile[at..at + 8].copy_from_slice(&f64::NAN.to_le_bytes());
    assert!(matches!(CompactChunk::decode(&hostile, &LIMITS), Err(ChunkError::Frame { .. })));
}

#[test]
fn a_newer_layout_is_told_as_one() {
    let bytes = encoded(&sample::sequence_of(0, 2, 1));
    let at = bytes.windows(10).position(|ten| ten == b"\"layout\":1").unwrap();
    let mut newer = bytes.clone();
    newer[at + 9] = b'7';
    assert_eq!(AnyChunk::decode(&newer, &LIMITS), Err(ChunkError::Version { found: 7, known: 1 }));
}

/// Reads everything that a hostile chunk offers.
fn read_all(bytes: &[u8]) {
    if let Ok(chunk) = CompactChunk::decode(bytes, &LIMITS) {
        for index in 0..chunk.frames().len() {
            let frame = chunk.frame(index).unwrap();
            assert!(frame.bodies.iter().all(|body| body.mesh.positions_m.len() == body.mesh.uvs.len()));
        }
        let _ = chunk.texture(0, 0);
    }
}

#[test]
fn a_cut_chunk_is_an_error() {
    let bytes = encoded(&sample::sequence_of(0, 6, 3));
    for end in (0..bytes.len()).step_by(7) {
        assert!(CompactChunk::decode(&bytes[..end], &LIMITS).is_err(), "cut at {end}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn changed_bytes_are_read_or_refused(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let mut bytes = encoded(&sample::sequence_of(0, 4, 2));
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        read_all(&bytes);
    }

    #[test]
    fn changed_numbers_in_the_head_are_read_or_refused(change in any::<prop::sample::Index>(), value in any::<u8>()) {
        let mut bytes = encoded(&sample::sequence_of(0, 4, 2));
        // Heads and motions are small beside the document: aim at them.
        let binary = bytes.len() - Glb::parse(&bytes).unwrap().bin.len();
        let at = binary + change.index(bytes.len() - binary);
        bytes[at] = value;
        read_all(&bytes);
    }
}
