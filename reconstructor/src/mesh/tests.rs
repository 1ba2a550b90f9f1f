//! Surfaces whose shape is known exactly, seen by a main camera, must come back as they are.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};
use protocol::{
    camera::{Camera, Ray},
    manifest::PersonId,
};

use super::*;
use crate::pose::{JOINTS, Joint, Person};

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

/// What the camera sees of a body given by the first and last hit of a ray: a depth map, and a red body on grass.
fn photograph(
    camera: &Camera,
    anchor_m: DVec3,
    hits: impl Fn(&Ray) -> Option<[DVec3; 2]>,
) -> (DepthMap, RgbImage) {
    let plane = VirtualPlane::new(camera, anchor_m).unwrap();
    let middle = camera.project(anchor_m + DVec3::Y * 0.9).unwrap().round().as_ivec2();
    let (width, height) = (160_u32, 260_u32);
    let (x0, y0) = (middle.x - width as i32 / 2, middle.y - height as i32 / 2);
    let mut image = RgbImage::from_pixel(camera.width_px, camera.height_px, GRASS);
    let mut map = DepthMap {
        first_px: DVec2::new(f64::from(x0), f64::from(y0)),
        cell_px: 1.0,
        width,
        height,
        ..DepthMap::default()
    };
    for y in y0..y0 + height as i32 {
        for x in x0..x0 + width as i32 {
            let pixel = DVec2::new(f64::from(x), f64::from(y));
            let inside = (0..16).filter(|i| {
                let sub = DVec2::new(f64::from(i % 4), f64::from(i / 4)) / 4.0 - 0.375;
                hits(&camera.ray(pixel + sub)).is_some()
            });
            map.coverage.push((inside.count() * 255 / 16) as u8);
            let offsets_m = hits(&camera.ray(pixel)).map(|points| {
                let on_plane = plane.point(pixel, 0.0).unwrap();
                image.put_pixel(x as u32, y as u32, RED);
                points.map(|point| camera.depth(point) - camera.depth(on_plane))
            });
            let [front, back] = offsets_m.unwrap_or_default().map(|metres| (metres * 1000.0).round() as i16);
            map.front_mm.push(front);
            map.back_mm.push(back);
        }
    }
    (map, image)
}

/// First and last hit of an upright cylinder with flat ends standing at `foot`.
fn cylinder(ray: &Ray, foot: DVec3, radius_m: f64, height_m: f64) -> Option<[DVec3; 2]> {
    let (o, d) = (ray.origin - foot, ray.direction);
    let (a, b) = (d.x * d.x + d.z * d.z, o.x * d.x + o.z * d.z);
    let root = (b * b - a * (o.x * o.x + o.z * o.z - radius_m * radius_m)).sqrt();
    let between = [0.0, height_m].map(|height| (height - o.y) / d.y);
    let enters = ((-b - root) / a).max(between[0].min(between[1]));
    let leaves = ((-b + root) / a).min(between[0].max(between[1]));
    // Beside the cylinder the root is no number.
    (root >= 0.0 && enters < leaves).then(|| [enters, leaves].map(|along| ray.origin + d * along))
}

fn world(surface: &BodySurface) -> Vec<DVec3> {
    let points = surface.mesh.positions_m.iter();
    points.map(|p| DVec3::from(p.map(f64::from)) + surface.anchor_m).collect()
}

fn lifted(
    camera: &Camera,
    anchor_m: DVec3,
    depth: &DepthMap,
    image: &RgbImage,
    triangles: usize,
) -> BodySurface {
    let budget = MeshBudget { triangles };
    lift(image, camera, Figure::standing(PersonId(3), 7), &person_at(anchor_m), depth, None, &budget).unwrap()
}

/// Vertices at the same place are one: charts share none.
fn welded(surface: &BodySurface) -> Vec<[usize; 3]> {
    let mut known = HashMap::new();
    let mut name = |index: u32| {
        let place = surface.mesh.positions_m[index as usize].map(f32::to_bits);
        let next = known.len();
        *known.entry(place).or_insert(next)
    };
    surface.mesh.triangles.iter().map(|triangle| triangle.map(&mut name)).collect()
}

fn is_closed(surface: &BodySurface) -> bool {
    let mut edges: HashMap<(usize, usize), i32> = HashMap::new();
    for [a, b, c] in welded(surface) {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((from, to)).or_default() += 1;
            *edges.entry((to, from)).or_default() -= 1;
        }
    }
    edges.values().all(|&count| count == 0)
}

#[test]
fn a_cylinder_comes_back_all_round_within_a_centimetre_and_closed() {
    let camera = camera();
    let anchor_m = DVec3::new(10.0, 0.0, 8.0);
    let (depth, image) = photograph(&camera, anchor_m, |ray| cylinder(ray, anchor_m, 0.16, 1.8));
    for triangles in [100_000, 1_200] {
        let surface = lifted(&camera, anchor_m, &depth, &image, triangles);
        assert!(is_closed(&surface), "{triangles} triangles");
        assert!(surface.mesh.triangles.len() <= triangles);
    }
    let surface = lifted(&camera, anchor_m, &depth, &image, 100_000);
    let points = world(&surface);
    assert!(points.len() > 2_000, "{} points", points.len());
    let mut errors: Vec<f64> = points
        .iter()
        .filter(|p| (0.1..1.7).contains(&p.y))
        .map(|p| ((*p - anchor_m).with_y(0.0).length() - 0.16).abs())
        .collect();
    errors.sort_by(f64::total_cmp);
    assert!(errors[errors.len() * 95 / 100] < 0.01, "95 % within {}", errors[errors.len() * 95 / 100]);
    assert!(errors[errors.len() - 1] < 0.08, "worst {}", errors[errors.len() - 1]);
    let (low, high) = points.iter().fold((9.0_f64, -9.0_f64), |(l, h), p| (l.min(p.y), h.max(p.y)));
    assert!(low.abs() < 0.03, "stands at {low}");
    assert!((high - 1.8).abs() < 0.03, "top at {high}");
    let behind = (camera.position - anchor_m).with_y(0.0).normalize() * -0.155;
    assert!(points.iter().any(|p| (*p - anchor_m - behind).with_y(0.0).length() < 0.05), "it has a back");
}

#[test]
fn a_sphere_keeps_its_shape_under_a_budget() {
    let camera = camera();
    let (anchor_m, radius_m) = (DVec3::new(-4.0, 0.0, -10.0), 0.15);
    let centre = anchor_m + DVec3::Y * radius_m;
    let sphere = |ray: &Ray| {
        let o = ray.origin - centre;
        let b = o.dot(ray.direction);
        let root = b * b - (o.length_squared() - radius_m * radius_m);
        (root >= 0.0).then(|| [-1.0, 1.0].map(|side| ray.origin + ray.direction * (-b + side * root.sqrt())))
    };
    let (depth, image) = photograph(&camera, anchor_m, sphere);
    for triangles in [600, 200] {
        let surface = lifted(&camera, anchor_m, &depth, &image, triangles);
        assert!(surface.mesh.triangles.len() <= triangles);
        assert!(surface.mesh.triangles.len() * 10 >= triangles * 9, "the budget is used");
        let mut errors: Vec<f64> =
            world(&surface).iter().map(|p| (p.distance(centre) - radius_m).abs()).collect();
        errors.sort_by(f64::total_cmp);
        assert!(errors[errors.len() * 8 / 10] < 0.01, "80 % within {}", errors[errors.len() * 8 / 10]);
    }
}

#[test]
fn triangles_face_outwards_and_the_texture_shows_no_grass() {
    let camera = camera();
    let anchor_m = DVec3::new(10.0, 0.0, 8.0);
    let (depth, image) = photograph(&camera, anchor_m, |ray| cylinder(ray, anchor_m, 0.16, 1.8));
    let surface = lifted(&camera, anchor_m, &depth, &image, 100_000);
    let points = world(&surface);
    let middle = anchor_m + DVec3::Y * 0.9;
    let corners = |triangle: &[u32; 3]| triangle.map(|index| points[index as usize]);
    let volume: f64 = surface
        .mesh
        .triangles
        .iter()
        .map(|triangle| corners(triangle).map(|p| p - middle))
        .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
        .sum();
    let expected = std::f64::consts::PI * 0.16_f64.powi(2) * 1.8;
    assert!((volume / expected - 1.0).abs() < 0.1, "{volume} of {expected} m³");
    // What the camera saw is in the left half of the texture, and faces it.
    let (mut facing, mut shown, mut wrong) = (0, 0, 0);
    for triangle in &surface.mesh.triangles {
        let [a, b, c] = corners(triangle);
        let normal = (b - a).cross(c - a);
        let facing_by = normal.normalize_or_zero().dot((camera.position - a).normalize());
        // Corners of one pixel column lie in one plane with the camera: such triangles have no side.
        if facing_by.abs() < 1e-4 {
            continue;
        }
        let faces = facing_by > 0.0;
        let seen = triangle.iter().all(|&index| surface.mesh.uvs[index as usize][0] <= 0.5);
        wrong += usize::from(seen && !faces);
        facing += usize::from(faces);
        shown += usize::from(seen);
    }
    assert_eq!(wrong, 0, "of {shown} seen triangles");
    assert!(shown * 100 > facing * 97, "{shown} of {facing} triangles that face the camera are seen");
    for pixel in surface.texture.pixels() {
        assert_eq!(*pixel, RED);
    }
    for uv in &surface.mesh.uvs {
        assert!(uv.iter().all(|t| (0.0..=1.0).contains(t)));
    }
}

#[test]
fn a_budget_that_no_body_fits_in_is_refused() {
    let camera = camera();
    let anchor_m = DVec3::new(10.0, 0.0, 8.0);
    let (depth, image) = photograph(&camera, anchor_m, |ray| cylinder(ray, anchor_m, 0.16, 1.8));
    assert!(!lifted(&camera, anchor_m, &depth, &image, 600).clustered);
    let (figure, budget) = (Figure::standing(PersonId(0), 0), MeshBudget { triangles: 0 });
    let refused = lift(&image, &camera, figure, &person_at(anchor_m), &depth, None, &budget);
    assert!(matches!(refused, Err(MeshError::TooSmall { triangles: 0 })));
}

#[test]
fn texture_coordinates_point_at_the_pixel_a_vertex_was_seen_in() {
    let camera = camera();
    let anchor_m = DVec3::new(10.0, 0.0, 8.0);
    let (depth, image) = photograph(&camera, anchor_m, |ray| cylinder(ray, anchor_m, 0.16, 1.8));
    let surface = lift(
        &image,
        &camera,
        Figure::standing(PersonId(0), 0),
        &person_at(anchor_m),
        &depth,
        None,
        &MeshBudget::default(),
    )
    .unwrap();
    let size = DVec2::new(f64::from(surface.texture.width() / 2), f64::from(surface.texture.height()));
    let pixels: Vec<DVec2> = world(&surface).iter().map(|p| camera.project(*p).unwrap()).collect();
    let shift = |i: usize| {
        let [u, v] = surface.mesh.uvs[i].map(f64::from);
        // Both halves show the same pixels.
        DVec2::new((2.0 * u) % 1.0, v) * size - pixels[i]
    };
    // All vertices agree on where the cut-out lies in the frame, but for the lift to the ground.
    for i in 1..pixels.len() {
        assert!((shift(i) - shift(0)).length() < 0.5, "{} against {}", shift(i), shift(0));
    }
}

#[test]
fn what_is_far_before_the_body_stands_free_without_a_skeleton() {
    let camera = camera();
    let anchor_m = DVec3::new(10.0, 0.0, 8.0);
    let towards = (camera.position - anchor_m).with_y(0.0).normalize();
    let (near, far) = (anchor_m + towards * 0.75, anchor_m + DVec3::X * 0.1);
    let (depth, image) = photograph(&camera, anchor_m, |ray| {
        let (near, far) = (cylinder(ray, near, 0.08, 1.2), cylinder(ray, far, 0.15, 1.8));
        match (near, far) {
            (Some([front, _]), Some([_, back])) => Some([front, back]),
            (near, far) => near.or(far),
        }
    });
    let surface = lifted(&camera, anchor_m, &depth, &image, 100_000);
    assert!(is_closed(&surface));
    let points = world(&surface);
    // Nothing between the two where they are in line.
    let between = anchor_m + towards * 0.35;
    let line = |p: &&DVec3| (0.2..0.9).contains(&p.y) && (**p - between).with_y(0.0).length() < 0.06;
    assert_eq!(points.iter().filter(line).count(), 0);
    assert!(points.iter().any(|p| (*p - near).with_y(0.0).length() < 0.1));
    assert!(points.iter().any(|p| (*p - far).with_y(0.0).length() < 0.17 && p.y > 1.5));
}

#[test]
fn broken_depth_maps_are_refused() {
    let camera = camera();
    let anchor_m = DVec3::new(10.0, 0.0, 8.0);
    let image = RgbImage::new(1920, 1080);
    let attempt = |anchor_m: DVec3, depth: &DepthMap| {
        let (figure, budget) = (Figure::standing(PersonId(0), 0), MeshBudget::default());
        lift(&image, &camera, figure, &person_at(anchor_m), depth, None, &budget)
    };
    let map = DepthMap {
        first_px: DVec2::splat(5.0),
        cell_px: 1.0,
        width: 10,
        height: 10,
        coverage: vec![255; 100],
        front_mm: vec![0; 100],
        back_mm: vec![100; 100],
    };
    let short = DepthMap { back_mm: vec![0; 99], ..map.clone() };
    assert!(matches!(attempt(anchor_m, &short), Err(MeshError::Sizes { .. })));
    let nan = DepthMap { first_px: DVec2::NAN, ..map.clone() };
    assert!(matches!(attempt(anchor_m, &nan), Err(MeshError::Sizes { .. })));
    let far = DepthMap { front_mm: vec![9_000; 100], back_mm: vec![9_100; 100], ..map.clone() };
    assert!(matches!(attempt(anchor_m, &far), Err(MeshError::TooSmall { triangles: 0 })));
    let empty = DepthMap { coverage: vec![0; 100], ..map.clone() };
    assert!(matches!(attempt(anchor_m, &empty), Err(MeshError::TooSmall { triangles: 0 })));
    assert!(matches!(attempt(camera.position.with_y(0.0), &map), Err(MeshError::NoPlane)));
}
