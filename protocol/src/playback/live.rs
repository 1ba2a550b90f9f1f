//! Following a stream that is still being written: when to read the manifest again, how far behind the newest chunk to
//! stay, when to hurry.

use std::time::Duration;

use super::{
    LiveConfig, RetryConfig, Speed,
    backoff::{self, SplitMix64},
};

/// Bounds of the wait between two readings of the manifest, whatever it says itself.
const WAITS: [Duration; 2] = [Duration::from_millis(250), Duration::from_secs(60)];
/// How long a manifest may take to come.
const PATIENCE: Duration = Duration::from_secs(5);

/// See the module.
#[derive(Debug)]
pub(super) struct Follower {
    config: LiveConfig,
    /// When the manifest is read next; `None` until a first moment is known.
    due: Option<Duration>,
    asked: Option<Duration>,
    failures: u32,
    random: SplitMix64,
    hurries: bool,
}

impl Follower {
    pub(super) fn new(config: LiveConfig, seed: u64) -> Self {
        // Other draws than those for the chunks.
        let random = SplitMix64::new(!seed);
        Self { config, due: None, asked: None, failures: 0, random, hurries: false }
    }

    /// Lets time pass; `update_after`: what the manifest says, `None` when the stream is complete.
    pub(super) fn advance(&mut self, now: Duration, update_after: Option<Duration>) {
        let Some(after) = update_after else {
            (self.due, self.asked) = (None, None);
            return;
        };
        if self.asked.is_some_and(|asked| now >= asked.saturating_add(PATIENCE)) {
            self.asked = None;
            self.due = Some(now);
        }
        if self.due.is_none() {
            self.due = Some(now.saturating_add(bounded(after)));
        }
    }

    /// Whether the manifest is to be read now; says so once.
    pub(super) fn poll(&mut self, now: Duration) -> bool {
        let ask = self.asked.is_none() && self.due.is_some_and(|due| now >= due);
        if ask {
            self.asked = Some(now);
        }
        ask
    }

    /// When [`Follower::poll`] has something to say next.
    pub(super) fn next_event(&self) -> Option<Duration> {
        self.asked.map(|asked| asked.saturating_add(PATIENCE)).or(self.due)
    }

    /// Takes the news that the manifest was read. One that has not grown is read again after half the time, as clients
    /// of HTTP Live Streaming do (RFC 8216, section 6.3.4).
    pub(super) fn updated(&mut self, now: Duration, after: Duration, grown: bool) {
        let asked = self.asked.take().unwrap_or(now);
        let wait = bounded(if grown { after } else { after / 2 });
        self.due = Some(asked.saturating_add(wait).max(now.saturating_add(WAITS[0])));
        self.failures = 0;
    }

    /// Takes the news that the manifest could not be read or was of no use.
    pub(super) fn failed(&mut self, now: Duration, retry: &RetryConfig) {
        self.asked = None;
        self.failures = self.failures.saturating_add(1);
        let wait = backoff::wait(self.failures, retry.wait, retry.longest_wait, &mut self.random);
        self.due = Some(now.saturating_add(wait.max(WAITS[0])));
    }

    /// How far behind the newest chunk's end to stay.
    pub(super) fn target(&self, last_two_chunks: Duration) -> Duration {
        self.config.latency.unwrap_or(last_two_chunks)
    }

    /// How fast time is to run, when the user chose `speed`. `may`: whether enough is at hand to run faster.
    pub(super) fn speed(&mut self, speed: Speed, latency: Duration, target: Duration, may: bool) -> Speed {
        let late = latency > target.saturating_add(self.config.tolerance);
        self.hurries = (late || self.hurries && latency > target) && speed == Speed::NORMAL;
        if self.hurries && may {
            Speed::percent(self.config.catch_up.as_percent().clamp(100, 150))
        } else {
            speed
        }
    }
}

fn bounded(wait: Duration) -> Duration {
    wait.clamp(WAITS[0], WAITS[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    fn follower() -> Follower {
        Follower::new(LiveConfig::default(), 0)
    }

    #[test]
    fn the_manifest_is_read_when_due_and_sooner_when_it_has_not_grown() {
        let (mut follower, after) = (follower(), Some(ms(1_000)));
        follower.advance(ms(500), after);
        assert_eq!((follower.poll(ms(1_499)), follower.next_event()), (false, Some(ms(1_500))));
        assert!(follower.poll(ms(1_500)) && !follower.poll(ms(1_500)), "once");
        follower.updated(ms(1_600), ms(1_000), true);
        assert_eq!(follower.next_event(), Some(ms(2_500)));
        assert!(follower.poll(ms(2_500)));
        follower.updated(ms(2_600), ms(1_000), false);
        assert_eq!(follower.next_event(), Some(ms(3_000)));
    }

    #[test]
    fn a_lost_or_failed_reading_is_tried_again() {
        let (mut follower, after) = (follower(), Some(ms(1_000)));
        follower.advance(ms(0), after);
        assert!(follower.poll(ms(1_000)));
        follower.advance(ms(6_000), after);
        assert!(follower.poll(ms(6_000)), "no answer");
        follower.failed(ms(6_100), &RetryConfig::default());
        let next = follower.next_event().unwrap();
        assert!(next > ms(6_100) && next <= ms(6_350), "{next:?}");
        follower.advance(ms(6_200), None);
        assert_eq!(follower.next_event(), None, "complete");
    }

    #[test]
    fn it_hurries_from_the_tolerance_down_to_the_target() {
        let mut follower = follower();
        let mut speed = |latency| follower.speed(Speed::NORMAL, ms(latency), ms(2_000), true).as_percent();
        assert_eq!(
            [2_400, 2_600, 2_400, 2_001, 2_000, 2_400].map(&mut speed),
            [100, 110, 110, 110, 100, 100]
        );
        assert_eq!(follower.speed(Speed::percent(50), ms(9_000), ms(2_000), true), Speed::percent(50));
        assert_eq!(follower.speed(Speed::NORMAL, ms(9_000), ms(2_000), false), Speed::NORMAL);
    }
}
