//! The texture of one mesh in many frames: what each frame's own body shows at the place where the mesh's texel is.

use glam::{DVec2, DVec3};
use image::RgbImage;
use protocol::{chunk::PixelImage, mesh::Mesh};

use crate::{
    geometry::bilinear,
    surface::{Surface, Triangle, barycentric, nearest_on_triangle},
};

/// Texels this far outside a triangle still take its colour: filtering reads them.
const MARGIN_PX: f64 = 2.5;
/// Another frame's body farther away than this has nothing to show, metres.
const REACH_M: f64 = 0.25;

/// How much a colour counts that was seen, and one that was guessed.
const SEEN: u8 = 255;
const GUESSED: u8 = 40;
/// Colours of this many frames before and after count, less the farther away they are (standard deviation, frames).
const SPREAD_FRAMES: f32 = 2.0;
const NEAR_FRAMES: usize = 5;

/// A colour that was seen takes over others this near to it, root of the sum of squares of 255; farther ones are of another place of the body, which the
/// mesh has slid over, and would blur it.
const ALIKE: f32 = 50.0;

/// Steadies the colours of each texel over time (a bilateral filter): what was seen counts more than what was guessed, what is alike more than what is not.
pub(super) fn steady(pictures: &[PixelImage]) -> Vec<PixelImage> {
    let near =
        |frame: usize| frame.saturating_sub(NEAR_FRAMES)..(frame + NEAR_FRAMES + 1).min(pictures.len());
    let steadied = |(frame, picture): (usize, &PixelImage)| {
        let own = picture.rgba.as_chunks::<4>().0;
        let mut sums = vec![[0.0f32; 4]; own.len()];
        for other in near(frame) {
            let steps = other.abs_diff(frame) as f32 / SPREAD_FRAMES;
            let share = (-0.5 * steps * steps).exp();
            for ((sum, [r, g, b, counts]), own) in
                sums.iter_mut().zip(pictures[other].rgba.as_chunks::<4>().0).zip(own)
            {
                let apart = |a: u8, b: u8| (f32::from(a) - f32::from(b)).powi(2);
                let apart = apart(*r, own[0]) + apart(*g, own[1]) + apart(*b, own[2]);
                // A guess has nothing to defend.
                let alike = if own[3] == SEEN { (-0.5 * apart / (ALIKE * ALIKE)).exp() } else { 1.0 };
                let weight = share * alike * f32::from(*counts);
                for (sum, value) in sum.iter_mut().zip([f32::from(*r), f32::from(*g), f32::from(*b), 1.0]) {
                    *sum += weight * value;
                }
            }
        }
        let rgba = sums.iter().flat_map(|[r, g, b, weight]| {
            let [r, g, b] = [r, g, b].map(|sum| (sum / weight + 0.5) as u8);
            [r, g, b, 255]
        });
        PixelImage { rgba: rgba.collect(), ..*picture }
    };
    pictures.iter().enumerate().map(steadied).collect()
}

/// A texel that a mesh wears: which triangle, and the weights of its corners.
#[derive(Clone, Copy, Debug)]
struct Texel {
    x: u32,
    y: u32,
    triangle: u32,
    weights: [f32; 3],
}

/// The texels that the triangles of a mesh wear on a texture.
pub(super) struct Texels {
    width: u32,
    height: u32,
    texels: Vec<Texel>,
}

impl Texels {
    /// Every texel in or near a triangle, with the triangle that it is deepest in.
    pub(super) fn of(mesh: &Mesh, width: u32, height: u32) -> Self {
        let mut best: Vec<(f64, Option<Texel>)> = vec![(MARGIN_PX, None); width as usize * height as usize];
        for (index, corners) in mesh.triangles.iter().enumerate() {
            let corner = |vertex: u32| {
                let [u, v] = mesh.uvs.get(vertex as usize).copied().unwrap_or_default();
                DVec3::new(f64::from(u) * f64::from(width) - 0.5, f64::from(v) * f64::from(height) - 0.5, 0.0)
            };
            let triangle = corners.map(corner);
            let low = triangle.iter().fold(DVec3::INFINITY, |low, p| low.min(*p)) - MARGIN_PX;
            let high = triangle.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p)) + MARGIN_PX;
            let range = |low: f64, high: f64, side: u32| {
                (low.ceil().max(0.0) as u32)..((high.floor() + 1.0).clamp(0.0, f64::from(side)) as u32)
            };
            for y in range(low.y, high.y, height) {
                for x in range(low.x, high.x, width) {
                    let here = DVec3::new(f64::from(x), f64::from(y), 0.0);
                    let near = nearest_on_triangle(here, triangle);
                    let outside = here.distance(near);
                    let place = &mut best[(y * width + x) as usize];
                    if outside < place.0 {
                        let weights = barycentric(near, triangle).map(|weight| weight as f32);
                        *place = (outside, Some(Texel { x, y, triangle: index as u32, weights }));
                    }
                }
            }
        }
        Self { width, height, texels: best.into_iter().filter_map(|(_, texel)| texel).collect() }
    }
}

/// A body of one frame, as it was lifted.
pub(super) struct Dressed<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) triangles: &'a [Triangle],
    pub(super) surface: &'a Surface,
    pub(super) texture: &'a RgbImage,
    pub(super) guessed_from_u: Option<f32>,
}

/// The texture of the mesh whose `texels` these are, with its points at `points`, as `body` looks there; elsewhere `ground`.
pub(super) fn resample(
    texels: &Texels,
    corners: &[[u32; 3]],
    points: &[DVec3],
    body: &Dressed<'_>,
    ground: &PixelImage,
) -> PixelImage {
    let mut picture = ground.clone();
    // How much a pixel counts, until it is steadied.
    picture.rgba.as_chunks_mut::<4>().0.iter_mut().for_each(|pixel| pixel[3] = GUESSED);
    for texel in &texels.texels {
        let triangle = corners[texel.triangle as usize].map(|corner| points[corner as usize]);
        let [u, v, w] = texel.weights.map(f64::from);
        let [a, b, c] = triangle;
        let place = a * u + b * v + c * w;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let near = body.surface.nearest_facing(place, normal, 0.0, REACH_M);
        let Some(near) = near.or_else(|| body.surface.nearest(place)) else { continue };
        let weights = barycentric(near.point, body.triangles[near.triangle]);
        let Some(colour) = colour_at(body, near.triangle, weights) else { continue };
        let at = (texel.y as usize * texels.width as usize + texel.x as usize) * 4;
        let seen = body.guessed_from_u.is_none_or(|from| {
            let corners = body.mesh.triangles[near.triangle];
            corners.iter().any(|corner| body.mesh.uvs[*corner as usize][0] < from)
        });
        if let Some(pixel) = picture.rgba.get_mut(at..at + 4) {
            pixel[..3].copy_from_slice(&colour);
            pixel[3] = if seen { SEEN } else { GUESSED };
        }
    }
    debug_assert_eq!((texels.width, texels.height), (ground.width_px, ground.height_px));
    picture
}

/// The colour of a body at a place of its mesh.
fn colour_at(body: &Dressed<'_>, triangle: usize, weights: [f64; 3]) -> Option<[u8; 3]> {
    let corners = body.mesh.triangles.get(triangle)?;
    let mut uv = [0.0; 2];
    for (corner, weight) in corners.iter().zip(weights) {
        let [u, v] = *body.mesh.uvs.get(*corner as usize)?;
        uv = [uv[0] + weight * f64::from(u), uv[1] + weight * f64::from(v)];
    }
    Some(sampled(body.texture, uv).map(|value| (value + 0.5) as u8))
}

/// The colour of a picture at a texture coordinate, 0..255.
pub(crate) fn sampled(picture: &RgbImage, [u, v]: [f64; 2]) -> [f32; 3] {
    let size = DVec2::new(f64::from(picture.width()), f64::from(picture.height()));
    bilinear(picture, DVec2::new(u, v) * size - 0.5)
}
