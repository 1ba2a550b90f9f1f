//! Shots without a click, on drawn pictures: cameras of single frames come from the truth with errors put on.

use glam::{DMat3, DVec3};
use image::Rgb;
use rayon::prelude::*;

use super::{
    tests::{SIZE, broadcast, by_hand, drawn, reprojection},
    *,
};
use crate::{
    geometry::PixelBox,
    inference::InferenceError,
    report::median,
    shots::{Shot, Transition, TransitionKind},
};

/// Finds the camera of a drawn picture by the number in its first pixel, as wrong as `found` makes it.
struct ByNumber<F>(F);

impl<F: Fn(usize) -> Result<Located, String> + Send> FindCamera for ByNumber<F> {
    fn find(
        &mut self,
        picture: &RgbImage,
        _: &[PixelBox],
        _: &Pitch,
    ) -> Result<Result<Located, String>, InferenceError> {
        Ok((self.0)(usize::from(picture.get_pixel(0, 0).0[0])))
    }
}

/// Pictures of cameras, each with its number; without a camera a picture of something else.
fn pictures(cameras: &[Option<Camera>]) -> Vec<RgbImage> {
    cameras
        .par_iter()
        .enumerate()
        .map(|(number, camera)| {
            let mut picture = match camera {
                Some(camera) => drawn(camera, &Pitch::default(), number as u32),
                None => {
                    RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| Rgb([(x % 251) as u8, (y % 241) as u8, 120]))
                }
            };
            picture.put_pixel(0, 0, Rgb([number as u8, 0, 0]));
            picture
        })
        .collect()
}

/// A camera a few pixels and metres off, differently for each frame.
fn roughly(camera: &Camera, number: usize) -> Located {
    let by = |k: f64| (number as f64 * 12.9898 + k * 78.233).sin();
    let turn = DMat3::from_rotation_y(0.004 * by(1.0)) * DMat3::from_rotation_x(0.003 * by(2.0));
    let position = camera.position + 1.5 * DVec3::new(by(3.0), by(4.0), by(5.0));
    let focal_px = camera.focal_px * (1.0 + 0.02 * by(6.0));
    let camera = Camera { rotation: turn * camera.rotation, position, focal_px, k1: 0.0, ..*camera };
    Located { camera, confidence: 0.8 }
}

fn solved(
    cameras: &[Option<Camera>],
    shots: &ShotList,
    find: impl Fn(usize) -> Result<Located, String> + Send + Sync + Clone + 'static,
) -> ClipCameras {
    let load = || -> Result<Box<dyn FindCamera>, InferenceError> { Ok(Box::new(ByNumber(find.clone()))) };
    let finders = Finders::new(&load);
    let known = Known { pitch: Pitch::default(), given: None, finders: Some(&finders), apart: false };
    images(&pictures(cameras), shots, &known).unwrap()
}

#[test]
fn a_shot_needs_no_click() {
    let truth: Vec<Option<Camera>> = (0..31).map(|frame| Some(broadcast(frame))).collect();
    let known = truth.clone();
    let found =
        solved(&truth, &ShotList::single(31), move |number| Ok(roughly(&known[number].unwrap(), number)));
    let mut errors = Vec::new();
    for (frame, (truth, estimate)) in truth.iter().zip(&found.frames).enumerate() {
        let (truth, camera) =
            (truth.unwrap(), estimate.camera.unwrap_or_else(|| panic!("{frame}: {estimate:?}")));
        let away = camera.position.distance(truth.position);
        assert!(away < 0.5, "frame {frame}: {away:.2} m from its place");
        assert!((camera.focal_px / truth.focal_px - 1.0).abs() < 0.01, "frame {frame}: {}", camera.focal_px);
        assert!(estimate.confidence.unwrap() > 0.9);
        errors.extend(reprojection(&truth, &camera));
    }
    let middle = median(&errors).unwrap();
    assert!(middle < 0.5, "{middle}");
    let figures = &found.shots[0];
    assert_eq!((figures.solved, figures.agreeing, figures.located), (31, 3, 3));
    assert!(!figures.moving && figures.centre_std_m.unwrap() < 1e-6);
    assert!(figures.halves_apart_m.unwrap() < 2.0, "{figures:?}");
}

#[test]
fn a_wrong_camera_is_outvoted() {
    let truth: Vec<Option<Camera>> = (0..20).map(|frame| Some(broadcast(frame))).collect();
    let known = truth.clone();
    // The surest one of three is of another place altogether.
    let found = solved(&truth, &ShotList::single(20), move |number| {
        let mut located = roughly(&known[number].unwrap(), number);
        if number < 7 {
            located.camera = broadcast(30);
            located.confidence = 0.95;
        }
        Ok(located)
    });
    for (truth, estimate) in truth.iter().zip(&found.frames) {
        let error = median(&reprojection(&truth.unwrap(), &estimate.camera.unwrap())).unwrap();
        assert!(error < 1.0, "{error}");
    }
    assert_eq!(found.shots[0].agreeing, 2);
}

#[test]
fn every_shot_stands_alone_and_close_ups_have_reasons() {
    let mut cameras: Vec<Option<Camera>> = (0..16).map(|frame| Some(broadcast(frame))).collect();
    cameras.extend([None; 20]);
    // The second camera stands elsewhere.
    let other = |frame: usize| {
        let mut camera = broadcast(frame);
        camera.position += DVec3::new(12.0, 3.0, 5.0);
        camera
    };
    cameras.extend((0..16).map(|frame| Some(other(frame))));
    let shots = ShotList {
        shots: vec![Shot { frames: 0..16 }, Shot { frames: 18..36 }, Shot { frames: 36..52 }],
        transitions: vec![Transition { frames: 16..18, kind: TransitionKind::Dissolve }],
    };
    let known = cameras.clone();
    let found = solved(&cameras, &shots, move |number| match known[number] {
        Some(camera) => Ok(roughly(&camera, number)),
        None => Err("no lines in view".to_owned()),
    });
    let reasons = |frame: usize| found.frames[frame].reason.clone().unwrap_or_default();
    assert_eq!((reasons(16), found.frames[16].camera), ("dissolve".to_owned(), None));
    assert!(found.frames[18..36].iter().all(|estimate| estimate.camera.is_none()));
    assert!(reasons(20).contains("no lines in view"), "{}", reasons(20));
    for (frames, shot) in [(0..16, 0), (36..52, 2)] {
        let place = found.shots[shot].position_m.unwrap();
        assert!(place.distance(cameras[frames.start].unwrap().position) < 0.7, "shot {shot}: {place}");
        assert!(found.frames[frames].iter().all(|estimate| estimate.camera.is_some()));
    }
    assert_eq!(found.shots.iter().map(|shot| shot.solved).collect::<Vec<_>>(), [16, 0, 16]);
}

#[test]
fn the_stronger_picture_of_a_dissolve_is_followed() {
    let first: Vec<Option<Camera>> = (0..22).map(|frame| Some(broadcast(frame))).collect();
    let second: Vec<Option<Camera>> = (0..36).map(|frame| Some(broadcast(60 - frame))).collect();
    let shots = ShotList {
        shots: vec![Shot { frames: 0..16 }, Shot { frames: 22..36 }],
        transitions: vec![Transition { frames: 16..22, kind: TransitionKind::Dissolve }],
    };
    let mut all = pictures(&second);
    for (number, (a, b)) in pictures(&first).iter().zip(&mut all).enumerate() {
        let share = ((number as f64 - 15.0) / 7.0).clamp(0.0, 1.0);
        for (from, to) in a.iter().zip(b.iter_mut()) {
            *to = (f64::from(*from) * (1.0 - share) + f64::from(*to) * share).round() as u8;
        }
        b.put_pixel(0, 0, Rgb([number as u8, 0, 0]));
    }
    let shown = |number: usize| if number < 19 { first[number] } else { second[number] };
    let truth: Vec<Camera> = (0..36).filter_map(shown).collect();
    let known = truth.clone();
    let find = move |number: usize| Ok(roughly(&known[number], number));
    let load = || -> Result<Box<dyn FindCamera>, InferenceError> { Ok(Box::new(ByNumber(find.clone()))) };
    let finders = Finders::new(&load);
    let known = Known { pitch: Pitch::default(), given: None, finders: Some(&finders), apart: false };
    let found = images(&all, &shots, &known).unwrap();
    let mut followed = 0;
    for (index, (estimate, truth)) in found.frames.iter().zip(&truth).enumerate().take(22).skip(16) {
        assert!(estimate.reason.as_ref().unwrap().contains("dissolve"), "{estimate:?}");
        let Some(camera) = estimate.camera else { continue };
        followed += 1;
        let error = median(&reprojection(truth, &camera)).unwrap();
        assert!(error < 1.5, "frame {index}: {error} px");
    }
    assert!(followed >= 4, "{followed} of 6");
    assert_eq!(found.shots.iter().map(|shot| shot.solved).collect::<Vec<_>>(), [16, 14]);
}

#[test]
fn a_camera_on_rails_is_flagged_and_followed() {
    let truth: Vec<Option<Camera>> = (0..40)
        .map(|frame| {
            let t = frame as f64 / 40.0;
            // Two metres per second at 25 frames per second.
            let position = DVec3::new(-1.6 + 3.2 * t, 12.0, 55.0);
            Some(Camera::looking_at(SIZE, 900.0, position, DVec3::new(-4.0 + 8.0 * t, 0.0, -4.0)))
        })
        .collect();
    let known = truth.clone();
    let found =
        solved(&truth, &ShotList::single(40), move |number| Ok(roughly(&known[number].unwrap(), number)));
    assert!(found.shots[0].moving, "{:?}", found.shots[0]);
    for (truth, estimate) in truth.iter().zip(&found.frames) {
        assert!(estimate.reason.as_ref().unwrap().contains("tripod"));
        let error = median(&reprojection(&truth.unwrap(), &estimate.camera.unwrap())).unwrap();
        assert!(error < 1.5, "{error}");
    }
}

#[test]
fn given_cameras_win_for_their_shot_and_are_told_apart_by_content() {
    let cameras: Vec<Camera> = (0..10).map(broadcast).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("given.json");
    let theirs = serde_json::to_value(soccernet::SoccerNetCamera::from(&cameras[4])).unwrap();
    let mut numbered = theirs.clone();
    numbered["frame"] = 4.into();
    let report = serde_json::json!({"pitch": {"length_m": 105.0, "width_m": 68.0},
        "frames": [{"clip_frame": 3, "soccernet": null}, {"clip_frame": 4, "soccernet": theirs, "reason": null}]});
    let pictures = pictures(&cameras.iter().copied().map(Some).collect::<Vec<_>>());
    for content in [numbered.clone(), serde_json::json!([numbered]), report] {
        std::fs::write(&path, content.to_string()).unwrap();
        let given = Given::read(&path).unwrap();
        assert!(matches!(&given, Given::Cameras { cameras, .. } if cameras.len() == 1 && cameras[0].0 == 4));
        // Nobody is asked: a finder that fails would stop everything.
        let load = || -> Result<Box<dyn FindCamera>, InferenceError> {
            Err(InferenceError::ModelNotFound { name: "none".into(), looked_at: Vec::new() })
        };
        let finders = Finders::new(&load);
        let known =
            Known { pitch: Pitch::default(), given: Some(&given), finders: Some(&finders), apart: false };
        let found = calibrate_images(&pictures, &known).unwrap();
        assert!(found.frames.iter().all(|e| e.camera.is_some() && e.confidence == Some(1.0)));
        let none = Known { given: None, ..known };
        assert!(matches!(calibrate_images(&pictures, &none), Err(CalibrationError::Inference(_))));
    }
    std::fs::write(&path, serde_json::to_vec(&by_hand(&cameras[2], 2)).unwrap()).unwrap();
    assert!(matches!(Given::read(&path), Ok(Given::Points(points)) if points.frame == 2));
    std::fs::write(&path, "{\"frames\": 3}").unwrap();
    assert!(matches!(Given::read(&path), Err(CalibrationError::Parse { .. })));
}
