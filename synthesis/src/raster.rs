//! A small z-buffer rasteriser: which triangle is in front at every sample of a regular grid laid over the picture.
//! Samples lie in clip pixels, so the same code renders pictures (several samples per pixel) and exact depth at any grid.

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

/// The front-most triangle of every sample.
#[derive(Clone, Debug)]
pub struct Raster {
    /// The samples.
    pub grid: Grid,
    /// 1 / depth along the optical axis; 0 where nothing is.
    pub inverse_depth: Vec<f32>,
    /// Index of the triangle, counted over everything drawn; [`NOTHING`] where nothing is.
    pub triangle: Vec<u32>,
}

/// A vertex in the grid: sample coordinates and 1 / depth.
pub type Projected = Option<Vec3>;

/// Projects points into `grid`; `None` behind the camera. Radial distortion is not drawn.
pub fn project(camera: &Camera, grid: &Grid, points: &[Vec3], out: &mut Vec<Projected>) {
    out.clear();
    let rotation = camera.rotation.as_mat3();
    let scale = (camera.focal_px * grid.per_px) as f32;
    let centre = camera.centre_px();
    let offset = Vec2::new(
        ((centre.x - grid.origin_px[0]) * grid.per_px) as f32,
        ((centre.y - grid.origin_px[1]) * grid.per_px) as f32,
    );
    out.extend(points.iter().map(|&point| {
        // The difference is taken in double precision: the camera is far away.
        let p = rotation * (DVec3::from(point) - camera.position).as_vec3();
        (p.z > 0.3).then(|| (p.truncate() / p.z * scale + offset).extend(1.0 / p.z))
    }));
}

impl Raster {
    /// An empty raster.
    #[must_use]
    pub fn new(grid: Grid) -> Self {
        let count = grid.width * grid.height;
        Self { grid, inverse_depth: vec![0.0; count], triangle: vec![NOTHING; count] }
    }

    /// Draws `triangles` over projected `vertices`; triangle `k` gets the index `first + k`.
    pub fn draw(&mut self, vertices: &[Projected], triangles: &[[u32; 3]], first: u32) {
        let (width, height) = (self.grid.width as i32, self.grid.height as i32);
        for (index, triangle) in triangles.iter().enumerate() {
            let [Some(a), Some(b), Some(c)] = triangle.map(|v| vertices.get(v as usize).copied().flatten())
            else {
                continue;
            };
            let low = a.min(b).min(c);
            let high = a.max(b).max(c);
            let (x0, x1) = ((low.x.ceil() as i32).max(0), (high.x.floor() as i32).min(width - 1));
            let (y0, y1) = ((low.y.ceil() as i32).max(0), (high.y.floor() as i32).min(height - 1));
            if x0 > x1 || y0 > y1 {
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
                let row = y as usize * self.grid.width;
                for x in x0..=x1 {
                    let dx = x as f32 - a.x;
                    let wb = dx * bx + dy * by;
                    let wc = dx * cx + dy * cy;
                    if wb >= 0.0 && wc >= 0.0 && wb + wc <= 1.0 {
                        let inverse = a.z + (b.z - a.z) * wb + (c.z - a.z) * wc;
                        let place = row + x as usize;
                        if inverse > self.inverse_depth[place] {
                            self.inverse_depth[place] = inverse;
                            self.triangle[place] = first + index as u32;
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
                let place = j * grid.width + i;
                if raster.triangle[place] == NOTHING {
                    continue;
                }
                hits += 1;
                assert_eq!(raster.triangle[place], 7);
                let ground = camera.ground_point(grid.pixel(i, j).into()).unwrap();
                let depth = f64::from(1.0 / raster.inverse_depth[place]);
                assert!((depth - camera.depth(ground)).abs() < 2e-3);
            }
        }
        assert!(hits > 5_000, "{hits} samples");
    }

    #[test]
    fn the_nearer_triangle_wins_in_either_order() {
        let camera = camera();
        let triangle = |z: f32| [Vec3::new(-5.0, -3.0, z), Vec3::new(5.0, -3.0, z), Vec3::new(0.0, 6.0, z)];
        let points: Vec<Vec3> = triangle(0.0).into_iter().chain(triangle(5.0)).collect();
        let grid = Grid::over_pixels([0, 0], [320, 180], 1);
        let mut projected = Vec::new();
        project(&camera, &grid, &points, &mut projected);
        let centre = 90 * 320 + 160;
        for order in [[[0u32, 1, 2], [3, 4, 5]], [[3, 4, 5], [0, 1, 2]]] {
            let mut raster = Raster::new(grid);
            raster.draw(&projected, &order, 0);
            assert_eq!(order[raster.triangle[centre] as usize][0], 3);
        }
    }
}
