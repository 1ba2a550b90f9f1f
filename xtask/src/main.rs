//! `cargo xtask`: everything around the code, with nothing to install by hand.
//!
//! `demo` and `test` are the README's two commands; both begin with `setup`.

mod bench;
mod dataset;
mod demo;
mod goldens;
mod openxr;
mod process;
mod setup;
mod test;

use std::{path::PathBuf, process::ExitCode};

use clap::{Parser, Subcommand};

/// Set-up, demo, tests and benchmarks of Holopitch.
#[derive(Parser)]
#[command(name = "cargo xtask", after_help = "Example: cargo xtask demo")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Install what is missing: system packages by apt, ONNX Runtime pinned by its hash, the glTF validator, an OpenXR runtime for tests
    Setup,
    /// Reconstruct the shipped clip into target/demo/stream, draw pictures of it, open the player
    Demo {
        /// Draw the pictures but do not open a window
        #[arg(long)]
        no_window: bool,
    },
    /// Run everything CI runs
    Test,
    /// Draw the kept pictures of the tests anew: look at each before you commit it
    Goldens {
        /// First reconstruct the excerpt of the demo stream that they show
        #[arg(long)]
        stream: bool,
    },
    /// Measure the player, or the stream
    Bench {
        /// Which
        #[arg(default_value = "player")]
        what: bench::What,
    },
    /// Make a data set under target/datasets
    Dataset {
        /// Which one
        name: dataset::Name,
        /// Samples to render; the default is the number the shipped figures were measured on
        #[arg(long)]
        count: Option<usize>,
    },
}

fn main() -> ExitCode {
    let result = match Arguments::parse().command {
        Command::Setup => setup::everything(),
        Command::Demo { no_window } => demo::run(no_window),
        Command::Test => test::run(),
        Command::Goldens { stream } => goldens::run(stream),
        Command::Bench { what } => bench::run(what),
        Command::Dataset { name, count } => dataset::run(name, count),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// The folder of the workspace: cargo says it when it runs this; the one it was built in may have been copied since.
fn root() -> PathBuf {
    let told = std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
    let xtask = PathBuf::from(told);
    xtask.parent().map_or(xtask.clone(), PathBuf::from)
}
