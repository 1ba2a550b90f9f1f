//! The match as a headset's eye is given it, laid over the picture of a synthesized room as the headset's compositor would:
//! on the table with what the runtime knows of a box in front of it, and as a preview on the highlighted table.
//!
//! The cup is no known surface: nothing tells the headset of it, and the match is drawn over it.

use glam::{DMat3, DQuat, DVec3};
use holopitch_tests::{
    excerpt,
    over::over,
    snapshot::{Snapshot, compare},
};
use image::RgbaImage;
use player::{
    ar::{RoomCamera, synthetic::SyntheticRoom},
    camera::EyeView,
    placement::{
        Plane, Surface, SurfaceId, SurfaceKind, TabletopPose,
        fit::{Wish, fit},
    },
    renderer::{InRoom, Marks, PictureFormat, RoomScene, Sight, Standing, Surroundings},
    scene::{FrameScene, Stage},
};
use protocol::{limits::Limits, pitch::Pitch};

use super::{MEAN, WORST_BLOCK, software_adapter};

const SIZE_PX: (u32, u32) = (480, 360);
const FORMAT: PictureFormat = PictureFormat {
    colour: player::renderer::COLOUR_FORMAT,
    samples: 4,
    views: 1,
    surroundings: Surroundings::Transparent,
};

/// The table as a runtime reports it, which sees nothing of what stands on it.
fn table(room: &SyntheticRoom) -> Surface {
    Surface { obstacles_m: Vec::new(), ..room.table() }
}

/// The top and the two sides of the box that are seen from the right.
fn carton(room: &SyntheticRoom) -> [Surface; 3] {
    let y = room.table_height_m;
    let (low, high) = (DVec3::new(0.44, y, -0.24), DVec3::new(0.62, y + 0.2, -0.1));
    let surface = |id, kind, normal: DVec3, outline_m: [DVec3; 4]| Surface {
        id: SurfaceId(id),
        kind,
        plane: Plane::through(outline_m[0], normal),
        outline_m: outline_m.to_vec(),
        obstacles_m: Vec::new(),
        confidence: 1.0,
    };
    let at = DVec3::new;
    let top = [(low.x, high.z), (high.x, high.z), (high.x, low.z), (low.x, low.z)];
    let front = [(low.x, low.y), (high.x, low.y), (high.x, high.y), (low.x, high.y)];
    let side = [(high.z, low.y), (low.z, low.y), (low.z, high.y), (high.z, high.y)];
    [
        surface(2, SurfaceKind::Other, DVec3::Y, top.map(|(x, z)| at(x, high.y, z))),
        surface(3, SurfaceKind::Wall, DVec3::Z, front.map(|(x, y)| at(x, y, high.z))),
        surface(4, SurfaceKind::Wall, DVec3::X, side.map(|(z, y)| at(high.x, y, z))),
    ]
}

fn eye(camera: &RoomCamera) -> EyeView {
    let (right, down, forward) = (camera.rotation.row(0), camera.rotation.row(1), camera.rotation.row(2));
    let [width, height] = camera.size_px.map(f64::from);
    let from_edge = |edge: f64, centre: f64, focal: f64| (edge - 0.5 - centre) / focal;
    EyeView {
        position_m: camera.position_m,
        orientation: DQuat::from_mat3(&DMat3::from_cols(right, -down, -forward)),
        tangents: [
            from_edge(0.0, camera.centre_px.x, camera.focal_px.x),
            from_edge(width, camera.centre_px.x, camera.focal_px.x),
            -from_edge(0.0, camera.centre_px.y, camera.focal_px.y),
            -from_edge(height, camera.centre_px.y, camera.focal_px.y),
        ],
    }
}

/// What the user sees: the match at `opacity`, hidden by `known` surfaces, with handles or with the table highlighted.
fn draw(view: usize, opacity: f64, known: &[Surface], highlighted: bool, sight: Sight) -> Option<RgbaImage> {
    let gpu = software_adapter()?;
    let room = SyntheticRoom::default();
    let camera = room.cameras()[view].resized(SIZE_PX.0, SIZE_PX.1);
    let table = table(&room);
    let wish = Wish { viewer_m: Some(room.cameras()[0].position_m), ..Wish::of(Pitch::default()) };
    let pose = fit(&table, &wish).unwrap();
    let stage = Stage::on_real_table(Pitch::default());
    let mut in_room = InRoom::new(&gpu.device, &gpu.queue, &stage, FORMAT, sight);
    let frame = FrameScene::new(&excerpt::frame(), &[], &Limits::default()).unwrap();
    in_room.upload(&gpu.device, &gpu.queue, &frame);
    in_room.know(&gpu.device, &gpu.queue, known.iter());
    let [x, z] = stage.layout.half_turf_m.map(|half| half * 1.06 * pose.scale);
    let corner = |(x, z): (f64, f64)| pose.foot_m() + pose.orientation * DVec3::new(x, 0.0, z);
    let handles: ([DVec3; 4], TabletopPose) = ([(x, z), (x, -z), (-x, -z), (-x, z)].map(corner), pose);
    let scene = RoomScene {
        standing: Some(Standing { pose, opacity, on: Some(&table) }),
        marks: Marks {
            highlighted: highlighted.then(|| (table.clone(), true)),
            handles: (!highlighted).then_some(handles),
        },
    };
    in_room.prepare(&gpu.device, &gpu.queue, &scene);
    let front = gpu.picture_for_eye(&in_room, FORMAT, &eye(&camera), SIZE_PX).unwrap();
    let seen = room.picture(&camera).colour;
    let behind = |x, y| {
        let [r, g, b, _] = seen.get_pixel(x, y).0;
        [r, g, b]
    };
    Some(over(behind, &front))
}

fn known() -> Vec<Surface> {
    let room = SyntheticRoom::default();
    carton(&room).into_iter().chain([table(&room)]).collect()
}

#[test]
fn known_surfaces_hide_the_match_and_the_table_catches_its_shadow() {
    let Some(drawn) = draw(2, 1.0, &known(), false, Sight::Room) else { return };
    Snapshot::new("eye-placed", drawn).matches_within(MEAN, WORST_BLOCK);
}

#[test]
fn a_preview_on_the_highlighted_table() {
    let Some(drawn) = draw(0, 0.65, &known(), true, Sight::Room) else { return };
    Snapshot::new("eye-preview", drawn).matches_within(MEAN, WORST_BLOCK);
}

/// The bounds are worth something: a match over the box, without its shadow, or without handles is another picture.
#[test]
fn the_bounds_notice_what_makes_the_table_real() {
    let Some(right) = draw(2, 1.0, &known(), false, Sight::Room) else { return };
    for (what, wrong) in [
        ("not hidden", draw(2, 1.0, &[], false, Sight::Room)),
        ("no shadow", draw(2, 1.0, &known(), false, Sight::RoomPlusLight)),
        ("no handles", draw(2, 1.0, &known(), true, Sight::Room)),
    ] {
        let difference = compare(&right, &wrong.unwrap());
        assert!(
            difference.mean > MEAN || difference.worst_block > WORST_BLOCK,
            "{what} goes unnoticed: {difference:?}"
        );
    }
}
