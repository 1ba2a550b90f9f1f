//! Clip to shots: where one camera hands over to another, by a cut or by a dissolve, seen on thumbnails alone.
//!
//! What the camera itself does (pan, tilt, zoom) is taken out first, so that only what it cannot explain counts. A cut is a
//! single step that stands out from its neighbours (after Hanjalic 2002); a dissolve is a run of steps that all add the same
//! picture, the difference of the two scenes, whereas what moves in a scene leaves differences that do not add up.

mod detect;
mod measure;
mod motion;
#[cfg(test)]
mod tests;
mod thumbnail;

use std::{ops::Range, path::Path};

use serde::{Deserialize, Serialize};

pub use detect::ShotDetector;

use crate::ingest::{Clip, IngestError};

/// Frames of one camera without a break.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shot {
    /// Indices in `ClipInfo::frames`.
    pub frames: Range<usize>,
}

/// How one shot becomes the next over several frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TransitionKind {
    /// Both scenes are seen, the share of the second growing.
    Dissolve,
    /// Breaks so close to each other that nothing between them is a shot: flashes, an animated logo.
    Effect,
}

impl TransitionKind {
    /// Its name, as in the reason why a frame has no camera.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Dissolve => "dissolve",
            Self::Effect => "effect between shots",
        }
    }
}

/// Frames that belong to no shot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Transition {
    /// Indices in `ClipInfo::frames`.
    pub frames: Range<usize>,
    /// What happens in them.
    pub kind: TransitionKind,
}

/// The shots of a clip and what lies between them; together they cover every frame exactly once, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShotList {
    /// At least one frame each.
    pub shots: Vec<Shot>,
    /// None between two shots that follow each other by a cut.
    pub transitions: Vec<Transition>,
}

impl ShotList {
    /// One shot of `frames` frames.
    #[must_use]
    pub fn single(frames: usize) -> Self {
        let shots = (frames > 0).then_some(Shot { frames: 0..frames }).into_iter().collect();
        Self { shots, transitions: Vec::new() }
    }

    /// Number of the shot that a frame belongs to; `None` in a transition and after the last frame.
    #[must_use]
    pub fn shot_of(&self, frame: usize) -> Option<usize> {
        let number = self.shots.partition_point(|shot| shot.frames.end <= frame);
        self.shots.get(number).filter(|shot| shot.frames.contains(&frame)).map(|_| number)
    }

    /// Frames covered.
    #[must_use]
    pub fn frames(&self) -> usize {
        let shots = self.shots.last().map_or(0, |shot| shot.frames.end);
        self.transitions.last().map_or(0, |transition| transition.frames.end).max(shots)
    }
}

/// Opens a clip and finds its shots in the same pass.
///
/// # Errors
/// As [`Clip::open`].
pub fn open(path: &Path, range: Option<Range<u32>>) -> Result<(Clip, ShotList), IngestError> {
    let mut detector = ShotDetector::new();
    let clip = Clip::open_watched(path, range, &mut |thumbnail| detector.push(thumbnail))?;
    let list = detector.finish();
    tracing::info!(
        "{}: {} shots, {} dissolves or effects between them",
        path.display(),
        list.shots.len(),
        list.transitions.len()
    );
    Ok((clip, list))
}
