//! Shirt numbers: the clip passes once more, and backs are looked at when it is known whose they are and where the joints really lie.
//!
//! In the pass of the pose stage neither is known yet: every back would have to be looked at, and left and right are sometimes exchanged.

use std::collections::BTreeMap;

use protocol::manifest::PersonId;

use super::{PipelineError, run::Run};
use crate::{
    numbers::{self, NumberReader, Reading, Readings, ShirtNumber},
    pose::Person,
    report::Stage,
    teams::Member,
    tracking::{Sighting, Track},
};

impl Run<'_> {
    /// What looks at the backs of those who are followed show.
    pub(super) fn read_backs(
        &mut self,
        people: &[Vec<Person>],
        tracks: &[Track],
    ) -> Result<Readings, PipelineError> {
        let settings = format!("{:?}", self.options.tracking);
        let results = self.results(Stage::Numbers, numbers::MODEL, &[settings.as_bytes()])?;
        let due = numbers::due(people, tracks, self.clip.info());
        let wanted: Vec<bool> = due.iter().map(|people| !people.is_empty()).collect();
        let looks = self.per_frame(
            Stage::Numbers,
            &results,
            &wanted,
            || Ok(NumberReader::load()?),
            |reader, frame| {
                let mut looks: Vec<(usize, Reading)> = Vec::new();
                let frame_people = people.get(frame.index).map_or(&[][..], Vec::as_slice);
                for &person_index in due.get(frame.index).into_iter().flatten() {
                    let Some(person) = frame_people.get(person_index) else { continue };
                    if let Some(reading) = reader.read(&frame.image, person)? {
                        looks.push((person_index, reading));
                    }
                }
                Ok(looks)
            },
        )?;
        Ok(looks
            .into_iter()
            .enumerate()
            .flat_map(|(frame, looks)| looks.into_iter().flatten().map(move |look| (frame, look)))
            .map(|(frame, (person_index, reading))| (Sighting { frame, person_index }, reading))
            .collect())
    }
}

/// The shirt numbers that can be read.
pub(super) fn numbers(
    tracks: &[Track],
    members: &[Member],
    readings: &Readings,
) -> BTreeMap<PersonId, ShirtNumber> {
    let read = numbers::decide(tracks, members, readings);
    tracing::info!(
        "numbers: {} of {} people read in {} looks at backs",
        read.len(),
        tracks.len(),
        readings.len()
    );
    read
}
