//! The true surfaces of a rendered clip as a Holopitch stream, so that one reader, one evaluator and one player serve both.

use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use protocol::{
    chunk::{self, Atlas, Ball, Body, Chunk, ChunkFrame, EncodedImage, FrameQuality, ImageFormat},
    hash,
    manifest::{ChunkEntry, FILE_NAME, FORMAT, Manifest, Person, PersonId, Profile, Representation, VERSION},
    mesh::Mesh,
    time::{Ticks, Timescale},
};

use super::{FrameTruth, bytes, people_truth};
use crate::{
    SynthesisError,
    figure::{Figure, Material},
    fixture::{Fixture, Member},
    outfit::{Pattern, Srgb},
    output::{make_folder, put},
    render::Scene,
};

/// The materials in the order of the palette's columns.
const MATERIALS: [Material; 9] = [
    Material::Skin,
    Material::Hair,
    Material::Eye,
    Material::Shirt,
    Material::Sleeve,
    Material::Shorts,
    Material::Sock,
    Material::Boot,
    Material::Glove,
];

/// Pixels of one colour in the palette.
const SWATCH: u32 = 4;

fn colour_of(figure: &Figure, material: Material) -> Srgb {
    let (outfit, kit) = (&figure.outfit, &figure.outfit.kit);
    let mean = |a: Srgb, b: Srgb| [0, 1, 2].map(|k| (a[k] + b[k]) / 2.0);
    match material {
        Material::Skin | Material::Eye => outfit.skin,
        Material::Hair => outfit.hair.map_or(outfit.skin, |hair| hair.colour),
        Material::Shirt => match kit.pattern {
            Pattern::Plain | Pattern::Sleeves | Pattern::Sash(_) => kit.shirt,
            Pattern::Stripes(_) | Pattern::Hoops(_) | Pattern::Halves => mean(kit.shirt, kit.second),
        },
        Material::Sleeve => match kit.pattern {
            Pattern::Sleeves => kit.second,
            Pattern::Stripes(_) | Pattern::Hoops(_) => mean(kit.shirt, kit.second),
            _ => kit.shirt,
        },
        Material::Shorts => kit.shorts,
        Material::Sock => kit.socks,
        Material::Boot => outfit.boots,
        Material::Glove => outfit.gloves.unwrap_or(outfit.skin),
    }
}

/// A true surface with fewer triangles: which of a figure's vertices it keeps.
pub struct Reduced {
    vertices: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    uvs: Vec<[f32; 2]>,
}

impl Reduced {
    /// At most about `triangles` triangles of the figure of member `row` of `rows`.
    #[must_use]
    pub fn new(figure: &Figure, triangles: usize, row: usize, rows: usize) -> Self {
        let positions: Vec<[f32; 3]> = figure.vertices.iter().map(|v| v.rest.to_array()).collect();
        let indices: &[u32] = bytemuck::cast_slice(&figure.triangles);
        let kept = match meshopt::VertexDataAdapter::new(bytemuck::cast_slice(&positions), 12, 0) {
            Ok(adapter) => {
                let options = meshopt::SimplifyOptions::ErrorAbsolute;
                meshopt::simplify(indices, &adapter, triangles * 3, 0.03, options, None)
            }
            Err(_) => indices.to_vec(),
        };
        let mut material_of = vec![0usize; figure.vertices.len()];
        for (triangle, material) in figure.triangles.iter().zip(&figure.materials) {
            let column = MATERIALS.iter().position(|m| m == material).unwrap_or(0);
            triangle.iter().for_each(|&v| material_of[v as usize] = column);
        }
        let mut place = std::collections::BTreeMap::new();
        let mut reduced = Self { vertices: Vec::new(), triangles: Vec::new(), uvs: Vec::new() };
        for triangle in kept.as_chunks::<3>().0 {
            reduced.triangles.push(triangle.map(|v| {
                *place.entry(v).or_insert_with(|| {
                    reduced.vertices.push(v);
                    let column = material_of[v as usize] as f32 + 0.5;
                    reduced.uvs.push([column / MATERIALS.len() as f32, (row as f32 + 0.5) / rows as f32]);
                    reduced.vertices.len() as u32 - 1
                })
            }));
        }
        reduced
    }

    fn mesh(&self, positions: &[Vec3], anchor: Vec3) -> Mesh {
        Mesh {
            positions_m: self.vertices.iter().map(|&v| (positions[v as usize] - anchor).to_array()).collect(),
            uvs: self.uvs.clone(),
            triangles: self.triangles.clone(),
        }
    }
}

/// The colours of everybody's materials as a small picture: one row per member, one column per material.
pub fn palette(members: &[Member]) -> Result<EncodedImage, SynthesisError> {
    let size = (MATERIALS.len() as u32 * SWATCH, members.len() as u32 * SWATCH);
    let image = image::RgbImage::from_fn(size.0, size.1, |x, y| {
        let figure = &members[(y / SWATCH) as usize].figure;
        image::Rgb(bytes(colour_of(figure, MATERIALS[(x / SWATCH) as usize])))
    });
    let mut file = std::io::Cursor::new(Vec::new());
    image.write_to(&mut file, image::ImageFormat::Png).map_err(SynthesisError::Picture)?;
    Ok(EncodedImage { format: ImageFormat::Png, bytes: file.into_inner() })
}

/// One frame of the truth stream: the true surfaces of everybody in view.
#[must_use]
pub fn stream_frame(
    fixture: &Fixture,
    scene: &Scene<'_>,
    truth: &FrameTruth,
    reduced: &[Reduced],
    palette: &EncodedImage,
) -> ChunkFrame {
    let bodies = truth
        .people
        .iter()
        .filter(|person| person.in_view)
        .map(|person| {
            let id = person.id as usize;
            let anchor = fixture.anchor_m(id, truth.frame);
            let mesh = reduced[id].mesh(&scene.actors[id].posed.positions, anchor);
            Body { person: PersonId(person.id), anchor_m: anchor, mesh, guessed_from_u: None }
        })
        .collect();
    ChunkFrame {
        clip_frame: truth.frame as u32,
        start: Ticks(truth.frame as i64),
        duration: Ticks(1),
        camera: Some(truth.camera),
        quality: FrameQuality { line_residual_px: Some(0.0), track_confidence: Some(1.0) },
        ball: Some(Ball { position_m: DVec3::from(truth.ball.position_m), height_known: true, spread: None }),
        atlas: Some(Atlas::Encoded(palette.clone())),
        bodies,
    }
}

/// The name of the only representation, and of its folder.
const NAME: &str = "truth";

fn broken(reason: impl ToString) -> SynthesisError {
    SynthesisError::Asset { what: "the truth stream".into(), reason: reason.to_string() }
}

/// Writes the stream while frames come in: chunks of one second, the manifest last.
pub struct StreamWriter {
    folder: PathBuf,
    timescale: Timescale,
    frames_per_chunk: usize,
    waiting: Vec<ChunkFrame>,
    chunks: Vec<ChunkEntry>,
    end: Ticks,
    bytes: u64,
}

impl StreamWriter {
    /// A stream in `folder`, which is made.
    pub fn create(folder: &Path, frame_rate: u32) -> Result<Self, SynthesisError> {
        make_folder(&folder.join(NAME))?;
        let timescale = Timescale::new(frame_rate, 1).ok_or_else(|| broken("its frame rate is zero"))?;
        Ok(Self {
            folder: folder.to_owned(),
            timescale,
            frames_per_chunk: frame_rate as usize,
            waiting: Vec::new(),
            chunks: Vec::new(),
            end: Ticks(0),
            bytes: 0,
        })
    }

    /// Adds the next frame.
    pub fn push(&mut self, frame: ChunkFrame) -> Result<(), SynthesisError> {
        self.waiting.push(frame);
        if self.waiting.len() == self.frames_per_chunk { self.write_chunk() } else { Ok(()) }
    }

    fn write_chunk(&mut self) -> Result<(), SynthesisError> {
        let part = Chunk { frames: std::mem::take(&mut self.waiting) };
        let Some((start, end)) = part.span() else { return Ok(()) };
        let file = chunk::encode(&part, self.timescale).map_err(broken)?;
        let path = format!("{NAME}/{:05}.glb", self.chunks.len());
        put(&self.folder.join(&path), &file)?;
        self.bytes += file.len() as u64;
        let duration = Ticks(end.0 - start.0);
        self.chunks.push(ChunkEntry { file: hash::entry(path, &file), start, duration });
        self.end = end;
        Ok(())
    }

    /// Writes what is left and the manifest; returns the bytes of the whole stream.
    pub fn finish(mut self, fixture: &Fixture, triangles: u32) -> Result<u64, SynthesisError> {
        self.write_chunk()?;
        let people = people_truth(&fixture.members)
            .into_iter()
            .map(|person| Person {
                id: PersonId(person.id),
                team: person.team.map(str::to_owned),
                team_confidence: None,
                role_confidence: None,
                role: serde_json::to_value(person.role).ok().and_then(|v| v.as_str().map(str::to_owned)),
                number: person.number,
                number_confidence: None,
                shirt_rgb: Some(person.shirt_rgb),
            })
            .collect();
        let manifest = Manifest {
            format: FORMAT.into(),
            version: VERSION.into(),
            timescale: self.timescale,
            duration: self.end,
            pitch: fixture.stadium.pitch,
            live: None,
            static_scene: None,
            people,
            segments: Vec::new(),
            representations: vec![Representation {
                id: NAME.into(),
                profile: Profile::Plain,
                triangles_per_body: triangles,
                chunks: self.chunks,
            }],
        };
        let json = manifest.to_json().map_err(broken)?;
        put(&self.folder.join(FILE_NAME), json.as_bytes())?;
        Ok(self.bytes + json.len() as u64)
    }
}
