//! A room drawn by rule: a table with a box and a cup on it, with picture, depth and the true surfaces.
//!
//! For tests and goldens, which may hold nothing that somebody else recorded. One ray per pixel, no chance: the same
//! numbers on every machine.

use glam::{DVec2, DVec3, Vec3};
use image::{Rgba, RgbaImage};

use super::{RoomCamera, RoomPicture, holes};
use crate::placement::{Plane, Surface, SurfaceId, SurfaceKind};

/// Between the sensor's projector and its camera, metres: what the projector does not reach has no depth.
const BASELINE_M: f64 = 0.075;
/// The wall behind the table, metres from the middle of the room.
const WALL_Z_M: f64 = -1.6;
/// Light that comes from everywhere.
const AMBIENT: f32 = 0.42;

/// Where the light comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Any length; from the room towards the lamp.
    pub towards: DVec3,
    /// Linear light.
    pub colour: Vec3,
}

impl Default for Lamp {
    fn default() -> Self {
        Self { towards: DVec3::new(-0.6, 1.0, 0.35), colour: Vec3::ONE }
    }
}

/// A room of 4 m with a table in the middle; y is up, the floor at 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SyntheticRoom {
    /// Height of the table, metres.
    pub table_height_m: f64,
    /// Half length (x) and half width (z) of the table, metres.
    pub half_table_m: [f64; 2],
    /// The light.
    pub lamp: Lamp,
    /// Whether the depth has the shadow of the projector and the steps of a real sensor.
    pub sensor: bool,
}

impl Default for SyntheticRoom {
    fn default() -> Self {
        Self { table_height_m: 0.74, half_table_m: [0.7, 0.42], lamp: Lamp::default(), sensor: true }
    }
}

/// Something in the room.
enum Body {
    /// Between two corners.
    Box { low: DVec3, high: DVec3 },
    /// Upright: middle of its foot, radius, height.
    Cylinder { foot: DVec3, radius: f64, height: f64 },
}

struct Hit {
    along: f64,
    normal: DVec3,
    albedo: Vec3,
}

impl SyntheticRoom {
    /// Three cameras of 640 × 480 px, 0.9 to 1.3 m from the table: in front, from the left, from the right and above.
    #[must_use]
    pub fn cameras(&self) -> [RoomCamera; 3] {
        let table = DVec3::Y * self.table_height_m;
        let pinhole = RoomCamera::at_origin([640, 480], DVec2::splat(525.0), DVec2::new(319.5, 239.5));
        [DVec3::new(0.05, 0.55, 1.0), DVec3::new(-0.85, 0.6, 0.7), DVec3::new(0.55, 0.95, 0.75)]
            .map(|from| pinhole.looking_at(table + from, table + DVec3::new(0.0, 0.0, 0.03), DVec3::Y))
    }

    /// The table as a perfect finder would report it, with the foot prints of what stands on it.
    #[must_use]
    pub fn table(&self) -> Surface {
        let [x, z] = self.half_table_m;
        let corner = |x: f64, z: f64| DVec3::new(x, self.table_height_m, z);
        let foot_print = |body: &Body| match *body {
            Body::Box { low, high } => {
                vec![
                    corner(low.x, low.z),
                    corner(low.x, high.z),
                    corner(high.x, high.z),
                    corner(high.x, low.z),
                ]
            }
            Body::Cylinder { foot, radius, .. } => (0..12)
                .map(|index| {
                    // Around the circle, so that it is not cut short.
                    let radius = radius / (std::f64::consts::PI / 12.0).cos();
                    let (sin, cos) = (f64::from(index) * std::f64::consts::TAU / 12.0).sin_cos();
                    corner(foot.x + radius * cos, foot.z + radius * sin)
                })
                .collect(),
        };
        Surface {
            id: SurfaceId(1),
            kind: SurfaceKind::Table,
            plane: Plane::through(corner(0.0, 0.0), DVec3::Y),
            outline_m: vec![corner(-x, -z), corner(-x, z), corner(x, z), corner(x, -z)],
            obstacles_m: self.things().iter().map(|(body, _)| foot_print(body)).collect(),
            confidence: 1.0,
        }
    }

    /// What a camera sees.
    #[must_use]
    pub fn picture(&self, camera: &RoomCamera) -> RoomPicture {
        let [width, height] = camera.size_px;
        let projector = camera.position_m + camera.rotation.row(0) * BASELINE_M;
        let mut depth_m = Vec::with_capacity(width as usize * height as usize);
        let colour = RgbaImage::from_fn(width, height, |column, row| {
            let ray = camera.ray(DVec2::new(f64::from(column), f64::from(row)));
            let Some(hit) = self.first_hit(ray.origin_m, ray.direction) else {
                depth_m.push(0.0);
                return Rgba([0, 0, 0, 255]);
            };
            let point = ray.origin_m + ray.direction * hit.along;
            let seen = !self.sensor || !self.is_hidden(point + hit.normal * 1e-4, projector - point, 1.0);
            depth_m.push(if seen { self.measured(hit.along) } else { 0.0 });
            srgb(self.shaded(point, &hit))
        });
        holes::fill(&mut depth_m, width as usize);
        RoomPicture { colour, depth_m, camera: *camera }
    }

    /// Steps of a Kinect's disparity: 2.85 mm at one metre, growing with the square of the distance.
    fn measured(&self, depth_m: f64) -> f32 {
        if !self.sensor {
            return depth_m as f32;
        }
        let step = 0.00285 * depth_m * depth_m;
        ((depth_m / step).round() * step) as f32
    }

    fn shaded(&self, point: DVec3, hit: &Hit) -> Vec3 {
        let towards = self.lamp.towards.normalize_or(DVec3::Y);
        let facing = hit.normal.dot(towards).max(0.0);
        let start = point + hit.normal * 1e-4;
        let direct =
            if facing > 0.0 && !self.is_hidden(start, towards, f64::INFINITY) { facing } else { 0.0 };
        hit.albedo * self.lamp.colour * (AMBIENT + 0.75 * direct as f32)
    }

    fn is_hidden(&self, from: DVec3, way: DVec3, most: f64) -> bool {
        // A lamp shines through the walls, as windows would.
        self.bodies().iter().any(|(body, _)| body.hit(from, way).is_some_and(|(along, _)| along < most))
    }

    fn first_hit(&self, origin: DVec3, way: DVec3) -> Option<Hit> {
        let mut nearest: Option<Hit> = None;
        let mut consider = |along: f64, normal: DVec3, albedo: Vec3| {
            if along > 1e-6 && nearest.as_ref().is_none_or(|hit| along < hit.along) {
                nearest = Some(Hit { along, normal, albedo });
            }
        };
        for (body, albedo) in self.bodies() {
            if let Some((along, normal)) = body.hit(origin, way) {
                let point = origin + way * along;
                consider(along, normal, albedo * grain(point, normal));
            }
        }
        let floor = -origin.y / way.y;
        let at = origin + way * floor;
        let tile = ((at.x * 2.5).floor() + (at.z * 2.5).floor()).rem_euclid(2.0) as f32;
        consider(floor, DVec3::Y, Vec3::new(0.30, 0.27, 0.24) * (0.85 + 0.15 * tile));
        consider((WALL_Z_M - origin.z) / way.z, DVec3::Z, Vec3::new(0.46, 0.47, 0.45));
        for side in [-2.0, 2.0] {
            consider((side - origin.x) / way.x, DVec3::X * -side.signum(), Vec3::new(0.42, 0.43, 0.45));
        }
        nearest
    }

    /// The table top and what stands on it.
    fn bodies(&self) -> Vec<(Body, Vec3)> {
        let [x, z] = self.half_table_m;
        let y = self.table_height_m;
        let top = Body::Box { low: DVec3::new(-x, y - 0.03, -z), high: DVec3::new(x, y, z) };
        let mut bodies = vec![(top, Vec3::new(0.36, 0.26, 0.17))];
        for (sx, sz) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let foot = DVec3::new(sx * (x - 0.05), 0.0, sz * (z - 0.05));
            bodies.push((Body::Cylinder { foot, radius: 0.025, height: y - 0.03 }, Vec3::splat(0.12)));
        }
        bodies.extend(self.things());
        bodies
    }

    /// A box at the right end, a cup at the near edge: from in front the cup hides a part of the pitch.
    fn things(&self) -> Vec<(Body, Vec3)> {
        let y = self.table_height_m;
        let carton = Body::Box { low: DVec3::new(0.44, y, -0.24), high: DVec3::new(0.62, y + 0.2, -0.1) };
        let cup = Body::Cylinder { foot: DVec3::new(0.12, y, 0.34), radius: 0.04, height: 0.11 };
        vec![(carton, Vec3::new(0.16, 0.28, 0.52)), (cup, Vec3::new(0.62, 0.20, 0.14))]
    }
}

impl Body {
    /// Distance in lengths of `way` and the outward normal where a ray first enters.
    fn hit(&self, origin: DVec3, way: DVec3) -> Option<(f64, DVec3)> {
        match *self {
            Self::Box { low, high } => {
                let (to_low, to_high) = ((low - origin) / way, (high - origin) / way);
                let (near, far) = (to_low.min(to_high), to_low.max(to_high));
                let (enter, leave) = (near.max_element(), far.min_element());
                let axis = DVec3::AXES.into_iter().find(|axis| near.dot(*axis) == enter)?;
                (enter > 1e-9 && enter < leave).then(|| (enter, -axis * way.dot(axis).signum()))
            }
            Self::Cylinder { foot, radius, height } => {
                let from = origin - foot;
                let (flat, level) = (DVec2::new(from.x, from.z), DVec2::new(way.x, way.z));
                let (a, b) = (level.length_squared(), flat.dot(level));
                let root = (b * b - a * (flat.length_squared() - radius * radius)).sqrt();
                let side = (-b - root) / a;
                let at = from + way * side;
                if side > 1e-9 && (0.0..=height).contains(&at.y) {
                    return Some((side, DVec3::new(at.x, 0.0, at.z) / radius));
                }
                let top = (height - from.y) / way.y;
                let at = flat + level * top;
                (top > 1e-9 && at.length() <= radius && way.y < 0.0).then_some((top, DVec3::Y))
            }
        }
    }
}

/// A picture as scanners write it: an organised cloud with colours, PCD, in the axes of its camera.
#[must_use]
pub fn to_pcd(picture: &RoomPicture) -> Vec<u8> {
    let (width, height) = picture.colour.dimensions();
    let mut bytes = format!(
        "VERSION 0.7\nFIELDS x y z rgba\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH {width}\nHEIGHT {height}\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA binary\n",
        width * height
    )
    .into_bytes();
    let camera = &picture.camera;
    for (column, row, colour) in picture.colour.enumerate_pixels() {
        let point = picture.point_m(column, row).map(|point| camera.rotation * (point - camera.position_m));
        let point = point.map_or(Vec3::NAN, DVec3::as_vec3);
        bytes.extend(point.to_array().iter().flat_map(|value| value.to_le_bytes()));
        let [red, green, blue, _] = colour.0;
        bytes.extend([blue, green, red, 255]);
    }
    bytes
}

/// A little variation, so that no surface is one flat colour.
fn grain(point: DVec3, normal: DVec3) -> f32 {
    if normal.y < 0.5 {
        return 1.0;
    }
    (1.0 + 0.07 * (point.z * 90.0 + (point.x * 7.0).sin() * 1.5).sin()) as f32
}

fn srgb(linear: Vec3) -> Rgba<u8> {
    let encode = |value: f32| {
        let value = value.clamp(0.0, 1.0);
        let encoded =
            if value <= 0.003_130_8 { value * 12.92 } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 };
        (encoded * 255.0).round() as u8
    };
    Rgba([encode(linear.x), encode(linear.y), encode(linear.z), 255])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_lies_on_the_table_and_the_cup_stands_in_front() {
        let room = SyntheticRoom { sensor: false, ..SyntheticRoom::default() };
        let camera = room.cameras()[0];
        let picture = room.picture(&camera);
        let plane = room.table().plane;
        let at = |point: DVec3| {
            let (pixel, _) = camera.project(point).unwrap();
            picture.point_m(pixel.x.round() as u32, pixel.y.round() as u32).unwrap()
        };
        for place in [DVec3::new(-0.3, 0.74, 0.0), DVec3::new(0.2, 0.74, -0.2)] {
            assert!(plane.distance_m(at(place)).abs() < 1e-6);
        }
        let cup = at(DVec3::new(0.12, 0.80, 0.38));
        assert!((cup - DVec3::new(0.12, 0.8, 0.34)).length() < 0.045, "{cup}");
    }

    #[test]
    fn the_sensor_leaves_steps_but_no_small_holes() {
        let room = SyntheticRoom::default();
        let picture = room.picture(&room.cameras()[0]);
        let unknown = picture.depth_m.iter().filter(|depth| **depth == 0.0).count();
        assert!(unknown < picture.depth_m.len() / 20, "{unknown} pixels are unknown");
        let plane = room.table().plane;
        let point = picture.point_m(320, 300).unwrap();
        assert!(plane.distance_m(point).abs() < 0.003 && plane.distance_m(point) != 0.0);
    }
}
