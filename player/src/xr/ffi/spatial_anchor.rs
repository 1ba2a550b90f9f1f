//! XR_EXT_spatial_anchor: a place of the room that the runtime keeps, and corrects when it understands the room better.

use std::ptr;

use openxr::{Instance, Posef, Session, Space, SystemId, Time, raw, sys, sys::Handle as _};

use super::spatial::{Context, check, components};
use crate::xr::XrError;

const CAPABILITY: sys::SpatialCapabilityEXT = sys::SpatialCapabilityEXT::ANCHOR;
const COMPONENTS: [sys::SpatialComponentTypeEXT; 1] = [sys::SpatialComponentTypeEXT::ANCHOR];

/// Whether this headset keeps anchors, and not only its runtime knows the extension.
pub(in crate::xr) fn supported(instance: &Instance, system: SystemId) -> bool {
    components(instance, system, CAPABILITY).contains(&COMPONENTS[0])
}

/// A context with at most one anchor.
pub(in crate::xr) struct AnchorKeeper<G> {
    /// Destroyed before the context.
    anchor: Option<sys::SpatialEntityEXT>,
    create_anchor: raw::SpatialAnchorEXT,
    context: Context<G>,
}

impl<G> AnchorKeeper<G> {
    /// Asks for anchors; `None` without the extension.
    pub(in crate::xr) fn new(session: &Session<G>, system: SystemId) -> Result<Option<Self>, XrError> {
        let instance = session.instance();
        let Some(create_anchor) = instance.exts().ext_spatial_anchor else { return Ok(None) };
        if !supported(instance, system) {
            return Ok(None);
        }
        let configuration = sys::SpatialCapabilityConfigurationAnchorEXT {
            ty: sys::SpatialCapabilityConfigurationAnchorEXT::TYPE,
            next: ptr::null(),
            capability: CAPABILITY,
            enabled_component_count: COMPONENTS.len() as u32,
            enabled_components: COMPONENTS.as_ptr(),
        };
        // SAFETY: the structure is the one for this capability, which the headset offers; it outlives the call.
        let context = unsafe { Context::start(session, (&raw const configuration).cast()) }?;
        Ok(context.map(|context| Self { anchor: None, create_anchor, context }))
    }

    /// Puts the anchor to a place of `space` at `time`. Returns whether the runtime is ready for it.
    pub(in crate::xr) fn put(&mut self, pose: Posef, space: &Space, time: Time) -> Result<bool, XrError> {
        let Some(context) = self.context.ready()? else { return Ok(false) };
        self.lift();
        let create = sys::SpatialAnchorCreateInfoEXT {
            ty: sys::SpatialAnchorCreateInfoEXT::TYPE,
            next: ptr::null(),
            base_space: space.as_raw(),
            time,
            pose,
        };
        let (mut id, mut entity) = (sys::SpatialEntityIdEXT::from_raw(0), sys::SpatialEntityEXT::NULL);
        // SAFETY: context and space are live; all structures outlive the call.
        check(unsafe {
            (self.create_anchor.create_spatial_anchor)(
                context,
                &raw const create,
                &raw mut id,
                &raw mut entity,
            )
        })?;
        self.anchor = Some(entity);
        Ok(true)
    }

    /// Gives the anchor back.
    pub(in crate::xr) fn lift(&mut self) {
        if let Some(entity) = self.anchor.take() {
            // SAFETY: the entity is live, as its context is, and nobody uses it afterwards.
            let _ = unsafe { (self.context.functions.entity.destroy_spatial_entity)(entity) };
        }
    }

    /// Where the anchor is in `space` at `time`; `None` without one or while the runtime does not follow it.
    pub(in crate::xr) fn place(&mut self, space: &Space, time: Time) -> Result<Option<Posef>, XrError> {
        let Some(entity) = self.anchor else { return Ok(None) };
        let Some(snapshot) = self.context.update(entity, &COMPONENTS, space, time)? else { return Ok(None) };
        let list = |location_count, locations| sys::SpatialComponentAnchorListEXT {
            ty: sys::SpatialComponentAnchorListEXT::TYPE,
            next: ptr::null_mut(),
            location_count,
            locations,
        };
        // SAFETY: that is the list of anchors, and anchors are asked for.
        let found = unsafe { snapshot.read(&COMPONENTS, Posef::IDENTITY, list) }?;
        let followed =
            |((_, state), pose)| (state == sys::SpatialEntityTrackingStateEXT::TRACKING).then_some(pose);
        Ok(found.into_iter().find_map(followed))
    }
}

impl<G> Drop for AnchorKeeper<G> {
    fn drop(&mut self) {
        self.lift();
    }
}
