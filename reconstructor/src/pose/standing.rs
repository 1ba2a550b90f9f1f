//! A standing figure for people whose pose cannot be read: clearly detected, but hidden, cut or in a tangle.
//!
//! They stay on the pitch instead of vanishing for some frames; `pose_score` 0 says that nothing but the box was seen.

use glam::{DVec2, DVec3};
use protocol::{camera::Camera, pitch::Pitch};

use super::{JOINTS, Joint, Looks, Person, blazepose::Estimate, ground, index, silhouette};
use crate::{
    detection::Detection,
    geometry::{Mask, PixelBox},
};

/// How sure the joints of such a figure are.
const VISIBILITY: f32 = 0.1;
/// Joints of somebody who stands upright with arms at the sides: left side's index, share of the height, distance from the
/// middle as a share of the height. The right side is its mirror image.
const SIDES: [(usize, f64, f64); 10] = [
    (index::LEFT_SHOULDER, 0.82, 0.10),
    (index::LEFT_ELBOW, 0.64, 0.13),
    (index::LEFT_WRIST, 0.49, 0.14),
    (17, 0.46, 0.14),
    (19, 0.45, 0.14),
    (21, 0.46, 0.13),
    (index::LEFT_HIP, 0.53, 0.055),
    (index::LEFT_KNEE, 0.29, 0.06),
    (index::LEFT_ANKLE, 0.05, 0.06),
    (index::LEFT_HEEL, 0.03, 0.06),
];
/// Height of the face, and half its width, as shares of the height.
const FACE: (f64, f64) = (0.93, 0.02);
/// Half the thickness of the limbs of the figure's mask, as a share of the height.
const LIMB: f64 = 0.05;
/// Coverage of the pose network's mask that is believed beside a pose that is not.
const MASK_SHARE_MIN: f64 = 0.25;

/// Somebody who stands in the detection's box; `None` when nobody can.
pub(super) fn in_box(
    seen: &Estimate,
    detection: &Detection,
    camera: &Camera,
    pitch: &Pitch,
) -> Option<Person> {
    let bounds = detection.bounds;
    let ground_m = ground::under_box(camera, &bounds)?;
    let top = ground::lift(camera, DVec2::new(bounds.centre().x, bounds.min.y), ground_m)?;
    let place = DVec2::new(ground_m.x, ground_m.z);
    if !pitch.contains(place, ground::MARGIN_M) || !ground::HEAD_M.contains(&top.y) {
        return None;
    }
    let joints = joints(&bounds);
    let neck_px = ground::middle(&joints, index::LEFT_SHOULDER, index::RIGHT_SHOULDER)?;
    let neck_m = ground::lift(camera, neck_px, ground_m)?;
    let mask = mask(seen, &bounds, &joints);
    Some(Person {
        bounds,
        score: detection.score,
        roles: detection.roles,
        pose_score: 0.0,
        joints,
        mask,
        neck_px,
        ground_m: DVec3::new(ground_m.x, 0.0, ground_m.z),
        neck_m,
        looks: Looks::default(),
    })
}

/// All joints of a figure that fills the box from top to bottom.
fn joints(bounds: &PixelBox) -> Vec<Joint> {
    let (centre, height) = (bounds.centre().x, bounds.size().y);
    let at = |share: f64, beside: f64| Joint {
        pixel: DVec2::new(centre + beside * height, bounds.max.y - share * height),
        depth_m: 0.0,
        visibility: VISIBILITY,
    };
    // The eleven points of the face first, then left and right in turn.
    let mut joints = vec![at(FACE.0, 0.0); JOINTS];
    for (joint, share, beside) in SIDES {
        // Seen from the front the person's left is on the right of the picture.
        for (joint, beside) in [(joint, beside), (joint + 1, -beside)] {
            if let Some(place) = joints.get_mut(joint) {
                *place = at(share, beside);
            }
        }
    }
    for (joint, beside) in [(index::LEFT_TOE, 0.07), (index::RIGHT_TOE, -0.07)] {
        if let Some(place) = joints.get_mut(joint) {
            *place = at(0.0, beside);
        }
    }
    for (eye, place) in joints.iter_mut().enumerate().take(index::LEFT_SHOULDER).skip(1) {
        *place = at(FACE.0, if eye % 2 == 0 { -FACE.1 } else { FACE.1 });
    }
    joints
}

/// What the network saw inside the box, when that is enough of it; else the figure's limbs.
fn mask(seen: &Estimate, bounds: &PixelBox, joints: &[Joint]) -> Mask {
    let low = bounds.min.round().max(DVec2::ZERO);
    let size = (bounds.max.round() - low).max(DVec2::ONE);
    let (x0, y0, width, height) = (low.x as i32, low.y as i32, size.x as u32, size.y as u32);
    let pixels = |coverage: &dyn Fn(i32, i32) -> u8| Mask {
        x0,
        y0,
        width,
        height,
        coverage: (0..width * height)
            .map(|i| coverage(x0 + (i % width) as i32, y0 + (i / width) as i32))
            .collect(),
    };
    let inside = pixels(&|x, y| seen.mask.at(x, y));
    if inside.area_px() as f64 >= MASK_SHARE_MIN * f64::from(width) * f64::from(height) {
        return inside;
    }
    let (bones, limb) = (silhouette::bones(joints), LIMB * bounds.size().y);
    pixels(&|x, y| {
        let pixel = DVec2::new(f64::from(x), f64::from(y));
        let near = bones.iter().any(|&bone| silhouette::squared_distance_px(pixel, bone) <= limb * limb);
        if near { 255 } else { 0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detection::RoleChances;

    fn camera() -> Camera {
        Camera::looking_at((1280, 720), 1800.0, DVec3::new(0.0, 18.0, 75.0), DVec3::new(5.0, 0.0, 0.0))
    }

    fn boxed(foot: DVec3, height_m: f64) -> Detection {
        let camera = camera();
        let (low, high) =
            (camera.project(foot).unwrap(), camera.project(foot + DVec3::Y * height_m).unwrap());
        let bounds = PixelBox { min: high - DVec2::X * 8.0, max: low + DVec2::X * 8.0 };
        Detection { bounds, score: 0.9, roles: RoleChances::UNKNOWN }
    }

    #[test]
    fn the_figure_fills_its_box_and_stands_where_it_ends() {
        let nothing = Estimate { joints: Vec::new(), score: 0.1, mask: Mask::default() };
        let detection = boxed(DVec3::new(8.0, 0.0, -4.0), 1.8);
        let person = in_box(&nothing, &detection, &camera(), &Pitch::default()).unwrap();
        assert!((person.ground_m - DVec3::new(8.0, 0.0, -4.0)).length() < 0.2, "{}", person.ground_m);
        assert_eq!((person.joints.len(), person.pose_score), (JOINTS, 0.0));
        assert!(person.joints.iter().all(|joint| detection.bounds.contains(joint.pixel)));
        assert!(person.joints[index::NOSE].pixel.y < person.joints[index::LEFT_HIP].pixel.y);
        let share = person.mask.area_px() as f64 / (detection.bounds.size().x * detection.bounds.size().y);
        assert!((0.2..0.8).contains(&share), "{share}");
    }

    #[test]
    fn nobody_stands_in_the_crowd_or_is_four_metres_tall() {
        let nothing = Estimate { joints: Vec::new(), score: 0.1, mask: Mask::default() };
        let stands = |detection: &Detection| in_box(&nothing, detection, &camera(), &Pitch::default());
        assert!(stands(&boxed(DVec3::new(0.0, 0.0, -45.0), 1.8)).is_none());
        assert!(stands(&boxed(DVec3::ZERO, 4.0)).is_none());
    }
}
