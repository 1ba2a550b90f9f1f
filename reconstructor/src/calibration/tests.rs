//! The whole stage on drawn pictures with known cameras, and on the real clip where it is at hand.

use std::path::Path;

use glam::{DVec2, DVec3};
use image::Rgb;
use protocol::pitch::{Marking, Pitch};

use rayon::prelude::*;

use super::{lines::LinePixels, *};
use crate::{geometry::PixelBox, report::median};

pub(super) const SIZE: (u32, u32) = (960, 540);

/// Draws grass, stand and lines as `camera` sees them, two by two rays per pixel, with coding-like noise.
pub(super) fn drawn(camera: &Camera, pitch: &Pitch, seed: u32) -> RgbImage {
    let markings = pitch.markings();
    let mut noise = seed.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    RgbImage::from_fn(camera.width_px, camera.height_px, |x, y| {
        let mut sum = DVec3::ZERO;
        for k in 0..4 {
            let offset = DVec2::new(f64::from(k % 2) - 0.5, f64::from(k / 2) - 0.5) / 2.0;
            sum += colour_at(camera, pitch, &markings, DVec2::new(f64::from(x), f64::from(y)) + offset);
        }
        noise = noise.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let grain = f64::from(noise >> 24) / 255.0 * 8.0 - 4.0;
        let [r, g, b] = (sum / 4.0 + grain).to_array().map(|v| v.clamp(0.0, 255.0) as u8);
        Rgb([r, g, b])
    })
}

fn colour_at(camera: &Camera, pitch: &Pitch, markings: &[Marking], pixel: DVec2) -> DVec3 {
    let stand = DVec3::new(110.0, 100.0, 120.0);
    let Some(ground) = camera.ground_point(pixel) else { return stand };
    let place = DVec2::new(ground.x, ground.z);
    if !pitch.contains(place, 4.0) {
        return stand;
    }
    let painted = markings.iter().any(|marking| marking.covers(place));
    let mown = if (place.x / 5.0).rem_euclid(2.0) < 1.0 { 1.0 } else { 0.85 };
    if painted { DVec3::new(205.0, 220.0, 200.0) } else { DVec3::new(80.0, 130.0, 25.0) * mown }
}

/// A camera on a tripod that pans from the centre circle to the right and zooms in.
pub(super) fn broadcast(frame: usize) -> Camera {
    let t = frame as f64 / 30.0;
    let aim = DVec3::new(-2.0 + 22.0 * t, 0.0, -6.0 + 2.0 * t);
    let mut camera = Camera::looking_at(SIZE, 1250.0 + 250.0 * t, DVec3::new(1.5, 17.0, 70.0), aim);
    camera.k1 = 0.08;
    camera
}

/// Points of the centre circle and the halfway line as found by hand: up to a pixel off.
pub(super) fn by_hand(camera: &Camera, frame: u32) -> Calibration {
    let places = [(0.0, -34.0), (0.0, -9.15), (0.0, 9.15), (-9.15, 0.0), (9.15, 0.0)];
    let points = places
        .iter()
        .enumerate()
        .map(|(i, &(x, z))| Correspondence {
            name: format!("{x} {z}"),
            pixel: camera.project(DVec3::new(x, 0.0, z)).unwrap() + DVec2::from_angle(i as f64) * 0.8,
            world_m: DVec3::new(x, 0.0, z),
        })
        .collect();
    Calibration { frame, pitch: Pitch::default(), points }
}

/// Distances in pixels between where two cameras see the part of the pitch that the first shows.
pub(super) fn reprojection(truth: &Camera, found: &Camera) -> Vec<f64> {
    let mut errors = Vec::new();
    for x in -10..=10 {
        for z in -6..=6 {
            let world = DVec3::new(f64::from(x) * 5.0, 0.0, f64::from(z) * 5.5);
            if let Some(pixel) = truth.project(world).filter(|&pixel| truth.contains(pixel)) {
                errors.push(found.project(world).unwrap().distance(pixel));
            }
        }
    }
    errors
}

#[test]
fn a_panning_camera_is_followed_to_a_pixel_in_both_directions() {
    let pitch = Pitch::default();
    let cameras: Vec<Camera> = (0..31).step_by(3).map(broadcast).collect();
    let pictures: Vec<RgbImage> =
        cameras.par_iter().enumerate().map(|(i, camera)| drawn(camera, &pitch, i as u32)).collect();
    // The known frame is inside the shot: it is followed back as well.
    let estimates = calibrate_pictures(pictures, &by_hand(&cameras[3], 3)).unwrap();
    let mut errors = Vec::new();
    for (i, (truth, estimate)) in cameras.iter().zip(&estimates).enumerate() {
        let found = estimate.camera.unwrap_or_else(|| panic!("frame {i}: {:?}", estimate.reason));
        assert!(estimate.line_residual_median_px.unwrap() < 1.0, "frame {i}: {estimate:?}");
        assert_eq!(estimate.source, CameraSource::Lines);
        assert!((found.position - truth.position).length() < 1.0, "frame {i}: at {}", found.position);
        errors.extend(reprojection(truth, &found));
    }
    errors.sort_by(f64::total_cmp);
    let (middle, high) = (errors[errors.len() / 2], errors[errors.len() * 95 / 100]);
    assert!(middle < 0.5 && high < 2.0, "median {middle:.2} px, 95 % below {high:.2} px");
}

#[test]
fn frames_without_lines_are_bridged_and_said_to_be() {
    let pitch = Pitch::default();
    let cameras: Vec<Camera> = (0..7).map(broadcast).collect();
    let mut pictures: Vec<RgbImage> = cameras.iter().map(|camera| drawn(camera, &pitch, 7)).collect();
    pictures[3] = RgbImage::from_pixel(SIZE.0, SIZE.1, Rgb([80, 130, 25]));
    let estimates = calibrate_pictures(pictures, &by_hand(&cameras[0], 0)).unwrap();
    assert_eq!(estimates[3].source, CameraSource::Predicted);
    assert!(estimates[3].reason.is_some());
    let error = median(&reprojection(&cameras[3], &estimates[3].camera.unwrap())).unwrap();
    assert!(error < 2.0, "{error}");
    assert!([0, 1, 2, 4, 5, 6].iter().all(|&i| estimates[i].source == CameraSource::Lines));
}

#[test]
fn a_shot_that_ends_gives_reasons_instead_of_cameras() {
    let pitch = Pitch::default();
    let cameras: Vec<Camera> = (0..5).map(broadcast).collect();
    let mut pictures: Vec<RgbImage> = cameras.iter().map(|camera| drawn(camera, &pitch, 7)).collect();
    for picture in &mut pictures[3..] {
        *picture = RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| Rgb([(x % 251) as u8, (y % 241) as u8, 120]));
    }
    let estimates = calibrate_pictures(pictures, &by_hand(&cameras[0], 0)).unwrap();
    assert!(estimates[..3].iter().all(|e| e.camera.is_some()));
    assert!(estimates[3..].iter().all(|e| e.camera.is_none() && e.reason.is_some()), "{:?}", &estimates[3..]);
}

#[test]
fn people_hide_lines_and_do_not_count() {
    let camera = broadcast(0);
    let image = drawn(&camera, &Pitch::default(), 3);
    let all = LinePixels::find(&image, &[]);
    let left = PixelBox { min: DVec2::ZERO, max: DVec2::new(470.0, 539.0) };
    let right = LinePixels::find(&image, &[left]);
    assert!(right.pixels.len() > 100 && right.pixels.len() < all.pixels.len());
    assert!(right.pixels.iter().all(|pixel| pixel.middle.x > 469.0));
}

#[test]
fn pictures_without_a_pitch_or_with_another_one_are_refused() {
    let given = by_hand(&broadcast(0), 0);
    let crowd = RgbImage::from_pixel(SIZE.0, SIZE.1, Rgb([110, 100, 120]));
    let error = calibrate_pictures(vec![crowd], &given).unwrap_err();
    assert!(matches!(error, CalibrationError::NoPitch { .. }), "{error}");
    let lawn = RgbImage::from_pixel(SIZE.0, SIZE.1, Rgb([80, 130, 25]));
    assert!(calibrate_pictures(vec![lawn], &given).is_err());
    let elsewhere = drawn(&broadcast(30), &Pitch::default(), 1);
    let error = calibrate_pictures(vec![elsewhere], &given).unwrap_err();
    assert!(matches!(error, CalibrationError::LinesDisagree { .. }), "{error}");
    assert!(matches!(calibrate_pictures(vec![], &given), Err(CalibrationError::NoFrames)));
    let picture = drawn(&broadcast(0), &Pitch::default(), 1);
    let outside = Calibration { frame: 4, ..given };
    assert!(matches!(
        calibrate_pictures(vec![picture], &outside),
        Err(CalibrationError::FrameOutside { .. })
    ));
}

#[test]
fn the_real_clip_keeps_its_lines() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let path = root.join("../shared/data/clips/rma-sev-720p/soccer.mp4");
    if !path.exists() {
        eprintln!("skipped: {} is not here", path.display());
        return;
    }
    let given = Calibration::read(&root.join("tests/data/rma-sev-correspondences.json")).unwrap();
    let clip = Clip::open(&path, Some(150..180)).unwrap();
    let estimates = calibrate(&clip, &[], &given, &Progress::hidden()).unwrap();
    assert_eq!(estimates.len(), 30);
    for (i, estimate) in estimates.iter().enumerate() {
        let residual = estimate.line_residual_median_px.unwrap();
        assert!(estimate.camera.is_some() && residual <= 1.5, "frame {}: {residual:.2} px", 150 + i);
    }
    let early = Clip::open(&path, Some(10..12)).unwrap();
    let error = calibrate(&early, &[], &given, &Progress::hidden()).unwrap_err();
    assert!(matches!(error, CalibrationError::FrameOutside { frame: 150, start: 10, end: 12 }), "{error}");
}
