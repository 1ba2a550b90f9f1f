//! XR_EXT_spatial_entity with its futures: contexts that track planes or keep anchors, and the snapshots that tell of them.
//!
//! The `openxr` crate has only the raw functions. Nothing here waits: what takes time is a future that is polled. The
//! structures of plane tracking and anchors are in [`super::spatial_planes`] and [`super::spatial_anchor`].

use std::{ffi::c_void, ptr, rc::Rc};

use openxr::{Instance, Session, Space, SystemId, Time, raw, sys, sys::Handle as _};

use crate::xr::XrError;

/// Entities read from one snapshot: more than a room has, little enough to hold.
const MOST_ENTITIES: u32 = 64;
/// Corners read of one outline.
const MOST_CORNERS: u32 = 1024;
/// Capabilities and component types of a system.
const MOST_NAMES: u32 = 64;

/// What a headset can do for one kind of entity: the components that it can tell; empty when it cannot do it at all.
pub(super) fn components(
    instance: &Instance,
    system: SystemId,
    capability: sys::SpatialCapabilityEXT,
) -> Vec<sys::SpatialComponentTypeEXT> {
    let Some(functions) = instance.exts().ext_spatial_entity else { return Vec::new() };
    let mut count = 0;
    let mut capabilities = vec![sys::SpatialCapabilityEXT::from_raw(0); MOST_NAMES as usize];
    // SAFETY: the instance is live; `capabilities` has the length that is told, and both outlive the call.
    let result = unsafe {
        (functions.enumerate_spatial_capabilities)(
            instance.as_raw(),
            system,
            MOST_NAMES,
            &raw mut count,
            capabilities.as_mut_ptr(),
        )
    };
    capabilities.truncate(count as usize);
    if result != sys::Result::SUCCESS || !capabilities.contains(&capability) {
        return Vec::new();
    }
    let mut types = vec![sys::SpatialComponentTypeEXT::from_raw(0); MOST_NAMES as usize];
    let mut list = sys::SpatialCapabilityComponentTypesEXT {
        ty: sys::SpatialCapabilityComponentTypesEXT::TYPE,
        next: ptr::null_mut(),
        component_type_capacity_input: MOST_NAMES,
        component_type_count_output: 0,
        component_types: types.as_mut_ptr(),
    };
    // SAFETY: `list` names `types` with its true length, and both outlive the call.
    let result = unsafe {
        (functions.enumerate_spatial_capability_component_types)(
            instance.as_raw(),
            system,
            capability,
            &raw mut list,
        )
    };
    types.truncate(list.component_type_count_output as usize);
    if result == sys::Result::SUCCESS { types } else { Vec::new() }
}

/// The functions, and the session that keeps them valid.
pub(super) struct Functions<G> {
    pub(super) entity: raw::SpatialEntityEXT,
    future: raw::FutureEXT,
    pub(super) session: Session<G>,
}

impl<G> Functions<G> {
    fn is_ready(&self, future: sys::FutureEXT) -> Result<bool, XrError> {
        let poll = sys::FuturePollInfoEXT { ty: sys::FuturePollInfoEXT::TYPE, next: ptr::null(), future };
        let mut result = sys::FuturePollResultEXT {
            ty: sys::FuturePollResultEXT::TYPE,
            next: ptr::null_mut(),
            state: sys::FutureStateEXT::PENDING,
        };
        let instance = self.session.instance().as_raw();
        // SAFETY: the instance is live and made the future; both structures outlive the call.
        check(unsafe { (self.future.poll_future)(instance, &raw const poll, &raw mut result) })?;
        Ok(result.state == sys::FutureStateEXT::READY)
    }
}

enum State {
    /// The context is being made.
    Starting(sys::FutureEXT),
    Ready(sys::SpatialContextEXT),
}

/// A context, from the moment it is asked for. Destroyed with its session at the latest.
pub(super) struct Context<G> {
    pub(super) functions: Rc<Functions<G>>,
    state: State,
}

impl<G> Context<G> {
    /// Asks for a context; `None` without the extensions.
    ///
    /// # Safety
    /// `configuration` points to a structure for a capability whose extension is enabled, which begins with the fields of
    /// `SpatialCapabilityConfigurationBaseHeaderEXT` and, with all that it names, outlives the call.
    pub(super) unsafe fn start(
        session: &Session<G>,
        configuration: *const sys::SpatialCapabilityConfigurationBaseHeaderEXT,
    ) -> Result<Option<Self>, XrError> {
        let extensions = session.instance().exts();
        let (Some(entity), Some(future)) = (extensions.ext_spatial_entity, extensions.ext_future) else {
            return Ok(None);
        };
        let create = sys::SpatialContextCreateInfoEXT {
            ty: sys::SpatialContextCreateInfoEXT::TYPE,
            next: ptr::null(),
            capability_config_count: 1,
            capability_configs: &raw const configuration,
        };
        let mut promise = sys::FutureEXT::from_raw(0);
        // SAFETY: the session is live; `create` and what it names outlive the call, as the caller guarantees.
        check(unsafe {
            (entity.create_spatial_context_async)(session.as_raw(), &raw const create, &raw mut promise)
        })?;
        let functions = Rc::new(Functions { entity, future, session: session.clone() });
        Ok(Some(Self { functions, state: State::Starting(promise) }))
    }

    /// The context once it is made.
    pub(super) fn ready(&mut self) -> Result<Option<sys::SpatialContextEXT>, XrError> {
        let promise = match self.state {
            State::Ready(context) => return Ok(Some(context)),
            State::Starting(promise) => promise,
        };
        if !self.functions.is_ready(promise)? {
            return Ok(None);
        }
        let mut done = sys::CreateSpatialContextCompletionEXT {
            ty: sys::CreateSpatialContextCompletionEXT::TYPE,
            next: ptr::null_mut(),
            future_result: sys::Result::SUCCESS,
            spatial_context: sys::SpatialContextEXT::NULL,
        };
        let session = self.functions.session.as_raw();
        // SAFETY: the session is live, the future is ready and completed only here; `done` outlives the call.
        check(unsafe {
            (self.functions.entity.create_spatial_context_complete)(session, promise, &raw mut done)
        })?;
        check(done.future_result)?;
        self.state = State::Ready(done.spatial_context);
        Ok(Some(done.spatial_context))
    }

    /// Starts a discovery of entities with these components; `None` before the context is ready.
    pub(super) fn discover(
        &mut self,
        types: &[sys::SpatialComponentTypeEXT],
    ) -> Result<Option<Discovery>, XrError> {
        let Some(context) = self.ready()? else { return Ok(None) };
        let create = sys::SpatialDiscoverySnapshotCreateInfoEXT {
            ty: sys::SpatialDiscoverySnapshotCreateInfoEXT::TYPE,
            next: ptr::null(),
            component_type_count: types.len() as u32,
            component_types: types.as_ptr(),
        };
        let mut promise = sys::FutureEXT::from_raw(0);
        // SAFETY: the context is live; `create` names `types` with its true length, and both outlive the call.
        check(unsafe {
            (self.functions.entity.create_spatial_discovery_snapshot_async)(
                context,
                &raw const create,
                &raw mut promise,
            )
        })?;
        Ok(Some(Discovery { context, promise }))
    }

    /// What a discovery found, with places in `space` at `time`; `None` while it is still looking.
    pub(super) fn discovered(
        &self,
        discovery: &Discovery,
        space: &Space,
        time: Time,
    ) -> Result<Option<Snapshot<G>>, XrError> {
        if !self.functions.is_ready(discovery.promise)? {
            return Ok(None);
        }
        let info = sys::CreateSpatialDiscoverySnapshotCompletionInfoEXT {
            ty: sys::CreateSpatialDiscoverySnapshotCompletionInfoEXT::TYPE,
            next: ptr::null(),
            base_space: space.as_raw(),
            time,
            future: discovery.promise,
        };
        let mut done = sys::CreateSpatialDiscoverySnapshotCompletionEXT {
            ty: sys::CreateSpatialDiscoverySnapshotCompletionEXT::TYPE,
            next: ptr::null_mut(),
            future_result: sys::Result::SUCCESS,
            snapshot: sys::SpatialSnapshotEXT::NULL,
        };
        // SAFETY: context and space are live, the future is ready; the caller forgets it after this. Both structures outlive
        // the call.
        check(unsafe {
            (self.functions.entity.create_spatial_discovery_snapshot_complete)(
                discovery.context,
                &raw const info,
                &raw mut done,
            )
        })?;
        check(done.future_result)?;
        Ok(Some(Snapshot { handle: done.snapshot, functions: self.functions.clone() }))
    }

    /// Where one entity is in `space` at `time`.
    pub(super) fn update(
        &mut self,
        entity: sys::SpatialEntityEXT,
        types: &[sys::SpatialComponentTypeEXT],
        space: &Space,
        time: Time,
    ) -> Result<Option<Snapshot<G>>, XrError> {
        let Some(context) = self.ready()? else { return Ok(None) };
        let create = sys::SpatialUpdateSnapshotCreateInfoEXT {
            ty: sys::SpatialUpdateSnapshotCreateInfoEXT::TYPE,
            next: ptr::null(),
            entity_count: 1,
            entities: &raw const entity,
            component_type_count: types.len() as u32,
            component_types: types.as_ptr(),
            base_space: space.as_raw(),
            time,
        };
        let mut handle = sys::SpatialSnapshotEXT::NULL;
        // SAFETY: context, entity and space are live; `create` and what it names outlive the call.
        check(unsafe {
            (self.functions.entity.create_spatial_update_snapshot)(
                context,
                &raw const create,
                &raw mut handle,
            )
        })?;
        Ok(Some(Snapshot { handle, functions: self.functions.clone() }))
    }
}

impl<G> Drop for Context<G> {
    fn drop(&mut self) {
        if let State::Ready(context) = self.state {
            // SAFETY: the context is live, as its session is, which the functions hold; nobody uses it afterwards.
            let _ = unsafe { (self.functions.entity.destroy_spatial_context)(context) };
        }
    }
}

/// A discovery under way.
pub(super) struct Discovery {
    context: sys::SpatialContextEXT,
    promise: sys::FutureEXT,
}

/// Entities as they were at one moment.
pub(super) struct Snapshot<G> {
    handle: sys::SpatialSnapshotEXT,
    functions: Rc<Functions<G>>,
}

/// An entity of a snapshot: the runtime's name for it, and whether it is followed now.
pub(super) type Entity = (sys::SpatialEntityIdEXT, sys::SpatialEntityTrackingStateEXT);

impl<G> Snapshot<G> {
    /// Entities that have all of `types`, at most 64, and one value of type `T` for each: `list` makes, for an array of the
    /// told length, the list structure of a component.
    ///
    /// # Safety
    /// What `list` returns is the output structure of one of `types` whose array has elements of type `T`.
    pub(super) unsafe fn read<T: Copy, L>(
        &self,
        types: &[sys::SpatialComponentTypeEXT],
        blank: T,
        list: impl FnOnce(u32, *mut T) -> L,
    ) -> Result<Vec<(Entity, T)>, XrError> {
        let condition = sys::SpatialComponentDataQueryConditionEXT {
            ty: sys::SpatialComponentDataQueryConditionEXT::TYPE,
            next: ptr::null(),
            component_type_count: types.len() as u32,
            component_types: types.as_ptr(),
        };
        let mut result = sys::SpatialComponentDataQueryResultEXT {
            ty: sys::SpatialComponentDataQueryResultEXT::TYPE,
            next: ptr::null_mut(),
            entity_id_capacity_input: 0,
            entity_id_count_output: 0,
            entity_ids: ptr::null_mut(),
            entity_state_capacity_input: 0,
            entity_state_count_output: 0,
            entity_states: ptr::null_mut(),
        };
        let query = self.functions.entity.query_spatial_component_data;
        // SAFETY: the snapshot is live; capacities of 0 ask only for the number; all structures outlive the call.
        check(unsafe { query(self.handle, &raw const condition, &raw mut result) })?;
        let count = result.entity_id_count_output;
        if count > MOST_ENTITIES {
            return Err(XrError::Call(sys::Result::ERROR_LIMIT_REACHED));
        }
        let mut ids = vec![sys::SpatialEntityIdEXT::from_raw(0); count as usize];
        let mut states = vec![sys::SpatialEntityTrackingStateEXT::STOPPED; count as usize];
        let mut values = vec![blank; count as usize];
        let mut list = list(count, values.as_mut_ptr());
        result.next = (&raw mut list).cast::<c_void>();
        (result.entity_id_capacity_input, result.entity_id_count_output) = (count, 0);
        (result.entity_state_capacity_input, result.entity_state_count_output) = (count, 0);
        (result.entity_ids, result.entity_states) = (ids.as_mut_ptr(), states.as_mut_ptr());
        // SAFETY: the arrays have the lengths that are told, `list` is what the caller guarantees, and all outlive the call.
        check(unsafe { query(self.handle, &raw const condition, &raw mut result) })?;
        ids.truncate(result.entity_id_count_output as usize);
        Ok(ids.into_iter().zip(states).zip(values).collect())
    }

    /// The corners in a buffer of the snapshot, at most 1024.
    pub(super) fn corners(&self, buffer: sys::SpatialBufferEXT) -> Result<Vec<sys::Vector2f>, XrError> {
        let info = sys::SpatialBufferGetInfoEXT {
            ty: sys::SpatialBufferGetInfoEXT::TYPE,
            next: ptr::null(),
            buffer_id: buffer.buffer_id,
        };
        let get = self.functions.entity.get_spatial_buffer_vector2f;
        let mut count = 0;
        // SAFETY: the snapshot is live; a capacity of 0 asks only for the number.
        check(unsafe { get(self.handle, &raw const info, 0, &raw mut count, ptr::null_mut()) })?;
        if count > MOST_CORNERS {
            return Err(XrError::Call(sys::Result::ERROR_LIMIT_REACHED));
        }
        let mut corners = vec![sys::Vector2f { x: 0.0, y: 0.0 }; count as usize];
        // SAFETY: `corners` has the length that is told, and outlives the call.
        check(unsafe { get(self.handle, &raw const info, count, &raw mut count, corners.as_mut_ptr()) })?;
        corners.truncate(count as usize);
        Ok(corners)
    }
}

impl<G> Drop for Snapshot<G> {
    fn drop(&mut self) {
        // SAFETY: the snapshot is live, as its session is, which the functions hold; nobody uses it afterwards.
        let _ = unsafe { (self.functions.entity.destroy_spatial_snapshot)(self.handle) };
    }
}

/// Success in all its forms, or the error.
pub(super) fn check(result: sys::Result) -> Result<(), XrError> {
    if result.into_raw() >= 0 { Ok(()) } else { Err(result.into()) }
}
