//! Surfaces whose shape is known exactly, seen by a main camera, must come back as they are.

use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};
use protocol::{camera::Camera, manifest::PersonId};

use super::*;
use crate::{
    geometry::Mask,
    pose::{JOINTS, Joint, Person},
};

const RED: Rgb<u8> = Rgb([200, 30, 30]);
const GRASS: Rgb<u8> = Rgb([40, 120, 40]);

fn camera() -> Camera {
    Camera::looking_at((1920, 1080), 4000.0, DVec3::new(2.0, 18.0, 75.0), DVec3::new(8.0, 0.0, 5.0))
}

fn person_at(ground_m: DVec3) -> Person {
    let joint = Joint { pixel: DVec2::ZERO, depth_m: 0.0, visibility: 0.0 };
    Person {
        pose_score: 0.8,
        joints: vec![joint; JOINTS],
        ground_m,
        neck_m: ground_m + DVec3::Y * 1.5,
        ..Person::blank()
    }
}

/// What the camera sees of a body given by the first hit of a ray: a depth map, and a red body on grass.
fn photograph(
    camera: &Camera,
    anchor_m: DVec3,
    hit: impl Fn(&protocol::camera::Ray) -> Option<DVec3>,
) -> (DepthMap, RgbImage) {
    let plane = VirtualPlane::new(camera, anchor_m).unwrap();
    let middle = camera.project(anchor_m + DVec3::Y * 0.9).unwrap().round().as_ivec2();
    let (width, height) = (160_u32, 260_u32);
    let (x0, y0) = (middle.x - width as i32 / 2, middle.y - height as i32 / 2);
    let mut image = RgbImage::from_pixel(camera.width_px, camera.height_px, GRASS);
    let mut mask = Mask { x0, y0, width, height, coverage: Vec::new() };
    let mut offset_m = Vec::new();
    for y in y0..y0 + height as i32 {
        for x in x0..x0 + width as i32 {
            let pixel = DVec2::new(f64::from(x), f64::from(y));
            let inside = (0..16).filter(|i| {
                let sub = DVec2::new(f64::from(i % 4), f64::from(i / 4)) / 4.0 - 0.375;
                hit(&camera.ray(pixel + sub)).is_some()
            });
            mask.coverage.push((inside.count() * 255 / 16) as u8);
            offset_m.push(match hit(&camera.ray(pixel)) {
                Some(point) => {
                    let on_plane = plane.point(pixel, 0.0).unwrap();
                    image.put_pixel(x as u32, y as u32, RED);
                    (camera.depth(point) - camera.depth(on_plane)) as f32
                }
                None => 0.0,
            });
        }
    }
    (DepthMap { mask, offset_m }, image)
}

/// First hit of an upright cylinder with a flat top standing at `foot`.
fn cylinder(ray: &protocol::camera::Ray, foot: DVec3, radius_m: f64, height_m: f64) -> Option<DVec3> {
    let (o, d) = (ray.origin - foot, ray.direction);
    let (a, b) = (d.x * d.x + d.z * d.z, o.x * d.x + o.z * d.z);
    let c = o.x * o.x + o.z * o.z - radius_m * radius_m;
    let side = (b * b - a * c >= 0.0)
        .then(|| ray.origin + d * ((-b - (b * b - a * c).sqrt()) / a))
        .filter(|p| (foot.y..=foot.y + height_m).contains(&p.y));
    let top = ray.at_height(foot.y + height_m).filter(|p| (*p - foot).with_y(0.0).length() <= radius_m);
    match (side, top) {
        (Some(side), Some(top)) => {
            Some(if ray.origin.distance(side) < ray.origin.distance(top) { side } else { top })
        }
        (side, top) => side.or(top),
    }
}

fn world(surface: &BodySurface) -> Vec<DVec3> {
    let points = surface.mesh.positions_m.iter();
    points.map(|p| DVec3::from(p.map(f64::from)) + surface.anchor_m).collect()
}

#[test]
fn a_cylinder_comes_back_within_a_centimetre() {
    let camera = camera();
    let anchor_m = DVec3::new(10.0, 0.0, 8.0);
    let (depth, image) = photograph(&camera, anchor_m, |ray| cylinder(ray, anchor_m, 0.3, 1.8));
    let person = person_at(anchor_m);
    let surface = lift(
        &image,
        &camera,
        Figure::standing(PersonId(3), 7),
        &person,
        &depth,
        &MeshBudget { triangles: 100_000 },
    )
    .unwrap();
    let points = world(&surface);
    assert!(points.len() > 2_000, "{} points", points.len());
    // The outline is where the ray only grazes the surface: its depth is its inner neighbour's.
    let errors: Vec<f64> = points
        .iter()
        .filter(|p| p.y < 1.7)
        .map(|p| ((*p - anchor_m).with_y(0.0).length() - 0.3).abs())
        .collect();
    let mut sorted = errors.clone();
    sorted.sort_by(f64::total_cmp);
    assert!(sorted[sorted.len() * 95 / 100] < 0.01, "95 % within {}", sorted[sorted.len() * 95 / 100]);
    assert!(sorted[sorted.len() - 1] < 0.08, "worst {}", sorted[sorted.len() - 1]);
    let (low, high) = points.iter().fold((9.0_f64, -9.0_f64), |(l, h), p| (l.min(p.y), h.max(p.y)));
    assert!(low.abs() < 0.03, "stands at {low}");
    assert!((high - 1.8).abs() < 0.03, "top at {high}");
}

#[test]
fn a_sphere_keeps_its_shape_under_a_budget() {
    let camera = camera();
    let anchor_m = DVec3::new(-4.0, 0.0, -10.0);
    let (centre, radius_m) = (DVec3::new(-4.0, 0.6, -10.0), 0.6);
    let sphere = |ray: &protocol::camera::Ray| {
        let o = ray.origin - centre;
        let b = o.dot(ray.direction);
        let root = b * b - (o.length_squared() - radius_m * radius_m);
        (root >= 0.0).then(|| ray.origin + ray.direction * (-b - root.sqrt()))
    };
    let (depth, image) = photograph(&camera, anchor_m, sphere);
    for triangles in [1_000, 300] {
        let budget = MeshBudget { triangles };
        let surface =
            lift(&image, &camera, Figure::standing(PersonId(0), 0), &person_at(anchor_m), &depth, &budget)
                .unwrap();
        assert!(surface.mesh.triangles.len() <= triangles);
        assert!(surface.mesh.triangles.len() * 10 >= triangles * 9, "the budget is used");
        // The ball's lowest point is hidden under it, so the body is set down by a little: judge the shape without that.
        let spread = |down_mm: i32| {
            let centre = centre - DVec3::Y * f64::from(down_mm) / 1_000.0;
            let mut errors: Vec<f64> =
                world(&surface).iter().map(|p| (p.distance(centre) - radius_m).abs()).collect();
            errors.sort_by(f64::total_cmp);
            errors[errors.len() * 8 / 10]
        };
        let best = (0..40).map(spread).fold(f64::INFINITY, f64::min);
        assert!(best < 0.01, "80 % within {best}");
    }
}

#[test]
fn triangles_face_the_camera_and_the_texture_shows_no_grass() {
    let camera = camera();
    let anchor_m = DVec3::new(10.0, 0.0, 8.0);
    let (depth, image) = photograph(&camera, anchor_m, |ray| cylinder(ray, anchor_m, 0.3, 1.8));
    let surface = lift(
        &image,
        &camera,
        Figure::standing(PersonId(0), 0),
        &person_at(anchor_m),
        &depth,
        &MeshBudget { triangles: 100_000 },
    )
    .unwrap();
    let points = world(&surface);
    let away = surface.mesh.triangles.iter().filter(|triangle| {
        let [a, b, c] = triangle.map(|index| points[index as usize]);
        (b - a).cross(c - a).dot(camera.position - a) < 0.0
    });
    assert_eq!(away.count(), 0);
    for pixel in surface.texture.pixels() {
        assert_eq!(*pixel, RED);
    }
    for uv in &surface.mesh.uvs {
        assert!(uv.iter().all(|t| (0.0..=1.0).contains(t)));
    }
}

#[test]
fn texture_coordinates_point_at_the_pixel_a_vertex_was_seen_in() {
    let camera = camera();
    let anchor_m = DVec3::new(10.0, 0.0, 8.0);
    let (depth, image) = photograph(&camera, anchor_m, |ray| cylinder(ray, anchor_m, 0.3, 1.8));
    let surface = lift(
        &image,
        &camera,
        Figure::standing(PersonId(0), 0),
        &person_at(anchor_m),
        &depth,
        &MeshBudget::default(),
    )
    .unwrap();
    let size = DVec2::new(f64::from(surface.texture.width()), f64::from(surface.texture.height()));
    let pixels: Vec<DVec2> = world(&surface).iter().map(|p| camera.project(*p).unwrap()).collect();
    let shift = |i: usize| {
        let uv = DVec2::from(surface.mesh.uvs[i].map(f64::from));
        uv * size - pixels[i]
    };
    // All vertices agree on where the cut-out lies in the frame, but for the lift to the ground.
    for i in 1..pixels.len() {
        assert!((shift(i) - shift(0)).length() < 0.5, "{} against {}", shift(i), shift(0));
    }
}

#[test]
fn a_jump_in_depth_is_cut() {
    let camera = camera();
    let anchor_m = DVec3::new(10.0, 0.0, 8.0);
    let towards = (camera.position - anchor_m).with_y(0.0).normalize();
    let (near, far) = (anchor_m + towards * 0.4, anchor_m + DVec3::X * 0.15);
    let (depth, image) = photograph(&camera, anchor_m, |ray| {
        cylinder(ray, near, 0.12, 1.2).or_else(|| cylinder(ray, far, 0.25, 1.8))
    });
    let surface = lift(
        &image,
        &camera,
        Figure::standing(PersonId(0), 0),
        &person_at(anchor_m),
        &depth,
        &MeshBudget { triangles: 100_000 },
    )
    .unwrap();
    let points = world(&surface);
    for triangle in &surface.mesh.triangles {
        let depths = triangle.map(|index| camera.depth(points[index as usize]));
        let step =
            depths.iter().fold(f64::MIN, |a, b| a.max(*b)) - depths.iter().fold(f64::MAX, |a, b| a.min(*b));
        assert!(step < 0.15, "a triangle spans {step} m of depth");
    }
    // Both parts are there.
    assert!(points.iter().any(|p| (*p - near).with_y(0.0).length() < 0.13));
    assert!(points.iter().any(|p| (*p - far).with_y(0.0).length() < 0.26 && p.y > 1.5));
}

#[test]
fn broken_depth_maps_are_refused() {
    let camera = camera();
    let anchor_m = DVec3::new(10.0, 0.0, 8.0);
    let image = RgbImage::new(1920, 1080);
    let mask = Mask { x0: 5, y0: 5, width: 10, height: 10, coverage: vec![255; 100] };
    let attempt = |depth: &DepthMap| {
        lift(
            &image,
            &camera,
            Figure::standing(PersonId(0), 0),
            &person_at(anchor_m),
            depth,
            &MeshBudget::default(),
        )
    };
    let short = DepthMap { mask: mask.clone(), offset_m: vec![0.0; 99] };
    assert!(matches!(attempt(&short), Err(MeshError::Sizes { .. })));
    let nan = DepthMap { mask: mask.clone(), offset_m: vec![f32::NAN; 100] };
    assert!(matches!(attempt(&nan), Err(MeshError::TooSmall { triangles: 0 })));
    let empty = DepthMap { mask: Mask { coverage: vec![0; 100], ..mask }, offset_m: vec![0.0; 100] };
    assert!(matches!(attempt(&empty), Err(MeshError::TooSmall { triangles: 0 })));
    let above = person_at(camera.position.with_y(0.0));
    let depth = DepthMap { mask: Mask::default(), offset_m: Vec::new() };
    let lifted =
        lift(&image, &camera, Figure::standing(PersonId(0), 0), &above, &depth, &MeshBudget::default());
    assert!(matches!(lifted, Err(MeshError::NoPlane)));
}
