//! The headset's own planes (XR_EXT_plane_detection) as surfaces of the room.
//!
//! A detection is started about once a second and asked after every frame; nothing waits for it. The extension puts a
//! plane into the x–z plane of its pose with y as its normal, where Meta's and the newer XR_EXT_spatial_plane_tracking
//! use x–y and z. Runtimes have confused the two: the axis that agrees with what the plane is said to be is taken.

use std::{collections::BTreeMap, time::Duration};

use glam::{DQuat, DVec3};
use openxr::{Session, Space, Time, Vulkan, sys};

use super::{
    XrError,
    ffi::planes::{DetectedPlane, PlaneDetector},
    room::{self, UP},
};
use crate::placement::{Plane, PlaneSource, Surface, SurfaceId, SurfaceKind};

/// Between two detections.
const EVERY: Duration = Duration::from_secs(1);
/// A level plane this far above the lowest one is no floor, metres.
const ABOVE_FLOOR_M: f64 = 0.2;
/// Level planes between these heights above the floor can be seats or tables; from the second on they are tables.
const TABLE_FROM_M: f64 = 0.55;

/// The runtime's planes.
pub(super) struct RuntimePlanes {
    detector: PlaneDetector<Vulkan>,
    space: Space,
    time: Time,
    begun_at: Option<Duration>,
    pending: bool,
    ids: BTreeMap<u64, SurfaceId>,
    known: Vec<Surface>,
}

impl RuntimePlanes {
    /// A source on a session; `None` when the headset detects no planes. `space` is the room's frame.
    pub(super) fn new(session: &Session<Vulkan>, space: Space) -> Result<Option<Self>, XrError> {
        Ok(PlaneDetector::new(session)?.map(|detector| Self {
            detector,
            space,
            time: Time::from_nanos(0),
            begun_at: None,
            pending: false,
            ids: BTreeMap::new(),
            known: Vec::new(),
        }))
    }

    /// The runtime's time of the frame for which the planes are wanted.
    pub(super) fn set_time(&mut self, time: Time) {
        self.time = time;
    }

    fn ask(&mut self, now: Duration) -> Result<Option<Vec<DetectedPlane>>, XrError> {
        if self.pending {
            let found = self.detector.found(&self.space, self.time)?;
            self.pending = found.is_none();
            return Ok(found);
        }
        if self.begun_at.is_none_or(|begun| now.saturating_sub(begun) >= EVERY) {
            self.begun_at = Some(now);
            self.detector.begin(&self.space, self.time)?;
            self.pending = true;
        }
        Ok(None)
    }
}

impl PlaneSource for RuntimePlanes {
    fn name(&self) -> &str {
        "XR_EXT_plane_detection"
    }

    fn poll(&mut self, now: Duration) -> Option<Vec<Surface>> {
        let planes = match self.ask(now) {
            Ok(planes) => planes?,
            Err(error) => {
                tracing::warn!("planes: {error}");
                self.pending = false;
                return None;
            }
        };
        let surfaces = surfaces(&planes, &mut self.ids);
        let changed = surfaces != self.known;
        self.known.clone_from(&surfaces);
        changed.then_some(surfaces)
    }
}

/// Planes of the runtime as surfaces with ids that last.
fn surfaces(planes: &[DetectedPlane], ids: &mut BTreeMap<u64, SurfaceId>) -> Vec<Surface> {
    let level = planes
        .iter()
        .filter(|plane| plane.orientation == sys::PlaneDetectorOrientationEXT::HORIZONTAL_UPWARD);
    let floor_m = level.map(|plane| f64::from(plane.pose.position.y)).fold(f64::INFINITY, f64::min);
    let mut surfaces = Vec::new();
    for plane in planes {
        let (position_m, turn) =
            (room::position(plane.pose.position), room::orientation(plane.pose.orientation));
        let upright_z = lies_in_x_y(plane.orientation, turn);
        let to_room = |[x, y]: [f32; 2]| {
            let (x, y) = (f64::from(x), f64::from(y));
            position_m + turn * if upright_z { DVec3::new(x, y, 0.0) } else { DVec3::new(x, 0.0, y) }
        };
        let normal = turn * if upright_z { DVec3::Z } else { DVec3::Y };
        let mut outline_m: Vec<DVec3> = if plane.outline_m.len() < 3 {
            let [width, height] = plane.extents_m.map(|extent| extent / 2.0);
            [[-width, -height], [width, -height], [width, height], [-width, height]].map(to_room).to_vec()
        } else {
            plane.outline_m.iter().copied().map(to_room).collect()
        };
        if !outline_m.iter().all(|corner| corner.is_finite()) {
            tracing::warn!("the runtime's plane {} has corners that are no numbers: left out", plane.id);
            continue;
        }
        if signed_area_m2(&outline_m, normal) < 0.0 {
            outline_m.reverse();
        }
        let next = SurfaceId(u32::try_from(ids.len()).unwrap_or(u32::MAX));
        let id = *ids.entry(plane.id).or_insert(next);
        let kind = kind(plane, position_m.y - floor_m);
        surfaces.push(Surface {
            id,
            kind,
            plane: Plane::through(position_m, normal),
            outline_m,
            obstacles_m: Vec::new(),
            confidence: 1.0,
        });
    }
    surfaces
}

/// Whether a plane lies in the x–y plane of its pose and not in x–z: its normal then agrees better with gravity.
fn lies_in_x_y(orientation: sys::PlaneDetectorOrientationEXT, turn: DQuat) -> bool {
    let (y, z) = ((turn * DVec3::Y).dot(UP), (turn * DVec3::Z).dot(UP));
    match orientation {
        sys::PlaneDetectorOrientationEXT::HORIZONTAL_UPWARD => z > y,
        sys::PlaneDetectorOrientationEXT::HORIZONTAL_DOWNWARD => z < y,
        sys::PlaneDetectorOrientationEXT::VERTICAL => z.abs() < y.abs(),
        _ => false,
    }
}

/// What it is: as the runtime says, else by its height above the lowest level plane.
fn kind(plane: &DetectedPlane, above_floor_m: f64) -> SurfaceKind {
    use sys::PlaneDetectorSemanticTypeEXT as Meaning;
    match (plane.meaning, plane.orientation) {
        (Meaning::FLOOR, _) => SurfaceKind::Floor,
        (Meaning::WALL, _) | (_, sys::PlaneDetectorOrientationEXT::VERTICAL) => SurfaceKind::Wall,
        (Meaning::PLATFORM, _) => SurfaceKind::Table,
        (Meaning::CEILING, _) => SurfaceKind::Other,
        (_, sys::PlaneDetectorOrientationEXT::HORIZONTAL_UPWARD) if above_floor_m >= TABLE_FROM_M => {
            SurfaceKind::Table
        }
        (_, sys::PlaneDetectorOrientationEXT::HORIZONTAL_UPWARD) if above_floor_m >= ABOVE_FLOOR_M => {
            SurfaceKind::Seat
        }
        (_, sys::PlaneDetectorOrientationEXT::HORIZONTAL_UPWARD) => SurfaceKind::Floor,
        _ => SurfaceKind::Other,
    }
}

/// Area of an outline seen from the side of `normal`; positive when its corners run counter-clockwise.
fn signed_area_m2(outline_m: &[DVec3], normal: DVec3) -> f64 {
    let Some(first) = outline_m.first() else { return 0.0 };
    let twice: f64 =
        outline_m.windows(2).map(|pair| (pair[0] - *first).cross(pair[1] - *first).dot(normal)).sum();
    twice / 2.0
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    fn plane(
        id: u64,
        position_m: DVec3,
        turn: DQuat,
        meaning: sys::PlaneDetectorSemanticTypeEXT,
    ) -> DetectedPlane {
        DetectedPlane {
            id,
            pose: room::pose(position_m, turn),
            extents_m: [1.2, 0.8],
            orientation: sys::PlaneDetectorOrientationEXT::HORIZONTAL_UPWARD,
            meaning,
            outline_m: Vec::new(),
        }
    }

    #[test]
    fn a_table_in_either_convention_is_the_same_table() {
        let undefined = sys::PlaneDetectorSemanticTypeEXT::UNDEFINED;
        let place = DVec3::new(0.2, -0.4, -0.9);
        let floor = plane(7, DVec3::new(0.0, -1.2, 0.0), DQuat::IDENTITY, undefined);
        for turn in [DQuat::IDENTITY, DQuat::from_rotation_x(-FRAC_PI_2)] {
            let mut ids = BTreeMap::new();
            let found = surfaces(&[floor.clone(), plane(9, place, turn, undefined)], &mut ids);
            let [floor, table] = &found[..] else { panic!("{found:?}") };
            assert_eq!((floor.kind, table.kind), (SurfaceKind::Floor, SurfaceKind::Table));
            assert!(table.plane.normal.distance(DVec3::Y) < 1e-6, "{turn}: {:?}", table.plane);
            assert!(signed_area_m2(&table.outline_m, DVec3::Y) > 0.95, "counter-clockwise");
            assert!(table.outline_m.iter().all(|corner| table.plane.distance_m(*corner).abs() < 1e-6));
            let across = table.outline_m.iter().map(|corner| (corner.x - place.x).abs()).fold(0.0, f64::max);
            assert!((across - 0.6).abs() < 1e-6);
        }
    }

    #[test]
    fn ids_last_and_nonsense_is_left_out() {
        let platform = sys::PlaneDetectorSemanticTypeEXT::PLATFORM;
        let table = plane(9, DVec3::new(0.0, -0.4, -0.9), DQuat::IDENTITY, platform);
        let mut broken = plane(4, DVec3::ZERO, DQuat::IDENTITY, platform);
        broken.outline_m = vec![[f32::NAN, 0.0], [1.0, 0.0], [1.0, 1.0]];
        let mut ids = BTreeMap::new();
        let first = surfaces(std::slice::from_ref(&table), &mut ids);
        let second = surfaces(&[broken, table], &mut ids);
        assert_eq!((first[0].id, first.len()), (second[0].id, second.len()));
        assert_eq!(first[0].kind, SurfaceKind::Table);
    }
}
