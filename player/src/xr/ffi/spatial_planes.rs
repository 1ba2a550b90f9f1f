//! XR_EXT_spatial_plane_tracking: the planes of the room as entities of a spatial context.
//!
//! A plane lies in the x–y plane of its pose with z as its normal (XrSpatialBounded2DDataEXT: `extents` along the x-axis and
//! the y-axis, centred on `center`), unlike those of XR_EXT_plane_detection.

use std::{collections::BTreeMap, ptr};

use openxr::{Instance, Posef, Session, Space, SystemId, Time, sys};

use super::{
    planes::{DetectedPlane, PlaneAxes},
    spatial::{Context, Discovery, Snapshot, components},
};
use crate::xr::XrError;

/// A polygon in the plane of its pose, metres.
type Outline = (Posef, Vec<[f32; 2]>);

const CAPABILITY: sys::SpatialCapabilityEXT = sys::SpatialCapabilityEXT::PLANE_TRACKING;
/// Told by every runtime that tracks planes.
const ALWAYS: [sys::SpatialComponentTypeEXT; 2] =
    [sys::SpatialComponentTypeEXT::BOUNDED_2D, sys::SpatialComponentTypeEXT::PLANE_ALIGNMENT];
/// Told by some.
const OUTLINE: sys::SpatialComponentTypeEXT = sys::SpatialComponentTypeEXT::POLYGON_2D;
const MEANING: sys::SpatialComponentTypeEXT = sys::SpatialComponentTypeEXT::PLANE_SEMANTIC_LABEL;

/// Whether this headset tracks planes, and not only its runtime knows the extension.
pub(in crate::xr) fn supported(instance: &Instance, system: SystemId) -> bool {
    let offered = components(instance, system, CAPABILITY);
    ALWAYS.iter().all(|needed| offered.contains(needed))
}

/// Planes under observation.
pub(in crate::xr) struct PlaneTracker<G> {
    context: Context<G>,
    components: Vec<sys::SpatialComponentTypeEXT>,
    looking: Option<Discovery>,
}

impl<G> PlaneTracker<G> {
    /// Asks for the planes of the room; `None` without the extension.
    pub(in crate::xr) fn new(session: &Session<G>, system: SystemId) -> Result<Option<Self>, XrError> {
        let offered = components(session.instance(), system, CAPABILITY);
        if !ALWAYS.iter().all(|needed| offered.contains(needed)) {
            return Ok(None);
        }
        let mut wanted = ALWAYS.to_vec();
        wanted.extend([OUTLINE, MEANING].into_iter().filter(|component| offered.contains(component)));
        let configuration = sys::SpatialCapabilityConfigurationPlaneTrackingEXT {
            ty: sys::SpatialCapabilityConfigurationPlaneTrackingEXT::TYPE,
            next: ptr::null(),
            capability: CAPABILITY,
            enabled_component_count: wanted.len() as u32,
            enabled_components: wanted.as_ptr(),
        };
        // SAFETY: the structure is the one for this capability, which the headset offers; it and `wanted` outlive the call.
        let context = unsafe { Context::start(session, (&raw const configuration).cast()) }?;
        Ok(context.map(|context| Self { context, components: wanted, looking: None }))
    }

    /// Starts looking, as soon as the runtime is ready for it. Returns whether it did.
    pub(in crate::xr) fn begin(&mut self) -> Result<bool, XrError> {
        self.looking = self.context.discover(&self.components)?;
        Ok(self.looking.is_some())
    }

    /// The planes found since [`begin`](Self::begin), in `space`; `None` while it is still looking.
    pub(in crate::xr) fn found(
        &mut self,
        space: &Space,
        time: Time,
    ) -> Result<Option<Vec<DetectedPlane>>, XrError> {
        let Some(looking) = self.looking.take() else { return Ok(None) };
        match self.context.discovered(&looking, space, time)? {
            Some(snapshot) => self.read(&snapshot).map(Some),
            None => {
                self.looking = Some(looking);
                Ok(None)
            }
        }
    }

    fn read(&self, snapshot: &Snapshot<G>) -> Result<Vec<DetectedPlane>, XrError> {
        let bounds = |bound_count, bounds| sys::SpatialComponentBounded2DListEXT {
            ty: sys::SpatialComponentBounded2DListEXT::TYPE,
            next: ptr::null_mut(),
            bound_count,
            bounds,
        };
        let no_extent = sys::SpatialBounded2DDataEXT {
            center: Posef::IDENTITY,
            extents: sys::Extent2Df { width: 0.0, height: 0.0 },
        };
        // SAFETY: that is the list of bounds, and bounds are asked for.
        let bounds = unsafe { snapshot.read(&ALWAYS, no_extent, bounds) }?;
        let alignments =
            |plane_alignment_count, plane_alignments| sys::SpatialComponentPlaneAlignmentListEXT {
                ty: sys::SpatialComponentPlaneAlignmentListEXT::TYPE,
                next: ptr::null_mut(),
                plane_alignment_count,
                plane_alignments,
            };
        // SAFETY: that is the list of alignments, and alignments are asked for.
        let alignments =
            unsafe { snapshot.read(&ALWAYS, sys::SpatialPlaneAlignmentEXT::ARBITRARY, alignments) }?;
        let alignments: BTreeMap<u64, _> =
            alignments.into_iter().map(|((id, _), alignment)| (id.into_raw(), alignment)).collect();
        let (outlines, meanings) = (self.outlines(snapshot)?, self.meanings(snapshot)?);
        let followed = bounds
            .into_iter()
            .filter(|((_, state), _)| *state == sys::SpatialEntityTrackingStateEXT::TRACKING);
        Ok(followed
            .map(|((id, _), bound)| {
                let id = id.into_raw();
                let (pose, extents_m) = (bound.center, [bound.extents.width, bound.extents.height]);
                let outline = outlines.get(&id).cloned();
                DetectedPlane {
                    id,
                    pose,
                    axes: PlaneAxes::XY,
                    extents_m,
                    orientation: orientation(alignments.get(&id).copied()),
                    meaning: meaning(meanings.get(&id).copied()),
                    // An outline has a pose of its own.
                    outline_pose: outline.as_ref().map_or(pose, |(origin, _)| *origin),
                    outline_m: outline.map_or_else(Vec::new, |(_, corners)| corners),
                }
            })
            .collect())
    }

    fn outlines(&self, snapshot: &Snapshot<G>) -> Result<BTreeMap<u64, Outline>, XrError> {
        if !self.components.contains(&OUTLINE) {
            return Ok(BTreeMap::new());
        }
        let list = |polygon_count, polygons| sys::SpatialComponentPolygon2DListEXT {
            ty: sys::SpatialComponentPolygon2DListEXT::TYPE,
            next: ptr::null_mut(),
            polygon_count,
            polygons,
        };
        let none = sys::SpatialPolygon2DDataEXT {
            origin: Posef::IDENTITY,
            vertex_buffer: sys::SpatialBufferEXT {
                buffer_id: sys::SpatialBufferIdEXT::from_raw(0),
                buffer_type: sys::SpatialBufferTypeEXT::UNKNOWN,
            },
        };
        // SAFETY: that is the list of polygons, and polygons are asked for.
        let found = unsafe { snapshot.read(&[OUTLINE], none, list) }?;
        let mut outlines = BTreeMap::new();
        for ((id, _), polygon) in found {
            if polygon.vertex_buffer.buffer_type == sys::SpatialBufferTypeEXT::VECTOR2F {
                let corners = snapshot.corners(polygon.vertex_buffer)?;
                let corners = corners.iter().map(|corner| [corner.x, corner.y]).collect();
                outlines.insert(id.into_raw(), (polygon.origin, corners));
            }
        }
        Ok(outlines)
    }

    fn meanings(
        &self,
        snapshot: &Snapshot<G>,
    ) -> Result<BTreeMap<u64, sys::SpatialPlaneSemanticLabelEXT>, XrError> {
        if !self.components.contains(&MEANING) {
            return Ok(BTreeMap::new());
        }
        let list = |semantic_label_count, semantic_labels| sys::SpatialComponentPlaneSemanticLabelListEXT {
            ty: sys::SpatialComponentPlaneSemanticLabelListEXT::TYPE,
            next: ptr::null_mut(),
            semantic_label_count,
            semantic_labels,
        };
        let none = sys::SpatialPlaneSemanticLabelEXT::UNCATEGORIZED;
        // SAFETY: that is the list of labels, and labels are asked for.
        let found = unsafe { snapshot.read(&[MEANING], none, list) }?;
        Ok(found.into_iter().map(|((id, _), label)| (id.into_raw(), label)).collect())
    }
}

fn orientation(alignment: Option<sys::SpatialPlaneAlignmentEXT>) -> sys::PlaneDetectorOrientationEXT {
    use sys::{PlaneDetectorOrientationEXT as Orientation, SpatialPlaneAlignmentEXT as Alignment};
    match alignment {
        Some(Alignment::HORIZONTAL_UPWARD) => Orientation::HORIZONTAL_UPWARD,
        Some(Alignment::HORIZONTAL_DOWNWARD) => Orientation::HORIZONTAL_DOWNWARD,
        Some(Alignment::VERTICAL) => Orientation::VERTICAL,
        _ => Orientation::ARBITRARY,
    }
}

fn meaning(label: Option<sys::SpatialPlaneSemanticLabelEXT>) -> sys::PlaneDetectorSemanticTypeEXT {
    use sys::{PlaneDetectorSemanticTypeEXT as Meaning, SpatialPlaneSemanticLabelEXT as Label};
    match label {
        Some(Label::FLOOR) => Meaning::FLOOR,
        Some(Label::WALL) => Meaning::WALL,
        Some(Label::CEILING) => Meaning::CEILING,
        Some(Label::TABLE) => Meaning::PLATFORM,
        _ => Meaning::UNDEFINED,
    }
}
