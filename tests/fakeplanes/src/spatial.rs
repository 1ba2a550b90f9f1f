//! The same room through XR_EXT_spatial_entity, with XR_EXT_spatial_plane_tracking and XR_EXT_spatial_anchor: futures that
//! are not ready at once, planes in x and y with z as the normal, outlines, labels, and one anchor.
//!
//! With `FAKEPLANES_ANCHOR_DRIFT` (metres) the anchor turns out, after some looks, to be that far along x from where it was put.

use std::{
    collections::BTreeMap,
    ffi::c_char,
    mem::transmute,
    sync::{
        Mutex,
        atomic::{AtomicU32, AtomicU64, Ordering},
    },
};

use openxr_sys::{
    BaseOutStructure, CreateSpatialContextCompletionEXT, CreateSpatialDiscoverySnapshotCompletionEXT,
    CreateSpatialDiscoverySnapshotCompletionInfoEXT, Extent2Df, FutureCancelInfoEXT, FutureEXT,
    FuturePollInfoEXT, FuturePollResultEXT, FutureStateEXT, Handle as _, Instance, Posef, Quaternionf,
    Result, Session, SpatialAnchorCreateInfoEXT, SpatialBounded2DDataEXT, SpatialBufferEXT,
    SpatialBufferGetInfoEXT, SpatialBufferIdEXT, SpatialBufferTypeEXT, SpatialCapabilityComponentTypesEXT,
    SpatialCapabilityEXT, SpatialCapabilityFeatureEXT, SpatialComponentAnchorListEXT,
    SpatialComponentBounded2DListEXT, SpatialComponentDataQueryConditionEXT,
    SpatialComponentDataQueryResultEXT, SpatialComponentPlaneAlignmentListEXT,
    SpatialComponentPlaneSemanticLabelListEXT, SpatialComponentPolygon2DListEXT, SpatialComponentTypeEXT,
    SpatialContextCreateInfoEXT, SpatialContextEXT, SpatialDiscoverySnapshotCreateInfoEXT, SpatialEntityEXT,
    SpatialEntityFromIdCreateInfoEXT, SpatialEntityIdEXT, SpatialEntityTrackingStateEXT,
    SpatialPlaneAlignmentEXT, SpatialPlaneSemanticLabelEXT, SpatialPolygon2DDataEXT, SpatialSnapshotEXT,
    SpatialUpdateSnapshotCreateInfoEXT, SystemId, Vector2f, Vector3f, pfn,
};

use crate::{planes::PLANES, room};

const CAPABILITIES: [SpatialCapabilityEXT; 2] =
    [SpatialCapabilityEXT::PLANE_TRACKING, SpatialCapabilityEXT::ANCHOR];
const OF_PLANES: [SpatialComponentTypeEXT; 4] = [
    SpatialComponentTypeEXT::BOUNDED_2D,
    SpatialComponentTypeEXT::PLANE_ALIGNMENT,
    SpatialComponentTypeEXT::POLYGON_2D,
    SpatialComponentTypeEXT::PLANE_SEMANTIC_LABEL,
];
const OF_ANCHORS: [SpatialComponentTypeEXT; 1] = [SpatialComponentTypeEXT::ANCHOR];
/// Handles: what they are is in them.
const CONTEXT: u64 = 0xC0;
const DISCOVERED: u64 = 0xD0;
const UPDATED: u64 = 0xE0;
const ANCHOR: u64 = 0xA0;
/// A future is ready when it is asked for this time.
const READY_AT: u32 = 3;
/// The anchor drifts after this many looks.
const DRIFTS_AT: u32 = 5;
/// From x and y of the plane to x and z of the room: z becomes up.
const LYING: Quaternionf =
    Quaternionf { x: -std::f32::consts::FRAC_1_SQRT_2, y: 0.0, z: 0.0, w: std::f32::consts::FRAC_1_SQRT_2 };

static FUTURES: AtomicU64 = AtomicU64::new(1);
static ASKED: Mutex<BTreeMap<u64, u32>> = Mutex::new(BTreeMap::new());
static ANCHORED: Mutex<Option<Posef>> = Mutex::new(None);
static LOOKS: AtomicU32 = AtomicU32::new(0);

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
        b"xrQuerySpatialComponentDataEXT" => QuerySpatialComponentDataEXT = query,
        b"xrDestroySpatialSnapshotEXT" => DestroySpatialSnapshotEXT = destroy_snapshot,
        b"xrCreateSpatialEntityFromIdEXT" => CreateSpatialEntityFromIdEXT = entity_from_id,
        b"xrDestroySpatialEntityEXT" => DestroySpatialEntityEXT = destroy_entity,
        b"xrCreateSpatialUpdateSnapshotEXT" => CreateSpatialUpdateSnapshotEXT = update,
        b"xrGetSpatialBufferStringEXT" => GetSpatialBufferStringEXT = no_buffer::<c_char>,
        b"xrGetSpatialBufferUint8EXT" => GetSpatialBufferUint8EXT = no_buffer::<u8>,
        b"xrGetSpatialBufferUint16EXT" => GetSpatialBufferUint16EXT = no_buffer::<u16>,
        b"xrGetSpatialBufferUint32EXT" => GetSpatialBufferUint32EXT = no_buffer::<u32>,
        b"xrGetSpatialBufferFloatEXT" => GetSpatialBufferFloatEXT = no_buffer::<f32>,
        b"xrGetSpatialBufferVector2fEXT" => GetSpatialBufferVector2fEXT = corners,
        b"xrGetSpatialBufferVector3fEXT" => GetSpatialBufferVector3fEXT = no_buffer::<Vector3f>,
        b"xrCreateSpatialAnchorEXT" => CreateSpatialAnchorEXT = create_anchor,
    }
}

/// The room's frame has moved to a place of its old self.
pub(crate) fn frame_moved(origin: Posef) {
    if let Ok(mut anchored) = ANCHORED.lock() {
        *anchored = anchored.map(|pose| room::seen_from(origin, pose));
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

unsafe extern "system" fn destroy_snapshot(snapshot: SpatialSnapshotEXT) -> Result {
    if [DISCOVERED, UPDATED].contains(&snapshot.into_raw()) {
        Result::SUCCESS
    } else {
        Result::ERROR_HANDLE_INVALID
    }
}

unsafe extern "system" fn query(
    snapshot: SpatialSnapshotEXT,
    condition: *const SpatialComponentDataQueryConditionEXT,
    result: *mut SpatialComponentDataQueryResultEXT,
) -> Result {
    // SAFETY: the specification demands both structures, and an array of the told length.
    let (wanted, result) = unsafe {
        let condition = &*condition;
        let types =
            std::slice::from_raw_parts(condition.component_types, condition.component_type_count as usize);
        (types, &mut *result)
    };
    let of_anchors = snapshot.into_raw() == UPDATED;
    let has: &[_] = if of_anchors { &OF_ANCHORS } else { &OF_PLANES };
    let matches = wanted.iter().all(|component| has.contains(component));
    let anchored = ANCHORED.lock().ok().and_then(|anchored| *anchored);
    let ids: Vec<_> = match (matches, of_anchors) {
        (false, _) => Vec::new(),
        (true, true) => anchored.iter().map(|_| SpatialEntityIdEXT::from_raw(ANCHOR)).collect(),
        (true, false) => PLANES.iter().map(|plane| SpatialEntityIdEXT::from_raw(plane.id)).collect(),
    };
    let states = vec![SpatialEntityTrackingStateEXT::TRACKING; ids.len()];
    // SAFETY: the arrays have their true capacities.
    let listed = unsafe {
        let (id_count, state_count) =
            (&raw mut result.entity_id_count_output, &raw mut result.entity_state_count_output);
        let told = listed(&ids, result.entity_id_capacity_input, id_count, result.entity_ids);
        if told != Result::SUCCESS {
            return told;
        }
        listed(&states, result.entity_state_capacity_input, state_count, result.entity_states)
    };
    if listed != Result::SUCCESS || result.entity_id_capacity_input == 0 {
        return listed;
    }
    let mut next = result.next.cast::<BaseOutStructure>();
    // SAFETY: the chain consists of component lists, each with its true length.
    unsafe {
        while let Some(structure) = next.as_mut() {
            let filled = fill(next, ids.len(), anchored);
            if filled != Result::SUCCESS {
                return filled;
            }
            next = structure.next;
        }
    }
    Result::SUCCESS
}

/// Fills one list of components of as many entities as were asked for.
///
/// # Safety
/// `list` is a component list whose array has the told length.
unsafe fn fill(list: *mut BaseOutStructure, entities: usize, anchored: Option<Posef>) -> Result {
    macro_rules! write {
        ($kind:ident, $count:ident, $values:ident, $all:expr) => {{
            // SAFETY: the type says which structure it is.
            let list = unsafe { &mut *list.cast::<$kind>() };
            if list.$count as usize != entities {
                return Result::ERROR_SIZE_INSUFFICIENT;
            }
            for (index, value) in $all.into_iter().take(entities).enumerate() {
                // SAFETY: `index` is below the length that was checked.
                unsafe { list.$values.add(index).write(value) };
            }
            Result::SUCCESS
        }};
    }
    // SAFETY: the caller passes a valid structure.
    match unsafe { (*list).ty } {
        SpatialComponentBounded2DListEXT::TYPE => {
            write!(
                SpatialComponentBounded2DListEXT,
                bound_count,
                bounds,
                PLANES.iter().map(|plane| {
                    SpatialBounded2DDataEXT {
                        center: pose(plane.position_m),
                        extents: Extent2Df { width: 2.0 * plane.half_m[0], height: 2.0 * plane.half_m[1] },
                    }
                })
            )
        }
        SpatialComponentPlaneAlignmentListEXT::TYPE => {
            let upward = PLANES.iter().map(|_| SpatialPlaneAlignmentEXT::HORIZONTAL_UPWARD);
            write!(SpatialComponentPlaneAlignmentListEXT, plane_alignment_count, plane_alignments, upward)
        }
        SpatialComponentPolygon2DListEXT::TYPE => {
            write!(
                SpatialComponentPolygon2DListEXT,
                polygon_count,
                polygons,
                PLANES.iter().map(|plane| {
                    SpatialPolygon2DDataEXT {
                        origin: pose(plane.position_m),
                        vertex_buffer: SpatialBufferEXT {
                            buffer_id: SpatialBufferIdEXT::from_raw(plane.id),
                            buffer_type: SpatialBufferTypeEXT::VECTOR2F,
                        },
                    }
                })
            )
        }
        SpatialComponentPlaneSemanticLabelListEXT::TYPE => {
            let labels = [SpatialPlaneSemanticLabelEXT::TABLE, SpatialPlaneSemanticLabelEXT::FLOOR];
            write!(SpatialComponentPlaneSemanticLabelListEXT, semantic_label_count, semantic_labels, labels)
        }
        SpatialComponentAnchorListEXT::TYPE => {
            write!(SpatialComponentAnchorListEXT, location_count, locations, anchored)
        }
        _ => Result::ERROR_VALIDATION_FAILURE,
    }
}

fn pose([x, y, z]: [f32; 3]) -> Posef {
    Posef { orientation: LYING, position: Vector3f { x, y, z } }
}

unsafe extern "system" fn entity_from_id(
    _context: SpatialContextEXT,
    _info: *const SpatialEntityFromIdCreateInfoEXT,
    _entity: *mut SpatialEntityEXT,
) -> Result {
    Result::ERROR_FEATURE_UNSUPPORTED
}

unsafe extern "system" fn no_buffer<T>(
    _snapshot: SpatialSnapshotEXT,
    _info: *const SpatialBufferGetInfoEXT,
    _capacity: u32,
    _count: *mut u32,
    _buffer: *mut T,
) -> Result {
    Result::ERROR_SPATIAL_BUFFER_ID_INVALID_EXT
}

/// The rectangle of a plane, counter-clockwise seen from its front.
unsafe extern "system" fn corners(
    _snapshot: SpatialSnapshotEXT,
    info: *const SpatialBufferGetInfoEXT,
    capacity: u32,
    count: *mut u32,
    buffer: *mut Vector2f,
) -> Result {
    // SAFETY: the specification demands the structure.
    let id = unsafe { (*info).buffer_id };
    let Some(plane) = PLANES.iter().find(|plane| plane.id == id.into_raw()) else {
        return Result::ERROR_SPATIAL_BUFFER_ID_INVALID_EXT;
    };
    let [x, y] = plane.half_m;
    let corners = [(-x, -y), (x, -y), (x, y), (-x, y)].map(|(x, y)| Vector2f { x, y });
    // SAFETY: the specification demands a place for the count and a buffer with its true capacity.
    unsafe { listed(&corners, capacity, count, buffer) }
}

unsafe extern "system" fn create_anchor(
    _context: SpatialContextEXT,
    info: *const SpatialAnchorCreateInfoEXT,
    id: *mut SpatialEntityIdEXT,
    entity: *mut SpatialEntityEXT,
) -> Result {
    // SAFETY: the specification demands the structure and places to write to.
    let pose = unsafe {
        id.write(SpatialEntityIdEXT::from_raw(ANCHOR));
        entity.write(SpatialEntityEXT::from_raw(ANCHOR));
        (*info).pose
    };
    if let Ok(mut anchored) = ANCHORED.lock() {
        *anchored = Some(pose);
    }
    Result::SUCCESS
}

unsafe extern "system" fn destroy_entity(entity: SpatialEntityEXT) -> Result {
    match ANCHORED.lock() {
        Ok(mut anchored) if entity.into_raw() == ANCHOR => {
            *anchored = None;
            Result::SUCCESS
        }
        _ => Result::ERROR_HANDLE_INVALID,
    }
}

unsafe extern "system" fn update(
    _context: SpatialContextEXT,
    _info: *const SpatialUpdateSnapshotCreateInfoEXT,
    snapshot: *mut SpatialSnapshotEXT,
) -> Result {
    let drift = std::env::var("FAKEPLANES_ANCHOR_DRIFT").ok().and_then(|text| text.parse::<f32>().ok());
    if LOOKS.fetch_add(1, Ordering::Relaxed) + 1 == DRIFTS_AT
        && let (Ok(mut anchored), Some(drift)) = (ANCHORED.lock(), drift)
        && let Some(pose) = anchored.as_mut()
    {
        pose.position.x += drift;
    }
    // SAFETY: the specification demands a place to write to.
    unsafe { snapshot.write(SpatialSnapshotEXT::from_raw(UPDATED)) };
    Result::SUCCESS
}
