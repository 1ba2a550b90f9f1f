//! Everything around the players: mown grass with its lines, boards, stands with people, goals and nets.
//! Lines and stripes are filtered analytically over each pixel's footprint, so they neither crawl nor break.

use std::f32::consts::TAU;

use glam::{Mat3, Vec2, Vec3};
use protocol::{
    camera::Camera,
    pitch::{GOAL_HEIGHT_M, GOAL_WIDTH_M, LINE_WIDTH_M, Marking, Pitch},
};

use crate::{
    noise,
    outfit::{Srgb, linear},
    paint::Lights,
};

/// An advertising board.
#[derive(Clone, Debug, PartialEq)]
pub struct Board {
    /// What stands on it.
    pub text: String,
    /// Its colour.
    pub ground: Srgb,
    /// The colour of the text.
    pub ink: Srgb,
}

/// How a stadium looks.
#[derive(Clone, Debug)]
pub struct Stadium {
    /// The pitch.
    pub pitch: Pitch,
    /// Colour of the grass.
    pub grass: Srgb,
    /// How much lighter every other mown stripe is.
    pub mowing: f32,
    /// Width of a mown stripe, metres.
    pub stripe_m: f32,
    /// Boards, repeated round the pitch.
    pub boards: Vec<Board>,
    /// Colour of the ground outside the grass.
    pub apron: Srgb,
    /// Colours that the home crowd wears.
    pub crowd: Vec<Srgb>,
    /// Brightness of the stands.
    pub stands_light: f32,
    /// Varies noise and crowd.
    pub seed: u32,
    /// The lights.
    pub lights: Lights,
    paint: Vec<Painted>,
}

/// A marking with its bounding box.
#[derive(Clone, Copy, Debug)]
struct Painted {
    marking: Marking,
    low: Vec2,
    high: Vec2,
}

/// What a ray through the empty stadium meets.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Light, linear.
    pub light: Vec3,
    /// Depth along the ray in units of the (unnormalised) pixel direction: metres along the optical axis.
    pub depth_m: f32,
    /// The place on the ground, when it is the ground (shadows fall there).
    pub ground: Option<Vec2>,
}

/// Rays through pixels, linear in the pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelRays {
    origin: Vec3,
    corner: Vec3,
    across: Vec3,
    down: Vec3,
}

impl PixelRays {
    /// The rays of an undistorted camera.
    #[must_use]
    pub fn new(camera: &Camera) -> Self {
        let back: Mat3 = camera.rotation.as_mat3().transpose();
        let focal = camera.focal_px as f32;
        let centre = camera.centre_px().as_vec2();
        Self {
            origin: camera.position.as_vec3(),
            corner: back * Vec3::new(-centre.x / focal, -centre.y / focal, 1.0),
            across: back * Vec3::new(1.0 / focal, 0.0, 0.0),
            down: back * Vec3::new(0.0, 1.0 / focal, 0.0),
        }
    }

    fn direction(&self, pixel: Vec2) -> Vec3 {
        self.corner + self.across * pixel.x + self.down * pixel.y
    }
}

/// Distance of the boards from the lines, metres.
const BOARD_GAP_M: [f32; 2] = [4.5, 5.0];
const BOARD_HEIGHT_M: f32 = 0.95;
/// Where the stands begin behind the boards, and at what height.
const STAND_GAP_M: f32 = 3.5;
const STAND_FOOT_M: f32 = 1.4;

impl Stadium {
    /// A stadium with the given looks.
    #[must_use]
    pub fn new(pitch: Pitch, boards: Vec<Board>, lights: Lights, seed: u32) -> Self {
        let paint = pitch
            .markings()
            .into_iter()
            .map(|marking| {
                let points = marking.sample(0.5);
                let reach = match marking {
                    Marking::Spot { radius_m, .. } => radius_m,
                    _ => LINE_WIDTH_M,
                } as f32;
                let low = points.iter().fold(Vec2::MAX, |a, p| a.min(p.as_vec2())) - reach - 0.2;
                let high = points.iter().fold(Vec2::MIN, |a, p| a.max(p.as_vec2())) + reach + 0.2;
                Painted { marking, low, high }
            })
            .collect();
        Self {
            pitch,
            grass: [0.33, 0.47, 0.16],
            mowing: 0.16,
            stripe_m: 5.25,
            boards,
            apron: [0.20, 0.33, 0.16],
            crowd: vec![[0.85, 0.85, 0.88], [0.10, 0.10, 0.13], [0.15, 0.25, 0.55]],
            stands_light: 0.5,
            seed,
            lights,
            paint,
        }
    }

    /// What the camera sees at a pixel when nobody is there. `shadow` is the share of each lamp that is hidden, and
    /// after the lamps of the sky.
    #[must_use]
    pub fn see(&self, rays: &PixelRays, pixel: Vec2, shadow: impl Fn(usize) -> f32) -> Seen {
        let direction = rays.direction(pixel);
        let (half_x, half_z) = (self.pitch.length_m as f32 / 2.0, self.pitch.width_m as f32 / 2.0);
        let ground = (direction.y < -1e-6).then(|| -rays.origin.y / direction.y);
        let mut best: Option<(f32, Wall, f32, f32)> = None;
        let faces = [
            (Vec3::Z, -(half_z + BOARD_GAP_M[0])),
            (Vec3::X, half_x + BOARD_GAP_M[1]),
            (Vec3::X, -(half_x + BOARD_GAP_M[1])),
        ];
        for (normal, place) in faces {
            let outward = place.signum();
            // The board stands upright; behind it rise the stands as two slopes with a fascia between.
            let upright = |at: f32| (at - rays.origin.dot(normal)) / direction.dot(normal);
            let mut offer = |depth: f32, wall: Wall, height: f32| {
                if depth.is_finite() && depth > 0.5 && best.is_none_or(|(nearest, ..)| depth < nearest) {
                    let point = rays.origin + direction * depth;
                    // Along the wall from left to right, as somebody on the pitch reads it.
                    let along = if normal == Vec3::Z { point.x } else { point.z * outward };
                    best = Some((depth, wall, along, height));
                }
            };
            let depth = upright(place);
            let point = rays.origin + direction * depth;
            let height = point.y;
            // Boards meet at the corners.
            let (along, end) = if normal == Vec3::Z {
                (point.x, half_x + BOARD_GAP_M[1])
            } else {
                (point.z, half_z + BOARD_GAP_M[0])
            };
            if (0.0..BOARD_HEIGHT_M).contains(&height) && along.abs() <= end {
                offer(depth, Wall::Board, height);
            }
            let foot = place + outward * STAND_GAP_M;
            let depth = upright(foot);
            let height = (rays.origin + direction * depth).y;
            if (0.0..STAND_FOOT_M).contains(&height) {
                offer(depth, Wall::Barrier, height);
            }
            for (from, low, slope, deep) in
                [(0.0f32, STAND_FOOT_M, 0.52f32, 24.0f32), (22.0, 17.5, 0.66, 34.0)]
            {
                // height = low + slope · (outward · (p·normal) − |foot| − from)
                let a = direction.y - slope * outward * direction.dot(normal);
                let b = low + slope * (outward * rays.origin.dot(normal) - foot.abs() - from) - rays.origin.y;
                let depth = b / a;
                let point = rays.origin + direction * depth;
                let back = outward * point.dot(normal) - foot.abs() - from;
                if (0.0..deep).contains(&back) {
                    offer(depth, Wall::Seats, back * (1.0 + slope * slope).sqrt() + from * 10.0);
                }
            }
            let depth = upright(foot + outward * 22.0);
            let height = (rays.origin + direction * depth).y;
            if (12.0..17.5).contains(&height) {
                offer(depth, Wall::Fascia, height - 12.0);
            }
        }
        if let Some(depth) = ground
            && best.is_none_or(|(nearest, ..)| depth < nearest)
        {
            let hit = rays.origin + direction * depth;
            let place = Vec2::new(hit.x, hit.z);
            // How far the hit moves on the ground per pixel across and down.
            let slide = |step: Vec3| {
                let moved = depth * (step - direction * (step.y / direction.y));
                Vec2::new(moved.x, moved.z)
            };
            let light = self.turf(place, [slide(rays.across), slide(rays.down)]);
            let lamps = &self.lights.lamps;
            let lamp_light = lamps.iter().enumerate().fold(Vec3::ZERO, |sum, (index, (towards, colour))| {
                sum + *colour * towards.y * (1.0 - shadow(index))
            });
            let open = 1.0 - 0.6 * shadow(lamps.len());
            let light = light * (lamp_light + self.lights.sky * open);
            return Seen { light, depth_m: depth, ground: Some(place) };
        }
        let Some((depth, wall, along, height)) = best else {
            // Above the stands: the dark underside of a roof.
            return Seen { light: Vec3::new(0.012, 0.013, 0.017), depth_m: 1e6, ground: None };
        };
        let sample = depth * rays.across.length();
        let light = match wall {
            Wall::Board => self.board(along, height, sample) * 0.8,
            Wall::Barrier => self.barrier(along, height, sample),
            Wall::Seats => self.seats(along, height, sample) * self.stands_light,
            Wall::Fascia => self.fascia(along, height, sample),
        };
        Seen { light, depth_m: depth, ground: None }
    }

    /// Colour of the ground: grass, mowing stripes, lines. `steps` is how far a pixel across and down reaches.
    fn turf(&self, p: Vec2, steps: [Vec2; 2]) -> Vec3 {
        let (half_x, half_z) = (self.pitch.length_m as f32 / 2.0, self.pitch.width_m as f32 / 2.0);
        let reach =
            |normal: Vec2| (normal.dot(steps[0]).powi(2) + normal.dot(steps[1]).powi(2)).sqrt().max(1e-5);
        let outside = (p.x.abs() - half_x).max(p.y.abs() - half_z);
        if outside > 3.2 {
            let grain = 1.0 + 0.05 * noise::value(p * 3.0, self.seed);
            return linear(self.apron) * grain;
        }
        // Mown stripes: a square wave filtered over the footprint.
        let place = (p.x + half_x) / self.stripe_m;
        let wide = (reach(Vec2::X) / self.stripe_m).max(0.04);
        let edge = (place.rem_euclid(2.0) - 1.0).abs(); // 1 at the middle of one stripe, 0 at the middle of the other
        let stripe = ((edge - 0.5) / wide + 0.5).clamp(0.0, 1.0);
        let blade = reach(Vec2::Y);
        let grain = noise::value(p * Vec2::new(7.0, 4.0), self.seed) * (0.10 / (0.10 + blade))
            + 0.9 * noise::value(p * 1.1, self.seed ^ 1)
            + 1.2 * noise::value(p * 0.21, self.seed ^ 2);
        let tint = Vec3::new(1.0 + 0.03 * noise::value(p * 0.13, self.seed ^ 3), 1.0, 1.0);
        let grass = linear(self.grass) * tint * (1.0 + self.mowing * (stripe - 0.5)) * (1.0 + 0.035 * grain);
        let paint = self.paint_at(p, &reach);
        grass.lerp(linear([0.90, 0.93, 0.90]), paint * (0.94 + 0.06 * noise::value(p * 2.3, self.seed ^ 7)))
    }

    /// Share of a pixel that is covered by line paint.
    fn paint_at(&self, p: Vec2, reach: &impl Fn(Vec2) -> f32) -> f32 {
        let half_line = LINE_WIDTH_M as f32 / 2.0;
        let ramp = |t: f32| (t + 0.5).clamp(0.0, 1.0);
        let mut paint: f32 = 0.0;
        for painted in &self.paint {
            let margin = reach(Vec2::X).max(reach(Vec2::Y));
            if p.cmplt(painted.low - margin).any() || p.cmpgt(painted.high + margin).any() {
                continue;
            }
            let band = |signed: f32, normal: Vec2, half: f32| {
                let step = reach(normal);
                ramp((signed + half) / step) - ramp((signed - half) / step)
            };
            let cover = match painted.marking {
                Marking::Line { from, to } => {
                    let (from, to) = (from.as_vec2(), to.as_vec2());
                    let along = (to - from).normalize_or(Vec2::X);
                    let normal = along.perp();
                    let length = from.distance(to);
                    let middle = (p - from).dot(along) - length / 2.0;
                    band((p - from).dot(normal), normal, half_line)
                        * band(middle, along, length / 2.0 + half_line)
                }
                Marking::Arc { centre, radius_m, start, sweep } => {
                    let offset = p - centre.as_vec2();
                    let turn = (offset.to_angle() - start as f32).rem_euclid(TAU);
                    if turn <= sweep as f32 + 1e-4 {
                        band(offset.length() - radius_m as f32, offset.normalize_or(Vec2::X), half_line)
                    } else {
                        0.0
                    }
                }
                Marking::Spot { centre, radius_m } => {
                    let offset = p - centre.as_vec2();
                    let normal = offset.normalize_or(Vec2::X);
                    band(offset.length(), normal, radius_m as f32)
                }
            };
            paint = paint.max(cover);
        }
        paint
    }

    /// How much of the light from behind a goal net stays, and the light of the net, for a ray up to `until_m` deep.
    #[must_use]
    pub fn nets(&self, rays: &PixelRays, pixel: Vec2, until_m: f32) -> (f32, Vec3) {
        let direction = rays.direction(pixel);
        let half_x = self.pitch.length_m as f32 / 2.0;
        let (half_goal, bar) = (GOAL_WIDTH_M as f32 / 2.0, GOAL_HEIGHT_M as f32);
        let (mut open, mut light) = (1.0, Vec3::ZERO);
        for side in [-1.0f32, 1.0] {
            // Inside the box of the goal? Back and side nets, roof of the net.
            for (axis, place) in [(0, half_x + 2.0), (2, half_goal), (2, -half_goal), (1, bar)] {
                let (o, d) = (rays.origin[axis], direction[axis]);
                let place = if axis == 0 { place * side } else { place };
                let depth = (place - o) / d;
                if !(depth > 0.5 && depth < until_m) {
                    continue;
                }
                let hit = rays.origin + direction * depth;
                let back = hit.x * side - half_x;
                let inside = (-0.001..2.001).contains(&back)
                    && (0.0..bar + 0.001).contains(&hit.y)
                    && hit.z.abs() < half_goal + 0.001;
                if inside {
                    let knots = |a: f32| if (a / 0.12).rem_euclid(1.0) < 0.5 { 1.0 } else { 0.6 };
                    let cover = 0.16 * knots(hit.y + hit.x) * knots(hit.z + hit.x * 0.3);
                    light = light * (1.0 - cover) + Vec3::splat(0.62) * cover;
                    open *= 1.0 - cover;
                }
            }
        }
        (open, light)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wall {
    Board,
    Barrier,
    Seats,
    Fascia,
}
