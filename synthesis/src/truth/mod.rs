//! The ground truth of a rendered clip: who stands where, seen how well, in files that ordinary tools open.
//!
//! [`measure`] looks at one frame; [`TruthWriter`] writes `truth.json`, `frames.jsonl`, `mot/`, `maps/` and the true surfaces
//! as a stream. `docs/datasets.md` describes every file.

use glam::{DVec2, DVec3};
use protocol::{camera::Camera, pitch::Pitch};
use serde::Serialize;

use crate::{
    acts::Kind,
    bystanders::Part,
    fixture::{Fixture, Member},
    outfit::Srgb,
    props::BALL_RADIUS_M,
    raster::Grid,
    render::Scene,
    shots::ShotTruth,
    trajectories::Role,
};

mod files;
mod lines;
mod maps;
mod mot;
mod stream;

pub use files::{TruthOptions, TruthWriter};
pub use lines::{MARKING_NAMES, line_map};
pub use maps::{Maps, NOBODY, OFFSET_STEP_M, OFFSET_ZERO, Sheet};
pub use stream::{Reduced, StreamWriter, palette, stream_frame};

use maps::{PersonMaps, Tile};

/// `truth.json`: what holds for the whole clip.
#[derive(Clone, Debug, Serialize)]
pub struct Truth {
    /// Frames per second, as a fraction.
    pub frame_rate: [u32; 2],
    /// Length in frames.
    pub frames: usize,
    /// Size of the pitch.
    pub pitch: Pitch,
    /// Everybody, in order of `id`.
    pub people: Vec<PersonTruth>,
    /// Kinds of markings: the values of the line maps, from 1.
    pub markings: &'static [&'static str],
}

/// Who somebody is.
#[derive(Clone, Debug, Serialize)]
pub struct PersonTruth {
    /// Identity in frames and in the truth stream.
    pub id: u32,
    /// `home`, `away` or absent.
    pub team: Option<&'static str>,
    /// `player`, `goalkeeper`, `referee`, `assistant`.
    pub role: Role,
    /// Shirt number.
    pub number: Option<u8>,
    /// Main colour of the shirt, sRGB.
    pub shirt_rgb: [u8; 3],
}

/// One frame: a line of `frames.jsonl`.
#[derive(Clone, Debug, Serialize)]
pub struct FrameTruth {
    /// Index in the clip.
    pub frame: usize,
    /// Which shot it is from, and what it is mixed with.
    pub shot: ShotTruth,
    /// The camera; of the picture that dominates when two are mixed.
    pub camera: Camera,
    /// The ball.
    pub ball: BallFrame,
    /// Points of the pitch inside the picture, whether somebody stands before them or not.
    pub pitch_points: Vec<PitchPoint>,
    /// Everybody with at least one pixel of box in the picture.
    pub people: Vec<PersonFrame>,
    /// People beside the pitch who take no part, seen or hidden: a detector may find them and is not wrong.
    pub bystanders: Vec<BystanderFrame>,
}

/// Somebody beside the pitch in one frame.
#[derive(Clone, Debug, Serialize)]
pub struct BystanderFrame {
    /// What the person does there.
    pub part: Part,
    /// Amodal box: left, top, right, bottom in pixels.
    pub box_px: [f64; 4],
}

/// The ball in one frame.
#[derive(Clone, Debug, Serialize)]
pub struct BallFrame {
    /// Its middle, world metres.
    pub position_m: [f64; 3],
    /// The middle's projection; absent outside the picture.
    pub px: Option<[f64; 2]>,
    /// Its radius in the picture, pixels.
    pub radius_px: f64,
    /// Share of it that nobody covers.
    pub visible_share: f64,
}

/// A named point of the pitch in the picture.
#[derive(Clone, Debug, Serialize)]
pub struct PitchPoint {
    /// As in `correspondences.json`.
    pub name: String,
    /// Pixel.
    pub px: [f64; 2],
    /// World metres.
    pub world_m: [f64; 3],
}

/// One person in one frame.
#[derive(Clone, Debug, Serialize)]
pub struct PersonFrame {
    /// Who.
    pub id: u32,
    /// Amodal box: left, top, right, bottom in pixels, hidden parts and parts outside the picture included.
    pub box_px: [f64; 4],
    /// Box of the pixels that nothing covers: first and last column and row; absent when there are none.
    pub visible_box_px: Option<[u32; 4]>,
    /// Share of the box inside the picture.
    pub box_inside: f64,
    /// Share of the person's pixels (inside the picture) that nothing covers.
    pub visible_share: f64,
    /// Counts for evaluation: at least half of the box is inside the picture.
    pub in_view: bool,
    /// Ground point under the middle of the hips, world metres.
    pub anchor_m: [f64; 3],
    /// Height of the lowest point of the body above the ground, metres.
    pub above_ground_m: f64,
    /// What the person does.
    pub action: Kind,
    /// Whether the left and the right foot bear on the ground.
    pub contacts: [bool; 2],
    /// BlazePose's 33 landmarks, pixels.
    pub joints_px: Vec<[f64; 2]>,
    /// The same in world metres.
    pub joints_m: Vec<[f64; 3]>,
    /// Where the person's depths lie in the sheets, when maps are written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sheet: Option<Sheet>,
}

fn rounded<const N: usize>(values: [f64; N], digits: i32) -> [f64; N] {
    let scale = 10f64.powi(digits);
    values.map(|value| (value * scale).round() / scale)
}

/// Measures one frame of a fixture; the maps are made only when asked for.
#[must_use]
pub fn measure(
    fixture: &Fixture,
    scene: &Scene<'_>,
    frame: usize,
    with_maps: bool,
) -> (FrameTruth, Option<Maps>) {
    let camera = fixture.cameras[frame];
    let size = [camera.width_px as usize, camera.height_px as usize];
    let hits = scene.first_hits(&camera, Grid::over_pixels([0, 0], size, 1));
    let mut visible = vec![Visible::default(); scene.actors.len()];
    for (place, hit) in hits.iter().enumerate() {
        if let Some((actor, _)) = hit {
            visible[*actor].add((place % size[0]) as u32, (place / size[0]) as u32);
        }
    }
    let mut maps = with_maps.then(|| Maps::new(size, &hits, line_map(&camera, &fixture.stadium)));
    let mut people = Vec::new();
    for (id, actor) in scene.actors.iter().enumerate() {
        let Some([low, high]) = projected_box(&camera, actor.posed.positions.iter().map(|p| p.as_dvec3()))
        else {
            continue;
        };
        let limit = DVec2::new(size[0] as f64 - 0.5, size[1] as f64 - 0.5);
        let inside = (high.min(limit) - low.max(DVec2::splat(-0.5))).max(DVec2::ZERO);
        if inside.x * inside.y <= 0.0 {
            continue;
        }
        let box_inside = inside.x * inside.y / ((high.x - low.x) * (high.y - low.y)).max(1e-9);
        let anchor = fixture.anchor_m(id, frame).as_dvec3();
        // The person alone, in the part of its box that is in the picture.
        let own = PersonMaps::draw(&camera, actor, Tile::inside_picture(low, high, size));
        let seen = visible[id];
        let step = &fixture.members[id].movement.steps[frame];
        let joints = &actor.posed.landmarks;
        let lowest = actor.posed.positions.iter().map(|p| p.y).fold(f32::MAX, f32::min);
        people.push(PersonFrame {
            id: id as u32,
            box_px: rounded([low.x, low.y, high.x, high.y], 2),
            visible_box_px: seen.limits,
            box_inside: rounded([box_inside], 3)[0],
            visible_share: rounded([(seen.pixels as f64 / own.pixels().max(1) as f64).min(1.0)], 3)[0],
            in_view: box_inside >= 0.5,
            anchor_m: rounded(anchor.to_array(), 4),
            above_ground_m: rounded([f64::from(lowest)], 3)[0],
            action: step.kind,
            contacts: step.contacts,
            joints_px: joints
                .iter()
                .map(|j| rounded(camera.project(j.as_dvec3()).unwrap_or(DVec2::splat(-1e4)).to_array(), 1))
                .collect(),
            joints_m: joints.iter().map(|j| rounded(j.as_dvec3().to_array(), 3)).collect(),
            sheet: maps.as_mut().map(|maps| maps.add(&camera, anchor, &own)),
        });
    }
    let ball = ball(&camera, scene, fixture.ball[frame].as_dvec3());
    let pitch_points = lines::points_in_picture(&camera, &fixture.stadium.pitch);
    let shot = fixture.film[frame].truth();
    let bystanders = bystanders(fixture, &camera, size);
    (FrameTruth { frame, shot, camera, ball, pitch_points, people, bystanders }, maps)
}

/// The pixels of one person that nothing covers.
#[derive(Clone, Copy, Default)]
struct Visible {
    pixels: usize,
    limits: Option<[u32; 4]>,
}

impl Visible {
    fn add(&mut self, x: u32, y: u32) {
        let [left, top, right, bottom] = self.limits.unwrap_or([x, y, x, y]);
        self.limits = Some([left.min(x), top.min(y), right.max(x), bottom.max(y)]);
        self.pixels += 1;
    }
}

fn bystanders(fixture: &Fixture, camera: &Camera, size: [usize; 2]) -> Vec<BystanderFrame> {
    let last = DVec2::new(size[0] as f64 - 0.5, size[1] as f64 - 0.5);
    let all = fixture.bystanders.iter().filter_map(|person| {
        let [low, high] = projected_box(camera, person.solid.positions.iter().map(|p| p.as_dvec3()))?;
        let in_picture = high.cmpgt(DVec2::splat(-0.5)).all() && low.cmplt(last).all();
        in_picture
            .then(|| BystanderFrame { part: person.part, box_px: rounded([low.x, low.y, high.x, high.y], 2) })
    });
    all.collect()
}

/// Smallest and largest pixel coordinates of points; `None` when one is behind the camera.
fn projected_box(camera: &Camera, points: impl Iterator<Item = DVec3>) -> Option<[DVec2; 2]> {
    let (mut low, mut high) = (DVec2::MAX, DVec2::MIN);
    for point in points {
        let pixel = camera.project(point)?;
        low = low.min(pixel);
        high = high.max(pixel);
    }
    Some([low, high])
}

fn ball(camera: &Camera, scene: &Scene<'_>, middle: DVec3) -> BallFrame {
    /// Samples along the side of a pixel.
    const FINE: usize = 8;
    let position_m = rounded(middle.to_array(), 3);
    let size = DVec2::new(f64::from(camera.width_px), f64::from(camera.height_px));
    let in_picture = |px: &DVec2| px.cmpge(DVec2::splat(-0.5)).all() && px.cmplt(size - 0.5).all();
    let Some(px) = camera.project(middle).filter(in_picture) else {
        return BallFrame { position_m, px: None, radius_px: 0.0, visible_share: 0.0 };
    };
    let radius_px = camera.focal_px * f64::from(BALL_RADIUS_M) / camera.depth(middle);
    let first = (px - radius_px).floor().as_ivec2().to_array();
    let side = (2.0 * radius_px).ceil() as usize + 2;
    let grid = Grid::over_pixels(first, [side; 2], FINE);
    let (mut all, mut open) = (0usize, 0usize);
    for (place, hit) in scene.first_hits(camera, grid).iter().enumerate() {
        let at = DVec2::from(grid.pixel(place % grid.width, place / grid.width));
        if at.distance(px) < radius_px {
            all += 1;
            open += usize::from(hit.is_none());
        }
    }
    BallFrame {
        position_m,
        px: Some(rounded(px.to_array(), 2)),
        radius_px: rounded([radius_px], 2)[0],
        visible_share: rounded([open as f64 / all.max(1) as f64], 3)[0],
    }
}

/// Who everybody is.
#[must_use]
pub fn people_truth(members: &[Member]) -> Vec<PersonTruth> {
    let entry = |(id, member): (usize, &Member)| PersonTruth {
        id: id as u32,
        team: member.path.team.map(|team| if team == 0 { "home" } else { "away" }),
        role: member.path.role,
        number: member.path.number,
        shirt_rgb: bytes(member.figure.outfit.kit.shirt),
    };
    members.iter().enumerate().map(entry).collect()
}

fn bytes(colour: Srgb) -> [u8; 3] {
    colour.map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}

#[cfg(test)]
mod tests;
