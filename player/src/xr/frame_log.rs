//! What is kept of the frames of an evening: counts and histograms of a fixed size, and on request the first frames one by one.

use std::time::Duration;

use super::figures::{FrameRecord, Spread};

/// Frames of which every figure is kept for a trace: twenty minutes at 90 Hz, some fifteen megabytes.
const MOST_TRACED: usize = 110_000;
/// The shortest and the longest time that are told apart, milliseconds, and the ratio from one bin to the next.
const SHORTEST_MS: f64 = 1e-3;
const LONGEST_MS: f64 = 60_000.0;
const RATIO: f64 = 1.01;

/// Milliseconds of any number of measurements. Percentiles are within half a per cent, the longest is exact.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Histogram {
    bins: Vec<u64>,
    count: u64,
    longest_ms: f64,
}

impl Histogram {
    /// Counts a measurement.
    pub fn add(&mut self, ms: f64) {
        let bin = (ms.clamp(SHORTEST_MS, LONGEST_MS) / SHORTEST_MS).ln() / RATIO.ln();
        // Not a number counts as the shortest.
        let bin = bin.max(0.0) as usize;
        if self.bins.len() <= bin {
            self.bins.resize(bin + 1, 0);
        }
        if let Some(count) = self.bins.get_mut(bin) {
            *count += 1;
        }
        self.count += 1;
        self.longest_ms = self.longest_ms.max(ms);
    }

    /// Half are below, 95 of 100 are below, and the longest; zeros for none.
    #[must_use]
    pub fn spread(&self) -> Spread {
        let at = |share: f64| {
            let rank = (self.count.saturating_sub(1) as f64 * share).round() as u64;
            let mut below = 0;
            let bin = self.bins.iter().position(|count| {
                below += count;
                below > rank
            });
            let middle = |bin: usize| SHORTEST_MS * RATIO.powf(bin as f64 + 0.5);
            bin.map_or(0.0, |bin| middle(bin).min(self.longest_ms))
        };
        Spread { p50_ms: at(0.5), p95_ms: at(0.95), max_ms: self.longest_ms }
    }
}

/// Everything that is kept of the frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameLog {
    /// Frames.
    pub frames: u64,
    /// Frame times that the runtime asked for and did not get: every whole period of the display that passed between two
    /// frames beyond the one that is due.
    pub dropped: u64,
    /// Frames during which the match waited for data.
    pub stalled: u64,
    /// Processor time.
    pub cpu: Histogram,
    /// Wall time outside the runtime's calls.
    pub own: Histogram,
    /// Wall time inside them.
    pub runtime: Histogram,
    /// Wall time outside them of the frames that waited for data.
    pub stalled_own: Histogram,
    /// The first frames, when they are wanted.
    pub trace: Vec<FrameRecord>,
    last_display_ns: Option<i64>,
}

impl FrameLog {
    /// Takes in a frame shown for `period`; `traced` keeps all of it as long as there is room.
    pub fn add(&mut self, record: FrameRecord, period: Duration, traced: bool) {
        self.frames += 1;
        self.cpu.add(record.cpu_ms);
        self.own.add(record.own_ms);
        self.runtime.add(record.runtime_ms);
        if record.stalled {
            self.stalled += 1;
            self.stalled_own.add(record.own_ms);
        }
        let (period_ns, at_ns) = (period.as_nanos() as f64, record.predicted_display_ns);
        if let Some(before_ns) = self.last_display_ns.replace(at_ns)
            && period_ns > 0.0
        {
            let periods = at_ns.saturating_sub(before_ns) as f64 / period_ns;
            self.dropped += (periods.round() - 1.0).max(0.0) as u64;
        }
        if traced && self.trace.len() < MOST_TRACED {
            self.trace.push(record);
            if self.trace.len() == MOST_TRACED {
                tracing::warn!("the trace ends after {MOST_TRACED} frames; the figures go on");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(predicted_display_ns: i64) -> FrameRecord {
        FrameRecord {
            predicted_display_ns,
            cpu_ms: 1.0,
            own_ms: 1.0,
            runtime_ms: 0.0,
            match_frame: None,
            stalled: false,
            uploaded: false,
            centre_m: [0.0; 3],
        }
    }

    fn dropped(times_ms: &[i64], period_ms: u64) -> u64 {
        let mut log = FrameLog::default();
        for ms in times_ms {
            log.add(record(ms * 1_000_000), Duration::from_millis(period_ms), false);
        }
        log.dropped
    }

    #[test]
    fn a_skipped_period_is_a_dropped_frame() {
        assert_eq!(dropped(&[0, 10, 21, 40, 49], 10), 1);
        assert_eq!(dropped(&[0, 10], 10), 0);
        assert_eq!(dropped(&[0, 10, 21, 40, 49], 0), 0);
    }

    #[test]
    fn percentiles_are_near_and_the_longest_is_exact() {
        let mut histogram = Histogram::default();
        assert_eq!(histogram.spread(), Spread::default());
        for value in 1..=1000 {
            histogram.add(f64::from(value) / 37.0);
        }
        let (near, exact) = (histogram.spread(), Spread::of((1..=1000).map(|value| f64::from(value) / 37.0)));
        assert!((near.p50_ms / exact.p50_ms - 1.0).abs() < 0.006, "{near:?} {exact:?}");
        assert!((near.p95_ms / exact.p95_ms - 1.0).abs() < 0.006, "{near:?} {exact:?}");
        assert!(near.max_ms == exact.max_ms);
        for strange in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            histogram.add(strange);
        }
        assert!(histogram.bins.len() < 2000);
    }

    /// An hour at 90 Hz takes no more room than a minute.
    #[test]
    fn the_log_does_not_grow() {
        let mut log = FrameLog::default();
        let sized = |log: &FrameLog| log.cpu.bins.len() + log.own.bins.len() + log.trace.len();
        for frame in 0..5400 {
            log.add(record(frame * 11_111_111), Duration::from_nanos(11_111_111), false);
        }
        let after_a_minute = sized(&log);
        for frame in 5400..324_000 {
            log.add(record(frame * 11_111_111), Duration::from_nanos(11_111_111), false);
        }
        assert_eq!((sized(&log), log.frames, log.dropped), (after_a_minute, 324_000, 0));
        for frame in 0..MOST_TRACED as i64 + 5 {
            log.add(record(frame), Duration::ZERO, true);
        }
        assert_eq!(log.trace.len(), MOST_TRACED);
    }
}
