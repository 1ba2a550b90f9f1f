//! `player inspect`: what a stream holds, how large its parts are, and whether every file is what the manifest says.

use std::{
    io::{self, Write},
    path::PathBuf,
};

use anyhow::Context;
use protocol::{
    chunk::{self, ChunkError},
    compact,
    content::AnyChunk,
    limits::Limits,
};
use serde::Serialize;

use player::source::LoadedChunk;

const EXAMPLES: &str = "Examples:
  player inspect target/demo/stream
  player inspect http://localhost:8080/ --json figures.json";

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct InspectArguments {
    #[command(flatten)]
    stream: super::StreamArgument,
    /// Write the figures as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Figures of a stream; units in the names.
#[derive(Serialize)]
struct Figures {
    stream: String,
    representation: String,
    pitch_length_m: f64,
    pitch_width_m: f64,
    duration_s: f64,
    chunks: usize,
    frames: usize,
    first_clip_frame: Option<u32>,
    last_clip_frame: Option<u32>,
    frames_with_camera: usize,
    frames_with_ball: usize,
    people: usize,
    body_frames: usize,
    people_per_frame_mean: f64,
    triangles: usize,
    manifest_bytes: usize,
    chunk_bytes: usize,
    geometry_bytes: usize,
    texture_bytes: usize,
    /// How points and textures change, in compact chunks.
    motion_bytes: usize,
    index_bytes: usize,
    bytes_per_body_frame: f64,
    megabits_per_second: f64,
    hashes_verified: usize,
}

pub(super) fn run(arguments: &InspectArguments) -> anyhow::Result<()> {
    let (runtime, stream) = super::open(&arguments.stream.stream)?;
    let manifest = &stream.manifest;
    let mut figures = Figures {
        stream: arguments.stream.stream.clone(),
        representation: stream.representation().to_owned(),
        pitch_length_m: manifest.pitch.length_m,
        pitch_width_m: manifest.pitch.width_m,
        duration_s: manifest.timescale.seconds(manifest.duration),
        chunks: stream.chunks().len(),
        frames: 0,
        first_clip_frame: None,
        last_clip_frame: None,
        frames_with_camera: 0,
        frames_with_ball: 0,
        people: manifest.people.len(),
        body_frames: 0,
        people_per_frame_mean: 0.0,
        triangles: 0,
        manifest_bytes: stream.manifest_bytes,
        chunk_bytes: 0,
        geometry_bytes: 0,
        texture_bytes: 0,
        motion_bytes: 0,
        index_bytes: 0,
        bytes_per_body_frame: 0.0,
        megabits_per_second: 0.0,
        hashes_verified: 0,
    };
    for index in 0..stream.chunks().len() {
        let loaded = runtime.block_on(stream.chunk(stream.best(), index))?;
        figures.hashes_verified += 1;
        figures.chunk_bytes += loaded.file.len();
        figures
            .add_bytes(&loaded, stream.limits())
            .with_context(|| stream.chunk_name(stream.best(), index))?;
        for place in 0..loaded.chunk.frames().len() {
            let Some(frame) = loaded.chunk.frame(place) else { continue };
            figures.frames += 1;
            figures.first_clip_frame.get_or_insert(frame.clip_frame);
            figures.last_clip_frame = Some(frame.clip_frame);
            figures.frames_with_camera += usize::from(frame.camera.is_some());
            figures.frames_with_ball += usize::from(frame.ball.is_some());
            figures.body_frames += frame.bodies.len();
            figures.triangles += frame.bodies.iter().map(|body| body.mesh.triangles.len()).sum::<usize>();
        }
    }
    let ratio = |part: usize, whole: f64| if whole > 0.0 { part as f64 / whole } else { 0.0 };
    figures.people_per_frame_mean = ratio(figures.body_frames, figures.frames as f64);
    figures.bytes_per_body_frame = ratio(figures.chunk_bytes, figures.body_frames as f64);
    figures.megabits_per_second = ratio(figures.chunk_bytes * 8, figures.duration_s * 1e6);
    // Whoever reads may stop early (`player inspect S | head`): that is no failure.
    match print(&figures, &mut io::stdout().lock()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => return Err(error.into()),
        _ => {}
    }
    if let Some(path) = &arguments.json {
        super::write_json(path, &figures)?;
    }
    Ok(())
}

impl Figures {
    /// Adds how the bytes of a chunk divide.
    fn add_bytes(&mut self, loaded: &LoadedChunk, limits: &Limits) -> Result<(), ChunkError> {
        match &loaded.chunk {
            AnyChunk::Plain(_) => {
                let split = chunk::byte_split(&loaded.file, limits)?;
                self.geometry_bytes += split.geometry;
                self.texture_bytes += split.texture;
                self.index_bytes += split.index;
            }
            AnyChunk::Compact(_) => {
                let parts = compact::byte_parts(&loaded.file, limits)?;
                self.geometry_bytes += parts.rest;
                self.motion_bytes += parts.motion;
                self.index_bytes += parts.head + parts.index;
            }
        }
        Ok(())
    }
}

fn print(figures: &Figures, out: &mut impl Write) -> io::Result<()> {
    let share = |bytes: usize| 100.0 * bytes as f64 / figures.chunk_bytes.max(1) as f64;
    writeln!(out, "{}", figures.stream)?;
    writeln!(out, "  pitch      {} × {} m", figures.pitch_length_m, figures.pitch_width_m)?;
    let clip = figures.first_clip_frame.zip(figures.last_clip_frame);
    let clip = clip.map_or(String::new(), |(first, last)| format!(", clip frames {first} to {last}"));
    writeln!(
        out,
        "  length     {:.2} s, {} frames in {} chunks{clip}",
        figures.duration_s, figures.frames, figures.chunks
    )?;
    writeln!(
        out,
        "  people     {}, {:.1} per frame with a mesh, {} triangles each on average",
        figures.people,
        figures.people_per_frame_mean,
        figures.triangles / figures.body_frames.max(1)
    )?;
    writeln!(
        out,
        "  camera     in {} of {} frames; ball in {}",
        figures.frames_with_camera, figures.frames, figures.frames_with_ball
    )?;
    writeln!(
        out,
        "  bytes      {} in chunks: {:.0} % geometry, {:.0} % texture, {:.0} % motion, {:.0} % index; {:.0} per person and frame",
        figures.chunk_bytes,
        share(figures.geometry_bytes),
        share(figures.texture_bytes),
        share(figures.motion_bytes),
        share(figures.index_bytes),
        figures.bytes_per_body_frame
    )?;
    writeln!(out, "  rate       {:.2} Mbit/s ({})", figures.megabits_per_second, figures.representation)?;
    writeln!(
        out,
        "  hashes     {} of {} chunks as the manifest says",
        figures.hashes_verified, figures.chunks
    )
}
