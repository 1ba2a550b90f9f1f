//! Draws the kept pictures of the tests anew, on request from a new excerpt of the demo stream.

use std::process::Command;

use anyhow::Result;

use crate::{
    openxr,
    process::{built, cargo, run_command},
    root, setup,
};

/// Replaces `tests/goldens/*.png` by what is drawn now; with `stream`, first `assets/demo/excerpt` by what the
/// reconstructor makes of the demo clip's first frames now.
pub(crate) fn run(stream: bool) -> Result<()> {
    setup::everything()?;
    if stream {
        cargo(&["build", "--package", "reconstructor"])?;
        built(
            "reconstructor",
            &[
                "reconstruct",
                "assets/demo/clip.mp4",
                "--calibration",
                "assets/demo/correspondences.json",
                "--frames",
                "0..6",
                "--out",
                "assets/demo/excerpt",
            ],
        )?;
    }
    cargo(&["build", "--package", "fakeplanes"])?;
    let program = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    run_command(
        Command::new(program)
            .args(["test", "--workspace", "--test", "golden", "--test", "headset"])
            .envs(openxr::folder()?.map(|folder| ("HOLOPITCH_OPENXR_ROOT", folder)))
            .envs(setup::environment())
            .env("VK_DRIVER_FILES", setup::software_vulkan()?)
            .env("HOLOPITCH_UPDATE_GOLDENS", "1")
            .current_dir(root()),
    )
}
