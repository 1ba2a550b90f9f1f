//! The whole way: a rendered broadcast clip with its truth in a folder.

use std::path::PathBuf;

use image::RgbImage;
use protocol::pitch::Pitch;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use crate::{
    SynthesisError,
    chain::Rate,
    correspondences::clicked,
    fixture::{Fixture, FixtureOptions},
    operator::Platform,
    output::{make_folder, put},
    render::{Exposure, Scene, Window},
    shots::{self, Shots, Take},
    shutter::Shutter,
    trajectories::Trajectories,
    truth::{self, Reduced, TruthOptions, TruthWriter},
    venue::Setting,
    video::Video,
};

/// Frames per second of every rendered clip.
pub const FRAME_RATE: u32 = 25;

/// What to render.
#[derive(Clone, Debug)]
pub struct Options {
    /// Folder for the clip and the files of its truth; made when missing.
    pub out: PathBuf,
    /// Everything random follows from it.
    pub seed: u64,
    /// Length in frames.
    pub frames: u32,
    /// Width and height of the picture, even numbers.
    pub size_px: (u32, u32),
    /// Recorded paths; generated ones when absent.
    pub trajectories: Option<PathBuf>,
    /// Where in the recording the clip starts.
    pub start_seconds: f64,
    /// Triangles of each true surface, about.
    pub truth_triangles: u32,
    /// Whether every frame's maps are written too: people, lines, first and last surfaces.
    pub maps: bool,
    /// Quality of the H.264 file: x264's CRF, 0 (best) to 51; without, a broadcaster's bitrate drawn from the seed.
    pub crf: Option<u8>,
    /// How freely the place, the camera and its chain are chosen.
    pub setting: Setting,
    /// Which cameras are on air when.
    pub shots: Shots,
    /// Where the main camera stands, instead of a place drawn from the seed.
    pub platform: Option<Platform>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            out: PathBuf::from("synthesized"),
            seed: 1,
            frames: 125,
            size_px: (1280, 720),
            trajectories: None,
            start_seconds: 0.0,
            truth_triangles: 1500,
            maps: false,
            crf: None,
            setting: Setting::default(),
            shots: Shots::default(),
            platform: None,
        }
    }
}

/// What was written.
#[derive(Clone, Debug)]
pub struct Synthesized {
    /// The video.
    pub clip: PathBuf,
    /// Whether the paths were made up because no recording was given.
    pub generated_paths: bool,
    /// Frames.
    pub frames: usize,
    /// People in view per frame, on average.
    pub people_in_view_mean: f64,
    /// Bytes of the video.
    pub clip_bytes: u64,
    /// Bytes of the truth, all files.
    pub truth_bytes: u64,
}

/// Renders a frame of a match: the picture that the broadcast shows.
pub fn render_frame(fixture: &Fixture, frame: usize, seed: u64) -> Result<RgbImage, SynthesisError> {
    render_scene(fixture, &fixture.scene(frame), frame, seed)
}

/// As [`render_frame`], with everybody already in place.
fn render_scene(
    fixture: &Fixture,
    scene: &Scene<'_>,
    frame: usize,
    seed: u64,
) -> Result<RgbImage, SynthesisError> {
    let shown = &fixture.film[frame];
    let beside = shots::beside(frame, fixture.frames());
    let open = fixture.chain.shutter * (beside as f32 - frame as f32);
    let other = if open == 0.0 { None } else { Some(fixture.scene(beside)) };
    let take = |take: &Take, number: u64| {
        // Somebody may have put another camera in this one's place; that one stands still.
        let camera = if number == 0 { fixture.cameras[frame] } else { take.camera };
        let next = if camera == take.camera { take.next } else { camera };
        let shutter = other.as_ref().map(|other| Shutter { other, camera: &next, open });
        let exposure = Exposure { side: fixture.chain.side, shutter, focus: take.focus };
        let size = [camera.width_px as usize, camera.height_px as usize];
        let light = scene.expose(&camera, Window { first: [0, 0], size }, &exposure);
        let salt = (frame as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ number;
        fixture.chain.sensor.expose(&light, &mut Pcg64Mcg::seed_from_u64(seed ^ salt))
    };
    let mut picture = take(&shown.main, 0)?;
    if let Some(other) = &shown.other {
        let (behind, share) = (take(other, 1)?, (other.share * 256.0) as u32);
        for (a, b) in picture.iter_mut().zip(behind.iter()) {
            *a = ((u32::from(*a) * (256 - share) + u32::from(*b) * share + 128) >> 8) as u8;
        }
    }
    fixture.score.draw(&mut picture, frame as f64 / f64::from(FRAME_RATE));
    Ok(picture)
}

/// Renders a clip with its truth. `progress` is called with the number of finished frames.
///
/// The `ffmpeg` program encodes the video; it is needed here only, not to reconstruct or to play.
pub fn synthesize(options: &Options, progress: impl Fn(usize) + Sync) -> Result<Synthesized, SynthesisError> {
    let (width, height) = options.size_px;
    if !(64..=7680).contains(&width) || !(64..=4320).contains(&height) || width % 2 + height % 2 > 0 {
        let message =
            format!("the picture size {width}x{height} must be even and between 64x64 and 7680x4320");
        return Err(SynthesisError::Options(message));
    }
    let count = options.frames as usize;
    let paths = match &options.trajectories {
        Some(path) => Trajectories::open(path)?,
        None => {
            let seconds = f64::from(options.frames) / f64::from(FRAME_RATE) + options.start_seconds.max(0.0);
            Trajectories::generated(options.seed, seconds + 1.0)
        }
    };
    let fixture = Fixture::new(
        &paths,
        &FixtureOptions {
            seed: options.seed,
            frames: count,
            rate_hz: f64::from(FRAME_RATE),
            size_px: options.size_px,
            start_seconds: options.start_seconds,
            setting: options.setting,
            pitch: options.trajectories.as_ref().map(|_| Pitch::default()),
            shots: options.shots.clone(),
            platform: options.platform,
        },
    )?;
    make_folder(&options.out)?;
    let rows = fixture.members.len();
    let reduced: Vec<Reduced> = fixture
        .members
        .iter()
        .enumerate()
        .map(|(row, member)| Reduced::new(&member.figure, options.truth_triangles as usize, row, rows))
        .collect();
    let palette = truth::palette(&fixture.members)?;

    let clip = options.out.join("clip.mp4");
    let rate = options.crf.map_or(fixture.chain.rate, Rate::Quality);
    let mut video = Video::start(&clip, options.size_px, (FRAME_RATE, 1), rate)?;
    let mut writer = TruthWriter::create(
        &options.out,
        TruthOptions {
            frame_rate: FRAME_RATE,
            size_px: options.size_px,
            triangles: options.truth_triangles,
            maps: options.maps,
        },
    )?;
    let (mut done, mut in_view) = (0, 0);
    // Several frames for each thread, so that none waits long for the slowest.
    let together = 4 * rayon::current_num_threads().max(1);
    for first in (0..count).step_by(together) {
        let batch: Vec<_> = (first..(first + together).min(count))
            .into_par_iter()
            .map(|frame| {
                let scene = fixture.scene(frame);
                let picture = render_scene(&fixture, &scene, frame, options.seed)?;
                let (truth, maps) = truth::measure(&fixture, &scene, frame, options.maps);
                let bodies = truth::stream_frame(&fixture, &scene, &truth, &reduced, &palette);
                Ok((picture, truth, maps, bodies))
            })
            .collect::<Result<_, SynthesisError>>()?;
        for (picture, truth, maps, bodies) in batch {
            video.push(&picture)?;
            in_view += truth.people.iter().filter(|person| person.in_view).count();
            writer.push(&truth, maps.as_ref(), bodies)?;
            done += 1;
            progress(done);
        }
    }
    video.finish()?;

    let truth_bytes = writer.finish(&fixture)?;
    let mut rng = Pcg64Mcg::seed_from_u64(options.seed ^ 0xC11C);
    let points = clicked(&fixture.cameras[0], &fixture.stadium.pitch, 0, 10, &mut rng);
    let text = serde_json::to_string_pretty(&points)
        .map_err(|error| SynthesisError::Options(format!("correspondences.json: {error}")))?;
    put(&options.out.join("correspondences.json"), (text + "\n").as_bytes())?;
    let clip_bytes = std::fs::metadata(&clip)
        .map_err(|source| SynthesisError::Io { path: clip.clone(), doing: "read", source })?
        .len();
    Ok(Synthesized {
        clip_bytes,
        clip,
        generated_paths: options.trajectories.is_none(),
        frames: count,
        people_in_view_mean: in_view as f64 / count as f64,
        truth_bytes,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::{chunk, limits::Limits, manifest::Manifest};
    use std::process::{Command, Stdio};

    fn small(seed: u64) -> Fixture {
        let options = FixtureOptions {
            seed,
            frames: 3,
            rate_hz: 25.0,
            size_px: (320, 180),
            start_seconds: 0.5,
            ..FixtureOptions::default()
        };
        Fixture::new(&Trajectories::generated(seed, 2.0), &options).unwrap()
    }

    #[test]
    fn the_same_seed_gives_the_same_picture_and_another_seed_does_not() {
        let picture = |seed| render_frame(&small(seed), 1, seed).unwrap();
        let first = picture(5);
        assert_eq!(first, picture(5));
        assert_ne!(first, picture(6));
    }

    #[test]
    fn shots_cut_and_dissolve_the_same_way_every_time_and_the_truth_says_so() {
        let film = || {
            let options = FixtureOptions {
                seed: 8,
                frames: 9,
                size_px: (256, 144),
                shots: "main:3,close-up:3~2,high-behind".parse().unwrap(),
                ..FixtureOptions::default()
            };
            Fixture::new(&Trajectories::generated(8, 2.0), &options).unwrap()
        };
        let (fixture, again) = (film(), film());
        let picture = |frame: usize| render_frame(&fixture, frame, 8).unwrap();
        for frame in [2, 3, 8] {
            assert_eq!(picture(frame), render_frame(&again, frame, 8).unwrap(), "frame {frame}");
        }
        let shots: Vec<_> = fixture.film.iter().map(|frame| frame.truth()).collect();
        let numbers: Vec<usize> = shots.iter().map(|shot| shot.shot).collect();
        assert_eq!(numbers, [0, 0, 0, 0, 1, 1, 2, 2, 2]);
        assert!(
            shots[3].main_camera && shots[3].mixed_with.is_some_and(|(shot, share)| shot == 1 && share < 0.5)
        );
        assert!(!shots[5].main_camera && shots[5].mixed_with.is_none());
        // Half-way through the dissolve the picture is a mixture of what it was and what it becomes.
        let mean =
            |frame: usize| picture(frame).iter().map(|b| f64::from(*b)).sum::<f64>() / (256.0 * 144.0 * 3.0);
        let (before, between, after) = (mean(2), mean(4), mean(5));
        assert!(before.min(after) - 3.0 < between && between < before.max(after) + 3.0);
        // The camera in the truth is the one whose picture dominates.
        assert!(fixture.cameras[5].focal_px > 1.5 * fixture.cameras[2].focal_px, "a close-up is close");
        assert!(fixture.cameras[8].position.x.abs() > 50.0, "high behind a goal");
    }

    #[test]
    fn a_clip_is_written_with_a_truth_stream_that_reads_back() {
        if Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).status().is_err() {
            let required = std::env::var_os("HOLOPITCH_REQUIRE_TOOLS").is_some_and(|value| value == "1");
            assert!(!required, "the program ffmpeg is not installed: run `cargo xtask setup`");
            println!("skipped: the program ffmpeg is not installed");
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let options = Options {
            out: folder.path().join("clip"),
            seed: 3,
            frames: 2,
            size_px: (320, 180),
            truth_triangles: 300,
            ..Options::default()
        };
        let done = synthesize(&options, |_| ()).unwrap();
        assert!(done.generated_paths && done.people_in_view_mean >= 3.0);
        assert!(std::fs::metadata(&done.clip).unwrap().len() > 1000);
        let read = |name: &str| std::fs::read(options.out.join(name)).unwrap();
        let manifest = Manifest::from_json(&read("truth/match.json"), &Limits::default()).unwrap();
        let entry = &manifest.best().unwrap().chunks[0].file;
        let bytes = read(&format!("truth/{}", entry.path));
        protocol::hash::verify(&bytes, entry).unwrap();
        let chunk = chunk::decode(&bytes, &Limits::default()).unwrap();
        let lines = String::from_utf8(read("frames.jsonl")).unwrap();
        let truth: Vec<serde_json::Value> =
            lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert_eq!((chunk.frames.len(), truth.len()), (2, 2));
        for (frame, content) in chunk.frames.iter().enumerate() {
            let people = truth[frame]["people"].as_array().unwrap();
            assert_eq!(content.bodies.len(), people.iter().filter(|p| p["in_view"] == true).count());
            for body in &content.bodies {
                let lowest = body.mesh.positions_m.iter().map(|p| p[1]).fold(f32::MAX, f32::min);
                let highest = body.mesh.positions_m.iter().map(|p| p[1]).fold(f32::MIN, f32::max);
                assert!(
                    lowest > -0.05 && lowest < 0.2 && highest > 1.2 && highest < 2.6,
                    "{lowest} to {highest} m"
                );
            }
        }
        let points: serde_json::Value = serde_json::from_slice(&read("correspondences.json")).unwrap();
        assert!(points["points"].as_array().unwrap().len() >= 4);
    }

    #[test]
    fn an_odd_picture_size_is_refused() {
        let options = Options { size_px: (321, 180), ..Options::default() };
        assert!(matches!(synthesize(&options, |_| ()), Err(SynthesisError::Options(_))));
    }
}
