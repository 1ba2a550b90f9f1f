//! Round trips, what an ordinary viewer sees, and what hostile bytes cannot do.

use glam::{DMat3, DVec3, Vec3};
use proptest::prelude::*;
use serde_json::Value;

use super::*;
use crate::{camera::Camera, glb::Glb, limits::Limits, manifest::PersonId, sample, time::Timescale};

/// Farthest from any vertex of `a` to the nearest vertex of `b`, metres and uv.
fn vertex_error(a: &Mesh, b: &Mesh) -> (f32, f32) {
    let mut worst = (0.0f32, 0.0f32);
    for (position, uv) in a.positions_m.iter().zip(&a.uvs) {
        let nearest = b
            .positions_m
            .iter()
            .zip(&b.uvs)
            .map(|(p, q)| {
                let metres = Vec3::from_array(*p).distance(Vec3::from_array(*position));
                let texture = (q[0] - uv[0]).abs().max((q[1] - uv[1]).abs());
                (metres, texture)
            })
            .min_by(|a, b| (a.0 + a.1).total_cmp(&(b.0 + b.1)))
            .unwrap();
        worst = (worst.0.max(nearest.0), worst.1.max(nearest.1));
    }
    worst
}

fn assert_close(original: &Chunk, back: &Chunk) {
    assert_eq!(original.frames.len(), back.frames.len());
    for (a, b) in original.frames.iter().zip(&back.frames) {
        assert_eq!(
            (a.clip_frame, a.start, a.duration, a.quality),
            (b.clip_frame, b.start, b.duration, b.quality)
        );
        assert_eq!(a.atlas, b.atlas);
        assert_eq!(a.bodies.len(), b.bodies.len());
        if let (Some(a), Some(b)) = (a.camera, b.camera) {
            assert!((a.position - b.position).length() < 1e-9 && (a.focal_px - b.focal_px).abs() < 1e-9);
            let turned = a.rotation * b.rotation.transpose() - DMat3::IDENTITY;
            assert!(turned.to_cols_array().iter().all(|value| value.abs() < 1e-12));
        }
        assert_eq!(a.camera.is_some(), b.camera.is_some());
        assert_eq!(a.ball.map(|ball| ball.height_known), b.ball.map(|ball| ball.height_known));
        assert_eq!(a.ball.map(|ball| ball.spread), b.ball.map(|ball| ball.spread));
        for (a, b) in a.bodies.iter().zip(&b.bodies) {
            assert_eq!((a.person, a.anchor_m), (b.person, b.anchor_m));
            assert_eq!(a.mesh.triangles.len(), b.mesh.triangles.len());
            assert_eq!(a.mesh.positions_m.len(), b.mesh.positions_m.len());
            let (metres, texture) = vertex_error(&a.mesh, &b.mesh);
            assert!(metres < 0.001, "a vertex moved by {metres} m");
            assert!(texture < 0.001, "a texture coordinate moved by {texture}");
        }
    }
}

#[test]
fn a_sample_chunk_comes_back() {
    let chunk = sample::chunk_of(0, 5, 4);
    let bytes = encode(&chunk, sample::TIMESCALE).unwrap();
    assert_close(&chunk, &decode(&bytes, &Limits::default()).unwrap());
    let split = byte_split(&bytes, &Limits::default()).unwrap();
    assert_eq!(split.geometry + split.texture + split.index, bytes.len());
    assert_eq!(split.bodies, 20);
}

#[test]
fn frames_without_anybody_come_back() {
    let mut chunk = sample::chunk_of(0, 3, 2);
    chunk.frames[1].bodies.clear();
    chunk.frames[2].atlas = None;
    chunk.frames[2].camera = None;
    chunk.frames[2].ball = None;
    let bytes = encode(&chunk, sample::TIMESCALE).unwrap();
    assert_close(&chunk, &decode(&bytes, &Limits::default()).unwrap());

    let empty = sample::chunk_of(0, 2, 0);
    let bytes = encode(&empty, sample::TIMESCALE).unwrap();
    assert_close(&empty, &decode(&bytes, &Limits::default()).unwrap());
}

/// Plays the file's standard animation the way a viewer without our extras does.
fn visible_at(document: &Value, bin: &[u8], seconds: f64) -> Vec<(String, [f32; 3])> {
    let floats = |accessor: usize| -> Vec<f32> {
        let accessor = &document["accessors"][accessor];
        let view = &document["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let start = view["byteOffset"].as_u64().unwrap_or(0) as usize;
        let length = view["byteLength"].as_u64().unwrap() as usize;
        bin[start..start + length]
            .chunks_exact(4)
            .map(|four| f32::from_le_bytes(four.try_into().unwrap()))
            .collect()
    };
    let animation = &document["animations"][0];
    let value = |node: usize, path: &str| -> [f32; 3] {
        let channel = animation["channels"]
            .as_array()
            .unwrap()
            .iter()
            .find(|channel| channel["target"]["node"] == node && channel["target"]["path"] == path)
            .unwrap();
        let sampler = &animation["samplers"][channel["sampler"].as_u64().unwrap() as usize];
        assert_eq!(sampler["interpolation"], "STEP");
        let keys = floats(sampler["input"].as_u64().unwrap() as usize);
        let values = floats(sampler["output"].as_u64().unwrap() as usize);
        let key = keys.partition_point(|key| f64::from(*key) <= seconds).saturating_sub(1);
        values[3 * key..3 * key + 3].try_into().unwrap()
    };
    let mut shown = Vec::new();
    for root in document["scenes"][0]["nodes"].as_array().unwrap() {
        let root = root.as_u64().unwrap() as usize;
        for child in document["nodes"][root]["children"].as_array().unwrap() {
            let child = child.as_u64().unwrap() as usize;
            if value(child, "scale") == [1.0; 3] {
                let name = document["nodes"][child]["name"].as_str().unwrap().to_owned();
                shown.push((name, value(root, "translation")));
            }
        }
    }
    shown
}

#[test]
fn an_ordinary_viewer_shows_the_right_people_at_the_right_time() {
    let mut chunk = sample::chunk_of(7, 6, 3);
    chunk.frames[2].bodies.remove(1);
    let bytes = encode(&chunk, sample::TIMESCALE).unwrap();
    let glb = Glb::parse(&bytes).unwrap();
    let document: Value = serde_json::from_slice(glb.json).unwrap();
    let origin = chunk.frames[0].start;
    for frame in &chunk.frames {
        // In the middle of the frame, and (last frame) at the very end of the animation.
        let middle = sample::TIMESCALE.seconds(frame.start - origin) + 0.015;
        let shown = visible_at(&document, glb.bin, middle);
        let expected: Vec<(String, [f32; 3])> = frame
            .bodies
            .iter()
            .map(|body| {
                let name = format!("person-{:03}/frame-{:04}", body.person.0, frame.clip_frame);
                (name, body.anchor_m.to_array())
            })
            .collect();
        assert_eq!(shown, expected);
    }
    assert_eq!(visible_at(&document, glb.bin, 10.0).len(), 3, "the last frame stays");
}

#[test]
fn what_cannot_be_stored_is_refused() {
    let good = sample::chunk_of(0, 2, 2);
    let broken = |change: &dyn Fn(&mut Chunk)| {
        let mut chunk = good.clone();
        change(&mut chunk);
        encode(&chunk, sample::TIMESCALE).unwrap_err()
    };
    assert_eq!(encode(&Chunk::default(), sample::TIMESCALE), Err(ChunkError::Empty));
    assert!(matches!(broken(&|chunk| chunk.frames[1].start = Ticks(0)), ChunkError::Frame { frame: 1, .. }));
    assert!(matches!(
        broken(&|chunk| chunk.frames[0].bodies[1].person = PersonId(0)),
        ChunkError::Frame { frame: 0, .. }
    ));
    assert!(matches!(
        broken(&|chunk| chunk.frames[0].bodies[0].anchor_m.x = f32::NAN),
        ChunkError::Frame { frame: 0, .. }
    ));
    assert!(matches!(
        broken(&|chunk| chunk.frames[0].bodies[0].mesh.positions_m[3][1] = f32::INFINITY),
        ChunkError::Body { frame: 0, person: PersonId(0), .. }
    ));
    assert!(matches!(
        broken(&|chunk| chunk.frames[1].bodies[1].mesh.triangles[0] = [0, 1, 9999]),
        ChunkError::Body { frame: 1, person: PersonId(1), .. }
    ));
    assert!(matches!(
        broken(&|chunk| chunk.frames[0].bodies[0].mesh.triangles.clear()),
        ChunkError::Body { .. }
    ));
}

#[test]
fn limits_hold() {
    let bytes = encode(&sample::chunk_of(0, 4, 3), sample::TIMESCALE).unwrap();
    let refused = |limits: Limits| match decode(&bytes, &limits) {
        Err(ChunkError::Limit { what, .. }) => what,
        other => panic!("not refused: {other:?}"),
    };
    let free = Limits::default();
    assert_eq!(refused(Limits { chunk_bytes: 100, ..free }), "bytes");
    assert_eq!(refused(Limits { chunk_json_bytes: 100, ..free }), "bytes of JSON");
    assert_eq!(refused(Limits { frames_per_chunk: 3, ..free }), "frames");
    assert_eq!(refused(Limits { bodies_per_frame: 2, ..free }), "bodies in a frame");
    assert_eq!(refused(Limits { vertices_per_body: 47, ..free }), "vertices in a body");
    assert_eq!(refused(Limits { triangles_per_body: 71, ..free }), "triangles in a body");
    assert_eq!(refused(Limits { texture_side_px: 47, ..free }), "pixels along a texture");
    assert_eq!(refused(Limits { decoded_bytes_per_chunk: 20_000, ..free }), "bytes after decoding");
}

/// The file with its JSON rewritten by `change`.
fn with_json(bytes: &[u8], change: impl Fn(&mut Value)) -> Vec<u8> {
    let glb = Glb::parse(bytes).unwrap();
    let mut document: Value = serde_json::from_slice(glb.json).unwrap();
    change(&mut document);
    let json = serde_json::to_vec(&document).unwrap();
    Glb { json: &json, bin: glb.bin }.write().unwrap()
}

#[test]
fn lies_in_the_document_are_found() {
    let bytes = encode(&sample::chunk_of(0, 2, 2), sample::TIMESCALE).unwrap();
    let told = |change: &dyn Fn(&mut Value)| {
        decode(&with_json(&bytes, change), &Limits::default()).unwrap_err().to_string()
    };
    let index = |document: &mut Value| -> Value { document["scenes"][0]["extras"]["holopitch"].clone() };
    assert_eq!(index(&mut serde_json::from_slice(Glb::parse(&bytes).unwrap().json).unwrap())["layout"], 1);

    // Fewer or more vertices than the Draco data has.
    for count in [47, 49] {
        let message = told(&|document| {
            for accessor in document["accessors"].as_array_mut().unwrap() {
                if accessor["count"] == 48 {
                    accessor["count"] = count.into();
                }
            }
        });
        assert!(message.contains("person 0"), "{message}");
    }
    let message = told(&|document| document["scenes"][0]["extras"]["holopitch"]["layout"] = 2.into());
    assert!(message.contains("layout version 2"), "{message}");
    let message = told(&|document| document["scenes"][0]["extras"] = Value::Null);
    assert!(message.contains("no `holopitch` extras"), "{message}");
    let message = told(&|document| document["bufferViews"][1]["byteLength"] = u64::MAX.into());
    assert!(message.contains("buffer view 1"), "{message}");
    let message = told(&|document| document["meshes"][0]["primitives"] = Value::Array(Vec::new()));
    assert!(message.contains("mesh with one primitive 0"), "{message}");
    let message = told(&|document| {
        document["scenes"][0]["extras"]["holopitch"]["frames"][1]["start"] = 0.into();
    });
    assert!(message.starts_with("frame 1"), "{message}");
    let message = told(&|document| {
        document["scenes"][0]["extras"]["holopitch"]["frames"][0]["bodies"][1] = serde_json::json!([0, 0]);
    });
    assert!(message.contains("two bodies"), "{message}");
    let message = told(&|document| {
        document["scenes"][0]["extras"]["holopitch"]["people"][0]["anchors"] = 1_000_000.into();
    });
    assert!(message.contains("anchor accessor"), "{message}");
}

#[test]
fn what_is_guessed_comes_back_and_is_told_for_every_body() {
    let mut chunk = sample::chunk_of(0, 2, 3);
    chunk.frames[1].bodies[2].guessed_from_u = Some(0.25);
    let bytes = encode(&chunk, sample::TIMESCALE).unwrap();
    let told = |chunk: &Chunk| -> Vec<Option<f32>> {
        chunk.frames.iter().flat_map(|frame| frame.bodies.iter().map(|body| body.guessed_from_u)).collect()
    };
    assert_eq!(told(&decode(&bytes, &Limits::default()).unwrap()), told(&chunk));
    for wrong in [serde_json::json!([null, 0.5]), serde_json::json!([0.1, 1.5, null])] {
        let hostile = with_json(&bytes, |document| {
            document["scenes"][0]["extras"]["holopitch"]["frames"][1]["guessed_from_u"] = wrong.clone();
        });
        let refused = decode(&hostile, &Limits::default());
        assert!(matches!(refused, Err(ChunkError::Frame { frame: 1, .. })), "{refused:?}");
    }
    chunk.frames[0].bodies[0].guessed_from_u = Some(f32::NAN);
    let refused = encode(&chunk, sample::TIMESCALE);
    assert!(matches!(refused, Err(ChunkError::Frame { frame: 0, .. })), "{refused:?}");
}

#[test]
fn a_triangle_is_guessed_when_all_its_corners_are() {
    let uvs = vec![[0.2, 0.0], [0.6, 0.0], [0.7, 1.0], [0.9, 0.5]];
    let mesh = Mesh { positions_m: vec![[0.0; 3]; 4], uvs, triangles: Vec::new() };
    let body = Body { person: PersonId(1), anchor_m: Vec3::ZERO, mesh, guessed_from_u: Some(0.6) };
    assert!(body.is_guessed([1, 2, 3]));
    assert!(!body.is_guessed([0, 2, 3]) && !body.is_guessed([1, 2, 9]));
    assert!(!Body { guessed_from_u: None, ..body }.is_guessed([1, 2, 3]));
}

#[test]
fn unknown_fields_are_ignored() {
    let chunk = sample::chunk_of(0, 2, 2);
    let bytes = encode(&chunk, sample::TIMESCALE).unwrap();
    let newer = with_json(&bytes, |document| {
        document["extras"] = serde_json::json!({ "from": "the future" });
        document["scenes"][0]["extras"]["holopitch"]["weather"] = "rain".into();
        document["scenes"][0]["extras"]["holopitch"]["frames"][0]["offside_line_m"] = 31.5.into();
    });
    assert_close(&chunk, &decode(&newer, &Limits::default()).unwrap());
}

#[test]
fn a_cut_file_is_an_error_at_every_length() {
    let bytes = encode(&sample::chunk_of(0, 1, 1), sample::TIMESCALE).unwrap();
    for end in 0..bytes.len() {
        assert!(decode(&bytes[..end], &Limits::default()).is_err(), "cut at {end}");
    }
}

/// A body of `rows × 2` vertices in a strip, bent by `bend`.
fn strip(rows: u32, bend: f32) -> Mesh {
    let mut mesh = Mesh::default();
    for row in 0..rows {
        let y = 1.8 * row as f32 / (rows - 1) as f32;
        let x = bend * (3.0 * y).sin();
        for side in [0.0, 0.4] {
            mesh.positions_m.push([x + side, y, bend * y * y]);
            mesh.uvs.push([side, y / 1.8]);
        }
    }
    for row in 0..rows - 1 {
        let base = 2 * row;
        mesh.triangles.push([base, base + 1, base + 2]);
        mesh.triangles.push([base + 1, base + 3, base + 2]);
    }
    mesh
}

/// Clip frame, start, duration, bodies, atlas.
type AnyFrame = (u32, i64, i64, Vec<(u32, u32, f32, [f32; 3])>, bool);

fn any_frame() -> impl Strategy<Value = AnyFrame> {
    let body = (0..20u32, 2..40u32, -0.5..0.5f32, [-60.0..60.0f32, 0.0..3.0f32, -40.0..40.0f32]);
    (0..100_000u32, 0..3000i64, 1..3000i64, proptest::collection::vec(body, 0..4), any::<bool>())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn any_chunk_comes_back(frames in proptest::collection::vec(any_frame(), 1..5), origin in 0..1_000_000_000i64) {
        let mut chunk = Chunk::default();
        let mut now = origin;
        for (clip_frame, gap, duration, bodies, with_camera) in frames {
            now += gap;
            let mut frame = ChunkFrame {
                clip_frame,
                start: Ticks(now),
                duration: Ticks(duration),
                camera: with_camera.then(|| {
                    Camera::looking_at((1920, 1080), 2500.5, DVec3::new(1.5, 20.0, 80.0), DVec3::new(now as f64 % 40.0, 0.0, 1.0))
                }),
                quality: FrameQuality { line_residual_px: with_camera.then_some(0.5), track_confidence: None },
                ball: None,
                atlas: None,
                bodies: Vec::new(),
            };
            for (person, rows, bend, anchor) in bodies {
                if frame.bodies.iter().all(|body: &Body| body.person.0 != person) {
                    let anchor_m = Vec3::from_array(anchor);
                    frame.bodies.push(Body { person: PersonId(person), anchor_m, mesh: strip(rows, bend), guessed_from_u: None });
                }
            }
            now += duration;
            chunk.frames.push(frame);
        }
        let timescale = Timescale { numerator: 90_000, denominator: 1 };
        let bytes = encode(&chunk, timescale).unwrap();
        let back = decode(&bytes, &Limits::default()).unwrap();
        for (a, b) in chunk.frames.iter().zip(&back.frames) {
            prop_assert_eq!(a.bodies.iter().map(|b| b.person).collect::<Vec<_>>(), b.bodies.iter().map(|b| b.person).collect::<Vec<_>>());
        }
        assert_close(&chunk, &back);
    }
}

/// Splitmix64: enough randomness for mutations, the same every run.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Most memory that this process has ever used, bytes; `None` where the system does not say.
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}

#[test]
fn thousands_of_mutations_end_in_an_error_or_a_chunk_within_the_limits() {
    let chunk = Chunk { frames: vec![sample::frame_of(3, 2), sample::frame_of(4, 2)] };
    let good = encode(&chunk, sample::TIMESCALE).unwrap();
    let json_end = 20 + Glb::parse(&good).unwrap().json.len();
    let limits = Limits { decoded_bytes_per_chunk: 32 << 20, ..Limits::default() };
    let before = peak_bytes();
    let (mut state, mut refused, mut accepted) = (1, 0, 0);
    for round in 0..20_000 {
        let mut bytes = good.clone();
        for _ in 0..=random(&mut state) % 6 {
            // Document and binary part in turn; the container has its own tests.
            let (from, to) = if round % 2 == 0 { (20, json_end) } else { (json_end + 8, bytes.len()) };
            let at = from + random(&mut state) as usize % (to - from);
            bytes[at] = match random(&mut state) % 4 {
                0 => bytes[at] ^ (1 << (random(&mut state) % 8)),
                1 => b'0' + (random(&mut state) % 10) as u8,
                2 => [0, 0xFF, 0x7F, 0x80][random(&mut state) as usize % 4],
                _ => random(&mut state) as u8,
            };
        }
        if round % 10 == 0 {
            // Cut, with a header that agrees.
            bytes.truncate(json_end + 8 + random(&mut state) as usize % (good.len() - json_end - 8));
            let (total, bin) = (bytes.len() as u32, (bytes.len() - json_end - 8) as u32);
            bytes[8..12].copy_from_slice(&total.to_le_bytes());
            bytes[json_end..json_end + 4].copy_from_slice(&bin.to_le_bytes());
        }
        match decode(&bytes, &limits) {
            Err(_) => refused += 1,
            Ok(chunk) => {
                accepted += 1;
                for body in chunk.frames.iter().flat_map(|frame| &frame.bodies) {
                    assert!(body.mesh.positions_m.len() <= limits.vertices_per_body);
                    assert_eq!(body.mesh.positions_m.len(), body.mesh.uvs.len());
                    assert!(body.anchor_m.is_finite());
                }
            }
        }
    }
    println!("{refused} refused, {accepted} accepted");
    assert!(refused > 5_000 && accepted > 500, "{refused} refused, {accepted} accepted: the mutations miss");
    if let (Some(before), Some(after)) = (before, peak_bytes()) {
        assert!(after - before < 256 << 20, "memory grew by {} MiB", (after - before) >> 20);
    }
}

#[test]
fn a_small_file_cannot_ask_for_much() {
    // One mesh named by every body of every frame: the budget ends it.
    let bytes = encode(&sample::chunk_of(0, 1, 1), sample::TIMESCALE).unwrap();
    let many = with_json(&bytes, |document| {
        let index = &mut document["scenes"][0]["extras"]["holopitch"];
        index["frames"][0]["bodies"] = (0..100).map(|person| serde_json::json!([person, 0])).collect();
        index["people"] = (0..100).map(|person| serde_json::json!({ "id": person, "anchors": 5 })).collect();
        let frame = index["frames"][0].clone();
        index["frames"] = (0..300i64)
            .map(|position| {
                let mut frame = frame.clone();
                frame["start"] = (position * 1001).into();
                frame
            })
            .collect();
    });
    let limits = Limits { decoded_bytes_per_chunk: 1 << 20, ..Limits::default() };
    assert!(decode(&many, &limits).is_err());

    // Accessors that promise as much as the limits allow, over Draco data that has far less.
    let boastful = with_json(&bytes, |document| {
        for accessor in document["accessors"].as_array_mut().unwrap() {
            if accessor["bufferView"].is_null() {
                accessor["count"] = if accessor["type"] == "SCALAR" { 150_000 } else { 50_000 }.into();
            }
        }
    });
    let error = decode(&boastful, &Limits::default()).unwrap_err().to_string();
    assert!(error.contains("person 0"), "{error}");
}

/// A chunk of one frame whose only content is the ball.
fn with_ball(ball: Ball) -> Chunk {
    let mut chunk = sample::chunk_of(0, 1, 0);
    chunk.frames[0].ball = Some(ball);
    chunk
}

#[test]
fn the_spread_of_the_ball_comes_back_and_older_streams_have_none() {
    let spread = BallSpread { along_m: 1.25, across_m: 0.0625 };
    let ball = Ball { position_m: DVec3::new(3.0, 2.0, -7.0), height_known: true, spread: Some(spread) };
    let bytes = encode(&with_ball(ball), sample::TIMESCALE).unwrap();
    let back = decode(&bytes, &Limits::default()).unwrap();
    assert_eq!(back.frames[0].ball.unwrap().spread, Some(spread));
    let older: Ball = serde_json::from_str(r#"{"position_m":[1,2,3],"height_known":false}"#).unwrap();
    assert_eq!(older.spread, None);
}

#[test]
fn a_ball_beyond_all_bounds_is_refused_on_both_ways() {
    let ball = |x: f64, along_m: f32| Ball {
        position_m: DVec3::new(x, 0.1, 0.0),
        height_known: true,
        spread: Some(BallSpread { along_m, across_m: 0.1 }),
    };
    for bad in [ball(1e300, 1.0), ball(f64::NAN, 1.0), ball(0.0, -1.0), ball(0.0, f32::NAN), ball(0.0, 1e9)] {
        let refused = encode(&with_ball(bad), sample::TIMESCALE);
        assert!(matches!(refused, Err(ChunkError::Frame { frame: 0, .. })), "{bad:?}");
    }
    // The same on the way in: the JSON of a good chunk with a number of the same length changed.
    let bytes = encode(&with_ball(ball(12.5, 0.25)), sample::TIMESCALE).unwrap();
    let text = b"12.5";
    let at = bytes.windows(text.len()).position(|window| window == text).unwrap();
    let mut hostile = bytes.clone();
    hostile[at..at + 4].copy_from_slice(b"1e30");
    let refused = decode(&hostile, &Limits::default());
    assert!(matches!(refused, Err(ChunkError::Frame { frame: 0, .. })), "{refused:?}");
}
