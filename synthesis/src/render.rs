//! Renders people, ball and goals into the stadium: rasterise at several moments, shade, average, lay over the background.
//! Works on any window of the clip's picture, so that a crop costs only its own pixels.

use std::borrow::Cow;

use glam::{Vec2, Vec3, Vec4};
use protocol::camera::Camera;

use crate::{
    figure::Figure,
    nets::{NetLook, Nets},
    raster::{self, Grid, Hit, NOTHING, Projected, Raster, TILE},
    rays::PixelRays,
    rig::Posed,
    sensor,
    shading::Shader,
    shadows::Shadows,
    shutter::{Flow, Shutter},
    stadium::Stadium,
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
    /// People; the index is the identity in [`Scene::first_hits`].
    pub actors: Vec<Actor<'a>>,
    /// Ball, posts, flags, dug-outs.
    pub solids: Vec<Cow<'a, Solid>>,
    /// The goals' nets, when there are goals.
    pub nets: Option<NetLook>,
}

/// A window of the clip's picture, in pixels; may reach outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Top-left pixel.
    pub first: [i32; 2],
    /// Width and height.
    pub size: [usize; 2],
}

/// What lies far behind the sharp distance is out of focus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Focus {
    /// Everything deeper than this is blurred, metres.
    pub beyond_m: f32,
    /// Standard deviation of its blur, pixels.
    pub blur_px: f32,
}

/// How a picture is taken.
#[derive(Clone, Copy, Default)]
pub struct Exposure<'a> {
    /// Samples along each side of a pixel, at least 1.
    pub side: usize,
    /// Motion during the exposure; everything is frozen without.
    pub shutter: Option<Shutter<'a>>,
    /// Depth of field; everything is sharp without.
    pub focus: Option<Focus>,
}

/// A picture of linear light.
#[derive(Clone, Debug)]
pub struct Light {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Row by row.
    pub pixels: Vec<Vec3>,
    /// Where the middle of the clip's picture lies in this one, pixels.
    pub centre: Vec2,
}

/// Meshes projected into a grid and drawn. A mesh that cannot be in the grid has no vertices here.
pub(crate) struct Drawn {
    pub(crate) raster: Raster,
    pub(crate) vertices: Vec<Vec<Projected>>,
    pub(crate) firsts: Vec<u32>,
}

impl Drawn {
    pub(crate) fn mesh_of(&self, triangle: u32) -> Option<usize> {
        (triangle != NOTHING).then(|| self.firsts.partition_point(|&first| first <= triangle) - 1)
    }
}

/// People in one tile of pixels: colour times coverage, and coverage; near and out of focus.
struct Patch {
    first: [usize; 2],
    layers: [[Vec4; TILE * TILE]; 2],
    nearest_m: [f32; TILE * TILE],
}

impl Scene<'_> {
    pub(crate) fn meshes(&self) -> impl Iterator<Item = (&[Vec3], &[[u32; 3]])> {
        let people =
            self.actors.iter().map(|a| (a.posed.positions.as_slice(), a.figure.triangles.as_slice()));
        people.chain(self.solids.iter().map(|s| (s.positions.as_slice(), s.triangles.as_slice())))
    }

    /// Draws everything; with `moved`, at the place between this scene and that one at that share.
    fn draw(&self, camera: &Camera, grid: Grid, moved: Option<(&Scene<'_>, f32)>) -> Drawn {
        let mut drawn = Drawn { raster: Raster::new(grid), vertices: Vec::new(), firsts: Vec::new() };
        let mut others = moved.iter().flat_map(|(scene, _)| scene.meshes());
        let mut first = 0;
        for (positions, triangles) in self.meshes() {
            let later = others.next().map(|(later, _)| later).filter(|later| later.len() == positions.len());
            let mut projected = Vec::new();
            if may_be_in(camera, &grid, positions) {
                let share = moved.map_or(0.0, |(_, share)| share);
                raster::project_moving(
                    camera,
                    &grid,
                    positions,
                    later.unwrap_or(positions),
                    share,
                    &mut projected,
                );
                drawn.raster.draw(&projected, triangles, first);
            }
            drawn.vertices.push(projected);
            drawn.firsts.push(first);
            first += triangles.len() as u32;
        }
        drawn
    }

    /// For every sample of `grid`: the actor in front and the depth along the optical axis; `None` where the
    /// background or a thing is in front.
    #[must_use]
    pub fn first_hits(&self, camera: &Camera, grid: Grid) -> Vec<Option<(usize, f32)>> {
        let drawn = self.draw(camera, grid, None);
        let mut hits = vec![None; grid.width * grid.height];
        for [i, j] in drawn.raster.tiles() {
            for (place, hit) in drawn.raster.tile(i, j).into_iter().flatten().enumerate() {
                let (x, y) = (i + place % TILE, j + place / TILE);
                let actor = drawn.mesh_of(hit.triangle).filter(|mesh| *mesh < self.actors.len());
                if let Some(actor) = actor
                    && x < grid.width
                    && y < grid.height
                {
                    hits[y * grid.width + x] = Some((actor, 1.0 / hit.inverse_depth));
                }
            }
        }
        hits
    }

    /// Renders a window with `side × side` samples per pixel, nothing moving and all of it sharp.
    #[must_use]
    pub fn render(&self, camera: &Camera, window: Window, side: usize) -> Light {
        self.expose(camera, window, &Exposure { side, ..Exposure::default() })
    }

    /// Renders a window as an exposure of some length sees it.
    #[must_use]
    pub fn expose(&self, camera: &Camera, window: Window, exposure: &Exposure<'_>) -> Light {
        let rays = PixelRays::new(camera);
        let nets = self.nets.as_ref().map(|look| Nets::new(look, &self.stadium.pitch, camera));
        let (mut pixels, walls) = self.background(camera, window, &rays, nets.as_ref());
        if let Some(shutter) = &exposure.shutter {
            let flow = Flow::new(camera, shutter, window);
            if flow.longest_px > 0.6 {
                pixels = flow.blur(&pixels, window.size);
            }
        }
        let patches = self.people(camera, window, exposure, &walls);
        let lay = |layer: usize, pixels: &mut [Vec3]| {
            for patch in &patches {
                for (place, colour) in patch.layers[layer].iter().enumerate() {
                    let (x, y) = (patch.first[0] + place % TILE, patch.first[1] + place / TILE);
                    if colour.w == 0.0 || x >= window.size[0] || y >= window.size[1] {
                        continue;
                    }
                    let pixel =
                        Vec2::new(x as f32 + window.first[0] as f32, y as f32 + window.first[1] as f32);
                    let mut front = colour.truncate();
                    let veil = nets.as_ref().and_then(|nets| nets.over(&rays, pixel, patch.nearest_m[place]));
                    if let Some((open, net)) = veil {
                        front = front * open + net * colour.w;
                    }
                    let behind = &mut pixels[y * window.size[0] + x];
                    *behind = *behind * (1.0 - colour.w) + front;
                }
            }
        };
        if let Some(focus) = &exposure.focus {
            lay(1, &mut pixels);
            pixels = sensor::gaussian(&pixels, window.size, focus.blur_px);
        }
        lay(0, &mut pixels);
        let first = Vec2::new(window.first[0] as f32, window.first[1] as f32);
        Light { size: window.size, pixels, centre: camera.centre_px().as_vec2() - first }
    }

    /// The empty stadium, and how deep its walls stand at each pixel.
    fn background(
        &self,
        camera: &Camera,
        window: Window,
        rays: &PixelRays,
        nets: Option<&Nets<'_>>,
    ) -> (Vec<Vec3>, Vec<f32>) {
        let shadows = Shadows::new(self, camera, window);
        let [width, height] = window.size;
        let (mut pixels, mut walls) =
            (Vec::with_capacity(width * height), Vec::with_capacity(width * height));
        for y in 0..height {
            for x in 0..width {
                let pixel =
                    Vec2::new((window.first[0] + x as i32) as f32, (window.first[1] + y as i32) as f32);
                let seen = self.stadium.see(rays, pixel, || shadows.at(x, y));
                let veil = nets.and_then(|nets| nets.over(rays, pixel, seen.depth_m));
                pixels.push(veil.map_or(seen.light, |(open, net)| seen.light * open + net));
                walls.push(if seen.upright { seen.depth_m } else { f32::MAX });
            }
        }
        (pixels, walls)
    }

    /// People and things, sampled over the pixels and over the exposure.
    fn people(&self, camera: &Camera, window: Window, exposure: &Exposure<'_>, walls: &[f32]) -> Vec<Patch> {
        let side = exposure.side.max(1);
        let count = side * side;
        let drawn: Vec<Drawn> = (0..count)
            .map(|k| {
                // Each sample of a pixel has its own moment; neighbours in the pixel are far apart in time.
                let moment = ((k * 7) % count) as f32 / count as f32 + 0.5 / count as f32 - 0.5;
                let inset = 0.5 - 0.5 / side as f64;
                let off = [k % side, k / side].map(|s| s as f64 / side as f64 - inset);
                let grid = Grid {
                    origin_px: [0, 1].map(|a| f64::from(window.first[a]) + off[a]),
                    per_px: 1.0,
                    width: window.size[0],
                    height: window.size[1],
                };
                match &exposure.shutter {
                    Some(shutter) => {
                        let moved = Some((shutter.other, shutter.open * moment));
                        self.draw(&shutter.camera_at(camera, moment), grid, moved)
                    }
                    None => self.draw(camera, grid, None),
                }
            })
            .collect();
        let mut firsts: Vec<[usize; 2]> = drawn.iter().flat_map(|d| d.raster.tiles()).collect();
        firsts.sort_unstable();
        firsts.dedup();
        let shader = Shader::new(self, camera);
        let beyond = exposure.focus.map_or(f32::MAX, |focus| focus.beyond_m);
        firsts.into_iter().map(|first| patch(first, &drawn, &shader, beyond, walls)).collect()
    }
}

/// Shades one tile of pixels.
fn patch(first: [usize; 2], drawn: &[Drawn], shader: &Shader<'_>, beyond_m: f32, walls: &[f32]) -> Patch {
    let tiles: Vec<Option<&[Hit]>> = drawn.iter().map(|d| d.raster.tile(first[0], first[1])).collect();
    let mut patch =
        Patch { first, layers: [[Vec4::ZERO; TILE * TILE]; 2], nearest_m: [f32::MAX; TILE * TILE] };
    for place in 0..TILE * TILE {
        let (i, j) = (first[0] + place % TILE, first[1] + place / TILE);
        let (mut sums, mut shaded, mut covered) = ([Vec3::ZERO; 2], [0u32; 2], [0u32; 2]);
        let mut last = (NOTHING, Vec3::ZERO);
        let width = drawn.first().map_or(0, |drawn| drawn.raster.grid.width);
        let wall = if i < width { walls.get(j * width + i) } else { None }.copied().unwrap_or(f32::MAX);
        for (k, tile) in tiles.iter().enumerate() {
            let Some(hit) = tile.map(|tile| tile[place]).filter(|hit| hit.triangle != NOTHING) else {
                continue;
            };
            let depth = 1.0 / hit.inverse_depth;
            if depth > wall {
                continue; // behind a board
            }
            let layer = usize::from(depth > beyond_m);
            covered[layer] += 1;
            patch.nearest_m[place] = patch.nearest_m[place].min(depth);
            // Colour varies less than coverage: every other sample is shaded, unless it is the only one so far.
            if k % 2 == 0 || shaded[layer] == 0 {
                if last.0 != hit.triangle {
                    last = (hit.triangle, shader.shade(&drawn[k], hit.triangle, i, j));
                }
                sums[layer] += last.1;
                shaded[layer] += 1;
            }
        }
        for layer in 0..2 {
            if covered[layer] > 0 {
                let share = covered[layer] as f32 / drawn.len() as f32;
                patch.layers[layer][place] = (sums[layer] * (share / shaded[layer] as f32)).extend(share);
            }
        }
    }
    patch
}
/// Whether a mesh can touch the grid, by the sphere round its box; a moving one gets some pixels more.
pub(crate) fn may_be_in(camera: &Camera, grid: &Grid, positions: &[Vec3]) -> bool {
    let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
    for p in positions {
        (low, high) = (low.min(*p), high.max(*p));
    }
    let (centre, radius) = (((low + high) / 2.0).as_dvec3(), f64::from(low.distance(high)) / 2.0);
    let depth = camera.depth(centre);
    if depth < radius + 0.5 {
        return depth > -radius;
    }
    let Some(pixel) = camera.project(centre) else { return true };
    let reach = radius * camera.focal_px / (depth - radius) * 1.3 + 60.0;
    let end = |k: usize, count: usize| grid.origin_px[k] + count as f64 / grid.per_px;
    let near = |k: usize, value: f64, count: usize| {
        value > grid.origin_px[k] - reach && value < end(k, count) + reach
    };
    near(0, pixel.x, grid.width) && near(1, pixel.y, grid.height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{props, venue::Venue};
    use glam::DVec3;

    /// Where something lighter than its surroundings lies along a row of pixels, to a fraction of a pixel.
    fn middle(light: &Light, first: i32) -> f64 {
        let values: Vec<f64> = light.pixels.iter().map(|p| f64::from(p.z)).collect();
        let ground = values[0].min(values[values.len() - 1]);
        let (mut sum, mut weights) = (0.0, 0.0);
        for (k, value) in values.iter().enumerate() {
            let weight = (value - ground - 0.08).max(0.0);
            sum += weight * (f64::from(first) + k as f64);
            weights += weight;
        }
        assert!(weights > 0.1, "nothing light in {values:?}");
        sum / weights
    }

    #[test]
    fn picture_and_projection_agree_on_lines_and_posts_through_a_bending_lens() {
        let mut venue = Venue::plain(1, Default::default(), [[0.9; 3], [0.1; 3]]);
        venue.stadium.turf.look.wear = 0.0;
        let goals = props::goals(&venue.stadium.pitch, &venue.net);
        let solids = goals.iter().map(Cow::Borrowed).collect();
        let scene = Scene { stadium: &venue.stadium, actors: Vec::new(), solids, nets: None };
        for k1 in [-0.12, 0.0, 0.2] {
            let position = DVec3::new(22.0, 17.0, 58.0);
            let camera = Camera {
                k1,
                ..Camera::looking_at((1280, 720), 1250.0, position, DVec3::new(27.0, 0.0, 4.0))
            };
            let mut places = Vec::new();
            // The halfway line and the front of the penalty area.
            for (x, z) in [(0.0, -28.0), (0.0, -15.0), (36.0, -12.0), (36.0, 12.0)] {
                places.push(DVec3::new(x, 0.0, z));
            }
            for z in [-3.72, 3.72] {
                places.push(DVec3::new(52.5, 1.2, z)); // the posts
            }
            for place in places {
                let wanted = camera.project(place).unwrap();
                assert!(camera.contains(wanted), "{place} is at {wanted}");
                let first = [wanted.x.round() as i32 - 9, wanted.y.round() as i32];
                let light = scene.render(&camera, Window { first, size: [19, 1] }, 5);
                // What the line does between the wanted height and the middle of the row.
                let step = if place.y > 0.0 { DVec3::Y } else { DVec3::Z } * 0.05;
                let beside = camera.project(place + step).unwrap() - wanted;
                let expected = wanted.x + beside.x / beside.y * (f64::from(first[1]) - wanted.y);
                let found = middle(&light, first[0]);
                assert!(
                    (found - expected).abs() < 0.1,
                    "k1 {k1}, {place}: {found:.3} instead of {expected:.3}"
                );
            }
        }
    }
}
