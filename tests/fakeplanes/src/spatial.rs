//! The same room through XR_EXT_spatial_entity, with XR_EXT_spatial_plane_tracking and XR_EXT_spatial_anchor: capabilities,
//! contexts, and futures that are not ready at once. What there is to see is in [`crate::snapshots`].

use std::{
    collections::BTreeMap,
    ffi::c_char,
    mem::transmute,
    sync::{
        Mutex,
        atomic::{AtomicU64, Ordering},
    },
};

use openxr_sys::{
    CreateSpatialContextCompletionEXT, CreateSpatialDiscoverySnapshotCompletionEXT,
    CreateSpatialDiscoverySnapshotCompletionInfoEXT, FutureCancelInfoEXT, FutureEXT, FuturePollInfoEXT,
    FuturePollResultEXT, FutureStateEXT, Handle as _, Instance, Result, Session,
    SpatialCapabilityComponentTypesEXT, SpatialCapabilityEXT, SpatialCapabilityFeatureEXT,
    SpatialContextCreateInfoEXT, SpatialContextEXT, SpatialDiscoverySnapshotCreateInfoEXT, SpatialEntityEXT,
    SpatialEntityFromIdCreateInfoEXT, SpatialSnapshotEXT, SystemId, Vector3f, pfn,
};

use crate::snapshots::{self, DISCOVERED, OF_ANCHORS, OF_PLANES};

const CAPABILITIES: [SpatialCapabilityEXT; 2] =
    [SpatialCapabilityEXT::PLANE_TRACKING, SpatialCapabilityEXT::ANCHOR];
/// The handle of every context.
const CONTEXT: u64 = 0xC0;
/// A future is ready when it is asked for this time.
const READY_AT: u32 = 3;

static FUTURES: AtomicU64 = AtomicU64::new(1);
static ASKED: Mutex<BTreeMap<u64, u32>> = Mutex::new(BTreeMap::new());

/// The functions of the extensions.
pub(crate) fn function(name: &[u8]) -> Option<pfn::VoidFunction> {
    macro_rules! of {
        ($($name:literal => $kind:ident = $function:expr,)*) => {
            match name {
                // SAFETY: a function pointer is turned into the untyped one that OpenXR hands out; its user turns it back.
                $($name => Some(unsafe { transmute::<pfn::$kind, pfn::VoidFunction>($function) }),)*
                _ => None,
            }
        };
    }
    of! {
        b"xrPollFutureEXT" => PollFutureEXT = poll,
        b"xrCancelFutureEXT" => CancelFutureEXT = cancel,
        b"xrEnumerateSpatialCapabilitiesEXT" => EnumerateSpatialCapabilitiesEXT = capabilities,
        b"xrEnumerateSpatialCapabilityComponentTypesEXT" => EnumerateSpatialCapabilityComponentTypesEXT = components,
        b"xrEnumerateSpatialCapabilityFeaturesEXT" => EnumerateSpatialCapabilityFeaturesEXT = features,
        b"xrCreateSpatialContextAsyncEXT" => CreateSpatialContextAsyncEXT = create_context,
        b"xrCreateSpatialContextCompleteEXT" => CreateSpatialContextCompleteEXT = context_created,
        b"xrDestroySpatialContextEXT" => DestroySpatialContextEXT = destroy_context,
        b"xrCreateSpatialDiscoverySnapshotAsyncEXT" => CreateSpatialDiscoverySnapshotAsyncEXT = discover,
        b"xrCreateSpatialDiscoverySnapshotCompleteEXT" => CreateSpatialDiscoverySnapshotCompleteEXT = discovered,
        b"xrQuerySpatialComponentDataEXT" => QuerySpatialComponentDataEXT = snapshots::query,
        b"xrDestroySpatialSnapshotEXT" => DestroySpatialSnapshotEXT = snapshots::destroy_snapshot,
        b"xrCreateSpatialEntityFromIdEXT" => CreateSpatialEntityFromIdEXT = entity_from_id,
        b"xrDestroySpatialEntityEXT" => DestroySpatialEntityEXT = snapshots::destroy_entity,
        b"xrCreateSpatialUpdateSnapshotEXT" => CreateSpatialUpdateSnapshotEXT = snapshots::update,
        b"xrGetSpatialBufferStringEXT" => GetSpatialBufferStringEXT = snapshots::no_buffer::<c_char>,
        b"xrGetSpatialBufferUint8EXT" => GetSpatialBufferUint8EXT = snapshots::no_buffer::<u8>,
        b"xrGetSpatialBufferUint16EXT" => GetSpatialBufferUint16EXT = snapshots::no_buffer::<u16>,
        b"xrGetSpatialBufferUint32EXT" => GetSpatialBufferUint32EXT = snapshots::no_buffer::<u32>,
        b"xrGetSpatialBufferFloatEXT" => GetSpatialBufferFloatEXT = snapshots::no_buffer::<f32>,
        b"xrGetSpatialBufferVector2fEXT" => GetSpatialBufferVector2fEXT = snapshots::corners,
        b"xrGetSpatialBufferVector3fEXT" => GetSpatialBufferVector3fEXT = snapshots::no_buffer::<Vector3f>,
        b"xrCreateSpatialAnchorEXT" => CreateSpatialAnchorEXT = snapshots::create_anchor,
    }
}

fn promise(future: *mut FutureEXT) -> Result {
    // SAFETY: the specification demands a place to write to.
    unsafe { future.write(FutureEXT::from_raw(FUTURES.fetch_add(1, Ordering::Relaxed))) };
    Result::SUCCESS
}

fn is_ready(future: FutureEXT, asks: bool) -> bool {
    let Ok(mut asked) = ASKED.lock() else { return false };
    let count = asked.entry(future.into_raw()).or_default();
    *count += u32::from(asks);
    *count >= READY_AT
}

unsafe extern "system" fn poll(
    _instance: Instance,
    info: *const FuturePollInfoEXT,
    result: *mut FuturePollResultEXT,
) -> Result {
    // SAFETY: the specification demands both structures.
    let (info, result) = unsafe { (&*info, &mut *result) };
    result.state = if is_ready(info.future, true) { FutureStateEXT::READY } else { FutureStateEXT::PENDING };
    Result::SUCCESS
}

unsafe extern "system" fn cancel(_instance: Instance, _info: *const FutureCancelInfoEXT) -> Result {
    Result::SUCCESS
}

unsafe extern "system" fn capabilities(
    _instance: Instance,
    _system: SystemId,
    capacity: u32,
    count: *mut u32,
    list: *mut SpatialCapabilityEXT,
) -> Result {
    // SAFETY: the specification demands a place for the count and a list with its true capacity.
    unsafe { listed(&CAPABILITIES, capacity, count, list) }
}

unsafe extern "system" fn components(
    _instance: Instance,
    _system: SystemId,
    capability: SpatialCapabilityEXT,
    list: *mut SpatialCapabilityComponentTypesEXT,
) -> Result {
    // SAFETY: the specification demands a list with its true capacity.
    let list = unsafe { &mut *list };
    let of: &[_] = match capability {
        SpatialCapabilityEXT::PLANE_TRACKING => &OF_PLANES,
        SpatialCapabilityEXT::ANCHOR => &OF_ANCHORS,
        _ => return Result::ERROR_SPATIAL_CAPABILITY_UNSUPPORTED_EXT,
    };
    let count = &raw mut list.component_type_count_output;
    // SAFETY: as above.
    unsafe { listed(of, list.component_type_capacity_input, count, list.component_types) }
}

unsafe extern "system" fn features(
    _instance: Instance,
    _system: SystemId,
    _capability: SpatialCapabilityEXT,
    capacity: u32,
    count: *mut u32,
    list: *mut SpatialCapabilityFeatureEXT,
) -> Result {
    // SAFETY: the specification demands a place for the count and a list with its true capacity.
    unsafe { listed(&[], capacity, count, list) }
}

/// OpenXR's way to hand out an array: a capacity of 0 asks for the number.
///
/// # Safety
/// `count` can be written, and `list` holds `capacity` values.
pub(crate) unsafe fn listed<T: Copy>(values: &[T], capacity: u32, count: *mut u32, list: *mut T) -> Result {
    // SAFETY: as the caller says.
    unsafe { count.write(values.len() as u32) };
    if capacity == 0 {
        return Result::SUCCESS;
    }
    if (capacity as usize) < values.len() {
        return Result::ERROR_SIZE_INSUFFICIENT;
    }
    for (index, value) in values.iter().enumerate() {
        // SAFETY: `index` is below the capacity that was checked.
        unsafe { list.add(index).write(*value) };
    }
    Result::SUCCESS
}

unsafe extern "system" fn create_context(
    _session: Session,
    info: *const SpatialContextCreateInfoEXT,
    future: *mut FutureEXT,
) -> Result {
    // SAFETY: the specification demands the structure and its array of pointers.
    let sound = unsafe {
        let info = &*info;
        let configurations =
            std::slice::from_raw_parts(info.capability_configs, info.capability_config_count as usize);
        configurations.iter().all(|configuration| CAPABILITIES.contains(&(**configuration).capability))
    };
    if sound { promise(future) } else { Result::ERROR_SPATIAL_CAPABILITY_UNSUPPORTED_EXT }
}

unsafe extern "system" fn context_created(
    _session: Session,
    future: FutureEXT,
    completion: *mut CreateSpatialContextCompletionEXT,
) -> Result {
    if !is_ready(future, false) {
        return Result::ERROR_FUTURE_PENDING_EXT;
    }
    // SAFETY: the specification demands the structure.
    let completion = unsafe { &mut *completion };
    completion.future_result = Result::SUCCESS;
    completion.spatial_context = SpatialContextEXT::from_raw(CONTEXT);
    Result::SUCCESS
}

unsafe extern "system" fn destroy_context(_context: SpatialContextEXT) -> Result {
    Result::SUCCESS
}

unsafe extern "system" fn discover(
    _context: SpatialContextEXT,
    _info: *const SpatialDiscoverySnapshotCreateInfoEXT,
    future: *mut FutureEXT,
) -> Result {
    promise(future)
}

unsafe extern "system" fn discovered(
    _context: SpatialContextEXT,
    info: *const CreateSpatialDiscoverySnapshotCompletionInfoEXT,
    completion: *mut CreateSpatialDiscoverySnapshotCompletionEXT,
) -> Result {
    // SAFETY: the specification demands both structures.
    let (info, completion) = unsafe { (&*info, &mut *completion) };
    if !is_ready(info.future, false) {
        return Result::ERROR_FUTURE_PENDING_EXT;
    }
    completion.future_result = Result::SUCCESS;
    completion.snapshot = SpatialSnapshotEXT::from_raw(DISCOVERED);
    Result::SUCCESS
}

unsafe extern "system" fn entity_from_id(
    _context: SpatialContextEXT,
    _info: *const SpatialEntityFromIdCreateInfoEXT,
    _entity: *mut SpatialEntityEXT,
) -> Result {
    Result::ERROR_FEATURE_UNSUPPORTED
}
