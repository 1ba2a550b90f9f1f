//! Section 4.3: which pixels belong to a tracked player.
//!
//! Frames pass a [`Segmenter`] once, in order; it keeps what it still needs of them (crops, never whole pictures) and gives masks as soon
//! as they are decided. The methods of the ablation are the [`Method`]s; `docs/segmentation.md` says how they compare.

mod blocks;
mod crf;
mod energy;
mod exclusive;
mod grid;
mod lattice;
mod minimum;
mod paper;
mod refine;

use std::collections::BTreeMap;

use image::RgbImage;
use protocol::manifest::PersonId;
use serde::{Deserialize, Serialize};

pub use paper::{PaperSegmenter, Parts};
pub use refine::{MODEL, RefiningSegmenter};

pub use exclusive::exclusive;

use crate::{
    geometry::Mask,
    inference::InferenceError,
    pose::Person,
    tracking::{Sighting, Track},
};

/// The pixels of one tracked person in one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlayerMask {
    /// Whose.
    pub sighting: Sighting,
    /// Which pixels.
    pub mask: Mask,
}

/// One frame as it passes a [`Segmenter`].
#[derive(Clone, Copy, Debug)]
pub struct FrameSeen<'a> {
    /// Index in `ClipInfo::frames`.
    pub index: usize,
    /// The picture.
    pub picture: &'a RgbImage,
    /// Everybody found in it.
    pub people: &'a [Person],
    /// Who of them is followed: whose track, and index in `people`.
    pub followed: &'a [(PersonId, usize)],
}

impl<'a> FrameSeen<'a> {
    /// Those who are followed: whose track, index in `people`, and the person.
    fn tracked(&self) -> impl Iterator<Item = (PersonId, usize, &'a Person)> {
        let people = self.people;
        self.followed.iter().filter_map(move |&(id, index)| Some((id, index, people.get(index)?)))
    }

    /// Everybody but one.
    fn others(&self, index: usize) -> impl Iterator<Item = &'a Person> {
        self.people.iter().enumerate().filter(move |(i, _)| *i != index).map(|(_, other)| other)
    }
}

/// A way to find the pixels of tracked people. Masks come with the frame they were asked for or later, in no order.
pub trait Segmenter {
    /// Takes the next frame; gives the masks that are now decided.
    ///
    /// # Errors
    /// When a network fails.
    fn push(&mut self, seen: &FrameSeen<'_>) -> Result<Vec<PlayerMask>, SegmentationError>;

    /// No further frame comes: the masks still open.
    ///
    /// # Errors
    /// When a network fails.
    fn finish(&mut self) -> Result<Vec<PlayerMask>, SegmentationError> {
        Ok(Vec::new())
    }
}

/// Why masks could not be made.
#[derive(Debug, thiserror::Error)]
pub enum SegmentationError {
    /// The network could not be loaded or run.
    #[error("mask network: {0}")]
    Inference(#[from] InferenceError),
}

/// The ways to find masks that the ablation compares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Method {
    /// The pose network's own instance mask.
    Network,
    /// The same, minus pixels nearer to somebody else's skeleton.
    Claims,
    /// The same, times the energy's mask (Mₒ).
    NetworkEnergy,
    /// The temporal CRF (M_CNN) on it.
    Crf,
    /// The paper's product of energy and CRF.
    Paper,
    /// A small network that sees the picture, the pose network's masks and everybody's skeleton.
    Refined,
}

impl Method {
    /// What `reconstruct` uses.
    pub const DEFAULT: Self = Self::Refined;

    /// Every method, the default first.
    pub const ALL: [Self; 6] =
        [Self::DEFAULT, Self::Network, Self::Claims, Self::NetworkEnergy, Self::Crf, Self::Paper];

    /// Its name on the command line and in figures.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Network => "network",
            Self::Claims => "claims",
            Self::NetworkEnergy => "network-energy",
            Self::Crf => "crf",
            Self::Paper => "paper",
            Self::Refined => "refined",
        }
    }

    /// Makes it ready for a clip.
    ///
    /// # Errors
    /// When its network is missing or unusable.
    pub fn open(self) -> Result<Box<dyn Segmenter>, SegmentationError> {
        let paper = |parts| Ok(Box::new(PaperSegmenter::new(parts)) as Box<dyn Segmenter>);
        match self {
            Self::Network => Ok(Box::new(InstanceMaskSegmenter { claims: false })),
            Self::Claims => Ok(Box::new(InstanceMaskSegmenter { claims: true })),
            Self::NetworkEnergy => paper(Parts { energy: true, crf: false }),
            Self::Crf => paper(Parts { energy: false, crf: true }),
            Self::Paper => paper(Parts { energy: true, crf: true }),
            Self::Refined => Ok(Box::new(RefiningSegmenter::load()?)),
        }
    }
}

/// The pose network's instance mask.
#[derive(Clone, Copy, Debug)]
pub struct InstanceMaskSegmenter {
    /// Whether pixels go that belong more to somebody else in the frame.
    pub claims: bool,
}

impl Segmenter for InstanceMaskSegmenter {
    fn push(&mut self, seen: &FrameSeen<'_>) -> Result<Vec<PlayerMask>, SegmentationError> {
        let masks = seen.tracked().map(|(_, person_index, person)| {
            let mask = if self.claims {
                exclusive::own_pixels(person, seen.others(person_index))
            } else {
                person.mask.clone()
            };
            PlayerMask { sighting: Sighting { frame: seen.index, person_index }, mask }
        });
        Ok(masks.collect())
    }
}

/// Who is followed in each of `frames` frames, by track: what [`FrameSeen::followed`] wants.
#[must_use]
pub fn followed(tracks: &[Track], frames: usize) -> Vec<Vec<(PersonId, usize)>> {
    let mut all = vec![Vec::new(); frames];
    for track in tracks {
        for sighting in &track.sightings {
            if let Some(frame) = all.get_mut(sighting.frame) {
                frame.push((track.person, sighting.person_index));
            }
        }
    }
    all
}

/// The decided masks by frame, pixels that several people hold given to one of them; masks without any pixel are left out.
#[must_use]
pub fn settled(masks: Vec<PlayerMask>, people: &[Vec<Person>]) -> BTreeMap<usize, Vec<PlayerMask>> {
    let mut frames: BTreeMap<usize, Vec<PlayerMask>> = BTreeMap::new();
    for mask in masks {
        frames.entry(mask.sighting.frame).or_default().push(mask);
    }
    for (frame, masks) in &mut frames {
        masks.sort_by_key(|mask| mask.sighting.person_index);
        exclusive(masks, people.get(*frame).map_or(&[], Vec::as_slice));
        masks.retain(|found| found.mask.area_px() > 0);
    }
    frames
}

#[cfg(test)]
pub(crate) mod tests;
