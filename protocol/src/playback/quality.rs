//! Which representation the next chunk comes from.
//!
//! Throughput decides and the buffer tempers it: the fuller the buffer, the larger the share of the measured throughput
//! that a representation may need, and a full one sits out a dip. What the chunks to come weigh is known from the
//! manifest, so their real sizes are compared and no nominal bit rate.

use std::time::Duration;

use super::{ChoiceConfig, Quality, ladder::Ladder};

/// Chunks whose sizes are looked at.
const LOOK_AHEAD: usize = 5;

/// What a choice is made from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Situation {
    pub(super) now: Duration,
    /// Match time at hand without a hole, from the play head on, and how much can be at most.
    pub(super) at_hand: Duration,
    pub(super) at_most: Duration,
    /// Measured throughput.
    pub(super) bytes_per_second: Option<f64>,
    /// Seconds of match per second.
    pub(super) speed: f64,
}

/// The choice made last.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chooser {
    pub(super) quality: Quality,
    config: ChoiceConfig,
    current: Option<usize>,
    changed_at: Option<Duration>,
    switches: u32,
}

impl Chooser {
    pub(super) fn new(quality: Quality, config: ChoiceConfig) -> Self {
        Self { quality, config, current: None, changed_at: None, switches: 0 }
    }

    /// How often the choice changed.
    pub(super) fn switches(&self) -> u32 {
        self.switches
    }

    pub(super) fn current(&self) -> Option<usize> {
        self.current
    }

    /// Throughput to reckon with, bytes per second.
    pub(super) fn reckoned(&self, measured: Option<f64>) -> f64 {
        measured.unwrap_or(self.config.initial_bits_per_second as f64 / 8.0).max(1.0)
    }

    /// Chooses for one chunk. `ceiling`: no better than this, for this chunk only.
    pub(super) fn choose(
        &mut self,
        ladder: &Ladder,
        chunk: usize,
        ceiling: usize,
        situation: &Situation,
    ) -> usize {
        let best = ladder.rungs().saturating_sub(1);
        let (wanted, ceiling) = match self.quality {
            Quality::Fixed(rung) => (rung.min(best), best),
            Quality::Auto => (self.automatic(ladder, chunk, situation), ceiling),
        };
        if self.current != Some(wanted) {
            if self.current.is_some() {
                self.switches += 1;
                self.changed_at = Some(situation.now);
            }
            self.current = Some(wanted);
        }
        ladder.available(wanted.min(ceiling), chunk)
    }

    fn automatic(&self, ladder: &Ladder, chunk: usize, situation: &Situation) -> usize {
        let ChoiceConfig { share_when_empty, share_when_full, dwell, short, quick_start, .. } = self.config;
        let throughput = self.reckoned(situation.bytes_per_second);
        let (at_hand, at_most) = (situation.at_hand.as_secs_f64(), situation.at_most.as_secs_f64());
        let fill = if at_most > 0.0 { (at_hand / at_most).min(1.0) } else { 0.0 };
        let share = share_when_empty + (share_when_full - share_when_empty) * fill;
        let needed = |rung: &usize| ladder.rate(*rung, chunk, LOOK_AHEAD) * situation.speed;
        let rungs = 0..ladder.rungs();
        let sustainable = rungs.rev().find(|rung| needed(rung) <= share * throughput).unwrap_or(0);
        let takes_s = |rung: usize| ladder.bytes(rung, chunk).unwrap_or(0) as f64 / throughput;

        let is_short = at_hand < short.as_secs_f64().min(at_most / 4.0) || situation.at_hand.is_zero();
        let rested = self.changed_at.is_none_or(|at| situation.now.saturating_sub(at) >= dwell);
        let mut wanted = match self.current {
            Some(current) if sustainable > current && (is_short || !rested) => current,
            // Up only to what comes well before it is due; near the live edge that is less than what the link carries.
            Some(current) if sustainable > current => {
                let lasts_s = ladder.seconds(chunk);
                let usually_s = |rung: &usize| ladder.rate(*rung, chunk, LOOK_AHEAD) * lasts_s / throughput;
                let in_time =
                    |rung: &usize| takes_s(*rung).max(usually_s(rung)) * situation.speed <= 0.75 * at_hand;
                (current + 1..=sustainable).rev().find(in_time).unwrap_or(current)
            }
            // What was good enough stays good enough until the link hardly carries it: sizes vary from chunk to chunk.
            Some(current)
                if sustainable < current && !is_short && needed(&current) <= share_when_full * throughput =>
            {
                current
            }
            // A full buffer outlives a dip that is over soon.
            Some(current)
                if sustainable < current
                    && fill >= 0.5
                    && takes_s(current) * situation.speed <= at_hand / 2.0 =>
            {
                current
            }
            _ => sustainable,
        };
        if is_short {
            let limit_s = (at_hand / 2.0 / situation.speed).max(quick_start.as_secs_f64());
            while wanted > 0 && takes_s(wanted) > limit_s {
                wanted -= 1;
            }
        }
        wanted
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::playback::{Gaps, simulation::MadeUpMatch};

    /// Low 2, medium 5, high 12 Mbit/s.
    fn ladder() -> Ladder {
        Ladder::new(&MadeUpMatch::default().manifest(), Gaps::Jump).unwrap()
    }

    fn situation(now_s: u64, at_hand_s: u64, megabits: f64) -> Situation {
        let s = Duration::from_secs;
        Situation {
            now: s(now_s),
            at_hand: s(at_hand_s),
            at_most: s(10),
            bytes_per_second: Some(megabits * 1e6 / 8.0),
            speed: 1.0,
        }
    }

    fn chooser() -> Chooser {
        Chooser::new(Quality::Auto, ChoiceConfig::default())
    }

    fn then(chooser: &mut Chooser, now_s: u64, at_hand_s: u64, megabits: f64) -> usize {
        chooser.choose(&ladder(), 10, usize::MAX, &situation(now_s, at_hand_s, megabits))
    }

    #[test]
    fn it_starts_low_and_goes_up_when_there_is_enough_at_hand() {
        let mut chooser = chooser();
        let unknown = Situation { bytes_per_second: None, ..situation(0, 0, 0.0) };
        assert_eq!(chooser.choose(&ladder(), 0, usize::MAX, &unknown), 0);
        assert_eq!(then(&mut chooser, 1, 1, 30.0), 0, "short");
        assert_eq!(then(&mut chooser, 3, 4, 30.0), 2);
        assert_eq!(chooser.switches(), 1);
    }

    #[test]
    fn it_goes_up_again_only_after_a_while_and_down_at_once() {
        let mut chooser = chooser();
        assert_eq!(then(&mut chooser, 0, 5, 8.0), 1);
        assert_eq!(then(&mut chooser, 10, 4, 3.0), 0);
        assert_eq!(then(&mut chooser, 15, 9, 30.0), 0, "dwells");
        assert_eq!(then(&mut chooser, 20, 9, 30.0), 2);
        assert_eq!(then(&mut chooser, 21, 2, 6.0), 0, "short: what arrives in time");
    }

    #[test]
    fn a_full_buffer_sits_out_a_dip_and_lets_it_use_more_of_the_link() {
        let mut chooser = chooser();
        assert_eq!(then(&mut chooser, 0, 10, 6.0), 1, "5 of 6 Mbit/s");
        assert_eq!(then(&mut chooser, 5, 9, 3.0), 1);
        assert_eq!(then(&mut chooser, 8, 4, 3.0), 0);
        assert_eq!(then(&mut super::tests::chooser(), 0, 4, 6.0), 0, "5 of 6 Mbit/s with less at hand");
    }

    #[test]
    fn a_fixed_choice_and_a_ceiling_hold() {
        let mut fixed = Chooser::new(Quality::Fixed(1), ChoiceConfig::default());
        assert_eq!(then(&mut fixed, 0, 0, 0.1), 1);
        let mut chooser = chooser();
        assert_eq!(chooser.choose(&ladder(), 10, 1, &situation(0, 5, 30.0)), 1);
        assert_eq!(then(&mut chooser, 0, 5, 30.0), 2, "the ceiling was for one chunk");
        assert_eq!(chooser.switches(), 0);
    }

    #[test]
    fn twice_the_speed_needs_twice_the_link() {
        let mut chooser = chooser();
        let fast = Situation { speed: 2.0, ..situation(0, 5, 15.0) };
        assert_eq!(chooser.choose(&ladder(), 10, usize::MAX, &fast), 1);
    }
}
