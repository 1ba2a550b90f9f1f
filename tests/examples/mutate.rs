//! Streams changed at random through everything that reads them: `mutate [EXECUTIONS] [SEED]`.
//!
//! Manifests, plain and compact chunks, and the scenes that the player makes of them. Every execution has a seed of its own; one that panics, takes more
//! than a second or makes the process larger than 256 MiB is told by it, and its bytes are written beside the caller.

// The tool reports what panics; it may itself give up.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    time::{Duration, Instant},
};

use player::scene::FrameScene;
use protocol::{chunk, compact, content::AnyChunk, limits::Limits, manifest::Manifest, sample};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// What an execution may take.
const LONGEST: Duration = Duration::from_secs(1);
const LARGEST_KIB: u64 = 256 << 10;

fn main() {
    let mut arguments = std::env::args().skip(1).map(|argument| argument.parse().expect("a number"));
    let (executions, first) = (arguments.next().unwrap_or(100_000), arguments.next().unwrap_or(1));
    let seeds: Vec<Vec<u8>> = originals();
    let (mut read, mut longest, mut finds) = (0u64, Duration::ZERO, 0u64);
    std::panic::set_hook(Box::new(|_| ()));
    for seed in first..first + executions {
        let bytes = changed(&seeds, seed);
        let started = Instant::now();
        let result = catch_unwind(AssertUnwindSafe(|| read_all(&bytes)));
        let took = started.elapsed();
        longest = longest.max(took);
        read += u64::from(matches!(result, Ok(true)));
        if result.is_err() || took > LONGEST {
            finds += 1;
            let name = format!("find-{seed}.bin");
            println!(
                "seed {seed}: {} after {took:?}; bytes in {name}",
                if result.is_err() { "panic" } else { "hang" }
            );
            std::fs::write(name, &bytes).expect("a place for finds");
        }
    }
    let peak = peak_kib();
    println!(
        "{executions} executions from seed {first}: {read} read whole, longest {longest:?}, peak {} MiB, {finds} finds",
        peak >> 10
    );
    assert!(finds == 0 && peak <= LARGEST_KIB, "see above");
}

/// A manifest, and chunks of both profiles.
fn originals() -> Vec<Vec<u8>> {
    let sample = sample::match_of(8, 3).unwrap();
    let plain = chunk::encode(&sample::chunk_of(0, 3, 2), sample::TIMESCALE).unwrap();
    let compact = |frames, people| {
        compact::encode(&sample::sequence_of(0, frames, people), sample::TIMESCALE, &compact::Quality::HIGH)
            .unwrap()
    };
    vec![sample.manifest.to_json().unwrap().into_bytes(), plain, compact(3, 2), compact(8, 1)]
}

/// One of the originals with a few changes: bytes set, bits turned, pieces cut, doubled, or taken from another place.
fn changed(originals: &[Vec<u8>], seed: u64) -> Vec<u8> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut bytes = originals[random.random_range(0..originals.len())].clone();
    for _ in 0..random.random_range(1..6) {
        let at = random.random_range(0..bytes.len().max(1)).min(bytes.len().saturating_sub(1));
        match random.random_range(0..8) {
            0 => bytes.truncate(at),
            1 => {
                let end = (at + random.random_range(1..40)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            2 => {
                let end = (at + random.random_range(1..40)).min(bytes.len());
                bytes.drain(at..end);
            }
            3 | 4 if at < bytes.len() => bytes[at] ^= 1 << random.random_range(0..8),
            5 if at < bytes.len() => bytes[at] = [0, 1, 0x7F, 0x80, 0xFF][random.random_range(0..5)],
            _ if at < bytes.len() => bytes[at] = random.random(),
            _ => {}
        }
        if bytes.is_empty() {
            break;
        }
    }
    bytes
}

/// Whether the bytes were read to their end as something.
fn read_all(bytes: &[u8]) -> bool {
    let limits = Limits::default();
    if let Ok(manifest) = Manifest::from_json(bytes, &limits) {
        return manifest.best().is_some();
    }
    let Ok(chunk) = AnyChunk::decode(bytes, &limits) else { return false };
    (0..chunk.frames().len()).all(|index| {
        let frame = chunk.frame(index).expect("a frame that there is");
        FrameScene::new(&frame, &[], &limits).is_ok()
    })
}

/// The largest the process has been, KiB.
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(0)
}
