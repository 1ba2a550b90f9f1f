//! Writes the truth of a clip while it is rendered, frame by frame, so that a long match needs no more memory than a short one.

use std::{
    fs::File,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

use protocol::chunk::ChunkFrame;

use super::{FrameTruth, MARKING_NAMES, Maps, StreamWriter, Truth, mot, people_truth};
use crate::{
    SynthesisError,
    fixture::Fixture,
    output::{make_folder, put},
};

/// What is written.
#[derive(Clone, Copy, Debug)]
pub struct TruthOptions {
    /// Frames per second.
    pub frame_rate: u32,
    /// Picture size.
    pub size_px: (u32, u32),
    /// Triangles of each true surface, about.
    pub triangles: u32,
    /// Whether `maps/` is written.
    pub maps: bool,
}

/// Writes the files of the truth into one folder.
pub struct TruthWriter {
    folder: PathBuf,
    options: TruthOptions,
    stream: StreamWriter,
    frames: BufWriter<File>,
    tracks: BufWriter<File>,
    count: usize,
    bytes: u64,
}

impl TruthWriter {
    /// Begins in `folder`, which is made.
    pub fn create(folder: &Path, options: TruthOptions) -> Result<Self, SynthesisError> {
        make_folder(&folder.join("mot/gt"))?;
        if options.maps {
            make_folder(&folder.join("maps"))?;
        }
        Ok(Self {
            folder: folder.to_owned(),
            options,
            stream: StreamWriter::create(&folder.join("truth"), options.frame_rate)?,
            frames: open(&folder.join("frames.jsonl"))?,
            tracks: open(&folder.join("mot/gt/gt.txt"))?,
            count: 0,
            bytes: 0,
        })
    }

    /// Adds the next frame.
    pub fn push(
        &mut self,
        truth: &FrameTruth,
        maps: Option<&Maps>,
        surfaces: ChunkFrame,
    ) -> Result<(), SynthesisError> {
        let mut line =
            serde_json::to_vec(truth).map_err(|error| SynthesisError::Options(error.to_string()))?;
        line.push(b'\n');
        let failed =
            |path: &str, source| SynthesisError::Io { path: self.folder.join(path), doing: "write", source };
        self.frames.write_all(&line).map_err(|source| failed("frames.jsonl", source))?;
        let tracks = mot::lines(truth);
        self.tracks.write_all(tracks.as_bytes()).map_err(|source| failed("mot/gt/gt.txt", source))?;
        self.bytes += (line.len() + tracks.len()) as u64;
        if let Some(maps) = maps.filter(|_| self.options.maps) {
            for (kind, file) in maps.files()? {
                put(&self.folder.join(format!("maps/{:06}-{kind}.png", truth.frame)), &file)?;
                self.bytes += file.len() as u64;
            }
        }
        self.stream.push(surfaces)?;
        self.count += 1;
        Ok(())
    }

    /// Writes what holds for the whole clip; returns the bytes of everything the truth takes.
    pub fn finish(mut self, fixture: &Fixture) -> Result<u64, SynthesisError> {
        let TruthOptions { frame_rate, size_px: (width, height), triangles, .. } = self.options;
        for (file, path) in [(&mut self.frames, "frames.jsonl"), (&mut self.tracks, "mot/gt/gt.txt")] {
            let path = self.folder.join(path);
            file.flush().map_err(|source| SynthesisError::Io { path, doing: "write", source })?;
        }
        let sequence = mot::sequence(self.count, frame_rate, [width, height]);
        put(&self.folder.join("mot/seqinfo.ini"), sequence.as_bytes())?;
        let truth = Truth {
            frame_rate: [frame_rate, 1],
            frames: self.count,
            pitch: fixture.stadium.pitch,
            people: people_truth(&fixture.members),
            markings: MARKING_NAMES,
        };
        let mut text = serde_json::to_string_pretty(&truth)
            .map_err(|error| SynthesisError::Options(error.to_string()))?;
        text.push('\n');
        put(&self.folder.join("truth.json"), text.as_bytes())?;
        Ok(self.bytes + text.len() as u64 + self.stream.finish(fixture, triangles)?)
    }
}

fn open(path: &Path) -> Result<BufWriter<File>, SynthesisError> {
    let file = File::create(path);
    Ok(BufWriter::new(file.map_err(|source| SynthesisError::Io {
        path: path.to_owned(),
        doing: "create",
        source,
    })?))
}
