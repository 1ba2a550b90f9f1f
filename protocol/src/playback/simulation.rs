//! A made-up match, a made-up network and a clock that nobody waits for: minutes of watching in milliseconds.
//!
//! For tests and for benches (feature `sample`). [`Scenario::all`] is what is measured; [`Scenario::run`] watches one and
//! returns its figures and a trace of what happened when. `cargo run -p protocol --features sample --example
//! watch_made_up_match` prints them.

mod link;
mod matches;
mod scenarios;
mod viewer;

use std::{fmt, time::Duration};

use serde::Serialize;

pub use self::{
    link::{Fault, FaultKind, Link},
    matches::{FRAME, FakeContent, MadeUpMatch, TIMESCALE},
    scenarios::{Action, Outcome, Scenario},
    viewer::Viewer,
};
use super::{FailureKind, PlaybackState};

/// Something that happened, and when.
#[derive(Clone, Debug, PartialEq)]
pub struct TraceLine {
    /// Since the viewer opened the address.
    pub at: Duration,
    /// What.
    pub event: TraceEvent,
}

/// Something that happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TraceEvent {
    /// The manifest came; it names so many chunks.
    Manifest {
        /// Chunks.
        chunks: usize,
    },
    /// A chunk was asked for.
    Asked {
        /// Which.
        chunk: usize,
        /// In which quality.
        representation: usize,
    },
    /// A chunk came and was decoded.
    Came {
        /// Which.
        chunk: usize,
        /// In which quality.
        representation: usize,
        /// How long the transfer took.
        took: Duration,
    },
    /// A chunk could not be fetched or decoded.
    Failed {
        /// Which.
        chunk: usize,
        /// How.
        kind: FailureKind,
    },
    /// A request is not waited for any more.
    Dropped {
        /// Which.
        chunk: usize,
    },
    /// The first frame is on show.
    FirstFrame,
    /// Playback does something else than before.
    State(PlaybackState),
    /// The user did something.
    User(Action),
}

impl fmt::Display for TraceLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:9.3} s  ", self.at.as_secs_f64())?;
        match self.event {
            TraceEvent::Manifest { chunks } => write!(f, "manifest with {chunks} chunks"),
            TraceEvent::Asked { chunk, representation } => {
                write!(f, "chunk {chunk} asked for in quality {representation}")
            }
            TraceEvent::Came { chunk, representation, took } => {
                write!(f, "chunk {chunk} came in quality {representation} after {} ms", took.as_millis())
            }
            TraceEvent::Failed { chunk, kind } => write!(f, "chunk {chunk} failed: {kind:?}"),
            TraceEvent::Dropped { chunk } => write!(f, "chunk {chunk} not waited for any more"),
            TraceEvent::FirstFrame => write!(f, "first frame"),
            TraceEvent::State(state) => write!(f, "{state:?}"),
            TraceEvent::User(action) => write!(f, "user: {action:?}"),
        }
    }
}

/// How well it went.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The scenario.
    pub name: String,
    /// From the address to the first frame, milliseconds.
    pub first_frame_ms: Option<f64>,
    /// How often running time had to stop for want of data.
    pub stalls: u32,
    /// For how long altogether, milliseconds.
    pub stalled_ms: f64,
    /// How often the quality changed.
    pub switches: u32,
    /// Share of the match time shown in every quality, best last.
    pub shown_in: Vec<f64>,
    /// Bytes of the chunks that came.
    pub bytes: u64,
    /// Requests made.
    pub requests: usize,
    /// Longest way from a request that the user made (a seek) to its frame, milliseconds.
    pub longest_seek_ms: Option<f64>,
    /// Measured throughput at the end, bits per second.
    pub bits_per_second: Option<u64>,
    /// Match time at hand at the end, milliseconds.
    pub ahead_ms: f64,
    /// Most bytes that were at hand and on their way at once.
    pub most_buffered_bytes: u64,
    /// Of a live stream: distance from the newest chunk's end when it was left, and the largest while time ran,
    /// milliseconds.
    pub latency_ms: Option<f64>,
    /// See `latency_ms`.
    pub largest_latency_ms: Option<f64>,
    /// What playback was doing at the end.
    pub state: String,
    /// Whether playback asked to be woken in the past without having anything to do: a fault.
    pub busy: bool,
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.0} ms"));
        let shares: Vec<String> =
            self.shown_in.iter().map(|share| format!("{:.0} %", share * 100.0)).collect();
        write!(
            f,
            "{}: first frame {}, {} stalls ({:.0} ms), {} switches, quality {}, {:.1} MB in {} requests, longest seek \
             {}, latency {} (at most {}), at most {:.1} MB buffered, {}",
            self.name,
            ms(self.first_frame_ms),
            self.stalls,
            self.stalled_ms,
            self.switches,
            shares.join(" / "),
            self.bytes as f64 / 1e6,
            self.requests,
            ms(self.longest_seek_ms),
            ms(self.latency_ms),
            ms(self.largest_latency_ms),
            self.most_buffered_bytes as f64 / 1e6,
            self.state,
        )
    }
}
