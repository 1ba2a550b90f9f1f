//! Shirt numbers: a small network of our own looks at the backs that are turned to the camera, and what it saw in many looks becomes one
//! number per person, or none. A wrong number is worse than none.
//!
//! [`due`] says who is looked at in which frame, [`NumberReader`] looks, [`evidence`] weighs all looks of a track, and [`decide`] sees to it that
//! no two players of a team carry one number at a time.

mod decide;
pub(crate) mod evidence;
mod patch;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use image::RgbImage;
use serde::{Deserialize, Serialize};

pub use decide::{Readings, decide};
pub use evidence::ShirtNumber;

use crate::{
    inference::{InferenceError, Model, Tensor},
    ingest::ClipInfo,
    pose::{POSE_SCORE_MIN, Person},
    tracking::{Sighting, Track},
};
use patch::{CELLS, Patch};

/// File name of the network in `assets/models`.
pub const MODEL: &str = "numbers.onnx";

/// Tens that the network tells apart: 0 stands for none.
const TENS: usize = 10;
/// Units.
const UNITS: usize = 10;
/// Somebody is looked at once in so many seconds: neighbouring pictures show the same and err alike.
const EVERY_S: f64 = 0.2;

/// What one look at a back gives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// Probabilities of the tens, if there is a number; the first is of numbers below 10.
    pub tens: [f32; TENS],
    /// Probabilities of the units.
    pub units: [f32; UNITS],
    /// Probability that there is a number and that it is in view.
    pub legible: f32,
}

/// The network, ready to run on one thread.
#[derive(Debug)]
pub struct NumberReader {
    model: Model,
}

impl NumberReader {
    /// Loads the shipped network.
    ///
    /// # Errors
    /// When ONNX Runtime or the model file is missing or unusable.
    pub fn load() -> Result<Self, InferenceError> {
        Ok(Self { model: Model::load_shipped(MODEL)? })
    }

    /// Looks at somebody's back; `None` when it is turned away or too small.
    ///
    /// # Errors
    /// When the network fails.
    pub fn read(&mut self, picture: &RgbImage, person: &Person) -> Result<Option<Reading>, InferenceError> {
        let Some(patch) = Patch::of(person).filter(|patch| patch.shows_the_back() && !picture.is_empty())
        else {
            return Ok(None);
        };
        self.look(&patch.sample(picture)).map(Some)
    }

    /// Runs the network on the colours of [`CELLS`]² cells.
    fn look(&mut self, cells: &[[f32; 3]]) -> Result<Reading, InferenceError> {
        let channel = |channel: usize| cells.iter().filter_map(move |cell| cell.get(channel).copied());
        let input: Vec<f32> = (0..3).flat_map(channel).collect();
        let outputs = self.model.run(&[(&[1, 3, CELLS, CELLS], &input)])?;
        reading(&outputs).ok_or_else(|| self.model.unexpected("10 tens, 10 units and one more", &outputs))
    }
}

fn reading(outputs: &[Tensor]) -> Option<Reading> {
    let [tens, units, legible] = outputs else { return None };
    let probable = |value: f32| if value.is_finite() { value.clamp(0.0, 1.0) } else { 0.0 };
    let ten =
        |tensor: &Tensor| <[f32; 10]>::try_from(tensor.data.as_slice()).ok().map(|ten| ten.map(probable));
    let [legible] = legible.data.as_slice() else { return None };
    Some(Reading { tens: ten(tens)?, units: ten(units)?, legible: probable(*legible) })
}

/// Who is to be looked at: for every frame, indices into its people. Of every person's sightings within [`EVERY_S`] it is the one in which the
/// number is drawn largest, among those in which nobody nearer stands before it.
#[must_use]
pub fn due(people: &[Vec<Person>], tracks: &[Track], info: &ClipInfo) -> Vec<Vec<usize>> {
    let mut due = vec![Vec::new(); people.len()];
    for track in tracks {
        let mut best: BTreeMap<i64, (f64, Sighting)> = BTreeMap::new();
        for sighting in &track.sightings {
            let size = people.get(sighting.frame).and_then(|frame| drawn_px(frame, sighting.person_index));
            let (Some(size), Some(time)) = (size, info.frames.get(sighting.frame)) else { continue };
            // A hair more, so that rounding does not put the first frame of a spell into the one before.
            let spell = (info.timescale.seconds(time.start) / EVERY_S + 1e-6).floor() as i64;
            let kept = best.entry(spell).or_insert((size, *sighting));
            if size > kept.0 {
                *kept = (size, *sighting);
            }
        }
        for (_, sighting) in best.into_values() {
            if let Some(place) = due.get_mut(sighting.frame) {
                place.push(sighting.person_index);
            }
        }
    }
    due
}

/// How wide the back of somebody is drawn, pixels; `None` when a number on it could not be read.
fn drawn_px(frame: &[Person], index: usize) -> Option<f64> {
    let person = frame.get(index).filter(|person| person.pose_score >= POSE_SCORE_MIN)?;
    let patch = Patch::of(person).filter(Patch::shows_the_back)?;
    let nearer =
        |other: &Person| other.bounds.max.y > person.bounds.max.y && other.bounds.contains(patch.middle);
    let hidden = frame.iter().enumerate().any(|(i, other)| i != index && nearer(other));
    (!hidden).then_some(patch.turn * patch.side_px())
}
