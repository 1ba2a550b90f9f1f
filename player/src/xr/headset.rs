//! The headset as its runtime describes it: extensions, size of the pictures, how they mix with the room.
//!
//! Nothing here is for one maker: an extension is used when the runtime offers it, and what is used is logged.

use openxr::{
    ApplicationInfo, EnvironmentBlendMode, ExtensionSet, FormFactor, Instance, SystemId, Version,
    ViewConfigurationType, sys::Result as XrResult,
};

use super::{XrError, ffi};
use crate::renderer::{Sight, Surroundings};

/// Two eyes.
pub(super) const VIEWS: ViewConfigurationType = ViewConfigurationType::PRIMARY_STEREO;
const NAME: &str = "Holopitch";

/// A headset that was found.
pub(super) struct Headset {
    pub(super) instance: Instance,
    pub(super) system: SystemId,
    /// "Monado 25.0.0", as the runtime calls itself.
    pub(super) runtime: String,
    /// The headset's name.
    pub(super) name: String,
    /// Width and height of one eye's picture that the runtime recommends, pixels.
    pub(super) recommended_px: (u32, u32),
    /// The largest it takes.
    pub(super) most_px: (u32, u32),
    pub(super) mixing: Mixing,
    /// What was asked for and given.
    pub(super) extensions: ExtensionSet,
    pub(super) hand_tracking: bool,
    /// XR_EXT_plane_detection.
    pub(super) detects_planes: bool,
    /// XR_EXT_spatial_plane_tracking.
    pub(super) tracks_planes: bool,
    /// XR_EXT_spatial_anchor.
    pub(super) keeps_anchors: bool,
}

/// How the pictures mix with the room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mixing {
    pub(super) blend_mode: EnvironmentBlendMode,
    /// Whether a layer of the headset's camera picture goes under ours (XR_FB_passthrough).
    pub(super) camera_layer: bool,
    pub(super) surroundings: Surroundings,
}

impl Mixing {
    /// The best of what the runtime offers: the room as it is where it can be seen, a dark one where it cannot.
    pub(super) fn choose(offered: &[EnvironmentBlendMode], camera_layer: bool) -> Self {
        let has = |mode| offered.contains(&mode);
        let (blend_mode, camera_layer) = if has(EnvironmentBlendMode::ALPHA_BLEND) {
            (EnvironmentBlendMode::ALPHA_BLEND, false)
        } else if has(EnvironmentBlendMode::ADDITIVE) && !has(EnvironmentBlendMode::OPAQUE) {
            // Light is added to the room: black is clear.
            (EnvironmentBlendMode::ADDITIVE, false)
        } else {
            (EnvironmentBlendMode::OPAQUE, camera_layer)
        };
        let sees_room = camera_layer || blend_mode != EnvironmentBlendMode::OPAQUE;
        let surroundings = if sees_room { Surroundings::Transparent } else { Surroundings::Dark };
        Self { blend_mode, camera_layer, surroundings }
    }

    /// What the user sees beside the pictures.
    pub(super) fn sight(self) -> Sight {
        match (self.sees_room(), self.blend_mode) {
            (false, _) => Sight::Nothing,
            (true, EnvironmentBlendMode::ADDITIVE) => Sight::RoomPlusLight,
            (true, _) => Sight::Room,
        }
    }

    /// Whether the user sees the room.
    pub(super) fn sees_room(self) -> bool {
        self.surroundings == Surroundings::Transparent
    }
}

impl Headset {
    /// Looks for a runtime and its headset.
    pub(super) fn find() -> Result<Self, XrError> {
        let entry = ffi::load()?;
        let unavailable = |error: XrResult| XrError::NoRuntime(error.to_string());
        let offered = entry.enumerate_extensions().map_err(unavailable)?;
        if !offered.khr_vulkan_enable2 {
            return Err(XrError::NoRuntime("it does not speak Vulkan (XR_KHR_vulkan_enable2)".to_owned()));
        }
        let enabled = wanted(&offered);
        let application = ApplicationInfo {
            application_name: NAME,
            application_version: 1,
            engine_name: NAME,
            engine_version: 1,
            api_version: Version::new(1, 0, 0),
        };
        let instance = entry.create_instance(&application, &enabled, &[], &()).map_err(unavailable)?;
        let about = instance.properties()?;
        let runtime = format!("{} {}", about.runtime_name, about.runtime_version);
        let system = instance.system(FormFactor::HEAD_MOUNTED_DISPLAY).map_err(|error| {
            if error == XrResult::ERROR_FORM_FACTOR_UNAVAILABLE {
                XrError::NoHeadset(runtime.clone())
            } else {
                error.into()
            }
        })?;
        let properties = instance.system_properties(system)?;
        let views = instance.enumerate_view_configuration_views(system, VIEWS)?;
        let Some(view) = views.first().filter(|_| views.len() == 2) else {
            return Err(XrError::NoRuntime(format!("the headset has {} views, not two", views.len())));
        };
        let modes = instance.enumerate_environment_blend_modes(system, VIEWS)?;
        let mixing = Mixing::choose(&modes, enabled.fb_passthrough);
        let headset = Self {
            runtime,
            name: properties.system_name,
            recommended_px: (view.recommended_image_rect_width, view.recommended_image_rect_height),
            most_px: (view.max_image_rect_width, view.max_image_rect_height),
            mixing,
            hand_tracking: enabled.ext_hand_tracking && instance.supports_hand_tracking(system)?,
            detects_planes: enabled.ext_plane_detection && ffi::planes::supported(&instance, system),
            tracks_planes: enabled.ext_spatial_plane_tracking
                && ffi::spatial_planes::supported(&instance, system),
            keeps_anchors: enabled.ext_spatial_anchor && ffi::spatial_anchor::supported(&instance, system),
            extensions: enabled,
            instance,
            system,
        };
        tracing::info!(
            "{} with {}: {:?} px an eye, blend modes {modes:?}, {:?}, hands {}, planes detected {} tracked {}, anchors {}",
            headset.runtime,
            headset.name,
            headset.recommended_px,
            headset.mixing,
            headset.hand_tracking,
            headset.detects_planes,
            headset.tracks_planes,
            headset.keeps_anchors
        );
        Ok(headset)
    }
}

/// What we can use of what is offered.
fn wanted(offered: &ExtensionSet) -> ExtensionSet {
    let mut enabled = ExtensionSet::default();
    enabled.khr_vulkan_enable2 = true;
    enabled.ext_hand_tracking = offered.ext_hand_tracking;
    enabled.ext_hand_interaction = offered.ext_hand_interaction;
    enabled.msft_hand_interaction = offered.msft_hand_interaction;
    enabled.ext_plane_detection = offered.ext_plane_detection;
    let spatial = offered.ext_future && offered.ext_spatial_entity;
    enabled.ext_future = spatial;
    enabled.ext_spatial_entity = spatial;
    enabled.ext_spatial_plane_tracking = spatial && offered.ext_spatial_plane_tracking;
    enabled.ext_spatial_anchor = spatial && offered.ext_spatial_anchor;
    enabled.ext_user_presence = offered.ext_user_presence;
    enabled.fb_passthrough = offered.fb_passthrough;
    enabled
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_room_is_shown_wherever_it_can_be() {
        use EnvironmentBlendMode as Mode;
        let see = |offered: &[Mode], camera| Mixing::choose(offered, camera);
        assert_eq!(see(&[Mode::OPAQUE], false).surroundings, Surroundings::Dark);
        let quest = see(&[Mode::OPAQUE], true);
        assert!(quest.sees_room() && quest.camera_layer && quest.blend_mode == Mode::OPAQUE);
        let varjo = see(&[Mode::OPAQUE, Mode::ALPHA_BLEND], true);
        assert!(varjo.sees_room() && !varjo.camera_layer && varjo.blend_mode == Mode::ALPHA_BLEND);
        let hololens = see(&[Mode::ADDITIVE], false);
        assert!(hololens.sees_room() && hololens.blend_mode == Mode::ADDITIVE);
        assert_eq!(
            [see(&[Mode::OPAQUE], false), quest, varjo, hololens].map(Mixing::sight),
            [Sight::Nothing, Sight::Room, Sight::Room, Sight::RoomPlusLight]
        );
    }
}
