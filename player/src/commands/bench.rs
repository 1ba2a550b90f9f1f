//! `player bench`: what a frame costs from the file to the finished picture.

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use anyhow::Context;
use player::{
    camera::Preset,
    offscreen::Offscreen,
    renderer::Renderer,
    scene::{FrameScene, Stage},
};
use serde::Serialize;

const EXAMPLES: &str = "Examples:
  player bench target/demo/stream --json bench.json
  player bench http://localhost:8080/ --size 1920x1080 --json bench.json";

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct BenchArguments {
    #[command(flatten)]
    stream: super::StreamArgument,
    /// Write the figures as JSON.
    #[arg(long, value_name = "FILE")]
    json: PathBuf,
    /// Width and height of the picture in pixels.
    #[arg(long, value_name = "WxH", value_parser = super::parse_size, default_value = "1280x720")]
    size: (u32, u32),
    /// How many seeks to measure.
    #[arg(long, default_value_t = 12)]
    seeks: u32,
}

/// Milliseconds of repeated measurements.
#[derive(Serialize)]
struct Spread {
    count: usize,
    median_ms: f64,
    p95_ms: f64,
    max_ms: f64,
}

#[derive(Serialize)]
struct Figures {
    stream: String,
    adapter: String,
    width_px: u32,
    height_px: u32,
    frames: usize,
    time_to_first_frame_ms: f64,
    fetch_per_chunk: Spread,
    verify_per_chunk: Spread,
    decode_per_chunk: Spread,
    decode_geometry_per_frame: Spread,
    build_per_frame: Spread,
    upload_per_frame: Spread,
    draw_per_frame: Spread,
    seek_latency: Spread,
}

pub(super) fn run(arguments: &BenchArguments) -> anyhow::Result<()> {
    let started = Instant::now();
    let (runtime, stream) = super::open(&arguments.stream.stream)?;
    let people = stream.manifest.people.clone();
    let limits = *stream.limits();
    let gpu = Offscreen::open()?;
    let target = gpu.target(arguments.size.0, arguments.size.1)?;
    let mut renderer = Renderer::new(&gpu.device, &gpu.queue, &Stage::new(stream.manifest.pitch));
    let camera = Preset::Table
        .view(&stream.manifest.pitch, None, target.aspect())
        .context("the table view always exists")?;

    let (mut fetch, mut verify, mut decode) = (Samples::default(), Samples::default(), Samples::default());
    let (mut geometry, mut build) = (Samples::default(), Samples::default());
    let (mut upload, mut draw) = (Samples::default(), Samples::default());
    let mut first_frame = None;
    let mut keys = Vec::new();
    for index in 0..stream.chunks().len() {
        let loaded = runtime.block_on(stream.chunk(stream.best(), index))?;
        fetch.push(loaded.fetch);
        verify.push(loaded.verify);
        decode.push(loaded.decode);
        geometry.push(loaded.decode / loaded.chunk.frames().len().max(1) as u32);
        for place in 0..loaded.chunk.frames().len() {
            keys.push((index, place));
            let scene = build.time(|| {
                loaded.chunk.frame(place).map(|frame| FrameScene::new(&frame, &people, &limits)).transpose()
            });
            let scene = scene.with_context(|| stream.chunk_name(stream.best(), index))?;
            let scene = scene.context("the chunk has fewer frames than it says")?;
            upload.time(|| {
                renderer.upload(&gpu.device, &gpu.queue, &scene);
                gpu.queue.submit([]);
                gpu.finish()
            })?;
            draw.time(|| gpu.draw(&renderer, &target, &camera))?;
            first_frame.get_or_insert_with(|| started.elapsed());
        }
    }

    // A seek to a frame nothing is known of: fetch, verify, decode, build, upload, draw.
    let mut seek = Samples::default();
    for step in 0..arguments.seeks as usize {
        // A stride near the golden ratio visits the whole stream without pattern.
        let Some(&(index, place)) = keys.get((step * 618 + 309) % 1000 * keys.len() / 1000) else { break };
        seek.time(|| -> anyhow::Result<()> {
            let loaded = runtime.block_on(stream.chunk(stream.best(), index))?;
            let frame = loaded.chunk.frame(place).context("the stream changed while it was measured")?;
            let scene = FrameScene::new(&frame, &people, &limits)?;
            renderer.upload(&gpu.device, &gpu.queue, &scene);
            gpu.draw(&renderer, &target, &camera)?;
            Ok(())
        })?;
    }

    let figures = Figures {
        stream: arguments.stream.stream.clone(),
        adapter: gpu.adapter.clone(),
        width_px: arguments.size.0,
        height_px: arguments.size.1,
        frames: keys.len(),
        time_to_first_frame_ms: milliseconds(first_frame.unwrap_or_default()),
        fetch_per_chunk: fetch.spread(),
        verify_per_chunk: verify.spread(),
        decode_per_chunk: decode.spread(),
        decode_geometry_per_frame: geometry.spread(),
        build_per_frame: build.spread(),
        upload_per_frame: upload.spread(),
        draw_per_frame: draw.spread(),
        seek_latency: seek.spread(),
    };
    print(&figures);
    super::write_json(&arguments.json, &figures)
}

fn print(figures: &Figures) {
    println!("{} at {} × {} px on {}", figures.stream, figures.width_px, figures.height_px, figures.adapter);
    println!("  first frame after          {:8.1} ms", figures.time_to_first_frame_ms);
    for (name, spread) in [
        ("decode per frame", &figures.decode_geometry_per_frame),
        ("texture and scene", &figures.build_per_frame),
        ("upload per frame", &figures.upload_per_frame),
        ("draw per frame", &figures.draw_per_frame),
        ("seek to a shown frame", &figures.seek_latency),
    ] {
        println!("  {name:<24}   {:8.1} ms (95 %: {:.1} ms)", spread.median_ms, spread.p95_ms);
    }
}

fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

#[derive(Default)]
struct Samples(Vec<f64>);

impl Samples {
    fn push(&mut self, duration: Duration) {
        self.0.push(milliseconds(duration));
    }

    fn time<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let started = Instant::now();
        let result = work();
        self.push(started.elapsed());
        result
    }

    fn spread(mut self) -> Spread {
        self.0.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let index = ((self.0.len() as f64 - 1.0) * share).round().max(0.0) as usize;
            self.0.get(index).copied().unwrap_or_default()
        };
        Spread { count: self.0.len(), median_ms: at(0.5), p95_ms: at(0.95), max_ms: at(1.0) }
    }
}
