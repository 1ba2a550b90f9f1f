//! The demo: the shipped clip becomes a stream, the stream becomes pictures and, with a display, a window.

use std::fs;

use anyhow::{Context, Result};

use crate::{
    process::{built, cargo},
    root, setup,
};

/// Views drawn of the demo stream: file name, frame, camera.
const PICTURES: &[(&str, &str, &str)] = &[
    ("broadcast", "40", "broadcast"),
    ("table", "40", "table"),
    ("top", "40", "top"),
    ("goal-left", "40", "goal-left"),
    ("broadcast-later", "90", "broadcast"),
];

/// Runs the whole way on the shipped clip.
pub(crate) fn run(no_window: bool) -> Result<()> {
    println!("demo: set up, build, reconstruct assets/demo/clip.mp4, draw it, open the player");
    setup::to_run()?;
    cargo(&["build", "--package", "reconstructor", "--package", "player"])?;
    let out = root().join("target/demo");
    fs::create_dir_all(&out).with_context(|| format!("cannot make {}", out.display()))?;
    let kept = ["--work", "target/demo/work", "--report", "target/demo/report.json"];
    reconstruct("target/demo/stream", &kept)?;
    built(
        "reconstructor",
        &[
            "evaluate",
            "match",
            "--data",
            "assets/demo",
            "--stream",
            "target/demo/stream",
            "--json",
            "target/demo/match.json",
        ],
    )?;
    for (name, frame, camera) in PICTURES {
        let picture = format!("target/demo/{name}.png");
        built(
            "player",
            &[
                "render",
                "target/demo/stream",
                "--frame",
                frame,
                "--camera",
                camera,
                "--size",
                "1280x720",
                "--out",
                &picture,
            ],
        )?;
    }
    println!("stream: target/demo/stream    pictures: target/demo/*.png");
    let has_display = ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|v| std::env::var_os(v).is_some());
    if no_window || !has_display {
        println!("no window asked for or no display here: the pictures are the demo");
        return Ok(());
    }
    built("player", &["target/demo/stream"])
}

/// Reconstructs the shipped clip into a folder; the reconstructor is built.
pub(crate) fn reconstruct(out: &str, more: &[&str]) -> Result<()> {
    built("reconstructor", &[&["reconstruct", "assets/demo/clip.mp4", "--out", out], more].concat())
}
