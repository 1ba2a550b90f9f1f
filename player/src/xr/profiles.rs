//! Which button of which controller selects: OpenXR's interaction profiles, as data.
//!
//! The runtime maps what it has to the nearest of these. A profile of an extension is suggested only where it exists.

use openxr::ExtensionSet;

/// One kind of controller or hand.
pub(super) struct Profile {
    /// Path of the interaction profile.
    pub(super) path: &'static str,
    /// Whether the runtime can know it.
    pub(super) offered: fn(&ExtensionSet) -> bool,
    /// What selects, below `/user/hand/left` and `…/right`.
    pub(super) select: &'static str,
    /// What takes back, if there is something.
    pub(super) squeeze: Option<&'static str>,
}

/// Where every one of them points from.
pub(super) const AIM: &str = "input/aim/pose";

fn always(_: &ExtensionSet) -> bool {
    true
}

/// All that we know. Values between 0 and 1 are turned into pressed or not by the runtime.
pub(super) const PROFILES: [Profile; 7] = [
    Profile {
        path: "/interaction_profiles/khr/simple_controller",
        offered: always,
        select: "input/select/click",
        squeeze: Some("input/menu/click"),
    },
    Profile {
        path: "/interaction_profiles/oculus/touch_controller",
        offered: always,
        select: "input/trigger/value",
        squeeze: Some("input/squeeze/value"),
    },
    Profile {
        path: "/interaction_profiles/valve/index_controller",
        offered: always,
        select: "input/trigger/click",
        squeeze: Some("input/squeeze/force"),
    },
    Profile {
        path: "/interaction_profiles/htc/vive_controller",
        offered: always,
        select: "input/trigger/click",
        squeeze: Some("input/squeeze/click"),
    },
    Profile {
        path: "/interaction_profiles/microsoft/motion_controller",
        offered: always,
        select: "input/trigger/value",
        squeeze: Some("input/squeeze/click"),
    },
    Profile {
        path: "/interaction_profiles/microsoft/hand_interaction",
        offered: |extensions| extensions.msft_hand_interaction,
        select: "input/select/value",
        squeeze: Some("input/squeeze/value"),
    },
    Profile {
        path: "/interaction_profiles/ext/hand_interaction_ext",
        offered: |extensions| extensions.ext_hand_interaction,
        select: "input/aim_activate_ext/value",
        squeeze: Some("input/grasp_ext/value"),
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profiles_are_well_formed_and_known_once() {
        for (index, profile) in PROFILES.iter().enumerate() {
            assert!(profile.path.starts_with("/interaction_profiles/"), "{}", profile.path);
            for part in [Some(profile.select), profile.squeeze].into_iter().flatten() {
                assert!(part.starts_with("input/") && !part.ends_with('/'), "{part}");
            }
            assert!(PROFILES.iter().skip(index + 1).all(|other| other.path != profile.path));
        }
        let plain = ExtensionSet::default();
        assert_eq!(PROFILES.iter().filter(|profile| (profile.offered)(&plain)).count(), 5);
    }
}
