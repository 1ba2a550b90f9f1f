//! Writes training sets: `dataset depth --out DIR --count N --seed S --split train|test [--motions FILE]`.

use std::{
    path::PathBuf,
    process::ExitCode,
    sync::atomic::{AtomicUsize, Ordering},
    time::Instant,
};

use synthesis::dataset::{DepthOptions, Split, depth_crops};

const USAGE: &str = "usage: dataset depth --out DIR --count N [--seed S] [--split train|test] [--motions FILE] [--shard N] [--height LOW..HIGH]

Writes shard-NNNN/{crops.npy, mask.npy, offset_mm.npy, meta.jsonl}: rendered players for the depth network.
example: cargo run -p synthesis --bin dataset -- depth --out target/depth/train --count 12000 --motions target/people/motions.bin";

fn options() -> Option<DepthOptions> {
    let mut arguments = std::env::args().skip(1);
    if arguments.next()? != "depth" {
        return None;
    }
    let mut options = DepthOptions {
        out: PathBuf::new(),
        count: 0,
        shard: 512,
        seed: 1,
        split: Split::Train,
        motions: None,
        height_px: [30.0, 160.0],
    };
    while let Some(name) = arguments.next() {
        let value = arguments.next()?;
        match name.as_str() {
            "--out" => options.out = value.into(),
            "--count" => options.count = value.parse().ok()?,
            "--shard" => options.shard = value.parse().ok()?,
            "--seed" => options.seed = value.parse().ok()?,
            "--motions" => options.motions = Some(value.into()),
            "--split" => {
                options.split = match value.as_str() {
                    "train" => Split::Train,
                    "test" => Split::Test,
                    _ => return None,
                }
            }
            "--height" => {
                let (low, high) = value.split_once("..")?;
                options.height_px = [low.parse().ok()?, high.parse().ok()?];
            }
            _ => return None,
        }
    }
    (options.count > 0 && !options.out.as_os_str().is_empty()).then_some(options)
}

fn main() -> ExitCode {
    let Some(options) = options() else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    if options.motions.is_none() {
        eprintln!(
            "warning: no --motions: only the shipped clips are used (bake all with training/bake_people.py --all-motions)"
        );
    }
    let (done, start) = (AtomicUsize::new(0), Instant::now());
    let result = depth_crops(&options, |_| {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        if done.is_multiple_of(100) || done == options.count {
            let seconds = start.elapsed().as_secs_f64();
            eprintln!("{done} of {} samples, {:.1} per second", options.count, done as f64 / seconds);
        }
    });
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(1)
        }
    }
}
