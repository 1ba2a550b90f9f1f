//! Benchmarks: the player's figures on the demo stream, and the stream's own.

use anyhow::{Result, bail};
use clap::ValueEnum;

use crate::{
    demo,
    process::{built, cargo},
    root, setup,
};

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum What {
    /// Decode, upload, draw and seek on the demo stream
    Player,
    /// Rate and distortion of the codec on the demo clip, playback over made-up networks, a hundred viewers, changed streams
    Stream,
}

/// Measures.
pub(crate) fn run(what: What) -> Result<()> {
    setup::to_run()?;
    match what {
        What::Player => player(),
        What::Stream => stream(),
    }
}

fn player() -> Result<()> {
    if !root().join("target/demo/stream/match.json").is_file() {
        bail!("target/demo/stream is missing: run `cargo xtask demo` first");
    }
    cargo(&["build", "--package", "player"])?;
    built("player", &["bench", "target/demo/stream", "--json", "target/demo/bench.json"])?;
    println!("figures: target/demo/bench.json");
    Ok(())
}

fn stream() -> Result<()> {
    // The same build as that of the tests: another selection of packages would compile everything again.
    cargo(&["build", "--workspace", "--all-targets"])?;
    let kept = ["--work", "target/demo/work", "--profile", "plain"];
    demo::reconstruct("target/demo/plain", &kept)?;
    let (json, plot) = ("target/demo/stream.json", "target/demo/stream.svg");
    let figures = ["--stream", "target/demo/plain", "--json", json, "--plot", plot];
    built("reconstructor", &[&["evaluate", "stream"], figures.as_slice()].concat())?;
    built("examples/watch_made_up_match", &[])?;
    built("examples/soak", &["--seconds", "120"])?;
    built("examples/mutate", &["1000000"])?;
    println!("figures: {json}, {plot}");
    Ok(())
}
