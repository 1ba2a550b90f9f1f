//! What XR_EXT_spatial_entity tells of the room of the tests: planes in x and y with z as the normal, outlines, labels, and one
//! anchor.
//!
//! With `FAKEPLANES_ANCHOR_DRIFT` (metres) the anchor turns out, after some looks, to be that far along x from where it was put.

use std::sync::{
    Mutex,
    atomic::{AtomicU32, Ordering},
};

use openxr_sys::{
    BaseOutStructure, Extent2Df, Handle as _, Posef, Quaternionf, Result, SpatialAnchorCreateInfoEXT,
    SpatialBounded2DDataEXT, SpatialBufferEXT, SpatialBufferGetInfoEXT, SpatialBufferIdEXT,
    SpatialBufferTypeEXT, SpatialComponentAnchorListEXT, SpatialComponentBounded2DListEXT,
    SpatialComponentDataQueryConditionEXT, SpatialComponentDataQueryResultEXT,
    SpatialComponentPlaneAlignmentListEXT, SpatialComponentPlaneSemanticLabelListEXT,
    SpatialComponentPolygon2DListEXT, SpatialComponentTypeEXT, SpatialContextEXT, SpatialEntityEXT,
    SpatialEntityIdEXT, SpatialEntityTrackingStateEXT, SpatialPlaneAlignmentEXT,
    SpatialPlaneSemanticLabelEXT, SpatialPolygon2DDataEXT, SpatialSnapshotEXT,
    SpatialUpdateSnapshotCreateInfoEXT, Vector2f, Vector3f,
};

use crate::{planes::PLANES, room, spatial::listed};

/// What can be told of a plane.
pub(crate) const OF_PLANES: [SpatialComponentTypeEXT; 4] = [
    SpatialComponentTypeEXT::BOUNDED_2D,
    SpatialComponentTypeEXT::PLANE_ALIGNMENT,
    SpatialComponentTypeEXT::POLYGON_2D,
    SpatialComponentTypeEXT::PLANE_SEMANTIC_LABEL,
];
/// What can be told of an anchor.
pub(crate) const OF_ANCHORS: [SpatialComponentTypeEXT; 1] = [SpatialComponentTypeEXT::ANCHOR];
/// Handles: what they are is in them.
pub(crate) const DISCOVERED: u64 = 0xD0;
const UPDATED: u64 = 0xE0;
const ANCHOR: u64 = 0xA0;
/// The anchor drifts after this many looks.
const DRIFTS_AT: u32 = 5;
/// From x and y of the plane to x and z of the room: z becomes up.
const LYING: Quaternionf =
    Quaternionf { x: -std::f32::consts::FRAC_1_SQRT_2, y: 0.0, z: 0.0, w: std::f32::consts::FRAC_1_SQRT_2 };

static ANCHORED: Mutex<Option<Posef>> = Mutex::new(None);
static LOOKS: AtomicU32 = AtomicU32::new(0);

/// The room's frame has moved to a place of its old self.
pub(crate) fn frame_moved(origin: Posef) {
    if let Ok(mut anchored) = ANCHORED.lock() {
        *anchored = anchored.map(|pose| room::seen_from(origin, pose));
    }
}

pub(crate) unsafe extern "system" fn destroy_snapshot(snapshot: SpatialSnapshotEXT) -> Result {
    if [DISCOVERED, UPDATED].contains(&snapshot.into_raw()) {
        Result::SUCCESS
    } else {
        Result::ERROR_HANDLE_INVALID
    }
}

pub(crate) unsafe extern "system" fn query(
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

pub(crate) unsafe extern "system" fn no_buffer<T>(
    _snapshot: SpatialSnapshotEXT,
    _info: *const SpatialBufferGetInfoEXT,
    _capacity: u32,
    _count: *mut u32,
    _buffer: *mut T,
) -> Result {
    Result::ERROR_SPATIAL_BUFFER_ID_INVALID_EXT
}

/// The rectangle of a plane, counter-clockwise seen from its front.
pub(crate) unsafe extern "system" fn corners(
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

pub(crate) unsafe extern "system" fn create_anchor(
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

pub(crate) unsafe extern "system" fn destroy_entity(entity: SpatialEntityEXT) -> Result {
    match ANCHORED.lock() {
        Ok(mut anchored) if entity.into_raw() == ANCHOR => {
            *anchored = None;
            Result::SUCCESS
        }
        _ => Result::ERROR_HANDLE_INVALID,
    }
}

pub(crate) unsafe extern "system" fn update(
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
