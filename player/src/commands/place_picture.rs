//! The picture of `player place`: the match on the table that was found, seen from the scan's camera or another one.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use glam::{DMat4, DQuat, DVec3};
use player::{
    ar::{RoomCamera, RoomLight, RoomPicture},
    offscreen::Offscreen,
    placement::{
        Surface, TabletopPose,
        fit::{Facing, Wish, fit},
    },
    renderer::OnTable,
    scan::{self, RecordedRoom},
    scene::FrameScene,
};
use serde::Serialize;

use super::{
    place::{ScanArgument, ScanOptions},
    render::find_frame,
};

/// How far the camera is moved around the table for `left`, `right` and `above`, degrees.
const ASIDE_DEGREES: f64 = 22.0;
const ABOVE_DEGREES: f64 = 18.0;

#[derive(clap::Args)]
pub(super) struct PictureArguments {
    /// Colour picture of the same view; a cloud's own colours without it.
    #[arg(long, value_name = "FILE.png|.jpg", requires = "out")]
    image: Option<PathBuf>,
    /// Draw the match of this stream on the table: a folder or an http:// address.
    #[arg(long, value_name = "STREAM|URL", requires = "out")]
    stream: Option<String>,
    /// Index of the frame in the stream.
    #[arg(long, value_name = "N", default_value_t = 0)]
    frame: u32,
    /// Where the picture goes.
    #[arg(long, value_name = "PNG", requires = "stream")]
    out: Option<PathBuf>,
    /// From where: own; left, right or above, with the scan drawn as it looks from there; or a view of the sequence.
    #[arg(long, value_name = "own|left|right|above|NAME", default_value = "own", requires = "out")]
    view: String,
    /// Which way the pitch lies.
    #[arg(long, value_name = "long-side|viewer", default_value = "long-side", value_parser = parse_facing)]
    facing: Facing,
}

fn parse_facing(text: &str) -> Result<Facing, String> {
    match text {
        "long-side" => Ok(Facing::LongerSide),
        "viewer" => Ok(Facing::Viewer),
        _ => Err("long-side or viewer expected".to_owned()),
    }
}

/// A picture that is wanted.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    stream: &'a str,
    frame: u32,
    out: &'a Path,
    view: &'a str,
    facing: Facing,
}

impl PictureArguments {
    /// What is to be drawn, if anything is.
    pub(super) fn asked(&self) -> Option<Asked<'_>> {
        Some(Asked {
            stream: self.stream.as_deref()?,
            frame: self.frame,
            out: self.out.as_deref()?,
            view: &self.view,
            facing: self.facing,
        })
    }
}

/// Where the match was put; metres in the axes of the scan.
#[derive(Serialize)]
pub(super) struct PitchReport {
    position: DVec3,
    along: DVec3,
    up: DVec3,
    scale: f64,
    length_m: f64,
    light: [f32; 3],
    light_towards: DVec3,
    light_measured: bool,
}

/// The view in which the table is looked for, and the one that is drawn.
pub(super) struct Room {
    pub(super) found_in: RecordedRoom,
    other: Option<RoomPicture>,
}

/// Reads the scan with its picture.
pub(super) fn read(
    scan: &ScanArgument,
    options: &ScanOptions,
    picture: &PictureArguments,
) -> anyhow::Result<Room> {
    let metres_per_unit = 1.0 / options.depth_scale;
    let intrinsics = options.intrinsics.as_ref().map(|given| given.read()).transpose()?;
    let (mut found_in, other) = match (&scan.cloud, &scan.depth, &scan.sequence, intrinsics) {
        (Some(cloud), ..) => (RecordedRoom::from_cloud(cloud, picture.image.as_deref())?, None),
        (None, Some(depth), _, Some(intrinsics)) => {
            let image = picture.image.as_deref().context("--depth needs --image, the colours of the view")?;
            let still = DMat4::IDENTITY;
            (RecordedRoom::from_depth(depth, metres_per_unit, image, &intrinsics, &still)?, None)
        }
        (None, None, Some(folder), Some(intrinsics)) => {
            let views = scan::read_sequence(folder)?;
            let read = |view: &scan::SequenceView| {
                RecordedRoom::from_depth(
                    &view.depth,
                    metres_per_unit,
                    &view.image,
                    &intrinsics,
                    &view.room_from_camera,
                )
            };
            let first = views.first().with_context(|| format!("{}: an empty sequence", folder.display()))?;
            let other = views.iter().find(|view| view.name == picture.view).map(read).transpose()?;
            (read(first)?, other.map(|room| room.picture))
        }
        _ => bail!("give --cloud, or --depth or --sequence with --intrinsics"),
    };
    if let Some(up) = options.up {
        found_in.cloud = found_in.cloud.with_up(up);
    }
    Ok(Room { found_in, other })
}

/// Puts the match on `table`, draws it and writes the picture.
pub(super) fn draw(room: &Room, table: &Surface, asked: &Asked<'_>) -> anyhow::Result<PitchReport> {
    let (runtime, stream) = super::open(asked.stream)?;
    let (chunk_name, frame) = find_frame(&runtime, &stream, asked.frame)?;
    let scene = FrameScene::new(&frame, &stream.manifest.people, stream.limits())
        .with_context(|| format!("{chunk_name}, frame {}", asked.frame))?;
    let pitch = stream.manifest.pitch;
    let own = &room.found_in.picture;
    let wish = Wish { facing: asked.facing, viewer_m: Some(own.camera.position_m), ..Wish::of(pitch) };
    let pose = fit(table, &wish).context("the match cannot stand on the table that was found")?;
    let picture = match (&room.other, asked.view) {
        (Some(other), _) => other,
        (None, "own") => own,
        (None, name) => &own.seen_from(beside(own, &pose, name)?),
    };
    let light = RoomLight::estimate(own, table);
    let drawn =
        Offscreen::open()?.picture_in_room(pitch, &scene, picture, &OnTable { pose, light, opacity: 1.0 })?;
    drawn.save(asked.out).with_context(|| {
        format!("{}: cannot be written: give a name that ends in .png", asked.out.display())
    })?;
    Ok(PitchReport {
        position: pose.foot_m(),
        along: pose.orientation * DVec3::X,
        up: pose.up(),
        scale: pose.scale,
        length_m: pose.scale * pitch.length_m,
        light: light.colour.into(),
        light_towards: light.towards,
        light_measured: light.measured,
    })
}

/// The scan's camera, moved around the match.
fn beside(picture: &RoomPicture, pose: &TabletopPose, view: &str) -> anyhow::Result<RoomCamera> {
    let camera = picture.camera;
    let right = camera.rotation.row(0);
    let turn = match view {
        // To the viewer's left, the camera goes clockwise seen from above.
        "left" => DQuat::from_axis_angle(pose.up(), -ASIDE_DEGREES.to_radians()),
        "right" => DQuat::from_axis_angle(pose.up(), ASIDE_DEGREES.to_radians()),
        "above" => {
            let level = right.reject_from_normalized(pose.up()).normalize_or(right);
            DQuat::from_axis_angle(level, -ABOVE_DEGREES.to_radians())
        }
        other => bail!("there is no view `{other}`: own, left, right, above, or a name in the sequence"),
    };
    let middle = pose.position_m;
    Ok(camera.looking_at(middle + turn * (camera.position_m - middle), middle, pose.up()))
}
