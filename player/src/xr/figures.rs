//! What the frames of a headset cost, and the trace of every one of them.
//!
//! Processor time is that of the frame loop's thread alone: loading, decoding and, on a software GPU, rasterising happen
//! on others. A frame's wall time is told in two parts: outside the runtime's calls, where nothing may wait, and inside
//! them, where pacing and the GPU's backlog are.

use std::time::Duration;

use serde::Serialize;

/// One frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FrameRecord {
    /// When the runtime says it is shown, nanoseconds of its clock.
    pub predicted_display_ns: i64,
    /// Processor time of the frame loop's thread, milliseconds.
    pub cpu_ms: f64,
    /// Wall time outside the runtime's calls, milliseconds.
    pub own_ms: f64,
    /// Wall time inside them, milliseconds.
    pub runtime_ms: f64,
    /// The frame of the match on show, 0-based.
    pub match_frame: Option<u32>,
    /// Whether the match waited for data.
    pub stalled: bool,
    /// Whether another frame of the match was uploaded.
    pub uploaded: bool,
}

/// Milliseconds of repeated measurements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Half are below.
    pub p50_ms: f64,
    /// 95 of 100 are below.
    pub p95_ms: f64,
    /// The longest.
    pub max_ms: f64,
}

impl Spread {
    /// Of any number of values; zeros for none.
    #[must_use]
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let index = ((sorted.len() as f64 - 1.0) * share).round().max(0.0) as usize;
            sorted.get(index).copied().unwrap_or_default()
        };
        Self { p50_ms: at(0.5), p95_ms: at(0.95), max_ms: at(1.0) }
    }
}

/// Frame times that the runtime asked for and did not get: every whole period of the display that passed between two
/// frames beyond the one that is due.
#[must_use]
pub fn dropped(records: &[FrameRecord], period: Duration) -> u64 {
    let period = period.as_nanos() as f64;
    if period <= 0.0 {
        return 0;
    }
    let gaps = records.windows(2).filter_map(|pair| {
        let [before, after] = pair else { return None };
        Some((after.predicted_display_ns - before.predicted_display_ns) as f64 / period)
    });
    gaps.map(|periods| (periods.round() - 1.0).max(0.0) as u64).sum()
}

/// Milliseconds of a duration.
#[must_use]
pub fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
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
        }
    }

    #[test]
    fn a_skipped_period_is_a_dropped_frame() {
        let records = [0, 10, 21, 40, 49].map(|ms| record(ms * 1_000_000));
        assert_eq!(dropped(&records, Duration::from_millis(10)), 1);
        assert_eq!(dropped(&records[..2], Duration::from_millis(10)), 0);
        assert_eq!(dropped(&records, Duration::ZERO), 0);
        assert_eq!(dropped(&[], Duration::from_millis(10)), 0);
    }

    #[test]
    fn percentiles_of_few_values() {
        let spread = Spread::of([3.0, 1.0, 2.0]);
        assert_eq!((spread.p50_ms, spread.p95_ms, spread.max_ms), (2.0, 3.0, 3.0));
        assert_eq!(Spread::of([]), Spread::default());
    }
}
