//! How long to wait before a failed fetch is tried again: exponential, bounded, jittered.
//!
//! "Equal jitter" of M. Brooker, "Exponential Backoff and Jitter" (AWS Architecture Blog, 2015): half of the wait is
//! fixed, half is drawn. The generator belongs to the state machine, so that a test sees the same waits every time.

use std::time::Duration;

/// S. Vigna's SplitMix64: one addition and two multiplications per number, every seed is good.
#[derive(Clone, Debug)]
pub(super) struct SplitMix64(u64);

impl SplitMix64 {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// Evenly in 0 .. 1.
    pub(super) fn fraction(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// The wait after failed attempt number `attempt` (from 1 on): between half and all of `first` doubled `attempt - 1`
/// times, which is at most `longest`.
pub(super) fn wait(attempt: u32, first: Duration, longest: Duration, random: &mut SplitMix64) -> Duration {
    let doubled = first.saturating_mul(1 << attempt.saturating_sub(1).min(20)).min(longest);
    doubled / 2 + (doubled / 2).mul_f64(random.fraction())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_generator_is_the_published_one() {
        // The first numbers of the reference implementation for seed 1234567.
        let mut random = SplitMix64::new(1_234_567);
        assert_eq!((random.next(), random.next()), (6_457_827_717_110_365_317, 3_203_168_211_198_807_973));
    }

    #[test]
    fn waits_double_up_to_a_bound_and_differ_between_viewers() {
        let ms = Duration::from_millis;
        let waits = |seed| {
            let mut random = SplitMix64::new(seed);
            (1..40).map(|attempt| wait(attempt, ms(250), ms(1_000), &mut random)).collect::<Vec<_>>()
        };
        for (attempt, wait) in waits(7).into_iter().enumerate() {
            let most = ms([250, 500, 1_000][attempt.min(2)]);
            assert!(wait >= most / 2 && wait <= most, "attempt {attempt}: {wait:?}");
        }
        assert_eq!(waits(7), waits(7));
        assert_ne!(waits(7), waits(8));
    }
}
