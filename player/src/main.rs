//! The `player` program: watch, draw, inspect and measure Holopitch streams.

mod commands;

use std::process::ExitCode;

fn main() -> ExitCode {
    commands::run()
}
