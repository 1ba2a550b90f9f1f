//! A tiny match of walking box people, for tests and for trying a player without a clip.
//!
//! Everything is computed from the frame and the person's number, so a test can say where anybody stands.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use crate::{
    camera::Camera,
    chunk::{
        Atlas, Ball, Body, Chunk, ChunkError, ChunkFrame, EncodedImage, FrameQuality, ImageFormat,
        PixelImage, encode,
    },
    compact::{Run, Sequence},
    hash,
    manifest::{ChunkEntry, FORMAT, Manifest, Person, PersonId, Profile, Representation, VERSION},
    mesh::Mesh,
    pitch::Pitch,
    time::{Ticks, Timescale},
};

/// 30000/1001 frames per second: the awkward one.
pub const TIMESCALE: Timescale = Timescale { numerator: 30_000, denominator: 1 };
/// Ticks of one frame.
pub const FRAME: Ticks = Ticks(1001);
/// Frames in a chunk.
pub const FRAMES_PER_CHUNK: u32 = 30;
/// The clip frame that the match starts at.
pub const FIRST_CLIP_FRAME: u32 = 150;
/// Side of one person's tile of the atlas, pixels.
const TILE_PX: u32 = 16;

/// A whole stream in memory.
#[derive(Clone, Debug)]
pub struct SampleMatch {
    /// The manifest.
    pub manifest: Manifest,
    /// Every other file by its path relative to the manifest.
    pub files: BTreeMap<String, Vec<u8>>,
}

/// A match of `frames` frames with `people` people, two teams.
///
/// # Errors
/// When a chunk cannot be encoded, for example because `frames` is 0.
pub fn match_of(frames: u32, people: u32) -> Result<SampleMatch, ChunkError> {
    let mut files = BTreeMap::new();
    let mut chunks = Vec::new();
    if frames == 0 {
        return Err(ChunkError::Empty);
    }
    for (index, first) in (0..frames).step_by(FRAMES_PER_CHUNK as usize).enumerate() {
        let chunk = chunk_of(first, FRAMES_PER_CHUNK.min(frames - first), people);
        let bytes = encode(&chunk, TIMESCALE)?;
        let path = format!("high/{index:05}.glb");
        let (start, end) = chunk.span().ok_or(ChunkError::Empty)?;
        chunks.push(ChunkEntry { file: hash::entry(path.clone(), &bytes), start, duration: end - start });
        files.insert(path, bytes);
    }
    let manifest = Manifest {
        format: FORMAT.to_owned(),
        version: VERSION.to_owned(),
        timescale: TIMESCALE,
        duration: Ticks(i64::from(frames) * FRAME.0),
        pitch: Pitch::default(),
        static_scene: None,
        people: (0..people).map(person).collect(),
        segments: Vec::new(),
        live: None,
        representations: vec![Representation {
            id: "high".to_owned(),
            profile: Profile::Plain,
            triangles_per_body: 72,
            chunks,
        }],
    };
    Ok(SampleMatch { manifest, files })
}

/// Frames `first .. first + count` of the match.
#[must_use]
pub fn chunk_of(first: u32, count: u32, people: u32) -> Chunk {
    Chunk { frames: (first..first + count).map(|frame| frame_of(frame, people)).collect() }
}

/// The same frames as runs, as the compact profile takes them.
#[must_use]
pub fn sequence_of(first: u32, count: u32, people: u32) -> Sequence {
    let frames: Vec<ChunkFrame> = (first..first + count).map(|frame| frame_of(frame, people)).collect();
    let column = |person: u32| {
        let pixels = (0..3 * TILE_PX * TILE_PX).flat_map(|pixel| {
            let [r, g, b] = colour(pixel / TILE_PX / TILE_PX, person);
            [r, g, b, 255]
        });
        PixelImage { width_px: TILE_PX, height_px: 3 * TILE_PX, rgba: pixels.collect() }
    };
    let run = |person: u32| {
        let bodies: Vec<&Body> =
            frames.iter().filter_map(|frame| frame.bodies.get(person as usize)).collect();
        let mut mesh = mesh_of(first, person, people);
        // From the atlas of all to one's own column.
        mesh.uvs.iter_mut().for_each(|uv| uv[0] = (uv[0] * people as f32 - person as f32).clamp(0.0, 1.0));
        Run {
            person: PersonId(person),
            frames: (0..count as usize).collect(),
            anchors_m: bodies.iter().map(|body| body.anchor_m).collect(),
            positions_m: bodies.iter().map(|body| body.mesh.positions_m.clone()).collect(),
            textures: vec![column(person); count as usize],
            guessed_from_u: None,
            colour: shirt(person),
            mesh,
        }
    };
    let runs = (0..people).map(run).collect();
    let bare = |frame: &ChunkFrame| ChunkFrame { atlas: None, bodies: Vec::new(), ..frame.clone() };
    Sequence { frames: frames.iter().map(bare).collect(), runs }
}

/// Frame `frame` of the match.
#[must_use]
pub fn frame_of(frame: u32, people: u32) -> ChunkFrame {
    let ball = anchor_of(frame, 0).as_dvec3() + DVec3::new(0.6, 0.11, 0.0);
    ChunkFrame {
        clip_frame: FIRST_CLIP_FRAME + frame,
        start: Ticks(i64::from(frame) * FRAME.0),
        duration: FRAME,
        camera: Some(Camera::looking_at((1280, 720), 1400.0, DVec3::new(0.0, 18.0, 75.0), ball)),
        quality: FrameQuality { line_residual_px: Some(1.25), track_confidence: Some(0.75) },
        ball: Some(Ball { position_m: ball, height_known: false, spread: None }),
        atlas: (people > 0).then(|| Atlas::Encoded(atlas(people))),
        bodies: (0..people)
            .map(|person| Body {
                person: PersonId(person),
                anchor_m: anchor_of(frame, person),
                mesh: mesh_of(frame, person, people),
                guessed_from_u: None,
            })
            .collect(),
    }
}

/// Where person `person` stands in frame `frame`, world metres: on a line across the pitch, walking along x.
#[must_use]
pub fn anchor_of(frame: u32, person: u32) -> Vec3 {
    let direction = if person.is_multiple_of(2) { 1.0 } else { -1.0 };
    let walked = 0.06 * frame as f32;
    Vec3::new(direction * (walked - 20.0) + 1.5 * (person / 2) as f32, 0.0, 3.0 * (person % 11) as f32 - 15.0)
}

fn person(index: u32) -> Person {
    let home = index.is_multiple_of(2);
    Person {
        id: PersonId(index),
        team: Some(if home { "home" } else { "away" }.to_owned()),
        team_confidence: None,
        role: Some("player".to_owned()),
        role_confidence: None,
        number: u8::try_from(index / 2 + 1).ok(),
        number_confidence: None,
        shirt_rgb: Some(shirt(index)),
    }
}

/// Of a row of a person's column: skin, shirt, shorts.
fn colour(row: u32, person: u32) -> [u8; 3] {
    match row {
        0 => [205, 150, 120],
        1 => shirt(person),
        _ => [235, 235, 240],
    }
}

fn shirt(person: u32) -> [u8; 3] {
    if person.is_multiple_of(2) { [200, 30, 40] } else { [40, 70, 200] }
}

/// Legs, trunk, arms and head, as boxes; the legs and arms swing.
fn mesh_of(frame: u32, person: u32, people: u32) -> Mesh {
    let swing = 0.25 * (0.35 * frame as f32 + person as f32).sin();
    let mut mesh = Mesh::default();
    let tile = |row: f32| {
        let u = (person as f32 + 0.5) / people as f32;
        [u, (row + 0.5) / 3.0]
    };
    // Middle, half size, row of the tile: 0 skin, 1 shirt, 2 shorts.
    let parts = [
        (Vec3::new(swing, 0.4, 0.1), Vec3::new(0.08, 0.4, 0.07), 2.0),
        (Vec3::new(-swing, 0.4, -0.1), Vec3::new(0.08, 0.4, 0.07), 2.0),
        (Vec3::new(0.0, 1.1, 0.0), Vec3::new(0.12, 0.32, 0.2), 1.0),
        (Vec3::new(-swing, 1.1, 0.27), Vec3::new(0.05, 0.3, 0.05), 1.0),
        (Vec3::new(swing, 1.1, -0.27), Vec3::new(0.05, 0.3, 0.05), 1.0),
        (Vec3::new(0.0, 1.62, 0.0), Vec3::new(0.1, 0.13, 0.09), 0.0),
    ];
    for (middle, half, row) in parts {
        push_box(&mut mesh, middle, half, tile(row));
    }
    mesh
}

/// Eight corners, twelve triangles, counter-clockwise from outside; a little of the tile around `uv`.
fn push_box(mesh: &mut Mesh, middle: Vec3, half: Vec3, uv: [f32; 2]) {
    let base = mesh.positions_m.len() as u32;
    for corner in 0..8u32 {
        let sign = |bit: u32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
        let offset = Vec3::new(sign(0), sign(1), sign(2));
        mesh.positions_m.push((middle + half * offset).to_array());
        mesh.uvs.push([uv[0] + 0.001 * offset.x, uv[1] + 0.05 * offset.y]);
    }
    let faces: [[u32; 4]; 6] =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    for [a, b, c, d] in faces {
        mesh.triangles.push([base + a, base + b, base + c]);
        mesh.triangles.push([base + a, base + c, base + d]);
    }
}

/// One column of three tiles per person: skin, shirt, shorts.
fn atlas(people: u32) -> EncodedImage {
    let (width, height) = (people * TILE_PX, 3 * TILE_PX);
    let mut pixels = Vec::with_capacity((width * height * 3) as usize);
    for row in 0..height {
        for column in 0..width {
            pixels.extend(colour(row / TILE_PX, column / TILE_PX));
        }
    }
    let mut bytes = Vec::new();
    // Writing to memory fails only for a size that does not match, which the loops above rule out.
    let written = PngEncoder::new(&mut bytes).write_image(&pixels, width, height, ExtendedColorType::Rgb8);
    debug_assert!(written.is_ok(), "{written:?}");
    EncodedImage { format: ImageFormat::Png, bytes }
}
