//! Time as integer ticks of a rational timescale taken from the clip; never seconds in floating point.

use std::ops::{Add, Sub};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A moment or a duration, in ticks of the stream's [`Timescale`].
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(transparent)]
pub struct Ticks(pub i64);

impl Add for Ticks {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl Sub for Ticks {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

/// How many ticks make a second, as the fraction `numerator / denominator` (both at least 1).
///
/// A clip at 30000/1001 frames per second usually has 30000/1 ticks per second and 1001 ticks per frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
pub struct Timescale {
    /// Ticks in `denominator` seconds.
    pub numerator: u32,
    /// Seconds that `numerator` ticks take.
    pub denominator: u32,
}

impl Timescale {
    /// A timescale of `numerator / denominator` ticks per second, or `None` when either is zero.
    #[must_use]
    pub fn new(numerator: u32, denominator: u32) -> Option<Self> {
        (numerator > 0 && denominator > 0).then_some(Self { numerator, denominator })
    }

    /// `ticks` in seconds, for display and for physics; never for comparing moments.
    #[must_use]
    pub fn seconds(self, ticks: Ticks) -> f64 {
        ticks.0 as f64 * f64::from(self.denominator) / f64::from(self.numerator)
    }

    /// The number of whole ticks in `nanoseconds` of wall-clock time, rounded down.
    #[must_use]
    pub fn ticks_in_nanoseconds(self, nanoseconds: u64) -> Ticks {
        let scaled = u128::from(nanoseconds) * u128::from(self.numerator);
        let ticks = scaled / (u128::from(self.denominator) * 1_000_000_000);
        Ticks(i64::try_from(ticks).unwrap_or(i64::MAX))
    }

    /// The first nanosecond of `ticks`, so that [`Timescale::ticks_in_nanoseconds`] gives `ticks` back as long as a tick is
    /// at least a nanosecond; 0 before the start.
    #[must_use]
    pub fn nanoseconds(self, ticks: Ticks) -> u64 {
        let ticks = u128::try_from(ticks.0).unwrap_or(0);
        let scaled = ticks * u128::from(self.denominator) * 1_000_000_000;
        u64::try_from(scaled.div_ceil(u128::from(self.numerator.max(1)))).unwrap_or(u64::MAX)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn nanoseconds_and_back(ticks in 0..1_000_000_000i64, numerator in 1..1_000_000u32, denominator in 1..1002u32) {
            let timescale = Timescale { numerator, denominator };
            let there = timescale.nanoseconds(Ticks(ticks));
            prop_assume!(there < u64::MAX);
            prop_assert_eq!(timescale.ticks_in_nanoseconds(there), Ticks(ticks));
            prop_assert!(there == 0 || timescale.ticks_in_nanoseconds(there - 1) < Ticks(ticks));
        }
    }

    #[test]
    fn a_frame_at_ntsc_rate_is_1001_of_30000() {
        let timescale = Timescale { numerator: 30_000, denominator: 1 };
        assert!((timescale.seconds(Ticks(1001)) - 1001.0 / 30_000.0).abs() < 1e-15);
        assert_eq!(timescale.ticks_in_nanoseconds(1_000_000_000), Ticks(30_000));
        assert_eq!(Timescale::new(0, 1), None);
    }
}
