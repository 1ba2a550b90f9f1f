//! The views that have a name.

use std::{fmt, str::FromStr};

use glam::DVec3;
use protocol::{camera::Camera, pitch::Pitch};
use thiserror::Error;

use super::{OrbitCamera, ViewCamera};

/// Vertical field of view of the views from above and behind the goals.
const FOV: f64 = 0.6;

/// A view with a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Preset {
    /// Three quarters from above, as somebody standing at the table sees it.
    Table,
    /// The camera that filmed the clip, frame by frame.
    Broadcast,
    /// Straight down, the main camera's side below.
    Top,
    /// From behind the goal at negative x (left in the broadcast).
    GoalLeft,
    /// From behind the goal at positive x.
    GoalRight,
}

/// A name that is no preset.
#[derive(Debug, Error, PartialEq, Eq)]
#[error(
    "there is no camera called `{0}`: use table, broadcast, top, goal-left or goal-right, or a JSON file"
)]
pub struct NoSuchPreset(String);

impl Preset {
    /// All of them, in the order of the menu.
    pub const ALL: [Self; 5] = [Self::Table, Self::Broadcast, Self::Top, Self::GoalLeft, Self::GoalRight];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Table => "table",
            Self::Broadcast => "broadcast",
            Self::Top => "top",
            Self::GoalLeft => "goal-left",
            Self::GoalRight => "goal-right",
        }
    }

    /// The name in the window.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::Table => "Table",
            Self::Broadcast => "Broadcast",
            Self::Top => "From above",
            Self::GoalLeft => "Left goal",
            Self::GoalRight => "Right goal",
        }
    }

    /// The view of a pitch in a picture of width over height `aspect`.
    ///
    /// `broadcast` is the frame's own camera: without it the broadcast view has nothing to show and is `None`.
    #[must_use]
    pub fn view(self, pitch: &Pitch, broadcast: Option<&Camera>, aspect: f64) -> Option<ViewCamera> {
        let half_length = pitch.length_m / 2.0;
        let behind_goal = |side: f64| {
            let eye = DVec3::new(side * (half_length + 15.0), 6.0, 0.0);
            ViewCamera::looking_at(eye, DVec3::new(side * (half_length - 26.0), 0.0, 0.0), FOV, aspect)
        };
        match self {
            Self::Table => Some(OrbitCamera::table(pitch, aspect).view(aspect)),
            Self::Broadcast => broadcast.map(|camera| ViewCamera::from_broadcast(camera, aspect)),
            Self::Top => Some(from_above(pitch, aspect)),
            Self::GoalLeft => Some(behind_goal(-1.0)),
            Self::GoalRight => Some(behind_goal(1.0)),
        }
    }
}

fn from_above(pitch: &Pitch, aspect: f64) -> ViewCamera {
    let view = ViewCamera::looking_at(DVec3::Y * 100.0, DVec3::ZERO, FOV, aspect);
    view.fitted(DVec3::ZERO, &turf_corners(pitch), 0.04)
}

/// The corners of the turf, world metres.
pub(super) fn turf_corners(pitch: &Pitch) -> [DVec3; 4] {
    let x = pitch.length_m / 2.0 + crate::scene::APRON_M;
    let z = pitch.width_m / 2.0 + crate::scene::APRON_M;
    [(-x, -z), (x, -z), (-x, z), (x, z)].map(|(x, z)| DVec3::new(x, 0.0, z))
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Preset {
    type Err = NoSuchPreset;

    fn from_str(name: &str) -> Result<Self, NoSuchPreset> {
        let found = Self::ALL.into_iter().find(|preset| preset.name() == name);
        found.ok_or_else(|| NoSuchPreset(name.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip_and_others_are_refused() {
        for preset in Preset::ALL {
            assert_eq!(preset.name().parse::<Preset>(), Ok(preset));
        }
        assert!("blimp".parse::<Preset>().unwrap_err().to_string().contains("blimp"));
    }

    #[test]
    fn top_and_table_show_the_whole_turf_at_any_aspect() {
        for pitch in [Pitch::default(), Pitch { length_m: 90.0, width_m: 90.0 }] {
            for aspect in [0.5, 1.0, 16.0 / 9.0, 3.0] {
                for preset in [Preset::Top, Preset::Table] {
                    let view = preset.view(&pitch, None, aspect).unwrap();
                    for corner in turf_corners(&pitch) {
                        let seen = view.project(corner).unwrap();
                        let inside = seen.min_element() >= 0.0 && seen.max_element() <= 1.0;
                        assert!(inside, "{preset} at {aspect}: {corner} at {seen}");
                    }
                }
            }
        }
    }

    #[test]
    fn behind_a_goal_the_goal_is_in_the_picture() {
        let pitch = Pitch::default();
        for (preset, x) in [(Preset::GoalLeft, -52.5), (Preset::GoalRight, 52.5)] {
            let view = preset.view(&pitch, None, 16.0 / 9.0).unwrap();
            let bar = view.project(DVec3::new(x, 2.44, 0.0)).unwrap();
            assert!((0.0..1.0).contains(&bar.y), "{preset}: {bar}");
            assert!(view.position_m.x.abs() > 52.5);
        }
    }

    #[test]
    fn broadcast_without_a_camera_has_no_view() {
        assert_eq!(Preset::Broadcast.view(&Pitch::default(), None, 1.5), None);
    }
}
