//! Watches made-up matches over made-up networks and prints how it went.
//!
//! `cargo run -p protocol --features sample --example watch_made_up_match` prints one line per scenario; with (a part of)
//! a scenario's name behind it, also everything that happened in it.

use std::process::ExitCode;

use protocol::playback::simulation::Scenario;

fn main() -> ExitCode {
    let wanted = std::env::args().nth(1);
    for scenario in Scenario::all() {
        if wanted.as_ref().is_some_and(|wanted| !scenario.name.contains(wanted.as_str())) {
            continue;
        }
        let outcome = match scenario.run() {
            Ok(outcome) => outcome,
            Err(error) => {
                eprintln!("{}: {error}", scenario.name);
                return ExitCode::FAILURE;
            }
        };
        if wanted.is_some() {
            outcome.trace.iter().for_each(|line| println!("{line}"));
        }
        println!("{}", outcome.figures);
    }
    ExitCode::SUCCESS
}
