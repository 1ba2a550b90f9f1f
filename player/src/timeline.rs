//! Arithmetic of the timeline: moments, frames, speeds and the play head. No clock and no widgets in here.

use protocol::time::{Ticks, Timescale};

/// Nanoseconds of a steady clock that the caller reads.
pub type Nanoseconds = u64;

/// How long the match is and how it divides into frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeline {
    /// Ticks per second.
    pub timescale: Timescale,
    /// From the start to the end of the last frame.
    pub duration: Ticks,
    /// How long one frame is shown; in a clip with uneven frames, its first one.
    pub frame: Ticks,
}

impl Timeline {
    /// Frames of the match, at least 1.
    #[must_use]
    pub fn frames(&self) -> u32 {
        let frame = self.frame.0.max(1);
        u32::try_from(self.duration.0.max(0) as u64 / frame as u64).unwrap_or(u32::MAX).max(1)
    }

    /// The frame shown at a moment, 0-based.
    #[must_use]
    pub fn frame_at(&self, moment: Ticks) -> u32 {
        let frame = moment.0.max(0) / self.frame.0.max(1);
        u32::try_from(frame).unwrap_or(u32::MAX).min(self.frames() - 1)
    }

    /// When a frame starts.
    #[must_use]
    pub fn start_of(&self, frame: u32) -> Ticks {
        Ticks(i64::from(frame.min(self.frames() - 1)).saturating_mul(self.frame.0.max(1)))
    }

    /// A moment in minutes and seconds: `0:04.10`.
    #[must_use]
    pub fn label(&self, moment: Ticks) -> String {
        let hundredths = (self.timescale.seconds(moment).max(0.0) * 100.0 + 1e-6).floor() as u64;
        format!("{}:{:02}.{:02}", hundredths / 6000, hundredths / 100 % 60, hundredths % 100)
    }
}

/// How fast the match is played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Speed {
    numerator: u32,
    denominator: u32,
}

impl Speed {
    /// The speeds of the menu.
    pub const ALL: [Self; 5] = [
        Self { numerator: 1, denominator: 8 },
        Self { numerator: 1, denominator: 4 },
        Self { numerator: 1, denominator: 2 },
        Self::NORMAL,
        Self { numerator: 2, denominator: 1 },
    ];
    /// As it was played.
    pub const NORMAL: Self = Self { numerator: 1, denominator: 1 };

    /// The name in the menu.
    #[must_use]
    pub fn label(self) -> String {
        if self.denominator == 1 {
            format!("{}×", self.numerator)
        } else {
            format!("{}/{}×", self.numerator, self.denominator)
        }
    }
}

/// Where in the match we are, and whether it moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlayHead {
    position: Ticks,
    speed: Speed,
    /// While playing: the moment of the clock at which the head stood where.
    running: Option<(Nanoseconds, Ticks)>,
}

impl Default for PlayHead {
    fn default() -> Self {
        Self { position: Ticks(0), speed: Speed::NORMAL, running: None }
    }
}

impl PlayHead {
    /// The moment shown.
    #[must_use]
    pub fn position(&self) -> Ticks {
        self.position
    }

    /// Whether it moves.
    #[must_use]
    pub fn is_playing(&self) -> bool {
        self.running.is_some()
    }

    /// How fast it moves.
    #[must_use]
    pub fn speed(&self) -> Speed {
        self.speed
    }

    /// Starts; from the beginning when it stands on the last frame.
    pub fn play(&mut self, timeline: &Timeline, now: Nanoseconds) {
        if timeline.frame_at(self.position) + 1 == timeline.frames() {
            self.position = Ticks(0);
        }
        self.running = Some((now, self.position));
    }

    /// Stops where it is.
    pub fn pause(&mut self) {
        self.running = None;
    }

    /// Moves to a frame; keeps playing from there when it played.
    pub fn seek(&mut self, timeline: &Timeline, frame: u32, now: Nanoseconds) {
        self.position = timeline.start_of(frame);
        if self.is_playing() {
            self.running = Some((now, self.position));
        }
    }

    /// Stops and moves by whole frames.
    pub fn step(&mut self, timeline: &Timeline, frames: i64) {
        self.pause();
        let frame = i64::from(timeline.frame_at(self.position)).saturating_add(frames);
        self.position = timeline.start_of(u32::try_from(frame.max(0)).unwrap_or(u32::MAX));
    }

    /// Plays on at another speed.
    pub fn set_speed(&mut self, speed: Speed, now: Nanoseconds) {
        self.speed = speed;
        if self.is_playing() {
            self.running = Some((now, self.position));
        }
    }

    /// Moves the head to where it is at `now`. At the end it stops on the last frame.
    pub fn advance(&mut self, timeline: &Timeline, now: Nanoseconds) {
        let Some((since, from)) = self.running else { return };
        let elapsed = u128::from(now.saturating_sub(since)) * u128::from(self.speed.numerator)
            / u128::from(self.speed.denominator.max(1));
        let elapsed = u64::try_from(elapsed).unwrap_or(u64::MAX);
        self.position = from + timeline.timescale.ticks_in_nanoseconds(elapsed);
        if self.position >= timeline.duration {
            self.position = timeline.start_of(timeline.frames() - 1);
            self.running = None;
        }
    }

    /// Waits for data: the clock goes on, the head does not.
    pub fn hold(&mut self, now: Nanoseconds) {
        if self.is_playing() {
            self.running = Some((now, self.position));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Nanoseconds = 1_000_000_000;

    fn ntsc(frames: i64) -> Timeline {
        Timeline {
            timescale: Timescale { numerator: 30_000, denominator: 1 },
            duration: Ticks(1001 * frames),
            frame: Ticks(1001),
        }
    }

    #[test]
    fn frames_and_moments_agree_over_a_whole_half_at_ntsc_rate() {
        let timeline = ntsc(80_919);
        assert_eq!(timeline.frames(), 80_919);
        for frame in (0..80_919).step_by(977) {
            assert_eq!(timeline.frame_at(timeline.start_of(frame)), frame);
            assert_eq!(timeline.frame_at(timeline.start_of(frame) + Ticks(1000)), frame);
        }
        assert_eq!(timeline.frame_at(Ticks(i64::MAX)), 80_918);
        assert_eq!(timeline.frame_at(Ticks(-5)), 0);
    }

    #[test]
    fn labels_do_not_round_up_into_the_next_second() {
        let timeline = ntsc(10_000);
        assert_eq!(timeline.label(Ticks(0)), "0:00.00");
        assert_eq!(timeline.label(Ticks(29_999)), "0:00.99");
        assert_eq!(timeline.label(Ticks(30_000 * 61 + 3_000)), "1:01.10");
    }

    #[test]
    fn playing_follows_the_clock_at_every_speed_and_stops_on_the_last_frame() {
        let timeline = ntsc(300);
        for (speed, frame) in Speed::ALL.into_iter().zip([3, 7, 14, 29, 59]) {
            let mut head = PlayHead::default();
            head.set_speed(speed, 0);
            head.play(&timeline, 5 * SECOND);
            // In uneven steps, to the same place.
            for now in [5 * SECOND + 1, 5 * SECOND + SECOND / 3, 6 * SECOND] {
                head.advance(&timeline, now);
            }
            assert_eq!(timeline.frame_at(head.position()), frame, "{}", speed.label());
            head.advance(&timeline, 600 * SECOND);
            assert_eq!((head.is_playing(), timeline.frame_at(head.position())), (false, 299));
        }
    }

    #[test]
    fn play_at_the_end_starts_over_and_steps_stay_in_the_match() {
        let timeline = ntsc(10);
        let mut head = PlayHead::default();
        head.step(&timeline, -1);
        assert_eq!(head.position(), Ticks(0));
        head.step(&timeline, 99);
        assert_eq!(timeline.frame_at(head.position()), 9);
        head.play(&timeline, SECOND);
        assert_eq!(head.position(), Ticks(0));
    }

    #[test]
    fn a_head_that_holds_does_not_jump_afterwards() {
        let timeline = ntsc(300);
        let mut head = PlayHead::default();
        head.play(&timeline, 0);
        head.advance(&timeline, SECOND);
        let before = head.position();
        head.hold(9 * SECOND);
        head.advance(&timeline, 9 * SECOND);
        assert_eq!(head.position(), before);
    }

    #[test]
    fn a_stream_with_silly_numbers_has_one_frame() {
        let timeline = Timeline { duration: Ticks(0), frame: Ticks(0), ..ntsc(1) };
        assert_eq!((timeline.frames(), timeline.frame_at(Ticks(77))), (1, 0));
    }
}
