//! A sequence to a compact chunk.

use std::collections::BTreeSet;

use super::{
    EXTENSION, Run, Sequence,
    entropy::{EncoderTables, Recorder, tables},
    klt::Basis,
    motion::{self, Points},
    texture::{self, Blocks, TILE_PX, TILE_VALUES},
    wire::{ANCHOR_STEP_M, FARTHEST_M, Head, Motion, RunHead},
};
use crate::{
    chunk::{ChunkError, PixelImage, Quantisation, check_frames, draco, draco_mesh},
    gltf::{Builder, DRACO, Material, Node, Scene, UNLIT},
    mesh::Mesh,
    time::Timescale,
};

/// How much may be lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Rounding of the mesh at rest.
    pub rest: Quantisation,
    /// Step of the points' shares of a wave, metres. Positions are off by about a fifth of it, root mean square.
    pub point_step_m: f32,
    /// Step of the texture's shares of a wave, of 255.
    pub texture_step: f32,
}

impl Quality {
    /// The best of the ladder.
    pub const HIGH: Self = Self {
        rest: Quantisation { position_bits: 10, uv_bits: 10 },
        point_step_m: 0.012,
        texture_step: 12.0,
    };
}

/// Added to a texture's value, in steps, before it is rounded down: less than a half, so that small ones become nothing (a dead zone), which saves
/// more bits than it costs accuracy.
const TEXTURE_ROUNDING: f32 = 0.3;
/// Room round a triangle in which its texture is read when it is drawn smaller, pixels.
const MARGIN_PX: f32 = 2.0;

/// Writes a compact chunk.
///
/// # Errors
/// When the sequence is empty or out of order, or a run does not fit together or cannot be stored.
pub fn encode(sequence: &Sequence, timescale: Timescale, quality: &Quality) -> Result<Vec<u8>, ChunkError> {
    check_frames(&sequence.frames)?;
    check_runs(sequence)?;
    let runs = sequence.runs.iter().map(|run| Packed::new(run, quality)).collect::<Result<Vec<_>, _>>()?;
    let recorders: Vec<&Recorder> = runs.iter().map(|run| &run.recorder).collect();
    let tables = tables(&recorders);
    let encoder = EncoderTables::new(&tables)?;
    let head = Head {
        timescale,
        frames: sequence.frames.iter().map(Into::into).collect(),
        runs: sequence.runs.iter().map(run_head).collect::<Result<_, _>>()?,
        tables,
    };
    let mut builder = Builder::default();
    let head = builder.view(&to_bytes(&head)?, None);
    let mut nodes = Vec::with_capacity(runs.len());
    let mut listed = Vec::with_capacity(runs.len());
    for (run, packed) in sequence.runs.iter().zip(&runs) {
        let colour = run.colour.map(|channel| (f32::from(channel) / 255.0).powf(2.2));
        let colour = [colour[0], colour[1], colour[2], 1.0];
        let document = &mut builder.document;
        document.materials.push(Material::unlit(String::new(), Some(colour), None));
        let material = document.materials.len() - 1;
        let mesh = draco_mesh(&mut builder, &packed.draco, &packed.rest, material);
        let motion = Motion {
            coded: &packed.recorder.finish(&encoder)?,
            tiles: &packed.tiles,
            ..packed.motion.clone()
        };
        let motion = builder.view(&to_bytes(&motion)?, None);
        let document = &mut builder.document;
        document.nodes.push(Node {
            name: format!("person-{:03}", run.person.0),
            mesh: Some(mesh),
            translation: run.anchors_m.get(packed.middle).map(|anchor| anchor.to_array()),
            ..Node::default()
        });
        nodes.push(document.nodes.len() - 1);
        listed.push([mesh, motion]);
    }
    let document = &mut builder.document;
    document.scenes = vec![Scene { name: Some("match".to_owned()), nodes, extras: None }];
    document.extensions_used = vec![EXTENSION];
    if !runs.is_empty() {
        document.extensions_used.extend([DRACO, UNLIT]);
        document.extensions_required = vec![DRACO];
    }
    document.extensions = Some(
        serde_json::json!({ EXTENSION: { "layout": super::decode::LAYOUT, "head": head, "runs": listed } }),
    );
    Ok(builder.finish()?)
}

fn to_bytes(value: &impl serde::Serialize) -> Result<Vec<u8>, ChunkError> {
    postcard::to_allocvec(value).map_err(|error| ChunkError::Json { message: error.to_string() })
}

/// What would come out as something else is refused.
fn check_runs(sequence: &Sequence) -> Result<(), ChunkError> {
    let mut seen = BTreeSet::new();
    for run in &sequence.runs {
        let first = run.frames.first().copied().unwrap_or_default();
        let problem = |problem: &str| ChunkError::Body {
            frame: first,
            person: run.person,
            problem: problem.to_owned(),
        };
        let (frames, vertices) = (run.frames.len(), run.mesh.positions_m.len());
        if frames == 0
            || !run.frames.is_sorted_by(|a, b| a < b)
            || run.frames.iter().any(|&frame| frame >= sequence.frames.len())
        {
            return Err(problem("its frames are none, out of order, or not in the chunk"));
        }
        if run.anchors_m.len() != frames || run.positions_m.len() != frames || run.textures.len() != frames {
            return Err(problem("not every frame has an anchor, positions and a texture"));
        }
        if !run.frames.iter().all(|frame| seen.insert((*frame, run.person))) {
            return Err(problem("the person has two bodies in a frame"));
        }
        let finite =
            |positions: &Vec<[f32; 3]>| positions.as_flattened().iter().all(|value| value.is_finite());
        if run.positions_m.iter().any(|positions| positions.len() != vertices || !finite(positions))
            || !run
                .anchors_m
                .iter()
                .all(|anchor| anchor.is_finite() && anchor.abs().max_element() < FARTHEST_M)
        {
            return Err(problem("a position is missing or not a number, or an anchor is nowhere near"));
        }
        let size = |texture: &PixelImage| (texture.width_px, texture.height_px);
        let one = run.textures.first().map(size).unwrap_or_default();
        let whole = |texture: &PixelImage| {
            size(texture) == one && texture.rgba.len() as u64 == u64::from(one.0) * u64::from(one.1) * 4
        };
        if one.0 == 0 || one.1 == 0 || one.0.max(one.1) > 4096 || !run.textures.iter().all(whole) {
            return Err(problem("its textures differ in size, or are empty or larger than 4096 pixels"));
        }
        if !crate::chunk::guessed_is_possible(run.guessed_from_u) {
            return Err(problem("what is guessed of it does not begin on its texture"));
        }
    }
    Ok(())
}

fn run_head(run: &Run) -> Result<RunHead, ChunkError> {
    let mut frames = Vec::with_capacity(run.frames.len());
    let (mut last_frame, mut last) = (0, [0; 3]);
    let mut anchors = Vec::with_capacity(run.anchors_m.len());
    for (frame, anchor) in run.frames.iter().zip(&run.anchors_m) {
        let step = u16::try_from(frame - last_frame);
        frames.push(step.map_err(|_| ChunkError::Limit {
            what: "frames",
            found: *frame as u64,
            limit: u64::from(u16::MAX),
        })?);
        last_frame = *frame;
        let here = anchor.to_array().map(|value| (value / ANCHOR_STEP_M).round() as i32);
        anchors.push([0, 1, 2].map(|axis| here[axis] - last[axis]));
        last = here;
    }
    let texture = run.textures.first();
    let side = |side: u32| u16::try_from(side).unwrap_or(u16::MAX);
    Ok(RunHead {
        person: run.person.0,
        frames,
        anchors,
        texture_px: texture
            .map(|texture| [side(texture.width_px), side(texture.height_px)])
            .unwrap_or_default(),
        guessed_from_u: run.guessed_from_u,
    })
}

/// A run that waits for the chunk's tables.
struct Packed {
    draco: Vec<u8>,
    rest: Mesh,
    /// The frame that stands for the run where only one is shown.
    middle: usize,
    motion: Motion<'static>,
    tiles: Vec<u8>,
    recorder: Recorder,
}

impl Packed {
    fn new(run: &Run, quality: &Quality) -> Result<Self, ChunkError> {
        let first = run.frames.first().copied().unwrap_or_default();
        let fail = |problem| ChunkError::Body { frame: first, person: run.person, problem };
        let draco = draco::encode(&run.mesh, quality.rest).map_err(fail)?;
        let rest = draco::decode_own(&draco).map_err(fail)?;
        let mut recorder = Recorder::default();
        let point_waves = points(run, &rest, quality.point_step_m, &mut recorder);
        let (texture_waves, tiles) = colours(run, &rest, quality.texture_step, &mut recorder);
        let motion = Motion {
            point_step_m: quality.point_step_m,
            texture_step: quality.texture_step,
            point_waves,
            texture_waves,
            tiles: &[],
            coded: &[],
        };
        Ok(Self { draco, rest, middle: run.frames.len() / 2, motion, tiles, recorder })
    }
}

/// The vertex of the mesh that each vertex of its rounded copy is: the codec reorders them. The nearest one, a body being about as large as its
/// texture is wide.
fn originals(mesh: &Mesh, rounded: &Mesh) -> Vec<usize> {
    let places = |mesh: &Mesh| -> Vec<[f32; 5]> {
        let both = mesh.positions_m.iter().zip(&mesh.uvs);
        both.map(|([x, y, z], [u, v])| [*x, *y, *z, *u, *v]).collect()
    };
    let given = places(mesh);
    let nearest = |here: &[f32; 5]| {
        let apart = |there: &[f32; 5]| (0..5).map(|axis| (here[axis] - there[axis]).powi(2)).sum::<f32>();
        let distances = given.iter().map(apart).enumerate();
        distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(vertex, _)| vertex)
    };
    places(rounded).iter().map(nearest).collect()
}

/// Records the points' shares; returns the values of their waves.
fn points(run: &Run, rest: &Mesh, step_m: f32, recorder: &mut Recorder) -> Vec<i16> {
    let points = Points::of(rest);
    let originals = originals(&run.mesh, rest);
    let series: Vec<Vec<f32>> = run
        .positions_m
        .iter()
        .map(|positions| {
            let moved = points.first_vertex.iter().flat_map(|&vertex| {
                let at = rest.positions_m.get(vertex as usize).copied().unwrap_or_default();
                let original = originals.get(vertex as usize).copied().unwrap_or_default();
                let now = positions.get(original).copied().unwrap_or(at);
                [0, 1, 2].map(|axis| now[axis] - at[axis])
            });
            moved.collect()
        })
        .collect();
    let basis = Basis::of(&series);
    let mut waves = 0;
    for wave in 0..basis.waves() {
        let shares = basis.shares(wave, &series);
        let steps: Vec<[i32; 3]> = shares
            .as_chunks::<3>()
            .0
            .iter()
            .map(|share| share.map(|value| (value / step_m).round() as i32))
            .collect();
        if steps.as_flattened().iter().all(|step| *step == 0) {
            break;
        }
        motion::write(recorder, &points, wave, &steps);
        waves = wave + 1;
    }
    basis.first(waves).values
}

/// Records the texture's shares; returns the values of its waves and which tiles are stored.
fn colours(run: &Run, rest: &Mesh, step: f32, recorder: &mut Recorder) -> (Vec<i16>, Vec<u8>) {
    let Some(first) = run.textures.first() else { return (Vec::new(), Vec::new()) };
    let (width, height) = (first.width_px as usize, first.height_px as usize);
    let (columns, rows) = (width.div_ceil(TILE_PX), height.div_ceil(TILE_PX));
    let covered = covered(rest, width, height);
    let places: Vec<usize> = (0..columns * rows).filter(|tile| covered[*tile]).collect();
    let series: Vec<Vec<f32>> = run
        .textures
        .iter()
        .map(|texture| {
            let tile = |&place: &usize| {
                texture::tile(|x, y| {
                    let (x, y) = (place % columns * TILE_PX + x, place / columns * TILE_PX + y);
                    let at = (y.min(height - 1) * width + x.min(width - 1)) * 4;
                    texture.rgba.get(at..at + 3).map_or([0; 3], |rgb| [rgb[0], rgb[1], rgb[2]])
                })
            };
            places.iter().flat_map(tile).collect()
        })
        .collect();
    let basis = Basis::of(&series);
    let mut waves = 0;
    for wave in 0..basis.waves() {
        let shares = basis.shares(wave, &series);
        let steps: Vec<[i32; 64]> =
            shares.as_chunks::<64>().0.iter().map(|block| rounded(&texture::forward(block), step)).collect();
        if steps.as_flattened().iter().all(|step| *step == 0) {
            break;
        }
        let mut blocks = Blocks::of_wave(wave);
        for (index, steps) in steps.iter().enumerate() {
            blocks.write(recorder, index % (TILE_VALUES / 64), steps);
        }
        waves = wave + 1;
    }
    let mut tiles = vec![0u8; (columns * rows).div_ceil(8)];
    for place in places {
        tiles[place / 8] |= 1 << (place % 8);
    }
    (basis.first(waves).values, tiles)
}

fn rounded(block: &[f32; 64], step: f32) -> [i32; 64] {
    block.map(|value| ((value.abs() / step + TEXTURE_ROUNDING).floor() as i32) * value.signum() as i32)
}

/// The tiles of a texture that a triangle of the mesh may read.
fn covered(mesh: &Mesh, width: usize, height: usize) -> Vec<bool> {
    let (columns, rows) = (width.div_ceil(TILE_PX), height.div_ceil(TILE_PX));
    let mut covered = vec![false; columns * rows];
    for corners in &mesh.triangles {
        let corner = |vertex: u32| mesh.uvs.get(vertex as usize).copied().unwrap_or_default();
        let uvs = corners.map(corner);
        let tiles = |axis: usize, side: usize, count: usize| {
            let along = uvs.map(|uv| uv[axis] * side as f32);
            let low = along.into_iter().fold(f32::INFINITY, f32::min) - MARGIN_PX;
            let high = along.into_iter().fold(f32::NEG_INFINITY, f32::max) + MARGIN_PX;
            let tile = |value: f32| ((value / TILE_PX as f32) as usize).min(count - 1);
            tile(low)..=tile(high)
        };
        for row in tiles(1, height, rows) {
            for column in tiles(0, width, columns) {
                covered[row * columns + column] = true;
            }
        }
    }
    covered
}
