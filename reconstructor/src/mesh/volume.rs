//! The space that a body fills: between its first and its last surface, but for the gaps between limbs that lie behind each
//! other.
//!
//! A depth map says where each ray enters the body and where it leaves for the last time. Where the two are farther apart than any
//! part of a body is thick, there is air between (a leg before the other, an arm before the trunk); the skeleton says which parts
//! are there, so that no curtain hangs between them.

use glam::{DVec2, DVec3};

use super::{MeshError, VirtualPlane};
use crate::{
    depth::{DepthMap, LAST_TRUNK_LIMB, Skeleton, View},
    pose::Person,
};

/// A ray that stays in the body for longer than this may have passed air, metres.
const THICK_M: f64 = 0.34;
/// The same where there are only arms and legs.
const THICK_LIMB_M: f64 = 0.24;
/// Air between parts that is thinner than this is filled, metres.
const GAP_M: f64 = 0.06;
/// Depth of a slab, metres.
const SLAB_M: f64 = 0.02;
/// Slabs at most: deeper bodies get deeper slabs.
const SLABS: usize = 96;
/// Surfaces farther than this from the upright plane are cut, metres.
const REACH_M: f64 = 1.6;
/// Balls that stand for a limb.
const BALLS: usize = 6;
/// Radius of parts of a body without a skeleton, metres.
const USUAL_RADIUS_M: f64 = 0.12;

/// How far inside the body each sample of a grid is, metres, negative outside: cells of the depth map with a ring round them, by slabs.
pub(super) struct Volume {
    /// Samples along x, y (cells, the first is −1) and depth.
    pub(super) size: [usize; 3],
    /// x fastest, then y.
    pub(super) values: Vec<f32>,
    nearest_m: f64,
    slab_m: f64,
}

impl Volume {
    /// The body of `depth`; `footprint_m` is the width of a pixel of the clip at the player.
    pub(super) fn fill(
        depth: &DepthMap,
        person: &Person,
        plane: &VirtualPlane,
        footprint_m: f64,
    ) -> Result<Self, MeshError> {
        if !depth.is_whole() {
            return Err(MeshError::Sizes {
                width: depth.width,
                height: depth.height,
                coverage: depth.coverage.len(),
                offsets: depth.front_mm.len().min(depth.back_mm.len()),
            });
        }
        let rays = Rays::read(depth);
        let (low_m, high_m) = rays.range();
        if low_m > high_m {
            return Err(MeshError::TooSmall { triangles: 0 });
        }
        let slab_m = SLAB_M.max((high_m - low_m) / SLABS as f64);
        let slabs = ((high_m - low_m) / slab_m).ceil() as usize + 4;
        let nearest_m = low_m - 1.5 * slab_m;
        let size = [rays.width, rays.height, slabs];
        let cell_m = depth.cell_px * footprint_m;
        let limbs = Limbs::new(person, plane, depth, &rays, footprint_m);
        let mut values = vec![0.0; size.iter().product()];
        let layer = rays.width * rays.height;
        let mut parts = Vec::new();
        for (cell, ray) in rays.rays.iter().enumerate() {
            let across_m = (f64::from(ray.coverage) / 255.0 - 0.5) * 4.0 * cell_m;
            parts.clear();
            match ray.surfaces_m {
                Some(surfaces) => limbs.parts(rays.pixel(depth, cell), surfaces, &mut parts),
                None => parts.push([f64::INFINITY, f64::NEG_INFINITY]),
            }
            for slab in 0..slabs {
                let at_m = nearest_m + slab as f64 * slab_m;
                let along_m = parts
                    .iter()
                    .map(|[front, back]| (at_m - front).min(back - at_m))
                    .fold(f64::NEG_INFINITY, f64::max);
                values[slab * layer + cell] = along_m.min(across_m).max(-1.0) as f32;
            }
        }
        Ok(Self { size, values, nearest_m, slab_m })
    }

    /// A volume of given samples.
    #[cfg(test)]
    pub(super) fn of_samples(size: [usize; 3], values: Vec<f32>) -> Self {
        Self { size, values, nearest_m: 0.0, slab_m: 1.0 }
    }

    /// A place of the grid as a cell of the depth map and a distance from the upright plane in metres.
    pub(super) fn place(&self, at: DVec3) -> (DVec2, f64) {
        (at.truncate() - 1.0, self.nearest_m + at.z * self.slab_m)
    }
}

/// What is known of one ray.
#[derive(Clone, Copy, Default)]
struct Ray {
    coverage: u8,
    /// First and last surface, metres from the upright plane.
    surfaces_m: Option<[f64; 2]>,
}

/// The cells of a depth map with a ring round them. Cells at the outline that are not inside have the mean surfaces of those inside beside them.
struct Rays {
    width: usize,
    height: usize,
    rays: Vec<Ray>,
}

impl Rays {
    fn read(depth: &DepthMap) -> Self {
        let (width, height) = (depth.width as usize + 2, depth.height as usize + 2);
        let mut rays = vec![Ray::default(); width * height];
        let own = |x: i64, y: i64| -> Option<[f64; 2]> {
            let [front, back] = depth.surfaces_m(x, y)?;
            let inside = front.abs() <= REACH_M && back >= front;
            // The thinnest parts are still a slab thick, so that none is lost between samples.
            inside.then(|| [front, back.min(REACH_M).max(front + 1.5 * SLAB_M)])
        };
        for (cell, ray) in rays.iter_mut().enumerate() {
            let (x, y) = ((cell % width) as i64 - 1, (cell / width) as i64 - 1);
            ray.coverage = depth.covered(x, y);
            ray.surfaces_m = own(x, y).or_else(|| {
                let beside: Vec<[f64; 2]> = (-1..=1)
                    .flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy)))
                    .filter_map(|(x, y)| own(x, y))
                    .collect();
                let mean = |side: usize| beside.iter().map(|s| s[side]).sum::<f64>() / beside.len() as f64;
                (!beside.is_empty()).then(|| [mean(0), mean(1)])
            });
        }
        Self { width, height, rays }
    }

    fn pixel(&self, depth: &DepthMap, cell: usize) -> DVec2 {
        depth.pixel(DVec2::new((cell % self.width) as f64 - 1.0, (cell / self.width) as f64 - 1.0))
    }

    /// Nearest first and farthest last surface.
    fn range(&self) -> (f64, f64) {
        let surfaces = self.rays.iter().filter_map(|ray| ray.surfaces_m);
        surfaces.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), [front, back]| {
            (low.min(front), high.max(back))
        })
    }
}

/// A ball of a limb.
struct Ball {
    pixel: DVec2,
    /// Distance from the upright plane, metres.
    offset_m: f64,
    radius_m: f64,
    /// Whether it may lie between the first and the last part of a ray. A leg across the sight is the one or the other; where the pose has it
    /// between them, it is wrong, and a curtain would hang there.
    fills: bool,
}

/// The skeleton as balls.
struct Limbs {
    balls: Vec<Ball>,
    footprint_m: f64,
}

impl Limbs {
    /// The limbs of a person at the distances of the surfaces: joints know their depth only from the hips.
    fn new(person: &Person, plane: &VirtualPlane, depth: &DepthMap, rays: &Rays, footprint_m: f64) -> Self {
        let view = View::from_camera(&plane.camera, plane.anchor_m);
        let skeleton = view.and_then(|view| Skeleton::of(&person.joints, view));
        let Some(skeleton) = skeleton else { return Self { balls: Vec::new(), footprint_m } };
        let balls = skeleton.limbs().iter().enumerate().flat_map(|(index, limb)| {
            let fills = index <= LAST_TRUNK_LIMB || limb.along_sight;
            (0..BALLS).map(move |k| {
                let share = k as f64 / (BALLS - 1) as f64;
                Ball { pixel: limb.at(share), offset_m: limb.depth_m(share), radius_m: limb.radius_m, fills }
            })
        });
        let balls = balls.collect();
        let mut limbs = Self { balls, footprint_m };
        limbs.shift(depth, rays);
        limbs
    }

    /// Moves all balls along the sight so that they lie in the middle of the body where it is one part thick.
    fn shift(&mut self, depth: &DepthMap, rays: &Rays) {
        let mut shifts: Vec<f64> = Vec::new();
        for (cell, ray) in rays.rays.iter().enumerate() {
            let Some([front, back]) = ray.surfaces_m.filter(|[f, b]| b - f < THICK_M) else { continue };
            let pixel = rays.pixel(depth, cell);
            let on: Vec<f64> = self.at(pixel).map(|(ball, _)| ball.offset_m).collect();
            if !on.is_empty() {
                shifts.push((front + back) / 2.0 - on.iter().sum::<f64>() / on.len() as f64);
            }
        }
        shifts.sort_by(f64::total_cmp);
        let shift = shifts.get(shifts.len() / 2).copied().unwrap_or(0.0);
        self.balls.iter_mut().for_each(|ball| ball.offset_m += shift);
    }

    /// The balls that a ray meets, and half the way through each, metres.
    fn at(&self, pixel: DVec2) -> impl Iterator<Item = (&Ball, f64)> {
        self.balls.iter().filter_map(move |ball| {
            let beside_m = ball.pixel.distance(pixel) * self.footprint_m;
            let half = ball.radius_m * ball.radius_m - beside_m * beside_m;
            (half > 0.0).then(|| (ball, half.sqrt()))
        })
    }

    /// The ball that a ray comes closest to.
    fn closest(&self, pixel: DVec2) -> Option<&Ball> {
        let edge_m = |ball: &Ball| ball.pixel.distance(pixel) * self.footprint_m - ball.radius_m;
        self.balls.iter().min_by(|a, b| edge_m(a).total_cmp(&edge_m(b)))
    }

    /// The stretches of a ray that are inside the body.
    fn parts(&self, pixel: DVec2, [front, back]: [f64; 2], parts: &mut Vec<[f64; 2]>) {
        // Where the skeleton passes beside a ray, the limb is like its closest part.
        let closest = self.closest(pixel);
        let slender = closest.is_some_and(|ball| !ball.fills) && self.at(pixel).all(|(ball, _)| !ball.fills);
        if back - front <= if slender { THICK_LIMB_M } else { THICK_M } {
            parts.push([front, back]);
            return;
        }
        let usual_m = closest.map_or(USUAL_RADIUS_M, |ball| ball.radius_m);
        let (mut nearest, mut farthest) = ((f64::INFINITY, usual_m), (f64::NEG_INFINITY, usual_m));
        for (&Ball { offset_m, radius_m, fills, .. }, half_m) in self.at(pixel) {
            let part = [(offset_m - half_m).max(front), (offset_m + half_m).min(back)];
            if fills && part[0] < part[1] {
                parts.push(part);
            }
            if offset_m < nearest.0 {
                nearest = (offset_m, radius_m);
            }
            if offset_m > farthest.0 {
                farthest = (offset_m, radius_m);
            }
        }
        parts.push([front, front + 2.0 * nearest.1]);
        parts.push([back - 2.0 * farthest.1, back]);
        parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
        // Parts that touch, or nearly, are one.
        let mut joined: Vec<[f64; 2]> = Vec::with_capacity(parts.len());
        for part in parts.drain(..) {
            match joined.last_mut() {
                Some(last) if part[0] <= last[1] + GAP_M => last[1] = last[1].max(part[1]),
                _ => joined.push(part),
            }
        }
        parts.extend(joined);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limbs(balls: &[(f64, f64)]) -> Limbs {
        let ball = |&(offset_m, radius_m): &(f64, f64)| Ball {
            pixel: DVec2::ZERO,
            offset_m,
            radius_m,
            fills: radius_m > 0.07,
        };
        Limbs { balls: balls.iter().map(ball).collect(), footprint_m: 0.02 }
    }

    fn parts(limbs: &Limbs, surfaces: [f64; 2]) -> Vec<[f64; 2]> {
        let mut parts = Vec::new();
        limbs.parts(DVec2::ZERO, surfaces, &mut parts);
        parts
    }

    #[test]
    fn a_thin_ray_is_one_part_and_legs_behind_each_other_are_two() {
        let legs = limbs(&[(-0.2, 0.06), (0.3, 0.06)]);
        assert_eq!(parts(&legs, [-0.1, 0.1]), vec![[-0.1, 0.1]]);
        let two = parts(&legs, [-0.27, 0.37]);
        assert_eq!(two.len(), 2, "{two:?}");
        // A leg that the pose puts in the middle does not join them.
        assert_eq!(parts(&limbs(&[(-0.2, 0.06), (0.05, 0.06), (0.3, 0.06)]), [-0.27, 0.37]).len(), 2);
        assert!(two[0][0] == -0.27 && two[0][1] < -0.1 && two[1][0] > 0.2 && two[1][1] == 0.37);
    }

    #[test]
    fn the_trunk_between_two_arms_stays() {
        let all = limbs(&[(-0.25, 0.05), (-0.1, 0.1), (0.0, 0.12), (0.1, 0.1), (0.28, 0.05)]);
        let whole = parts(&all, [-0.3, 0.33]);
        assert_eq!(whole.len(), 1, "{whole:?}");
        assert_eq!(whole[0], [-0.3, 0.33]);
    }

    #[test]
    fn without_a_skeleton_the_middle_of_a_deep_ray_is_air() {
        let none = parts(&limbs(&[]), [-0.5, 0.5]);
        assert_eq!(none.len(), 2);
    }
}
