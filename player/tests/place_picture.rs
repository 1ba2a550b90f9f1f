//! `player place --out`: from a scan on disk to the picture of the match on its table, with the program itself.
//!
//! The scan is a room drawn by rule, written as the files that scanners write. Without a software Vulkan driver the tests
//! say so and pass, unless `HOLOPITCH_REQUIRE_TOOLS=1`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use glam::DVec3;
use player::{
    ar::{
        RoomPicture,
        synthetic::{SyntheticRoom, to_pcd},
    },
    offscreen::Offscreen,
};

fn can_draw() -> bool {
    let Err(error) = Offscreen::open_software() else { return true };
    let required = std::env::var_os("HOLOPITCH_REQUIRE_TOOLS").is_some_and(|value| value == "1");
    assert!(!required, "{error}");
    println!("skipped: {error}");
    false
}

fn player(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_player")).args(arguments).output().expect("the player starts")
}

/// A point in the axes of the picture's camera.
fn in_camera(picture: &RoomPicture, point: DVec3) -> DVec3 {
    picture.camera.rotation * (point - picture.camera.position_m)
}

/// The room's three cameras as a sequence of depth and colour pictures with poses.
fn write_sequence(room: &SyntheticRoom, folder: &Path) {
    for sub in ["depth", "color"] {
        fs::create_dir_all(folder.join(sub)).unwrap();
    }
    let mut poses = String::new();
    for (index, camera) in room.cameras().iter().enumerate() {
        let picture = room.picture(camera);
        let (width, height) = picture.colour.dimensions();
        let depth: Vec<u16> = picture.depth_m.iter().map(|depth| (depth * 1000.0).round() as u16).collect();
        image::ImageBuffer::<image::Luma<u16>, _>::from_raw(width, height, depth)
            .unwrap()
            .save(folder.join(format!("depth/{index}.png")))
            .unwrap();
        picture.colour.save(folder.join(format!("color/{index}.png"))).unwrap();
        let turn = glam::DQuat::from_mat3(&camera.rotation.transpose());
        let (p, q) = (camera.position_m, turn);
        poses += &format!("{} {} {} {} {} {} {}\n", p.x, p.y, p.z, q.x, q.y, q.z, q.w);
    }
    fs::write(folder.join("pose.txt"), poses).unwrap();
}

struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        support::write_match(&folder.path().join("stream"), 3);
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }

    /// `player place` with a scan and the stream of these files.
    fn place(&self, scan: &[&str]) -> Output {
        let (stream, out, json) = (self.text("stream"), self.text("out.png"), self.text("out.json"));
        player(&[&["place", "--stream", &stream, "--out", &out, "--json", &json], scan].concat())
    }

    /// The picture and the JSON of a placing that succeeds.
    fn drawn(&self, scan: &[&str]) -> (image::RgbaImage, serde_json::Value) {
        let output = self.place(scan);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let picture = image::open(self.path("out.png")).unwrap().into_rgba8();
        (picture, serde_json::from_str(&fs::read_to_string(self.path("out.json")).unwrap()).unwrap())
    }
}

fn greens(picture: &image::RgbaImage) -> usize {
    let green = |[r, g, b, _]: [u8; 4]| g > r.saturating_add(15) && g > b.saturating_add(15);
    picture.pixels().filter(|pixel| green(pixel.0)).count()
}

#[test]
fn the_match_is_drawn_on_the_table_of_a_cloud() {
    if !can_draw() {
        return;
    }
    let files = Files::new();
    let room = SyntheticRoom::default();
    let seen = room.picture(&room.cameras()[0]);
    fs::write(files.path("room.pcd"), to_pcd(&seen)).unwrap();
    for view in ["own", "left", "above"] {
        let (drawn, json) =
            files.drawn(&["--cloud", &files.text("room.pcd"), "--frame", "1", "--view", view]);
        assert!(greens(&drawn) > 15_000, "{view}: {} green pixels", greens(&drawn));
        let position: [f64; 3] = serde_json::from_value(json["pitch"]["position"].clone()).unwrap();
        let table = DVec3::from_array(serde_json::from_value(json["table"]["normal"].clone()).unwrap());
        let offset = json["table"]["offset_m"].as_f64().unwrap();
        assert!((table.dot(DVec3::from_array(position)) + offset).abs() < 1e-9, "it stands on the plane");
        let truth = in_camera(&seen, DVec3::ZERO).y - in_camera(&seen, DVec3::Y).y;
        assert!((-table.y - truth).abs() < 0.01, "the table's normal is the room's up");
    }
    let wrong = files.place(&["--cloud", &files.text("room.pcd"), "--view", "behind"]);
    assert_eq!(wrong.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("there is no view `behind`"));
}

#[test]
fn a_sequence_shows_the_same_place_from_every_view() {
    if !can_draw() {
        return;
    }
    let files = Files::new();
    write_sequence(&SyntheticRoom::default(), &files.path("room"));
    let mut places = Vec::new();
    for view in ["own", "1", "2"] {
        let scan = ["--sequence", &files.text("room"), "--intrinsics", "525,525,319.5,239.5"];
        let (drawn, json) = files.drawn(&[&scan[..], &["--view", view]].concat());
        assert!(greens(&drawn) > 15_000, "{view}: {} green pixels", greens(&drawn));
        let position: [f64; 3] = serde_json::from_value(json["pitch"]["position"].clone()).unwrap();
        assert!((position[1] - 0.74).abs() < 0.01, "{view}: not on the table: {position:?}");
        places.push(position);
    }
    assert!(places.iter().all(|place| *place == places[0]), "it moves with the view: {places:?}");
}

#[test]
fn without_a_table_there_is_no_picture() {
    let files = Files::new();
    // A wall alone.
    let room = SyntheticRoom::default();
    let camera =
        room.cameras()[0].looking_at(DVec3::new(0.0, 1.6, 0.2), DVec3::new(0.0, 1.9, -1.6), DVec3::Y);
    fs::write(files.path("wall.pcd"), to_pcd(&room.picture(&camera))).unwrap();
    let output = files.place(&["--cloud", &files.text("wall.pcd")]);
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stdout));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("no table found") && !files.path("out.png").exists(), "{said}");
    for usage in [
        &["place", "--cloud", "x.pcd", "--out", "a.png"][..],
        &["place", "--cloud", "x.pcd", "--stream", "s"],
        &["place", "--sequence", "x"],
    ] {
        assert_eq!(player(usage).status.code(), Some(2), "{usage:?}");
    }
}
