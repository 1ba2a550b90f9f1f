//! Hands and controllers: what they point at and whether they select, as plain values every frame.

use glam::{DQuat, DVec3};
use openxr::{
    Action, ActionSet, ActiveActionSet, Binding, Hand, HandJoint, HandJointLocations, HandTracker, Instance,
    Path, Posef, Session, Space, SpaceLocationFlags, Time, Vulkan,
};

use super::{
    XrError,
    headset::Headset,
    pinch::{Pinch, aim},
    profiles::{AIM, PROFILES},
    room,
};

/// One hand as it is this frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct HandState {
    /// Where it points: origin in room metres and unit direction; `None` when it is not there.
    pub(super) ray: Option<(DVec3, DVec3)>,
    /// Whether it pinches or pulls the trigger.
    pub(super) select: bool,
    /// Whether it squeezes or presses the menu button.
    pub(super) squeeze: bool,
}

/// One hand's sources.
struct Source {
    path: Path,
    aim: Space,
    tracker: Option<HandTracker>,
    pinch: Pinch,
    side: f64,
}

/// The actions of a session.
pub(super) struct Input {
    set: ActionSet,
    select: Action<bool>,
    squeeze: Action<bool>,
    hands: [Source; 2],
}

impl Input {
    /// Suggests bindings for every controller we know and attaches them to the session; possible once per session.
    pub(super) fn new(headset: &Headset, session: &Session<Vulkan>) -> Result<Self, XrError> {
        let instance = &headset.instance;
        let tops = ["/user/hand/left", "/user/hand/right"];
        let [left, right] = tops;
        let paths = [instance.string_to_path(left)?, instance.string_to_path(right)?];
        let set = instance.create_action_set("table", "Match on the table", 0)?;
        let aim_action = set.create_action::<Posef>("aim", "Point", &paths)?;
        let select = set.create_action::<bool>("select", "Select", &paths)?;
        let squeeze = set.create_action::<bool>("take_back", "Take the match off the table", &paths)?;
        for profile in PROFILES.iter().filter(|profile| (profile.offered)(&headset.extensions)) {
            let mut bindings = Vec::new();
            for top in tops {
                let path = |part: &str| instance.string_to_path(&format!("{top}/{part}"));
                bindings.push(Binding::new(&aim_action, path(AIM)?));
                bindings.push(Binding::new(&select, path(profile.select)?));
                if let Some(part) = profile.squeeze {
                    bindings.push(Binding::new(&squeeze, path(part)?));
                }
            }
            let profile_path = instance.string_to_path(profile.path)?;
            if let Err(error) = instance.suggest_interaction_profile_bindings(profile_path, &bindings) {
                tracing::warn!("the runtime does not take {}: {error}", profile.path);
            }
        }
        session.attach_action_sets(&[&set])?;
        let source = |path: Path, hand: Hand, side: f64| -> Result<Source, XrError> {
            let tracker = headset.hand_tracking.then(|| session.create_hand_tracker(hand)).transpose()?;
            let aim = aim_action.create_space(session, path, Posef::IDENTITY)?;
            Ok(Source { path, aim, tracker, pinch: Pinch::default(), side })
        };
        let [left, right] = paths;
        let hands = [source(left, Hand::LEFT, -1.0)?, source(right, Hand::RIGHT, 1.0)?];
        Ok(Self { set, select, squeeze, hands })
    }

    /// Both hands at `time`, in `space`. `head` is where the eyes are and how they are turned.
    pub(super) fn read(
        &mut self,
        session: &Session<Vulkan>,
        space: &Space,
        time: Time,
        (head_m, head): (DVec3, DQuat),
    ) -> Result<[HandState; 2], XrError> {
        session.sync_actions(&[ActiveActionSet::new(&self.set)])?;
        let mut states = [HandState::default(); 2];
        for (state, source) in states.iter_mut().zip(&mut self.hands) {
            let place = source.aim.locate(space, time)?;
            let known = SpaceLocationFlags::POSITION_VALID | SpaceLocationFlags::ORIENTATION_VALID;
            if place.location_flags.contains(known) {
                let direction = room::orientation(place.pose.orientation) * DVec3::NEG_Z;
                state.ray = Some((room::position(place.pose.position), direction));
                let select = self.select.state(session, source.path)?;
                let squeeze = self.squeeze.state(session, source.path)?;
                state.select = select.is_active && select.current_state;
                state.squeeze = squeeze.is_active && squeeze.current_state;
            } else if let Some(tracker) = &source.tracker {
                let joints = space.locate_hand_joints(tracker, time)?;
                match joints.as_ref().and_then(finger_tips) {
                    Some((thumb_m, index_m)) => {
                        state.ray = aim(head_m, head * DVec3::X, source.side, thumb_m, index_m);
                        state.select = source.pinch.update(thumb_m, index_m);
                    }
                    None => source.pinch.lost(),
                }
            }
        }
        Ok(states)
    }
}

/// The tips of thumb and index finger, when both are seen.
fn finger_tips(joints: &HandJointLocations) -> Option<(DVec3, DVec3)> {
    let tip = |joint: HandJoint| {
        let joint = joints.get(usize::try_from(joint.into_raw()).ok()?)?;
        let seen = joint.location_flags.contains(SpaceLocationFlags::POSITION_VALID);
        seen.then(|| room::position(joint.pose.position))
    };
    Some((tip(HandJoint::THUMB_TIP)?, tip(HandJoint::INDEX_TIP)?))
}

/// The controller or hand that the runtime uses for a hand, for the log.
pub(super) fn profile_in_use(instance: &Instance, session: &Session<Vulkan>, hand: &str) -> Option<String> {
    let hand = instance.string_to_path(hand).ok()?;
    let profile = session.current_interaction_profile(hand).ok().filter(|path| *path != Path::NULL)?;
    instance.path_to_string(profile).ok()
}
