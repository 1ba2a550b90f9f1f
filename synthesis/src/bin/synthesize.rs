//! Renders a broadcast clip with its truth, with every option; `reconstructor synthesize` offers the common ones.

use std::{path::PathBuf, process::ExitCode, time::Instant};

use synthesis::{Options, synthesize, venue::Setting};

const USAGE: &str = "usage: synthesize --out DIR [--seed N] [--frames N] [--size WxH] [--trajectories FILE.json] [--start SECONDS]
                  [--truth-triangles N] [--crf N] [--maps yes|no] [--setting plain|drawn] [--shots LIST]

example: cargo run -p synthesis --bin synthesize -- --out target/clip --seed 7 --frames 50";

fn options() -> Option<Options> {
    let mut options = Options { out: PathBuf::new(), ..Options::default() };
    let mut arguments = std::env::args().skip(1);
    while let Some(name) = arguments.next() {
        let value = arguments.next()?;
        match name.as_str() {
            "--out" => options.out = value.into(),
            "--seed" => options.seed = value.parse().ok()?,
            "--frames" => options.frames = value.parse().ok()?,
            "--size" => {
                let (width, height) = value.split_once('x')?;
                options.size_px = (width.parse().ok()?, height.parse().ok()?);
            }
            "--trajectories" => options.trajectories = Some(value.into()),
            "--start" => options.start_seconds = value.parse().ok()?,
            "--truth-triangles" => options.truth_triangles = value.parse().ok()?,
            "--maps" => options.maps = value == "yes",
            "--shots" => options.shots = value.parse().ok()?,
            "--setting" => {
                options.setting = match value.as_str() {
                    "plain" => Setting::Plain,
                    "drawn" => Setting::Drawn,
                    _ => return None,
                };
            }
            "--crf" => options.crf = Some(value.parse().ok()?),
            _ => return None,
        }
    }
    (!options.out.as_os_str().is_empty()).then_some(options)
}

fn main() -> ExitCode {
    let Some(options) = options() else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    if options.trajectories.is_none() {
        eprintln!("warning: no --trajectories: the players' paths are made up");
    }
    let start = Instant::now();
    let result = synthesize(&options, |done| {
        if done % 25 == 0 {
            eprintln!(
                "{done} of {} frames, {:.2} per second",
                options.frames,
                done as f64 / start.elapsed().as_secs_f64()
            );
        }
    });
    match result {
        Ok(done) => {
            println!(
                "{}: {} frames, {:.1} people in view on average",
                done.clip.display(),
                done.frames,
                done.people_in_view_mean
            );
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(1)
        }
    }
}
