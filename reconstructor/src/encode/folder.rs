//! The folder of a stream: chunks of every representation, the pitch, and at last the manifest.

use std::{
    fs,
    path::{Path, PathBuf},
};

use protocol::{
    chunk::{self, Chunk, Quantisation},
    compact::{self, Run, Sequence},
    hash,
    limits::Limits,
    manifest::{self, ChunkEntry, FileEntry, Manifest, Profile, Representation},
    time::Timescale,
};
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::{
    EncodeError, FileError, files,
    ladder::{LADDER, Rung},
};

/// The one quality of the plain profile, and its folder.
const PLAIN: &str = "high";
/// The file of the pitch.
const STATIC_SCENE: &str = "static.glb";

/// What a chunk holds.
pub(super) enum Content {
    /// For the compact profile.
    Runs(Sequence),
    /// For the plain profile, and how finely it is rounded.
    Frames(Chunk, Quantisation),
}

/// A stream's folder that has no manifest yet.
#[derive(Debug)]
pub(super) struct StreamFolder {
    folder: PathBuf,
    timescale: Timescale,
    static_scene: Option<FileEntry>,
    /// Those of the ladder, or the plain one.
    representations: Vec<Representation>,
}

impl StreamFolder {
    /// Prepares `folder`, which may hold an older stream: its manifest goes first, so that no reader ever sees a manifest
    /// with other chunks than its own.
    pub(super) fn create(
        folder: &Path,
        timescale: Timescale,
        profile: Profile,
        static_scene: Option<&[u8]>,
    ) -> Result<Self, EncodeError> {
        files::create_folder(folder)?;
        files::remove(&folder.join(manifest::FILE_NAME))?;
        for rung in LADDER {
            remove_old_chunks(&folder.join(rung.id))?;
        }
        let (profile, names) = match profile {
            Profile::Compact => (profile, LADDER.iter().map(|rung| rung.id).collect()),
            // What readers do not know is not written.
            Profile::Plain | Profile::Other => (Profile::Plain, vec![PLAIN]),
        };
        for name in &names {
            files::create_folder(&folder.join(name))?;
        }
        if let Some(bytes) = static_scene {
            files::write(&folder.join(STATIC_SCENE), bytes)?;
        }
        let representation = |id: &str| Representation {
            id: id.to_owned(),
            profile,
            triangles_per_body: 0,
            chunks: Vec::new(),
        };
        Ok(Self {
            folder: folder.to_owned(),
            timescale,
            static_scene: static_scene.map(|bytes| hash::entry(STATIC_SCENE, bytes)),
            representations: names.into_iter().map(representation).collect(),
        })
    }

    /// Writes the next chunk of every representation. Nothing is written of a chunk without frames.
    pub(super) fn put(&mut self, content: &Content) -> Result<(), EncodeError> {
        let frames = match content {
            Content::Runs(sequence) => &sequence.frames,
            Content::Frames(chunk, _) => &chunk.frames,
        };
        let (Some(first), Some(last)) = (frames.first(), frames.last()) else { return Ok(()) };
        let (start, duration) = (first.start, last.start + last.duration - first.start);
        let encoded = match content {
            Content::Runs(sequence) => {
                LADDER.iter().map(|rung| on_rung(rung, sequence, self.timescale)).collect()
            }
            Content::Frames(chunk, quantisation) => {
                vec![(chunk::encode_with(chunk, self.timescale, *quantisation), most_triangles(chunk))]
            }
        };
        for (representation, (bytes, triangles)) in self.representations.iter_mut().zip(encoded) {
            let name = format!("{}/{:05}.glb", representation.id, representation.chunks.len());
            let path = self.folder.join(&name);
            let bytes = bytes.map_err(|source| EncodeError::Chunk { path: path.clone(), source })?;
            files::write(&path, &bytes)?;
            let triangles = u32::try_from(triangles).unwrap_or(u32::MAX);
            representation.triangles_per_body = representation.triangles_per_body.max(triangles);
            representation.chunks.push(ChunkEntry { file: hash::entry(name, &bytes), start, duration });
        }
        Ok(())
    }

    /// Writes the manifest, with the files that are there; returns it.
    pub(super) fn finish(self, manifest: Manifest) -> Result<Manifest, EncodeError> {
        let manifest = Manifest {
            format: manifest::FORMAT.to_owned(),
            version: manifest::VERSION.to_owned(),
            static_scene: self.static_scene,
            representations: self.representations,
            ..manifest
        };
        // What a reader would refuse is not worth writing.
        manifest.validate(&Limits::default())?;
        files::write(&self.folder.join(manifest::FILE_NAME), manifest.to_json()?.as_bytes())?;
        Ok(manifest)
    }
}

/// The chunk of a rung, and the triangles of its largest mesh.
fn on_rung(
    rung: &Rung,
    sequence: &Sequence,
    timescale: Timescale,
) -> (Result<Vec<u8>, chunk::ChunkError>, usize) {
    let runs: Vec<Run> = sequence.runs.par_iter().map(|run| rung.of(run)).collect();
    let triangles = runs.iter().map(|run| run.mesh.triangles.len()).max().unwrap_or(0);
    let kept = Sequence { frames: sequence.frames.clone(), runs };
    (compact::encode(&kept, timescale, &rung.quality), triangles)
}

fn most_triangles(chunk: &Chunk) -> usize {
    let bodies = chunk.frames.iter().flat_map(|frame| &frame.bodies);
    bodies.map(|body| body.mesh.triangles.len()).max().unwrap_or(0)
}

/// Removes `00000.glb` and so on: an older stream may have had more of them, or other qualities.
fn remove_old_chunks(folder: &Path) -> Result<(), FileError> {
    if !folder.is_dir() {
        return Ok(());
    }
    for entry in fs::read_dir(folder).map_err(FileError::new("read", folder))? {
        let path = entry.map_err(FileError::new("read", folder))?.path();
        let number = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        let is_chunk = path.extension().is_some_and(|extension| extension == "glb")
            && number.len() >= 5
            && number.bytes().all(|digit| digit.is_ascii_digit());
        if is_chunk {
            files::remove(&path)?;
        }
    }
    Ok(())
}
