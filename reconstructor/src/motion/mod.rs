//! Bodies to motion: one mesh per person for a while, and how its points and its texture move, instead of a new mesh in every frame.
//!
//! The mesh of the middle frame is laid onto the bodies of the frames before and after it, frame by frame ([`register`]); its texture is what those
//! bodies show ([`resample`]). Where it does not fit any more, another mesh takes over.

mod register;
mod resample;
mod topology;

#[cfg(test)]
mod tests;

use std::ops::Range;

use glam::DVec3;
use image::RgbImage;
use protocol::{chunk::PixelImage, compact::Run, manifest::PersonId, mesh::Mesh};

pub(crate) use self::resample::sampled;
use self::{
    register::{Target, register},
    resample::{Dressed, Texels, resample, steady},
    topology::Topology,
};
use crate::surface::{Surface, Triangle, spread_places};

/// Places of a body that pull the mesh.
const PLACES: usize = 800;
/// A mesh that is farther off than this fits no more, root mean square, metres.
const MISFIT_M: f64 = 0.03;

/// A body on its way to a run.
#[derive(Clone, Copy, Debug)]
pub struct FrameBody<'a> {
    /// Place of its frame in the chunk.
    pub frame: usize,
    /// Where it stands, world metres.
    pub anchor_m: DVec3,
    /// Relative to the anchor, metres; texture coordinates into `texture`.
    pub mesh: &'a Mesh,
    /// Its texture.
    pub texture: &'a RgbImage,
    /// Texture coordinate u from which on what is shown is guessed.
    pub guessed_from_u: Option<f32>,
}

/// The runs of one person over a chunk; `bodies` in order of time. Bodies whose triangles name vertices that are not there are left out.
#[must_use]
pub fn follow(person: PersonId, bodies: &[FrameBody<'_>]) -> Vec<Run> {
    let solids: Vec<Solid<'_>> = bodies.iter().filter_map(Solid::new).collect();
    let mut runs = Vec::new();
    let whole = 0..solids.len();
    let mut waiting = Vec::from([whole]);
    while let Some(range) = waiting.pop() {
        if range.is_empty() {
            continue;
        }
        let key = range.start + range.len() / 2;
        let fitted = Fitted::new(&solids, key, range.clone());
        let reached = fitted.reached();
        waiting.extend([range.start..reached.start, reached.end..range.end]);
        runs.push(fitted.run(person, &solids));
    }
    runs.sort_by_key(|run| run.frames.first().copied());
    runs
}

/// A body and its triangles in space.
struct Solid<'a> {
    body: &'a FrameBody<'a>,
    topology: Topology,
    points: Vec<DVec3>,
    target: Target,
    triangles: Vec<Triangle>,
}

impl<'a> Solid<'a> {
    fn new(body: &'a FrameBody<'a>) -> Option<Self> {
        let (topology, points) = Topology::of(body.mesh)?;
        let triangles = topology.in_space(&points);
        let target = Target::new(&triangles, &spread_places(&triangles, PLACES))?;
        Some(Self { body, topology, points, target, triangles })
    }
}

/// The mesh of one frame laid onto the bodies around it.
struct Fitted {
    key: usize,
    first: usize,
    paths: Vec<Vec<DVec3>>,
}

impl Fitted {
    /// Goes from frame `key` to both ends of `range`, or until the mesh fits no more.
    fn new(solids: &[Solid<'_>], key: usize, range: Range<usize>) -> Self {
        let solid = &solids[key];
        let rest = &solid.points;
        let (mut before, mut after) = (Vec::new(), Vec::new());
        let indices: [Box<dyn Iterator<Item = usize>>; 2] =
            [Box::new((range.start..key).rev()), Box::new(key + 1..range.end)];
        for (paths, indices) in [&mut before, &mut after].into_iter().zip(indices) {
            let (mut last, mut last_but_one) = (rest.clone(), rest.clone());
            for index in indices {
                // What moves goes on moving.
                let start =
                    last.iter().zip(&last_but_one).map(|(last, before)| *last * 2.0 - *before).collect();
                let points = register(&solid.topology, rest, start, &solids[index].target);
                if misfit(&solid.topology, &points, &solids[index]) > MISFIT_M {
                    break;
                }
                last_but_one = std::mem::replace(&mut last, points.clone());
                paths.push(points);
            }
        }
        before.reverse();
        let first = key - before.len();
        let paths = before.into_iter().chain([rest.clone()]).chain(after).collect();
        Self { key, first, paths }
    }

    fn reached(&self) -> Range<usize> {
        self.first..self.first + self.paths.len()
    }

    fn run(self, person: PersonId, solids: &[Solid<'_>]) -> Run {
        let Solid { body: key, topology, .. } = &solids[self.key];
        let (width, height) = key.texture.dimensions();
        let texels = Texels::of(key.mesh, width, height);
        let ground = pixels(key.texture);
        let mut run = Run {
            person,
            frames: Vec::with_capacity(self.paths.len()),
            anchors_m: Vec::with_capacity(self.paths.len()),
            mesh: key.mesh.clone(),
            positions_m: Vec::with_capacity(self.paths.len()),
            textures: Vec::with_capacity(self.paths.len()),
            guessed_from_u: key.guessed_from_u,
            colour: mean_colour(key.texture),
        };
        for (solid, points) in solids[self.reached()].iter().zip(&self.paths) {
            run.frames.push(solid.body.frame);
            run.anchors_m.push(solid.body.anchor_m.as_vec3());
            let position = |point: &u32| points[*point as usize].as_vec3().to_array();
            run.positions_m.push(topology.point_of.iter().map(position).collect());
            let dressed = Dressed {
                mesh: solid.body.mesh,
                triangles: &solid.triangles,
                surface: &solid.target.surface,
                texture: solid.body.texture,
                guessed_from_u: solid.body.guessed_from_u,
            };
            run.textures.push(resample(&texels, &topology.triangles, points, &dressed, &ground));
        }
        run.textures = steady(&run.textures);
        run
    }
}

/// How far two surfaces are apart, the worse way, root mean square, metres.
fn misfit(topology: &Topology, points: &[DVec3], body: &Solid<'_>) -> f64 {
    let triangles = topology.in_space(points);
    let Some(own) = Surface::new(&triangles) else { return f64::INFINITY };
    let mean = |squares: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = squares.fold((0.0, 0), |(sum, count), square| (sum + square, count + 1));
        if count == 0 { f64::INFINITY } else { (sum / f64::from(count)).sqrt() }
    };
    let forth = mean(&mut points.iter().map(|point| body.target.surface.distance(*point).powi(2)));
    let back = mean(&mut body.target.places.iter().step_by(2).map(|(place, _)| own.distance(*place).powi(2)));
    forth.max(back)
}

fn pixels(picture: &RgbImage) -> PixelImage {
    let rgba = picture.pixels().flat_map(|image::Rgb([r, g, b])| [*r, *g, *b, 255]).collect();
    PixelImage { width_px: picture.width(), height_px: picture.height(), rgba }
}

fn mean_colour(picture: &RgbImage) -> [u8; 3] {
    let count = u64::from(picture.width()) * u64::from(picture.height()).max(1);
    let mut sums = [0u64; 3];
    for pixel in picture.pixels() {
        sums.iter_mut().zip(pixel.0).for_each(|(sum, value)| *sum += u64::from(value));
    }
    sums.map(|sum| (sum / count.max(1)) as u8)
}
