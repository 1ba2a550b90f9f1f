//! Drawn scenes with known breaks, rendered clips, and the real clip where it is at hand.

use std::path::Path;

use image::imageops;
use synthesis::{
    clip::render_frame,
    fixture::{Fixture, FixtureOptions},
    trajectories::Trajectories,
};

use super::{
    thumbnail::{HEIGHT, Thumbnail, WIDTH},
    *,
};
use crate::ingest::THUMBNAIL_SIZE;

/// RGB of a made-up scene: smooth random hills of brightness and colour, the same for the same number and place.
fn colour(number: u32, x: f32, y: f32) -> [f32; 3] {
    let seed = number as f32 * 17.31;
    [1.0, 2.0, 3.0].map(|channel: f32| {
        let wave = |k: f32| {
            let (a, b) = ((seed * k + channel).sin(), (seed * k * 1.7 - channel).cos());
            ((x * a + y * b) * 0.25 / k.sqrt() + seed * k).sin()
        };
        let sum: f32 = [1.0, 2.0, 3.0, 4.0].map(wave).iter().sum();
        (120.0 + 30.0 * sum).clamp(0.0, 255.0)
    })
}

/// Scene `number` with each pixel's colour taken from where `source` says.
fn rgb(number: u32, source: impl Fn(f32, f32) -> [f32; 2]) -> Vec<u8> {
    let places = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x as f32, y as f32)));
    places
        .flat_map(|(x, y)| {
            let [u, v] = source(x, y);
            colour(number, u, v).map(|c| c as u8)
        })
        .collect()
}

pub(super) fn scene(number: u32, source: impl Fn(f32, f32) -> [f32; 2]) -> Thumbnail {
    Thumbnail::from_rgb(&rgb(number, source))
}

fn mixed(a: &[u8], b: &[u8], share: f32) -> Vec<u8> {
    a.iter().zip(b).map(|(a, b)| (f32::from(*a) * (1.0 - share) + f32::from(*b) * share) as u8).collect()
}

/// Coding noise of a few levels.
fn with_noise(mut picture: Vec<u8>, frame: usize) -> Vec<u8> {
    let mut state = (frame as u32).wrapping_mul(747_796_405) ^ 12_345;
    for value in &mut picture {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        *value = value.saturating_add((state >> 29) as u8);
    }
    picture
}

fn shots_of(frames: impl IntoIterator<Item = Vec<u8>>) -> ShotList {
    let mut detector = ShotDetector::new();
    for (number, frame) in frames.into_iter().enumerate() {
        detector.push(&with_noise(frame, number));
    }
    detector.finish()
}

fn ranges(list: &ShotList) -> Vec<Range<usize>> {
    list.shots.iter().map(|shot| shot.frames.clone()).collect()
}

/// A panning and zooming camera on scene `number` at frame `t`.
fn panned(number: u32, t: usize, speed: f32) -> Vec<u8> {
    let (t, zoom) = (t as f32, 1.0 + 0.004 * t as f32);
    rgb(number, |x, y| [x / zoom + speed * t, y / zoom + 0.2 * speed * t])
}

#[test]
fn a_camera_that_pans_fast_and_zooms_makes_no_shots() {
    for speed in [0.3, 1.7, 6.0] {
        assert_eq!(
            shots_of((0..60).map(|t| panned(1, t, speed))),
            ShotList::single(60),
            "{speed} px per frame"
        );
    }
}

#[test]
fn cuts_are_found_to_the_frame() {
    let frames = (0..90).map(|t| panned([1, 2, 1][t / 30], t, if t < 30 { 2.0 } else { 0.4 }));
    let list = shots_of(frames);
    assert_eq!(ranges(&list), [0..30, 30..60, 60..90]);
    assert!(list.transitions.is_empty());
    assert_eq!((list.shot_of(29), list.shot_of(30), list.shot_of(90)), (Some(0), Some(1), None));
    assert_eq!(list.frames(), 90);
}

#[test]
fn a_cut_between_views_that_look_alike_stands_out_from_quiet_steps_only() {
    let alike = |t: usize| mixed(&panned(1, t, 0.0), &panned(2, t, 0.0), 0.27);
    let (before, after) = (Thumbnail::from_rgb(&panned(1, 30, 0.0)), Thumbnail::from_rgb(&alike(30)));
    let change = measure::difference(&before, &after, &motion::Motion::between(&before, &after)).unwrap();
    assert!((0.025..0.04).contains(&change), "this test is of a weak cut: {change}");
    let list = shots_of((0..60).map(|t| if t < 30 { panned(1, t, 0.0) } else { alike(t) }));
    assert_eq!(ranges(&list), [0..30, 30..60]);
    // The same step where every step is nearly as large is none.
    let restless = shots_of((0..60).map(|t| if t % 2 == 0 { panned(1, t, 0.0) } else { alike(t) }));
    assert_eq!(restless.shots.len(), 1, "{restless:?}");
}

#[test]
fn dissolves_of_any_length_are_found_and_their_frames_are_nobodys() {
    for length in [4_usize, 8, 12, 25, 40] {
        let frames = (0..120).map(|t| {
            let share = (t as f32 - 39.0) / (length + 1) as f32;
            mixed(&panned(1, t, 0.6), &panned(2, t, -0.3), share.clamp(0.0, 1.0))
        });
        let list = shots_of(frames);
        assert_eq!((list.shots.len(), list.transitions.len()), (2, 1), "{length}: {list:?}");
        let Transition { frames, kind } = &list.transitions[0];
        assert_eq!(*kind, TransitionKind::Dissolve);
        let slack = 1 + length / 8;
        assert!(
            frames.start.abs_diff(40) <= slack && frames.end.abs_diff(40 + length) <= slack,
            "{length}: {frames:?}"
        );
        assert_eq!(list.shot_of((frames.start + frames.end) / 2), None);
    }
}

#[test]
fn flashes_and_graphics_are_no_cuts() {
    let flash = (0..60).map(|t| {
        let picture = panned(1, t, 0.5);
        if t == 20 || t == 40 || t == 41 { mixed(&picture, &vec![255; picture.len()], 0.8) } else { picture }
    });
    assert_eq!(shots_of(flash), ShotList::single(60));
    // A graphic over a ninth of the picture appears at once and goes; a score board fades in.
    let graphics = (0..80).map(|t| {
        let mut picture = panned(1, t, 0.5);
        let fade = ((t as f32 - 45.0) / 10.0).clamp(0.0, 1.0);
        for (x, y) in (2..9).flat_map(|y| (2..40).map(move |x| (x, y))) {
            let at = 3 * (y * WIDTH + x);
            if (20..35).contains(&t) {
                picture[at..at + 3].copy_from_slice(&[10, 10, 60]);
            }
            if x < 22 && y < 6 {
                for value in &mut picture[at..at + 3] {
                    *value = (f32::from(*value) * (1.0 - fade) + 20.0 * fade) as u8;
                }
            }
        }
        picture
    });
    assert_eq!(shots_of(graphics), ShotList::single(80));
}

#[test]
fn a_flash_at_a_cut_does_not_hide_it() {
    let frames = (0..60).map(|t| {
        let picture = panned(if t < 30 { 1 } else { 2 }, t, 0.5);
        if t == 30 { mixed(&picture, &vec![255; picture.len()], 0.8) } else { picture }
    });
    let list = shots_of(frames);
    assert_eq!(list.shots.len(), 2, "{list:?}");
    assert!((30..=31).contains(&list.shots[0].frames.end) || list.shots[1].frames.start == 31, "{list:?}");
}

#[test]
fn nothing_and_one_frame_are_no_trouble() {
    assert_eq!(ShotDetector::new().finish(), ShotList::default());
    assert_eq!(shots_of([panned(1, 0, 0.0)]), ShotList::single(1));
    // A thumbnail that is too short is black where nothing is known.
    let mut detector = ShotDetector::new();
    detector.push(&[]);
    detector.push(&[1, 2]);
    assert_eq!(detector.finish(), ShotList::single(2));
}

/// Shots of a rendered match, from the pictures themselves.
fn of_rendered(shots: &str, seed: u64, frames: usize) -> ShotList {
    let options = FixtureOptions {
        seed,
        frames,
        size_px: (320, 180),
        shots: shots.parse().unwrap(),
        ..FixtureOptions::default()
    };
    let paths = Trajectories::generated(seed, frames as f64 / 25.0 + 1.0);
    let fixture = Fixture::new(&paths, &options).unwrap();
    let mut detector = ShotDetector::new();
    for frame in 0..frames {
        let picture = render_frame(&fixture, frame, seed).unwrap();
        let (width, height) = THUMBNAIL_SIZE;
        detector.push(imageops::thumbnail(&picture, width, height).as_raw());
    }
    detector.finish()
}

#[test]
fn a_rendered_match_falls_into_its_shots() {
    let list = of_rendered("main:30,high-behind:25,close-up:25~8,main", 5, 110);
    assert_eq!(list.shots.len(), 4, "{list:?}");
    assert_eq!(ranges(&list)[..2], [0..30, 30..55]);
    assert_eq!((list.shots[2].frames.end, list.shots[3].frames.start), (80, 80));
    let dissolve = &list.transitions[0].frames;
    assert!(dissolve.start.abs_diff(55) <= 1 && dissolve.end.abs_diff(63) <= 1, "{list:?}");
}

#[test]
fn the_dissolve_of_the_real_clip_is_found() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/clips/rma-sev-720p/soccer.mp4");
    if !path.exists() {
        eprintln!("skipped: {} is not here", path.display());
        return;
    }
    let (clip, list) = open(&path, Some(0..300)).unwrap();
    assert_eq!(list.frames(), clip.info().frames.len());
    // By eye: the new scene shines through from frame 124 on, the old one is gone in 133.
    let dissolve = &list.transitions[0];
    assert_eq!(
        (list.shots.len(), list.transitions.len(), dissolve.kind),
        (2, 1, TransitionKind::Dissolve),
        "{list:?}"
    );
    assert!(
        (122..=126).contains(&dissolve.frames.start) && (131..=135).contains(&dissolve.frames.end),
        "{list:?}"
    );
}
