//! The camera of one picture without any help: a network names points and lines of the pitch, two-point hypotheses from where
//! broadcast cameras stand explain them, a robust fit on points and lines refines the best, and the painted lines of the
//! picture itself settle it (section 4.1, whose four clicked points this replaces).
//!
//! The world is turned so that the camera stands on the near side or behind the left goal: from the picture alone nobody
//! can tell these from their opposites.

mod confidence;
mod crossings;
mod evidence;
mod hypotheses;
mod names;
mod readings;
mod refine;
#[cfg(test)]
mod tests;

use image::RgbImage;
use protocol::{camera::Camera, pitch::Pitch};

use super::{
    fit::{onto_lines, residual},
    least_squares::{Normal, PARAMETERS, RADIAL},
    lines::LinePixels,
    sequence, template,
};
use crate::{
    geometry::PixelBox,
    inference::{InferenceError, Model},
    report::thread_cpu_s,
};
use confidence::Agreement;
use evidence::Evidence;
use hypotheses::Pair;
pub(crate) use names::points as pitch_points;
use readings::{End, before_goal};
pub(crate) use refine::Terms;
use refine::{Named, beside_lines, refine};

/// File name of the network in `assets/models`.
pub(crate) const MODEL: &str = "pitch.onnx";

/// Fewer named points and crossings than this fix no camera.
const PAIRS_MIN: usize = 3;
/// A camera that nothing else speaks for must be more likely right than not.
pub(crate) const CONFIDENCE_MIN: f64 = 0.5;
/// From this confidence on, other readings of the names are not tried.
const CLEAR: f64 = 0.9;

/// A camera found in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Located {
    /// The camera.
    pub camera: Camera,
    /// Probability that it is right, 0..1, as far as rendered pictures can tell: see `docs/calibration.md` for real ones.
    pub confidence: f64,
}

impl Located {
    /// Whether the camera is to be used though nothing else speaks for it.
    pub(crate) fn is_sure(&self) -> bool {
        self.confidence >= CONFIDENCE_MIN
    }
}

/// Finds cameras in pictures; one per thread.
#[derive(Debug)]
pub(crate) struct Locator {
    model: Model,
    terms: Terms,
    network_s: f64,
}

impl Locator {
    /// Loads the network.
    ///
    /// # Errors
    /// When ONNX Runtime or the model is missing or unusable.
    pub(crate) fn load() -> Result<Self, InferenceError> {
        Ok(Self { model: Model::load_shipped(MODEL)?, terms: Terms::default(), network_s: 0.0 })
    }

    /// The same with some terms of the fit left out.
    pub(crate) fn with_terms(self, terms: Terms) -> Self {
        Self { terms, ..self }
    }

    /// Processor time that the network took so far, seconds.
    pub(crate) fn network_s(&self) -> f64 {
        self.network_s
    }

    /// The best guess of the camera of a picture of a pitch of known size, however unsure; `people` hide lines. `Err` in the inner
    /// result says in plain words why there is none.
    ///
    /// # Errors
    /// When the network fails.
    pub(crate) fn guess(
        &mut self,
        picture: &RgbImage,
        people: &[PixelBox],
        pitch: &Pitch,
    ) -> Result<Result<Located, String>, InferenceError> {
        let started = thread_cpu_s();
        let evidence = evidence::find(&mut self.model, picture)?;
        self.network_s += thread_cpu_s() - started;
        let named = Named::new(pitch);
        let mut reading = evidence;
        let mut best = self.read(&reading, &named, pitch);
        // Names that fit together are not doubted.
        if !best.as_ref().is_ok_and(|located| located.confidence >= CLEAR) {
            for other_reading in [End::Left, End::Right].map(|end| before_goal(&reading, end)) {
                let other = self.read(&other_reading, &named, pitch);
                let confidence =
                    |guess: &Result<Located, String>| guess.as_ref().map_or(0.0, |g| g.confidence);
                if confidence(&other) > confidence(&best) {
                    (best, reading) = (other, other_reading);
                }
            }
        }
        Ok(best.map(|located| {
            if !self.terms.polish {
                return located;
            }
            let further = |camera: &Camera| beside_lines(camera, &reading, &named, self.terms);
            let camera = polish(&located.camera, picture, people, pitch, self.terms.radial, further);
            Located { camera, ..located }
        }))
    }

    /// The best camera for one reading of the evidence.
    fn read(&self, evidence: &Evidence, named: &Named, pitch: &Pitch) -> Result<Located, String> {
        let (camera, _) = explain(evidence, named, pitch, self.terms)?;
        let agreement = Agreement::of(&camera, evidence, named);
        tracing::debug!(?agreement, "camera from named points and lines");
        Ok(Located { camera, confidence: agreement.confidence() })
    }
}

/// The camera that explains the evidence best, and its cost.
fn explain(evidence: &Evidence, named: &Named, pitch: &Pitch, terms: Terms) -> Result<(Camera, f64), String> {
    let points = if terms.points { evidence.points.as_slice() } else { &[] };
    let mut pairs: Vec<Pair> = points
        .iter()
        .filter_map(|point| {
            let world = *named.points.get(point.name).filter(|world| world.y == 0.0)?;
            Some(Pair { world, pixel: point.pixel, weight: point.score })
        })
        .collect();
    if terms.lines {
        pairs.extend(crossings::crossings(evidence, pitch));
    }
    if pairs.len() < PAIRS_MIN {
        return Err(format!("no pitch camera here: {} points of a pitch are seen", pairs.len()));
    }
    hypotheses::hypotheses(&pairs, evidence.size_px, pitch)
        .iter()
        .map(|start| refine(start, evidence, named, terms))
        .filter(|(camera, cost)| cost.is_finite() && camera.position.y > 2.0)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .ok_or_else(|| "no pitch camera here: no camera sees the points where they are".to_owned())
}

/// The camera moved onto the painted lines of the picture, when these agree with it better there.
fn polish(
    camera: &Camera,
    picture: &RgbImage,
    people: &[PixelBox],
    pitch: &Pitch,
    radial: bool,
    further: impl Fn(&Camera) -> Normal,
) -> Camera {
    let lines = LinePixels::find(picture, people);
    let map = lines.map();
    let samples = template::samples(pitch);
    let mut free = [true; PARAMETERS];
    free[RADIAL] = radial;
    let before = residual(camera, &samples, people, &map);
    // Twice: the points that are visible are chosen again once the camera is better.
    let moved = (0..2).fold(*camera, |camera, _| onto_lines(&camera, free, &samples, people, &map, &further));
    let after = residual(&moved, &samples, people, &map);
    let better = after.1 >= sequence::LEAST_POINTS && after.0.zip(before.0).is_some_and(|(a, b)| a <= b);
    if better { moved } else { *camera }
}
