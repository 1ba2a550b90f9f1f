//! The ball against the truth: how often it is known, how far off it is, and whether its own figures say so.

use std::collections::BTreeMap;

use glam::DVec3;
use protocol::chunk::{Ball, BallSpread};
use serde::{Deserialize, Serialize};

use crate::report::{median, quantile};

/// The true ball counts as seen when at least this share of it is uncovered.
pub const VISIBLE_SHARE: f64 = 0.5;
/// A ball whose middle is higher than this flies, metres.
pub const FLIGHT_M: f64 = 0.35;
/// A ball farther from the truth than this is another thing, metres.
pub const WRONG_M: f64 = 2.0;

/// The true ball in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueBall {
    /// Its middle, world metres.
    pub position_m: DVec3,
    /// Where the camera is, world metres.
    pub camera_m: DVec3,
    /// In the picture, [`VISIBLE_SHARE`] of it uncovered, and no dissolve.
    pub seen: bool,
}

/// The figures of a ball over a clip. Errors are of frames in which the true ball is seen and the stream has a ball.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BallFigures {
    /// Frames in which the true ball is in the picture, at least half uncovered, outside dissolves.
    pub ball_frames_seen: usize,
    /// Share of these that have a ball in the stream, right or wrong.
    pub ball_coverage: f64,
    /// The same for frames in which the true ball is higher than 0.35 m.
    pub ball_coverage_flight: Option<f64>,
    /// Frames with a ball in the stream although the true one is hidden or out of the picture.
    pub ball_frames_unseen: usize,
    /// Distance from the true ball in space, metres: median.
    pub ball_error_median_m: Option<f64>,
    /// The same, not exceeded by 90 %.
    pub ball_error_p90_m: Option<f64>,
    /// Median where the true ball is not higher than 0.35 m.
    pub ball_error_ground_median_m: Option<f64>,
    /// Median where it is higher.
    pub ball_error_flight_median_m: Option<f64>,
    /// Not exceeded by 90 % of those.
    pub ball_error_flight_p90_m: Option<f64>,
    /// Median of the error along the line of sight.
    pub ball_error_along_median_m: Option<f64>,
    /// Median of the error across it.
    pub ball_error_across_median_m: Option<f64>,
    /// Share of frames that are more than 2 m off.
    pub ball_wrong_share: Option<f64>,
    /// Share of frames whose error is within two of the stream's own standard deviations, along and across together.
    pub ball_within_two_sigma: Option<f64>,
    /// The same for a true ball higher than 0.35 m.
    pub ball_within_two_sigma_flight: Option<f64>,
}

/// Compares the balls of a stream, by frame of the clip, with the truth.
#[must_use]
pub fn compare(truth: &BTreeMap<u32, TrueBall>, ours: &BTreeMap<u32, Ball>) -> BallFigures {
    let (mut all, mut ground, mut flight) = (Vec::new(), Vec::new(), Vec::new());
    let (mut along, mut across) = (Vec::new(), Vec::new());
    let (mut seen, mut seen_flight, mut unseen) = (0, 0, 0);
    let mut honest: Vec<(bool, bool)> = Vec::new();
    for (frame, true_ball) in truth {
        let ball = ours.get(frame);
        if !true_ball.seen {
            unseen += usize::from(ball.is_some());
            continue;
        }
        let flies = true_ball.position_m.y > FLIGHT_M;
        seen += 1;
        seen_flight += usize::from(flies);
        let Some(ball) = ball else { continue };
        let off = ball.position_m - true_ball.position_m;
        let sight = (true_ball.position_m - true_ball.camera_m).normalize_or(DVec3::NEG_Z);
        let along_m = off.dot(sight);
        all.push(off.length());
        if flies {
            flight.push(off.length())
        } else {
            ground.push(off.length())
        }
        along.push(along_m.abs());
        across.push((off - sight * along_m).length());
        honest.extend(ball.spread.map(|spread| (flies, off.length() <= two_sigma_m(&spread))));
    }
    let share = |part: usize, whole: usize| (whole > 0).then(|| part as f64 / whole as f64);
    let wrong = all.iter().filter(|&&error| error > WRONG_M).count();
    let kept = |only_flight: bool| {
        let chosen: Vec<bool> = honest.iter().filter(|h| h.0 || !only_flight).map(|h| h.1).collect();
        share(chosen.iter().filter(|within| **within).count(), chosen.len())
    };
    BallFigures {
        ball_frames_seen: seen,
        ball_coverage: share(all.len(), seen).unwrap_or(0.0),
        ball_coverage_flight: share(flight.len(), seen_flight),
        ball_frames_unseen: unseen,
        ball_error_median_m: median(&all),
        ball_error_p90_m: quantile(&all, 0.9),
        ball_error_ground_median_m: median(&ground),
        ball_error_flight_median_m: median(&flight),
        ball_error_flight_p90_m: quantile(&flight, 0.9),
        ball_error_along_median_m: median(&along),
        ball_error_across_median_m: median(&across),
        ball_wrong_share: share(wrong, all.len()),
        ball_within_two_sigma: kept(false),
        ball_within_two_sigma_flight: kept(true),
    }
}

/// Two standard deviations of the distance in space.
fn two_sigma_m(spread: &BallSpread) -> f64 {
    let (along, across) = (f64::from(spread.along_m), f64::from(spread.across_m));
    2.0 * (along * along + 2.0 * across * across).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(frames: u32) -> BTreeMap<u32, TrueBall> {
        let at = |frame: u32| TrueBall {
            position_m: DVec3::new(f64::from(frame), if frame.is_multiple_of(2) { 0.11 } else { 3.0 }, 0.0),
            camera_m: DVec3::new(f64::from(frame), 10.0, 60.0),
            seen: frame != 0,
        };
        (0..frames).map(|frame| (frame, at(frame))).collect()
    }

    fn ball(position_m: DVec3, sigma_m: f32) -> Ball {
        let spread = Some(BallSpread { along_m: sigma_m, across_m: 0.01 });
        Ball { position_m, height_known: true, spread }
    }

    #[test]
    fn the_truth_has_no_error_and_a_frame_out_of_view_counts_for_nothing() {
        let truth = truth(9);
        let ours = truth.iter().map(|(&f, t)| (f, ball(t.position_m, 0.1))).collect();
        let figures = compare(&truth, &ours);
        assert_eq!(
            (figures.ball_frames_seen, figures.ball_frames_unseen, figures.ball_coverage),
            (8, 1, 1.0)
        );
        assert_eq!((figures.ball_error_median_m, figures.ball_wrong_share), (Some(0.0), Some(0.0)));
        assert_eq!(figures.ball_within_two_sigma, Some(1.0));
    }

    #[test]
    fn errors_are_split_by_the_line_of_sight_and_held_against_their_own_figures() {
        let truth = truth(9);
        // A metre and a half towards the camera, for the balls in the air only.
        let moved = |t: &TrueBall| {
            let sight = (t.position_m - t.camera_m).normalize();
            if t.position_m.y > 1.0 { t.position_m - sight * 1.5 } else { t.position_m }
        };
        let ours = truth.iter().map(|(&f, t)| (f, ball(moved(t), 0.5))).collect();
        let figures = compare(&truth, &ours);
        assert!((figures.ball_error_flight_median_m.unwrap() - 1.5).abs() < 1e-9);
        assert_eq!(figures.ball_error_ground_median_m, Some(0.0));
        assert!(figures.ball_error_across_median_m.unwrap() < 1e-9);
        assert_eq!(figures.ball_within_two_sigma_flight, Some(0.0));
        assert_eq!(figures.ball_within_two_sigma, Some(0.5));
    }

    #[test]
    fn a_stream_without_a_ball_covers_nothing() {
        let figures = compare(&truth(5), &BTreeMap::new());
        assert_eq!((figures.ball_coverage, figures.ball_error_median_m), (0.0, None));
        assert_eq!(compare(&BTreeMap::new(), &BTreeMap::new()).ball_coverage, 0.0);
    }
}
