//! `reconstructor`: clip to stream, and the tools around it. Exit codes: 0 done, 1 failed on the input, 2 wrong usage.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod cli;

use std::{
    fs,
    io::{IsTerminal, Write},
    path::Path,
    process::ExitCode,
};

use anyhow::{Context, Result};
use clap::Parser;
use protocol::{chunk::ChunkFrame, limits::Limits, manifest::ChunkEntry};
use reconstructor::{
    calibration::{
        ShotFigures,
        command::{self, CalibrateOptions},
    },
    encode::{StreamReader, convert},
    evaluate::{self, air, depth, flicker, frame_truth, matches},
    mesh::MeshBudget,
    pipeline::{ObserveOptions, ReconstructOptions, reconstruct},
    report::{Progress, Reporter},
    segmentation::Method,
    tracking::TrackingLimits,
    trajectory::Smoothing,
};
use serde::Serialize;
use tracing_subscriber::EnvFilter;

use cli::{Cli, Command, Evaluate};

/// Pictures in the sheet of `evaluate realism`.
const SHEET_ROWS: usize = 8;

fn main() -> ExitCode {
    // clap ends the program with 2 on wrong usage and 0 on --help.
    let cli = Cli::parse();
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_target(false)
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(std::io::stderr)
        .init();
    match run(cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", one_line(&error));
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<()> {
    match command {
        Command::Reconstruct(arguments) => run_reconstruct(arguments),
        Command::Calibrate(arguments) => run_calibrate(arguments),
        Command::Synthesize(arguments) => run_synthesize(arguments),
        Command::Evaluate(Evaluate::Match(arguments)) => run_evaluate_match(&arguments),
        Command::Evaluate(Evaluate::Stream(arguments)) => run_evaluate_stream(&arguments),
        Command::Evaluate(Evaluate::Depth(arguments)) => {
            let progress = Progress::new("depth", 0);
            let figures = depth::depth(&arguments.data, |_| progress.advance(1))?;
            drop(progress);
            write_figures(&arguments.json, &figures)
        }
        Command::Evaluate(Evaluate::Calibration(arguments)) => {
            let progress = Progress::new("calibration", 0);
            let options = evaluate::calibration::EvaluationOptions {
                clicks: arguments.clicks,
                without: arguments.without,
            };
            let figures = evaluate::calibration::evaluate(&arguments.data, &options, &progress)?;
            drop(progress);
            write_figures(&arguments.json, &figures)
        }
        Command::Evaluate(Evaluate::Detection(arguments)) => {
            let progress = Progress::new("detection", 0);
            let figures = evaluate::detection::evaluate(&arguments.data, &progress)?;
            drop(progress);
            write_figures(&arguments.json, &figures)
        }
        Command::Evaluate(Evaluate::Tracking(arguments)) => {
            let evaluation = evaluate::tracking::TrackingEvaluation {
                data: arguments.data,
                work: arguments.work,
                tracks: arguments.tracks,
                threads: threads(arguments.threads),
            };
            let figures = evaluate::tracking::evaluate(&evaluation, &mut Reporter::new())?;
            write_figures(&arguments.json, &figures)
        }
        Command::Evaluate(Evaluate::Segmentation(arguments)) => {
            let methods = match arguments.segmentation {
                chosen if chosen.is_empty() => Method::ALL.to_vec(),
                chosen => chosen,
            };
            let (data, work) = (arguments.data, arguments.work);
            let options = evaluate::segmentation::SegmentationOptions { data, work, methods };
            write_figures(&arguments.json, &evaluate::segmentation::evaluate(&options)?)
        }
        Command::Evaluate(Evaluate::Realism(arguments)) => run_evaluate_realism(&arguments),
        Command::Convert(arguments) => run_convert(&arguments),
        Command::Serve(arguments) => Ok(serving::server::serve(&arguments.stream, arguments.options())?),
    }
}

fn run_reconstruct(arguments: cli::Reconstruct) -> Result<()> {
    let options = ReconstructOptions {
        observe: ObserveOptions {
            clip: arguments.clip,
            calibration: arguments.calibration,
            pitch: arguments.pitch,
            frames: arguments.frames,
            work: arguments.work,
            tracking: TrackingLimits { method: arguments.tracking, ..TrackingLimits::default() },
            threads: threads(arguments.threads),
        },
        out: arguments.out,
        profile: arguments.profile,
        budget: MeshBudget { triangles: arguments.triangles as usize },
        smoothing: Smoothing::default(),
        overlay: arguments.overlay,
    };
    // People of a chunk are followed at the same time: on no more cores than were asked for.
    rayon::ThreadPoolBuilder::new().num_threads(options.observe.threads).build_global()?;
    let mut reporter = Reporter::new();
    let report = reconstruct(&options, &mut reporter).inspect_err(|_| {
        if let Some(work) = options.observe.work.as_ref().filter(|work| work.exists()) {
            tracing::info!("finished parts stay in {}; the same command resumes", work.display());
        }
    })?;
    if let Some(path) = &arguments.report {
        write_json(path, &report)?;
    }
    println!(
        "{}: {} frames, {} cameras, {} median line residual, {} people, {:.1} with a mesh per frame, {:.1} s per frame",
        options.out.display(),
        report.frames,
        report.cameras_solved,
        pixels(report.line_residual_median_px),
        report.people,
        report.people_with_mesh_mean,
        report.seconds_per_frame,
    );
    Ok(())
}

/// Frames worked on at a time.
fn threads(asked: Option<u16>) -> usize {
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    asked.map_or_else(cores, usize::from)
}

fn run_calibrate(arguments: cli::Calibrate) -> Result<()> {
    let options = CalibrateOptions {
        inputs: arguments.inputs,
        calibration: arguments.calibration,
        pitch: arguments.pitch,
        frames: arguments.frames,
        out: arguments.out,
        overlay: arguments.overlay,
    };
    let progress = Progress::new("calibration", 0);
    let report = command::run(&options, &progress)?;
    drop(progress);
    for shot in &report.shots {
        println!("{}", shot_line(shot));
    }
    println!(
        "{}: {} of {} cameras, {} median line residual, {} worst frame",
        options.out.display(),
        report.solved,
        report.frames.len(),
        pixels(report.line_residual_median_px),
        pixels(report.line_residual_worst_px),
    );
    Ok(())
}

/// A shot's cameras for people to read.
fn shot_line(shot: &ShotFigures) -> String {
    let metres = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.2} m"));
    format!(
        "frames {}..{} of the range: {} cameras, found alone in {} of {} frames and {} of these agree; {} ({} frame by frame) \
         median line residual; place known to {} (halves of the shot), {} frame by frame{}",
        shot.frames.start,
        shot.frames.end,
        shot.solved,
        shot.located,
        shot.tried,
        shot.agreeing,
        pixels(shot.line_residual_median_px),
        pixels(shot.free_line_residual_median_px),
        metres(shot.halves_apart_m),
        metres(shot.free_centre_std_m),
        if shot.moving { "; the camera moves" } else { "" },
    )
}

fn run_synthesize(arguments: cli::Synthesize) -> Result<()> {
    let platform = arguments.camera.map(|position_m| synthesis::operator::Platform {
        position_m: position_m.into(),
        player_px: arguments.player_px,
    });
    let options = synthesis::Options {
        out: arguments.out,
        seed: arguments.seed,
        frames: arguments.frames,
        size_px: arguments.size,
        trajectories: arguments.trajectories,
        start_seconds: arguments.start,
        truth_triangles: arguments.truth_triangles,
        maps: arguments.maps,
        crf: arguments.crf,
        setting: arguments.setting,
        shots: arguments.shots,
        platform,
    };
    let start = std::time::Instant::now();
    let progress = Progress::new("synthesis", u64::from(options.frames));
    // The callback gets the number of finished frames.
    let made = synthesis::synthesize(&options, |done| {
        progress.advance((done as u64).saturating_sub(progress.done()));
    })?;
    drop(progress);
    if made.generated_paths {
        tracing::warn!("no --trajectories given: the players run on made-up paths");
    }
    println!(
        "{}: {} frames, {:.1} people in view per frame; {:.2} frames/s; per frame {} bytes of video, {} of truth",
        made.clip.display(),
        made.frames,
        made.people_in_view_mean,
        made.frames as f64 / start.elapsed().as_secs_f64(),
        made.clip_bytes / made.frames.max(1) as u64,
        made.truth_bytes / made.frames.max(1) as u64
    );
    Ok(())
}

/// What `evaluate match` prints.
#[derive(Serialize)]
struct AllFigures {
    #[serde(flatten)]
    people: matches::MatchFigures,
    #[serde(flatten)]
    flicker: flicker::FlickerFigures,
    #[serde(flatten)]
    air: Option<air::AirFigures>,
}

fn run_convert(arguments: &cli::Convert) -> Result<()> {
    // The old chunks go before the new ones come.
    let same = arguments.out.exists() && arguments.stream.canonicalize()? == arguments.out.canonicalize()?;
    anyhow::ensure!(!same, "--out is the stream itself: choose another folder");
    let reader = StreamReader::open(&arguments.stream, &Limits::default())?;
    let progress = Progress::new("chunks", reader.chunk_count() as u64);
    let manifest = convert(&reader, &arguments.out, arguments.profile, || progress.advance(1))?;
    drop(progress);
    let bytes = |files: &[ChunkEntry]| files.iter().map(|chunk| chunk.file.bytes).sum::<u64>();
    for representation in &manifest.representations {
        println!(
            "{}: {} bytes in {}",
            representation.id,
            bytes(&representation.chunks),
            arguments.out.display()
        );
    }
    Ok(())
}

fn run_evaluate_stream(arguments: &cli::EvaluateStream) -> Result<()> {
    let reader = StreamReader::open(&arguments.stream, &Limits::default())?;
    let chosen = (0..reader.chunk_count()).step_by(arguments.every as usize);
    let progress = Progress::new("chunks", chosen.len() as u64);
    let chunks = chosen.map(|index| {
        progress.advance(1);
        reader.any_chunk(index).map_err(anyhow::Error::from)
    });
    let figures = evaluate::stream::stream(chunks, reader.manifest().timescale)?;
    drop(progress);
    if let Some(path) = &arguments.plot {
        fs::write(path, evaluate::stream_plot::plot(&figures))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    if let Some(ratio) = figures.bytes_ratio {
        println!("bytes for one of Draco and JPEG per frame: {ratio:.3}");
    }
    for rung in &figures.rungs {
        println!(
            "{}: {:.2} Mbit/s, {:.2} mm, {:.1} dB, {:.2} ms",
            rung.rate.id, rung.rate.mbit_s, rung.rate.error_mm, rung.rate.psnr_db, rung.decode_ms_p50
        );
    }
    write_figures(&arguments.json, &figures)
}

fn run_evaluate_match(arguments: &cli::EvaluateMatch) -> Result<()> {
    let limits = Limits::default();
    let truth = arguments.data.join("truth");
    let frames = |folder: &Path| -> Result<(_, Vec<_>)> {
        let reader = StreamReader::open(folder, &limits)?;
        let mut frames = Vec::new();
        for chunk in reader.chunks() {
            // Textures are not measured here; a whole match of them would not fit in memory.
            frames.extend(chunk?.frames.into_iter().map(|frame| ChunkFrame { atlas: None, ..frame }));
        }
        Ok((reader.manifest().timescale, frames))
    };
    let (timescale, truth) = frames(&truth)
        .context("the true stream cannot be read; --data names the folder that holds truth/")?;
    let (_, ours) = frames(&arguments.stream).context("the reconstructed stream cannot be read")?;
    let frames = arguments.data.join(frame_truth::FILE_NAME);
    let air = if frames.exists() {
        Some(air::compare(&frame_truth::frames::<air::FrameLine>(&arguments.data)?, &truth, &ours))
    } else {
        tracing::warn!("there is no {}, so ball and jumps are not measured", frames.display());
        None
    };
    let people = matches::compare(&truth, &ours);
    let figures = AllFigures { people, flicker: flicker::flicker(&truth, &ours, timescale), air };
    write_figures(&arguments.json, &figures)
}

/// A distance for people to read.
fn pixels(distance_px: Option<f64>) -> String {
    distance_px.map_or("no".to_owned(), |px| format!("{px:.2} px"))
}

/// Writes figures to a file and to standard output.
fn run_evaluate_realism(arguments: &cli::EvaluateRealism) -> Result<()> {
    use evaluate::realism;
    let progress = Progress::new("realism", 0);
    if let (Some(out), Some(annotated)) = (&arguments.sheet, &arguments.annotated) {
        let sheet = realism::sheet(annotated, SHEET_ROWS, arguments.seed, &progress)?;
        sheet.save(out).with_context(|| format!("cannot write {}", out.display()))?;
    }
    let figures = realism::evaluate(&arguments.real, &arguments.ours, &progress)?;
    drop(progress);
    write_figures(&arguments.json, &figures)
}

fn write_figures(path: &Path, figures: &impl Serialize) -> Result<()> {
    write_json(path, figures)?;
    // Whoever reads may stop early (`… | head`): that is no failure.
    match writeln!(std::io::stdout().lock(), "{}", serde_json::to_string_pretty(figures)?) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

/// Writes a JSON file whole or not at all.
fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let write = || -> Result<()> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder)?;
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        serde_json::to_writer_pretty(&mut file, value)?;
        file.write_all(b"\n")?;
        file.persist(path)?;
        Ok(())
    };
    write().with_context(|| format!("cannot write {}", path.display()))
}

/// An error and its causes on one line, each cause once.
fn one_line(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for cause in error.chain() {
        let cause = cause.to_string().replace('\n', "; ");
        // Most messages already hold their cause.
        if !line.contains(&cause) {
            line += if line.is_empty() { "" } else { ": " };
            line += &cause;
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_one_line_without_repetition() {
        let error = anyhow::anyhow!("no such file")
            .context("cannot read a.mp4: no such file")
            .context("not\nfinished");
        assert_eq!(one_line(&error), "not; finished: cannot read a.mp4: no such file");
    }

    #[test]
    fn json_is_written_whole_and_the_place_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/figures.json");
        write_json(&path, &[1, 2]).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "[\n  1,\n  2\n]\n");
        let error = write_json(&path.join("below"), &[1]).unwrap_err();
        assert!(one_line(&error).contains("figures.json"), "{error:#}");
    }
}
