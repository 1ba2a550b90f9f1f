//! Arithmetic of the timeline: frames, moments and their labels. No clock and no widgets in here.

use protocol::{
    manifest::{Segment, SegmentKind},
    playback::Speed,
    time::{Ticks, Timescale},
};

/// The speeds of the menu, per cent.
pub const SPEEDS_PERCENT: [u16; 5] = [10, 25, 50, 100, 200];

/// How long the match is and how it divides into frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeline {
    /// Ticks per second.
    pub timescale: Timescale,
    /// When the first frame is shown.
    pub start: Ticks,
    /// From there to the end of the last frame.
    pub duration: Ticks,
    /// How long one frame is shown; in a clip with uneven frames, its first one.
    pub frame: Ticks,
}

impl Timeline {
    /// Frames of the match, at least 1.
    #[must_use]
    pub fn frames(&self) -> u32 {
        let frame = self.frame.0.max(1);
        u32::try_from(self.duration.0.max(0) / frame).unwrap_or(u32::MAX).max(1)
    }

    /// The frame shown at a moment, 0-based.
    #[must_use]
    pub fn frame_at(&self, moment: Ticks) -> u32 {
        let frame = (moment - self.start).0.max(0) / self.frame.0.max(1);
        u32::try_from(frame).unwrap_or(u32::MAX).min(self.frames() - 1)
    }

    /// When a frame starts.
    #[must_use]
    pub fn start_of(&self, frame: u32) -> Ticks {
        let frame = i64::from(frame.min(self.frames() - 1));
        self.start + Ticks(frame.saturating_mul(self.frame.0.max(1)))
    }

    /// A moment in minutes and seconds since the start: `0:04.10`.
    #[must_use]
    pub fn label(&self, moment: Ticks) -> String {
        let seconds = self.timescale.seconds(moment - self.start).max(0.0);
        // A hair more, so that 0.29 s does not come out as 28 hundredths.
        let hundredths = (seconds * 100.0 + 1e-6).floor() as u64;
        format!("{}:{:02}.{:02}", hundredths / 6000, hundredths / 100 % 60, hundredths % 100)
    }
}

/// A segment as it lies on the timeline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// Where it begins, 0 at the first frame and 1 at the last one.
    pub start: f32,
    /// Where it ends, likewise.
    pub end: f32,
    /// Whether nothing is shown in it.
    pub is_gap: bool,
}

impl Timeline {
    /// Where segments lie; those that the timeline does not reach are left out.
    #[must_use]
    pub fn marks(&self, segments: &[Segment]) -> Vec<Mark> {
        let last = f64::from((self.frames() - 1).max(1));
        let share = |moment: Ticks| (f64::from(self.frame_at(moment)) / last) as f32;
        let end = self.start + self.duration;
        let reached = segments.iter().filter(|s| s.start < end && s.start + s.duration > self.start);
        reached
            .map(|segment| Mark {
                start: share(segment.start),
                end: share(segment.start + segment.duration),
                is_gap: segment.kind == SegmentKind::Gap,
            })
            .collect()
    }
}

/// A speed as the menu shows it: `0.25×`.
#[must_use]
pub fn speed_label(speed: Speed) -> String {
    format!("{}×", f64::from(speed.as_percent()) / 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ntsc(frames: i64) -> Timeline {
        Timeline {
            timescale: Timescale { numerator: 30_000, denominator: 1 },
            start: Ticks(0),
            duration: Ticks(1001 * frames),
            frame: Ticks(1001),
        }
    }

    #[test]
    fn frames_and_moments_agree_over_a_whole_half_at_ntsc_rate() {
        for start in [0, 77_000] {
            let timeline = Timeline { start: Ticks(start), ..ntsc(80_919) };
            assert_eq!(timeline.frames(), 80_919);
            for frame in (0..80_919).step_by(977) {
                assert_eq!(timeline.frame_at(timeline.start_of(frame)), frame);
                assert_eq!(timeline.frame_at(timeline.start_of(frame) + Ticks(1000)), frame);
            }
            assert_eq!(timeline.frame_at(Ticks(i64::MAX)), 80_918);
            assert_eq!(timeline.frame_at(Ticks(-5)), 0);
            assert_eq!(timeline.start_of(u32::MAX), Ticks(start + 80_918 * 1001));
        }
    }

    #[test]
    fn labels_do_not_round_up_into_the_next_second() {
        let timeline = ntsc(10_000);
        assert_eq!(timeline.label(Ticks(0)), "0:00.00");
        assert_eq!(timeline.label(Ticks(29_999)), "0:00.99");
        assert_eq!(timeline.label(Ticks(30_000 * 61 + 3_000)), "1:01.10");
        assert_eq!(Timeline { start: Ticks(30_000), ..timeline }.label(Ticks(60_000)), "0:01.00");
    }

    #[test]
    fn segments_lie_where_their_frames_are() {
        let timeline = Timeline { start: Ticks(10_010), ..ntsc(101) };
        let segment = |from: i64, frames: i64, kind| Segment {
            start: Ticks(10_010 + 1001 * from),
            duration: Ticks(1001 * frames),
            kind,
        };
        let marks = timeline.marks(&[
            segment(-10, 10, SegmentKind::Gap),
            segment(0, 50, SegmentKind::Shot),
            segment(50, 25, SegmentKind::Gap),
            segment(75, 26, SegmentKind::Shot),
            segment(300, 5, SegmentKind::Shot),
        ]);
        let places: Vec<(f32, f32, bool)> = marks.iter().map(|m| (m.start, m.end, m.is_gap)).collect();
        assert_eq!(places, [(0.0, 0.5, false), (0.5, 0.75, true), (0.75, 1.0, false)]);
    }

    #[test]
    fn speeds_are_labelled_as_factors() {
        let labels = SPEEDS_PERCENT.map(|percent| speed_label(Speed::percent(percent)));
        assert_eq!(labels, ["0.1×", "0.25×", "0.5×", "1×", "2×"]);
    }

    #[test]
    fn a_stream_with_silly_numbers_has_one_frame() {
        let timeline = Timeline { duration: Ticks(0), frame: Ticks(0), ..ntsc(1) };
        assert_eq!((timeline.frames(), timeline.frame_at(Ticks(77))), (1, 0));
    }
}
