//! The room of the tests: a table in front of the user and a floor below it, whatever space is asked for.

use std::ffi::{CStr, c_char};

use openxr_sys::{
    Extent2Df, Handle as _, PlaneDetectionStateEXT, PlaneDetectorBeginInfoEXT, PlaneDetectorCreateInfoEXT,
    PlaneDetectorEXT, PlaneDetectorGetInfoEXT, PlaneDetectorLocationsEXT, PlaneDetectorOrientationEXT,
    PlaneDetectorPolygonBufferEXT, PlaneDetectorSemanticTypeEXT, Posef, Quaternionf, Result, Session,
    SpaceLocationFlags, Vector2f, Vector3f,
};

/// The only detector there is.
const DETECTOR: u64 = 0x7AB1E;

/// A plane with its outline in its own x and z axes.
pub(crate) struct FakePlane {
    pub(crate) id: u64,
    pub(crate) position_m: [f32; 3],
    pub(crate) half_m: [f32; 2],
    meaning: PlaneDetectorSemanticTypeEXT,
}

/// A table, then a floor.
pub(crate) const PLANES: [FakePlane; 2] = [
    FakePlane {
        id: 11,
        position_m: [0.05, -0.45, -0.95],
        half_m: [0.6, 0.4],
        meaning: PlaneDetectorSemanticTypeEXT::PLATFORM,
    },
    FakePlane {
        id: 12,
        position_m: [0.0, -1.2, -0.5],
        half_m: [2.0, 2.0],
        meaning: PlaneDetectorSemanticTypeEXT::FLOOR,
    },
];

/// # Safety
/// `name` is a C string.
pub(crate) unsafe fn is_extension(name: *const c_char) -> bool {
    // SAFETY: as the caller says.
    let name = unsafe { CStr::from_ptr(name) };
    [
        c"XR_EXT_plane_detection",
        c"XR_EXT_future",
        c"XR_EXT_spatial_entity",
        c"XR_EXT_spatial_plane_tracking",
        c"XR_EXT_spatial_anchor",
    ]
    .contains(&name)
}

pub(crate) unsafe extern "system" fn create(
    _session: Session,
    _info: *const PlaneDetectorCreateInfoEXT,
    detector: *mut PlaneDetectorEXT,
) -> Result {
    // SAFETY: the specification demands a place to write to.
    unsafe { detector.write(PlaneDetectorEXT::from_raw(DETECTOR)) };
    Result::SUCCESS
}

pub(crate) unsafe extern "system" fn destroy(detector: PlaneDetectorEXT) -> Result {
    known(detector)
}

pub(crate) unsafe extern "system" fn begin(
    detector: PlaneDetectorEXT,
    _info: *const PlaneDetectorBeginInfoEXT,
) -> Result {
    known(detector)
}

pub(crate) unsafe extern "system" fn state(
    detector: PlaneDetectorEXT,
    state: *mut PlaneDetectionStateEXT,
) -> Result {
    // SAFETY: the specification demands a place to write to.
    unsafe { state.write(PlaneDetectionStateEXT::DONE) };
    known(detector)
}

pub(crate) unsafe extern "system" fn detections(
    detector: PlaneDetectorEXT,
    _info: *const PlaneDetectorGetInfoEXT,
    list: *mut PlaneDetectorLocationsEXT,
) -> Result {
    // SAFETY: the specification demands a list with its true capacity.
    let list = unsafe { &mut *list };
    list.plane_location_count_output = PLANES.len() as u32;
    if list.plane_location_capacity_input == 0 {
        return known(detector);
    }
    if (list.plane_location_capacity_input as usize) < PLANES.len() {
        return Result::ERROR_SIZE_INSUFFICIENT;
    }
    for (index, plane) in PLANES.iter().enumerate() {
        // SAFETY: `index` is below the capacity that was checked.
        let place = unsafe { &mut *list.plane_locations.add(index) };
        let [x, y, z] = plane.position_m;
        place.plane_id = plane.id;
        place.location_flags = SpaceLocationFlags::POSITION_VALID | SpaceLocationFlags::ORIENTATION_VALID;
        place.pose = Posef {
            orientation: Quaternionf { x: 0.0, y: 0.0, z: 0.0, w: 1.0 },
            position: Vector3f { x, y, z },
        };
        place.extents = Extent2Df { width: 2.0 * plane.half_m[0], height: 2.0 * plane.half_m[1] };
        place.orientation = PlaneDetectorOrientationEXT::HORIZONTAL_UPWARD;
        place.semantic_type = plane.meaning;
        place.polygon_buffer_count = 1;
    }
    known(detector)
}

pub(crate) unsafe extern "system" fn outline(
    _detector: PlaneDetectorEXT,
    id: u64,
    polygon: u32,
    buffer: *mut PlaneDetectorPolygonBufferEXT,
) -> Result {
    let Some(plane) = PLANES.iter().find(|plane| plane.id == id && polygon == 0) else {
        return Result::ERROR_VALIDATION_FAILURE;
    };
    // SAFETY: the specification demands a buffer with its true capacity.
    let buffer = unsafe { &mut *buffer };
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    buffer.vertex_count_output = corners.len() as u32;
    if buffer.vertex_capacity_input == 0 {
        return Result::SUCCESS;
    }
    if (buffer.vertex_capacity_input as usize) < corners.len() {
        return Result::ERROR_SIZE_INSUFFICIENT;
    }
    for (index, [x, z]) in corners.into_iter().enumerate() {
        let corner = Vector2f { x: x * plane.half_m[0], y: z * plane.half_m[1] };
        // SAFETY: `index` is below the capacity that was checked.
        unsafe { buffer.vertices.add(index).write(corner) };
    }
    Result::SUCCESS
}

fn known(detector: PlaneDetectorEXT) -> Result {
    if detector.into_raw() == DETECTOR { Result::SUCCESS } else { Result::ERROR_HANDLE_INVALID }
}
