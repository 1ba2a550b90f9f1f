//! Shadows of people and things on the grass: everything pressed flat along each lamp's direction, as the camera sees it.
//! Straight below, the same gives the loss of sky light round the feet.

use glam::{DVec3, Vec3};
use protocol::camera::Camera;

use crate::{
    raster::{self, Grid, Raster, TILE},
    render::{Scene, Window, may_be_in},
    stadium::Shadow,
};

/// Shares of light lost in every pixel of a window.
pub(crate) struct Shadows {
    width: usize,
    lamps: Vec<f32>,
    sky: Vec<f32>,
}

impl Shadows {
    pub(crate) fn new(scene: &Scene<'_>, camera: &Camera, window: Window) -> Self {
        let count = window.size[0] * window.size[1];
        let mut shadows = Self { width: window.size[0], lamps: vec![0.0; count], sky: vec![0.0; count] };
        let lights = &scene.stadium.lights;
        let strength = |(towards, colour): &(Vec3, Vec3)| colour.y * towards.y.max(0.0);
        let total: f32 = lights.lamps.iter().map(strength).sum();
        for lamp in &lights.lamps {
            add(scene, camera, window, lamp.0, strength(lamp) / total.max(1e-6), &mut shadows.lamps);
        }
        if !lights.lamps.is_empty() {
            blur(&mut shadows.lamps, window.size, 1);
        }
        add(scene, camera, window, Vec3::Y, 1.0, &mut shadows.sky);
        // The sky's shadow is as soft as a body is high above the ground.
        let radius = (pixels_per_metre(camera) * 0.07).clamp(1.0, 12.0) as usize;
        blur(&mut shadows.sky, window.size, radius);
        blur(&mut shadows.sky, window.size, radius);
        shadows
    }

    pub(crate) fn at(&self, x: usize, y: usize) -> Shadow {
        let place = y * self.width + x;
        Shadow { lamps: self.lamps[place].min(1.0), sky: self.sky[place].min(1.0) }
    }
}

/// At the grass in the middle of the picture; some metres ahead when the camera looks over it.
fn pixels_per_metre(camera: &Camera) -> f64 {
    let ground = camera.ground_point(camera.centre_px());
    camera.pixels_per_metre(ground.unwrap_or(camera.position + camera.forward() * 60.0 + DVec3::ZERO))
}

fn add(scene: &Scene<'_>, camera: &Camera, window: Window, towards: Vec3, weight: f32, out: &mut [f32]) {
    let mut raster = Raster::new(Grid::over_pixels(window.first, window.size, 1));
    let (mut projected, mut flat) = (Vec::new(), Vec::new());
    for (positions, triangles) in scene.meshes() {
        flat.clear();
        flat.extend(positions.iter().map(|p| {
            let p = *p - towards * (p.y.max(0.0) / towards.y.max(0.05));
            Vec3::new(p.x, 0.0, p.z)
        }));
        if !may_be_in(camera, &raster.grid, &flat) {
            continue;
        }
        raster::project(camera, &raster.grid, &flat, &mut projected);
        raster.draw(&projected, triangles, 0);
    }
    let [width, height] = window.size;
    for [i, j] in raster.tiles() {
        let Some(hits) = raster.tile(i, j) else { continue };
        for (place, hit) in hits.iter().enumerate() {
            let (x, y) = (i + place % TILE, j + place / TILE);
            if hit.inverse_depth > 0.0 && x < width && y < height {
                out[y * width + x] += weight;
            }
        }
    }
}

/// A mean over (2 radius + 1)² pixels; beyond the border nothing is dark.
fn blur(values: &mut [f32], [width, height]: [usize; 2], radius: usize) {
    let share = 1.0 / (2 * radius + 1) as f32;
    let mut line = vec![0.0f32; width];
    for row in values.chunks_exact_mut(width) {
        if row.iter().all(|v| *v == 0.0) {
            continue;
        }
        line.copy_from_slice(row);
        let mut sum: f32 = line[..radius.min(width)].iter().sum();
        for x in 0..width {
            sum += line.get(x + radius).copied().unwrap_or(0.0);
            row[x] = sum * share;
            sum -= if x >= radius { line[x - radius] } else { 0.0 };
        }
    }
    let source = values.to_vec();
    let mut sums = vec![0.0f32; width];
    for y in 0..radius.min(height) {
        sums.iter_mut().zip(&source[y * width..]).for_each(|(sum, v)| *sum += v);
    }
    for (y, row) in values.chunks_exact_mut(width).enumerate() {
        if y + radius < height {
            sums.iter_mut().zip(&source[(y + radius) * width..]).for_each(|(sum, v)| *sum += v);
        }
        // Rounding leaves traces after a shadow has passed.
        row.iter_mut().zip(&sums).for_each(|(v, sum)| *v = if *sum < 1e-4 { 0.0 } else { sum * share });
        if y >= radius {
            sums.iter_mut().zip(&source[(y - radius) * width..]).for_each(|(sum, v)| *sum -= v);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{paint::Lights, props, render::Solid, venue::Venue};
    use std::borrow::Cow;

    #[test]
    fn a_pole_throws_its_shadow_where_the_sun_says_and_nowhere_else() {
        let mut venue = Venue::plain(1, Default::default(), [[0.9; 3], [0.1; 3]]);
        let towards = Vec3::new(0.5, 0.6, 0.4).normalize();
        venue.stadium.lights = Lights { lamps: vec![(towards, Vec3::ONE)], ..venue.stadium.lights };
        let (foot, high) = (Vec3::new(4.0, 0.0, 6.0), 2.0);
        let mut pole = Solid::default();
        props::tube(&mut pole, foot, foot + Vec3::Y * high, 0.3, Vec3::ONE);
        let scene =
            Scene { stadium: &venue.stadium, actors: Vec::new(), solids: vec![Cow::Owned(pole)], nets: None };
        let camera = Camera {
            k1: -0.1,
            ..Camera::looking_at((640, 360), 900.0, DVec3::new(0.0, 15.0, 50.0), DVec3::new(8.0, 0.0, 4.0))
        };
        let shadows = Shadows::new(&scene, &camera, Window { first: [0, 0], size: [640, 360] });
        let at = |ground: Vec3| {
            let pixel = camera.project(ground.as_dvec3()).unwrap();
            shadows.at(pixel.x.round() as usize, pixel.y.round() as usize).lamps
        };
        let tip = foot - Vec3::new(towards.x, 0.0, towards.z) * (high / towards.y);
        for share in [0.2, 0.5, 0.9] {
            assert!(at(foot.lerp(tip, share)) > 0.6, "no shadow at {share} of its length");
        }
        assert_eq!(at(foot.lerp(tip, 1.4)), 0.0, "the shadow is too long");
        assert_eq!(at(foot.lerp(tip, -0.5)), 0.0, "a shadow towards the sun");
    }
}
