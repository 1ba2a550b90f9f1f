//! What the caller may choose.

use std::time::Duration;

use super::clock::Speed;

/// How much is fetched ahead, in which quality, how patiently, and what happens where nothing can be shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaybackConfig {
    /// Match time that is fetched ahead of the play head. What starts within it is asked for.
    pub ahead: Duration,
    /// Chunks kept before the one being shown, when there is room.
    pub behind: usize,
    /// Bytes of the chunks' files that are at hand or on their way. The chunk being shown is fetched whatever it weighs.
    pub buffer_bytes: u64,
    /// Fetches under way at the same time, once `resume_after` is at hand; before that one after the other, so that what
    /// is due next does not share the link.
    pub in_flight: usize,
    /// Match time that must be at hand before time starts to run, after opening and after a seek.
    pub start_after: Duration,
    /// Match time that must be at hand before time runs again after it had to wait for data.
    pub resume_after: Duration,
    /// What happens after the last frame.
    pub at_end: AtEnd,
    /// What happens where no chunk covers the time.
    pub gaps: Gaps,
    /// Which representation is asked for.
    pub quality: Quality,
    /// How the representation is chosen by itself.
    pub choice: ChoiceConfig,
    /// How patiently a chunk is asked for.
    pub retry: RetryConfig,
    /// How a live stream is followed.
    pub live: LiveConfig,
}

impl Default for PlaybackConfig {
    fn default() -> Self {
        Self {
            ahead: Duration::from_secs(10),
            behind: 1,
            buffer_bytes: 48 << 20,
            in_flight: 2,
            start_after: Duration::from_millis(500),
            resume_after: Duration::from_secs(2),
            at_end: AtEnd::Hold,
            gaps: Gaps::Jump,
            quality: Quality::Auto,
            choice: ChoiceConfig::default(),
            retry: RetryConfig::default(),
            live: LiveConfig::default(),
        }
    }
}

/// What happens after the last frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtEnd {
    /// The last frame stays until the user does something.
    Hold,
    /// From the start again. A live stream has no end: there it waits.
    Loop,
}

/// What happens where no chunk covers the time, because the broadcast showed something else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gaps {
    /// The play head jumps to the next chunk at once.
    Jump,
    /// Time runs while the last frame stays.
    Hold,
}

/// Which representation is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// The best one that the link carries.
    Auto,
    /// This one, whatever the link carries; another only while a live stream has not got a chunk of it yet.
    Fixed(usize),
}

/// How [`Quality::Auto`] chooses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChoiceConfig {
    /// What the link is taken to carry before anything was measured, bits per second.
    pub initial_bits_per_second: u64,
    /// Share of the measured throughput that a representation may need while nothing is buffered.
    pub share_when_empty: f64,
    /// The same while everything that is wanted ahead is buffered; in between it grows evenly.
    pub share_when_full: f64,
    /// How long a choice lasts before a better representation is tried again.
    pub dwell: Duration,
    /// With less than this at hand, or a quarter of what can be, the buffer is short: only what arrives in time is asked for.
    pub short: Duration,
    /// How long the chunk under an empty play head may take.
    pub quick_start: Duration,
}

impl Default for ChoiceConfig {
    fn default() -> Self {
        Self {
            initial_bits_per_second: 4_000_000,
            share_when_empty: 0.7,
            share_when_full: 0.95,
            dwell: Duration::from_secs(10),
            short: Duration::from_secs(3),
            quick_start: Duration::from_millis(500),
        }
    }
}

/// How patiently a chunk is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RetryConfig {
    /// Times that a chunk is asked for that cannot be fetched, before it is given up; at least 1.
    pub attempts: u32,
    /// The same for a chunk that arrives and cannot be used.
    pub corrupt_attempts: u32,
    /// Longest wait before the second attempt; doubles with every further one. The wait is drawn between half of it and
    /// all of it, so that viewers of a server that comes back do not all ask at the same moment.
    pub wait: Duration,
    /// Where the doubling ends.
    pub longest_wait: Duration,
    /// How long an answer may take at least before the attempt is given up; from the third attempt on it grows evenly.
    pub patience: Duration,
    /// How long it may take at most. In between: four times what the measured throughput promises, or most of the time
    /// until the chunk is to be shown, whichever is more.
    pub longest_patience: Duration,
    /// Seed of the waits: give every viewer another one.
    pub seed: u64,
}

impl Default for RetryConfig {
    fn default() -> Self {
        Self {
            attempts: 10,
            corrupt_attempts: 3,
            wait: Duration::from_millis(250),
            longest_wait: Duration::from_secs(1),
            patience: Duration::from_secs(2),
            longest_patience: Duration::from_secs(20),
            seed: 0,
        }
    }
}

/// How a live stream is followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LiveConfig {
    /// How far behind the newest chunk's end playback stays; `None` for the time of the last two chunks.
    pub latency: Option<Duration>,
    /// How much later it may get before time runs faster.
    pub tolerance: Duration,
    /// How fast it runs then, when the user chose no other speed than the normal one; at most 1.5 times.
    pub catch_up: Speed,
}

impl Default for LiveConfig {
    fn default() -> Self {
        Self { latency: None, tolerance: Duration::from_millis(500), catch_up: Speed::percent(110) }
    }
}
