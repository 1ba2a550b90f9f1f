//! Rooms made of boxes and a depth camera that looks at them, with the noise, outliers and gaps of a real one: the truth
//! that the finder is measured on.

use glam::{DAffine3, DMat3, DVec3, Vec3};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{Plane, PointCloud};

/// A box of the room; y is up, the floor of a room is at 0.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    room_from_body: DAffine3,
    half_m: DVec3,
}

impl Body {
    /// A box that stands on `foot_m` (the middle of its lower side).
    #[must_use]
    pub fn standing(foot_m: DVec3, size_m: DVec3) -> Self {
        let middle = foot_m + DVec3::Y * size_m.y / 2.0;
        Self { room_from_body: DAffine3::from_translation(middle), half_m: size_m / 2.0 }
    }

    /// The same, leaning about the room's x axis through its middle, degrees.
    #[must_use]
    pub fn leaning(self, degrees: f64) -> Self {
        let turn = DAffine3::from_rotation_x(degrees.to_radians());
        Self { room_from_body: self.room_from_body * turn, ..self }
    }

    /// The plane of its upper side.
    #[must_use]
    pub fn top(&self) -> Plane {
        let point = self.room_from_body.transform_point3(DVec3::Y * self.half_m.y);
        Plane::through(point, self.room_from_body.transform_vector3(DVec3::Y))
    }

    /// Where a ray enters, as a multiple of `direction`.
    fn hit(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let body_from_room = self.room_from_body.inverse();
        let origin = body_from_room.transform_point3(origin);
        let inverse = body_from_room.transform_vector3(direction).recip();
        let (one, other) = ((-self.half_m - origin) * inverse, (self.half_m - origin) * inverse);
        let (enter, leave) = (one.min(other).max_element(), one.max(other).min_element());
        (enter > 0.0 && enter < leave).then_some(enter)
    }
}

/// A floor and a wall at the back (z = −2).
#[must_use]
pub fn bare_room() -> Vec<Body> {
    vec![
        Body::standing(DVec3::NEG_Y * 0.1, DVec3::new(8.0, 0.1, 8.0)),
        Body::standing(DVec3::NEG_Z * 2.05, DVec3::new(8.0, 3.0, 0.1)),
    ]
}

/// A table of 1.2 × 0.7 m, 0.74 m high, in the middle of the room.
#[must_use]
pub fn table() -> Body {
    Body::standing(DVec3::Y * 0.70, DVec3::new(1.2, 0.04, 0.7))
}

/// Three things on that table.
#[must_use]
pub fn clutter() -> [Body; 3] {
    let on_table =
        |x: f64, z: f64, size: [f64; 3]| Body::standing(DVec3::new(x, 0.74, z), DVec3::from_array(size));
    [
        on_table(-0.3, 0.1, [0.2, 0.06, 0.14]),
        on_table(0.25, -0.15, [0.08, 0.2, 0.08]),
        on_table(0.45, 0.2, [0.12, 0.03, 0.2]),
    ]
}

/// A depth camera.
#[derive(Clone, Copy, Debug)]
pub struct Sensor {
    /// Columns and rows.
    pub size_px: (usize, usize),
    /// Times the noise of a Kinect (see [`super::Noise::Triangulated`]).
    pub noise: f64,
    /// Share of the points that lie anywhere on their ray.
    pub outliers: f64,
    /// Share of the points that are not measured.
    pub gaps: f64,
    /// Seed of chance.
    pub seed: u64,
}

impl Default for Sensor {
    fn default() -> Self {
        Self { size_px: (320, 240), noise: 1.0, outliers: 0.002, gaps: 0.03, seed: 1 }
    }
}

/// The room from camera axes (x right, y down, z forward) of a camera at `eye` that looks at `target`.
#[must_use]
pub fn room_from_camera(eye: DVec3, target: DVec3) -> DAffine3 {
    let forward = (target - eye).normalize();
    let right = forward.cross(DVec3::Y).try_normalize().unwrap_or(DVec3::X);
    DAffine3 { matrix3: DMat3::from_cols(right, forward.cross(right), forward), translation: eye }
}

/// A plane of the room in the axes of that camera.
#[must_use]
pub fn seen_plane(plane: &Plane, room_from_camera: &DAffine3) -> Plane {
    let normal = room_from_camera.matrix3.transpose() * plane.normal;
    Plane { normal, offset_m: plane.distance_m(room_from_camera.translation) }
}

impl Sensor {
    /// What the camera measures, in its own axes, in rows and columns.
    #[must_use]
    pub fn scan(&self, room: &[Body], room_from_camera: &DAffine3) -> PointCloud {
        let mut random = Pcg64Mcg::seed_from_u64(self.seed);
        let (columns, rows) = self.size_px;
        // The field of view of a Kinect: 63 degrees across.
        let focal_px = columns as f64 * 0.82;
        let points = (0..columns * rows).map(|index| {
            let (column, row) = ((index % columns) as f64, (index / columns) as f64);
            let ray = DVec3::new(
                (column - columns as f64 / 2.0 + 0.5) / focal_px,
                (row - rows as f64 / 2.0 + 0.5) / focal_px,
                1.0,
            );
            let hit = nearest(room, room_from_camera.translation, room_from_camera.matrix3 * ray);
            let chance: f64 = random.random();
            let noise = gaussian(&mut random);
            let anywhere = random.random_range(0.4..5.0);
            match hit {
                Some(depth_m) if chance > self.gaps + self.outliers && depth_m < 8.0 => {
                    let far = (depth_m - 0.4).max(0.0);
                    let sigma_m = self.noise * (0.0012 + 0.0019 * far * far);
                    (ray * (depth_m + sigma_m * noise)).as_vec3()
                }
                _ if chance < self.outliers => (ray * anywhere).as_vec3(),
                _ => Vec3::NAN,
            }
        });
        PointCloud::organised(points.collect(), columns)
    }

    /// What a phone gathers while it walks past: `count` points in the room's frame, without order, with the same noise
    /// `sigma_m` everywhere.
    #[must_use]
    pub fn gather(&self, room: &[Body], eye: DVec3, target: DVec3, count: usize, sigma_m: f64) -> PointCloud {
        let mut random = Pcg64Mcg::seed_from_u64(self.seed);
        let camera = room_from_camera(eye, target);
        let mut points = Vec::with_capacity(count);
        for _ in 0..count * 4 {
            if points.len() == count {
                break;
            }
            let step = DVec3::new(random.random_range(-0.5..0.5), random.random_range(-0.1..0.1), 0.0);
            let ray = DVec3::new(random.random_range(-0.6..0.6), random.random_range(-0.45..0.45), 1.0);
            let (origin, ray) = (eye + step, camera.matrix3 * ray);
            let Some(depth) = nearest(room, origin, ray) else { continue };
            let depth = if random.random::<f64>() < self.outliers {
                depth * random.random_range(0.5..1.5)
            } else {
                depth
            };
            let noise = DVec3::from_array(std::array::from_fn(|_| gaussian(&mut random))) * sigma_m;
            points.push((origin + ray * depth + noise).as_vec3());
        }
        PointCloud::unorganised(points).seen_from(eye).with_up(DVec3::Y)
    }
}

fn nearest(room: &[Body], origin: DVec3, direction: DVec3) -> Option<f64> {
    room.iter().filter_map(|body| body.hit(origin, direction)).min_by(f64::total_cmp)
}

/// Near enough to a Gaussian of unit variance: the sum of twelve even chances (Irwin and Hall).
fn gaussian(random: &mut Pcg64Mcg) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}
