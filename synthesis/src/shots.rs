//! The order in which cameras are on air: shots with cuts and dissolves between them, and what that means for each frame.

use std::str::FromStr;

use protocol::camera::Camera;
use serde::{Deserialize, Serialize};

use crate::{SynthesisError, render::Focus};

/// Which camera is on air.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ShotKind {
    /// The main camera over the halfway line.
    Main,
    /// High behind a goal.
    HighBehind,
    /// One player fills the picture.
    CloseUp,
}

/// One shot of a clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shot {
    /// Its camera.
    pub kind: ShotKind,
    /// Its length in frames, the dissolve into it included; 0 is until the end.
    pub frames: u32,
    /// Frames in which the shot before fades into this one; 0 is a cut.
    pub dissolve: u32,
}

/// Shots one after the other. As text: `main:60,close-up:25~8,main`: kind, frames, `~` frames of dissolve.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shots(pub Vec<Shot>);

impl Default for Shots {
    /// The main camera all the time.
    fn default() -> Self {
        Self(vec![Shot { kind: ShotKind::Main, frames: 0, dissolve: 0 }])
    }
}

impl FromStr for Shots {
    type Err = SynthesisError;

    fn from_str(text: &str) -> Result<Self, SynthesisError> {
        let shot = |part: &str| {
            let (kind, length) = part.split_once(':').unwrap_or((part, "0"));
            let (frames, dissolve) = length.split_once('~').unwrap_or((length, "0"));
            let kind = match kind.trim() {
                "main" => ShotKind::Main,
                "high-behind" => ShotKind::HighBehind,
                "close-up" => ShotKind::CloseUp,
                _ => return None,
            };
            Some(Shot { kind, frames: frames.trim().parse().ok()?, dissolve: dissolve.trim().parse().ok()? })
        };
        let wrong = |part: &str| {
            SynthesisError::Options(format!(
                "`{part}` is no shot: write main, high-behind or close-up, then :FRAMES, then ~FRAMES for a dissolve, \
                 as in main:60,close-up:25~8,main"
            ))
        };
        let shots: Result<Vec<Shot>, _> =
            text.split(',').map(|part| shot(part).ok_or_else(|| wrong(part))).collect();
        shots.map(Self)
    }
}

/// What a frame shows, for the truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ShotTruth {
    /// Number of the shot that gives the frame its camera.
    pub shot: usize,
    /// That shot's kind.
    pub kind: ShotKind,
    /// Whether that is the main camera and it gives at least half of the light.
    pub main_camera: bool,
    /// During a dissolve: the other shot's number, and the share of the light that comes from it.
    pub mixed_with: Option<(usize, f64)>,
}

/// One picture that goes into a frame.
#[derive(Clone, Copy, Debug)]
pub struct Take {
    /// The shot's number.
    pub shot: usize,
    /// Its kind.
    pub kind: ShotKind,
    /// Its camera in this frame.
    pub camera: Camera,
    /// The same camera one frame on (at the end of the clip: one frame back).
    pub next: Camera,
    /// Depth of field.
    pub focus: Option<Focus>,
    /// Share of the frame's light.
    pub share: f64,
}

/// The frame that a moving camera is compared with: the next one, at the end of the clip the one before.
#[must_use]
pub fn beside(frame: usize, frames: usize) -> usize {
    if frame + 1 < frames { frame + 1 } else { frame.saturating_sub(1) }
}

/// One frame of the film: the picture that dominates, and the one it is mixed with.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// The picture whose camera the truth tells.
    pub main: Take,
    /// The other picture of a dissolve.
    pub other: Option<Take>,
}

impl Frame {
    /// What the truth says about it.
    #[must_use]
    pub fn truth(&self) -> ShotTruth {
        ShotTruth {
            shot: self.main.shot,
            kind: self.main.kind,
            main_camera: self.main.kind == ShotKind::Main,
            mixed_with: self.other.map(|other| (other.shot, other.share)),
        }
    }
}

impl Shots {
    /// Which shots a frame shows and with which shares; the larger share first.
    #[must_use]
    pub fn at(&self, frame: usize) -> [(usize, f64); 2] {
        let (mut first, mut index) = (0usize, 0usize);
        while let Some(shot) = self.0.get(index) {
            let last = index + 1 == self.0.len() || shot.frames == 0;
            if last || frame < first + shot.frames as usize {
                break;
            }
            first += shot.frames as usize;
            index += 1;
        }
        let since = frame - first;
        let dissolve = self.0.get(index).map_or(0, |shot| shot.dissolve) as usize;
        if index == 0 || since >= dissolve {
            return [(index, 1.0), (index, 0.0)];
        }
        let share = (since + 1) as f64 / (dissolve + 1) as f64;
        if share >= 0.5 {
            [(index, share), (index - 1, 1.0 - share)]
        } else {
            [(index - 1, 1.0 - share), (index, share)]
        }
    }

    /// The first frame of a shot.
    #[must_use]
    pub fn first_frame(&self, index: usize) -> usize {
        self.0.iter().take(index).map(|shot| shot.frames as usize).sum()
    }

    /// The film of `frames` frames. `camera` gives the camera and focus of a shot, by number, at a frame.
    pub fn film(
        &self,
        frames: usize,
        camera: impl Fn(usize, usize) -> (Camera, Option<Focus>),
    ) -> Vec<Frame> {
        let take = |(shot, share): (usize, f64), frame: usize| {
            let kind = self.0.get(shot).map_or(ShotKind::Main, |shot| shot.kind);
            let beside = beside(frame, frames);
            let (now, focus) = camera(shot, frame);
            Take { shot, kind, camera: now, next: camera(shot, beside).0, focus, share }
        };
        (0..frames)
            .map(|frame| {
                let [main, other] = self.at(frame);
                Frame { main: take(main, frame), other: (other.1 > 0.0).then(|| take(other, frame)) }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_becomes_shots_and_nonsense_is_refused() {
        let shots: Shots = "main:60,close-up:25~8,high-behind".parse().unwrap();
        assert_eq!(shots.0[0], Shot { kind: ShotKind::Main, frames: 60, dissolve: 0 });
        assert_eq!(shots.0[1], Shot { kind: ShotKind::CloseUp, frames: 25, dissolve: 8 });
        assert_eq!(shots.0[2], Shot { kind: ShotKind::HighBehind, frames: 0, dissolve: 0 });
        for bad in ["", "drone:5", "main:-1", "main:5~", "main:5,,main"] {
            assert!(bad.parse::<Shots>().is_err(), "{bad}");
        }
    }

    #[test]
    fn shares_of_a_dissolve_rise_evenly_and_sum_to_one() {
        let shots: Shots = "main:10,close-up:10~4,main".parse().unwrap();
        assert_eq!(shots.at(9), [(0, 1.0), (0, 0.0)]);
        assert_eq!(shots.at(10), [(0, 0.8), (1, 0.2)]);
        let [(main, more), (other, less)] = shots.at(12);
        assert!(main == 1 && other == 0 && (more - 0.6).abs() < 1e-9 && (more + less - 1.0).abs() < 1e-9);
        assert_eq!(shots.at(14), [(1, 1.0), (1, 0.0)]);
        assert_eq!(shots.at(20), [(2, 1.0), (2, 0.0)]);
        assert_eq!(shots.at(5000)[0].0, 2);
    }
}
