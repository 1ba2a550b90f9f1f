//! The command line: arguments, and which command does what with them.
//!
//! Exit code 0: done; 1: failed on the input; 2: wrong usage.

mod bench;
mod inspect;
mod place;
mod place_picture;
mod render;
mod window;
mod xr;

use std::{path::PathBuf, process::ExitCode};

use anyhow::Context;
use clap::{Args, Parser, Subcommand};
use player::source::{Location, Stream};
use protocol::limits::Limits;
use tokio::runtime::Runtime;

const EXAMPLES: &str = "Examples:
  player target/demo/stream
  player http://192.168.1.20:8080/
  player target/demo/stream --scan room.pcd
  player render target/demo/stream --frame 0 --camera broadcast --size 1280x720 --out frame.png
  player inspect target/demo/stream
  player place --cloud scan.pcd --json table.json
  player bench target/demo/stream --json bench.json
  player xr target/demo/stream";

/// Shows a Holopitch stream on a table.
#[derive(Parser)]
#[command(name = "player", version, about, after_help = EXAMPLES, args_conflicts_with_subcommands = true)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    window: window::WindowArguments,
}

#[derive(Subcommand)]
enum Command {
    /// Draw one frame into a PNG, without a window or a display.
    Render(render::RenderArguments),
    /// Say what a stream holds, and check every hash.
    Inspect(inspect::InspectArguments),
    /// Find the table in a scan of a room.
    Place(place::PlaceArguments),
    /// Measure decoding, uploading, drawing and seeking.
    Bench(bench::BenchArguments),
    /// Show the match on a headset, through OpenXR.
    Xr(xr::XrArguments),
}

/// A stream that has to exist.
#[derive(Args)]
struct StreamArgument {
    /// Folder of the stream, or its http:// address.
    #[arg(value_name = "STREAM|URL")]
    stream: String,
}

/// Runs what the command line says.
pub(crate) fn run() -> ExitCode {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| "warn,wgpu_core=error,wgpu_hal=error,egui_wgpu=error,eframe=error".into());
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).without_time().init();
    let arguments = Arguments::parse();
    let done = match arguments.command {
        Some(Command::Render(arguments)) => render::run(&arguments),
        Some(Command::Inspect(arguments)) => inspect::run(&arguments),
        Some(Command::Place(arguments)) => place::run(&arguments),
        Some(Command::Bench(arguments)) => bench::run(&arguments),
        Some(Command::Xr(arguments)) => xr::run(&arguments),
        None => window::run(&arguments.window),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("player: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// A runtime for fetching, and the opened stream.
fn open(stream: &str) -> anyhow::Result<(Runtime, Stream)> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("cannot start the network runtime")?;
    let location = Location::parse(stream)?;
    let stream = runtime.block_on(Stream::open(location, Limits::default()))?;
    Ok((runtime, stream))
}

/// Writes figures as readable JSON.
fn write_json(path: &PathBuf, figures: &impl serde::Serialize) -> anyhow::Result<()> {
    let mut text = serde_json::to_string_pretty(figures)?;
    text.push('\n');
    std::fs::write(path, text).with_context(|| format!("{}: cannot be written", path.display()))
}

/// Parses `WxH`.
fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let size = text.split_once(['x', 'X', '×']).and_then(|(width, height)| {
        let size = (width.parse().ok()?, height.parse().ok()?);
        (size.0 > 0 && size.1 > 0).then_some(size)
    });
    size.ok_or_else(|| format!("`{text}` is not a size: give width and height in pixels, like 1280x720"))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn sizes_are_read_or_refused() {
        assert_eq!(parse_size("1280x720"), Ok((1280, 720)));
        for wrong in ["1280", "0x720", "axb", "-1x5", "99999999999x1"] {
            assert!(parse_size(wrong).is_err(), "{wrong}");
        }
    }
}
