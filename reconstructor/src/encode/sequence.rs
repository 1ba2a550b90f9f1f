//! Bodies of frames to the runs of their people, whether they were lifted just now or read from a stream.

use std::collections::BTreeMap;

use image::{RgbImage, imageops};
use protocol::{
    chunk::{Atlas, Body, ChunkFrame},
    compact::{Run, Sequence},
    content::AnyChunk,
    manifest::PersonId,
    mesh::Mesh,
};
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::EncodeError;
use crate::motion::{self, FrameBody};

/// Pixels kept round the texture of a body that is cut out of an atlas: filtering reads them.
const MARGIN_PX: f32 = 2.0;

/// The runs of everybody; a person's bodies come in order of time.
pub(super) fn runs<'a>(bodies: impl Iterator<Item = (PersonId, FrameBody<'a>)>) -> Vec<Run> {
    let mut people: BTreeMap<PersonId, Vec<FrameBody<'a>>> = BTreeMap::new();
    for (person, body) in bodies {
        people.entry(person).or_default().push(body);
    }
    let people: Vec<(PersonId, Vec<FrameBody<'a>>)> = people.into_iter().collect();
    let runs: Vec<Vec<Run>> =
        people.par_iter().map(|(person, bodies)| motion::follow(*person, bodies)).collect();
    runs.into_iter().flatten().collect()
}

/// A chunk of either profile as a sequence: bodies are followed anew.
///
/// # Errors
/// When a texture cannot be decoded.
pub fn sequence_of(chunk: &AnyChunk) -> Result<Sequence, EncodeError> {
    let mut cut = Vec::new();
    let mut frames = Vec::with_capacity(chunk.frames().len());
    for index in 0..chunk.frames().len() {
        let Some(frame) = chunk.frame(index) else { continue };
        let frame = frame.into_owned();
        let atlas = picture(&frame)?;
        cut.extend(frame.bodies.iter().map(|body| (index, cut_out(body, &atlas))));
        frames.push(ChunkFrame { atlas: None, bodies: Vec::new(), ..frame });
    }
    let bodies = cut.iter().map(|(frame, cut)| {
        let body = FrameBody {
            frame: *frame,
            anchor_m: cut.body.anchor_m.as_dvec3(),
            mesh: &cut.body.mesh,
            texture: &cut.texture,
            guessed_from_u: cut.body.guessed_from_u,
        };
        (cut.body.person, body)
    });
    Ok(Sequence { frames, runs: runs(bodies) })
}

/// The atlas of a frame; grey without one.
fn picture(frame: &ChunkFrame) -> Result<RgbImage, EncodeError> {
    match &frame.atlas {
        None => Ok(RgbImage::from_pixel(8, 8, image::Rgb([150; 3]))),
        Some(Atlas::Encoded(file)) => {
            let clip_frame = frame.clip_frame;
            let broken =
                |error: image::ImageError| EncodeError::Texture { clip_frame, message: error.to_string() };
            Ok(image::load_from_memory(&file.bytes).map_err(broken)?.to_rgb8())
        }
        Some(Atlas::Pixels(pixels)) => {
            let rgb = pixels.rgba.as_chunks::<4>().0.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]);
            Ok(RgbImage::from_raw(pixels.width_px, pixels.height_px, rgb.collect()).unwrap_or_default())
        }
    }
}

/// A body with a texture of its own.
struct CutOut {
    body: Body,
    texture: RgbImage,
}

/// Cuts the piece that a body wears out of its atlas.
fn cut_out(body: &Body, atlas: &RgbImage) -> CutOut {
    let size = [atlas.width() as f32, atlas.height() as f32];
    let piece = [0, 1].map(|axis| {
        let along = || body.mesh.uvs.iter().map(|uv| uv[axis] * size[axis]);
        let low = along().fold(f32::INFINITY, f32::min) - MARGIN_PX;
        let high = along().fold(f32::NEG_INFINITY, f32::max) + MARGIN_PX;
        let start = low.floor().clamp(0.0, size[axis] - 1.0);
        (start, (high.ceil().clamp(start + 1.0, size[axis]) - start))
    });
    let [(x, width), (y, height)] = piece;
    let texture = imageops::crop_imm(atlas, x as u32, y as u32, width as u32, height as u32).to_image();
    let inside =
        |axis: usize, value: f32| ((value * size[axis] - piece[axis].0) / piece[axis].1).clamp(0.0, 1.0);
    let uvs = body.mesh.uvs.iter().map(|[u, v]| [inside(0, *u), inside(1, *v)]).collect();
    let mesh = Mesh { uvs, ..body.mesh.clone() };
    let guessed_from_u = body.guessed_from_u.map(|u| inside(0, u));
    CutOut { body: Body { mesh, guessed_from_u, ..body.clone() }, texture }
}
