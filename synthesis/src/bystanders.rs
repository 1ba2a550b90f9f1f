//! People beside the pitch who take no part: substitutes and coaches, stewards, photographers, ball boys. They are not in
//! the match's truth as players; each is a small still figure, and the truth can ask where they are.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Quat, Vec3};
use rand::{Rng, seq::IndexedRandom};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;

use crate::{
    SynthesisError,
    body::{BaseBody, Build},
    figure::{Detail, Figure, Material, dress},
    furniture::DugOut,
    gait,
    motion::{Joint, Pose},
    outfit::{Kit, Outfit, Sleeves, Srgb, linear},
    render::Solid,
    rig::{self, Placement},
    stadium::Stadium,
};

/// What somebody beside the pitch does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)] // the names say it
pub enum Part {
    Substitute,
    Coach,
    Steward,
    Photographer,
    BallBoy,
}

/// Somebody beside the pitch.
#[derive(Clone, Debug)]
pub struct Bystander {
    /// What the person does.
    pub part: Part,
    /// The surface in the world.
    pub solid: Solid,
}

/// Triangles of a bystander.
const TRIANGLES: usize = 420;

/// Sitting on a chair.
fn sitting(mood: f32) -> Pose {
    let mut pose = Pose::default();
    for (thigh, calf, side) in [(Joint::ThighL, Joint::CalfL, 1.0), (Joint::ThighR, Joint::CalfR, -1.0)] {
        *pose.joint(thigh) = Quat::from_rotation_z(0.12 * side) * Quat::from_rotation_x(-1.45);
        *pose.joint(calf) = Quat::from_rotation_x(1.3 + 0.4 * mood);
    }
    for arm in [Joint::UpperArmL, Joint::UpperArmR] {
        *pose.joint(arm) = Quat::from_rotation_x(-0.5 - 0.3 * mood);
    }
    for arm in [Joint::LowerArmL, Joint::LowerArmR] {
        *pose.joint(arm) = Quat::from_rotation_x(-0.9);
    }
    *pose.joint(Joint::Chest) = Quat::from_rotation_x(0.25 * mood);
    pose
}

/// The wardrobe of people beside the pitch: long sleeves and trousers; they are coloured one by one.
fn figures(base: &BaseBody, rng: &mut Pcg64Mcg) -> Vec<Figure> {
    (0..6)
        .map(|k| {
            let female = k % 3 == 2;
            let kit = Kit::random(rng, "beside the pitch".into());
            let outfit = Outfit {
                sleeves: Sleeves::Long,
                shorts_above_knee_m: -0.22,
                looseness_m: 0.03,
                ..Outfit::random(rng, kit, None, female)
            };
            dress(base, base.shape(&Build::of(rng, female, false)), outfit, Detail::Broadcast)
        })
        .collect()
}

fn still(figure: &Figure, pose: &Pose, place: &Placement, coat: Srgb, trousers: Srgb) -> Solid {
    let posed = rig::pose(figure, pose).placed(place);
    let positions: Vec<[f32; 3]> = posed.positions.iter().map(|p| p.to_array()).collect();
    let indices: &[u32] = bytemuck::cast_slice(&figure.triangles);
    let kept = match meshopt::VertexDataAdapter::new(bytemuck::cast_slice(&positions), 12, 0) {
        Ok(adapter) => {
            let options = meshopt::SimplifyOptions::ErrorAbsolute;
            meshopt::simplify(indices, &adapter, TRIANGLES * 3, 0.04, options, None)
        }
        Err(_) => indices.to_vec(),
    };
    let mut colour_of = vec![Vec3::ZERO; positions.len()];
    for (triangle, material) in figure.triangles.iter().zip(&figure.materials) {
        let colour = match material {
            Material::Shirt | Material::Sleeve => coat,
            Material::Shorts | Material::Sock => trousers,
            Material::Hair => figure.outfit.hair.map_or(figure.outfit.skin, |hair| hair.colour),
            Material::Boot | Material::Glove => [0.08, 0.08, 0.09],
            _ => figure.outfit.skin,
        };
        triangle.iter().for_each(|&v| colour_of[v as usize] = linear(colour));
    }
    let mut solid = Solid::default();
    let mut renamed = std::collections::BTreeMap::new();
    for triangle in kept.as_chunks::<3>().0 {
        solid.triangles.push(triangle.map(|v| {
            *renamed.entry(v).or_insert_with(|| {
                solid.positions.push(posed.positions[v as usize]);
                solid.normals.push(posed.normals[v as usize]);
                solid.positions.len() as u32 - 1
            })
        }));
        solid.colours.push(colour_of[triangle[0] as usize]);
    }
    solid
}

/// Everybody beside the pitch of a stadium. `colours` are the teams' shirts: substitutes wear something near them.
pub fn beside(
    rng: &mut Pcg64Mcg,
    stadium: &Stadium,
    dug_outs: &[DugOut],
    colours: [Srgb; 2],
) -> Result<Vec<Bystander>, SynthesisError> {
    let base = BaseBody::load()?;
    let figures = figures(&base, rng);
    let mut people = Vec::new();
    let mut add =
        |rng: &mut Pcg64Mcg, part: Part, feet: Vec3, yaw: f32, sits: bool, coat: Srgb, trousers: Srgb| {
            let Some(figure) = figures.choose(rng) else { return };
            let pose = if sits {
                sitting(rng.random_range(0.0..1.0))
            } else {
                gait::stand(rng.random_range(0.0..1.0), rng.random_range(0.0..1.0))
            };
            let place = Placement { anchor_m: feet.with_y(0.0), yaw: yaw + rng.random_range(-0.5..0.5) };
            let shade = rng.random_range(0.8..1.1f32);
            let solid = still(figure, &pose, &place, coat.map(|c| (c * shade).min(0.95)), trousers);
            people.push(Bystander { part, solid });
        };
    const DARK: Srgb = [0.06, 0.07, 0.10];
    for (dug_out, colour) in dug_outs.iter().zip(colours) {
        let full = rng.random_range(0.5..1.0);
        let bib: Srgb = if rng.random_bool(0.5) { DARK } else { colour };
        for seat in &dug_out.seats {
            if rng.random_bool(full) {
                let coat = if rng.random_bool(0.75) { bib } else { [0.25, 0.26, 0.30] };
                add(rng, Part::Substitute, *seat, dug_out.yaw, true, coat, DARK);
            }
        }
        for _ in 0..rng.random_range(0..4) {
            let [a, b] = dug_out.area;
            let at =
                Vec3::new(rng.random_range(a.x..b.x), 0.0, a.z + (b.z - a.z) * rng.random_range(0.0..1.0f32));
            let coat = if rng.random_bool(0.7) { DARK } else { [0.30, 0.31, 0.34] };
            add(rng, Part::Coach, at, dug_out.yaw, false, coat, DARK);
        }
    }
    const VESTS: [Srgb; 3] = [[0.85, 0.90, 0.15], [0.95, 0.45, 0.08], [0.75, 0.80, 0.10]];
    let vest = *VESTS.choose(rng).unwrap_or(&VESTS[0]);
    for (index, side) in stadium.around.sides.iter().enumerate() {
        let Some(row) = side.boards.last() else { continue };
        let along = side.outward.cross(Vec3::Y);
        // The way that faces the pitch.
        let inwards = match index {
            0 => 0.0,
            1 => -FRAC_PI_2,
            2 => FRAC_PI_2,
            _ => PI,
        };
        let place = |along_m: f32, out_m: f32| along * along_m + side.outward * (side.line_m + out_m);
        let anywhere = |rng: &mut Pcg64Mcg| rng.random_range(-0.92..0.92f32) * side.half_m;
        // Stewards behind the boards look at the crowd.
        for _ in 0..rng.random_range(0..8) {
            let at = place(anywhere(rng), row.gap_m + rng.random_range(0.7..1.6f32));
            let sits = rng.random_bool(0.3);
            add(rng, Part::Steward, at, inwards + PI, sits, vest, DARK);
        }
        let front = side.boards.first().map_or(4.0, |row| row.gap_m);
        for _ in 0..rng.random_range(0..3) {
            let at = place(anywhere(rng), front - 0.7);
            let sits = rng.random_bool(0.6);
            add(rng, Part::BallBoy, at, inwards, sits, [0.2, 0.4, 0.75], DARK);
        }
        if index == 1 || index == 2 {
            for _ in 0..rng.random_range(0..7) {
                let aside = rng.random_range(6.0..22.0f32) * if rng.random_bool(0.5) { 1.0 } else { -1.0 };
                let at = place(aside, front - rng.random_range(0.6..1.1f32));
                add(rng, Part::Photographer, at, inwards, true, [0.35, 0.36, 0.40], DARK);
            }
        }
    }
    Ok(people)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        furniture::dug_outs,
        venue::{Venue, pitch_of},
    };
    use rand::SeedableRng;

    #[test]
    fn bystanders_stay_off_the_pitch_and_on_the_ground() {
        for seed in 0..3 {
            let colours = [[0.8, 0.1, 0.1], [0.1, 0.1, 0.8]];
            let venue = Venue::drawn(seed, pitch_of(seed), colours);
            let rng = &mut Pcg64Mcg::seed_from_u64(seed);
            let shelters = dug_outs(rng, &venue.stadium);
            let people = beside(rng, &venue.stadium, &shelters, colours).unwrap();
            assert!(people.len() > 5, "{} people", people.len());
            let (half_x, half_z) =
                (venue.stadium.pitch.length_m as f32 / 2.0, venue.stadium.pitch.width_m as f32 / 2.0);
            for person in &people {
                let low = person.solid.positions.iter().fold(Vec3::MAX, |a, p| a.min(*p));
                let high = person.solid.positions.iter().fold(Vec3::MIN, |a, p| a.max(*p));
                assert!((-0.02..0.05).contains(&low.y), "{:?} floats at {}", person.part, low.y);
                assert!((0.9..2.4).contains(&high.y), "{:?} is {} m high", person.part, high.y);
                let inside = person.solid.positions.iter().any(|p| p.x.abs() < half_x && p.z.abs() < half_z);
                assert!(!inside, "{:?} on the pitch", person.part);
                assert!(person.solid.triangles.len() < 2 * TRIANGLES);
            }
        }
    }
}
