//! The estimator against the trainer's arithmetic (`training/fixture.py` wrote the vector), and against hostile input.

use glam::{DVec2, DVec3};
use serde::Deserialize;

use super::*;
use crate::{geometry::PixelBox, inference};

/// A rendered player and what the trainer's code makes of it: places in the arrays, and the numbers there.
#[derive(Deserialize)]
struct Vector {
    pixels_per_metre: f64,
    descent: f64,
    joints: Vec<[f64; 3]>,
    window: [f64; 3],
    picture: Vec<(usize, f32)>,
    pose: Vec<(usize, f32)>,
    offset_m: Vec<(usize, f64)>,
    presence: Vec<(usize, f64)>,
}

/// Read when the test runs: the vector changes with the shipped network.
fn testdata(name: &str) -> Vec<u8> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/depth/testdata").join(name);
    std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

impl Vector {
    fn read() -> Self {
        serde_json::from_slice(&testdata("vector.json")).unwrap()
    }

    fn view(&self) -> View {
        View { pixels_per_metre: self.pixels_per_metre, descent: self.descent }
    }

    fn joints(&self) -> Vec<Joint> {
        let joint =
            |&[x, y, z]: &[f64; 3]| Joint { pixel: DVec2::new(x, y), depth_m: z as f32, visibility: 1.0 };
        self.joints.iter().map(joint).collect()
    }
}

fn player() -> (RgbImage, Mask) {
    let image = image::load_from_memory(&testdata("player.png")).unwrap().to_rgb8();
    let mask = image::load_from_memory(&testdata("mask.png")).unwrap().to_luma8();
    let (width, height) = mask.dimensions();
    (image, Mask { x0: 0, y0: 0, width, height, coverage: mask.into_raw() })
}

fn worst(values: &[f32], expected: &[(usize, f32)]) -> f32 {
    assert!(expected.len() >= 20);
    expected.iter().map(|&(i, v)| (values[i] - v).abs()).fold(0.0, f32::max)
}

#[test]
fn window_picture_and_painted_pose_are_the_trainers() {
    let vector = Vector::read();
    let (image, mask) = player();
    let window = Window::around(&mask, vector.pixels_per_metre).unwrap();
    let [x, y, side] = vector.window;
    assert!((window.centre_px - DVec2::new(x, y)).length() < 1e-9 && (window.side_px - side).abs() < 1e-9);
    assert!(worst(&window.picture(&image, &mask), &vector.picture) < 1e-5);
    let pose = paint::paint(&vector.joints(), &window, vector.view()).unwrap();
    assert!(worst(&pose, &vector.pose) < 1e-5);
}

fn estimator() -> Option<DepthEstimator> {
    inference::ready().then(|| DepthEstimator::load().unwrap())
}

#[test]
fn the_network_says_here_what_it_says_to_the_trainer() {
    let Some(mut estimator) = estimator() else { return };
    let vector = Vector::read();
    let (image, mask) = player();
    let surface = estimator.surface(&image, vector.view(), &vector.joints(), &mask).unwrap();
    let at = |cell: usize| {
        DVec2::new(surface.window().cell(0, cell % GRID, GRID), surface.window().cell(1, cell / GRID, GRID))
    };
    for &(cell, expected) in &vector.presence {
        assert!((surface.presence_at(at(cell)) - expected).abs() < 1e-3, "presence of cell {cell}");
    }
    for &(cell, expected) in &vector.offset_m {
        assert!((surface.offset_at(at(cell)) - expected).abs() < 1e-3, "distance in cell {cell}");
    }
}

#[test]
fn a_depth_map_covers_the_mask_and_stays_near_the_plane() {
    let Some(mut estimator) = estimator() else { return };
    let (image, mask) = player();
    let camera =
        Camera::looking_at((64, 64), 60.0 * 29.0, DVec3::new(0.0, 15.0, 60.0), DVec3::new(0.0, 1.0, 0.0));
    let person = Person {
        bounds: PixelBox { min: DVec2::ZERO, max: DVec2::splat(63.0) },
        score: 1.0,
        pose_score: 1.0,
        joints: Vector::read().joints(),
        mask: mask.clone(),
        neck_px: DVec2::splat(20.0),
        neck_m: DVec3::Y,
        ..Person::blank()
    };
    let map = estimator.estimate(&image, &camera, &person, &mask).unwrap();
    assert_eq!((map.mask.width, map.mask.height), (mask.width, mask.height));
    assert_eq!(map.offset_m.len(), map.mask.coverage.len());
    let (kept, given) = (map.mask.area_px(), mask.area_px());
    assert!(kept * 10 > given * 7 && kept <= given, "{kept} of {given} pixels kept");
    assert!(map.offset_m.iter().all(|d| d.abs() <= 0.48), "distances are of the network's range");
    let (near, far) = map.offset_m.iter().fold((0.0f32, 0.0f32), |(a, b), &d| (a.min(d), b.max(d)));
    assert!(far - near > 0.1, "a body is not flat: {near}..{far}");
}

#[test]
fn hostile_input_is_a_typed_error() {
    let Some(mut estimator) = estimator() else { return };
    let vector = Vector::read();
    let (image, mask) = player();
    let joints = vector.joints();
    let view = vector.view();
    let empty = Mask { coverage: vec![0; mask.coverage.len()], ..mask.clone() };
    assert!(matches!(estimator.surface(&image, view, &joints, &empty), Err(DepthError::EmptyMask)));
    let huge = Mask { width: u32::MAX, height: u32::MAX, ..mask.clone() };
    assert!(matches!(estimator.surface(&image, view, &joints, &huge), Err(DepthError::BrokenMask { .. })));
    let mut broken = joints.clone();
    broken[27].pixel.x = f64::NAN;
    assert!(matches!(
        estimator.surface(&image, view, &broken, &mask),
        Err(DepthError::BrokenPose { found: 32 })
    ));
    assert!(matches!(
        estimator.surface(&image, view, &joints[..4], &mask),
        Err(DepthError::BrokenPose { found: 4 })
    ));
    let nothing = RgbImage::new(0, 0);
    assert!(matches!(estimator.surface(&nothing, view, &joints, &mask), Err(DepthError::OutOfView)));
    let camera = Camera::looking_at((64, 64), 900.0, DVec3::new(0.0, 15.0, 60.0), DVec3::ZERO);
    assert_eq!(View::from_camera(&camera, DVec3::new(0.0, 0.0, 200.0)), None, "behind the camera");
    assert_eq!(View::from_camera(&camera, DVec3::splat(f64::NAN)), None);
}
