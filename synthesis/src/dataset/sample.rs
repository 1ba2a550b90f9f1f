//! One sample: a player in front of a camera, rendered, degraded, cropped, with the exact truth of the crop.

use glam::{DVec2, DVec3, Vec3};
use image::RgbImage;
use protocol::camera::Camera;
use rand::Rng;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;

use super::{
    CROP, DepthOptions, NO_OFFSET, OFFSETS, Split,
    cast::{Cast, rng},
};
use crate::{
    SynthesisError,
    gait::{self, Action},
    motion::Pose,
    raster::{Grid, first_and_last},
    render::{Actor, Scene, Window},
    rig::{self, Placement},
    sensor::Sensor,
};

/// Share of training players who do two things at once.
const MIXED: f64 = 0.5;

/// One line of `meta.jsonl`.
#[derive(Clone, Debug, Serialize)]
pub struct SampleMeta {
    /// Index in the whole set.
    pub index: usize,
    /// Seed of the sample.
    pub seed: u64,
    /// Motion clip or formula; two of them, joined by `+`, when the player does both.
    pub motion: String,
    /// Share of the motion 0..1.
    pub phase: f32,
    /// Body.
    pub body: u32,
    /// Kit.
    pub kit: String,
    /// Shirt number, when there is one.
    pub number: Option<u8>,
    /// Camera of the whole 1280×720 picture.
    pub camera: Camera,
    /// Clip pixel of the crop's first pixel centre (x, y), and clip pixels per crop pixel.
    pub crop: [f64; 3],
    /// Ground point under the hips, world metres.
    pub anchor_m: [f64; 3],
    /// Heading about y; 0 looks along +z.
    pub yaw: f32,
    /// Height of the person's box in the clip, pixels.
    pub height_px: f64,
    /// Share of the person's samples that nobody covers, inside the crop.
    pub visible_share: f32,
    /// The whole boxes (left, top, right, bottom, clip pixels) of the others who are in the crop.
    pub others_px: Vec<[f64; 4]>,
    /// BlazePose's 33 landmarks in clip pixels.
    pub joints_px: Vec<[f64; 2]>,
    /// The same in world metres.
    pub joints_m: Vec<[f64; 3]>,
}

/// One sample in memory.
pub struct Sample {
    /// RGB, `CROP`².
    pub crop: RgbImage,
    /// 255 where the person is in front, `CROP`².
    pub mask: Vec<u8>,
    /// Millimetres from the virtual plane to the surface that is seen, positive away from the camera, `OFFSETS`².
    pub offsets_mm: Vec<i16>,
    /// The same to the body's first surface, also where somebody stands before it.
    pub front_mm: Vec<i16>,
    /// The same to the body's last surface.
    pub back_mm: Vec<i16>,
    /// The rest.
    pub meta: SampleMeta,
}

/// The camera at `position` that sees `target` at `pixel`, horizon level.
#[must_use]
pub fn aim(size_px: (u32, u32), focal_px: f64, position: DVec3, target: DVec3, pixel: DVec2) -> Camera {
    let mut camera = Camera::looking_at(size_px, focal_px, position, target);
    let n = (pixel - camera.centre_px()) / focal_px;
    let sight = (target - position).normalize_or(DVec3::NEG_Z);
    // Along the sight the world's y must come out right: n.y cos(tilt) + sin(tilt) = −sight.y |n|.
    let length = n.extend(1.0).length();
    let tilt = ((-sight.y * length) / (1.0 + n.y * n.y).sqrt()).clamp(-1.0, 1.0).asin() - n.y.atan();
    let ahead = tilt.cos() - n.y * tilt.sin(); // the horizontal part that points ahead; n.x points right
    let heading = sight.x.atan2(-sight.z) - n.x.atan2(ahead);
    let forward = DVec3::new(heading.sin() * tilt.cos(), -tilt.sin(), -heading.cos() * tilt.cos());
    camera = Camera::looking_at(size_px, focal_px, position, position + forward);
    camera
}

fn draw_pose(actions: &[Action<'_>], split: Split, rng: &mut Pcg64Mcg) -> (String, f32, Pose) {
    let phase = rng.random_range(0.0..1.0);
    let mood = rng.random_range(0.0..1.0);
    let Some(action) = gait::draw(actions, rng) else { return ("none".into(), 0.0, Pose::default()) };
    let strength = if rng.random_bool(0.8) { 1.0 } else { 0.0 };
    let (mut name, mut pose) = (action.name.clone(), action.pose(phase, mood));
    if split == Split::Train
        && rng.random_bool(MIXED)
        && let Some(other) = gait::draw(actions, rng)
    {
        let other_pose = other.pose(rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
        pose = gait::mixed(&pose, &other_pose, rng);
        name = format!("{name}+{}", other.name);
    }
    (name, phase, gait::personal(pose, strength, rng))
}

/// Renders one sample.
pub(super) fn draw(
    options: &DepthOptions,
    index: usize,
    cast: &Cast,
    actions: &[Action<'_>],
) -> Result<Sample, SynthesisError> {
    let seed = options.seed.wrapping_mul(1_000_003).wrapping_add(index as u64);
    let rng = &mut rng(options.seed, &[9, index as u64]);
    let stadium = &cast.stadiums[rng.random_range(0..cast.stadiums.len())];
    let main = rng.random_range(0..cast.figures.len());
    let (motion, phase, pose) = draw_pose(actions, options.split, rng);

    // Where the player stands and where the camera is.
    let (position, anchor) = loop {
        let aside = if rng.random_bool(0.8) { 10.0 } else { 45.0 };
        let position = DVec3::new(
            rng.random_range(-aside..aside),
            rng.random_range(8.0..25.0),
            34.0 + rng.random_range(8.0..48.0),
        );
        let anchor = DVec3::new(rng.random_range(-51.0..51.0), 0.0, rng.random_range(-33.0..33.5));
        if (30.0..115.0).contains(&position.distance(anchor)) {
            break (position, anchor);
        }
    };
    let yaw = rng.random_range(-std::f32::consts::PI..std::f32::consts::PI);
    let placement = Placement { anchor_m: anchor.as_vec3(), yaw };
    let posed = rig::pose(&cast.figures[main].0, &pose).placed(&placement);

    let [low, high] = options.height_px;
    let wanted_px = f64::from(low * (high / low).powf(rng.random_range(0.0..1.0f32)));
    let focal = wanted_px * position.distance(anchor) / 1.78;
    let pixel = DVec2::new(rng.random_range(60.0..1220.0), rng.random_range(150.0..690.0));
    let camera = aim((1280, 720), focal, position, anchor, pixel);

    let mut actors = vec![Actor { figure: &cast.figures[main].0, posed }];
    if rng.random_bool(0.4) {
        for _ in 0..rng.random_range(1..3) {
            let other = rng.random_range(0..cast.figures.len());
            let (_, _, pose) = draw_pose(actions, options.split, rng);
            let (away, around) =
                (rng.random_range(0.55..2.6f32), rng.random_range(0.0..std::f32::consts::TAU));
            let place = Placement {
                anchor_m: placement.anchor_m + Vec3::new(around.cos(), 0.0, around.sin()) * away,
                yaw: rng.random_range(-3.2..3.2),
            };
            let figure = &cast.figures[other].0;
            actors.push(Actor { figure, posed: rig::pose(figure, &pose).placed(&place) });
        }
    }
    let joints = actors[0].posed.landmarks.clone();
    let scene = Scene { stadium, actors, solids: Vec::new(), nets: None };

    // The crop: the box of the whole person, hidden parts too, made square and wide enough for the pose network.s look (1.5 times the box).
    let boxed = |actor: &Actor<'_>| {
        let seen = actor.posed.positions.iter().filter_map(|p| camera.project(p.as_dvec3()));
        seen.fold((DVec2::MAX, DVec2::MIN), |(least, most), pixel| (least.min(pixel), most.max(pixel)))
    };
    let (least, most) = boxed(&scene.actors[0]);
    let (mut centre, mut side) = ((least + most) / 2.0, (most - least).max_element() * 1.6);
    if options.split == Split::Train {
        // The detector's boxes are never exact.
        side *= rng.random_range(0.93..1.12);
        centre += DVec2::new(rng.random_range(-0.04..0.04), rng.random_range(-0.04..0.04)) * side;
    }
    let scale = side / CROP as f64;
    let corner = centre - DVec2::splat(scale * (CROP as f64 - 1.0) / 2.0);

    // Render the native pixels round the crop, on the codec's blocks of eight, then enlarge.
    let first = [corner.x, corner.y].map(|c| (((c - 3.0) / 8.0).floor() * 8.0) as i32);
    let last = [corner.x, corner.y].map(|c| (c + side + 3.0).ceil() as i32);
    let window =
        Window { first, size: [0, 1].map(|k| ((last[k] - first[k]).max(8) as usize).div_ceil(8) * 8) };
    let fine = if side > 120.0 { 2 } else { 3 };
    let light = scene.render(&camera, window, fine);
    let native = Sensor::random(rng).expose(&light, rng)?;
    let crop = enlarge(&native, [corner.x - f64::from(first[0]), corner.y - f64::from(first[1])], scale);

    let grid = Grid { origin_px: corner.to_array(), per_px: 1.0 / scale, width: CROP, height: CROP };
    let hits = scene.first_hits(&camera, grid);
    let mask: Vec<u8> = hits.iter().map(|hit| if matches!(hit, Some((0, _))) { 255 } else { 0 }).collect();
    let mut in_crop: Vec<usize> = hits.iter().flatten().map(|hit| hit.0).filter(|&actor| actor > 0).collect();
    in_crop.sort_unstable();
    in_crop.dedup();
    let alone = Scene { stadium, actors: scene.actors[..1].to_vec(), solids: Vec::new(), nets: None };
    let whole = if scene.actors.len() > 1 {
        alone.first_hits(&camera, grid).iter().flatten().count()
    } else {
        hits.iter().flatten().count()
    };
    let visible = mask.iter().filter(|&&m| m > 0).count();

    let half = Grid {
        origin_px: (corner + DVec2::splat(0.5 * scale)).to_array(),
        per_px: 0.5 / scale,
        width: OFFSETS,
        height: OFFSETS,
    };
    let millimetres = |place: usize, depth: f32| {
        let pixel = half.pixel(place % OFFSETS, place / OFFSETS);
        let offset = f64::from(depth) - plane_depth(&camera, anchor, pixel.into());
        (offset * 1000.0).round().clamp(-32_000.0, 32_000.0) as i16
    };
    let seen = scene.first_hits(&camera, half);
    let offsets_mm = seen.iter().enumerate().map(|(place, hit)| match hit {
        Some((0, depth)) => millimetres(place, *depth),
        _ => NO_OFFSET,
    });
    let body = &scene.actors[0];
    let surfaces = first_and_last(&camera, half, &body.posed.positions, &body.figure.triangles);
    let [front_mm, back_mm] = surfaces.map(|depths| {
        let offset = |(place, depth): (usize, &f32)| {
            if *depth > 0.0 { millimetres(place, *depth) } else { NO_OFFSET }
        };
        depths.iter().enumerate().map(offset).collect()
    });
    let offsets_mm = offsets_mm.collect();

    let meta = SampleMeta {
        index,
        seed,
        motion,
        phase,
        body: cast.figures[main].1,
        kit: cast.figures[main].0.outfit.kit.id.clone(),
        number: cast.figures[main].0.outfit.number,
        camera,
        crop: [corner.x, corner.y, scale],
        anchor_m: anchor.to_array(),
        yaw,
        height_px: most.y - least.y,
        visible_share: visible as f32 / whole.max(1) as f32,
        others_px: in_crop
            .iter()
            .map(|&actor| boxed(&scene.actors[actor]))
            .map(|(least, most)| [least.x, least.y, most.x, most.y])
            .collect(),
        joints_px: joints
            .iter()
            .map(|j| camera.project(j.as_dvec3()).unwrap_or(DVec2::splat(-1e4)).to_array())
            .collect(),
        joints_m: joints.iter().map(|j| j.as_dvec3().to_array()).collect(),
    };
    Ok(Sample { crop, mask, offsets_mm, front_mm, back_mm, meta })
}

/// Depth along the optical axis of the virtual plane of `anchor` at a pixel: the upright plane through the anchor
/// that faces the camera.
#[must_use]
pub fn plane_depth(camera: &Camera, anchor: DVec3, pixel: DVec2) -> f64 {
    let towards = camera.position - anchor;
    let normal = DVec3::new(towards.x, 0.0, towards.z).normalize_or(DVec3::Z);
    let ray = camera.ray(pixel);
    let distance = (anchor - ray.origin).dot(normal) / ray.direction.dot(normal);
    distance * ray.direction.dot(camera.forward())
}

/// Bilinear samples of `image` at `corner + scale · (u, v)`.
fn enlarge(image: &RgbImage, corner: [f64; 2], scale: f64) -> RgbImage {
    let (width, height) = image.dimensions();
    RgbImage::from_fn(CROP as u32, CROP as u32, |u, v| {
        let x = (corner[0] + scale * f64::from(u)).clamp(0.0, f64::from(width - 1)) as f32;
        let y = (corner[1] + scale * f64::from(v)).clamp(0.0, f64::from(height - 1)) as f32;
        let (x0, y0) = (x as u32, y as u32);
        let (x1, y1) = ((x0 + 1).min(width - 1), (y0 + 1).min(height - 1));
        let (fx, fy) = (x - x0 as f32, y - y0 as f32);
        let [a, b, c, d] =
            [(x0, y0), (x1, y0), (x0, y1), (x1, y1)].map(|(x, y)| image.get_pixel(x, y).0.map(f32::from));
        image::Rgb([0, 1, 2].map(|k| {
            let top = a[k] + (b[k] - a[k]) * fx;
            let bottom = c[k] + (d[k] - c[k]) * fx;
            (top + (bottom - top) * fy + 0.5) as u8
        }))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{body::BaseBody, motion::Motions};

    #[test]
    fn an_aimed_camera_sees_its_target_where_it_should_with_a_level_horizon() {
        let (position, target) = (DVec3::new(-7.0, 15.0, 70.0), DVec3::new(30.0, 0.0, -12.0));
        for pixel in [DVec2::new(100.0, 650.0), DVec2::new(1200.0, 200.0), DVec2::new(640.0, 360.0)] {
            let camera = aim((1280, 720), 2600.0, position, target, pixel);
            assert!(camera.project(target).unwrap().distance(pixel) < 1e-6);
            assert!(camera.rotation.row(0).y.abs() < 1e-9, "the picture's x axis is horizontal");
        }
    }

    #[test]
    fn offsets_lead_back_to_points_of_a_standing_body() {
        let base = BaseBody::load().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let options = super::super::tests::options(folder.path(), Split::Train);
        let motions = Motions::shipped().unwrap();
        let actions = gait::repertoire(&motions, Split::Train);
        let cast = Cast::new(&base, &options, 0, 4);
        for index in 0..4 {
            let made = draw(&options, index, &cast, &actions).unwrap();
            let (anchor, camera) = (DVec3::from(made.meta.anchor_m), made.meta.camera);
            let [x0, y0, scale] = made.meta.crop;
            let mut seen = 0;
            for (place, &offset) in made.offsets_mm.iter().enumerate() {
                let (i, j) = (place % OFFSETS, place / OFFSETS);
                let masked = made.mask[2 * j * CROP + 2 * i] > 0;
                if offset == NO_OFFSET {
                    continue;
                }
                seen += usize::from(masked);
                let pixel = DVec2::new(
                    x0 + scale * (2 * i) as f64 + 0.5 * scale,
                    y0 + scale * (2 * j) as f64 + 0.5 * scale,
                );
                let depth = plane_depth(&camera, anchor, pixel) + f64::from(offset) / 1000.0;
                let ray = camera.ray(pixel);
                let point = ray.origin + ray.direction * (depth / ray.direction.dot(camera.forward()));
                assert!((-0.05..2.8).contains(&point.y), "a body point {} m high", point.y);
                assert!((point - anchor).with_y(0.0).length() < 1.5);
            }
            let masked = made.mask.iter().filter(|&&m| m > 0).count();
            assert!(seen * 4 > masked * 8 / 10 && masked > 1500, "{seen} offsets for {masked} mask pixels");
        }
    }
}
