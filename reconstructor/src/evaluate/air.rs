//! What is in the air, measured on a rendered clip: joins the stream with the truth for [`ball`](super::ball) and
//! [`jumps`](super::jumps).

use std::collections::BTreeMap;

use glam::DVec3;
use protocol::{
    camera::Camera,
    chunk::{Body, ChunkFrame},
};
use serde::{Deserialize, Serialize};

use super::{
    ball::{self, BallFigures, TrueBall, VISIBLE_SHARE},
    frame_truth::ShotLine,
    jumps::{self, Height, JumpFigures},
    matches,
};

/// The share of points that may lie lower than the sole: what the mesh stage takes for stray pixels of grass.
const STRAY_SHARE: f64 = 0.003;

/// What of a line of `frames.jsonl` ball and jumps are measured on.
#[derive(Clone, Debug, Deserialize)]
pub struct FrameLine {
    frame: u32,
    shot: ShotLine,
    camera: Camera,
    ball: BallLine,
    people: Vec<PersonLine>,
}

#[derive(Clone, Debug, Deserialize)]
struct BallLine {
    position_m: DVec3,
    /// Its middle in the picture; absent outside.
    #[serde(default)]
    px: Option<[f64; 2]>,
    visible_share: f64,
}

#[derive(Clone, Debug, Deserialize)]
struct PersonLine {
    id: u32,
    in_view: bool,
    above_ground_m: f64,
    action: String,
    contacts: [bool; 2],
}

/// Figures of the ball and of jumps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AirFigures {
    /// The ball.
    #[serde(flatten)]
    pub ball: BallFigures,
    /// People.
    #[serde(flatten)]
    pub jumps: JumpFigures,
}

/// Compares a stream with the truth: `lines` of the clip, and the true stream, whose bodies tell who is whom.
#[must_use]
pub fn compare(lines: &[FrameLine], truth: &[ChunkFrame], ours: &[ChunkFrame]) -> AirFigures {
    let ours: BTreeMap<u32, &ChunkFrame> = ours.iter().map(|frame| (frame.clip_frame, frame)).collect();
    let true_balls = lines.iter().map(|line| (line.frame, true_ball(line))).collect();
    let our_balls = ours.iter().filter_map(|(&frame, content)| Some((frame, content.ball?))).collect();
    let truth: BTreeMap<u32, &ChunkFrame> = truth.iter().map(|frame| (frame.clip_frame, frame)).collect();
    let mut heights = Vec::new();
    for line in lines {
        // As the other measures of people: in view, and no dissolve.
        if line.shot.is_mixed() {
            continue;
        }
        let mut lowest = BTreeMap::new();
        if let (Some(true_frame), Some(our_frame)) = (truth.get(&line.frame), ours.get(&line.frame)) {
            for (true_index, our_index) in matches::pairs(&true_frame.bodies, &our_frame.bodies) {
                if let Some(height_m) = lowest_m(&our_frame.bodies[our_index]) {
                    lowest.insert(true_frame.bodies[true_index].person.0, height_m);
                }
            }
        }
        heights.extend(line.people.iter().filter(|person| person.in_view).map(|person| Height {
            frame: line.frame,
            person: person.id,
            true_m: person.above_ground_m,
            stands: person.contacts.contains(&true),
            goes_down: matches!(person.action.as_str(), "tackle" | "dive" | "fall"),
            ours_m: lowest.get(&person.id).copied(),
        }));
    }
    AirFigures { ball: ball::compare(&true_balls, &our_balls), jumps: jumps::compare(&heights) }
}

fn true_ball(line: &FrameLine) -> TrueBall {
    TrueBall {
        position_m: line.ball.position_m,
        camera_m: line.camera.position,
        seen: line.ball.px.is_some() && line.ball.visible_share >= VISIBLE_SHARE && !line.shot.is_mixed(),
    }
}

/// Height of the lowest point of a body, metres.
fn lowest_m(body: &Body) -> Option<f64> {
    let mut heights: Vec<f32> = body.mesh.positions_m.iter().map(|position| position[1]).collect();
    heights.sort_by(f32::total_cmp);
    let lowest = heights.get((heights.len() as f64 * STRAY_SHARE) as usize)?;
    Some(f64::from(body.anchor_m.y + lowest))
}
