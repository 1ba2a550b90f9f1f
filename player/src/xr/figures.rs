//! What a frame of a headset costs, and how such figures are summed up.
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
    /// Where the centre mark is drawn, room metres.
    pub centre_m: [f64; 3],
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

/// Milliseconds of a duration.
#[must_use]
pub fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_few_values() {
        let spread = Spread::of([3.0, 1.0, 2.0]);
        assert_eq!((spread.p50_ms, spread.p95_ms, spread.max_ms), (2.0, 3.0, 3.0));
        assert_eq!(Spread::of([]), Spread::default());
    }
}
