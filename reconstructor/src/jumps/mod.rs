//! Jumps: when somebody's feet are off the ground, how high, and where the person really is meanwhile.
//!
//! A body's distance is taken from its lower foot, as if that stood (`pose`). In the air it therefore seems to run away from the
//! camera and back, several metres within half a second, and never to rise. No runner does that: what looks like it, lasts
//! as long as gravity says for its height, and is seen at the hips too, is a jump.

mod parabola;

use glam::{DVec2, DVec3};
use protocol::camera::Camera;

use crate::{
    calibration::CameraEstimate,
    ingest::ClipInfo,
    pose::{Person, index, lift_upright},
    tracking::{Sighting, Track},
};
use parabola::{Jump, Sample};

/// The camera of a shot moves less than this from frame to frame, metres.
const SAME_CAMERA_M: f64 = 1.0;

/// A sighting off the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lift {
    /// Index in `ClipInfo::frames`.
    pub frame: usize,
    /// Index in that frame's people.
    pub person_index: usize,
    /// Height of the lowest point of the body above the grass, metres.
    pub above_ground_m: f64,
    /// The point of the pitch under the hips, world metres: what `Person::ground_m` would be if the feet stood.
    pub ground_m: DVec3,
}

/// Every sighting of `tracks` that is in the air, by frame and person.
///
/// `people` and `cameras` have an entry per frame of `clip`. A track must show the person before and after a jump.
#[must_use]
pub fn find(
    people: &[Vec<Person>],
    tracks: &[Track],
    cameras: &[CameraEstimate],
    clip: &ClipInfo,
) -> Vec<Lift> {
    let mut lifts = Vec::new();
    for track in tracks {
        let seen = track.sightings.iter().filter_map(|sighting| {
            let camera = cameras.get(sighting.frame)?.camera?;
            let person = people.get(sighting.frame)?.get(sighting.person_index)?;
            let time = clip.frames.get(sighting.frame)?;
            Some((*sighting, camera, sample(&camera, person, clip.timescale.seconds(time.start))?))
        });
        let seen: Vec<(Sighting, Camera, Sample)> = seen.collect();
        // From another place the distance is another one: a cut would look like a leap.
        for shot in seen.chunk_by(|(_, a, _), (_, b, _)| a.position.distance(b.position) < SAME_CAMERA_M) {
            let samples: Vec<Sample> = shot.iter().map(|(_, _, sample)| *sample).collect();
            for jump in parabola::jumps(&samples) {
                lifts.extend(shot.iter().filter_map(|(sighting, camera, sample)| {
                    let above_ground_m = jump.height_m(sample.seconds);
                    (above_ground_m > 0.0).then(|| Lift {
                        frame: sighting.frame,
                        person_index: sighting.person_index,
                        above_ground_m,
                        ground_m: under(camera, sample, &jump),
                    })
                }));
            }
        }
    }
    lifts.sort_by_key(|lift| (lift.frame, lift.person_index));
    lifts.dedup_by_key(|lift| (lift.frame, lift.person_index));
    lifts
}

/// Moves those who are in the air to where they really are.
pub fn place(people: &mut [Vec<Person>], cameras: &[CameraEstimate], lifts: &[Lift]) {
    for lift in lifts {
        let person = people.get_mut(lift.frame).and_then(|frame| frame.get_mut(lift.person_index));
        let camera = cameras.get(lift.frame).and_then(|estimate| estimate.camera);
        let (Some(person), Some(camera)) = (person, camera) else { continue };
        person.ground_m = lift.ground_m;
        if let Some(neck_m) = lift_upright(&camera, person.neck_px, lift.ground_m) {
            person.neck_m = neck_m;
        }
    }
}

/// What one sighting says; `None` when the person stands under the camera or has no hips.
fn sample(camera: &Camera, person: &Person, seconds: f64) -> Option<Sample> {
    let hips = [index::LEFT_HIP, index::RIGHT_HIP].map(|hip| person.joints.get(hip).map(|joint| joint.pixel));
    let [Some(left), Some(right)] = hips else { return None };
    let ray = camera.ray((left + right) / 2.0);
    let flat = DVec2::new(ray.direction.x, ray.direction.z);
    let away_m = (person.ground_m - camera.position).with_y(0.0).length();
    let sample = Sample {
        seconds,
        away_m,
        rise_per_m: camera.position.y / away_m,
        camera_m: camera.position.y,
        hips_slope: ray.direction.y / flat.length(),
        hips_towards: flat / flat.length(),
        size_px: camera.pixels_per_metre(person.ground_m),
    };
    let usable =
        away_m > 1.0 && camera.position.y > 1.0 && flat.length() > 1e-3 && sample.hips_slope.is_finite();
    usable.then_some(sample)
}

/// The point of the pitch under the hips during a jump.
fn under(camera: &Camera, sample: &Sample, jump: &Jump) -> DVec3 {
    let flat = sample.hips_towards * jump.away_m(sample.seconds);
    DVec3::new(camera.position.x + flat.x, 0.0, camera.position.z + flat.y)
}

#[cfg(test)]
mod tests;
