//! Depth that does not flicker: a player's surfaces, steadied with those of the frames before and after.
//!
//! A player moves between frames, so places are found again by the pose: a cell belongs to the limb that is painted there, and is
//! compared with the same place beside that limb in the other frames, as far before or behind it. What a limb does, the joints say
//! (they are smoothed along the track); what is filtered is the surface round it. Fast limbs stay sharp.

use glam::DVec2;

use super::{
    DepthMap, View,
    map::millimetres,
    skeleton::{Side, Skeleton},
};
use crate::pose::Joint;

/// Surfaces this far from the middle one of all frames do not count, metres: there another limb covers the place.
const REJECT_M: f64 = 0.1;
/// Weight of a frame one step away, of that of the frame itself; two steps away it is the square.
const STEP_WEIGHT: f64 = 0.8;

/// One frame of a track.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// Frames from the one that is steadied.
    pub steps: i32,
    /// What the network said.
    pub map: &'a DepthMap,
    /// The pose.
    pub joints: &'a [Joint],
    /// How the camera sees the player.
    pub view: View,
}

/// The depth map of `own`, steadied with the frames `around`. Its outline stays. What cannot be found again stays as it is.
#[must_use]
pub fn steady(own: &Moment<'_>, around: &[Moment<'_>]) -> DepthMap {
    let mut map = own.map.clone();
    let Some(skeleton) = Skeleton::of(own.joints, own.view) else { return map };
    let others: Vec<(&Moment<'_>, Skeleton)> = around
        .iter()
        .filter(|moment| moment.map.is_whole())
        .filter_map(|moment| Some((moment, Skeleton::of(moment.joints, moment.view)?)))
        .collect();
    if others.is_empty() || !map.is_whole() {
        return map;
    }
    let columns = map.width.max(1) as usize;
    let mut values: [Vec<(f64, f64)>; 2] = Default::default();
    for cell in 0..map.coverage.len() {
        let (column, row) = ((cell % columns) as i64, (cell / columns) as i64);
        let Some(surfaces_m) = own.map.surfaces_m(column, row) else { continue };
        let pixel = map.pixel(DVec2::new(column as f64, row as f64));
        let Some(place) = skeleton.place(pixel, Side::Front) else { continue };
        for (values, surface_m) in values.iter_mut().zip(surfaces_m) {
            values.clear();
            values.push((surface_m, 1.0));
        }
        for (moment, skeleton) in &others {
            let Some((pixel, limb_m)) = skeleton.pixel(&place) else { continue };
            let Some(there_m) = moment.map.surfaces_at(pixel) else { continue };
            let weight = STEP_WEIGHT.powi(moment.steps.abs());
            for (values, there_m) in values.iter_mut().zip(there_m) {
                values.push((there_m - limb_m + place.limb_m, weight));
            }
        }
        let [front, back] = [0, 1].map(|side| millimetres(middle(&mut values[side])));
        if let (Some(front_mm), Some(back_mm)) = (map.front_mm.get_mut(cell), map.back_mm.get_mut(cell)) {
            (*front_mm, *back_mm) = (front, back.max(front));
        }
    }
    map
}

/// The weighted mean of what lies near the weighted median.
fn middle(values: &mut [(f64, f64)]) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = values.iter().map(|(_, weight)| weight).sum::<f64>() / 2.0;
    let mut sum = 0.0;
    let median = values.iter().find(|(_, weight)| {
        sum += weight;
        sum >= half
    });
    let median = median.map_or(0.0, |(value, _)| *value);
    let near = values.iter().filter(|(value, _)| (value - median).abs() <= REJECT_M);
    let (sum, weight) =
        near.fold((0.0, 0.0), |(sum, all), (value, weight)| (sum + value * weight, all + weight));
    if weight > 0.0 { sum / weight } else { median }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::JOINTS;

    const VIEW: View = View { pixels_per_metre: 40.0, descent: 0.0 };

    /// Somebody upright at column `x`, whose left leg stands `forward` metres before him.
    fn pose(x: f64, forward: f64) -> Vec<Joint> {
        let joint = |i: usize| {
            let side = if i % 2 == 1 { 6.0 } else { -6.0 };
            let (dx, y) = match i {
                0..=10 => (0.0, 14.0),
                11 | 12 => (side, 20.0),
                13..=22 => (1.4 * side, 40.0),
                23 | 24 => (side, 48.0),
                25 | 26 => (side, 66.0),
                _ => (side, 84.0),
            };
            let before = if i >= 25 && i % 2 == 1 { forward } else { 0.0 };
            Joint { pixel: DVec2::new(x + dx, y), depth_m: -before as f32, visibility: 1.0 }
        };
        (0..JOINTS).map(joint).collect()
    }

    /// A map of 40×90 cells with its middle at column `x`: each cell `surface(column − 20, row)` before and 0.2 m behind that.
    fn map(x: f64, surface: impl Fn(f64, f64) -> f64) -> DepthMap {
        let cell = |i: usize| millimetres(surface((i % 40) as f64 - 20.0, (i / 40) as f64));
        let front_mm: Vec<i16> = (0..3600).map(cell).collect();
        DepthMap {
            first_px: DVec2::new(x - 20.0, 0.0),
            cell_px: 1.0,
            width: 40,
            height: 90,
            coverage: vec![255; 3600],
            back_mm: front_mm.iter().map(|mm| mm + 200).collect(),
            front_mm,
        }
    }

    #[test]
    fn shaking_shrinks_while_the_player_runs_across() {
        // He runs by 5 pixels a frame while his leg comes forward by 0.1 m a frame; each frame is off by a few centimetres.
        let off = [0.03, -0.03, 0.04, 0.01, -0.05];
        let truth = |frame: usize, column: f64, row: f64| {
            let leg = if row >= 67.0 && column > 0.0 { -0.1 * frame as f64 } else { 0.0 };
            0.002 * column + leg
        };
        let poses: Vec<Vec<Joint>> = (0..5).map(|f| pose(100.0 + 5.0 * f as f64, 0.1 * f as f64)).collect();
        let maps: Vec<DepthMap> =
            (0..5).map(|f| map(100.0 + 5.0 * f as f64, |x, y| truth(f, x, y) + off[f])).collect();
        let moment = |f: usize| Moment { steps: f as i32 - 2, map: &maps[f], joints: &poses[f], view: VIEW };
        let steadied = steady(&moment(2), &[0, 1, 3, 4].map(moment));
        for (column, row) in [(0.0, 30.0), (7.0, 80.0), (-7.0, 80.0)] {
            let [front, back] = steadied.surfaces_m(column as i64 + 20, row as i64).unwrap();
            let error = front - truth(2, column, row);
            assert!(error.abs() < 0.015, "{error} at {column}, {row}");
            assert!((back - front - 0.2).abs() < 0.002);
        }
        assert_eq!(steadied.coverage, maps[2].coverage);
    }

    #[test]
    fn one_frame_that_is_all_wrong_does_not_count_and_alone_nothing_changes() {
        let poses = pose(100.0, 0.0);
        let maps: Vec<DepthMap> = [0.0, 0.0, 0.6, 0.0].iter().map(|off| map(100.0, |_, _| *off)).collect();
        let moment = |f: usize| Moment { steps: f as i32 - 1, map: &maps[f], joints: &poses, view: VIEW };
        let steadied = steady(&moment(2), &[0, 1, 3].map(moment));
        assert!(steadied.front_mm.iter().all(|mm| mm.abs() <= 1));
        assert_eq!(steady(&moment(2), &[]), maps[2]);
        let broken = Moment { joints: &poses[..3], ..moment(2) };
        assert_eq!(steady(&broken, &[moment(0)]), maps[2]);
        let damaged = DepthMap { front_mm: Vec::new(), ..maps[1].clone() };
        assert_eq!(steady(&moment(0), &[Moment { map: &damaged, ..moment(1) }]), maps[0]);
    }
}
