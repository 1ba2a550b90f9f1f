//! The legs of one body: where its soles are, forward kinematics of a pose's legs, and the two-bone inverse kinematics
//! that puts an ankle where a planted foot must be. Person's frame: metres, y up, looking along +z, left at +x.

use std::f32::consts::PI;

use glam::{Quat, Vec3};

use crate::{
    body::{Bone, ShapedBody},
    figure::{Figure, Material},
    motion::{Joint, Pose},
};

/// A leg counts as straight a little before it is, so that the knee neither locks nor snaps.
const STRAIGHT: f32 = 0.995;
/// A knee bends so far at most, radians (Norkin & White, Measurement of Joint Motion: 150°).
const KNEE_MOST: f32 = 2.62;

/// Left or right, as an index: 0 is left.
pub const SIDES: [usize; 2] = [0, 1];

const THIGHS: [Joint; 2] = [Joint::ThighL, Joint::ThighR];
const CALVES: [Joint; 2] = [Joint::CalfL, Joint::CalfR];
const FEET: [Joint; 2] = [Joint::FootL, Joint::FootR];

/// One leg at rest.
#[derive(Clone, Copy, Debug)]
struct Leg {
    /// Hip joint, from the middle of the hips.
    hip: Vec3,
    thigh_m: f32,
    calf_m: f32,
    /// Back end of the sole, from the ankle.
    heel: Vec3,
    /// The joint of the toes, from the ankle.
    ball: Vec3,
    /// Front end of the sole, from the ankle.
    toe: Vec3,
}

/// Where a foot is: its ankle and its turn against the rest pose, in which it stands flat and looks ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// The ankle joint, metres.
    pub ankle: Vec3,
    /// Turn of the foot.
    pub turn: Quat,
}

/// Both legs of a figure.
#[derive(Clone, Debug)]
pub struct Legs {
    legs: [Leg; 2],
}

impl Legs {
    /// Measures the legs of a dressed figure, boots included.
    #[must_use]
    pub fn of(figure: &Figure) -> Self {
        let body = &figure.body;
        let leg = |side: usize| {
            let [thigh, calf, foot, ball] = [
                [Bone::ThighL, Bone::CalfL, Bone::FootL, Bone::BallL],
                [Bone::ThighR, Bone::CalfR, Bone::FootR, Bone::BallR],
            ][side];
            let ankle = body.head(foot);
            let sole = boot_points(figure, body.head(thigh).x.signum());
            let lowest = sole.iter().map(|p| p.y).fold(f32::MAX, f32::min);
            // The tread: what lies within a centimetre of the lowest point.
            let tread = || sole.iter().filter(|p| p.y < lowest + 0.010);
            let back = tread().map(|p| p.z).fold(f32::MAX, f32::min);
            let front = tread().map(|p| p.z).fold(f32::MIN, f32::max);
            let below = |z: f32, x: f32| Vec3::new(x - ankle.x, lowest - ankle.y, z - ankle.z);
            Leg {
                hip: body.head(thigh) - body.hips(),
                thigh_m: body.head(thigh).distance(body.head(calf)),
                calf_m: body.head(calf).distance(ankle),
                heel: below(back, ankle.x),
                ball: body.head(ball) - ankle,
                toe: below(front, body.tail(ball).x),
            }
        };
        Self { legs: SIDES.map(leg) }
    }

    /// Height of the middle of the hips over the soles with straight legs.
    #[must_use]
    pub fn standing_m(&self) -> f32 {
        let leg = &self.legs[0];
        leg.thigh_m + leg.calf_m - leg.heel.y - leg.hip.y
    }

    /// Height of the ankle over the sole.
    #[must_use]
    pub fn ankle_m(&self) -> f32 {
        -self.legs[0].heel.y
    }

    /// The foot of one side in `pose`, from the middle of the hips.
    #[must_use]
    pub fn foot(&self, pose: &Pose, side: usize) -> Foot {
        let leg = &self.legs[side];
        let pelvis = pose.rotations[Joint::Pelvis as usize];
        let thigh = pelvis * pose.rotations[THIGHS[side] as usize];
        let calf = thigh * pose.rotations[CALVES[side] as usize];
        let turn = calf * pose.rotations[FEET[side] as usize];
        let ankle = pelvis * leg.hip + thigh * Vec3::NEG_Y * leg.thigh_m + calf * Vec3::NEG_Y * leg.calf_m;
        Foot { ankle, turn }
    }

    /// The turn of a shank in `pose`.
    #[must_use]
    pub fn shank(&self, pose: &Pose, side: usize) -> Quat {
        let [pelvis, thigh, calf] =
            [Joint::Pelvis, THIGHS[side], CALVES[side]].map(|joint| pose.rotations[joint as usize]);
        pelvis * thigh * calf
    }

    /// The joint between pelvis and thigh of one side.
    #[must_use]
    pub fn hip_joint(side: usize) -> Joint {
        THIGHS[side]
    }

    /// The joint between shank and foot of one side.
    #[must_use]
    pub fn ankle_joint(side: usize) -> Joint {
        FEET[side]
    }

    /// Height of the lowest point of a sole, toes straight.
    #[must_use]
    pub fn sole_y(&self, foot: &Foot, side: usize) -> f32 {
        let leg = &self.legs[side];
        [leg.heel, leg.toe]
            .map(|point| (foot.ankle + foot.turn * point).y)
            .into_iter()
            .fold(f32::MAX, f32::min)
    }

    /// A foot that stands on the ground at `ankle` (its height is ignored), looks along `yaw`, and rolls by `pitch`:
    /// positive lifts the toes about the heel, negative the heel about the joint of the toes.
    #[must_use]
    pub fn planted(&self, side: usize, ankle: Vec3, yaw: f32, pitch: f32) -> Foot {
        let leg = &self.legs[side];
        let flat = Quat::from_rotation_y(yaw);
        let at = ankle.with_y(self.ankle_m());
        let pivot = if pitch > 0.0 { leg.heel } else { leg.ball };
        let turn = flat * Quat::from_rotation_x(-pitch);
        // Skinning pulls the sole before the joint of the toes down with the foot: about a centimetre at 40°.
        let eased = Vec3::Y * (-pitch).max(0.0) * 0.015;
        Foot { ankle: at + flat * pivot - turn * pivot + eased, turn }
    }

    /// How high the middle of the hips may be at most for the leg to reach `ankle`; both in a frame whose origin is
    /// the anchor on the ground.
    #[must_use]
    pub fn reach_m(&self, pelvis: Quat, side: usize, ankle: Vec3) -> f32 {
        let leg = &self.legs[side];
        let hip = pelvis * leg.hip;
        let longest = (leg.thigh_m + leg.calf_m) * STRAIGHT;
        let aside = (ankle - hip).with_y(0.0).length();
        ankle.y - hip.y + (longest * longest - aside * aside).max(0.04).sqrt()
    }

    /// Bends a leg of `pose` so that its foot is `foot` (from the middle of the hips). The knee keeps to the side where
    /// the pose has it. A foot out of reach is approached as far as the leg goes.
    ///
    /// Two bones and a hinge leave one freedom, the turn about the line from hip to ankle; the pose's own knee settles it.
    pub fn bend(&self, pose: &mut Pose, side: usize, foot: &Foot) {
        let leg = &self.legs[side];
        let pelvis = pose.rotations[Joint::Pelvis as usize];
        let before = pelvis * pose.rotations[THIGHS[side] as usize];
        let hip = pelvis * leg.hip;
        let (a, b) = (leg.thigh_m, leg.calf_m);
        let least = (a * a + b * b + 2.0 * a * b * KNEE_MOST.cos()).max(0.0).sqrt();
        let line = foot.ankle - hip;
        let distance = line.length().clamp(least, (a + b) * STRAIGHT);
        let along = line.normalize_or(Vec3::NEG_Y);
        // Where the knee points: as the pose has it, and half as the foot looks while that is ahead.
        let toes = foot.turn * Vec3::Z;
        let level = 0.5 * ((toes.dot(pelvis * Vec3::Z) - 0.4) / 0.4).clamp(0.0, 1.0);
        let wanted = (before * Vec3::Z).lerp(toes.with_y(0.0).normalize_or(before * Vec3::Z), level);
        let ahead =
            (wanted - along * wanted.dot(along)).normalize_or((before * Vec3::Z).any_orthonormal_vector());
        let cosine = ((distance * distance + a * a - b * b) / (2.0 * distance * a)).clamp(-1.0, 1.0);
        let thigh = along * cosine + ahead * (1.0 - cosine * cosine).sqrt();
        let hinge = ahead.cross(along).normalize_or(Vec3::X);
        let up = -thigh;
        let global = Quat::from_mat3(&glam::Mat3::from_cols(hinge, up, hinge.cross(up)));
        let inner = ((a * a + b * b - distance * distance) / (2.0 * a * b)).clamp(-1.0, 1.0).acos();
        let calf = global * Quat::from_rotation_x(PI - inner);
        *pose.joint(THIGHS[side]) = pelvis.inverse() * global;
        *pose.joint(CALVES[side]) = Quat::from_rotation_x(PI - inner);
        *pose.joint(FEET[side]) = calf.inverse() * foot.turn;
    }
}

/// The points of one boot in the rest pose.
fn boot_points(figure: &Figure, side: f32) -> Vec<Vec3> {
    let mut points = Vec::new();
    for (triangle, material) in figure.triangles.iter().zip(&figure.materials) {
        if *material == Material::Boot {
            points.extend(
                triangle.map(|v| figure.vertices[v as usize].rest).into_iter().filter(|p| p.x * side > 0.0),
            );
        }
    }
    if points.is_empty() { vec![ground_under(&figure.body, side)] } else { points }
}

fn ground_under(body: &ShapedBody, side: f32) -> Vec3 {
    body.tail(if side > 0.0 { Bone::BallL } else { Bone::BallR })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        body::{BaseBody, Build},
        figure::{Detail, dress},
        gait,
        outfit::{Kit, Outfit},
    };
    use rand::SeedableRng;

    fn legs() -> Legs {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(4);
        let base = BaseBody::load().unwrap();
        let build = Build { female: 0.0, origin: [0.3, 0.3, 0.4], muscle: 0.2, weight: 0.0, height_m: 1.8 };
        let kit = Kit::random(&mut rng, "k".into());
        Legs::of(&dress(
            &base,
            base.shape(&build),
            Outfit::random(&mut rng, kit, None, false),
            Detail::Broadcast,
        ))
    }

    #[test]
    fn a_bent_leg_ends_where_the_foot_was_asked_to_be() {
        let legs = legs();
        assert!((0.75..1.05).contains(&legs.standing_m()), "hips at {} m", legs.standing_m());
        for (x, z, high) in [(0.1, 0.0, 0.88), (0.1, 0.3, 0.80), (0.2, -0.25, 0.82), (0.05, 0.1, 0.55)] {
            let mut pose = gait::stride(&gait::JOG, 0.2);
            let foot = legs.planted(0, Vec3::new(x, 0.0, z), 0.3, 0.0);
            let wanted = Foot { ankle: foot.ankle - Vec3::Y * high, ..foot };
            legs.bend(&mut pose, 0, &wanted);
            let got = legs.foot(&pose, 0);
            assert!(got.ankle.distance(wanted.ankle) < 1e-3, "{got:?} for {wanted:?}");
            assert!(got.turn.angle_between(wanted.turn) < 1e-2);
            let knee = pose.rotations[Joint::CalfL as usize];
            assert!(2.0 * knee.x.atan2(knee.w) > -1e-3, "the knee bends backwards");
        }
    }

    #[test]
    fn a_rolling_foot_keeps_its_pivot_on_the_ground() {
        let legs = legs();
        let ankle = Vec3::new(3.0, 0.0, 2.0);
        let flat = legs.planted(1, ankle, 1.0, 0.0);
        for pitch in [0.25f32, -0.6] {
            let rolled = legs.planted(1, ankle, 1.0, pitch);
            let pivot = if pitch > 0.0 { legs.legs[1].heel } else { legs.legs[1].ball };
            let moved = (rolled.ankle + rolled.turn * pivot).distance(flat.ankle + flat.turn * pivot);
            assert!(moved < 0.01, "the pivot moved {moved} m");
            assert!((rolled.turn * Vec3::Z).y * pitch > 0.0, "positive lifts the toes");
        }
    }
}
