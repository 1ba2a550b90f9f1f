//! A small z-buffer rasteriser: which triangle is in front at every sample of a regular grid laid over the picture.
//! Samples lie in clip pixels, so the same code renders pictures (several samples per pixel) and exact depth at any grid.
//! Memory is taken in tiles where something is drawn: people cover a few hundredths of a broadcast picture.

use glam::{DVec3, Vec2, Vec3};
use protocol::camera::Camera;

/// A regular grid of samples: sample (i, j) looks through the clip pixel `origin_px + (i, j) / per_px`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Clip pixel of the first sample.
    pub origin_px: [f64; 2],
    /// Samples per clip pixel, along one side.
    pub per_px: f64,
    /// Samples across.
    pub width: usize,
    /// Samples down.
    pub height: usize,
}

impl Grid {
    /// `side × side` samples in each of the pixels `width × height` from pixel `first` on.
    #[must_use]
    pub fn over_pixels(first: [i32; 2], size: [usize; 2], side: usize) -> Self {
        let inset = 0.5 - 0.5 / side as f64;
        Self {
            origin_px: first.map(|p| f64::from(p) - inset),
            per_px: side as f64,
            width: size[0] * side,
            height: size[1] * side,
        }
    }

    /// The clip pixel of a sample.
    #[must_use]
    pub fn pixel(&self, i: usize, j: usize) -> [f64; 2] {
        [self.origin_px[0] + i as f64 / self.per_px, self.origin_px[1] + j as f64 / self.per_px]
    }
}

/// No triangle.
pub const NOTHING: u32 = u32::MAX;

/// Side of a tile, samples.
pub const TILE: usize = 16;

/// What is in front at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Index of the triangle, counted over everything drawn; [`NOTHING`] where nothing is.
    pub triangle: u32,
    /// 1 / depth along the optical axis; 0 where nothing is.
    pub inverse_depth: f32,
}

const EMPTY: Hit = Hit { triangle: NOTHING, inverse_depth: 0.0 };

/// The front-most triangle of every sample.
#[derive(Clone, Debug)]
pub struct Raster {
    /// The samples.
    pub grid: Grid,
    tiles_across: usize,
    /// Where each tile's samples begin in `hits`; [`NOTHING`] for tiles without any.
    slots: Vec<u32>,
    hits: Vec<Hit>,
}

/// A vertex in the grid: sample coordinates and 1 / depth.
pub type Projected = Option<Vec3>;

/// Projects points into `grid`, with the lens's distortion; `None` behind the camera and beyond the lens's reach.
pub fn project(camera: &Camera, grid: &Grid, points: &[Vec3], out: &mut Vec<Projected>) {
    project_moving(camera, grid, points, points, 0.0, out);
}

/// As [`project`], for points that are `share` of the way from `points` to `later` (which may lie outside 0..1).
pub fn project_moving(
    camera: &Camera,
    grid: &Grid,
    points: &[Vec3],
    later: &[Vec3],
    share: f32,
    out: &mut Vec<Projected>,
) {
    out.clear();
    let rotation = camera.rotation.as_mat3();
    let scale = (camera.focal_px * grid.per_px) as f32;
    let centre = camera.centre_px();
    let offset = Vec2::new(
        ((centre.x - grid.origin_px[0]) * grid.per_px) as f32,
        ((centre.y - grid.origin_px[1]) * grid.per_px) as f32,
    );
    let k1 = camera.k1 as f32;
    out.extend(points.iter().zip(later).map(|(&point, &later)| {
        let point = point + (later - point) * share;
        // The difference is taken in double precision: the camera is far away.
        let p = rotation * (DVec3::from(point) - camera.position).as_vec3();
        if p.z <= 0.3 {
            return None;
        }
        let n = p.truncate() / p.z;
        let bent = k1 * n.length_squared();
        // Where three times the bend reaches −1 the model folds back into the picture; no lens shows that.
        (bent > -0.3).then(|| (n * (1.0 + bent) * scale + offset).extend(1.0 / p.z))
    }));
}

/// Depths along the optical axis of the first and of the last surface at every sample of `grid`, 0 where there is none.
#[must_use]
pub fn first_and_last(camera: &Camera, grid: Grid, points: &[Vec3], triangles: &[[u32; 3]]) -> [Vec<f32>; 2] {
    let mut vertices = Vec::new();
    project(camera, &grid, points, &mut vertices);
    let mut front = Raster::new(grid);
    front.draw(&vertices, triangles, 0);
    // The last surface has the smallest inverse depth; taken from a constant just above all of them, it is the largest.
    let above = vertices.iter().flatten().map(|v| v.z).fold(0.0, f32::max) * 1.5;
    vertices.iter_mut().flatten().for_each(|v| v.z = above - v.z);
    let mut back = Raster::new(grid);
    back.draw(&vertices, triangles, 0);
    let depths = |raster: &Raster, inverse: &dyn Fn(f32) -> f32| {
        let samples = (0..grid.width * grid.height).map(|k| raster.at(k % grid.width, k / grid.width));
        samples.map(|hit| hit.map_or(0.0, |hit| 1.0 / inverse(hit.inverse_depth))).collect()
    };
    [depths(&front, &|value| value), depths(&back, &|value| above - value)]
}

/// The least whole number that is not below; `ceil` is a call on processors without a rounding instruction.
fn above(value: f32) -> i32 {
    let cut = value as i32;
    cut.saturating_add(i32::from((cut as f32) < value))
}

/// The greatest whole number that is not above.
fn below(value: f32) -> i32 {
    let cut = value as i32;
    cut.saturating_sub(i32::from(cut as f32 > value))
}

impl Raster {
    /// An empty raster.
    #[must_use]
    pub fn new(grid: Grid) -> Self {
        let tiles_across = grid.width.div_ceil(TILE);
        let slots = vec![NOTHING; tiles_across * grid.height.div_ceil(TILE)];
        Self { grid, tiles_across, slots, hits: Vec::new() }
    }

    /// What is in front at sample (i, j); `None` where nothing is.
    #[must_use]
    pub fn at(&self, i: usize, j: usize) -> Option<Hit> {
        let slot = *self.slots.get((j / TILE) * self.tiles_across + i / TILE)?;
        let hit = *self.hits.get((slot as usize).checked_add((j % TILE) * TILE + i % TILE)?)?;
        (hit.triangle != NOTHING).then_some(hit)
    }

    /// The tiles with something in them: samples (i, j) of their first corners.
    pub fn tiles(&self) -> impl Iterator<Item = [usize; 2]> {
        let across = self.tiles_across;
        let full = self.slots.iter().enumerate().filter(|(_, slot)| **slot != NOTHING);
        full.map(move |(index, _)| [index % across * TILE, index / across * TILE])
    }

    /// The samples of the tile that begins at (i, j), row by row; `None` when nothing is in it.
    #[must_use]
    pub fn tile(&self, i: usize, j: usize) -> Option<&[Hit]> {
        let slot = *self.slots.get((j / TILE) * self.tiles_across + i / TILE)? as usize;
        self.hits.get(slot..slot.checked_add(TILE * TILE)?)
    }

    /// Draws `triangles` over projected `vertices`; triangle `k` gets the index `first + k`.
    pub fn draw(&mut self, vertices: &[Projected], triangles: &[[u32; 3]], first: u32) {
        let (width, height) = (self.grid.width as i32, self.grid.height as i32);
        for (index, triangle) in triangles.iter().enumerate() {
            let [Some(a), Some(b), Some(c)] = triangle.map(|v| vertices.get(v as usize).copied().flatten())
            else {
                continue;
            };
            // Most triangles of a distant body lie between the samples: out with them first.
            let (y0, y1) =
                (above(a.y.min(b.y).min(c.y)).max(0), below(a.y.max(b.y).max(c.y)).min(height - 1));
            if y0 > y1 {
                continue;
            }
            let (x0, x1) = (above(a.x.min(b.x).min(c.x)).max(0), below(a.x.max(b.x).max(c.x)).min(width - 1));
            if x0 > x1 {
                continue;
            }
            let area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
            if area.abs() < 1e-9 {
                continue;
            }
            let scale = 1.0 / area;
            // Barycentric coordinates of b and c are linear in the sample position.
            let (bx, by) = ((c.y - a.y) * scale, -(c.x - a.x) * scale);
            let (cx, cy) = (-(b.y - a.y) * scale, (b.x - a.x) * scale);
            for y in y0..=y1 {
                let dy = y as f32 - a.y;
                let row = y as usize / TILE * self.tiles_across;
                let line = y as usize % TILE * TILE;
                for x in x0..=x1 {
                    let dx = x as f32 - a.x;
                    let wb = dx * bx + dy * by;
                    let wc = dx * cx + dy * cy;
                    if wb >= 0.0 && wc >= 0.0 && wb + wc <= 1.0 {
                        let inverse = a.z + (b.z - a.z) * wb + (c.z - a.z) * wc;
                        let tile = row + x as usize / TILE;
                        if self.slots[tile] == NOTHING {
                            self.slots[tile] = self.hits.len() as u32;
                            self.hits.resize(self.hits.len() + TILE * TILE, EMPTY);
                        }
                        let hit = &mut self.hits[self.slots[tile] as usize + line + x as usize % TILE];
                        if inverse > hit.inverse_depth {
                            *hit = Hit { triangle: first + index as u32, inverse_depth: inverse };
                        }
                    }
                }
            }
        }
    }

    /// Perspective-correct weights of the corners `a`, `b`, `c` at sample (i, j).
    #[must_use]
    pub fn weights(a: Vec3, b: Vec3, c: Vec3, i: usize, j: usize) -> [f32; 3] {
        let area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
        let (dx, dy) = (i as f32 - a.x, j as f32 - a.y);
        let wb = (dx * (c.y - a.y) - dy * (c.x - a.x)) / area;
        let wc = (dy * (b.x - a.x) - dx * (b.y - a.y)) / area;
        let raw = [(1.0 - wb - wc) * a.z, wb * b.z, wc * c.z];
        let sum = raw.iter().sum::<f32>().max(1e-12);
        raw.map(|weight| weight / sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera::looking_at((320, 180), 400.0, DVec3::new(0.0, 10.0, 50.0), DVec3::ZERO)
    }

    #[test]
    fn depth_of_a_tilted_triangle_is_exact() {
        let camera = camera();
        let points = [Vec3::new(-9.0, 0.0, 6.0), Vec3::new(9.0, 0.0, 4.0), Vec3::new(0.0, 0.0, -14.0)];
        let grid = Grid::over_pixels([0, 0], [320, 180], 2);
        let mut raster = Raster::new(grid);
        let mut projected = Vec::new();
        project(&camera, &grid, &points, &mut projected);
        raster.draw(&projected, &[[0, 1, 2]], 7);
        let mut hits = 0;
        for j in 0..grid.height {
            for i in 0..grid.width {
                let Some(hit) = raster.at(i, j) else { continue };
                hits += 1;
                assert_eq!(hit.triangle, 7);
                let ground = camera.ground_point(grid.pixel(i, j).into()).unwrap();
                let depth = f64::from(1.0 / hit.inverse_depth);
                assert!((depth - camera.depth(ground)).abs() < 2e-3);
            }
        }
        assert!(hits > 5_000, "{hits} samples");
    }

    #[test]
    fn rounding_agrees_with_the_library_and_survives_any_number() {
        for value in [-2.5f32, -2.0, -0.1, 0.0, 0.1, 1.0, 7.9] {
            assert_eq!((above(value), below(value)), (value.ceil() as i32, value.floor() as i32), "{value}");
        }
        assert_eq!((below(-1e30), above(1e30), below(f32::NAN)), (i32::MIN, i32::MAX, 0));
    }

    #[test]
    fn the_nearer_triangle_wins_in_either_order() {
        let camera = camera();
        let triangle = |z: f32| [Vec3::new(-5.0, -3.0, z), Vec3::new(5.0, -3.0, z), Vec3::new(0.0, 6.0, z)];
        let points: Vec<Vec3> = triangle(0.0).into_iter().chain(triangle(5.0)).collect();
        let grid = Grid::over_pixels([0, 0], [320, 180], 1);
        let mut projected = Vec::new();
        project(&camera, &grid, &points, &mut projected);
        for order in [[[0u32, 1, 2], [3, 4, 5]], [[3, 4, 5], [0, 1, 2]]] {
            let mut raster = Raster::new(grid);
            raster.draw(&projected, &order, 0);
            assert_eq!(order[raster.at(160, 90).unwrap().triangle as usize][0], 3);
        }
    }
}
