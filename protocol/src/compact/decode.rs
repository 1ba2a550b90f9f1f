//! A compact chunk, for files that anyone may have written: every count is checked against the limits and the bytes at hand before memory is
//! taken for it.

use std::collections::BTreeSet;

use glam::Vec3;
use serde::Deserialize;

use super::{
    EXTENSION,
    entropy::{DecoderTables, Reader},
    klt::Basis,
    motion::{self, Points},
    run::DecodedRun,
    texture::{self, Blocks, TILE_PX, TILE_VALUES},
    wire::{ANCHOR_STEP_M, FARTHEST_M, Head, Motion, RunHead},
};
use crate::{
    atlas::{self, Layout},
    chunk::{
        Atlas, BodyError, Budget, ChunkError, ChunkFrame, PixelImage, body_mesh, check_times,
        guessed_is_possible, is_finite, reference,
    },
    glb::Glb,
    gltf::{Accessor, BufferView, Mesh as GltfMesh},
    limits::Limits,
    manifest::PersonId,
};

/// Layout version written and read by this crate.
pub(super) const LAYOUT: u32 = 1;
/// Bytes of a head at most: that of the longest chunk with the most bodies that a reader takes has a third. Its lists take up to thirty times as
/// much memory.
const HEAD_BYTES: usize = 1 << 20;
/// Steps of points and of textures at most.
const LARGEST_STEP_M: f32 = 1.0;
const LARGEST_TEXTURE_STEP: f32 = 255.0;

/// The parts of the document that a reader needs.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Document {
    #[serde(default)]
    meshes: Vec<GltfMesh>,
    #[serde(default)]
    accessors: Vec<Accessor>,
    #[serde(default)]
    buffer_views: Vec<BufferView>,
    extensions: Option<Extensions>,
}

#[derive(Deserialize)]
struct Extensions {
    #[serde(rename = "HOLOPITCH_motion")]
    motion: Option<Extension>,
}

#[derive(Deserialize)]
struct Extension {
    layout: u32,
    head: usize,
    runs: Vec<[usize; 2]>,
}

/// How the bytes of a compact chunk divide.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ByteParts {
    /// Meshes at rest (Draco).
    pub rest: usize,
    /// How points and textures change.
    pub motion: usize,
    /// The head: frames, anchors, tables.
    pub head: usize,
    /// The document and padding.
    pub index: usize,
}

/// A decoded compact chunk: any of its frames can be made from it.
#[derive(Clone, Debug, PartialEq)]
pub struct CompactChunk {
    frames: Vec<ChunkFrame>,
    runs: Vec<DecodedRun>,
    atlas: Layout,
}

impl CompactChunk {
    /// Reads a compact chunk.
    ///
    /// # Errors
    /// When the file is not one, is corrupt, or exceeds `limits`.
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Self, ChunkError> {
        let file = open(bytes, limits)?;
        let head = file.head(limits)?;
        let tables = DecoderTables::new(&head.tables)?;
        let frames: Vec<ChunkFrame> = head.frames.into_iter().map(Into::into).collect();
        check_times(frames.iter().map(|frame| (frame.start, frame.duration)))?;
        if head.timescale.numerator == 0 || head.timescale.denominator == 0 {
            return Err(ChunkError::Corrupt { what: "timescale" });
        }
        if let Some(frame) = frames.iter().position(|frame| !is_finite(frame)) {
            let problem = "the camera or a figure is not a number, or the ball is nowhere near the pitch";
            return Err(ChunkError::Frame { frame, problem });
        }
        let mut budget = Budget::new(limits.decoded_bytes_per_chunk);
        let (mut seen, mut counts) = (BTreeSet::new(), vec![0usize; frames.len()]);
        let mut runs = Vec::with_capacity(head.runs.len());
        let mut sizes = Vec::with_capacity(head.runs.len());
        for (run, &listed) in head.runs.iter().zip(&file.extension.runs) {
            let (run, size) = file.run(run, listed, &tables, frames.len(), limits, &mut budget)?;
            for &frame in &run.frames {
                if !seen.insert((frame, run.person)) {
                    return Err(ChunkError::Frame { frame, problem: "a person has two bodies" });
                }
                let count = counts.get_mut(frame).ok_or(reference("frame", frame))?;
                *count += 1;
                ChunkError::check("bodies in a frame", *count, limits.bodies_per_frame)?;
            }
            runs.push(run);
            sizes.push(size);
        }
        let atlas = atlas::place(&sizes, 0, limits.texture_side_px);
        let atlas = atlas.ok_or(ChunkError::Corrupt { what: "size of the textures" })?;
        budget.spend((atlas.width as usize).saturating_mul(atlas.height as usize).saturating_mul(4))?;
        for (run, place) in runs.iter_mut().zip(&atlas.places) {
            run.move_to(place, &atlas);
        }
        Ok(Self { frames, runs, atlas })
    }

    /// The frames, without their bodies and atlases.
    #[must_use]
    pub fn frames(&self) -> &[ChunkFrame] {
        &self.frames
    }

    /// Frame `index` with its bodies and its atlas; `None` when there is no such frame.
    #[must_use]
    pub fn frame(&self, index: usize) -> Option<ChunkFrame> {
        let mut frame = self.frames.get(index)?.clone();
        let (width_px, height_px) = (self.atlas.width, self.atlas.height);
        let mut picture =
            PixelImage { width_px, height_px, rgba: vec![0; width_px as usize * height_px as usize * 4] };
        for (run, place) in self.runs.iter().zip(&self.atlas.places) {
            let Ok(at) = run.frames.binary_search(&index) else { continue };
            run.paint(at, place, &mut picture);
            frame.bodies.push(run.body(at));
        }
        frame.bodies.sort_by_key(|body| body.person);
        frame.atlas = (!frame.bodies.is_empty()).then_some(Atlas::Pixels(picture));
        Some(frame)
    }

    /// The texture of run `run` (in the order of the file) in its frame `at`, in its own size; `None` when there is no such frame.
    #[must_use]
    pub fn texture(&self, run: usize, at: usize) -> Option<PixelImage> {
        let (run, place) = (self.runs.get(run)?, self.atlas.places.get(run)?);
        run.frames.get(at)?;
        let whole = atlas::Place { x: 0, y: 0, ..*place };
        let mut tiles = PixelImage {
            width_px: place.width,
            height_px: place.height,
            rgba: vec![0; place.width as usize * place.height as usize * 4],
        };
        run.paint(at, &whole, &mut tiles);
        let [width, height] = run.texture_px;
        let rows = tiles.rgba.chunks_exact((place.width as usize * 4).max(1)).take(height);
        let rgba = rows.flat_map(|row| row.iter().take(width * 4)).copied().collect();
        Some(PixelImage { width_px: width as u32, height_px: height as u32, rgba })
    }
}

/// Says how the bytes of a compact chunk divide, without decoding geometry.
///
/// # Errors
/// As [`CompactChunk::decode`], as far as it reads.
pub fn byte_parts(bytes: &[u8], limits: &Limits) -> Result<ByteParts, ChunkError> {
    let file = open(bytes, limits)?;
    let mut parts = ByteParts { head: file.view(file.extension.head)?.len(), ..ByteParts::default() };
    for &[mesh, motion] in &file.extension.runs {
        parts.motion = parts.motion.saturating_add(file.view(motion)?.len());
        let primitives = file.document.meshes.get(mesh).into_iter().flat_map(|mesh| &mesh.primitives);
        for draco in primitives.filter_map(|primitive| primitive.extensions.as_ref()?.draco.as_ref()) {
            parts.rest = parts.rest.saturating_add(file.view(draco.buffer_view)?.len());
        }
    }
    let told = parts.head.saturating_add(parts.motion).saturating_add(parts.rest);
    parts.index = bytes.len().saturating_sub(told);
    Ok(parts)
}

/// An opened file: the document understood, the binary part at hand.
struct File<'a> {
    document: Document,
    extension: Extension,
    bin: &'a [u8],
}

fn open<'a>(bytes: &'a [u8], limits: &Limits) -> Result<File<'a>, ChunkError> {
    ChunkError::check("bytes", bytes.len(), limits.chunk_bytes)?;
    let Glb { json, bin } = Glb::parse(bytes)?;
    ChunkError::check("bytes of JSON", json.len(), limits.chunk_json_bytes)?;
    let mut document: Document =
        serde_json::from_slice(json).map_err(|error| ChunkError::Json { message: error.to_string() })?;
    let Some(extension) = document.extensions.take().and_then(|extensions| extensions.motion) else {
        return Err(ChunkError::Json { message: format!("it has no extension {EXTENSION}") });
    };
    if extension.layout != LAYOUT {
        return Err(ChunkError::Version { found: extension.layout, known: LAYOUT });
    }
    Ok(File { document, extension, bin })
}

impl<'a> File<'a> {
    /// The bytes of a buffer view.
    fn view(&self, index: usize) -> Result<&'a [u8], ChunkError> {
        let view = self.document.buffer_views.get(index).ok_or(reference("buffer view", index))?;
        view.of(self.bin).ok_or(reference("buffer view", index))
    }

    fn head(&self, limits: &Limits) -> Result<Head, ChunkError> {
        let bytes = self.view(self.extension.head)?;
        ChunkError::check("bytes of the head", bytes.len(), HEAD_BYTES)?;
        let head: Head = postcard::from_bytes(bytes).map_err(|_| ChunkError::Corrupt { what: "head" })?;
        ChunkError::check("frames", head.frames.len(), limits.frames_per_chunk)?;
        if head.frames.is_empty() {
            return Err(ChunkError::Empty);
        }
        if head.runs.len() != self.extension.runs.len() {
            return Err(ChunkError::Corrupt { what: "list of runs" });
        }
        ChunkError::check(
            "runs",
            head.runs.len(),
            limits.bodies_per_frame.saturating_mul(head.frames.len()),
        )?;
        Ok(head)
    }

    /// A run and the size of its texture in whole tiles, pixels.
    fn run(
        &self,
        head: &RunHead,
        [mesh, motion]: [usize; 2],
        tables: &DecoderTables,
        frame_count: usize,
        limits: &Limits,
        budget: &mut Budget,
    ) -> Result<(DecodedRun, (u32, u32)), ChunkError> {
        let person = PersonId(head.person);
        let frames =
            places(&head.frames, frame_count).ok_or(ChunkError::Corrupt { what: "list of frames" })?;
        let first = frames.first().copied().unwrap_or_default();
        let anchors_m =
            anchors(&head.anchors, frames.len()).ok_or(ChunkError::Corrupt { what: "anchors" })?;
        if !guessed_is_possible(head.guessed_from_u) {
            return Err(ChunkError::Frame {
                frame: first,
                problem: "what is guessed of a body is not on its texture",
            });
        }
        let document_mesh = self.document.meshes.get(mesh).ok_or(reference("mesh", mesh))?;
        let mesh =
            body_mesh(document_mesh, &self.document.accessors, |index| self.view(index), limits, budget)
                .map_err(|error| match error {
                    BodyError::Chunk(error) => error,
                    BodyError::Problem(problem) => ChunkError::Body { frame: first, person, problem },
                })?;
        let wire: Motion<'_> =
            postcard::from_bytes(self.view(motion)?).map_err(|_| ChunkError::Corrupt { what: "motion" })?;
        // Not a number is no step either.
        let possible = |step: f32, largest: f32| step > 0.0 && step <= largest;
        if !possible(wire.point_step_m, LARGEST_STEP_M) || !possible(wire.texture_step, LARGEST_TEXTURE_STEP)
        {
            return Err(ChunkError::Corrupt { what: "size of a step" });
        }
        let point_waves = waves(wire.point_waves, frames.len())?;
        let texture_waves = waves(wire.texture_waves, frames.len())?;
        let points = Points::of(&mesh);
        let [width, height] = head.texture_px.map(usize::from);
        let side = limits.texture_side_px as usize;
        ChunkError::check("pixels along a texture", width.max(height), side)?;
        let (columns, rows) = (width.div_ceil(TILE_PX), height.div_ceil(TILE_PX));
        // The atlas will hold it, and the list of tiles is no larger.
        budget.spend(columns * rows * TILE_PX * TILE_PX * 4)?;
        let tiles =
            stored_tiles(wire.tiles, columns * rows).ok_or(ChunkError::Corrupt { what: "list of tiles" })?;
        let values = |waves: usize, each: usize| waves.saturating_mul(each).saturating_mul(4);
        budget.spend(values(point_waves.waves(), points.count() * 3))?;
        budget.spend(values(texture_waves.waves(), tiles.len() * TILE_VALUES))?;
        let mut reader = Reader::new(wire.coded, tables)?;
        let mut point_shares = Vec::with_capacity(point_waves.waves() * points.count());
        for wave in 0..point_waves.waves() {
            let steps = motion::read(&mut reader, &points, wave)?;
            point_shares
                .extend(steps.iter().map(|share| share.map(|steps| steps as f32 * wire.point_step_m)));
        }
        let mut texture_shares = vec![0.0; texture_waves.waves() * tiles.len() * TILE_VALUES];
        let mut filled = vec![false; texture_waves.waves() * tiles.len()];
        let mut blocks = texture_shares.as_chunks_mut::<64>().0.iter_mut().enumerate();
        for wave in 0..texture_waves.waves() {
            let mut coded = Blocks::of_wave(wave);
            for (block, out) in blocks.by_ref().take(tiles.len() * (TILE_VALUES / 64)) {
                let (steps, end) = coded.read(&mut reader, block % (TILE_VALUES / 64))?;
                if steps[0] != 0 || end > 1 {
                    texture::picture(&steps, end, wire.texture_step, out);
                    if let Some(filled) = filled.get_mut(block / (TILE_VALUES / 64)) {
                        *filled = true;
                    }
                }
            }
        }
        if !reader.is_done() {
            return Err(ChunkError::Corrupt { what: "motion" });
        }
        let whole = ((columns * TILE_PX) as u32, (rows * TILE_PX) as u32);
        let scale = [width as f32 / whole.0.max(1) as f32, height as f32 / whole.1.max(1) as f32];
        let mut run = DecodedRun {
            person,
            frames,
            anchors_m,
            guessed_from_u: head.guessed_from_u,
            mesh,
            of_vertex: points.of_vertex,
            point_waves,
            point_shares,
            texture_waves,
            texture_px: [width, height],
            columns,
            tiles,
            texture_shares,
            filled,
        };
        run.scale_uvs(|[u, v]| [u * scale[0], v * scale[1]]);
        Ok((run, whole))
    }
}

/// First place and steps to places; `None` when they do not rise or leave the chunk.
fn places(steps: &[u16], frame_count: usize) -> Option<Vec<usize>> {
    let mut places: Vec<usize> = Vec::with_capacity(steps.len().min(frame_count));
    for step in steps {
        let place = places.last().copied().unwrap_or(0) + usize::from(*step);
        if place >= frame_count || (*step == 0 && !places.is_empty()) {
            return None;
        }
        places.push(place);
    }
    (!places.is_empty()).then_some(places)
}

/// First anchor and differences to anchors, metres.
fn anchors(steps: &[[i32; 3]], count: usize) -> Option<Vec<Vec3>> {
    let mut here = [0i32; 3];
    let mut anchors = Vec::with_capacity(count);
    for step in steps {
        for axis in 0..3 {
            here[axis] = here[axis].checked_add(step[axis])?;
        }
        anchors.push(Vec3::from(here.map(|steps| steps as f32 * ANCHOR_STEP_M)));
    }
    let near = anchors.iter().all(|anchor| anchor.abs().max_element() <= FARTHEST_M);
    (near && anchors.len() == count).then_some(anchors)
}

/// Waves over `frames` frames; no more than there are frames.
fn waves(values: Vec<i16>, frames: usize) -> Result<Basis, ChunkError> {
    if !values.len().is_multiple_of(frames.max(1)) || values.len() / frames.max(1) > frames {
        return Err(ChunkError::Corrupt { what: "waves" });
    }
    Ok(Basis { frames, values })
}

/// The places of the tiles whose bit is set.
fn stored_tiles(bits: &[u8], count: usize) -> Option<Vec<usize>> {
    (bits.len() == count.div_ceil(8))
        .then(|| (0..count).filter(|tile| bits[tile / 8] >> (tile % 8) & 1 == 1).collect())
}
