//! What the link carries, measured from finished transfers.
//!
//! Two exponentially weighted averages of the throughput, weighted by the time that transfers took, and the smaller of
//! them counts: the fast one notices a drop, the slow one does not believe a short peak. This is the estimator of hls.js
//! (`ewma-bandwidth-estimator.ts`) and of Shaka Player (`ewma_bandwidth_estimator.js`), with the half-lives of hls.js.

use std::time::Duration;

/// Half-lives in seconds of transfers.
const HALF_LIVES_S: [f64; 2] = [3.0, 9.0];
/// Bytes below which a sample says more about latency than about throughput, as in Shaka Player; it waits for more.
const SAMPLE_BYTES: u64 = 16_000;
/// Bytes that must have come before the estimate is believed.
const ENOUGH_BYTES: u64 = 64_000;
/// A file from a disk may come faster than the clock ticks.
const SHORTEST_S: f64 = 1e-3;

/// How a chunk came: what the caller measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transfer {
    /// Bytes that came.
    pub bytes: u64,
    /// When the request was sent, on the clock of `now`.
    pub started: Duration,
    /// When the last byte was there.
    pub finished: Duration,
}

/// An average whose past loses half of its weight every `half_life_s`.
#[derive(Clone, Copy, Debug)]
struct Average {
    half_life_s: f64,
    value: f64,
    weight_s: f64,
}

impl Average {
    fn add(&mut self, value: f64, weight_s: f64) {
        let kept = 0.5_f64.powf(weight_s / self.half_life_s);
        self.value = value * (1.0 - kept) + self.value * kept;
        self.weight_s += weight_s;
    }

    /// Corrected for having started at zero.
    fn get(&self) -> f64 {
        self.value / (1.0 - 0.5_f64.powf(self.weight_s / self.half_life_s))
    }
}

/// See the module.
#[derive(Clone, Debug)]
pub(super) struct Estimate {
    averages: [Average; 2],
    /// Up to here the time of the link is accounted for.
    counted_until: Duration,
    /// Bytes that came, and link time that passed, since the last sample.
    pending: (u64, f64),
    bytes: u64,
}

impl Default for Estimate {
    fn default() -> Self {
        let averages = HALF_LIVES_S.map(|half_life_s| Average { half_life_s, value: 0.0, weight_s: 0.0 });
        Self { averages, counted_until: Duration::ZERO, pending: (0, 0.0), bytes: 0 }
    }
}

impl Estimate {
    /// Takes a finished transfer. Transfers that overlap share the link: every byte counts once and every moment counts
    /// once, so the one that ends later is charged only for the time after the end of the other.
    pub(super) fn add(&mut self, transfer: Transfer) {
        let from = transfer.started.max(self.counted_until);
        let alone_s = transfer.finished.saturating_sub(from).as_secs_f64();
        self.counted_until = self.counted_until.max(transfer.finished);
        self.bytes = self.bytes.saturating_add(transfer.bytes);
        let (bytes, seconds) = self.pending;
        let (bytes, seconds) = (bytes.saturating_add(transfer.bytes), seconds + alone_s);
        if bytes < SAMPLE_BYTES {
            self.pending = (bytes, seconds);
            return;
        }
        self.pending = (0, 0.0);
        self.sample(bytes, seconds.max(SHORTEST_S));
    }

    /// A transfer of `bytes` that was given up: not more than that can have come, which is news if it is little.
    pub(super) fn gave_up(&mut self, bytes: u64, started: Duration, now: Duration) {
        let seconds = now.saturating_sub(started.max(self.counted_until)).as_secs_f64().max(SHORTEST_S);
        if self.bytes_per_second().is_none_or(|known| bytes as f64 / seconds < known) {
            self.sample(bytes, seconds);
            self.counted_until = self.counted_until.max(now);
            self.bytes = self.bytes.max(ENOUGH_BYTES);
        }
    }

    /// What the link carries, once enough has come to tell.
    pub(super) fn bytes_per_second(&self) -> Option<f64> {
        let measured = self.bytes >= ENOUGH_BYTES && self.averages[0].weight_s > 0.0;
        measured.then(|| self.averages[0].get().min(self.averages[1].get()))
    }

    fn sample(&mut self, bytes: u64, seconds: f64) {
        for average in &mut self.averages {
            average.add(bytes as f64 / seconds, seconds);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn transfer(bytes: u64, started_ms: u64, finished_ms: u64) -> Transfer {
        let ms = Duration::from_millis;
        Transfer { bytes, started: ms(started_ms), finished: ms(finished_ms) }
    }

    fn after(transfers: impl IntoIterator<Item = Transfer>) -> f64 {
        let mut estimate = Estimate::default();
        transfers.into_iter().for_each(|transfer| estimate.add(transfer));
        estimate.bytes_per_second().unwrap()
    }

    fn assert_near(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 0.02, "{found}, expected {expected}");
    }

    #[test]
    fn a_steady_link_is_measured_with_one_and_with_overlapping_transfers() {
        // A million bytes per second, one after the other.
        assert_near(after((0..20).map(|n| transfer(500_000, n * 500, (n + 1) * 500))), 1e6);
        // Two at a time, each with half of the link, staggered; the first had the link for itself for a while.
        let staggered = (0..40).map(|n| transfer(500_000, n * 500, n * 500 + 1_000)).skip(1);
        assert_near(after(std::iter::once(transfer(750_000, 0, 1_000)).chain(staggered)), 1e6);
        // Two that start and end together: each alone looks like half of the link.
        let together = (0..20).map(|n| transfer(500_000, n / 2 * 1_000, (n / 2 + 1) * 1_000));
        assert_near(after(together), 1e6);
    }

    #[test]
    fn idle_time_does_not_count() {
        assert_near(after((0..10).map(|n| transfer(500_000, n * 10_000, n * 10_000 + 500))), 1e6);
    }

    #[test]
    fn a_drop_is_believed_sooner_than_a_peak() {
        let steady = |from: u64, rate: u64, count: u64| {
            (0..count).map(move |n| transfer(rate, from + n * 1_000, from + (n + 1) * 1_000))
        };
        let dropped = after(steady(0, 1_000_000, 30).chain(steady(30_000, 200_000, 3)));
        let peaked = after(steady(0, 200_000, 30).chain(steady(30_000, 1_000_000, 3)));
        assert!(dropped < 610_000.0 && peaked < 400_000.0, "{dropped} {peaked}");
    }

    #[test]
    fn little_says_nothing_and_a_transfer_given_up_says_at_most_so_much() {
        let mut estimate = Estimate::default();
        estimate.add(transfer(10_000, 0, 100));
        assert_eq!(estimate.bytes_per_second(), None);
        estimate.gave_up(1_000_000, Duration::ZERO, Duration::from_millis(2_100));
        assert_near(estimate.bytes_per_second().unwrap(), 500_000.0);
        let mut estimate = Estimate::default();
        estimate.add(transfer(1_000_000, 100, 1_100));
        let before = estimate.bytes_per_second().unwrap();
        estimate.gave_up(1_000_000, Duration::from_secs(2), Duration::from_secs(6));
        assert!(estimate.bytes_per_second().unwrap() < before / 1.5);
    }

    #[test]
    fn a_transfer_without_time_is_not_infinitely_fast() {
        assert!(after([transfer(100_000, 5, 5)]).is_finite());
    }
}
