//! GLB to chunk, for files that anyone may have written: every count is checked against the limits and the bytes at
//! hand before memory is taken for it.

use std::collections::BTreeSet;

use glam::Vec3;
use serde::Deserialize;

use super::{
    Atlas, Body, Chunk, ChunkError, ChunkFrame, EncodedImage, ImageFormat, draco, guessed_is_possible,
    index::{ChunkIndex, LAYOUT, PersonTrack, SceneExtras},
};
use crate::{
    glb::Glb,
    gltf::{Accessor, BufferView, Image, Mesh, component},
    limits::Limits,
    time::Ticks,
};

/// The parts of the document that a reader needs.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Document {
    #[serde(default)]
    scene: usize,
    scenes: Vec<Scene>,
    #[serde(default)]
    meshes: Vec<Mesh>,
    #[serde(default)]
    accessors: Vec<Accessor>,
    #[serde(default)]
    buffer_views: Vec<BufferView>,
    #[serde(default)]
    images: Vec<Image>,
}

#[derive(Deserialize)]
struct Scene {
    extras: Option<SceneExtras>,
}

/// How the bytes of a chunk divide.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ByteSplit {
    /// Draco geometry.
    pub geometry: usize,
    /// Pictures.
    pub texture: usize,
    /// Everything else: document, animation, padding.
    pub index: usize,
    /// Bodies in all frames together.
    pub bodies: usize,
}

/// Reads a chunk.
///
/// # Errors
/// When the file is not a Holopitch chunk, is corrupt, or exceeds `limits`.
pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Chunk, ChunkError> {
    let file = File::open(bytes, limits)?;
    let index = &file.index;
    ChunkError::check("frames", index.frames.len(), limits.frames_per_chunk)?;
    if index.frames.is_empty() {
        return Err(ChunkError::Empty);
    }
    check_times(index.frames.iter().map(|frame| (frame.start, frame.duration)))?;
    let mut budget = Budget::new(limits.decoded_bytes_per_chunk);
    let mut frames = Vec::with_capacity(index.frames.len());
    for (position, entry) in index.frames.iter().enumerate() {
        ChunkError::check("bodies in a frame", entry.bodies.len(), limits.bodies_per_frame)?;
        let atlas = entry.image.map(|image| file.image(image, limits, &mut budget)).transpose()?;
        let mut bodies = Vec::with_capacity(entry.bodies.len());
        let mut seen = BTreeSet::new();
        let guessed = &entry.guessed_from_u;
        if !(guessed.is_empty() || guessed.len() == entry.bodies.len())
            || !guessed.iter().copied().all(guessed_is_possible)
        {
            let problem = "what is guessed of its bodies is not told for each";
            return Err(ChunkError::Frame { frame: position, problem });
        }
        for (place, &[person, mesh]) in entry.bodies.iter().enumerate() {
            let track = index.people.get(person).ok_or(reference("person", person))?;
            if !seen.insert(track.id) {
                return Err(ChunkError::Frame { frame: position, problem: "a person has two bodies" });
            }
            let guessed_from_u = guessed.get(place).copied().flatten();
            let body = file.body(position, *track, mesh, limits, &mut budget)?;
            bodies.push(Body { guessed_from_u, ..body });
        }
        if !entry.ball.is_none_or(|ball| ball.is_possible()) {
            return Err(ChunkError::Frame { frame: position, problem: "the ball is nowhere near the pitch" });
        }
        frames.push(ChunkFrame {
            clip_frame: entry.clip_frame,
            start: entry.start,
            duration: entry.duration,
            camera: entry.camera.as_deref().copied(),
            quality: entry.quality,
            ball: entry.ball,
            atlas: atlas.map(Atlas::Encoded),
            bodies,
        });
    }
    Ok(Chunk { frames })
}

/// Says how the bytes of a chunk divide, without decoding geometry.
///
/// # Errors
/// As [`decode`], as far as it reads.
pub fn byte_split(bytes: &[u8], limits: &Limits) -> Result<ByteSplit, ChunkError> {
    let file = File::open(bytes, limits)?;
    let mut split = ByteSplit::default();
    for primitive in file.document.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        if let Some(draco) = primitive.extensions.as_ref().and_then(|all| all.draco.as_ref()) {
            split.geometry = split.geometry.saturating_add(file.view(draco.buffer_view)?.len());
        }
    }
    for image in &file.document.images {
        split.texture = split.texture.saturating_add(file.view(image.buffer_view)?.len());
    }
    split.bodies = file.index.frames.iter().map(|frame| frame.bodies.len()).sum();
    split.index = bytes.len().saturating_sub(split.geometry.saturating_add(split.texture));
    Ok(split)
}

/// Refuses frames, given by start and duration, that are not one after the other.
pub(crate) fn check_times(frames: impl Iterator<Item = (Ticks, Ticks)>) -> Result<(), ChunkError> {
    let mut earliest = Ticks(i64::MIN);
    for (frame, (start, duration)) in frames.enumerate() {
        if duration <= Ticks(0) || start < earliest {
            let problem = "it overlaps the frame before, or lasts no time";
            return Err(ChunkError::Frame { frame, problem });
        }
        earliest = start + duration;
    }
    Ok(())
}

/// What may still be decoded: a few bytes can name the same large mesh or picture many times.
pub(crate) struct Budget {
    left: usize,
    limit: usize,
}

impl Budget {
    pub(crate) fn new(limit: usize) -> Self {
        Self { left: limit, limit }
    }

    pub(crate) fn spend(&mut self, bytes: usize) -> Result<(), ChunkError> {
        match self.left.checked_sub(bytes) {
            Some(left) => self.left = left,
            None => {
                let found = (self.limit - self.left).saturating_add(bytes) as u64;
                let limit = self.limit as u64;
                return Err(ChunkError::Limit { what: "bytes after decoding", found, limit });
            }
        }
        Ok(())
    }
}

/// An opened chunk: the document understood, the binary part at hand.
struct File<'a> {
    document: Document,
    index: ChunkIndex,
    bin: &'a [u8],
}

impl<'a> File<'a> {
    fn open(bytes: &'a [u8], limits: &Limits) -> Result<Self, ChunkError> {
        ChunkError::check("bytes", bytes.len(), limits.chunk_bytes)?;
        let Glb { json, bin } = Glb::parse(bytes)?;
        ChunkError::check("bytes of JSON", json.len(), limits.chunk_json_bytes)?;
        let mut document: Document =
            serde_json::from_slice(json).map_err(|error| ChunkError::Json { message: error.to_string() })?;
        let scene = document.scene;
        let scene = document.scenes.get_mut(scene).ok_or(reference("scene", scene))?;
        let Some(SceneExtras { holopitch: index }) = scene.extras.take() else {
            return Err(ChunkError::Json { message: "its scene has no `holopitch` extras".to_owned() });
        };
        if index.layout != LAYOUT {
            return Err(ChunkError::Version { found: index.layout, known: LAYOUT });
        }
        if index.timescale.numerator == 0 || index.timescale.denominator == 0 {
            return Err(ChunkError::Json { message: "its timescale has a zero".to_owned() });
        }
        Ok(Self { document, index, bin })
    }

    /// The bytes of a buffer view.
    fn view(&self, index: usize) -> Result<&'a [u8], ChunkError> {
        let view = self.document.buffer_views.get(index).ok_or(reference("buffer view", index))?;
        view.of(self.bin).ok_or(reference("buffer view", index))
    }

    fn image(&self, index: usize, limits: &Limits, budget: &mut Budget) -> Result<EncodedImage, ChunkError> {
        let image = self.document.images.get(index).ok_or(reference("image", index))?;
        let format = [ImageFormat::Jpeg, ImageFormat::Png]
            .into_iter()
            .find(|format| format.mime_type() == image.mime_type)
            .ok_or(reference("JPEG or PNG image", index))?;
        let bytes = self.view(image.buffer_view)?;
        budget.spend(bytes.len())?;
        let (width, height) =
            super::picture::size_px(format, bytes).ok_or(reference("JPEG or PNG image", index))?;
        let side = width.max(height) as usize;
        ChunkError::check("pixels along a texture", side, limits.texture_side_px as usize)?;
        Ok(EncodedImage { format, bytes: bytes.to_vec() })
    }

    fn body(
        &self,
        frame: usize,
        track: PersonTrack,
        mesh: usize,
        limits: &Limits,
        budget: &mut Budget,
    ) -> Result<Body, ChunkError> {
        let anchor_m = self.anchor(track.anchors, frame)?;
        let fail = |problem: String| ChunkError::Body { frame, person: track.id, problem };
        let one = self.document.meshes.get(mesh).filter(|mesh| mesh.primitives.len() == 1);
        let mesh = one.ok_or(reference("mesh with one primitive", mesh))?;
        let view = |index| self.view(index);
        let mesh =
            body_mesh(mesh, &self.document.accessors, view, limits, budget).map_err(|error| match error {
                BodyError::Chunk(error) => error,
                BodyError::Problem(problem) => fail(problem),
            })?;
        Ok(Body { person: track.id, anchor_m, mesh, guessed_from_u: None })
    }

    /// Element `frame` of an accessor of float triples.
    fn anchor(&self, index: usize, frame: usize) -> Result<Vec3, ChunkError> {
        let fail = || reference("anchor accessor", index);
        let accessor = self.document.accessors.get(index).ok_or_else(fail)?;
        let usable = accessor.component_type == component::F32
            && accessor.kind == "VEC3"
            && accessor.count >= self.index.frames.len();
        let view = accessor.buffer_view.filter(|_| usable).ok_or_else(fail)?;
        let at =
            frame.checked_mul(12).and_then(|at| at.checked_add(accessor.byte_offset)).ok_or_else(fail)?;
        let bytes = at.checked_add(12).and_then(|end| self.view(view).ok()?.get(at..end)).ok_or_else(fail)?;
        let mut xyz = [0.0f32; 3];
        for (value, four) in xyz.iter_mut().zip(bytes.as_chunks::<4>().0) {
            *value = f32::from_le_bytes(*four);
        }
        let anchor = Vec3::from_array(xyz);
        if anchor.is_finite() { Ok(anchor) } else { Err(fail()) }
    }
}

/// What is wrong with a body: with the whole chunk, or with it alone.
pub(crate) enum BodyError {
    Chunk(ChunkError),
    Problem(String),
}

impl From<ChunkError> for BodyError {
    fn from(error: ChunkError) -> Self {
        Self::Chunk(error)
    }
}

/// The geometry of a glTF mesh with one Draco-compressed primitive; `view` gives the bytes of a buffer view.
pub(crate) fn body_mesh<'a>(
    mesh: &Mesh,
    accessors: &[Accessor],
    view: impl Fn(usize) -> Result<&'a [u8], ChunkError>,
    limits: &Limits,
    budget: &mut Budget,
) -> Result<crate::mesh::Mesh, BodyError> {
    let fail = |problem: &str| BodyError::Problem(problem.to_owned());
    let [primitive] = mesh.primitives.as_slice() else {
        return Err(fail("its mesh has not one primitive"));
    };
    let draco_part = primitive
        .extensions
        .as_ref()
        .and_then(|all| all.draco.as_ref())
        .ok_or_else(|| fail("its mesh is not Draco-compressed"))?;
    let count =
        |index: usize| accessors.get(index).map(|found| found.count).ok_or(reference("accessor", index));
    let no_uv = || fail("its mesh has no texture coordinates");
    let vertices = count(primitive.attributes.position)?;
    if count(primitive.attributes.uv.ok_or_else(no_uv)?)? != vertices {
        return Err(fail("its accessors disagree about the number of vertices"));
    }
    let indices = count(primitive.indices.ok_or_else(|| fail("its mesh has no indices"))?)?;
    if !indices.is_multiple_of(3) {
        return Err(BodyError::Problem(format!("{indices} indices are not whole triangles")));
    }
    let counts = draco::Counts { vertices, triangles: indices / 3 };
    ChunkError::check("vertices in a body", counts.vertices, limits.vertices_per_body)?;
    ChunkError::check("triangles in a body", counts.triangles, limits.triangles_per_body)?;
    budget.spend(counts.vertices * draco::VERTEX_BYTES + counts.triangles * draco::TRIANGLE_BYTES)?;
    let ids = draco::AttributeIds {
        position: draco_part.attributes.position,
        uv: draco_part.attributes.uv.ok_or_else(no_uv)?,
    };
    draco::decode(view(draco_part.buffer_view)?, ids, counts).map_err(BodyError::Problem)
}

pub(crate) fn reference(what: &'static str, index: usize) -> ChunkError {
    ChunkError::Reference { what, index }
}
