//! Whole broadcast pictures of many made-up matches, with the truth of each: for networks that find cameras, people and
//! the ball, and for holding ours against real broadcasts.
//!
//! A set is split by the seeds of its matches: seed modulo 8 is 7 for test, 6 for validation, 0 to 5 for training. People,
//! kits, ground, light and camera are drawn anew for every match; what they are drawn from, motions included, is the same for
//! all parts.

use std::{
    cmp::Ordering,
    path::PathBuf,
    sync::atomic::{self, AtomicUsize},
};

use image::{ImageEncoder, RgbImage, codecs::jpeg::JpegEncoder};
use protocol::pitch::Pitch;
use rand::Rng;
use rayon::prelude::*;
use serde::Serialize;

use super::{Split, cast::rng};
use crate::{
    SynthesisError,
    clip::{FRAME_RATE, render_frame},
    fixture::{Fixture, FixtureOptions},
    output::{make_folder, put},
    shots::{Shot, ShotKind, Shots},
    trajectories::{Role, Trajectories},
    truth::{self, FrameTruth, PersonTruth},
};

/// Pictures taken of one match when nothing else is said: making a match costs as much as five pictures of it.
pub const PER_MATCH: usize = 4;
/// Frames of which the one nearest to a goal is taken.
const TOWARDS_GOAL: usize = 5;
/// Length of a match, seconds.
const MATCH_S: f64 = 30.0;
/// Quality of the JPEG files: above what a broadcast leaves.
const QUALITY: u8 = 93;
/// A person is labelled when at least this share of it is seen, and this share of its box is inside the picture.
const SEEN_MIN: f64 = 0.25;
const INSIDE_MIN: f64 = 0.3;
/// The ball is labelled when at least this share of it is seen.
const BALL_SEEN_MIN: f64 = 0.3;

/// What to write.
#[derive(Clone, Debug)]
pub struct FrameOptions {
    /// Folder for the set; made when missing.
    pub out: PathBuf,
    /// Pictures in all.
    pub count: usize,
    /// Everything random follows from it.
    pub seed: u64,
    /// Pictures taken of one match.
    pub per_match: usize,
    /// Which matches.
    pub split: Split,
    /// Picture size.
    pub size_px: (u32, u32),
    /// Whether the maps (people, lines, first and last surfaces) are written too.
    pub maps: bool,
    /// The cameras of one match after the other, over and over; [`usual_kinds`] are six main cameras, one high behind a goal and
    /// one close-up.
    pub kinds: Vec<ShotKind>,
}

/// The cameras of a set for which nothing else is said.
#[must_use]
pub fn usual_kinds() -> Vec<ShotKind> {
    [vec![ShotKind::Main; 6], vec![ShotKind::HighBehind, ShotKind::CloseUp]].concat()
}

/// One line of `frames.jsonl`.
#[derive(Serialize)]
struct Line {
    /// Name of the picture without its ending.
    name: String,
    /// Seed of its match.
    match_seed: u64,
    /// Size of the pitch.
    pitch: Pitch,
    /// Everybody in the match.
    everybody: Vec<PersonTruth>,
    #[serde(flatten)]
    truth: FrameTruth,
}

/// The seed of the `index`th match of a part: its remainder by 8 tells the part.
fn match_seed(options: &FrameOptions, index: usize) -> u64 {
    let mut rng = rng(options.seed, &[0xF4A, index as u64]);
    let remainder = match options.split {
        Split::Train => rng.random_range(0..6),
        Split::Validation => 6,
        Split::Test => 7,
    };
    (rng.random::<u64>() >> 12) * 8 + remainder
}

/// Writes `images/`, `labels/` (YOLO: ball, goalkeeper, player, referee), `frames.jsonl` and, if wanted, `maps/`.
/// `progress` is called with the number of finished pictures.
pub fn broadcast_frames(
    options: &FrameOptions,
    progress: impl Fn(usize) + Sync,
) -> Result<(), SynthesisError> {
    if options.count == 0 || options.per_match == 0 || options.kinds.is_empty() {
        return Err(SynthesisError::Options(
            "a set needs at least one picture, in all and of a match, and one kind of camera".into(),
        ));
    }
    for folder in ["images", "labels", "maps"].iter().filter(|name| **name != "maps" || options.maps) {
        make_folder(&options.out.join(folder))?;
    }
    let matches = options.count.div_ceil(options.per_match);
    let finished = AtomicUsize::new(0);
    let lines: Vec<Vec<u8>> = (0..matches)
        .into_par_iter()
        .map(|index| {
            let first = index * options.per_match;
            let pictures = options.per_match.min(options.count - first);
            let lines = one_match(options, index, first..first + pictures)?;
            progress(finished.fetch_add(pictures, atomic::Ordering::Relaxed) + pictures);
            Ok(lines)
        })
        .collect::<Result<_, SynthesisError>>()?;
    put(&options.out.join("frames.jsonl"), &lines.concat())
}

fn one_match(
    options: &FrameOptions,
    index: usize,
    pictures: std::ops::Range<usize>,
) -> Result<Vec<u8>, SynthesisError> {
    let seed = match_seed(options, index);
    let frames = (MATCH_S * f64::from(FRAME_RATE)) as usize;
    let kind = options.kinds[index % options.kinds.len()];
    let mut fixture = Fixture::new(
        &Trajectories::generated(seed, MATCH_S + 1.0),
        &FixtureOptions {
            seed,
            frames,
            rate_hz: f64::from(FRAME_RATE),
            size_px: options.size_px,
            shots: Shots(vec![Shot { kind, frames: 0, dissolve: 0 }]),
            ..FixtureOptions::default()
        },
    )?;
    // Single pictures go through no video encoder: blocks and lost colour stand for it.
    fixture.chain.sensor.jpeg = Some(rng(seed, &[0xF4C]).random_range(30..85));
    let everybody = truth::people_truth(&fixture.members);
    let mut rng = rng(seed, &[0xF4B]);
    let mut lines = Vec::new();
    for picture in pictures {
        let frame = drawn_frame(&fixture, &mut rng);
        let drawn = render_frame(&fixture, frame, seed)?;
        let (truth, maps) = truth::measure(&fixture, &fixture.scene(frame), frame, options.maps);
        let name = format!("{picture:06}");
        put(&options.out.join("images").join(format!("{name}.jpg")), &jpeg(&drawn)?)?;
        let labels = labels(&truth, &everybody);
        put(&options.out.join("labels").join(format!("{name}.txt")), labels.as_bytes())?;
        if let Some(maps) = maps {
            for (kind, file) in maps.files()? {
                put(&options.out.join("maps").join(format!("{name}-{kind}.png")), &file)?;
            }
        }
        let line = Line {
            name,
            match_seed: seed,
            pitch: fixture.stadium.pitch,
            everybody: everybody.clone(),
            truth,
        };
        serde_json::to_writer(&mut lines, &line)
            .map_err(|error| SynthesisError::Options(error.to_string()))?;
        lines.push(b'\n');
    }
    Ok(lines)
}

/// Any frame of a match; every second time the one of several that looks nearest to a goal: play is there more seldom than
/// broadcasts show it.
fn drawn_frame(fixture: &Fixture, rng: &mut impl Rng) -> usize {
    let frames = fixture.cameras.len();
    let tries = if rng.random_bool(0.5) { TOWARDS_GOAL } else { 1 };
    let aim = |frame: &usize| {
        let camera = fixture.cameras.get(*frame)?;
        Some(camera.ground_point(camera.centre_px())?.x.abs())
    };
    let drawn: Vec<usize> = (0..tries).map(|_| rng.random_range(0..frames)).collect();
    let nearest = drawn.iter().copied().max_by(|a, b| aim(a).partial_cmp(&aim(b)).unwrap_or(Ordering::Equal));
    nearest.unwrap_or(0) // at least one is drawn
}

fn jpeg(picture: &RgbImage) -> Result<Vec<u8>, SynthesisError> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .write_image(picture, picture.width(), picture.height(), image::ExtendedColorType::Rgb8)
        .map_err(SynthesisError::Picture)?;
    Ok(bytes)
}

/// YOLO labels: class, middle and size of each box inside the picture, as shares of the picture.
fn labels(truth: &FrameTruth, everybody: &[PersonTruth]) -> String {
    let (width, height) = (f64::from(truth.camera.width_px), f64::from(truth.camera.height_px));
    let line = |class: u32, [left, top, right, bottom]: [f64; 4]| {
        // The outer edge of the first pixel is −½.
        let x = [left, right].map(|x| (x + 0.5).clamp(0.0, width) / width);
        let y = [top, bottom].map(|y| (y + 0.5).clamp(0.0, height) / height);
        format!(
            "{class} {:.6} {:.6} {:.6} {:.6}\n",
            (x[0] + x[1]) / 2.0,
            (y[0] + y[1]) / 2.0,
            x[1] - x[0],
            y[1] - y[0]
        )
    };
    let people = truth
        .people
        .iter()
        .filter(|person| person.visible_share >= SEEN_MIN && person.box_inside >= INSIDE_MIN)
        .map(|person| {
            let class = match everybody.get(person.id as usize).map(|p| p.role) {
                Some(Role::Goalkeeper) => 1,
                Some(Role::Referee | Role::Assistant) => 3,
                Some(Role::Player) | None => 2,
            };
            line(class, person.box_px)
        });
    let ball = truth.ball.px.filter(|_| truth.ball.visible_share >= BALL_SEEN_MIN).map(|[x, y]| {
        let r = truth.ball.radius_px;
        line(0, [x - r, y - r, x + r, y + r])
    });
    people.chain(ball).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_set_is_the_same_twice_and_its_labels_lie_on_people() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, split| {
            let options = FrameOptions {
                out: folder.path().join(name),
                count: 2,
                per_match: PER_MATCH,
                seed: 3,
                split,
                size_px: (320, 180),
                maps: true,
                kinds: usual_kinds(),
            };
            broadcast_frames(&options, |_| ()).unwrap();
            let read = |file: &str| std::fs::read(options.out.join(file)).unwrap();
            (
                read("images/000001.jpg"),
                read("frames.jsonl"),
                read("labels/000001.txt"),
                read("maps/000001-people.png"),
            )
        };
        let first = write("a", Split::Train);
        assert_eq!(write("b", Split::Train), first);
        let text = String::from_utf8(first.1).unwrap();
        assert_eq!(text.lines().count(), 2);
        let seed_of = |text: &str| -> u64 {
            let line: serde_json::Value = serde_json::from_str(text.lines().next().unwrap()).unwrap();
            line["match_seed"].as_u64().unwrap()
        };
        assert!(seed_of(&text) % 8 < 6);
        assert_eq!(seed_of(&String::from_utf8(write("c", Split::Test).1).unwrap()) % 8, 7);
        let people = image::load_from_memory(&first.3).unwrap().into_luma8();
        let labels = String::from_utf8(first.2).unwrap();
        let mut boxes = 0;
        for line in labels.lines().filter(|line| !line.starts_with('0')) {
            let v: Vec<f64> = line.split(' ').skip(1).map(|word| word.parse().unwrap()).collect();
            let [x, y, w, h] = v[..] else { panic!("{line}") };
            let at =
                |share: f64, side: u32| (share * f64::from(side)).clamp(0.0, f64::from(side) - 1.0) as u32;
            let somebody = (at(x - w / 2.0, 320)..=at(x + w / 2.0, 320)).any(|px| {
                (at(y - h / 2.0, 180)..=at(y + h / 2.0, 180)).any(|py| people.get_pixel(px, py)[0] > 0)
            });
            assert!(somebody, "nobody in {line}");
            boxes += 1;
        }
        assert!(boxes >= 3, "{boxes} boxes");
    }
}
