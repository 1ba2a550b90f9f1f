//! `player render`: one frame of a stream as a PNG.

use std::path::PathBuf;

use anyhow::{Context, bail};
use image::{RgbaImage, imageops};
use player::{
    camera::{CameraFile, Preset, ViewCamera, turntable},
    offscreen::Offscreen,
    renderer::Guessed,
    scene::{FrameScene, Stage},
    source::Stream,
};
use protocol::{camera::Camera, chunk::ChunkFrame, pitch::Pitch};
use tokio::runtime::Runtime;

const EXAMPLES: &str = "Examples:
  player render target/demo/stream --frame 60 --camera top --size 1280x720 --out top.png
  player render http://localhost:8080/ --frame 0 --camera goal-left --size 960x540 --out goal.png
  player render target/demo/stream --frame 0 --camera my-camera.json --size 960x540 --out mine.png
  player render target/demo/stream --frame 40 --turntable 8 --person 3 --size 320x400 --out round.png

A camera file holds {\"position_m\": [0, 25, 80], \"target_m\": [10, 0, 0], \"vertical_fov_degrees\": 30}
(world metres, y up, z towards the main camera) or a pinhole camera as the stream has it.
The broadcast view is the pinhole of the clip's camera; its radial distortion is left out.";

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct RenderArguments {
    #[command(flatten)]
    stream: super::StreamArgument,
    /// Index of the frame in the stream: the first is 0, whatever its number in the clip.
    #[arg(long)]
    frame: u32,
    /// table, broadcast, top, goal-left, goal-right, or a JSON file.
    #[arg(long, value_name = "NAME|FILE", value_parser = parse_camera, required_unless_present = "turntable")]
    camera: Option<CameraArgument>,
    /// So many views round one person instead, side by side, the first from the side of the broadcast camera.
    #[arg(long, value_name = "COUNT", requires = "person", conflicts_with = "camera", value_parser = clap::value_parser!(u32).range(1..=64))]
    turntable: Option<u32>,
    /// Who is in the middle of the turntable: a number of `player inspect`'s people.
    #[arg(long, value_name = "ID", requires = "turntable")]
    person: Option<u32>,
    /// What no camera saw of people: solid, ghosted or hidden.
    #[arg(long, value_name = "HOW", default_value = "solid", value_parser = parse_guessed)]
    guessed: Guessed,
    /// Width and height of the picture in pixels.
    #[arg(long, value_name = "WxH", value_parser = super::parse_size)]
    size: (u32, u32),
    /// Where the PNG goes.
    #[arg(long, value_name = "PNG")]
    out: PathBuf,
}

#[derive(Clone)]
enum CameraArgument {
    Preset(Preset),
    File(PathBuf),
}

fn parse_camera(text: &str) -> Result<CameraArgument, String> {
    if text.ends_with(".json") || text.contains(['/', '\\']) {
        return Ok(CameraArgument::File(text.into()));
    }
    text.parse().map(CameraArgument::Preset).map_err(|error: player::camera::NoSuchPreset| error.to_string())
}

fn parse_guessed(text: &str) -> Result<Guessed, String> {
    let known = Guessed::ALL.into_iter().find(|guessed| guessed.name() == text);
    known.ok_or_else(|| format!("{text} is none of {}", Guessed::ALL.map(Guessed::name).join(", ")))
}

pub(super) fn run(arguments: &RenderArguments) -> anyhow::Result<()> {
    let (runtime, stream) = super::open(&arguments.stream.stream)?;
    let (chunk_name, frame) = find_frame(&runtime, &stream, arguments.frame)?;
    let pitch = stream.manifest.pitch;
    let aspect = f64::from(arguments.size.0) / f64::from(arguments.size.1);
    let cameras = cameras(arguments, &pitch, &frame, aspect)
        .with_context(|| format!("frame {} of {}", arguments.frame, arguments.stream.stream))?;
    let scene = FrameScene::new(&frame, &stream.manifest.people, stream.limits())
        .with_context(|| format!("{chunk_name}, frame {}", arguments.frame))?;
    let gpu = Offscreen::open()?;
    let (width, height) = arguments.size;
    let mut picture = RgbaImage::new(width * cameras.len() as u32, height);
    for (place, camera) in cameras.iter().enumerate() {
        let view = gpu.picture_with(&Stage::new(pitch), &scene, camera, arguments.guessed, arguments.size)?;
        imageops::replace(&mut picture, &view, place as i64 * i64::from(width), 0);
    }
    picture.save(&arguments.out).with_context(|| {
        format!("{}: cannot be written: give a name that ends in .png", arguments.out.display())
    })
}

/// Where the picture, or each of a turntable's, is seen from.
fn cameras(
    arguments: &RenderArguments,
    pitch: &Pitch,
    frame: &ChunkFrame,
    aspect: f64,
) -> anyhow::Result<Vec<ViewCamera>> {
    if let Some(count) = arguments.turntable {
        let wanted = arguments.person.unwrap_or_default();
        let body = frame.bodies.iter().find(|body| body.person.0 == wanted).with_context(|| {
            let there: Vec<String> = frame.bodies.iter().map(|body| body.person.0.to_string()).collect();
            format!("person {wanted} is not in this frame: it has {}", there.join(", "))
        })?;
        return Ok(turntable(body.anchor_m.as_dvec3(), frame.camera.as_ref(), count, aspect));
    }
    let camera = arguments.camera.as_ref().context("give --camera or --turntable")?;
    Ok(vec![view(camera, pitch, frame.camera.as_ref(), aspect)?])
}

fn view(
    camera: &CameraArgument,
    pitch: &Pitch,
    broadcast: Option<&Camera>,
    aspect: f64,
) -> anyhow::Result<ViewCamera> {
    match camera {
        CameraArgument::Preset(preset) => preset
            .view(pitch, broadcast, aspect)
            .context("the stream has no broadcast camera for this frame: use another --camera"),
        CameraArgument::File(path) => {
            let text = std::fs::read_to_string(path)
                .with_context(|| format!("{}: the camera file cannot be read", path.display()))?;
            let file = CameraFile::from_json(&text).with_context(|| path.display().to_string())?;
            Ok(file.view(aspect))
        }
    }
}

/// The frame with an index in the stream. Frames may last unevenly, so chunks before it are opened to count theirs.
pub(super) fn find_frame(
    runtime: &Runtime,
    stream: &Stream,
    wanted: u32,
) -> anyhow::Result<(String, ChunkFrame)> {
    let mut first = 0_usize;
    for index in 0..stream.chunks().len() {
        let loaded = runtime.block_on(stream.chunk(stream.best(), index))?;
        let count = loaded.chunk.frames().len();
        if let Some(frame) = loaded.chunk.frame(wanted as usize - first) {
            return Ok((stream.chunk_name(stream.best(), index), frame.into_owned()));
        }
        first += count;
    }
    let name = stream.location().name_of("");
    bail!("{name}: there is no frame {wanted}: the stream has frames 0 to {}", first.saturating_sub(1));
}
