//! Which candidate is the ball, frame by frame: the chain of candidates with the best scores and the smoothest way.
//!
//! Places are compared as directions from the tripod, so pan, tilt and zoom drop out. A chain's cost looks at three sights
//! at a time (how far the third lies from where the first two lead), which dynamic programming minimises exactly over all
//! chains with gaps of up to [`GAP_FRAMES`]. A chain may also end, and another begin later.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use protocol::{camera::Camera, pitch::Pitch};

use super::{RADIUS_M, bodies, sight, sight::Moment};
use crate::{detection::BallCandidate, pose::Person};

/// Frames without a sight inside a chain.
const GAP_FRAMES: usize = 12;
/// Candidates looked at in a frame, best first.
const CANDIDATES_MAX: usize = 8;
/// Ways to a candidate that are kept.
const LINKS_MAX: usize = 24;
/// What a candidate of even score is worth, and how much its score counts.
const REWARD: f64 = 1.8;
const SCORE_WEIGHT: f64 = 0.6;
/// A frame without a sight, the start of a chain and its end.
const MISS_COST: f64 = 0.3;
const START_COST: f64 = 5.0;
const END_COST: f64 = 2.0;
/// Error of a candidate's middle, pixels, and the acceleration that is no surprise, m/s².
const PIXEL_SIGMA: f64 = 1.5;
const ACCELERATION: f64 = 14.0;
/// A change of way costs this much at most: beside a body, and in the open (a bounce, or somebody not found).
const TOUCH_COST: f64 = 3.5;
const OPEN_COST: f64 = 6.5;
/// A ball within this of a joint may have been played, metres.
const TOUCH_M: f64 = 0.7;
/// No ball is faster, m/s, at up to this many times the scale of the grass under it.
const SPEED_MAX: f64 = 36.0;
const NEARER: f64 = 1.4;
/// Logarithm of the ratio of a candidate's size to the ball's that is no surprise.
const SIZE_SIGMA: f64 = 0.45;
/// Candidates in one direction within this many pixels, in more than this share of the shot's frames and at least so many
/// frames besides those within [`REST_FRAMES`], are something that stands there.
const STANDING_PX: f64 = 3.0;
const STANDING_SHARE: f64 = 0.05;
const STANDING_FRAMES: usize = 8;
const REST_FRAMES: usize = 30;
const STANDING_COST: f64 = 2.0;
/// What a painted spot or corner costs, and how near it must be, metres on the grass.
const PAINT_COST: f64 = 2.0;
const PAINT_M: f64 = 0.8;
/// What costs a candidate beyond the pitch by more than the margin, metres.
const OUTSIDE_COST: f64 = 1.0;
const OUTSIDE_M: f64 = 6.0;

/// A candidate as the chains see it.
#[derive(Clone, Copy, Debug)]
struct Node {
    pixel: DVec2,
    direction: DVec3,
    reward: f64,
    /// Pixels per metre and the camera's focal length.
    scale_px: f64,
    focal_px: f64,
    turn_cost: f64,
}

/// One way to a candidate.
#[derive(Clone, Copy, Debug)]
struct Link {
    /// Total so far.
    cost: f64,
    /// Frame, candidate and link before; `None` at the start of a chain.
    before: Option<[usize; 3]>,
    /// Where the chain before this one ended, for a start.
    chain_before: Option<[usize; 3]>,
}

/// The ball's pixel in every frame, `None` where no candidate is the ball. All slices have a frame each.
pub(super) fn choose(
    moments: &[Moment],
    candidates: &[Vec<BallCandidate>],
    people: &[Vec<Person>],
    pitch: &Pitch,
) -> Vec<Option<DVec2>> {
    let nodes = nodes(moments, candidates, people, pitch);
    let mut links: Vec<Vec<Vec<Link>>> = Vec::with_capacity(nodes.len());
    // The best end of a chain in any frame so far, with the cost of ending there.
    let mut ended: (f64, Option<[usize; 3]>) = (0.0, None);
    for (frame, of_frame) in nodes.iter().enumerate() {
        let mut frame_links = Vec::with_capacity(of_frame.len());
        for node in of_frame {
            let start =
                Link { cost: ended.0 + START_COST - node.reward, before: None, chain_before: ended.1 };
            let mut found = vec![start];
            for earlier in frame.saturating_sub(GAP_FRAMES + 1)..frame {
                let missed = (frame - earlier - 1) as f64 * MISS_COST;
                for (index, from) in nodes[earlier].iter().enumerate() {
                    let seconds = moments[frame].seconds - moments[earlier].seconds;
                    if !within_reach(from, node, seconds) {
                        continue;
                    }
                    let best = links[earlier][index].iter().enumerate().map(|(number, link): (_, &Link)| {
                        let turn = match link.before {
                            Some([first, index, _]) => {
                                let before = moments[earlier].seconds - moments[first].seconds;
                                turn_cost([&nodes[first][index], from, node], [before, seconds])
                            }
                            // Two sights make no turn, but chance finds pairs more easily the farther apart.
                            None => 0.5,
                        };
                        (link.cost + turn, number)
                    });
                    let Some((cost, number)) = best.min_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
                    let cost = cost + missed - node.reward;
                    found.push(Link { cost, before: Some([earlier, index, number]), chain_before: None });
                }
            }
            found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            found.truncate(LINKS_MAX);
            frame_links.push(found);
        }
        for (index, found) in frame_links.iter().enumerate() {
            for (number, link) in found.iter().enumerate() {
                if link.cost + END_COST < ended.0 {
                    ended = (link.cost + END_COST, Some([frame, index, number]));
                }
            }
        }
        links.push(frame_links);
    }
    let mut chosen = vec![None; nodes.len()];
    let mut place = ended.1;
    while let Some([frame, index, number]) = place {
        chosen[frame] = Some(nodes[frame][index].pixel);
        let link = links[frame][index][number];
        place = link.before.or(link.chain_before);
    }
    chosen
}

/// Whether a ball can get from one to the other.
fn within_reach(from: &Node, to: &Node, seconds: f64) -> bool {
    let way_px = from.direction.distance(to.direction) * to.focal_px;
    way_px < SPEED_MAX * NEARER * seconds * from.scale_px.max(to.scale_px) + 8.0
}

/// What the change of way at the middle one of three sights costs; `seconds` lie between them.
fn turn_cost(nodes: [&Node; 3], seconds: [f64; 2]) -> f64 {
    let [first, middle, last] = nodes;
    let ratio = seconds[1] / seconds[0].max(1e-3);
    let led = middle.direction + (middle.direction - first.direction) * ratio;
    let off_px = led.distance(last.direction) * last.focal_px;
    let noise = PIXEL_SIGMA * PIXEL_SIGMA * (1.0 + (1.0 + ratio).powi(2) + ratio * ratio);
    let free_px = ACCELERATION * last.scale_px * seconds[1] * (seconds[0] + seconds[1]) / 2.0;
    let squares = off_px * off_px / (noise + free_px * free_px);
    // The longer the way to a turned sight, the more chance candidates lie there.
    let chance = (1.0 + off_px / (10.0 * PIXEL_SIGMA)).ln();
    (squares / 2.0).min(middle.turn_cost.min(last.turn_cost) + chance)
}

fn nodes(
    moments: &[Moment],
    candidates: &[Vec<BallCandidate>],
    people: &[Vec<Person>],
    pitch: &Pitch,
) -> Vec<Vec<Node>> {
    let spots = painted_spots(pitch);
    let mut nodes: Vec<Vec<Node>> = moments
        .iter()
        .enumerate()
        .map(|(frame, moment)| {
            let Some(camera) = moment.camera else { return Vec::new() };
            let mut best: Vec<&BallCandidate> = candidates
                .get(frame)
                .map_or(&[][..], Vec::as_slice)
                .iter()
                .filter(|candidate| candidate.centre_px.is_finite() && candidate.diameter_px.is_finite())
                .collect();
            best.sort_by(|a, b| b.score.total_cmp(&a.score));
            best.truncate(CANDIDATES_MAX);
            let people = people.get(frame).map_or(&[][..], Vec::as_slice);
            best.into_iter().map(|candidate| node(&camera, candidate, people, pitch, &spots)).collect()
        })
        .collect();
    charge_standing(&mut nodes);
    // What is rather not the ball is no stepping stone between two sights of it either.
    nodes.iter_mut().for_each(|of_frame| of_frame.retain(|node| node.reward > 0.0));
    nodes
}

fn node(
    camera: &Camera,
    candidate: &BallCandidate,
    people: &[Person],
    pitch: &Pitch,
    spots: &[DVec2],
) -> Node {
    let pixel = candidate.centre_px;
    let scale_px = sight::scale_px(camera, pixel);
    let score = f64::from(candidate.score).clamp(0.02, 0.98);
    let reward =
        REWARD + SCORE_WEIGHT * (score / (1.0 - score)).ln() - misfit(camera, candidate, pitch, spots);
    let near = bodies::near(camera, people, pixel, TOUCH_M);
    let turn_cost = if near.is_empty() { OPEN_COST } else { TOUCH_COST };
    Node {
        pixel,
        direction: camera.ray(pixel).direction,
        reward,
        scale_px,
        focal_px: camera.focal_px,
        turn_cost,
    }
}

/// What speaks against a candidate in its picture alone, as a loss of logarithmic odds: size and place.
fn misfit(camera: &Camera, candidate: &BallCandidate, pitch: &Pitch, spots: &[DVec2]) -> f64 {
    let pixel = candidate.centre_px;
    // A ball in the air is nearer than the grass it is seen against, so it may be larger, not much smaller.
    let ball_px = (2.0 * RADIUS_M * sight::scale_px(camera, pixel)).max(1.0);
    let size = (candidate.diameter_px.max(0.5) / ball_px).ln();
    let surprise = if size > 0.0 { (size - 0.15).max(0.0) } else { size };
    let mut cost = (surprise / SIZE_SIGMA).powi(2).min(9.0) / 2.0;
    let place = sight::on_grass(camera, pixel).map(|point| DVec2::new(point.x, point.z));
    if !place.is_some_and(|place| pitch.contains(place, OUTSIDE_M)) {
        cost += OUTSIDE_COST;
    }
    if place.is_some_and(|place| spots.iter().any(|spot| spot.distance(place) < PAINT_M)) {
        cost += PAINT_COST;
    }
    cost
}

/// How likely a candidate is the ball, 0..1, by its score, size and place in one picture.
pub(super) fn likely(camera: &Camera, candidate: &BallCandidate, pitch: &Pitch) -> f64 {
    let score = f64::from(candidate.score).clamp(0.0, 1.0);
    let against = misfit(camera, candidate, pitch, &painted_spots(pitch)).exp();
    score / (score + (1.0 - score) * against)
}

/// Penalty marks, the centre mark and corners of painted lines: small, white and always there.
fn painted_spots(pitch: &Pitch) -> Vec<DVec2> {
    use protocol::pitch::{
        GOAL_AREA_DEPTH_M, GOAL_AREA_WIDTH_M, PENALTY_AREA_DEPTH_M, PENALTY_AREA_WIDTH_M, PENALTY_MARK_M,
    };
    let (x, z) = (pitch.length_m / 2.0, pitch.width_m / 2.0);
    let mut spots = vec![DVec2::ZERO];
    for end in [-1.0, 1.0] {
        spots.push(DVec2::new(end * (x - PENALTY_MARK_M), 0.0));
        for side in [-1.0, 1.0] {
            spots.push(DVec2::new(end * x, side * z));
            spots.push(DVec2::new(end * (x - PENALTY_AREA_DEPTH_M), side * PENALTY_AREA_WIDTH_M / 2.0));
            spots.push(DVec2::new(end * (x - GOAL_AREA_DEPTH_M), side * GOAL_AREA_WIDTH_M / 2.0));
        }
    }
    spots
}

/// Takes from the worth of candidates that stand in one direction for much of the shot.
fn charge_standing(nodes: &mut [Vec<Node>]) {
    let mut focal: Vec<f64> = nodes.iter().flatten().map(|node| node.focal_px).collect();
    focal.sort_by(f64::total_cmp);
    let Some(&focal_px) = focal.get(focal.len() / 2) else { return };
    // Directions as whole steps of an even grid; neighbours within one step are looked at together.
    let cell = |node: &Node| (node.direction * (focal_px / STANDING_PX)).round().as_i64vec3().to_array();
    let mut seen: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (frame, of_frame) in nodes.iter().enumerate() {
        for node in of_frame {
            let frames = seen.entry(cell(node)).or_default();
            if frames.last() != Some(&frame) {
                frames.push(frame);
            }
        }
    }
    let least = STANDING_FRAMES.max((nodes.len() as f64 * STANDING_SHARE) as usize);
    for (frame, of_frame) in nodes.iter_mut().enumerate() {
        for node in of_frame {
            let [x, y, z] = cell(node);
            let mut others = 0;
            for (dx, dy, dz) in
                (-1..=1).flat_map(|a| (-1..=1).flat_map(move |b| (-1..=1).map(move |c| (a, b, c))))
            {
                let frames = seen.get(&[x + dx, y + dy, z + dz]).map_or(&[][..], Vec::as_slice);
                let before = frames.partition_point(|&f| f + REST_FRAMES < frame);
                let after = frames.len() - frames.partition_point(|&f| f <= frame + REST_FRAMES);
                others += before + after;
            }
            if others >= least {
                node.reward -= STANDING_COST;
            }
        }
    }
}
