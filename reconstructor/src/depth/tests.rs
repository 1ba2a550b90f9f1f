//! The estimator against the trainer's arithmetic (`training/depth/fixture.py` wrote the vector), and against hostile input.

use std::collections::BTreeMap;

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
    /// Metres right of and below the middle of the window, and behind the hips, of the joints that are lifted.
    lifted: BTreeMap<usize, [f64; 3]>,
    /// Values of the six planes.
    planes: [Vec<(usize, f64)>; surface::PLANES],
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
    for (plane, expected) in vector.planes.iter().enumerate() {
        assert!(expected.len() >= 20);
        for &(cell, expected) in expected {
            let off = (surface.value(plane, cell) - expected).abs();
            assert!(off < 1e-3, "plane {plane}, cell {cell}: {off} off");
        }
    }
}

#[test]
fn joints_are_lifted_here_as_for_the_trainer() {
    if !inference::ready() {
        return;
    }
    let vector = Vector::read();
    let (image, mask) = player();
    let lifted = PoseLifter::load().unwrap().lift(&image, vector.view(), &vector.joints(), &mask).unwrap();
    let [x, y, _] = vector.window;
    assert!(vector.lifted.len() >= 15);
    for (joint, [right_m, down_m, behind_m]) in &vector.lifted {
        let expected = DVec2::new(x, y) + DVec2::new(*right_m, *down_m) * vector.pixels_per_metre;
        let off_m = (lifted[*joint].pixel - expected).length() / vector.pixels_per_metre;
        assert!(off_m < 1e-3, "joint {joint} is {off_m} m off");
        assert!((f64::from(lifted[*joint].depth_m) - behind_m).abs() < 1e-3, "joint {joint}");
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
    assert!(map.is_whole());
    let (kept, given) = (map.mask(), mask.clone());
    let (mut both, mut either) = (0, 0);
    for (x, y) in (0..64).flat_map(|y| (0..64).map(move |x| (x, y))) {
        let (kept, given) = (kept.at(x, y) >= 128, given.at(x, y) >= 128);
        both += usize::from(kept && given);
        either += usize::from(kept || given);
    }
    assert!(both * 10 > either * 7, "{both} of {either} pixels agree with the segmentation");
    let inside = |plane: &[i16]| -> Vec<i16> {
        plane.iter().zip(&map.coverage).filter(|(_, c)| **c >= 128).map(|(mm, _)| *mm).collect()
    };
    let (front, back) = (inside(&map.front_mm), inside(&map.back_mm));
    let (near, far) = front.iter().fold((0, 0), |(a, b), &d| (a.min(d), b.max(d)));
    assert!(far - near > 100, "a body is not flat: {near}..{far} mm");
    let mut thickness: Vec<i16> = front.iter().zip(&back).map(|(front, back)| back - front).collect();
    thickness.sort_unstable();
    let middle = thickness[thickness.len() / 2];
    assert!((40..400).contains(&middle), "half of the body is thicker than {middle} mm");
    assert!(thickness[0] >= 0);
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
