//! From a run of sights to places in metres: stretches, their joint fit, and what each frame is then worth.

use glam::DVec3;
use nalgebra::{Matrix3, Vector3};
use protocol::{camera::Camera, pitch::Pitch};

use super::{
    BallEstimate, BallState, RADIUS_M,
    arc::{self, Law, Square},
    cuts::{self, Cut},
    fit::{self, Fit, Pin, Stretch},
    joint,
    segments::{self, Kind, Segment},
    sight::{self, Moment, Sight},
};
use crate::pose::Person;

/// Sights are never taken to be worse than this many times what is usual.
const NOISE_MAX: f64 = 3.0;
/// What camera and laws leave out: pixels, and metres.
const CAMERA_SIGMA_PX: f64 = 0.8;
const MODEL_SIGMA_M: f64 = 0.04;
/// Standard deviations along the sight of a ball in the air are larger than the fit's by this factor: what its ends rest on is
/// sometimes the wrong thing. Measured on made-up matches of the development seeds (`docs/ball.md`).
const FLIGHT_DOUBT: f64 = 1.5;
/// A place less sure than this is not known, metres along and across the line of sight.
const ALONG_MAX_M: f64 = 3.5;
const ACROSS_MAX_M: f64 = 1.0;
/// Farther from any sight than this nothing is known, seconds.
const UNSEEN_MAX_S: f64 = 0.8;
/// A ball in hands is so far before or behind the body's plane, and so well seen across, metres.
const HELD_ALONG_M: f64 = 0.45;
const HELD_ACROSS_M: f64 = 0.08;
/// On the grass an unseen ball may be pushed this hard, m/s².
const UNSEEN_PUSH: f64 = 4.0;
/// A stretch on the grass that fewer sights tell of may be something else.
const SURE_SIGHTS: usize = 6;
/// The ball may be so far beyond the pitch, metres.
const OUTSIDE_M: f64 = 12.0;

/// Explains a run of sights and writes what is known into `found`, an entry per moment.
pub(super) fn explain(
    sights: &[Sight],
    moments: &[Moment],
    people: &[Vec<Person>],
    pitch: &Pitch,
    found: &mut [Option<BallEstimate>],
) {
    let cuts = cuts::between(sights, moments, people);
    let chosen = segments::best(sights, &cuts, people);
    let meetings: Vec<Pin> = chosen
        .windows(2)
        .map(|pair| match pair {
            [before, after] => {
                cuts.get(before.cuts[1]).map_or(Pin::Free, |cut| segments::meeting(before, after, cut))
            }
            _ => Pin::Free,
        })
        .collect();
    let mut rest = chosen.as_slice();
    while let Some(first) = rest.first() {
        let length = rest.iter().take_while(|segment| matches!(segment.kind, Kind::Free { .. })).count();
        let (part, after) = rest.split_at(length.max(1));
        let places = match &first.kind {
            Kind::Free { .. } => {
                let number = chosen.len() - rest.len();
                fitted(part, &meetings, number, sights, &cuts, moments)
            }
            Kind::Held(way) => held(first, way, sights, &cuts, moments),
            Kind::Unknown => Vec::new(),
        };
        for (frame, place) in places {
            let Some(camera) = moments.get(frame).and_then(|moment| moment.camera) else { continue };
            let seen = sights.binary_search_by_key(&frame, |sight| sight.frame).is_ok();
            if unseen_s(sights, moments[frame].seconds) <= UNSEEN_MAX_S
                && let Some(estimate) = place.estimate(&camera, seen, pitch)
                && let Some(entry) = found.get_mut(frame)
            {
                *entry = Some(estimate);
            }
        }
        rest = after;
    }
}

/// How far in time the nearest sight is.
fn unseen_s(sights: &[Sight], seconds: f64) -> f64 {
    let next = sights.partition_point(|sight| sight.seconds < seconds);
    let around = [next.checked_sub(1), Some(next)].into_iter().flatten().filter_map(|k| sights.get(k));
    around.map(|sight| (sight.seconds - seconds).abs()).fold(f64::INFINITY, f64::min)
}

/// A place with its covariance.
struct Place {
    position: Vector3<f64>,
    covariance: Matrix3<f64>,
    state: BallState,
    height_known: bool,
}

impl Place {
    /// What the frame is told; `None` when that is too little.
    fn estimate(&self, camera: &Camera, seen: bool, pitch: &Pitch) -> Option<BallEstimate> {
        let mut position_m = arc::point(&self.position);
        position_m.y = position_m.y.max(RADIUS_M);
        let inside = pitch.contains(glam::DVec2::new(position_m.x, position_m.z), OUTSIDE_M);
        if !position_m.is_finite() || !inside {
            return None;
        }
        let sight = (position_m - camera.position).normalize_or(DVec3::NEG_Z);
        let along = arc::vector(sight);
        // An error of the camera moves what is on the grass along the grass, that is more along the sight than across.
        let across_m = CAMERA_SIGMA_PX / camera.pixels_per_metre(position_m);
        let slant_m = match self.state {
            BallState::Ground => across_m / sight.y.abs().max(0.05),
            BallState::Flight | BallState::Held => across_m,
        };
        let trace = self.covariance.trace();
        let along_square = along.dot(&(self.covariance * along));
        let doubt = if self.state == BallState::Flight { FLIGHT_DOUBT } else { 1.0 };
        let sigma_along_m = (along_square * doubt.powi(2) + slant_m.powi(2) + MODEL_SIGMA_M.powi(2)).sqrt();
        let sigma_across_m =
            ((trace - along_square).max(0.0) / 2.0 + across_m.powi(2) + MODEL_SIGMA_M.powi(2)).sqrt();
        (sigma_along_m < ALONG_MAX_M && sigma_across_m < ACROSS_MAX_M).then_some(BallEstimate {
            position_m,
            sigma_along_m,
            sigma_across_m,
            height_known: self.height_known,
            state: self.state,
            seen,
        })
    }
}

/// Frames whose moment lies between two cuts.
fn frames(cuts: &[Cut], [from, to]: [usize; 2], moments: &[Moment]) -> std::ops::Range<usize> {
    let place = |cut: usize| {
        cuts.get(cut)
            .map_or(moments.len(), |cut| moments.partition_point(|moment| moment.seconds < cut.seconds))
    };
    place(from)..place(to)
}

/// Places of stretches that follow each other, fitted together.
fn fitted(
    segments: &[Segment],
    meetings: &[Pin],
    number: usize,
    sights: &[Sight],
    cuts: &[Cut],
    moments: &[Moment],
) -> Vec<(usize, Place)> {
    let mut chain: Vec<joint::Link<'_>> = segments.iter().filter_map(|s| link(s, sights, cuts)).collect();
    let meeting = |before: usize| meetings.get(before).copied().unwrap_or(Pin::Free);
    for (k, link) in chain.iter_mut().enumerate() {
        // A handover inside the chain counts once.
        let start = if k == 0 { (number + k).checked_sub(1).map_or(Pin::Free, meeting) } else { Pin::Free };
        for (pin, met) in link.pins.iter_mut().zip([start, meeting(number + k)]) {
            if met != Pin::Free {
                *pin = met;
            }
        }
    }
    let covariances = joint::refine(&mut chain);
    let noise = noise(&chain);
    let mut places = Vec::new();
    for ((segment, link), covariance) in segments.iter().zip(&chain).zip(covariances) {
        let Some(covariance) = covariance.map(|covariance| covariance * noise.powi(2)) else { continue };
        let frames = frames(cuts, segment.cuts, moments);
        let sure = link.fit.law == Law::Air || link.fit.explained >= SURE_SIGHTS || segments.len() > 1;
        let seconds = frames.clone().map(|frame| moments[frame].seconds);
        for (frame, state) in frames.clone().zip(link.fit.states(seconds)) {
            let mut place = place(&link.fit, &state, &covariance, sure);
            if link.fit.law == Law::Grass {
                // Whoever dribbles unseen may have turned.
                let push = link.stretch.push_sigma.max(UNSEEN_PUSH);
                let wander_m = push * unseen_s(sights, moments[frame].seconds).powi(2) / 2.0;
                place.covariance += Matrix3::from_diagonal(&Vector3::new(1.0, 0.0, 1.0)) * wander_m.powi(2);
            }
            places.push((frame, place));
        }
    }
    places
}

/// How many times larger the sights' errors are than they were taken to be; at least 1.
fn noise(chain: &[joint::Link<'_>]) -> f64 {
    let mut errors: Vec<f64> = chain
        .iter()
        .flat_map(|link| {
            let sights = link.stretch.sights;
            let states = link.fit.states(sights.iter().map(|sight| sight.seconds));
            sights.iter().zip(states).filter_map(|(sight, state)| {
                let (pixel, _) = sight::project(&sight.camera, arc::point(&state.position))?;
                Some((pixel.x - sight.pixel.x).hypot(pixel.y - sight.pixel.y) / fit::PIXEL_SIGMA)
            })
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    // The median length of a normal error in two dimensions is 1.18 standard deviations of one.
    errors.get(errors.len() / 2).map_or(1.0, |median| (median / 1.18).clamp(1.0, NOISE_MAX))
}

fn link<'a>(segment: &Segment, sights: &'a [Sight], cuts: &[Cut]) -> Option<joint::Link<'a>> {
    let Kind::Free { fit, pins, push_sigma } = &segment.kind else { return None };
    let [from, to] = segment.cuts;
    let (first, last) = (cuts.get(from)?, cuts.get(to)?);
    let stretch = Stretch {
        sights: sights.get(first.sight..last.sight)?,
        from_s: first.seconds,
        to_s: last.seconds,
        push_sigma: *push_sigma,
    };
    Some(joint::Link { stretch, pins: *pins, fit: (**fit).clone(), slack_s: last.slack_s })
}

fn place(fit: &Fit, state: &arc::State, covariance: &Square, sure: bool) -> Place {
    let state_kind = match fit.law {
        Law::Grass => BallState::Ground,
        Law::Air => BallState::Flight,
    };
    Place {
        position: state.position,
        covariance: fit::spread(covariance, &state.by_position),
        state: state_kind,
        height_known: sure,
    }
}

/// Places of a ball in hands: at the sights, and straight between them.
fn held(
    segment: &Segment,
    way: &[Vector3<f64>],
    sights: &[Sight],
    cuts: &[Cut],
    moments: &[Moment],
) -> Vec<(usize, Place)> {
    let first = cuts.get(segment.cuts[0]).map_or(0, |cut| cut.sight);
    let known: Vec<(f64, Vector3<f64>)> =
        sights.iter().skip(first).zip(way).map(|(sight, point)| (sight.seconds, *point)).collect();
    let at = |seconds: f64| {
        let next = known.partition_point(|(s, _)| *s < seconds);
        let (before, after) = (known.get(next.saturating_sub(1))?, known.get(next).or(known.last())?);
        let share = ((seconds - before.0) / (after.0 - before.0).max(1e-6)).clamp(0.0, 1.0);
        Some(before.1.lerp(&after.1, share))
    };
    frames(cuts, segment.cuts, moments)
        .filter_map(|frame| {
            let position = at(moments[frame].seconds)?;
            let sight = arc::vector((arc::point(&position) - moments[frame].camera?.position).normalize());
            let covariance = Matrix3::identity() * HELD_ACROSS_M.powi(2)
                + sight * sight.transpose() * HELD_ALONG_M.powi(2);
            Some((frame, Place { position, covariance, state: BallState::Held, height_known: true }))
        })
        .collect()
}
