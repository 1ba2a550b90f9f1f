//! Writes data sets: `dataset depth` player crops with depth, `dataset frames` whole broadcast pictures with their truth.

use std::{path::PathBuf, process::ExitCode, time::Instant};

use synthesis::{
    SynthesisError,
    dataset::{DepthOptions, FrameOptions, PER_MATCH, Split, broadcast_frames, depth_crops, usual_kinds},
    shots::Shots,
};

const USAGE: &str = "usage: dataset depth  --out DIR --count N [--seed S] [--split train|validation|test] [--motions FILE] [--shard N] [--height LOW..HIGH] [--numbers LOW..HIGH]
       dataset frames --out DIR --count N [--seed S] [--split train|validation|test] [--size WxH] [--per-match N] [--maps yes|no] [--kinds KIND,KIND,…]

depth writes shard-NNNN/{crops,mask,offset_mm,front_mm,back_mm}.npy and meta.jsonl: rendered players for the depth network.
frames writes images/, labels/ (YOLO: ball, goalkeeper, player, referee), frames.jsonl and maps/: whole pictures.
example: cargo run -p synthesis --bin dataset -- frames --out target/datasets/frames-train --count 2000";

enum Kind {
    Depth(DepthOptions),
    Frames(FrameOptions),
}

fn split(name: &str) -> Option<Split> {
    match name {
        "train" => Some(Split::Train),
        "validation" => Some(Split::Validation),
        "test" => Some(Split::Test),
        _ => None,
    }
}

fn yes(word: &str) -> Option<bool> {
    match word {
        "yes" => Some(true),
        "no" => Some(false),
        _ => None,
    }
}

fn depth(mut arguments: impl Iterator<Item = String>) -> Option<DepthOptions> {
    let mut options = DepthOptions {
        out: PathBuf::new(),
        count: 0,
        shard: 512,
        seed: 1,
        split: Split::Train,
        motions: None,
        height_px: [30.0, 160.0],
        numbers: [1, 39],
    };
    while let Some(name) = arguments.next() {
        let value = arguments.next()?;
        match name.as_str() {
            "--out" => options.out = value.into(),
            "--count" => options.count = value.parse().ok()?,
            "--shard" => options.shard = value.parse().ok()?,
            "--seed" => options.seed = value.parse().ok()?,
            "--motions" => options.motions = Some(value.into()),
            "--split" => options.split = split(&value)?,
            "--height" => {
                let (low, high) = value.split_once("..")?;
                options.height_px = [low.parse().ok()?, high.parse().ok()?];
            }
            "--numbers" => {
                let (low, high) = value.split_once("..")?;
                options.numbers = [low.parse().ok()?, high.parse().ok()?];
            }
            _ => return None,
        }
    }
    (options.count > 0 && !options.out.as_os_str().is_empty()).then_some(options)
}

fn frames(mut arguments: impl Iterator<Item = String>) -> Option<FrameOptions> {
    let mut options = FrameOptions {
        out: PathBuf::new(),
        count: 0,
        seed: 1,
        split: Split::Train,
        size_px: (1280, 720),
        maps: true,
        kinds: usual_kinds(),
        per_match: PER_MATCH,
    };
    while let Some(name) = arguments.next() {
        let value = arguments.next()?;
        match name.as_str() {
            "--out" => options.out = value.into(),
            "--count" => options.count = value.parse().ok()?,
            "--seed" => options.seed = value.parse().ok()?,
            "--split" => options.split = split(&value)?,
            "--maps" => options.maps = yes(&value)?,
            "--per-match" => options.per_match = value.parse().ok()?,
            // Written like the shots of a clip.
            "--kinds" => {
                options.kinds = value.parse::<Shots>().ok()?.0.iter().map(|shot| shot.kind).collect()
            }
            "--size" => {
                let (width, height) = value.split_once('x')?;
                options.size_px = (width.parse().ok()?, height.parse().ok()?);
            }
            _ => return None,
        }
    }
    (options.count > 0 && !options.out.as_os_str().is_empty()).then_some(options)
}

fn kind() -> Option<Kind> {
    let mut arguments = std::env::args().skip(1);
    match arguments.next()?.as_str() {
        "depth" => depth(arguments).map(Kind::Depth),
        "frames" => frames(arguments).map(Kind::Frames),
        _ => None,
    }
}

fn main() -> ExitCode {
    let Some(kind) = kind() else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    match run(&kind) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(1)
        }
    }
}

fn run(kind: &Kind) -> Result<(), SynthesisError> {
    let start = Instant::now();
    let said = |done: usize, count: usize, every: usize| {
        if done.is_multiple_of(every) || done == count {
            eprintln!("{done} of {count}, {:.1} per second", done as f64 / start.elapsed().as_secs_f64());
        }
    };
    match kind {
        Kind::Depth(options) => {
            if options.motions.is_none() {
                eprintln!(
                    "warning: no --motions: only the shipped clips are used (bake all with training/bake_people.py --all-motions)"
                );
            }
            // Samples finish in any order: they are counted here.
            let done = std::sync::atomic::AtomicUsize::new(0);
            depth_crops(options, |_| {
                said(done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1, options.count, 100);
            })
        }
        Kind::Frames(options) => broadcast_frames(options, |done| said(done, options.count, 4)),
    }
}
