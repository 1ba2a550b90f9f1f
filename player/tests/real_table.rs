//! The match on a table of a synthesized room, on a software adapter: what hides it, where it stands, what it shadows.
//!
//! Without a software Vulkan driver the tests say so and pass, unless `HOLOPITCH_REQUIRE_TOOLS=1`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use glam::DVec3;
use image::RgbaImage;
use player::{
    ar::{RoomLight, RoomPicture, synthetic::SyntheticRoom},
    offscreen::Offscreen,
    placement::{
        TabletopPose,
        fit::{Wish, fit},
    },
    renderer::{OnTable, RealTable},
    scene::FrameScene,
};
use protocol::{limits::Limits, pitch::Pitch, sample};

fn software_adapter() -> Option<Offscreen> {
    match Offscreen::open_software() {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            let required = std::env::var_os("HOLOPITCH_REQUIRE_TOOLS").is_some_and(|value| value == "1");
            assert!(!required, "{error}");
            println!("skipped: {error}");
            None
        }
    }
}

fn frame() -> FrameScene {
    FrameScene::new(&sample::frame_of(40, 22), &[], &Limits::default()).unwrap()
}

fn pose(room: &SyntheticRoom) -> TabletopPose {
    let viewer_m = Some(room.cameras()[0].position_m);
    fit(&room.table(), &Wish { viewer_m, ..Wish::of(Pitch::default()) }).unwrap()
}

fn draw(gpu: &Offscreen, picture: &RoomPicture, on_table: &OnTable) -> RgbaImage {
    gpu.picture_in_room(Pitch::default(), &frame(), picture, on_table).unwrap()
}

fn on_table(room: &SyntheticRoom, picture: &RoomPicture) -> OnTable {
    OnTable { pose: pose(room), light: RoomLight::estimate(picture, &room.table()), opacity: 1.0 }
}

/// The pixel where a room point lands.
fn pixel(picture: &RoomPicture, point: DVec3) -> (u32, u32) {
    let (at, _) = picture.camera.project(point).unwrap();
    (at.x.round() as u32, at.y.round() as u32)
}

fn is_green([red, green, blue, _]: [u8; 4]) -> bool {
    green > red.saturating_add(12) && green > blue.saturating_add(12)
}

#[test]
fn the_turf_lies_on_the_table_and_the_cup_hides_it() {
    let Some(gpu) = software_adapter() else { return };
    let room = SyntheticRoom::default();
    // The whole table, so that the pitch reaches behind the cup.
    let mut table = room.table();
    table.obstacles_m.clear();
    let pose = fit(&table, &Wish { viewer_m: Some(DVec3::new(0.0, 1.3, 1.0)), ..Wish::of(Pitch::default()) })
        .unwrap();
    let picture = room.picture(&room.cameras()[0]);
    let drawn = draw(&gpu, &picture, &OnTable { pose, light: RoomLight::neutral(DVec3::Y), opacity: 1.0 });
    if let Some(folder) = std::env::var_os("HOLOPITCH_PICTURES") {
        drawn.save(std::path::Path::new(&folder).join("occluded.png")).unwrap();
    }
    let colour = |point: DVec3| {
        let (column, row) = pixel(&picture, point);
        drawn.get_pixel(column, row).0
    };
    for place in [DVec3::new(-0.3, 0.745, 0.1), DVec3::new(0.3, 0.745, 0.2), DVec3::new(0.0, 0.745, -0.25)] {
        assert!(is_green(colour(place)), "no turf at {place}: {:?}", colour(place));
    }
    // The front of the cup and of the box are what they were.
    for place in [DVec3::new(0.12, 0.79, 0.38), DVec3::new(0.53, 0.84, -0.10)] {
        let (column, row) = pixel(&picture, place);
        let (before, after) = (picture.colour.get_pixel(column, row).0, drawn.get_pixel(column, row).0);
        let change: i32 = (0..3).map(|i| (i32::from(before[i]) - i32::from(after[i])).abs()).sum();
        assert!(change < 12, "at {place} {before:?} became {after:?}");
    }
    // Without depth the cup would be drawn over.
    let blind = RoomPicture { depth_m: vec![0.0; picture.depth_m.len()], ..picture.clone() };
    let over = draw(&gpu, &blind, &OnTable { pose, light: RoomLight::neutral(DVec3::Y), opacity: 1.0 });
    let (column, row) = pixel(&picture, DVec3::new(0.12, 0.76, 0.38));
    assert!(is_green(over.get_pixel(column, row).0), "the cup is in front of the turf");
}

#[test]
fn the_table_is_darker_beside_the_turf_and_the_floor_is_not() {
    let Some(gpu) = software_adapter() else { return };
    let room = SyntheticRoom::default();
    let picture = room.picture(&room.cameras()[0]);
    let on_table = on_table(&room, &picture);
    let drawn = draw(&gpu, &picture, &on_table);
    let luminance = |image: &RgbaImage, point: DVec3| {
        let (column, row) = pixel(&picture, point);
        image.get_pixel(column, row).0[..3].iter().map(|value| i32::from(*value)).sum::<i32>()
    };
    let [x, z] = Wish::of(Pitch::default()).half_turf_m;
    let beside = on_table.pose.to_room(DVec3::new(-x - 0.8, -0.8, 0.4 * z));
    assert!(luminance(&drawn, beside) < luminance(&picture.colour, beside) - 20, "no contact shadow");
    // Below the table's edge lies the floor, and beyond it the wall.
    let unchanged = |row: u32| {
        (0..640).all(|column| drawn.get_pixel(column, row) == picture.colour.get_pixel(column, row))
    };
    assert!(unchanged(440) && unchanged(60), "a shadow hangs in the air");
}

/// A picture costs little next to one of the drawn table: printed, as a software adapter's times say nothing of a GPU.
#[test]
fn the_composite_is_timed() {
    let Some(gpu) = software_adapter() else { return };
    let room = SyntheticRoom::default();
    let picture = room.picture(&room.cameras()[0]);
    let on_table = on_table(&room, &picture);
    let target = gpu.target(640, 480).unwrap();
    let mut table = RealTable::new(&gpu.device, &gpu.queue, Pitch::default());
    table.upload(&gpu.device, &gpu.queue, &frame());
    table.show_room(&gpu.device, &gpu.queue, &picture);
    let mut times = Vec::new();
    for _ in 0..8 {
        let started = std::time::Instant::now();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        table.draw(&gpu.device, &gpu.queue, &mut encoder, &target, Some(&on_table));
        gpu.queue.submit([encoder.finish()]);
        gpu.finish().unwrap();
        times.push(started.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    println!("640 × 480 px with occlusion and shadow: {:.0} ms (median of 8, {})", times[4], gpu.adapter);
}

#[test]
fn a_ghost_lets_the_table_through_and_the_same_is_drawn_twice() {
    let Some(gpu) = software_adapter() else { return };
    let room = SyntheticRoom::default();
    let picture = room.picture(&room.cameras()[1]);
    let solid = on_table(&room, &picture);
    let first = draw(&gpu, &picture, &solid);
    if let Some(folder) = std::env::var_os("HOLOPITCH_PICTURES") {
        for (index, camera) in room.cameras().iter().enumerate() {
            let picture = room.picture(camera);
            let drawn = draw(&gpu, &picture, &on_table(&room, &picture));
            drawn.save(std::path::Path::new(&folder).join(format!("synthetic-{index}.png"))).unwrap();
        }
    }
    assert!(first == draw(&gpu, &picture, &solid), "not the same twice");
    let ghost = draw(&gpu, &picture, &OnTable { opacity: 0.35, ..solid });
    let nothing = draw(&gpu, &picture, &OnTable { opacity: 0.0, ..solid });
    assert!(nothing == picture.colour, "an invisible match changes the picture");
    let (column, row) = pixel(&picture, solid.pose.to_room(DVec3::new(10.0, 0.0, 10.0)));
    let green = |image: &RgbaImage| i32::from(image.get_pixel(column, row).0[0]);
    let (table, ghost, turf) = (green(&nothing), green(&ghost), green(&first));
    assert!(turf < ghost && ghost < table, "red {turf}, {ghost}, {table}");
}
