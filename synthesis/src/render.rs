//! Renders people, ball and goals into the stadium: rasterise, shade every sample, average, then the camera's own marks.
//! Works on any window of the clip's picture, so that a crop costs only its own pixels.

use glam::{Vec2, Vec3};
use protocol::camera::Camera;

use crate::{
    figure::Figure,
    paint::{self, SurfacePoint},
    raster::{self, Grid, NOTHING, Projected, Raster},
    rig::Posed,
    stadium::{PixelRays, Stadium},
};

/// A person in the world.
#[derive(Clone, Debug)]
pub struct Actor<'a> {
    /// Shape and clothes.
    pub figure: &'a Figure,
    /// The surface in the world.
    pub posed: Posed,
}

/// A thing with one colour per triangle.
#[derive(Clone, Debug, Default)]
pub struct Solid {
    /// Vertices in the world.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals.
    pub normals: Vec<Vec3>,
    /// Triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Linear colour of each triangle.
    pub colours: Vec<Vec3>,
}

/// What is in front of the camera.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    /// Everything that does not move.
    pub stadium: &'a Stadium,
    /// People; the index is the identity in [`first_hits`].
    pub actors: Vec<Actor<'a>>,
    /// Ball, posts, flags.
    pub solids: Vec<Solid>,
}

/// A window of the clip's picture, in pixels; may reach outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Top-left pixel.
    pub first: [i32; 2],
    /// Width and height.
    pub size: [usize; 2],
}

/// A picture of linear light.
#[derive(Clone, Debug)]
pub struct Light {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Row by row.
    pub pixels: Vec<Vec3>,
}

/// Meshes projected into a grid, ready to draw.
struct Projections {
    vertices: Vec<Vec<Projected>>,
    firsts: Vec<u32>,
}

impl<'a> Scene<'a> {
    fn meshes(&self) -> impl Iterator<Item = (&[Vec3], &[[u32; 3]])> {
        let people =
            self.actors.iter().map(|a| (a.posed.positions.as_slice(), a.figure.triangles.as_slice()));
        people.chain(self.solids.iter().map(|s| (s.positions.as_slice(), s.triangles.as_slice())))
    }

    fn draw(&self, camera: &Camera, grid: Grid) -> (Raster, Projections) {
        let mut raster = Raster::new(grid);
        let mut projections = Projections { vertices: Vec::new(), firsts: Vec::new() };
        let mut first = 0;
        for (positions, triangles) in self.meshes() {
            let mut projected = Vec::new();
            raster::project(camera, &grid, positions, &mut projected);
            raster.draw(&projected, triangles, first);
            projections.vertices.push(projected);
            projections.firsts.push(first);
            first += triangles.len() as u32;
        }
        (raster, projections)
    }

    /// For every sample of `grid`: the actor in front and the depth along the optical axis; `None` where the
    /// background or a thing is in front.
    #[must_use]
    pub fn first_hits(&self, camera: &Camera, grid: Grid) -> Vec<Option<(usize, f32)>> {
        let (raster, projections) = self.draw(camera, grid);
        raster
            .triangle
            .iter()
            .zip(&raster.inverse_depth)
            .map(|(&triangle, &inverse)| {
                let mesh = projections.mesh_of(triangle)?;
                (mesh < self.actors.len()).then_some((mesh, 1.0 / inverse))
            })
            .collect()
    }

    /// Renders a window with `side × side` samples per pixel.
    #[must_use]
    pub fn render(&self, camera: &Camera, window: Window, side: usize) -> Light {
        let grid = Grid::over_pixels(window.first, window.size, side);
        let (raster, projections) = self.draw(camera, grid);
        let shadows = self.shadows(camera, window);
        let rays = PixelRays::new(camera);
        let [width, height] = window.size;
        let mut pixels = Vec::with_capacity(width * height);
        let share = 1.0 / (side * side) as f32;
        let eye = camera.position.as_vec3();
        for y in 0..height {
            for x in 0..width {
                let pixel =
                    Vec2::new((window.first[0] + x as i32) as f32, (window.first[1] + y as i32) as f32);
                let (mut light, mut covered, mut nearest) = (Vec3::ZERO, 0, f32::MAX);
                for sub in 0..side * side {
                    let (i, j) = (x * side + sub % side, y * side + sub / side);
                    let place = j * grid.width + i;
                    if raster.triangle[place] == NOTHING {
                        continue;
                    }
                    light +=
                        self.shade(&projections, raster.triangle[place], i, j, eye).min(Vec3::splat(1.3));
                    covered += 1;
                    nearest = nearest.min(1.0 / raster.inverse_depth[place]);
                }
                if covered < side * side {
                    let seen = self.stadium.see(&rays, pixel, |lamp| shadows.share(lamp, x, y));
                    let behind = self.stadium.nets(&rays, pixel, seen.depth_m);
                    light += (seen.light * behind.0 + behind.1) * (side * side - covered) as f32;
                }
                light *= share;
                if covered > 0 {
                    let (open, net) = self.stadium.nets(&rays, pixel, nearest);
                    let part = covered as f32 * share;
                    light = light * (1.0 - part * (1.0 - open)) + net * part;
                }
                pixels.push(light);
            }
        }
        Light { size: window.size, pixels }
    }

    fn shade(&self, projections: &Projections, triangle: u32, i: usize, j: usize, eye: Vec3) -> Vec3 {
        let Some(mesh) = projections.mesh_of(triangle) else { return Vec3::ZERO };
        let index = (triangle - projections.firsts[mesh]) as usize;
        let projected = &projections.vertices[mesh];
        let interpolate = |corners: [u32; 3], values: [Vec3; 3]| {
            let [Some(a), Some(b), Some(c)] = corners.map(|v| projected[v as usize]) else {
                return values[0];
            };
            let weights = Raster::weights(a, b, c, i, j);
            values[0] * weights[0] + values[1] * weights[1] + values[2] * weights[2]
        };
        if let Some(actor) = self.actors.get(mesh) {
            let corners = actor.figure.triangles[index];
            let vertices = corners.map(|v| &actor.figure.vertices[v as usize]);
            let hems = vertices.map(|v| Vec3::splat(v.hem_m));
            let position = interpolate(corners, corners.map(|v| actor.posed.positions[v as usize]));
            let point = SurfacePoint {
                rest: interpolate(corners, vertices.map(|v| v.rest)),
                normal: interpolate(corners, corners.map(|v| actor.posed.normals[v as usize]))
                    .normalize_or(Vec3::Y),
                hem_m: interpolate(corners, hems).x,
                material: actor.figure.materials[index],
            };
            let towards = (eye - position).normalize_or(Vec3::Z);
            paint::lit(actor.figure, &point, towards, &self.stadium.lights, position.y)
        } else {
            let solid = &self.solids[mesh - self.actors.len()];
            let corners = solid.triangles[index];
            let normal =
                interpolate(corners, corners.map(|v| solid.normals[v as usize])).normalize_or(Vec3::Y);
            solid.colours[index] * self.stadium.lights.on(normal, 1.0)
        }
    }

    /// Shadows on the grass: everything pressed flat along each lamp's direction, seen by the camera, softened.
    fn shadows(&self, camera: &Camera, window: Window) -> Shadows {
        let grid = Grid::over_pixels(window.first, window.size, 1);
        let mut layers = Vec::new();
        // After the lamps comes the open sky: what stands over the grass keeps its light away straight below.
        for towards in self.stadium.lights.lamps.iter().map(|(towards, _)| towards).chain([&Vec3::Y]) {
            let mut raster = Raster::new(grid);
            let mut projected = Vec::new();
            let mut flat = Vec::new();
            for (positions, triangles) in self.meshes() {
                flat.clear();
                flat.extend(positions.iter().map(|p| {
                    let p = *p - *towards * (p.y.max(0.0) / towards.y.max(0.05));
                    Vec3::new(p.x, 0.0, p.z)
                }));
                raster::project(camera, &grid, &flat, &mut projected);
                raster.draw(&projected, triangles, 0);
            }
            let hard: Vec<f32> =
                raster.triangle.iter().map(|&t| if t == NOTHING { 0.0 } else { 1.0 }).collect();
            layers.push(box_blur(&hard, window.size));
        }
        if let Some(sky) = layers.last_mut() {
            *sky = box_blur(&box_blur(sky, window.size), window.size);
        }
        Shadows { width: window.size[0], layers }
    }
}

impl Projections {
    fn mesh_of(&self, triangle: u32) -> Option<usize> {
        (triangle != NOTHING).then(|| self.firsts.partition_point(|&first| first <= triangle) - 1)
    }
}

struct Shadows {
    width: usize,
    layers: Vec<Vec<f32>>,
}

impl Shadows {
    fn share(&self, lamp: usize, x: usize, y: usize) -> f32 {
        self.layers.get(lamp).and_then(|layer| layer.get(y * self.width + x)).copied().unwrap_or(0.0)
    }
}

/// A 3 × 3 mean; at the border of the window the outermost values repeat.
fn box_blur(values: &[f32], [width, height]: [usize; 2]) -> Vec<f32> {
    let mut across = vec![0.0; values.len()];
    for y in 0..height {
        let row = y * width;
        for x in 0..width {
            let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
            across[row + x] = (values[row + left] + values[row + x] + values[row + right]) / 3.0;
        }
    }
    let mut out = vec![0.0; values.len()];
    for y in 0..height {
        let (up, down) = (y.saturating_sub(1) * width, (y + 1).min(height - 1) * width);
        for x in 0..width {
            out[y * width + x] = (across[up + x] + across[y * width + x] + across[down + x]) / 3.0;
        }
    }
    out
}
