//! How well it plays, in figures.

use std::time::Duration;

/// What happened since playback was created, and how it stands now.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stats {
    /// When the first frame could be shown, on the clock of `now`.
    pub first_frame_at: Option<Duration>,
    /// How often running time had to stop for want of data; waiting after a start or a seek is not counted.
    pub stalls: u32,
    /// How long it stood for that altogether, a stall that goes on included.
    pub stalled: Duration,
    /// Bytes of all chunks that came, those that nobody waited for any more included.
    pub bytes: u64,
    /// How often another representation was chosen than before.
    pub switches: u32,
    /// The representation chosen last.
    pub representation: Option<usize>,
    /// Throughput of the link, bits per second, once it was measured.
    pub bits_per_second: Option<u64>,
    /// Match time at hand without a hole, from the play head on.
    pub ahead: Duration,
    /// Bytes of chunks' files at hand and on their way.
    pub buffered_bytes: u64,
    /// Of a live stream: match time between the play head and the end of the newest chunk.
    pub latency: Option<Duration>,
}

/// What is counted on the way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counters {
    pub(super) first_frame_at: Option<Duration>,
    pub(super) bytes: u64,
    stalls: u32,
    stalled: Duration,
    since: Option<Duration>,
}

impl Counters {
    pub(super) fn stall_begins(&mut self, now: Duration) {
        if self.since.is_none() {
            self.stalls += 1;
            self.since = Some(now);
        }
    }

    pub(super) fn stall_ends(&mut self, now: Duration) {
        if let Some(since) = self.since.take() {
            self.stalled += now.saturating_sub(since);
        }
    }

    /// The counters as figures.
    pub(super) fn at(&self, now: Duration) -> Stats {
        let going_on = self.since.map_or(Duration::ZERO, |since| now.saturating_sub(since));
        Stats {
            first_frame_at: self.first_frame_at,
            stalls: self.stalls,
            stalled: self.stalled + going_on,
            bytes: self.bytes,
            ..Stats::default()
        }
    }
}
