//! Section 4.2, second half: the pose and the instance mask of everybody who can stand on the pitch.
//!
//! Boxes that cannot hold a person on the pitch, and people beside it who are not in the match, go first. The pose network
//! then looks at each of the others; what it is unsure of stays when the detection is clear, as a standing figure in its box
//! (`pose_score` 0), and goes when it is not. Skeletons that coincide are one person; whoever is left without one in a tangle is looked at once more,
//! without those who were found there ([`erase`]).

mod blazepose;
mod erase;
mod ground;
mod looks;
mod refine;
mod silhouette;
mod standing;

use glam::{DVec2, DVec3};
use image::RgbImage;
use protocol::{camera::Camera, pitch::Pitch};
use serde::{Deserialize, Serialize};

pub(crate) use ground::{lift as lift_upright, stand, upright_normal};
pub use looks::{Lab, Looks};
pub(crate) use silhouette::{bones, cut, squared_distance_px};

use crate::{
    detection::{Detection, RoleChances},
    geometry::{Mask, PixelBox},
    inference::{InferenceError, Model},
};

/// File name of the pose network in `assets/models`.
pub const MODEL: &str = "blazepose_full.onnx";
pub use refine::MODEL as JOINTS_MODEL;

/// Joints of the pose network, in its order: BlazePose's 33 landmarks.
pub const JOINTS: usize = 33;

/// Places of joints among the [`JOINTS`]; left is the person's own left.
pub mod index {
    /// Tip of the nose.
    pub const NOSE: usize = 0;
    /// Left shoulder.
    pub const LEFT_SHOULDER: usize = 11;
    /// Right shoulder.
    pub const RIGHT_SHOULDER: usize = 12;
    /// Left elbow.
    pub const LEFT_ELBOW: usize = 13;
    /// Right elbow.
    pub const RIGHT_ELBOW: usize = 14;
    /// Left wrist.
    pub const LEFT_WRIST: usize = 15;
    /// Right wrist.
    pub const RIGHT_WRIST: usize = 16;
    /// Left hip.
    pub const LEFT_HIP: usize = 23;
    /// Right hip.
    pub const RIGHT_HIP: usize = 24;
    /// Left knee.
    pub const LEFT_KNEE: usize = 25;
    /// Right knee.
    pub const RIGHT_KNEE: usize = 26;
    /// Left ankle.
    pub const LEFT_ANKLE: usize = 27;
    /// Right ankle.
    pub const RIGHT_ANKLE: usize = 28;
    /// Left heel.
    pub const LEFT_HEEL: usize = 29;
    /// Right heel.
    pub const RIGHT_HEEL: usize = 30;
    /// Tip of the left foot.
    pub const LEFT_TOE: usize = 31;
    /// Tip of the right foot.
    pub const RIGHT_TOE: usize = 32;
}

/// Boxes that the pose network looks at in one picture, best first: more than stand on a pitch with substitutes
/// warming up, and a bound on the time that one picture of noise can take.
const CANDIDATES_MAX: usize = 60;
/// From this score on a detection is somebody, whatever the pose network says.
const CLEAR: f32 = 0.5;
/// Below this the network saw no whole person.
pub(crate) const POSE_SCORE_MIN: f32 = 0.3;
/// A mask below this share of the body's box is none.
const MASK_SHARE_MIN: f64 = 0.08;
/// Below this score, or with the hips more than this part of the square from its middle, a second look is taken from
/// there.
const SURE: f32 = 0.5;
const OFF_CENTRE: f64 = 0.12;
/// The square of a second look at somebody in a tangle, relative to the first.
const NARROW: f64 = 0.8;
/// Share of a box inside another person's above which it may be a part of that person.
const COVERED: f64 = 0.5;
/// Sides of further squares, relative to the first, for a clear detection that the network still refuses: on hard poses its
/// verdict changes with small changes of the square.
const OTHER_LOOKS: [f64; 3] = [1.25, 0.85, 1.6];
/// The pose's box replaces the detector's when they agree this much; otherwise a limb or the neighbour was mistaken.
const BOXES_AGREE_IOU: f64 = 0.7;
/// Masks that share this part of the smaller one are of the same person if one of them is much shorter (half a body
/// found again) or the necks are one above the other. Two people in a tangle are about the same height, side by side.
const SAME_MASK: f64 = 0.7;
const HALF_BODY: f64 = 0.7;
/// Skeletons nearer than this, on average over the trunk and legs, are the same person, metres.
const SAME_SKELETON_M: f64 = 0.25;

/// One joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// Where, pixels of the clip.
    pub pixel: DVec2,
    /// Along the line of sight relative to the middle of the hips, metres, positive away from the camera.
    pub depth_m: f32,
    /// Probability that it is in the picture and not hidden, 0..1.
    pub visibility: f32,
}

/// Somebody on the pitch in one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Person {
    /// The box, refined by the pose, pixels of the clip.
    pub bounds: PixelBox,
    /// Detector's confidence 0..1.
    pub score: f32,
    /// What the person looks to be in this frame.
    pub roles: RoleChances,
    /// Pose network's confidence that it saw a whole person, 0..1; 0 when joints and mask are those of a standing figure in
    /// the detector's box.
    pub pose_score: f32,
    /// The joints, [`JOINTS`] of them.
    pub joints: Vec<Joint>,
    /// Instance mask of the pose network.
    pub mask: Mask,
    /// Middle between the shoulders: the paper's neck keypoint, pixels of the clip.
    pub neck_px: DVec2,
    /// The point of the pitch the person stands on, world metres.
    pub ground_m: DVec3,
    /// Neck lifted on the upright plane through `ground_m`, world metres.
    pub neck_m: DVec3,
    /// Colours and build.
    pub looks: Looks,
}

impl Person {
    /// Somebody of whom nothing is known, to be filled in.
    pub(crate) fn blank() -> Self {
        Self {
            bounds: PixelBox { min: DVec2::ZERO, max: DVec2::ONE },
            score: 0.9,
            roles: RoleChances::UNKNOWN,
            pose_score: 0.9,
            joints: Vec::new(),
            mask: Mask::default(),
            neck_px: DVec2::ZERO,
            ground_m: DVec3::ZERO,
            neck_m: DVec3::ZERO,
            looks: Looks::default(),
        }
    }
}

/// Somebody whose box overlaps by more with that of a found person may have been read as that one.
const TANGLED_IOU: f64 = 0.15;
/// Where others were erased, a pose is believed from this score on: what is left of them can look like a body.
const SURE_ALONE: f32 = 0.6;

/// Joints and mask in one box of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// The joints, [`JOINTS`] of them.
    pub joints: Vec<Joint>,
    /// Instance mask, without islands.
    pub mask: Mask,
    /// Confidence that it is a whole person, 0..1.
    pub score: f32,
}

/// Why poses could not be estimated.
#[derive(Debug, thiserror::Error)]
pub enum PoseError {
    /// The network could not be loaded or run.
    #[error("pose network: {0}")]
    Inference(#[from] InferenceError),
}

/// The pose network and the one that refines its joints; one per thread.
#[derive(Debug)]
pub struct PoseEstimator {
    model: Model,
    refiner: Model,
}

impl PoseEstimator {
    /// Loads the networks.
    ///
    /// # Errors
    /// When ONNX Runtime or a model is missing or unusable.
    pub fn load() -> Result<Self, PoseError> {
        Ok(Self { model: Model::load_shipped(MODEL)?, refiner: Model::load_shipped(refine::MODEL)? })
    }

    /// What the network sees in one box, wherever it stands and however sure: for measuring the stages that build on poses.
    ///
    /// `None` when the box or the picture is empty.
    ///
    /// # Errors
    /// When the network fails.
    pub fn look(&mut self, picture: &RgbImage, bounds: &PixelBox) -> Result<Option<Look>, PoseError> {
        let Some(square) = blazepose::Square::round(bounds).filter(|_| !picture.is_empty()) else {
            return Ok(None);
        };
        let seen = blazepose::estimate(&mut self.model, picture, square)?;
        let mask = silhouette::clean(&seen.mask, &seen.joints);
        Ok(Some(Look { joints: seen.joints, mask, score: seen.score }))
    }

    /// Whoever the networks see in one box, read as the product reads people, wherever they stand (the place on the pitch is left blank):
    /// for measuring the stages that build on poses. `None` when nobody is.
    ///
    /// # Errors
    /// When a network fails.
    pub fn person_in(&mut self, picture: &RgbImage, bounds: &PixelBox) -> Result<Option<Person>, PoseError> {
        let Some(square) = blazepose::Square::round(bounds).filter(|_| !picture.is_empty()) else {
            return Ok(None);
        };
        let mut seen = self.look_again(picture, square, bounds, true)?;
        refine::refine(&mut self.refiner, &mut seen.joints)?;
        let mask = silhouette::clean(&seen.mask, &seen.joints);
        let Some(bounds) = silhouette::bounds(&mask, &seen.joints) else { return Ok(None) };
        Ok((seen.score >= POSE_SCORE_MIN).then(|| Person {
            bounds,
            pose_score: seen.score,
            joints: seen.joints,
            mask,
            ..Person::blank()
        }))
    }

    /// Everybody of `detections` who can stand on the pitch, from left to right of the picture.
    ///
    /// # Errors
    /// When the network fails.
    pub fn people(
        &mut self,
        picture: &RgbImage,
        detections: &[Detection],
        camera: &Camera,
        pitch: &Pitch,
    ) -> Result<Vec<Person>, PoseError> {
        let mut candidates: Vec<&Detection> =
            detections.iter().filter(|found| ground::may_play(camera, pitch, found)).collect();
        candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut people: Vec<Person> = Vec::new();
        for detection in candidates.into_iter().take(CANDIDATES_MAX) {
            let square = blazepose::Square::round(&detection.bounds).filter(|_| !picture.is_empty());
            let Some(square) = square else { continue };
            // Part of a body found again, or somebody mostly behind another: only a pose of its own makes it a person.
            let covered = people.iter().any(|other| covers(&other.bounds, &detection.bounds));
            let clear = detection.score >= CLEAR && !covered;
            let mut seen = self.look_again(picture, square, &detection.bounds, clear)?;
            refine::refine(&mut self.refiner, &mut seen.joints)?;
            let fresh = |person: &Person| !people.iter().any(|other| same_person(other, person, camera));
            let mut posed = person_from(&seen, detection, camera, pitch).filter(fresh);
            if posed.is_none() && detection.score >= CLEAR {
                posed = self.alone(picture, square, detection, &people, camera, pitch)?.filter(fresh);
            }
            let unposed = || clear.then(|| standing::in_box(&seen, detection, camera, pitch)).flatten();
            match posed.or_else(unposed) {
                Some(person) => people.push(person),
                None => tracing::trace!(
                    x = square.centre.x,
                    y = square.centre.y,
                    score = detection.score,
                    "nobody on the pitch"
                ),
            }
        }
        people.sort_by(|a, b| a.neck_px.x.total_cmp(&b.neck_px.x));
        // Only now is it known who covers whom.
        let nose_m = |person: &Person| {
            Some(ground::lift(camera, person.joints.get(index::NOSE)?.pixel, person.ground_m)?.y)
        };
        let all: Vec<Looks> = people
            .iter()
            .enumerate()
            .map(|(place, person)| looks::of(picture, &people, place, nose_m(person)))
            .collect();
        people.iter_mut().zip(all).for_each(|(person, looks)| person.looks = looks);
        Ok(people)
    }

    /// Somebody in a tangle with `people`, read where these are painted over; `None` when nobody is in the way or nobody is sure to be left.
    fn alone(
        &mut self,
        picture: &RgbImage,
        square: blazepose::Square,
        detection: &Detection,
        people: &[Person],
        camera: &Camera,
        pitch: &Pitch,
    ) -> Result<Option<Person>, PoseError> {
        let in_the_way = || people.iter().filter(|other| other.bounds.iou(&detection.bounds) > TANGLED_IOU);
        if in_the_way().next().is_none() {
            return Ok(None);
        }
        let without = erase::without(picture, in_the_way().map(|other| &other.mask), square);
        let mut seen = blazepose::estimate(&mut self.model, &without, square)?;
        if seen.score < SURE_ALONE {
            return Ok(None);
        }
        refine::refine(&mut self.refiner, &mut seen.joints)?;
        Ok(person_from(&seen, detection, camera, pitch))
    }

    /// The best of several looks: most people need one, some a second from their hips or closer up, and who is clearly there
    /// and yet refused a few more.
    fn look_again(
        &mut self,
        picture: &RgbImage,
        square: blazepose::Square,
        bounds: &PixelBox,
        clear: bool,
    ) -> Result<blazepose::Estimate, PoseError> {
        let first = blazepose::estimate(&mut self.model, picture, square)?;
        let again = match first.hips_px() {
            Some(hips) if first.is_of(bounds) => {
                let shift = hips.distance(square.centre) / square.side;
                if shift <= OFF_CENTRE && first.score >= SURE {
                    return Ok(first);
                }
                blazepose::Square { centre: hips, ..square }
            }
            // A wide square in a tangle shows the neighbour as well, and the network may prefer that one.
            _ => blazepose::Square { side: square.side * NARROW, ..square },
        };
        let second = blazepose::estimate(&mut self.model, picture, again)?;
        // What is in the middle is read better than the score says.
        let better = second.is_of(bounds) && (!first.is_of(bounds) || second.score > first.score - 0.1);
        let mut best = if better { second } else { first };
        for scale in OTHER_LOOKS {
            if !clear || (best.is_of(bounds) && best.score >= POSE_SCORE_MIN) {
                break;
            }
            let other = blazepose::Square { side: square.side * scale, ..square };
            let other = blazepose::estimate(&mut self.model, picture, other)?;
            if other.is_of(bounds) && (!best.is_of(bounds) || other.score > best.score) {
                best = other;
            }
        }
        Ok(best)
    }
}

/// A person from what the network saw, if it can be one.
fn person_from(
    seen: &blazepose::Estimate,
    detection: &Detection,
    camera: &Camera,
    pitch: &Pitch,
) -> Option<Person> {
    if seen.score < POSE_SCORE_MIN || !seen.is_of(&detection.bounds) {
        return None;
    }
    let ground_m = ground::stand(camera, pitch, &seen.joints)?;
    let neck_px = ground::middle(&seen.joints, index::LEFT_SHOULDER, index::RIGHT_SHOULDER)?;
    let neck_m = ground::lift(camera, neck_px, ground_m)?;
    let mask = silhouette::clean(&seen.mask, &seen.joints);
    let posed = silhouette::bounds(&mask, &seen.joints)?;
    let bounds = if posed.iou(&detection.bounds) >= BOXES_AGREE_IOU { posed } else { detection.bounds };
    let size = bounds.size();
    if (mask.area_px() as f64) < MASK_SHARE_MIN * size.x * size.y {
        return None;
    }
    Some(Person {
        bounds,
        score: detection.score,
        roles: detection.roles,
        pose_score: seen.score,
        joints: seen.joints.clone(),
        mask,
        neck_px,
        ground_m,
        neck_m,
        looks: Looks::default(),
    })
}

/// Whether `larger` covers most of `bounds`.
fn covers(larger: &PixelBox, bounds: &PixelBox) -> bool {
    let area = |b: &PixelBox| b.size().x * b.size().y;
    let shared = PixelBox { min: larger.min.max(bounds.min), max: larger.max.min(bounds.max) };
    area(&shared) > COVERED * area(bounds)
}

/// Whether two skeletons, or two masks, are those of one person.
fn same_person(a: &Person, b: &Person, camera: &Camera) -> bool {
    let compared = [
        index::LEFT_SHOULDER,
        index::RIGHT_SHOULDER,
        index::LEFT_HIP,
        index::RIGHT_HIP,
        index::LEFT_KNEE,
        index::RIGHT_KNEE,
    ];
    let middle =
        |p: &Person| compared.iter().filter_map(|&j| p.joints.get(j)).map(|j| j.pixel).sum::<DVec2>();
    let count = compared.len() as f64;
    let mut apart_px = 0.0;
    for joint in compared {
        let (Some(p), Some(q)) = (a.joints.get(joint), b.joints.get(joint)) else { return false };
        apart_px += p.pixel.distance(q.pixel) / count;
    }
    // The network sometimes swaps left and right between two looks at one person: then only the middles coincide.
    let middles_px = (middle(a) - middle(b)).length() / count;
    let near_px = SAME_SKELETON_M * camera.pixels_per_metre(a.ground_m);
    let (height_a, height_b) = (a.bounds.size().y, b.bounds.size().y);
    let half = height_a.min(height_b) < HALF_BODY * height_a.max(height_b);
    let in_line = (a.neck_px.x - b.neck_px.x).abs() < near_px;
    apart_px < near_px
        || middles_px < 0.5 * near_px
        || ((half || in_line) && mask_overlap(&a.mask, &b.mask) > SAME_MASK)
}

/// Pixels inside both masks as a share of the smaller mask, 0..1.
fn mask_overlap(a: &Mask, b: &Mask) -> f64 {
    let (area_a, area_b) = (a.area_px(), b.area_px());
    let width = a.width.max(1) as usize;
    let shared = a
        .coverage
        .iter()
        .enumerate()
        .filter(|(i, c)| {
            let (x, y) = (a.x0 + (i % width) as i32, a.y0 + (i / width) as i32);
            **c >= silhouette::INSIDE && b.at(x, y) >= silhouette::INSIDE
        })
        .count();
    let smaller = area_a.min(area_b);
    if smaller == 0 { 0.0 } else { shared as f64 / smaller as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn person(x: f64, lean_px: f64) -> Person {
        let joints: Vec<Joint> = (0..JOINTS)
            .map(|i| Joint { pixel: DVec2::new(x + lean_px, i as f64 * 2.0), depth_m: 0.0, visibility: 1.0 })
            .collect();
        let mask = Mask { x0: x as i32 - 8, y0: 0, width: 16, height: 60, coverage: vec![255; 16 * 60] };
        let zero = DVec3::ZERO;
        let bounds = PixelBox { min: DVec2::new(x - 8.0, 0.0), max: DVec2::new(x + 8.0, 60.0) };
        let neck_px = DVec2::new(x, 22.0);
        Person { bounds, score: 0.5, joints, mask, neck_px, ground_m: zero, neck_m: zero, ..Person::blank() }
    }

    #[test]
    fn the_same_person_twice_is_one_and_neighbours_are_two() {
        let camera = Camera::looking_at((1280, 720), 2000.0, DVec3::new(0.0, 15.0, 60.0), DVec3::ZERO);
        assert!(same_person(&person(100.0, 0.0), &person(102.0, 1.0), &camera));
        assert!(!same_person(&person(100.0, 0.0), &person(115.0, 0.0), &camera));
    }

    #[test]
    fn a_part_of_a_body_found_again_is_the_same_person() {
        let camera = Camera::looking_at((1280, 720), 2000.0, DVec3::new(0.0, 15.0, 60.0), DVec3::ZERO);
        let mut legs = person(101.0, 0.0);
        for joint in &mut legs.joints {
            joint.pixel.y = 45.0 + joint.pixel.y / 4.0;
        }
        legs.mask = Mask { y0: 15, height: 45, coverage: vec![255; 16 * 45], ..legs.mask };
        legs.bounds.min.y = 15.0;
        assert!(same_person(&person(100.0, 0.0), &legs, &camera));
        let mut neighbour = Person { neck_px: legs.neck_px + DVec2::X * 14.0, ..legs };
        for joint in &mut neighbour.joints {
            joint.pixel.x += 14.0;
        }
        assert!(!same_person(&person(100.0, 0.0), &neighbour, &camera));
    }

    #[test]
    fn masks_overlap_by_their_pixels() {
        assert!((mask_overlap(&person(100.0, 0.0).mask, &person(100.0, 0.0).mask) - 1.0).abs() < 1e-12);
        assert!((mask_overlap(&person(100.0, 0.0).mask, &person(108.0, 0.0).mask) - 0.5).abs() < 1e-12);
        assert!(mask_overlap(&Mask::default(), &person(108.0, 0.0).mask).abs() < 1e-12);
    }
}
