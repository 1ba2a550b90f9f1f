//! The media clock: a position in nanoseconds of the match that stands or runs at a speed.
//!
//! Whole numbers only, always counted from the last change, so that nothing drifts.

use std::time::Duration;

/// How fast the match runs, in percent of real time: 1 to 1600.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Speed(u16);

impl Speed {
    /// Real time.
    pub const NORMAL: Self = Self(100);

    /// A speed in percent, brought into 1 ..= 1600.
    #[must_use]
    pub fn percent(percent: u16) -> Self {
        Self(percent.clamp(1, 1600))
    }

    /// The speed in percent.
    #[must_use]
    pub fn as_percent(self) -> u16 {
        self.0
    }
}

/// See the module.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    /// Position when last settled, nanoseconds of the match.
    settled_ns: u64,
    /// When it was settled, while running.
    since: Option<Duration>,
    speed: Speed,
}

impl Clock {
    /// Standing at a position.
    pub(super) fn at(position_ns: u64) -> Self {
        Self { settled_ns: position_ns, since: None, speed: Speed::NORMAL }
    }

    pub(super) fn is_running(&self) -> bool {
        self.since.is_some()
    }

    pub(super) fn speed(&self) -> Speed {
        self.speed
    }

    /// Nanoseconds of the match. Time that runs backwards is taken to stand.
    pub(super) fn position(&self, now: Duration) -> u64 {
        let Some(since) = self.since else { return self.settled_ns };
        let passed = now.saturating_sub(since).as_nanos() * u128::from(self.speed.0) / 100;
        self.settled_ns.saturating_add(u64::try_from(passed).unwrap_or(u64::MAX))
    }

    /// The position up to which everything has been looked at.
    pub(super) fn settled(&self) -> u64 {
        self.settled_ns
    }

    /// Counts from `now` on. Less than a nanosecond is lost, and only while running slower than real time.
    pub(super) fn settle(&mut self, now: Duration) {
        if let Some(since) = self.since
            && now > since
        {
            self.settled_ns = self.position(now);
            self.since = Some(now);
        }
    }

    pub(super) fn run(&mut self, now: Duration) {
        self.settle(now);
        self.since.get_or_insert(now);
    }

    pub(super) fn stop(&mut self, now: Duration) {
        self.settle(now);
        self.since = None;
    }

    /// Stands at a position.
    pub(super) fn stand(&mut self, position_ns: u64) {
        self.settled_ns = position_ns;
        self.since = None;
    }

    /// Goes on, standing or running, from a position that is reached at `now`.
    pub(super) fn jump(&mut self, now: Duration, position_ns: u64) {
        self.settled_ns = position_ns;
        self.since = self.since.map(|since| since.max(now));
    }

    pub(super) fn set_speed(&mut self, now: Duration, speed: Speed) {
        self.settle(now);
        self.speed = speed;
    }

    /// When the running clock gets to a position; `now` when it is past it.
    pub(super) fn reaches(&self, now: Duration, position_ns: u64) -> Duration {
        let left = u128::from(position_ns.saturating_sub(self.position(now)));
        let wall = (left * 100).div_ceil(u128::from(self.speed.0.max(1)));
        now.saturating_add(Duration::from_nanos(u64::try_from(wall).unwrap_or(u64::MAX)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_runs_stands_and_changes_speed_without_drift() {
        let ms = Duration::from_millis;
        let mut clock = Clock::at(1_000);
        assert_eq!(clock.position(ms(500)), 1_000);
        clock.run(ms(500));
        assert_eq!(clock.position(ms(502)), 2_001_000);
        clock.set_speed(ms(502), Speed::percent(25));
        assert_eq!(clock.position(ms(506)), 3_001_000);
        assert_eq!(clock.reaches(ms(506), 4_001_000), ms(510));
        clock.stop(ms(506));
        assert_eq!(clock.position(ms(900)), 3_001_000);
        for step in 0..1000 {
            clock.run(ms(1000 + step));
            clock.settle(ms(1000 + step));
        }
        assert_eq!(clock.position(ms(1999)), 3_001_000 + 999_000_000 / 4);
    }
}
