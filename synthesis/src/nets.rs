//! Goal nets: thin cords over four faces of each goal, kept as formulas so that they neither flicker nor cost triangles.

use glam::{DVec3, Vec2, Vec3};
use protocol::{
    camera::Camera,
    pitch::{GOAL_HEIGHT_M, GOAL_WIDTH_M, Pitch},
};

use crate::rays::PixelRays;

/// How a net hangs and looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetLook {
    /// Depth behind the goal line at the bar and on the ground, metres.
    pub deep_m: [f32; 2],
    /// Side of a mesh, metres.
    pub cell_m: f32,
    /// Thickness of a cord, metres.
    pub cord_m: f32,
    /// Linear colours; where they differ, they change every metre across the goal.
    pub colours: [Vec3; 2],
}

impl Default for NetLook {
    fn default() -> Self {
        Self { deep_m: [2.0, 2.0], cell_m: 0.12, cord_m: 0.012, colours: [Vec3::splat(0.62); 2] }
    }
}

/// The nets of both goals as one camera sees them.
pub struct Nets<'a> {
    look: &'a NetLook,
    half_x: f32,
    /// Per side (−1, 1): the box of pixels that the net lies in.
    boxes: [Option<(f32, Vec2, Vec2)>; 2],
}

impl<'a> Nets<'a> {
    /// Nets of a pitch before a camera.
    #[must_use]
    pub fn new(look: &'a NetLook, pitch: &Pitch, camera: &Camera) -> Self {
        let half_x = pitch.length_m / 2.0;
        let deep = f64::from(look.deep_m[0].max(look.deep_m[1])) + 0.1;
        let boxes = [-1.0, 1.0].map(|side| {
            let (mut low, mut high) = (Vec2::MAX, Vec2::MIN);
            for k in 0..8 {
                let pick = |bit: usize, off: f64, on: f64| if k >> bit & 1 == 0 { off } else { on };
                let half = GOAL_WIDTH_M / 2.0 + 0.1;
                let (x, y) = (side * (half_x + pick(0, 0.0, deep)), pick(1, 0.0, GOAL_HEIGHT_M + 0.1));
                // A corner behind the camera: the goal is not in a picture that looks at the play.
                let pixel = camera.project(DVec3::new(x, y, pick(2, -half, half)))?.as_vec2();
                (low, high) = (low.min(pixel), high.max(pixel));
            }
            Some((side as f32, low - 3.0, high + 3.0))
        });
        Self { look, half_x: half_x as f32, boxes }
    }

    /// How much of the light from behind stays, and the light of the net, for what lies `until_m` deep at a pixel.
    #[must_use]
    pub fn over(&self, rays: &PixelRays, pixel: Vec2, until_m: f32) -> Option<(f32, Vec3)> {
        let inside =
            |(_, low, high): &&(f32, Vec2, Vec2)| pixel.cmpge(*low).all() && pixel.cmple(*high).all();
        let &(side, ..) = self.boxes.iter().flatten().find(inside)?;
        let view = rays.through(pixel);
        let (o, d) = (rays.origin, view.direction);
        let (half_goal, bar) = (GOAL_WIDTH_M as f32 / 2.0, GOAL_HEIGHT_M as f32);
        let [top, bottom] = self.look.deep_m;
        let lean = (bottom - top) / bar;
        // Back: (x·side − half) = bottom − lean · y; sides; roof.
        let back = (bottom + self.half_x - o.x * side - lean * o.y) / (d.x * side + lean * d.y);
        let depths = [back, (half_goal - o.z) / d.z, (-half_goal - o.z) / d.z, (bar - o.y) / d.y];
        let (mut open, mut light) = (1.0, Vec3::ZERO);
        for (face, depth) in depths.into_iter().enumerate() {
            if !(depth > 0.5 && depth < until_m) {
                continue;
            }
            let hit = o + d * depth;
            let behind = hit.x * side - self.half_x;
            let within = behind > -0.001
                && behind < bottom - lean * hit.y + 0.002
                && (-0.001..bar + 0.001).contains(&hit.y)
                && hit.z.abs() < half_goal + 0.001;
            if !within {
                continue;
            }
            let place = match face {
                0 => Vec2::new(hit.z, hit.y),
                3 => Vec2::new(hit.z, behind),
                _ => Vec2::new(behind, hit.y),
            };
            let sample = depth * view.across.length();
            let cover = 1.0 - (1.0 - self.cords(place.x, sample)) * (1.0 - self.cords(place.y, sample));
            let colour = self.look.colours[(hit.z + 100.0) as usize % 2];
            light = light * (1.0 - cover) + colour * cover;
            open *= 1.0 - cover;
        }
        (open < 1.0).then_some((open, light))
    }

    /// Share of a pixel that parallel cords cover.
    fn cords(&self, at: f32, sample: f32) -> f32 {
        let cell = self.look.cell_m;
        let mean = self.look.cord_m / cell;
        let off = ((at / cell + 1000.5).fract() - 0.5).abs() * cell;
        // The overlap of the pixel with the nearest cord.
        let (half, half_cord) = (sample / 2.0, self.look.cord_m / 2.0);
        let sharp = ((off + half).min(half_cord) - (off - half).max(-half_cord)).max(0.0) / sample;
        // Fewer than four pixels from cord to cord would beat with the grid of pixels.
        let far = ((sample / cell - 0.12) / 0.13).clamp(0.0, 1.0);
        sharp + (mean - sharp) * far
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_net_veils_what_is_behind_it_and_not_what_is_in_front() {
        let camera =
            Camera::looking_at((1280, 720), 3500.0, DVec3::new(30.0, 14.0, 62.0), DVec3::new(52.0, 1.0, 0.0));
        let pitch = Pitch::default();
        for look in [NetLook::default(), NetLook { deep_m: [0.9, 2.2], ..NetLook::default() }] {
            let nets = Nets::new(&look, &pitch, &camera);
            let rays = PixelRays::new(&camera);
            let pixel = camera.project(DVec3::new(53.2, 1.0, 0.5)).unwrap().as_vec2();
            let depth = camera.depth(DVec3::new(53.2, 1.0, 0.5)) as f32;
            // Averaged over a patch, cords of 12 mm each 120 mm cover about a fifth per face.
            let mean = |until: f32| {
                let total: f32 = (0..400)
                    .map(|k| pixel + Vec2::new((k % 20) as f32 * 0.37, (k / 20) as f32 * 0.37))
                    .map(|p| nets.over(&rays, p, until).map_or(1.0, |(open, _)| open))
                    .sum();
                total / 400.0
            };
            let behind = mean(depth + 10.0);
            assert!((0.5..0.85).contains(&behind), "{behind}");
            assert!(mean(depth - 12.0) > 0.999);
            let beside = camera.project(DVec3::new(53.2, 1.0, 9.0)).unwrap().as_vec2();
            assert!(nets.over(&rays, beside, 200.0).is_none());
        }
    }
}
