//! `player xr`: the match on a headset.

use std::path::PathBuf;

use anyhow::{anyhow, bail};
use player::{
    session::Session,
    source::{Location, loader::Loader},
    xr::{self, XrFigures, XrOptions},
};
use protocol::limits::Limits;

const EXAMPLES: &str = "Examples:
  player xr target/demo/stream
  player xr http://192.168.1.20:8080/ --resolution-scale 0.8
  player xr target/demo/stream --exit-after-frames 300 --json xr.json --capture eyes

Needs an OpenXR runtime that draws with Vulkan (Monado, SteamVR, the headset maker's own). Point at a table
and select to put the match there; the panel beside it plays, scrubs and follows the ball.";

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct XrArguments {
    #[command(flatten)]
    stream: super::StreamArgument,
    /// Share of the picture size that the runtime recommends, 0.1 to 2.
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, value_parser = parse_share)]
    resolution_scale: f64,
    /// Samples per pixel: 4 for smooth edges, 1 for speed.
    #[arg(long, default_value = "4", value_parser = ["1", "4"])]
    samples: String,
    /// Stand at this frame of the stream instead of playing.
    #[arg(long, value_name = "N")]
    frame: Option<u32>,
    /// Put the match on the first table that the headset finds, without a hand.
    #[arg(long)]
    place: bool,
    /// For scripts: leave after this many frames with the match on show.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    exit_after_frames: Option<u32>,
    /// For scripts: write the figures as JSON. Needs --exit-after-frames.
    #[arg(long, value_name = "FILE", requires = "exit_after_frames")]
    json: Option<PathBuf>,
    /// For scripts: also write every frame's figures into the JSON.
    #[arg(long, requires = "json")]
    trace: bool,
    /// For scripts: write both eyes of the last frame as DIR/left.png and DIR/right.png. Needs --exit-after-frames.
    #[arg(long, value_name = "DIR", requires = "exit_after_frames")]
    capture: Option<PathBuf>,
}

fn parse_share(text: &str) -> Result<f64, String> {
    let share = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
    if (0.1..=2.0).contains(&share) { Ok(share) } else { Err("give a share from 0.1 to 2".to_owned()) }
}

pub(super) fn run(arguments: &XrArguments) -> anyhow::Result<()> {
    let text = &arguments.stream.stream;
    let location = Location::parse(text)?;
    if let Location::Folder(folder) = &location
        && !folder.is_dir()
    {
        bail!("{text}: there is no such folder: give the folder that holds match.json");
    }
    // The frame loop looks for news every frame: nobody has to be woken.
    let loader = Loader::start(location, Limits::default(), || {})?;
    let options = XrOptions {
        exit_after_frames: arguments.exit_after_frames,
        frame: arguments.frame,
        place: arguments.place,
        capture: arguments.capture.clone(),
        resolution_scale: arguments.resolution_scale,
        samples: if arguments.samples == "1" { 1 } else { 4 },
        trace: arguments.trace,
        compare_cost: arguments.json.is_some(),
    };
    let figures = xr::run(Session::new(loader), &options).map_err(|error| anyhow!("{text}: {error}"))?;
    if arguments.exit_after_frames.is_some() {
        print(&figures);
    }
    match &arguments.json {
        Some(path) => super::write_json(path, &figures),
        None => Ok(()),
    }
}

fn print(figures: &XrFigures) {
    println!(
        "{} frames for both eyes at {} × {} px on {} ({}), {}",
        figures.frames,
        figures.width_px,
        figures.height_px,
        figures.runtime,
        figures.adapter,
        if figures.multiview { "one pass" } else { "two passes" },
    );
    println!(
        "  processor time per frame   {:8.2} ms (95 %: {:.2} ms)",
        figures.frame_cpu.p50_ms, figures.frame_cpu.p95_ms
    );
    println!(
        "  outside the runtime        {:8.2} ms (95 %: {:.2} ms)",
        figures.frame_own.p50_ms, figures.frame_own.p95_ms
    );
    println!(
        "  inside the runtime         {:8.2} ms (95 %: {:.2} ms)",
        figures.frame_runtime.p50_ms, figures.frame_runtime.p95_ms
    );
    println!("  dropped frames             {:8}", figures.dropped_frames);
    if let Some(cost) = &figures.cost {
        println!("  two views over one         {:8.2} times the processor time", cost.stereo_over_mono);
    }
}
