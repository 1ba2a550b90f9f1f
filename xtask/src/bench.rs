//! Benchmarks: the player's figures on the demo stream.

use anyhow::{Result, bail};

use crate::{
    process::{built, cargo},
    root, setup,
};

/// Measures decode, upload, draw and seek on `target/demo/stream`.
pub(crate) fn run() -> Result<()> {
    setup::to_run()?;
    if !root().join("target/demo/stream/match.json").is_file() {
        bail!("target/demo/stream is missing: run `cargo xtask demo` first");
    }
    cargo(&["build", "--package", "player"])?;
    built("player", &["bench", "target/demo/stream", "--json", "target/demo/bench.json"])?;
    println!("figures: target/demo/bench.json");
    Ok(())
}
