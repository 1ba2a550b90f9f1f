//! The headset's own planes as surfaces of the room: from XR_EXT_spatial_plane_tracking where there is such a thing, else
//! from XR_EXT_plane_detection.
//!
//! The older extension puts a plane into the x–z plane of its pose with y as its normal, the newer one (and Meta's) into
//! x–y with z. Runtimes have confused the two: where the axis of the specification disagrees with what the plane is said
//! to be and the other one agrees, the other one is taken.

mod detection;
mod tracking;

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};
use openxr::{Posef, ReferenceSpaceType, Session, Time, Vulkan, sys};

use super::{
    XrError,
    ffi::planes::{DetectedPlane, PlaneAxes},
    headset::Headset,
    room::{self, UP},
};
use crate::placement::{Plane, PlaneSource, Surface, SurfaceId, SurfaceKind};

/// A level plane this far above the lowest one is no floor, metres.
const ABOVE_FLOOR_M: f64 = 0.2;
/// Level planes between these heights above the floor can be seats or tables; from the second on they are tables.
const TABLE_FROM_M: f64 = 0.55;
/// Cosines between a plane's normal and gravity's: an axis that is as good as along it, and one that is as good as level.
const ALONG: f64 = 0.7;
const LEVEL: f64 = 0.3;

/// A source of planes that asks the runtime.
pub(super) trait RuntimePlanes: PlaneSource {
    /// The runtime's time of the frame for which the planes are wanted.
    fn set_time(&mut self, time: Time);

    /// The runtime says that looking is worth it now.
    fn look(&mut self) {}
}

/// The best source of planes that the headset has; `None`, said in the log, when it knows none.
pub(super) fn source(
    headset: &Headset,
    session: &Session<Vulkan>,
) -> Result<Option<Box<dyn RuntimePlanes>>, XrError> {
    let space = || session.create_reference_space(ReferenceSpaceType::LOCAL, Posef::IDENTITY);
    if headset.tracks_planes
        && let Some(source) = tracking::TrackedPlanes::new(session, headset.system, space()?)?
    {
        return Ok(Some(Box::new(source)));
    }
    if headset.detects_planes
        && let Some(source) = detection::DetectedPlanes::new(session, space()?)?
    {
        tracing::info!("no planes through XR_EXT_spatial_plane_tracking: taken from XR_EXT_plane_detection");
        return Ok(Some(Box::new(source)));
    }
    tracing::warn!(
        "{} tells of no planes (neither XR_EXT_spatial_plane_tracking nor XR_EXT_plane_detection), and OpenXR has no depth \
         pictures for a finder of our own: the match can only float",
        headset.runtime
    );
    Ok(None)
}

/// Planes of the runtime as surfaces with ids that last.
fn surfaces(planes: &[DetectedPlane], ids: &mut BTreeMap<u64, SurfaceId>) -> Vec<Surface> {
    let level = planes
        .iter()
        .filter(|plane| plane.orientation == sys::PlaneDetectorOrientationEXT::HORIZONTAL_UPWARD);
    let floor_m = level.map(|plane| f64::from(plane.pose.position.y)).fold(f64::INFINITY, f64::min);
    let mut surfaces = Vec::new();
    for plane in planes {
        let (position_m, turn) = room::rigid(plane.pose);
        let axes = axes(plane, turn);
        let to_room = |(place_m, turn): (DVec3, DQuat), [first, second]: [f32; 2]| {
            let (x, second) = (f64::from(first), f64::from(second));
            place_m
                + turn
                    * match axes {
                        PlaneAxes::XY => DVec3::new(x, second, 0.0),
                        PlaneAxes::XZ => DVec3::new(x, 0.0, second),
                    }
        };
        let normal = turn * normal_of(axes);
        let mut outline_m: Vec<DVec3> = if plane.outline_m.len() < 3 {
            let [width, height] = plane.extents_m.map(|extent| extent / 2.0);
            let corners = [[-width, -height], [width, -height], [width, height], [-width, height]];
            corners.map(|corner| to_room((position_m, turn), corner)).to_vec()
        } else {
            let origin = room::rigid(plane.outline_pose);
            plane.outline_m.iter().map(|corner| to_room(origin, *corner)).collect()
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

fn normal_of(axes: PlaneAxes) -> DVec3 {
    match axes {
        PlaneAxes::XZ => DVec3::Y,
        PlaneAxes::XY => DVec3::Z,
    }
}

/// The axes that span a plane: the specification's, unless only the others agree with how the plane is said to lie.
fn axes(plane: &DetectedPlane, turn: DQuat) -> PlaneAxes {
    use sys::PlaneDetectorOrientationEXT as Lies;
    let agrees = |axes| {
        let up = (turn * normal_of(axes)).dot(UP);
        match plane.orientation {
            Lies::HORIZONTAL_UPWARD => up > ALONG,
            Lies::HORIZONTAL_DOWNWARD => up < -ALONG,
            Lies::VERTICAL => up.abs() < LEVEL,
            _ => true,
        }
    };
    let other = match plane.axes {
        PlaneAxes::XZ => PlaneAxes::XY,
        PlaneAxes::XY => PlaneAxes::XZ,
    };
    if !agrees(plane.axes) && agrees(other) { other } else { plane.axes }
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
            axes: PlaneAxes::XZ,
            extents_m: [1.2, 0.8],
            orientation: sys::PlaneDetectorOrientationEXT::HORIZONTAL_UPWARD,
            meaning,
            outline_pose: room::pose(position_m, turn),
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

    /// A wall's pose may have a level axis that is not its normal: the specification's one counts.
    #[test]
    fn a_wall_faces_where_its_extension_says() {
        let mut wall = plane(
            5,
            DVec3::new(0.0, 0.3, -2.0),
            DQuat::from_rotation_x(FRAC_PI_2),
            sys::PlaneDetectorSemanticTypeEXT::WALL,
        );
        wall.orientation = sys::PlaneDetectorOrientationEXT::VERTICAL;
        // y towards the viewer, z down; then both level.
        let turned = DQuat::from_rotation_z(FRAC_PI_2) * DQuat::from_rotation_x(FRAC_PI_2);
        for (axes, pose, normal) in [
            (PlaneAxes::XZ, DQuat::from_rotation_x(FRAC_PI_2), DVec3::Z),
            (PlaneAxes::XY, DQuat::IDENTITY, DVec3::Z),
            (PlaneAxes::XY, DQuat::from_rotation_z(FRAC_PI_2), DVec3::Z),
            (PlaneAxes::XZ, turned, DVec3::Z),
        ] {
            (wall.axes, wall.pose) = (axes, room::pose(DVec3::ZERO, pose));
            let found = surfaces(std::slice::from_ref(&wall), &mut BTreeMap::new());
            assert!(found[0].plane.normal.distance(normal) < 1e-6, "{axes:?}: {:?}", found[0].plane);
            assert_eq!(found[0].kind, SurfaceKind::Wall);
        }
    }

    #[test]
    fn an_outline_has_an_origin_of_its_own() {
        let turn = DQuat::from_rotation_x(-FRAC_PI_2);
        let mut table =
            plane(3, DVec3::new(0.0, -0.4, -1.0), turn, sys::PlaneDetectorSemanticTypeEXT::PLATFORM);
        table.axes = PlaneAxes::XY;
        table.outline_pose = room::pose(DVec3::new(0.5, -0.4, -1.0), turn);
        table.outline_m = vec![[-1.0, -0.5], [0.0, -0.5], [0.0, 0.5]];
        let found = surfaces(&[table], &mut BTreeMap::new());
        let places = [(-0.5, -0.5), (0.5, -0.5), (0.5, -1.5)].map(|(x, z)| DVec3::new(x, -0.4, z));
        for place in places {
            assert!(
                found[0].outline_m.iter().any(|corner| corner.distance(place) < 1e-6),
                "{place}: {found:?}"
            );
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
