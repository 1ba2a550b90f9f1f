//! What moves while the shutter is open: the camera between two frames, and the blur that its turning gives everything
//! that stands still. People are drawn at several moments instead (see `render`).

use glam::{DMat3, DQuat, DVec3, Vec2, Vec3};
use protocol::camera::Camera;

use crate::{
    rays::PixelRays,
    render::{Scene, Window},
};

/// Motion during the exposure. The picture's moment is the middle of it.
#[derive(Clone, Copy)]
pub struct Shutter<'a> {
    /// The same people and things at another frame close by, in the same order.
    pub other: &'a Scene<'a>,
    /// The camera then.
    pub camera: &'a Camera,
    /// How long the shutter is open, in units of the time from this frame to the other; negative when that one is earlier.
    pub open: f32,
}

impl Shutter<'_> {
    /// The camera `share` of the exposure away from the middle, −0.5 to 0.5.
    #[must_use]
    pub fn camera_at(&self, camera: &Camera, share: f32) -> Camera {
        between(camera, self.camera, f64::from(self.open * share))
    }
}

/// The camera `share` of the way from one to another; the share may lie outside 0..1.
#[must_use]
pub fn between(from: &Camera, to: &Camera, share: f64) -> Camera {
    let (start, mut end) = (DQuat::from_mat3(&from.rotation), DQuat::from_mat3(&to.rotation));
    if start.dot(end) < 0.0 {
        end = -end;
    }
    // Frames are close: the straight way between the rotations, made a rotation again, is exact enough (< 1e-4 px).
    let turn = (start + (end - start) * share).normalize();
    let mix = |a: f64, b: f64| a + (b - a) * share;
    Camera {
        focal_px: mix(from.focal_px, to.focal_px),
        k1: mix(from.k1, to.k1),
        rotation: DMat3::from_quat(turn),
        position: from.position.lerp(to.position, share),
        ..*from
    }
}

/// How far the picture of what stands still moves during the exposure, on a grid of nodes.
pub struct Flow {
    nodes: Vec<[Vec2; 2]>,
    across: usize,
    /// The longest way, pixels.
    pub longest_px: f32,
}

/// Pixels between nodes.
const STEP: usize = 40;

impl Flow {
    /// The flow of a window. The camera turns and zooms on its tripod, so that depth plays no part in it.
    #[must_use]
    pub fn new(camera: &Camera, shutter: &Shutter<'_>, window: Window) -> Self {
        let (open, close) = (shutter.camera_at(camera, -0.5), shutter.camera_at(camera, 0.5));
        let rays = PixelRays::new(camera);
        let [across, down] = window.size.map(|size| size.div_ceil(STEP) + 1);
        let mut flow = Self { nodes: Vec::with_capacity(across * down), across, longest_px: 0.0 };
        for y in 0..down {
            for x in 0..across {
                let local = Vec2::new((x * STEP) as f32, (y * STEP) as f32);
                let pixel = local + Vec2::new(window.first[0] as f32, window.first[1] as f32);
                let far: DVec3 = camera.position + rays.through(pixel).direction.as_dvec3() * 1e4;
                let ends =
                    [&open, &close].map(|c| c.project(far).map_or(Vec2::ZERO, |p| p.as_vec2() - pixel));
                flow.longest_px = flow.longest_px.max(ends[0].distance(ends[1]));
                flow.nodes.push(ends);
            }
        }
        flow
    }

    fn at(&self, x: usize, y: usize) -> [Vec2; 2] {
        let (i, j) = (x / STEP, y / STEP);
        let (fx, fy) = ((x % STEP) as f32 / STEP as f32, (y % STEP) as f32 / STEP as f32);
        let first = j * self.across + i;
        [0, 1].map(|end| {
            let top = self.nodes[first][end].lerp(self.nodes[first + 1][end], fx);
            let below = first + self.across;
            top.lerp(self.nodes[below][end].lerp(self.nodes[below + 1][end], fx), fy)
        })
    }

    /// Averages a picture along the flow; beyond its border the outermost pixels repeat.
    #[must_use]
    pub fn blur(&self, pixels: &[Vec3], [width, height]: [usize; 2]) -> Vec<Vec3> {
        let mut out = Vec::with_capacity(pixels.len());
        for y in 0..height {
            for x in 0..width {
                let [open, close] = self.at(x, y);
                let taps = (open.distance(close) * 0.8).ceil().clamp(2.0, 24.0) as usize;
                let mut sum = Vec3::ZERO;
                for tap in 0..taps {
                    // What is seen here at a moment stood, at the picture's moment, as far back along its way.
                    let way = open.lerp(close, (tap as f32 + 0.5) / taps as f32);
                    sum += bilinear(pixels, width, height, x as f32 - way.x, y as f32 - way.y);
                }
                out.push(sum / taps as f32);
            }
        }
        out
    }
}

fn bilinear(pixels: &[Vec3], width: usize, height: usize, x: f32, y: f32) -> Vec3 {
    let (x, y) = (x.clamp(0.0, (width - 1) as f32), y.clamp(0.0, (height - 1) as f32));
    let (x0, y0) = ((x as usize).min(width.saturating_sub(2)), (y as usize).min(height.saturating_sub(2)));
    let (fx, fy) = (x - x0 as f32, y - y0 as f32);
    let (right, below) = (usize::from(width > 1), if height > 1 { width } else { 0 });
    let first = y0 * width + x0;
    let top = pixels[first].lerp(pixels[first + right], fx);
    top.lerp(pixels[first + below].lerp(pixels[first + below + right], fx), fy)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        render::{Exposure, Solid},
        venue::Venue,
    };
    use std::borrow::Cow;

    fn scene<'a>(venue: &'a Venue, solid: Option<Solid>) -> Scene<'a> {
        let solids = solid.into_iter().map(Cow::Owned).collect();
        Scene { stadium: &venue.stadium, actors: Vec::new(), solids, nets: None }
    }

    fn camera(aside: f64) -> Camera {
        let target = DVec3::new(aside, 0.0, 0.0);
        Camera::looking_at((640, 360), 1400.0, DVec3::new(0.0, 16.0, 60.0), target)
    }

    /// Standard deviation of what is lighter than its surroundings along a row.
    fn spread(values: &[Vec3]) -> f32 {
        let ground = values.iter().map(|v| v.z).fold(f32::MAX, f32::min);
        let weights: Vec<f32> = values.iter().map(|v| (v.z - ground - 0.04).max(0.0)).collect();
        let total: f32 = weights.iter().sum();
        let mean = weights.iter().enumerate().map(|(k, w)| w * k as f32).sum::<f32>() / total;
        (weights.iter().enumerate().map(|(k, w)| w * (k as f32 - mean).powi(2)).sum::<f32>() / total).sqrt()
    }

    #[test]
    fn a_panning_camera_smears_lines_as_far_as_it_moves_while_the_shutter_is_open() {
        let venue = Venue::plain(1, Default::default(), [[0.9; 3], [0.1; 3]]);
        let still = scene(&venue, None);
        let (now, next) = (camera(0.0), camera(1.0));
        let window = Window { first: [260, 150], size: [120, 1] };
        let shutter = Shutter { other: &still, camera: &next, open: 0.5 };
        let sharp = still.render(&now, window, 3);
        let smeared =
            still.expose(&now, window, &Exposure { side: 3, shutter: Some(shutter), ..Exposure::default() });
        let moved =
            (next.project(DVec3::ZERO).unwrap() - now.project(DVec3::ZERO).unwrap()).length() as f32 * 0.5;
        // A box of that width adds its square over twelve to the variance.
        let added = spread(&smeared.pixels).powi(2) - spread(&sharp.pixels).powi(2);
        let width = (12.0 * added).sqrt();
        assert!(moved > 8.0 && (width - moved).abs() < 0.15 * moved, "{width} px instead of {moved}");
    }

    #[test]
    fn a_flying_thing_smears_before_a_still_camera() {
        let venue = Venue::plain(1, Default::default(), [[0.9; 3], [0.1; 3]]);
        let ball =
            |x: f32| scene(&venue, Some(crate::props::ball(Vec3::new(x, 4.0, 10.0), glam::Quat::IDENTITY)));
        let (now, later) = (ball(20.0), ball(21.0));
        let camera = camera(20.0);
        let shutter = Shutter { other: &later, camera: &camera, open: 0.5 };
        let place = camera.project(DVec3::new(20.0, 4.0, 10.0)).unwrap();
        let window = Window { first: [place.x as i32 - 40, place.y as i32 - 8], size: [80, 16] };
        let grey = now.render(&camera, window, 3).pixels[0];
        let covered = |light: crate::render::Light| {
            let columns =
                (0..80).filter(|x| (0..16).any(|y| (light.pixels[y * 80 + x] - grey).length() > 0.04));
            columns.count() as f64
        };
        let exposure = Exposure { side: 3, shutter: Some(shutter), ..Exposure::default() };
        let longer =
            covered(now.expose(&camera, window, &exposure)) - covered(now.render(&camera, window, 3));
        let moved = camera.pixels_per_metre(DVec3::new(20.0, 4.0, 10.0)) * 0.5;
        // Nine moments reach eight ninths of the way, and single samples at the ends of a small ball are missed.
        let share = longer / moved;
        assert!((0.55..1.05).contains(&share), "{longer} px longer instead of {moved}");
    }
}
