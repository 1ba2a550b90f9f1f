//! The work folder: results of costly stages, one file per frame, valid for the same clip, options and networks only.
//!
//! A stage's files lie in `STAGE-FINGERPRINT/`. The fingerprint covers everything that the results depend on, so a changed
//! option finds an empty folder and never a stale result. Files appear whole or not at all, and carry a hash.

use std::{
    fs, io,
    io::{Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
    time::UNIX_EPOCH,
};

use serde::{Serialize, de::DeserializeOwned};

use super::PipelineError;

/// Bytes of a clip's head and tail that its fingerprint covers, besides its length and time of change.
const SAMPLE_BYTES: u64 = 1 << 20;
/// Bytes of a record's hash.
const HASH_BYTES: usize = 32;

/// What results depend on, as a hash.
#[derive(Clone, Debug)]
pub(super) struct Fingerprint(blake3::Hasher);

impl Fingerprint {
    /// Of a clip's file.
    pub(super) fn of_clip(path: &Path) -> io::Result<Self> {
        let mut file = fs::File::open(path)?;
        let metadata = file.metadata()?;
        let changed = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        let mut sample = Vec::new();
        Read::by_ref(&mut file).take(SAMPLE_BYTES).read_to_end(&mut sample)?;
        file.seek(SeekFrom::Start(metadata.len().saturating_sub(SAMPLE_BYTES)))?;
        file.take(SAMPLE_BYTES).read_to_end(&mut sample)?;
        let start = Self(blake3::Hasher::new()).with(env!("CARGO_PKG_VERSION").as_bytes());
        Ok(start
            .with(&metadata.len().to_le_bytes())
            .with(&changed.unwrap_or_default().as_nanos().to_le_bytes())
            .with(&sample))
    }

    /// And of something more.
    pub(super) fn with(mut self, bytes: &[u8]) -> Self {
        // The length keeps "ab" + "c" apart from "a" + "bc".
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
        self
    }

    /// And of a whole file, such as a network.
    pub(super) fn with_file(self, path: &Path) -> Result<Self, PipelineError> {
        let hash = || -> io::Result<blake3::Hash> {
            Ok(blake3::Hasher::new().update_reader(fs::File::open(path)?)?.finalize())
        };
        match hash() {
            Ok(hash) => Ok(self.with(hash.as_bytes())),
            Err(source) => Err(PipelineError::Work { doing: "read", path: path.to_owned(), source }),
        }
    }

    /// And of this program: another build may compute something else.
    pub(super) fn with_program(self) -> Result<Self, PipelineError> {
        match std::env::current_exe() {
            Ok(program) => self.with_file(&program),
            Err(error) => {
                tracing::warn!("{error}: results of other builds of this version may be resumed");
                Ok(self)
            }
        }
    }

    fn name(&self) -> String {
        self.0.finalize().to_hex().chars().take(16).collect()
    }
}

/// The folder that results of stages are kept in.
#[derive(Debug)]
pub(super) struct WorkFolder {
    path: PathBuf,
    /// Removes the folder at the end when nobody asked to keep it.
    _temporary: Option<tempfile::TempDir>,
}

impl WorkFolder {
    /// The given folder, made when missing; a temporary one when `None`.
    pub(super) fn open(path: Option<&Path>) -> Result<Self, PipelineError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source| PipelineError::Work { doing: "create", path, source }
        };
        match path {
            Some(path) => {
                fs::create_dir_all(path).map_err(failed(path))?;
                Ok(Self { path: path.to_owned(), _temporary: None })
            }
            None => {
                let folder = tempfile::Builder::new()
                    .prefix("holopitch-")
                    .tempdir()
                    .map_err(failed(&std::env::temp_dir()))?;
                Ok(Self { path: folder.path().to_owned(), _temporary: Some(folder) })
            }
        }
    }

    /// The results of `stage` under `fingerprint`.
    pub(super) fn results(&self, stage: &str, fingerprint: &Fingerprint) -> Result<Results, PipelineError> {
        let path = self.path.join(format!("{stage}-{}", fingerprint.name()));
        match fs::create_dir_all(&path) {
            Ok(()) => Ok(Results { path }),
            Err(source) => Err(PipelineError::Work { doing: "create", path, source }),
        }
    }
}

/// Results of one stage, one record per frame.
#[derive(Debug)]
pub(super) struct Results {
    path: PathBuf,
}

impl Results {
    fn file(&self, index: usize) -> PathBuf {
        self.path.join(format!("{index:06}.bin"))
    }

    /// The record of a frame, when it was kept and is whole.
    pub(super) fn load<T: DeserializeOwned>(&self, index: usize) -> Option<T> {
        let path = self.file(index);
        let bytes = fs::read(&path).ok()?;
        let record = bytes.split_at_checked(HASH_BYTES).and_then(|(hash, payload)| {
            (blake3::hash(payload).as_bytes() == hash).then(|| postcard::from_bytes(payload).ok()).flatten()
        });
        if record.is_none() {
            tracing::warn!("{} is damaged; that frame is done again", path.display());
        }
        record
    }

    /// Keeps the record of a frame.
    pub(super) fn save<T: Serialize>(&self, index: usize, record: &T) -> Result<(), PipelineError> {
        let path = self.file(index);
        let write = || -> io::Result<()> {
            let payload = postcard::to_allocvec(record).map_err(io::Error::other)?;
            let mut file = tempfile::NamedTempFile::new_in(&self.path)?;
            file.write_all(blake3::hash(&payload).as_bytes())?;
            file.write_all(&payload)?;
            file.persist(&path)?;
            Ok(())
        };
        write().map_err(|source| PipelineError::Work { doing: "write", path, source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip(folder: &Path, bytes: &[u8]) -> PathBuf {
        let path = folder.join("clip.mp4");
        fs::write(&path, bytes).unwrap();
        path
    }

    #[test]
    fn records_come_back_and_other_options_do_not_see_them() {
        let folder = tempfile::tempdir().unwrap();
        let work = WorkFolder::open(Some(&folder.path().join("work"))).unwrap();
        let fingerprint = Fingerprint::of_clip(&clip(folder.path(), b"frames")).unwrap();
        let results = work.results("pose", &fingerprint).unwrap();
        results.save(3, &vec![1.5_f32, 2.5]).unwrap();
        assert_eq!(results.load::<Vec<f32>>(3), Some(vec![1.5, 2.5]));
        assert_eq!(results.load::<Vec<f32>>(4), None);
        let other = work.results("pose", &fingerprint.clone().with(b"option")).unwrap();
        assert_eq!(other.load::<Vec<f32>>(3), None);
        let again = work.results("pose", &fingerprint).unwrap();
        assert!(again.load::<Vec<f32>>(3).is_some());
    }

    #[test]
    fn a_damaged_record_is_no_record() {
        let folder = tempfile::tempdir().unwrap();
        let work = WorkFolder::open(Some(folder.path())).unwrap();
        let fingerprint = Fingerprint::of_clip(&clip(folder.path(), b"frames")).unwrap();
        let results = work.results("depth", &fingerprint).unwrap();
        results.save(0, &vec![7_u64; 50]).unwrap();
        let path = results.file(0);
        let whole = fs::read(&path).unwrap();
        for damage in [0, HASH_BYTES, whole.len() - 1] {
            let mut bytes = whole.clone();
            bytes[damage] ^= 1;
            fs::write(&path, &bytes).unwrap();
            assert_eq!(results.load::<Vec<u64>>(0), None, "flipped byte {damage}");
        }
        for length in [0, 5, whole.len() - 1] {
            fs::write(&path, &whole[..length]).unwrap();
            assert_eq!(results.load::<Vec<u64>>(0), None, "cut to {length} bytes");
        }
    }

    #[test]
    fn another_clip_has_another_fingerprint() {
        let folder = tempfile::tempdir().unwrap();
        let first = Fingerprint::of_clip(&clip(folder.path(), b"one")).unwrap().name();
        let second = Fingerprint::of_clip(&clip(folder.path(), b"two")).unwrap().name();
        assert_ne!(first, second);
        assert!(Fingerprint::of_clip(&folder.path().join("missing")).is_err());
    }

    #[test]
    fn a_work_folder_that_cannot_be_made_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, b"").unwrap();
        let error = WorkFolder::open(Some(&file.join("work"))).unwrap_err();
        assert!(error.to_string().contains("work"), "{error}");
    }
}
