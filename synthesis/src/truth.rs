//! The ground truth of a rendered clip: what `truth.json` says, and the Holopitch stream of the true surfaces.

use std::{io::Write, path::Path};

use glam::{DVec2, DVec3, Vec3};
use protocol::{
    camera::Camera,
    chunk::{self, Ball, Body, Chunk, ChunkFrame, EncodedImage, FrameQuality, ImageFormat},
    hash,
    manifest::{ChunkEntry, FILE_NAME, FORMAT, Manifest, Person, PersonId, Representation, VERSION},
    mesh::Mesh,
    pitch::Pitch,
    time::{Ticks, Timescale},
};
use serde::Serialize;

use crate::{
    SynthesisError,
    figure::{Figure, Material},
    fixture::{Fixture, Member},
    outfit::{Pattern, Srgb},
    raster::Grid,
    render::Scene,
    trajectories::Role,
};

/// `truth.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Truth {
    /// Frames per second, as a fraction.
    pub frame_rate: [u32; 2],
    /// Size of the pitch.
    pub pitch: Pitch,
    /// Everybody, in order of `id`.
    pub people: Vec<PersonTruth>,
    /// Every frame.
    pub frames: Vec<FrameTruth>,
}

/// Who somebody is.
#[derive(Clone, Debug, Serialize)]
pub struct PersonTruth {
    /// Identity in frames and in the truth stream.
    pub id: u32,
    /// `home`, `away` or absent.
    pub team: Option<&'static str>,
    /// `player`, `goalkeeper`, `referee`, `assistant`.
    pub role: Role,
    /// Shirt number.
    pub number: Option<u8>,
    /// Main colour of the shirt, sRGB.
    pub shirt_rgb: [u8; 3],
}

/// One frame.
#[derive(Clone, Debug, Serialize)]
pub struct FrameTruth {
    /// Index in the clip.
    pub frame: usize,
    /// The camera.
    pub camera: Camera,
    /// Middle of the ball, world metres.
    pub ball_m: [f64; 3],
    /// Everybody with at least one pixel of box in the picture.
    pub people: Vec<PersonFrame>,
}

/// One person in one frame.
#[derive(Clone, Debug, Serialize)]
pub struct PersonFrame {
    /// Who.
    pub id: u32,
    /// Amodal box: left, top, right, bottom in pixels, hidden parts and parts outside the picture included.
    pub box_px: [f64; 4],
    /// Share of the box inside the picture.
    pub box_inside: f64,
    /// Share of the person's pixels (inside the picture) that nothing covers.
    pub visible_share: f64,
    /// Counts for evaluation: at least half of the box is inside the picture.
    pub in_view: bool,
    /// Ground point under the middle of the hips, world metres.
    pub anchor_m: [f64; 3],
    /// BlazePose's 33 landmarks, pixels.
    pub joints_px: Vec<[f64; 2]>,
    /// The same in world metres.
    pub joints_m: Vec<[f64; 3]>,
}

fn rounded<const N: usize>(values: [f64; N], digits: i32) -> [f64; N] {
    let scale = 10f64.powi(digits);
    values.map(|value| (value * scale).round() / scale)
}

/// Measures one frame.
#[must_use]
pub fn frame_truth(fixture: &Fixture, scene: &Scene<'_>, frame: usize) -> FrameTruth {
    let camera = fixture.cameras[frame];
    let (width, height) = (camera.width_px as usize, camera.height_px as usize);
    let hits = scene.first_hits(&camera, Grid::over_pixels([0, 0], [width, height], 1));
    let mut seen = vec![0usize; scene.actors.len()];
    hits.iter().flatten().for_each(|&(actor, _)| seen[actor] += 1);
    let mut people = Vec::new();
    for (id, actor) in scene.actors.iter().enumerate() {
        let (mut low, mut high) = (DVec2::MAX, DVec2::MIN);
        let mut behind = false;
        for position in &actor.posed.positions {
            match camera.project(position.as_dvec3()) {
                Some(pixel) => {
                    low = low.min(pixel);
                    high = high.max(pixel);
                }
                None => behind = true,
            }
        }
        let limit = DVec2::new(width as f64 - 0.5, height as f64 - 0.5);
        let inside = (high.min(limit) - low.max(DVec2::splat(-0.5))).max(DVec2::ZERO);
        if behind || inside.x * inside.y <= 0.0 {
            continue;
        }
        let box_inside = inside.x * inside.y / ((high.x - low.x) * (high.y - low.y)).max(1e-9);
        // The person alone, in the part of its box that is in the picture.
        let first = [low.x.max(0.0) as i32, low.y.max(0.0) as i32];
        let size = [0, 1].map(|k| {
            let end = if k == 0 { high.x.min(width as f64 - 1.0) } else { high.y.min(height as f64 - 1.0) };
            (end as i32 + 2 - first[k]).max(1) as usize
        });
        let alone = Scene { stadium: scene.stadium, actors: vec![actor.clone()], solids: Vec::new() };
        let grid = Grid::over_pixels(first, size, 1);
        let in_picture = |place: usize| {
            let (x, y) = (first[0] as usize + place % size[0], first[1] as usize + place / size[0]);
            x < width && y < height
        };
        let whole = alone
            .first_hits(&camera, grid)
            .iter()
            .enumerate()
            .filter(|(place, hit)| hit.is_some() && in_picture(*place))
            .count();
        let joints = &actor.posed.landmarks;
        people.push(PersonFrame {
            id: id as u32,
            box_px: rounded([low.x, low.y, high.x, high.y], 2),
            box_inside: rounded([box_inside], 3)[0],
            visible_share: rounded([(seen[id] as f64 / whole.max(1) as f64).min(1.0)], 3)[0],
            in_view: box_inside >= 0.5,
            anchor_m: rounded(fixture.anchor_m(id, frame).as_dvec3().to_array(), 4),
            joints_px: joints
                .iter()
                .map(|j| rounded(camera.project(j.as_dvec3()).unwrap_or(DVec2::splat(-1e4)).to_array(), 1))
                .collect(),
            joints_m: joints.iter().map(|j| rounded(j.as_dvec3().to_array(), 2)).collect(),
        });
    }
    let ball_m = rounded(fixture.ball[frame].as_dvec3().to_array(), 3);
    FrameTruth { frame, camera, ball_m, people }
}

/// Who everybody is.
#[must_use]
pub fn people_truth(members: &[Member]) -> Vec<PersonTruth> {
    let entry = |(id, member): (usize, &Member)| PersonTruth {
        id: id as u32,
        team: member.path.team.map(|team| if team == 0 { "home" } else { "away" }),
        role: member.path.role,
        number: member.path.number,
        shirt_rgb: bytes(member.figure.outfit.kit.shirt),
    };
    members.iter().enumerate().map(entry).collect()
}

fn bytes(colour: Srgb) -> [u8; 3] {
    colour.map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}

/// The materials in the order of the palette's columns.
const MATERIALS: [Material; 8] = [
    Material::Skin,
    Material::Hair,
    Material::Eye,
    Material::Shirt,
    Material::Sleeve,
    Material::Shorts,
    Material::Sock,
    Material::Boot,
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
            Body { person: PersonId(person.id), anchor_m: anchor, mesh }
        })
        .collect();
    ChunkFrame {
        clip_frame: truth.frame as u32,
        start: Ticks(truth.frame as i64),
        duration: Ticks(1),
        camera: Some(truth.camera),
        quality: FrameQuality { line_residual_px: Some(0.0), track_confidence: Some(1.0) },
        ball: Some(Ball { position_m: DVec3::from(truth.ball_m), height_known: true }),
        atlas: Some(palette.clone()),
        bodies,
    }
}

/// Writes the truth stream: chunks of one second, then the manifest.
pub fn write_stream(
    folder: &Path,
    fixture: &Fixture,
    frames: Vec<ChunkFrame>,
    frame_rate: u32,
    triangles: u32,
) -> Result<(), SynthesisError> {
    let name = "truth";
    let chunks_folder = folder.join(name);
    std::fs::create_dir_all(&chunks_folder).map_err(|source| SynthesisError::Io {
        path: chunks_folder.clone(),
        doing: "create",
        source,
    })?;
    let broken = |reason: String| SynthesisError::Asset { what: "the truth stream".into(), reason };
    let timescale = Timescale::new(frame_rate, 1).ok_or_else(|| broken("its frame rate is zero".into()))?;
    let count = frames.len() as i64;
    let (mut chunks, mut rest) = (Vec::new(), frames);
    while !rest.is_empty() {
        let later = rest.split_off(rest.len().min(frame_rate as usize));
        let part = Chunk { frames: std::mem::replace(&mut rest, later) };
        let (Some(first), length) = (part.frames.first().map(|f| f.start), part.frames.len() as i64) else {
            break;
        };
        let file = chunk::encode(&part, timescale).map_err(|error| broken(error.to_string()))?;
        let path = format!("{name}/{:05}.glb", chunks.len());
        put(&folder.join(&path), &file)?;
        let entry = hash::entry(path, &file);
        chunks.push(ChunkEntry { file: entry, start: first, duration: Ticks(length) });
    }
    let people = people_truth(&fixture.members)
        .into_iter()
        .map(|person| Person {
            id: PersonId(person.id),
            team: person.team.map(str::to_owned),
            role: serde_json::to_value(person.role).ok().and_then(|v| v.as_str().map(str::to_owned)),
            number: person.number,
            shirt_rgb: Some(person.shirt_rgb),
        })
        .collect();
    let manifest = Manifest {
        format: FORMAT.into(),
        version: VERSION.into(),
        timescale,
        duration: Ticks(count),
        pitch: fixture.stadium.pitch,
        static_scene: None,
        people,
        representations: vec![Representation { id: name.into(), triangles_per_body: triangles, chunks }],
    };
    let json = manifest.to_json().map_err(|error| broken(error.to_string()))?;
    put(&folder.join(FILE_NAME), json.as_bytes())
}

/// Writes a file as a whole or not at all.
pub fn put(path: &Path, bytes: &[u8]) -> Result<(), SynthesisError> {
    let temporary = path.with_extension("partial");
    let written = std::fs::File::create(&temporary)
        .and_then(|mut file| file.write_all(bytes))
        .and_then(|()| std::fs::rename(&temporary, path));
    written.map_err(|source| SynthesisError::Io { path: path.to_owned(), doing: "write", source })
}
