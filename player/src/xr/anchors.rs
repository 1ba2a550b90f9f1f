//! Keeps the match where it was put when the runtime corrects its map or moves its spaces.
//!
//! An anchor of the runtime (XR_EXT_spatial_anchor) is best. Without one the place is held in the STAGE space, which stays
//! with the floor when the user recentres; without that in LOCAL, where everything else is. What moved is told to the
//! placement, which glides there.

use std::time::Duration;

use openxr::{Posef, ReferenceSpaceType, Session, Space, SpaceLocationFlags, Time, Vulkan};

use super::{
    XrError,
    ffi::spatial_anchor::AnchorKeeper,
    headset::Headset,
    room::{self, Rigid},
};

/// Between two looks at where the anchor is.
const EVERY: Duration = Duration::from_millis(100);
/// What is no correction: metres, radians.
const STILL_M: f64 = 0.0005;
const STILL_TURN: f64 = 0.001;

/// News of the place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Moved {
    /// The runtime knows better where the anchored point is, in the room's frame.
    Anchor(u32, Rigid),
    /// The room's frame was moved without saying how far: its new origin in the old frame, as the anchor shows.
    Frame(Rigid),
}

/// What holds the place.
enum Hold {
    Anchor(Box<AnchorKeeper<Vulkan>>),
    /// The place in a space that is not the room's frame.
    Space {
        steady: Space,
        place: Option<Rigid>,
    },
    /// The room's frame itself.
    Frame,
}

/// The place of one match in one session.
pub(super) struct Anchors {
    hold: Hold,
    /// The placement's name for the anchor that is held, and where it was last.
    held: Option<(u32, Rigid)>,
    looked_at: Duration,
    /// Whether the room's frame was moved without saying how far.
    frame_lost: bool,
}

impl Anchors {
    /// The best there is on a session; says in the log what that is when it is no anchor.
    pub(super) fn new(headset: &Headset, session: &Session<Vulkan>) -> Result<Self, XrError> {
        let keeper = if headset.keeps_anchors { AnchorKeeper::new(session, headset.system)? } else { None };
        let hold = match keeper {
            Some(keeper) => Hold::Anchor(Box::new(keeper)),
            None => {
                let hold = steady_space(session)?;
                tracing::warn!("{} keeps no anchors: the place is held in {}", headset.runtime, name(&hold));
                hold
            }
        };
        Ok(Self { hold, held: None, looked_at: Duration::ZERO, frame_lost: false })
    }

    /// What holds the place, in the words of OpenXR.
    pub(super) fn name(&self) -> &'static str {
        name(&self.hold)
    }

    /// Holds what is wanted (the placement's name for the anchor, and where it is in `space`, the room's frame) and says
    /// what has moved. `now` is the match's clock.
    pub(super) fn update(
        &mut self,
        session: &Session<Vulkan>,
        wanted: Option<(u32, Rigid)>,
        (space, time): (&Space, Time),
        now: Duration,
    ) -> Result<Option<Moved>, XrError> {
        match self.try_update(wanted, (space, time), now) {
            Err(error) if error.is_loss() => Err(error),
            Err(error) => {
                self.hold = steady_space(session)?;
                self.held = None;
                tracing::warn!("anchor: {error}: the place is held in {} now", self.name());
                Ok(None)
            }
            moved => moved,
        }
    }

    fn try_update(
        &mut self,
        wanted: Option<(u32, Rigid)>,
        (space, time): (&Space, Time),
        now: Duration,
    ) -> Result<Option<Moved>, XrError> {
        let Some((generation, wanted)) = wanted else {
            self.held = None;
            match &mut self.hold {
                Hold::Anchor(keeper) => keeper.lift(),
                Hold::Space { place, .. } => *place = None,
                Hold::Frame => {}
            }
            return Ok(None);
        };
        if self.held.is_none_or(|(held, _)| held != generation) {
            if self.put(wanted, space, time)? {
                self.held = Some((generation, wanted));
                self.looked_at = now;
            }
            return Ok(None);
        }
        if now.saturating_sub(self.looked_at) < EVERY && !self.frame_lost {
            return Ok(None);
        }
        self.looked_at = now;
        let found = self.find(space, time)?;
        Ok(found.and_then(|found| compared(&mut self.held, &mut self.frame_lost, found)))
    }

    fn put(&mut self, wanted: Rigid, space: &Space, time: Time) -> Result<bool, XrError> {
        match &mut self.hold {
            Hold::Anchor(keeper) => keeper.put(room::pose(wanted.0, wanted.1), space, time),
            Hold::Space { steady, place } => {
                *place = located(space, steady, time)?.map(|frame| room::compose(frame, wanted));
                Ok(place.is_some())
            }
            Hold::Frame => Ok(true),
        }
    }

    /// Where the held place is in the room's frame.
    fn find(&mut self, space: &Space, time: Time) -> Result<Option<Rigid>, XrError> {
        Ok(match &mut self.hold {
            Hold::Anchor(keeper) => keeper.place(space, time)?.map(room::rigid),
            Hold::Space { steady, place: Some(place) } => {
                located(steady, space, time)?.map(|steady| room::compose(steady, *place))
            }
            Hold::Space { .. } | Hold::Frame => None,
        })
    }

    /// A space of the runtime has moved: its new origin in its old frame, when the runtime says so. Returns whether the room's
    /// frame was moved to a place that nothing here can tell.
    pub(super) fn space_changed(&mut self, kind: ReferenceSpaceType, origin: Option<Rigid>) -> bool {
        if kind == ReferenceSpaceType::LOCAL {
            match origin {
                Some(origin) => {
                    if let Some((_, last)) = &mut self.held {
                        *last = room::compose(room::inverse(origin), *last);
                    }
                }
                None => {
                    self.frame_lost = self.held.is_some() && !matches!(self.hold, Hold::Frame);
                    return !self.frame_lost;
                }
            }
        } else if let (ReferenceSpaceType::STAGE, Hold::Space { place, .. }) = (kind, &mut self.hold) {
            match origin {
                Some(origin) => *place = place.map(|place| room::compose(room::inverse(origin), place)),
                // Held anew where the match is shown.
                None => self.held = None,
            }
        }
        false
    }
}

/// What the newly found place means.
fn compared(held: &mut Option<(u32, Rigid)>, frame_lost: &mut bool, found: Rigid) -> Option<Moved> {
    let (generation, last) = held.as_mut()?;
    let before = *last;
    if *frame_lost {
        *frame_lost = false;
        *last = found;
        return Some(Moved::Frame(room::compose(before, room::inverse(found))));
    }
    let still = before.0.distance(found.0) < STILL_M && before.1.angle_between(found.1) < STILL_TURN;
    if still {
        return None;
    }
    *last = found;
    Some(Moved::Anchor(*generation, found))
}

fn steady_space(session: &Session<Vulkan>) -> Result<Hold, XrError> {
    if !session.enumerate_reference_spaces()?.contains(&ReferenceSpaceType::STAGE) {
        return Ok(Hold::Frame);
    }
    let steady = session.create_reference_space(ReferenceSpaceType::STAGE, Posef::IDENTITY)?;
    Ok(Hold::Space { steady, place: None })
}

fn name(hold: &Hold) -> &'static str {
    match hold {
        Hold::Anchor(_) => "XR_EXT_spatial_anchor",
        Hold::Space { .. } => "STAGE",
        Hold::Frame => "LOCAL",
    }
}

/// Where a space is in another one.
fn located(space: &Space, base: &Space, time: Time) -> Result<Option<Rigid>, XrError> {
    let place = space.locate(base, time)?;
    let known = SpaceLocationFlags::POSITION_VALID | SpaceLocationFlags::ORIENTATION_VALID;
    Ok(place.location_flags.contains(known).then(|| room::rigid(place.pose)))
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;

    #[test]
    fn a_corrected_anchor_is_told_once() {
        let place = (DVec3::new(0.1, -0.4, -1.0), DQuat::from_rotation_y(0.3));
        let (mut held, mut lost) = (Some((4, place)), false);
        assert_eq!(compared(&mut held, &mut lost, (place.0 + DVec3::X * 1e-4, place.1)), None);
        let better = (place.0 + DVec3::X * 0.02, place.1);
        assert_eq!(compared(&mut held, &mut lost, better), Some(Moved::Anchor(4, better)));
        assert_eq!(compared(&mut held, &mut lost, better), None);
    }

    /// The frame jumps without a word; the anchor tells how far, and a point of the room goes where it has to.
    #[test]
    fn an_anchor_tells_how_far_the_frame_has_moved() {
        let place = (DVec3::new(0.1, -0.4, -1.0), DQuat::from_rotation_y(0.3));
        let origin = (DVec3::new(0.5, 0.0, 0.7), DQuat::from_rotation_y(-1.1));
        let found = room::compose(room::inverse(origin), place);
        let (mut held, mut lost) = (Some((1, place)), true);
        let Some(Moved::Frame(told)) = compared(&mut held, &mut lost, found) else { panic!("no news") };
        assert!(told.0.distance(origin.0) < 1e-9 && told.1.angle_between(origin.1) < 1e-6, "{told:?}");
        assert!(!lost && compared(&mut held, &mut lost, found).is_none());
    }
}
