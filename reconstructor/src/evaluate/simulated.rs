//! A made-up match as made-up detectors see it: truth without pictures, so that the stages that think in metres can be
//! tried on many matches in seconds.
//!
//! People, ball and cameras are those of `synthesis`; what a detector, a pose network and a calibration would add (noise,
//! misses, false candidates) is drawn from ranges that are named here.

use glam::{DMat3, DVec2, DVec3};
use protocol::{
    camera::Camera,
    manifest::PersonId,
    pitch::Pitch,
    time::{Ticks, Timescale},
};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};
use synthesis::{
    SynthesisError,
    fixture::{Fixture, FixtureOptions},
    rig,
    shots::Shots,
    trajectories::Trajectories,
};

use crate::{
    ball::RADIUS_M,
    calibration::CameraEstimate,
    detection::BallCandidate,
    geometry::{Mask, PixelBox},
    ingest::{ClipInfo, FrameTime},
    pose::{self, Joint, Person, index},
    shots::{Shot, ShotList},
    tracking::{Sighting, Track},
};

const RATE_HZ: u32 = 25;
/// Half the width of legs and trunk, metres.
const LIMB_M: f64 = 0.09;
const TRUNK_M: f64 = 0.17;

/// Errors of the made-up detectors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Standard deviation of a ball candidate's middle, pixels.
    pub ball_px: f64,
    /// Share of the frames in which the ball is not found though it is seen, besides the runs of misses beside feet.
    pub ball_missed: f64,
    /// False candidates per frame of each kind: anywhere, standing, on boots.
    pub false_candidates: [f64; 3],
    /// Standard deviation of a joint, pixels for a person 60 px tall; larger people have proportionally more.
    pub joint_px: f64,
    /// Share of people not found in a frame.
    pub person_missed: f64,
    /// Shiver of the camera from frame to frame, pixels.
    pub camera_px: f64,
}

impl Default for Errors {
    fn default() -> Self {
        Self {
            ball_px: 1.1,
            ball_missed: 0.25,
            false_candidates: [0.6, 0.7, 0.7],
            joint_px: 1.5,
            person_missed: 0.06,
            camera_px: 0.4,
        }
    }
}

/// What is true of one person in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PersonTruth {
    /// Who.
    pub id: u32,
    /// Ground point under the hips, world metres.
    pub anchor_m: DVec3,
    /// Height of the lower sole over the grass, metres.
    pub above_ground_m: f64,
    /// Whether a foot bears on the ground.
    pub stands: bool,
    /// Whether the person goes to the ground: a tackle, a dive, a fall.
    pub goes_down: bool,
}

/// What is true of the ball in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BallTruth {
    /// Its middle, world metres.
    pub position_m: DVec3,
    /// Whether it is in the picture and no body is before it.
    pub in_view: bool,
}

/// A made-up match, its truth and what is seen of it. All vectors have an entry per frame.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SimulatedMatch {
    /// The clip.
    pub clip: ClipInfo,
    /// Its shots.
    pub shots: ShotList,
    /// The pitch.
    pub pitch: Pitch,
    /// Cameras as calibrated.
    pub cameras: Vec<CameraEstimate>,
    /// People as seen.
    pub people: Vec<Vec<Person>>,
    /// Who they are, as if tracking made no mistake.
    pub tracks: Vec<Track>,
    /// Candidates for the ball.
    pub candidates: Vec<Vec<BallCandidate>>,
    /// The truth of `people`, entry by entry.
    pub people_truth: Vec<Vec<PersonTruth>>,
    /// The truth of the ball.
    pub ball_truth: Vec<BallTruth>,
}

/// Makes a match of `frames` frames from a seed, filmed by `shots`.
///
/// # Errors
/// As [`Fixture::new`].
pub fn simulate(
    seed: u64,
    frames: usize,
    shots: &Shots,
    errors: &Errors,
) -> Result<SimulatedMatch, SynthesisError> {
    let paths = Trajectories::generated(seed, frames as f64 / f64::from(RATE_HZ) + 1.0);
    let options = FixtureOptions { seed, frames, shots: shots.clone(), ..FixtureOptions::default() };
    let fixture = Fixture::new(&paths, &options)?;
    let mut rng = Pcg64Mcg::seed_from_u64(seed ^ 0xBA11);
    let pitch = fixture.stadium.pitch;
    let mut seen = SimulatedMatch {
        clip: clip(frames, options.size_px),
        shots: shot_list(&fixture),
        pitch,
        cameras: Vec::new(),
        people: Vec::new(),
        tracks: Vec::new(),
        candidates: Vec::new(),
        people_truth: Vec::new(),
        ball_truth: Vec::new(),
    };
    let mut misses = Misses::default();
    let standing = standing_things(&pitch, &mut rng);
    for frame in 0..frames {
        let camera = fixture.cameras[frame];
        let mixed = fixture.film[frame].other.is_some();
        let bodies = bodies(&fixture, frame, &camera);
        let ball_m = fixture.ball[frame].as_dvec3();
        let ball_px = camera.project(ball_m).filter(|&pixel| camera.contains(pixel));
        let hidden = bodies.iter().any(|body| body.hides(&camera, ball_m));
        let in_view = ball_px.is_some() && !hidden && !mixed;
        seen.ball_truth.push(BallTruth { position_m: ball_m, in_view });
        seen.candidates.push(candidates(
            &camera,
            ball_px.filter(|_| in_view).map(|_| ball_m),
            &bodies,
            &standing,
            errors,
            &mut misses,
            &mut rng,
        ));
        let calibrated = shaken(&camera, errors.camera_px, &mut rng);
        let (mut people, mut truth) = (Vec::new(), Vec::new());
        for body in &bodies {
            if mixed || rng.random_bool(errors.person_missed) {
                continue;
            }
            if let Some(person) = body.seen(&camera, &calibrated, &pitch, errors.joint_px, &mut rng) {
                people.push(person);
                truth.push(body.truth);
            }
        }
        seen.people.push(people);
        seen.people_truth.push(truth);
        let estimate = if mixed { None } else { Some(calibrated) };
        seen.cameras.push(CameraEstimate { camera: estimate, ..CameraEstimate::default() });
    }
    seen.tracks = tracks(&seen.people_truth, &seen.shots);
    Ok(seen)
}

fn clip(frames: usize, size_px: (u32, u32)) -> ClipInfo {
    let times = (0..frames).map(|frame| FrameTime {
        clip_frame: frame as u32,
        start: Ticks(frame as i64),
        duration: Ticks(1),
        duplicate: false,
    });
    ClipInfo {
        width_px: size_px.0,
        height_px: size_px.1,
        timescale: Timescale { numerator: RATE_HZ, denominator: 1 },
        frames: times.collect(),
    }
}

/// Shots without the frames in which two are mixed.
fn shot_list(fixture: &Fixture) -> ShotList {
    let mut list = ShotList::default();
    let mut number = None;
    for (frame, film) in fixture.film.iter().enumerate() {
        if film.other.is_some() {
            number = None;
            continue;
        }
        match list.shots.last_mut() {
            Some(shot) if number == Some(film.main.shot) => shot.frames.end = frame + 1,
            _ => list.shots.push(Shot { frames: frame..frame + 1 }),
        }
        number = Some(film.main.shot);
    }
    list
}

/// A body of the truth in one frame.
struct TrueBody {
    truth: PersonTruth,
    joints_m: Vec<DVec3>,
    joints_px: Vec<DVec2>,
    box_px: PixelBox,
}

fn bodies(fixture: &Fixture, frame: usize, camera: &Camera) -> Vec<TrueBody> {
    let body = |(id, member): (usize, &synthesis::fixture::Member)| {
        let step = &member.movement.steps[frame];
        let anchor_m = step.placement.anchor_m.as_dvec3();
        if camera.depth(anchor_m) < 2.0 {
            return None;
        }
        let landmarks = rig::landmarks_at(&member.figure, &step.pose, step.hips_m);
        let joints_m: Vec<DVec3> =
            landmarks.into_iter().map(|joint| step.placement.place(joint).as_dvec3()).collect();
        let joints_px: Option<Vec<DVec2>> = joints_m.iter().map(|&joint| camera.project(joint)).collect();
        let joints_px = joints_px?;
        let low = joints_px.iter().copied().fold(DVec2::MAX, DVec2::min);
        let high = joints_px.iter().copied().fold(DVec2::MIN, DVec2::max);
        let box_px = PixelBox { min: low, max: high };
        let truth = PersonTruth {
            id: id as u32,
            anchor_m,
            above_ground_m: f64::from(step.clearance_m),
            stands: step.contacts.contains(&true),
            goes_down: step.kind.goes_down(),
        };
        camera.contains(box_px.centre()).then_some(TrueBody { truth, joints_m, joints_px, box_px })
    };
    fixture.members.iter().enumerate().filter_map(body).collect()
}

impl TrueBody {
    /// Whether the body is before the ball.
    fn hides(&self, camera: &Camera, ball_m: DVec3) -> bool {
        let (Some(ball_px), depth) = (camera.project(ball_m), camera.depth(ball_m)) else { return false };
        let scale = camera.pixels_per_metre(self.truth.anchor_m);
        let bones = [
            (index::LEFT_HIP, index::LEFT_KNEE, LIMB_M),
            (index::LEFT_KNEE, index::LEFT_ANKLE, LIMB_M),
            (index::LEFT_HEEL, index::LEFT_TOE, LIMB_M),
            (index::RIGHT_HIP, index::RIGHT_KNEE, LIMB_M),
            (index::RIGHT_KNEE, index::RIGHT_ANKLE, LIMB_M),
            (index::RIGHT_HEEL, index::RIGHT_TOE, LIMB_M),
            (index::LEFT_SHOULDER, index::LEFT_HIP, TRUNK_M),
            (index::RIGHT_SHOULDER, index::RIGHT_HIP, TRUNK_M),
        ];
        bones.into_iter().any(|(a, b, half_m)| {
            let near = (camera.depth(self.joints_m[a]) + camera.depth(self.joints_m[b])) / 2.0 < depth;
            let (from, to) = (self.joints_px[a], self.joints_px[b]);
            let way = to - from;
            let share = ((ball_px - from).dot(way) / way.length_squared().max(1e-6)).clamp(0.0, 1.0);
            near && from.lerp(to, share).distance(ball_px) < half_m * scale
        })
    }

    /// The person as detector and pose network would give it.
    fn seen(
        &self,
        camera: &Camera,
        calibrated: &Camera,
        pitch: &Pitch,
        joint_px: f64,
        rng: &mut Pcg64Mcg,
    ) -> Option<Person> {
        let sigma = joint_px * (self.box_px.size().y / 60.0).max(0.4);
        let hips_m = (self.joints_m[index::LEFT_HIP] + self.joints_m[index::RIGHT_HIP]) / 2.0;
        // Part of the error is common to the whole body.
        let common = DVec2::new(normal(rng), normal(rng)) * sigma * 0.5;
        let joints: Vec<Joint> = self
            .joints_px
            .iter()
            .zip(&self.joints_m)
            .map(|(&pixel, &joint_m)| Joint {
                pixel: pixel + common + DVec2::new(normal(rng), normal(rng)) * sigma * 0.87,
                depth_m: (camera.depth(joint_m) - camera.depth(hips_m) + 0.08 * normal(rng)) as f32,
                visibility: 0.9,
            })
            .collect();
        let ground_m = pose::stand(calibrated, pitch, &joints)?;
        let neck_px = (joints[index::LEFT_SHOULDER].pixel + joints[index::RIGHT_SHOULDER].pixel) / 2.0;
        let neck_m = pose::lift_upright(calibrated, neck_px, ground_m)?;
        Some(Person {
            bounds: self.box_px,
            score: 0.8,
            roles: crate::detection::RoleChances::UNKNOWN,
            pose_score: 0.9,
            joints,
            mask: Mask::default(),
            neck_px,
            ground_m,
            neck_m,
            looks: pose::Looks::default(),
        })
    }
}

/// Runs of misses beside feet.
#[derive(Default)]
struct Misses {
    left: usize,
}

/// Places where something small and white always is, and how often each is taken for a ball.
fn standing_things(pitch: &Pitch, rng: &mut Pcg64Mcg) -> Vec<(DVec3, f64)> {
    let mark = pitch.length_m / 2.0 - 11.0;
    let mut things = vec![(DVec3::new(mark, 0.0, 0.0), 0.5), (DVec3::new(-mark, 0.0, 0.0), 0.5)];
    things.push((DVec3::ZERO, 0.3));
    for _ in 0..14 {
        // Beside the pitch and on boards and stands behind it.
        let along = rng.random_range(-0.6..0.6) * pitch.length_m;
        let away = -pitch.width_m / 2.0 - rng.random_range(2.0..14.0);
        things.push((DVec3::new(along, rng.random_range(0.1..4.0), away), rng.random_range(0.1..0.6)));
    }
    things
}

fn candidates(
    camera: &Camera,
    ball: Option<DVec3>,
    bodies: &[TrueBody],
    standing: &[(DVec3, f64)],
    errors: &Errors,
    misses: &mut Misses,
    rng: &mut Pcg64Mcg,
) -> Vec<BallCandidate> {
    let mut found = Vec::new();
    let diameter = |at: DVec3| 2.0 * RADIUS_M * camera.pixels_per_metre(at);
    let mut add = |pixel: DVec2, diameter_px: f64, score: f64| {
        if camera.contains(pixel) {
            let score = score.clamp(0.05, 0.98) as f32;
            found.push(BallCandidate { centre_px: pixel, diameter_px, score });
        }
    };
    if let Some((ball_m, pixel)) = ball.and_then(|ball| Some((ball, camera.project(ball)?))) {
        let beside_feet = bodies.iter().any(|body| {
            let scale = camera.pixels_per_metre(body.truth.anchor_m);
            (index::LEFT_ANKLE..=index::RIGHT_TOE)
                .any(|joint| body.joints_px[joint].distance(pixel) < 0.45 * scale)
        });
        if misses.left == 0 && beside_feet && rng.random_bool(0.06) {
            misses.left = rng.random_range(3..14);
        }
        misses.left = misses.left.saturating_sub(1);
        if misses.left == 0 && !rng.random_bool(errors.ball_missed) {
            let error = DVec2::new(normal(rng), normal(rng)) * errors.ball_px;
            let size = diameter(ball_m) * (1.0 + 0.18 * normal(rng)).max(0.4);
            add(pixel + error, size, 0.62 + 0.2 * normal(rng));
        }
    }
    let [anywhere, standing_share, boots] = errors.false_candidates;
    let size = DVec2::new(f64::from(camera.width_px), f64::from(camera.height_px));
    for _ in 0..3 {
        if rng.random_bool((anywhere / 3.0).min(1.0)) {
            let pixel = DVec2::new(rng.random_range(0.0..1.0), rng.random_range(0.0..1.0)) * size;
            add(pixel, rng.random_range(3.0..9.0), 0.3 + 0.14 * normal(rng));
        }
    }
    for &(place, often) in standing {
        let in_picture = camera.project(place).filter(|&pixel| camera.contains(pixel));
        if let Some(pixel) = in_picture
            && rng.random_bool((often * standing_share).clamp(0.0, 1.0))
        {
            let error = DVec2::new(normal(rng), normal(rng)) * 0.6;
            add(pixel + error, diameter(place) * 1.1, 0.36 + 0.14 * normal(rng));
        }
    }
    for body in bodies {
        // A few people's boots look like balls, all the time they are seen.
        let often = if body.truth.id % 7 == 3 { 0.25 } else { 0.02 };
        if rng.random_bool((often * boots).clamp(0.0, 1.0)) {
            let joint = if rng.random_bool(0.5) { index::LEFT_TOE } else { index::RIGHT_TOE };
            let error = DVec2::new(normal(rng), normal(rng)) * 1.5;
            add(
                body.joints_px[joint] + error,
                diameter(body.truth.anchor_m) * rng.random_range(0.7..1.3),
                0.36 + 0.14 * normal(rng),
            );
        }
    }
    found
}

/// The camera turned by a hair.
fn shaken(camera: &Camera, sigma_px: f64, rng: &mut Pcg64Mcg) -> Camera {
    let angle = sigma_px / camera.focal_px;
    let turn = DMat3::from_rotation_x(angle * normal(rng)) * DMat3::from_rotation_y(angle * normal(rng));
    Camera { rotation: turn * camera.rotation, ..*camera }
}

/// A normal deviate (Box & Muller).
fn normal(rng: &mut Pcg64Mcg) -> f64 {
    let (u, v): (f64, f64) = (rng.random_range(1e-12..1.0), rng.random_range(0.0..1.0));
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// Everybody's sightings, shot by shot.
fn tracks(people: &[Vec<PersonTruth>], shots: &ShotList) -> Vec<Track> {
    let mut all: Vec<Track> = Vec::new();
    for shot in &shots.shots {
        let mut of_shot = std::collections::BTreeMap::<u32, Vec<Sighting>>::new();
        for frame in shot.frames.clone() {
            for (person_index, person) in people[frame].iter().enumerate() {
                of_shot.entry(person.id).or_default().push(Sighting { frame, person_index });
            }
        }
        for sightings in of_shot.into_values() {
            let person = PersonId(all.len() as u32 + 1);
            all.push(Track { person, sightings });
        }
    }
    all
}
