//! Everything CI runs, in the order that fails fastest.

use anyhow::Result;

use crate::{
    openxr,
    process::{cargo, output, run_command},
    root, setup,
};

/// Formatting, lints, licences, the web build of the libraries that promise one, and every test.
pub(crate) fn run() -> Result<()> {
    println!("test: set up, formatting, lints, licences, wasm check, all tests");
    cargo(&["fmt", "--all", "--check"])?;
    setup::everything()?;
    cargo(&["clippy", "--workspace", "--all-targets", "--", "--deny", "warnings"])?;
    licences()?;
    web()?;
    tests()
}

/// Every test, with every optional tool required: here nothing may skip for want of one.
fn tests() -> Result<()> {
    // The headset's tests put this OpenXR layer between the player and the runtime.
    cargo(&["build", "--package", "fakeplanes"])?;
    cargo_test(&[], "HOLOPITCH_REQUIRE_TOOLS")
}

/// `cargo test` of the workspace on software Vulkan and the tests' OpenXR runtime, with a variable set to 1.
pub(crate) fn cargo_test(arguments: &[&str], variable: &str) -> Result<()> {
    let program = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    run_command(
        std::process::Command::new(program)
            .args(["test", "--workspace"])
            .args(arguments)
            .envs(openxr::folder()?.map(|folder| ("HOLOPITCH_OPENXR_ROOT", folder)))
            .envs(setup::environment())
            .env("VK_DRIVER_FILES", setup::software_vulkan()?)
            .env(variable, "1")
            .current_dir(root()),
    )
}

/// Every dependency's licence against `deny.toml`.
fn licences() -> Result<()> {
    let cargo_deny = setup::cargo_deny()?;
    // It looks at the crates of every platform; a build fetches only those of this one.
    cargo(&["fetch", "--locked"])?;
    run_command(
        std::process::Command::new(cargo_deny)
            .args(["--offline", "check", "licenses", "bans", "sources"])
            .current_dir(root()),
    )
}

/// The libraries that must compile for a browser. The standard library for that target is not to be had on every
/// machine: then this says so and goes on.
fn web() -> Result<()> {
    const TARGET: &str = "wasm32-unknown-unknown";
    let installed =
        || output("rustup", &["target", "list", "--installed"]).is_some_and(|l| l.contains(TARGET));
    if !installed() && output("rustup", &["target", "add", TARGET]).is_none() {
        println!("SKIPPED wasm check: rustup could not add the target {TARGET}");
        return Ok(());
    }
    cargo(&["check", "--target", TARGET, "--package", "protocol", "--package", "player", "--lib"])
}
