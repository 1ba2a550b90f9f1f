//! The match on the table of a synthesized room: three cameras, with a cup or a box in front, and a ghost.
//!
//! The room is drawn by rule (`player::ar::synthetic`), the match is the excerpt of the demo stream, so the kept pictures
//! hold nothing that somebody recorded.

use glam::DVec3;
use holopitch_tests::{
    excerpt,
    snapshot::{Snapshot, compare},
};
use image::RgbaImage;
use player::{
    ar::{RoomLight, synthetic::SyntheticRoom},
    placement::{
        Surface,
        fit::{Facing, Wish, fit},
    },
    renderer::OnTable,
    scene::FrameScene,
};
use protocol::{limits::Limits, pitch::Pitch};

use super::{MEAN, WORST_BLOCK, software_adapter};

/// The table as if nothing stood on it: the match then lies behind the cup and around the box.
fn ignoring_things(room: &SyntheticRoom) -> Surface {
    Surface { obstacles_m: Vec::new(), ..room.table() }
}

fn draw(table: &Surface, view: usize, opacity: f64, depth: bool) -> Option<RgbaImage> {
    let gpu = software_adapter()?;
    let room = SyntheticRoom::default();
    let mut picture = room.picture(&room.cameras()[view].resized(480, 360));
    if !depth {
        picture.depth_m.fill(0.0);
    }
    let wish = Wish { viewer_m: Some(room.cameras()[0].position_m), ..Wish::of(Pitch::default()) };
    let pose = fit(table, &Wish { facing: Facing::LongerSide, ..wish }).unwrap();
    let light = RoomLight::estimate(&room.picture(&room.cameras()[0]), table);
    let scene = FrameScene::new(&excerpt::frame(), &[], &Limits::default()).unwrap();
    let on_table = OnTable { pose, light, opacity };
    Some(gpu.picture_in_room(Pitch::default(), &scene, &picture, &on_table).unwrap())
}

#[test]
fn a_cup_stands_in_front_of_the_match() {
    let Some(drawn) = draw(&ignoring_things(&SyntheticRoom::default()), 0, 1.0, true) else { return };
    Snapshot::new("room-cup", drawn).matches_within(MEAN, WORST_BLOCK);
}

#[test]
fn the_match_fits_between_the_things_seen_from_the_left() {
    let Some(drawn) = draw(&SyntheticRoom::default().table(), 1, 1.0, true) else { return };
    Snapshot::new("room-left", drawn).matches_within(MEAN, WORST_BLOCK);
}

#[test]
fn a_box_hides_a_corner_seen_from_the_right() {
    let Some(drawn) = draw(&ignoring_things(&SyntheticRoom::default()), 2, 1.0, true) else { return };
    Snapshot::new("room-right", drawn).matches_within(MEAN, WORST_BLOCK);
}

#[test]
fn a_ghost_on_the_table() {
    let Some(drawn) = draw(&SyntheticRoom::default().table(), 0, 0.35, true) else { return };
    Snapshot::new("room-ghost", drawn).matches_within(MEAN, WORST_BLOCK);
}

/// The bounds are worth something: without occlusion, or on a table two centimetres lower, the picture is another.
#[test]
fn the_bounds_notice_a_match_over_the_cup_or_off_the_table() {
    let table = ignoring_things(&SyntheticRoom::default());
    let Some(right) = draw(&table, 0, 1.0, true) else { return };
    let mut lower = table.clone();
    lower.plane.offset_m += 0.02;
    lower.outline_m.iter_mut().for_each(|corner| *corner -= DVec3::Y * 0.02);
    for (what, wrong) in
        [("not hidden", draw(&table, 0, 1.0, false)), ("too low", draw(&lower, 0, 1.0, true))]
    {
        let difference = compare(&right, &wrong.unwrap());
        assert!(
            difference.mean > MEAN || difference.worst_block > WORST_BLOCK,
            "{what} goes unnoticed: {difference:?}"
        );
    }
}
