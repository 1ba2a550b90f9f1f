//! XR_EXT_plane_detection, for which the `openxr` crate has only the raw functions.

use std::ptr;

use openxr::{Instance, Posef, Session, Space, SystemId, Time, raw, sys, sys::Handle as _};

use crate::xr::XrError;

/// Planes asked for at once, and corners of one outline: more than a room has, little enough to hold.
const MOST_PLANES: u32 = 64;
const MOST_CORNERS: u32 = 1024;
/// Planes smaller than this do not interest us, square metres.
const LEAST_AREA_M2: f32 = 0.05;
/// Half the side of the box around the base space in which planes are looked for, metres.
const REACH_M: f32 = 5.0;

/// Which axes of its pose span a plane; the third one is its normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::xr) enum PlaneAxes {
    /// x and z, with y as the normal (XrPlaneDetectorLocationEXT: the plane's extents run along x and z of its pose).
    XZ,
    /// x and y, with z as the normal (XrSpatialBounded2DDataEXT).
    XY,
}

/// A plane as an extension reports it.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::xr) struct DetectedPlane {
    /// The runtime's name for it.
    pub(in crate::xr) id: u64,
    /// Middle of the extents.
    pub(in crate::xr) pose: Posef,
    /// As the extension says.
    pub(in crate::xr) axes: PlaneAxes,
    /// Full sizes along the plane's own two axes, metres.
    pub(in crate::xr) extents_m: [f32; 2],
    pub(in crate::xr) orientation: sys::PlaneDetectorOrientationEXT,
    pub(in crate::xr) meaning: sys::PlaneDetectorSemanticTypeEXT,
    /// Origin of the outline.
    pub(in crate::xr) outline_pose: Posef,
    /// Corners in the two axes of `outline_pose`, metres.
    pub(in crate::xr) outline_m: Vec<[f32; 2]>,
}

/// Whether this headset detects planes, and not only its runtime knows the extension.
pub(in crate::xr) fn supported(instance: &Instance, system: SystemId) -> bool {
    let mut planes = sys::SystemPlaneDetectionPropertiesEXT {
        ty: sys::SystemPlaneDetectionPropertiesEXT::TYPE,
        next: ptr::null_mut(),
        supported_features: sys::PlaneDetectionCapabilityFlagsEXT::EMPTY,
    };
    let mut properties = sys::SystemProperties::out((&raw mut planes).cast());
    // SAFETY: `properties` and the structure chained to it have their types set and live until the call returns.
    let result =
        unsafe { (instance.fp().get_system_properties)(instance.as_raw(), system, properties.as_mut_ptr()) };
    result == sys::Result::SUCCESS
        && planes.supported_features.contains(sys::PlaneDetectionCapabilityFlagsEXT::PLANE_DETECTION)
}

/// A running detection. Destroyed with its session at the latest.
pub(in crate::xr) struct PlaneDetector<G> {
    handle: sys::PlaneDetectorEXT,
    functions: raw::PlaneDetectionEXT,
    session: Session<G>,
}

impl<G> PlaneDetector<G> {
    /// A detector of upward and upright planes; `None` without the extension.
    pub(in crate::xr) fn new(session: &Session<G>) -> Result<Option<Self>, XrError> {
        let Some(functions) = session.instance().exts().ext_plane_detection else { return Ok(None) };
        let create = sys::PlaneDetectorCreateInfoEXT {
            ty: sys::PlaneDetectorCreateInfoEXT::TYPE,
            next: ptr::null(),
            flags: sys::PlaneDetectorFlagsEXT::ENABLE_CONTOUR,
        };
        let mut handle = sys::PlaneDetectorEXT::NULL;
        // SAFETY: the session is live; `create` and `handle` live until the call returns.
        check(unsafe {
            (functions.create_plane_detector)(session.as_raw(), &raw const create, &raw mut handle)
        })?;
        Ok(Some(Self { handle, functions, session: session.clone() }))
    }

    /// Starts looking for planes near the origin of `space`.
    pub(in crate::xr) fn begin(&self, space: &Space, time: Time) -> Result<(), XrError> {
        let orientations =
            [sys::PlaneDetectorOrientationEXT::HORIZONTAL_UPWARD, sys::PlaneDetectorOrientationEXT::VERTICAL];
        let side = 2.0 * REACH_M;
        let begin = sys::PlaneDetectorBeginInfoEXT {
            ty: sys::PlaneDetectorBeginInfoEXT::TYPE,
            next: ptr::null(),
            base_space: space.as_raw(),
            time,
            orientation_count: orientations.len() as u32,
            orientations: orientations.as_ptr(),
            semantic_type_count: 0,
            semantic_types: ptr::null(),
            max_planes: MOST_PLANES,
            min_area: LEAST_AREA_M2,
            bounding_box_pose: Posef::IDENTITY,
            bounding_box_extent: sys::Extent3Df { width: side, height: side, depth: side },
        };
        // SAFETY: the detector is live as its session is; `begin` and its array live until the call returns.
        check(unsafe { (self.functions.begin_plane_detection)(self.handle, &raw const begin) })
    }

    /// The planes found since [`begin`](Self::begin), in `space`; `None` while it is still looking.
    pub(in crate::xr) fn found(
        &self,
        space: &Space,
        time: Time,
    ) -> Result<Option<Vec<DetectedPlane>>, XrError> {
        let mut state = sys::PlaneDetectionStateEXT::NONE;
        // SAFETY: the detector is live; `state` lives until the call returns.
        check(unsafe { (self.functions.get_plane_detection_state)(self.handle, &raw mut state) })?;
        match state {
            sys::PlaneDetectionStateEXT::PENDING => return Ok(None),
            sys::PlaneDetectionStateEXT::DONE => {}
            _ => return Ok(Some(Vec::new())),
        }
        let get = sys::PlaneDetectorGetInfoEXT {
            ty: sys::PlaneDetectorGetInfoEXT::TYPE,
            next: ptr::null(),
            base_space: space.as_raw(),
            time,
        };
        let blank = sys::PlaneDetectorLocationEXT {
            ty: sys::PlaneDetectorLocationEXT::TYPE,
            next: ptr::null_mut(),
            plane_id: 0,
            location_flags: sys::SpaceLocationFlags::EMPTY,
            pose: Posef::IDENTITY,
            extents: sys::Extent2Df { width: 0.0, height: 0.0 },
            orientation: sys::PlaneDetectorOrientationEXT::ARBITRARY,
            semantic_type: sys::PlaneDetectorSemanticTypeEXT::UNDEFINED,
            polygon_buffer_count: 0,
        };
        let mut places = vec![blank; MOST_PLANES as usize];
        let mut list = sys::PlaneDetectorLocationsEXT {
            ty: sys::PlaneDetectorLocationsEXT::TYPE,
            next: ptr::null_mut(),
            plane_location_capacity_input: MOST_PLANES,
            plane_location_count_output: 0,
            plane_locations: places.as_mut_ptr(),
        };
        // SAFETY: `list` names `places` with its true length, and both live until the call returns.
        check(unsafe { (self.functions.get_plane_detections)(self.handle, &raw const get, &raw mut list) })?;
        places.truncate(list.plane_location_count_output as usize);
        let valid = sys::SpaceLocationFlags::POSITION_VALID | sys::SpaceLocationFlags::ORIENTATION_VALID;
        let known = places.iter().filter(|place| place.location_flags.contains(valid));
        let planes = known.map(|place| {
            let outline_m =
                if place.polygon_buffer_count > 0 { self.outline(place.plane_id)? } else { Vec::new() };
            Ok(DetectedPlane {
                id: place.plane_id,
                pose: place.pose,
                axes: PlaneAxes::XZ,
                extents_m: [place.extents.width, place.extents.height],
                orientation: place.orientation,
                meaning: place.semantic_type,
                outline_pose: place.pose,
                outline_m,
            })
        });
        planes.collect::<Result<_, XrError>>().map(Some)
    }

    /// The outer outline of a plane.
    fn outline(&self, id: u64) -> Result<Vec<[f32; 2]>, XrError> {
        let mut buffer = sys::PlaneDetectorPolygonBufferEXT {
            ty: sys::PlaneDetectorPolygonBufferEXT::TYPE,
            next: ptr::null_mut(),
            vertex_capacity_input: 0,
            vertex_count_output: 0,
            vertices: ptr::null_mut(),
        };
        // SAFETY: a capacity of 0 asks only for the number; `buffer` lives until the call returns.
        check(unsafe { (self.functions.get_plane_polygon_buffer)(self.handle, id, 0, &raw mut buffer) })?;
        let count = buffer.vertex_count_output.min(MOST_CORNERS);
        let mut corners = vec![sys::Vector2f { x: 0.0, y: 0.0 }; count as usize];
        (buffer.vertex_capacity_input, buffer.vertices) = (count, corners.as_mut_ptr());
        // SAFETY: `buffer` names `corners` with its true length, and both live until the call returns.
        check(unsafe { (self.functions.get_plane_polygon_buffer)(self.handle, id, 0, &raw mut buffer) })?;
        corners.truncate(buffer.vertex_count_output as usize);
        Ok(corners.iter().map(|corner| [corner.x, corner.y]).collect())
    }
}

impl<G> Drop for PlaneDetector<G> {
    fn drop(&mut self) {
        // The session is alive: this value holds it.
        let _ = &self.session;
        // SAFETY: the handle was made by this session, is live, and nobody uses it afterwards.
        let _ = unsafe { (self.functions.destroy_plane_detector)(self.handle) };
    }
}

fn check(result: sys::Result) -> Result<(), XrError> {
    if result.into_raw() >= 0 { Ok(()) } else { Err(result.into()) }
}
