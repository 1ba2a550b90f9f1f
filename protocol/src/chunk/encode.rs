//! Chunk to GLB: an ordinary animated glTF scene with an index of the frames in its extras.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    Atlas, Body, Chunk, ChunkError, ChunkFrame, EncodedImage, draco,
    geometry::{bounds, draco_mesh},
    guessed_is_possible,
    index::{ChunkIndex, FrameIndex, LAYOUT, PersonTrack, SceneExtras},
};
use crate::{
    gltf::{
        Accessor, Animation, AnimationSampler, Builder, Channel, DRACO, Image, Interpolation, Material, Node,
        Sampler, Scene, Target, TargetPath, Texture, UNLIT, component,
    },
    manifest::PersonId,
    time::{Ticks, Timescale},
};

/// How finely coordinates are rounded: bits across the longest side of each body's own box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quantisation {
    /// Bits of a position; 11 are steps of about one millimetre on a person.
    pub position_bits: u8,
    /// Bits of a texture coordinate; 10 are about a tenth of a pixel of a player's crop.
    pub uv_bits: u8,
}

impl Default for Quantisation {
    fn default() -> Self {
        Self { position_bits: 11, uv_bits: 10 }
    }
}

/// Writes a chunk as a GLB file with the default [`Quantisation`].
///
/// # Errors
/// When the chunk is empty, its frames are out of order, or a body or a number cannot be stored.
pub fn encode(chunk: &Chunk, timescale: Timescale) -> Result<Vec<u8>, ChunkError> {
    encode_with(chunk, timescale, Quantisation::default())
}

/// Writes a chunk as a GLB file.
///
/// # Errors
/// As [`encode`].
pub fn encode_with(
    chunk: &Chunk,
    timescale: Timescale,
    quantisation: Quantisation,
) -> Result<Vec<u8>, ChunkError> {
    check_frames(&chunk.frames)?;
    let mut writer = Writer::new(chunk, timescale, quantisation);
    writer.pictures();
    writer.bodies()?;
    let people = writer.people();
    writer.finish(people)
}

/// Order of time, one body per person, and nothing that JSON cannot say.
pub(crate) fn check_frames(frames: &[ChunkFrame]) -> Result<(), ChunkError> {
    if frames.is_empty() {
        return Err(ChunkError::Empty);
    }
    let mut earliest = Ticks(i64::MIN);
    for (frame, content) in frames.iter().enumerate() {
        let problem = |problem| ChunkError::Frame { frame, problem };
        if content.duration <= Ticks(0) || content.start < earliest {
            return Err(problem("it overlaps the frame before, or lasts no time"));
        }
        earliest = content.start + content.duration;
        let mut seen = BTreeSet::new();
        if !content.bodies.iter().all(|body| seen.insert(body.person)) {
            return Err(problem("a person has two bodies"));
        }
        if !is_finite(content) {
            return Err(problem(
                "the camera, the ball, an anchor or a figure is not a number, or the ball is nowhere near",
            ));
        }
        match &content.atlas {
            Some(Atlas::Encoded(file)) if file.size_px().is_none() => {
                return Err(problem("the atlas is not a picture of the format it says"));
            }
            Some(Atlas::Pixels(_)) => {
                return Err(problem("the atlas is not a picture file: encode it first"));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Whether a frame has only numbers, and its ball is near.
pub(crate) fn is_finite(frame: &ChunkFrame) -> bool {
    let camera = frame.camera.is_none_or(|camera| {
        camera.rotation.is_finite()
            && camera.position.is_finite()
            && camera.focal_px.is_finite()
            && camera.k1.is_finite()
    });
    let figures = [frame.quality.line_residual_px, frame.quality.track_confidence];
    camera
        && frame.ball.is_none_or(|ball| ball.is_possible())
        && figures.iter().flatten().all(|figure| figure.is_finite())
        && frame
            .bodies
            .iter()
            .all(|body| body.anchor_m.is_finite() && guessed_is_possible(body.guessed_from_u))
}

/// A chunk on its way into a document.
struct Writer<'a> {
    chunk: &'a Chunk,
    timescale: Timescale,
    quantisation: Quantisation,
    builder: Builder,
    animation: Animation,
    frames: Vec<FrameIndex>,
    /// Frame nodes of each person: position in the chunk and node.
    nodes: BTreeMap<PersonId, Vec<(usize, usize)>>,
    /// Seconds from the start of the chunk at which each frame starts, and the end.
    times: Vec<f32>,
}

impl<'a> Writer<'a> {
    fn new(chunk: &'a Chunk, timescale: Timescale, quantisation: Quantisation) -> Self {
        Self {
            chunk,
            timescale,
            quantisation,
            builder: Builder::default(),
            animation: Animation { name: "match".to_owned(), ..Animation::default() },
            frames: Vec::with_capacity(chunk.frames.len()),
            nodes: BTreeMap::new(),
            times: key_times(&chunk.frames, timescale),
        }
    }

    /// Atlases, their materials, and the index entry of every frame.
    fn pictures(&mut self) {
        for frame in &self.chunk.frames {
            let image = frame.atlas.as_ref().and_then(file_of).map(|atlas| {
                let buffer_view = self.builder.view(&atlas.bytes, None);
                let image = Image { buffer_view, mime_type: atlas.format.mime_type().to_owned() };
                self.builder.document.images.push(image);
                self.builder.document.images.len() - 1
            });
            self.frames.push(FrameIndex {
                clip_frame: frame.clip_frame,
                start: frame.start,
                duration: frame.duration,
                image,
                bodies: Vec::with_capacity(frame.bodies.len()),
                guessed_from_u: match frame.bodies.iter().any(|body| body.guessed_from_u.is_some()) {
                    true => frame.bodies.iter().map(|body| body.guessed_from_u).collect(),
                    false => Vec::new(),
                },
                camera: frame.camera.map(Box::new),
                quality: frame.quality,
                ball: frame.ball,
            });
        }
    }

    /// The material of a frame: its atlas, or plain grey.
    fn material(&mut self, frame: usize) -> usize {
        let document = &mut self.builder.document;
        let texture = self.frames.get(frame).and_then(|index| index.image).map(|source| {
            if document.samplers.is_empty() {
                document.samplers.push(Sampler::ATLAS);
            }
            document.textures.push(Texture { sampler: 0, source });
            document.textures.len() - 1
        });
        let colour = texture.is_none().then_some([0.6, 0.6, 0.6, 1.0]);
        let mut material = Material::unlit(format!("frame-{frame:04}"), colour, texture);
        material.double_sided = true; // a body is the side that the camera saw
        document.materials.push(material);
        document.materials.len() - 1
    }

    /// Meshes and their nodes, frame by frame.
    fn bodies(&mut self) -> Result<(), ChunkError> {
        let chunk = self.chunk;
        let people: Vec<PersonId> = {
            let all = chunk.frames.iter().flat_map(|frame| &frame.bodies).map(|body| body.person);
            all.collect::<BTreeSet<_>>().into_iter().collect()
        };
        for (position, frame) in chunk.frames.iter().enumerate() {
            if frame.bodies.is_empty() {
                continue;
            }
            let material = self.material(position);
            let visible = self.visibility(position);
            for body in &frame.bodies {
                let mesh = self.mesh(position, body, material)?;
                // `people` holds every person of every body.
                let person = people.binary_search(&body.person).unwrap_or_default();
                if let Some(index) = self.frames.get_mut(position) {
                    index.bodies.push([person, mesh]);
                }
                let shown_at_start = if position == 0 { 1.0 } else { 0.0 };
                let node = self.node(Node {
                    name: format!("{}/frame-{:04}", node_name(body.person), frame.clip_frame),
                    mesh: Some(mesh),
                    scale: Some([shown_at_start; 3]),
                    ..Node::default()
                });
                self.nodes.entry(body.person).or_default().push((position, node));
                self.channel(visible, node, TargetPath::Scale);
            }
        }
        Ok(())
    }

    /// The mesh of one body.
    fn mesh(&mut self, frame: usize, body: &Body, material: usize) -> Result<usize, ChunkError> {
        let fail = |problem| ChunkError::Body { frame, person: body.person, problem };
        let bytes = draco::encode(&body.mesh, self.quantisation).map_err(fail)?;
        let stored = draco::decode_own(&bytes).map_err(fail)?;
        Ok(draco_mesh(&mut self.builder, &bytes, &stored, material))
    }

    /// The animation sampler that shows something during one frame only.
    fn visibility(&mut self, frame: usize) -> usize {
        let time = |index: usize| self.times.get(index).copied().unwrap_or_default();
        let last = frame + 1 == self.chunk.frames.len();
        let (mut keys, mut shown) = (Vec::with_capacity(3), Vec::with_capacity(3));
        if frame > 0 {
            keys.push(time(0));
            shown.push([0.0f32; 3]);
        }
        keys.push(time(frame));
        shown.push([1.0; 3]);
        keys.push(time(frame + 1));
        // The end of the chunk is the end of the animation: the last frame stays.
        shown.push(if last { [1.0; 3] } else { [0.0; 3] });
        let input = self.floats(keys.iter().map(|key| [*key]).collect(), "SCALAR");
        let output = self.floats(shown, "VEC3");
        self.sampler(input, output)
    }

    /// A node per person that carries the anchors; returns the index of the people.
    fn people(&mut self) -> Vec<PersonTrack> {
        let mut tracks = Vec::with_capacity(self.nodes.len());
        let input = if self.nodes.is_empty() {
            0
        } else {
            let keys = self.times.iter().map(|key| [*key]).collect();
            self.floats(keys, "SCALAR")
        };
        let mut roots = Vec::with_capacity(self.nodes.len());
        for (person, frames) in std::mem::take(&mut self.nodes) {
            let anchors = self.anchors(person);
            let first = anchors.first().copied();
            let output = self.floats(anchors, "VEC3");
            tracks.push(PersonTrack { id: person, anchors: output });
            let node = self.node(Node {
                name: node_name(person),
                children: frames.iter().map(|(_, node)| *node).collect(),
                translation: first,
                ..Node::default()
            });
            let sampler = self.sampler(input, output);
            self.channel(sampler, node, TargetPath::Translation);
            roots.push(node);
        }
        self.builder.document.scenes =
            vec![Scene { name: Some("match".to_owned()), nodes: roots, extras: None }];
        tracks
    }

    /// Where a person stands at every key time; where nobody saw the person, the last place, or the first to come.
    fn anchors(&self, person: PersonId) -> Vec<[f32; 3]> {
        let seen: Vec<Option<[f32; 3]>> = self
            .chunk
            .frames
            .iter()
            .map(|frame| frame.bodies.iter().find(|body| body.person == person))
            .map(|body| body.map(|body| body.anchor_m.to_array()))
            .collect();
        let mut last = seen.iter().flatten().next().copied().unwrap_or_default();
        let mut anchors: Vec<[f32; 3]> = seen
            .into_iter()
            .map(|anchor| {
                last = anchor.unwrap_or(last);
                last
            })
            .collect();
        anchors.push(last); // at the end of the chunk
        anchors
    }

    /// An accessor of floats in a buffer view of its own; times carry the bounds that glTF asks for.
    fn floats<const N: usize>(&mut self, values: Vec<[f32; N]>, kind: &str) -> usize {
        let bytes: &[u8] = bytemuck::cast_slice(values.as_flattened());
        let buffer_view = Some(self.builder.view(bytes, None));
        let (min, max) = if N == 1 { bounds(&values) } else { (Vec::new(), Vec::new()) };
        self.builder.accessor(Accessor {
            buffer_view,
            byte_offset: 0,
            component_type: component::F32,
            count: values.len(),
            kind: kind.to_owned(),
            min,
            max,
        })
    }

    fn node(&mut self, node: Node) -> usize {
        self.builder.document.nodes.push(node);
        self.builder.document.nodes.len() - 1
    }

    fn sampler(&mut self, input: usize, output: usize) -> usize {
        let interpolation = Interpolation::Step;
        self.animation.samplers.push(AnimationSampler { input, output, interpolation });
        self.animation.samplers.len() - 1
    }

    fn channel(&mut self, sampler: usize, node: usize, path: TargetPath) {
        self.animation.channels.push(Channel { sampler, target: Target { node, path } });
    }

    fn finish(mut self, people: Vec<PersonTrack>) -> Result<Vec<u8>, ChunkError> {
        let index = ChunkIndex { layout: LAYOUT, timescale: self.timescale, people, frames: self.frames };
        let extras = serde_json::to_value(SceneExtras { holopitch: index })
            .map_err(|error| ChunkError::Json { message: error.to_string() })?;
        let document = &mut self.builder.document;
        if let Some(scene) = document.scenes.first_mut() {
            scene.extras = Some(extras);
        }
        if !document.meshes.is_empty() {
            document.extensions_used = vec![DRACO, UNLIT];
            document.extensions_required = vec![DRACO];
            document.animations = vec![self.animation];
        }
        Ok(self.builder.finish()?)
    }
}

/// The file of an atlas; frames with another kind are refused before.
fn file_of(atlas: &Atlas) -> Option<&EncodedImage> {
    match atlas {
        Atlas::Encoded(file) => Some(file),
        Atlas::Pixels(_) => None,
    }
}

/// `person-007`.
fn node_name(person: PersonId) -> String {
    format!("person-{:03}", person.0)
}

/// Seconds from the first frame's start to every frame's start and to the end of the last, strictly rising.
fn key_times(frames: &[ChunkFrame], timescale: Timescale) -> Vec<f32> {
    let origin = frames.first().map(|frame| frame.start).unwrap_or_default();
    let end = frames.last().map(|frame| frame.start + frame.duration);
    let mut times: Vec<f32> = Vec::with_capacity(frames.len() + 1);
    for moment in frames.iter().map(|frame| frame.start).chain(end) {
        let seconds = timescale.seconds(moment - origin) as f32;
        times.push(match times.last() {
            // Frames closer together than a float can tell apart still come one after the other.
            Some(before) => seconds.max(before.next_up()),
            None => seconds,
        });
    }
    times
}
