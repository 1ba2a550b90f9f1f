//! Training and test pictures for the depth network: one player per crop, with mask, depth offset and joints.
//!
//! Every sample is drawn from its own seed, so the same options give the same bytes on any machine and thread count.
//! `Split` holds out whole actions, bodies and kits.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::{
    SynthesisError,
    body::BaseBody,
    gait,
    motion::Motions,
    npy,
    output::{make_folder, put},
};

mod cast;
mod frames;
mod sample;

use cast::Cast;
pub use frames::{FrameOptions, PER_MATCH, broadcast_frames, usual_kinds};
pub use sample::{Sample, SampleMeta, aim, plane_depth};

/// Side of a crop and of its mask, pixels.
pub const CROP: usize = 256;
/// Side of the depth offsets: every second pixel of the crop, at crop pixels 0.5, 2.5, 4.5 …
pub const OFFSETS: usize = 128;
/// Marks an offset where the person is not seen.
pub const NO_OFFSET: i16 = i16::MIN;

/// Which players are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// For training.
    Train,
    /// To choose among what was trained.
    Validation,
    /// Never trained on, never chosen by.
    Test,
}

/// What to write.
#[derive(Clone, Debug)]
pub struct DepthOptions {
    /// Folder for the shards; made when missing.
    pub out: PathBuf,
    /// Samples in all.
    pub count: usize,
    /// Samples per shard.
    pub shard: usize,
    /// Everything random follows from it.
    pub seed: u64,
    /// Who is drawn.
    pub split: Split,
    /// A file with more motions; the shipped ones when absent.
    pub motions: Option<PathBuf>,
    /// Height of the players in the picture, pixels: smallest and largest.
    pub height_px: [f32; 2],
    /// Shirt numbers: lowest and highest.
    pub numbers: [u8; 2],
}

/// Writes the shards; `progress` is called with the number of finished samples. A finished shard (its `meta.jsonl` is
/// written last) is kept when the command runs again.
pub fn depth_crops(options: &DepthOptions, progress: impl Fn(usize) + Sync) -> Result<(), SynthesisError> {
    let [low, high] = options.height_px;
    let [lowest, highest] = options.numbers;
    if !(1..=99).contains(&lowest) || !(lowest..=99).contains(&highest) {
        return Err(SynthesisError::Options("shirt numbers must be of 1 to 99 and in order".into()));
    }
    if options.shard == 0 || options.count == 0 || !(low > 4.0 && high >= low && high < 1000.0) {
        return Err(SynthesisError::Options(
            "count, shard size and player heights must be positive and in order".into(),
        ));
    }
    let base = BaseBody::load()?;
    let motions = match &options.motions {
        Some(path) => Motions::open(path)?,
        None => Motions::shipped()?,
    };
    let actions = gait::repertoire(&motions, options.split);
    for (shard, first) in (0..options.count).step_by(options.shard).enumerate() {
        let folder = options.out.join(format!("shard-{shard:04}"));
        let last = (first + options.shard).min(options.count);
        if folder.join("meta.jsonl").exists() {
            progress(last);
            continue;
        }
        make_folder(&folder)?;
        let cast = Cast::new(&base, options, shard, (options.shard / 5).clamp(8, 128));
        let samples: Vec<Sample> = (first..last)
            .into_par_iter()
            .map(|index| {
                let made = sample::draw(options, index, &cast, &actions);
                progress(index + 1);
                made
            })
            .collect::<Result<_, _>>()?;
        write_shard(&folder, &samples)?;
    }
    Ok(())
}

fn write_shard(folder: &Path, samples: &[Sample]) -> Result<(), SynthesisError> {
    let count = samples.len();
    let crops: Vec<u8> = samples.iter().flat_map(|s| s.crop.as_raw().iter().copied()).collect();
    npy::write(&folder.join("crops.npy"), "|u1", &[count, CROP, CROP, 3], &crops)?;
    let masks: Vec<u8> = samples.iter().flat_map(|s| s.mask.iter().copied()).collect();
    npy::write(&folder.join("mask.npy"), "|u1", &[count, CROP, CROP], &masks)?;
    let plane = |name: &str, of: fn(&Sample) -> &[i16]| {
        let bytes: Vec<u8> = samples.iter().flat_map(of).flat_map(|offset| offset.to_le_bytes()).collect();
        npy::write(&folder.join(name), "<i2", &[count, OFFSETS, OFFSETS], &bytes)
    };
    plane("offset_mm.npy", |sample| &sample.offsets_mm)?;
    plane("front_mm.npy", |sample| &sample.front_mm)?;
    plane("back_mm.npy", |sample| &sample.back_mm)?;
    let mut lines = Vec::new();
    for sample in samples {
        serde_json::to_writer(&mut lines, &sample.meta)
            .map_err(|error| SynthesisError::Options(error.to_string()))?;
        lines.push(b'\n');
    }
    put(&folder.join("meta.jsonl"), &lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn options(out: &Path, split: Split) -> DepthOptions {
        DepthOptions {
            out: out.to_owned(),
            count: 6,
            shard: 4,
            seed: 11,
            split,
            motions: None,
            height_px: [40.0, 120.0],
            numbers: [1, 39],
        }
    }

    #[test]
    fn a_set_is_the_same_twice_and_its_splits_share_nobody() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, split| {
            let out = folder.path().join(name);
            depth_crops(&options(&out, split), |_| ()).unwrap();
            (
                std::fs::read(out.join("shard-0001/crops.npy")).unwrap(),
                std::fs::read_to_string(out.join("shard-0001/meta.jsonl")).unwrap(),
            )
        };
        let (first, train) = write("a", Split::Train);
        assert_eq!(first.len(), 128 + 2 * CROP * CROP * 3);
        assert_eq!(write("b", Split::Train), (first, train.clone()));
        let (_, test) = write("c", Split::Test);
        let names = |text: &str, key: &str| -> Vec<String> {
            text.lines()
                .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap()[key].to_string())
                .collect()
        };
        let (_, validation) = write("d", Split::Validation);
        for key in ["body", "kit", "motion"] {
            for (a, b) in [(&train, &test), (&train, &validation), (&validation, &test)] {
                let held_out = names(b, key);
                assert!(names(a, key).iter().all(|name| !held_out.contains(name)), "{key} is in two parts");
            }
        }
    }
}
