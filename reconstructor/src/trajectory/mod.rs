//! Section 4.5: smooth paths on the pitch.
//!
//! Per person the paper's energy, Σ ‖X_t − D_t‖² over the frames with a sighting plus w·Σ ‖X_{t−1} − 2X_t + X_{t+1}‖² over
//! all frames, is the linear system it is. Bodies move by what smoothing moved their anchor. Poses are smoothed along the
//! tracks too ([`smooth_poses`]), before anything is made of them.

mod poses;

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use protocol::manifest::PersonId;
use thiserror::Error;

use crate::{banded::Banded, mesh::BodySurface};
pub use poses::{PoseChanges, smooth_poses};

/// How strongly paths are smoothed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothing {
    /// Movements quicker than about this are taken for jitter, seconds. The paper's weight 1 is one frame.
    pub seconds: f64,
}

impl Default for Smoothing {
    fn default() -> Self {
        Self { seconds: 0.12 }
    }
}

impl Smoothing {
    /// The weight `w` of the second differences at a frame rate. A wave of angular frequency ω per frame is damped to
    /// 1 / (1 + w·ω⁴), so `w` is the fourth power of the time in frames.
    #[must_use]
    pub fn weight(self, frames_per_second: f64) -> f64 {
        (self.seconds * frames_per_second).max(0.0).powi(4)
    }
}

/// Why a path cannot be smoothed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum TrajectoryError {
    /// The system has no unique solution.
    #[error(
        "{sightings} usable positions do not fix a path of {frames} frames; the person needs at least two"
    )]
    Underdetermined {
        /// Frames that have a position.
        sightings: usize,
        /// Frames of the path.
        frames: usize,
    },
}

/// Minimises the paper's energy over one path. `measured` holds one position per frame in pitch metres (world x, world z),
/// `None` where the person was not seen; the result has a position for every frame.
///
/// # Errors
/// [`TrajectoryError::Underdetermined`] when fewer than two frames of a longer path have a finite position.
pub fn smooth(measured: &[Option<DVec2>], weight: f64) -> Result<Vec<DVec2>, TrajectoryError> {
    let frames = measured.len();
    let data: Vec<Option<DVec2>> = measured.iter().map(|m| m.filter(|p| p.is_finite())).collect();
    let sightings = data.iter().flatten().count();
    let underdetermined = TrajectoryError::Underdetermined { sightings, frames };
    if sightings < frames.min(2) {
        return Err(underdetermined);
    }
    // With no weight, gaps would be free: a little is enough to make them straight.
    let weight = if sightings < frames { weight.max(1e-6) } else { weight.max(0.0) };
    let seen: Vec<f64> = data.iter().map(|m| if m.is_some() { 1.0 } else { 0.0 }).collect();
    let mut system = Banded::diagonal(&seen, 2);
    for first in 0..frames.saturating_sub(2) {
        system.add_outer(&[(first, 1.0), (first + 1, -2.0), (first + 2, 1.0)], weight);
    }
    let factor = system.cholesky().ok_or(underdetermined)?;
    let solve = |axis: fn(DVec2) -> f64| {
        let mut right: Vec<f64> = data.iter().map(|m| m.map_or(0.0, axis)).collect();
        factor.solve(&mut right);
        right
    };
    let (x, z) = (solve(|p| p.x), solve(|p| p.y));
    Ok(x.into_iter().zip(z).map(|(x, z)| DVec2::new(x, z)).collect())
}

/// The smooth path of one person on the pitch, in parts between which nothing is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path {
    /// First frame and the places from there on, in order of time.
    parts: Vec<(usize, Vec<DVec2>)>,
}

impl Path {
    /// The path through `sightings` (index in `ClipInfo::frames`, anchor in world metres).
    ///
    /// # Errors
    /// As [`smooth`].
    pub fn through(sightings: &BTreeMap<usize, DVec3>, weight: f64) -> Result<Self, TrajectoryError> {
        let nothing = TrajectoryError::Underdetermined { sightings: 0, frames: 0 };
        let (first_frame, _) = sightings.first_key_value().ok_or(nothing)?;
        let (last_frame, _) = sightings.last_key_value().ok_or(nothing)?;
        let measured: Vec<Option<DVec2>> = (*first_frame..=*last_frame)
            .map(|frame| sightings.get(&frame).map(|anchor| DVec2::new(anchor.x, anchor.z)))
            .collect();
        Ok(Self { parts: vec![(*first_frame, smooth(&measured, weight)?)] })
    }

    /// The path through parts that are smoothed each on its own, in order of time, such as the shots of a clip.
    ///
    /// # Errors
    /// As [`smooth`], when that fails for all parts; a part that fails alone is left out.
    pub fn through_parts<'a>(
        parts: impl Iterator<Item = &'a BTreeMap<usize, DVec3>>,
        weight: f64,
    ) -> Result<Self, TrajectoryError> {
        let mut path = Self::default();
        let mut failed = TrajectoryError::Underdetermined { sightings: 0, frames: 0 };
        for part in parts {
            match Self::through(part, weight) {
                Ok(mut more) => path.parts.append(&mut more.parts),
                Err(error) => failed = error,
            }
        }
        if path.parts.is_empty() { Err(failed) } else { Ok(path) }
    }

    /// Where the person stands at a frame, world metres on the pitch; `None` outside the path.
    #[must_use]
    pub fn at(&self, frame: usize) -> Option<DVec3> {
        let part = self.parts.partition_point(|(first, _)| *first <= frame).checked_sub(1)?;
        let (first, positions_m) = self.parts.get(part)?;
        let position = positions_m.get(frame - first)?;
        Some(DVec3::new(position.x, 0.0, position.y))
    }
}

/// Moves surfaces onto their persons' paths: each by smoothed − measured anchor. Surfaces without a path stay.
pub fn place(surfaces: &mut [BodySurface], paths: &BTreeMap<PersonId, Path>) {
    for surface in surfaces {
        if let Some(anchor_m) = paths.get(&surface.person).and_then(|path| path.at(surface.frame)) {
            // The mesh is relative to its anchor, so it comes along.
            surface.anchor_m = anchor_m;
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    use super::*;

    /// The same energy as a dense least-squares system.
    fn dense(measured: &[Option<DVec2>], weight: f64) -> Vec<DVec2> {
        let n = measured.len();
        let mut a = DMatrix::<f64>::zeros(n, n);
        let (mut bx, mut bz) = (DVector::<f64>::zeros(n), DVector::<f64>::zeros(n));
        for (t, m) in measured.iter().enumerate() {
            if let Some(m) = m {
                a[(t, t)] += 1.0;
                (bx[t], bz[t]) = (m.x, m.y);
            }
        }
        for t in 1..n - 1 {
            let mut d = DVector::<f64>::zeros(n);
            (d[t - 1], d[t], d[t + 1]) = (1.0, -2.0, 1.0);
            a += weight * &d * d.transpose();
        }
        let lu = a.lu();
        let (x, z) = (lu.solve(&bx).unwrap(), lu.solve(&bz).unwrap());
        (0..n).map(|t| DVec2::new(x[t], z[t])).collect()
    }

    /// Positions with gaps, both ends seen.
    fn walks() -> impl Strategy<Value = Vec<Option<DVec2>>> {
        let step = (prop::bool::weighted(0.7), -60.0..60.0_f64, -40.0..40.0_f64);
        prop::collection::vec(step, 3..60).prop_map(|steps| {
            let last = steps.len() - 1;
            steps
                .iter()
                .enumerate()
                .map(|(t, &(seen, x, z))| (seen || t == 0 || t == last).then_some(DVec2::new(x, z)))
                .collect()
        })
    }

    proptest! {
        #[test]
        fn the_banded_solution_is_the_dense_one(walk in walks(), weight in 0.01..500.0_f64) {
            let ours = smooth(&walk, weight).unwrap();
            for (a, b) in ours.iter().zip(dense(&walk, weight)) {
                prop_assert!(a.distance(b) < 1e-6, "{a} against {b}");
            }
        }

        #[test]
        fn straight_motion_stays_as_it_is(
            from in (-50.0..50.0_f64, -30.0..30.0_f64),
            step in (-0.4..0.4_f64, -0.4..0.4_f64),
            seen in prop::collection::vec(any::<bool>(), 1..80),
            weight in 0.0..10_000.0_f64,
        ) {
            let at = |t: usize| DVec2::from(from) + DVec2::from(step) * t as f64;
            let mut measured: Vec<_> = seen.iter().enumerate().map(|(t, s)| s.then_some(at(t))).collect();
            measured.insert(0, Some(at(0)));
            measured.iter_mut().enumerate().skip(1).for_each(|(t, m)| *m = m.map(|_| at(t)));
            measured.push(Some(at(measured.len())));
            let smoothed = smooth(&measured, weight).unwrap();
            for (t, position) in smoothed.iter().enumerate() {
                prop_assert!(position.distance(at(t)) < 1e-4, "frame {t}: {position} against {}", at(t));
            }
        }
    }

    /// A runner who turns within two seconds, measured with noise of known size.
    #[test]
    fn jitter_shrinks_and_the_turn_stays() {
        let truth = |t: usize| {
            let angle = t as f64 / 30.0 * std::f64::consts::PI / 2.0;
            DVec2::new(6.0 * angle.cos(), 6.0 * angle.sin())
        };
        let mut state = 7_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5) * 0.6
        };
        let measured: Vec<_> = (0..120).map(|t| Some(truth(t) + DVec2::new(noise(), noise()))).collect();
        let smoothed = smooth(&measured, Smoothing::default().weight(30.0)).unwrap();
        let error = |path: &mut dyn Iterator<Item = DVec2>| {
            (path.enumerate().map(|(t, p)| p.distance_squared(truth(t))).sum::<f64>() / 120.0).sqrt()
        };
        let before = error(&mut measured.iter().map(|m| m.unwrap()));
        let after = error(&mut smoothed.iter().copied());
        assert!(after < before / 2.0, "{before} became {after}");
    }

    #[test]
    fn one_sighting_stands_and_none_is_refused() {
        assert_eq!(smooth(&[Some(DVec2::ONE)], 10.0), Ok(vec![DVec2::ONE]));
        let lost = smooth(&[None, Some(DVec2::ONE), None], 10.0);
        assert_eq!(lost, Err(TrajectoryError::Underdetermined { sightings: 1, frames: 3 }));
        let broken = smooth(&[Some(DVec2::NAN), None], 1.0);
        assert!(broken.is_err());
    }

    #[test]
    fn a_path_knows_its_frames() {
        let sightings = BTreeMap::from([(4, DVec3::ZERO), (8, DVec3::new(4.0, 0.0, 2.0))]);
        let path = Path::through(&sightings, 20.0).unwrap();
        assert_eq!(path.at(3), None);
        assert!(path.at(6).unwrap().distance(DVec3::new(2.0, 0.0, 1.0)) < 1e-6);
        assert_eq!(path.at(9), None);
    }

    #[test]
    fn parts_do_not_pull_at_each_other() {
        let part = |frame: usize, x: f64| (frame..frame + 5).map(|f| (f, DVec3::new(x, 0.0, 1.0))).collect();
        let parts: [BTreeMap<usize, DVec3>; 2] = [part(2, 0.0), part(7, 3.0)];
        let path = Path::through_parts(parts.iter(), 200.0).unwrap();
        assert!(path.at(6).unwrap().x.abs() < 1e-9 && (path.at(7).unwrap().x - 3.0).abs() < 1e-9);
        assert_eq!((path.at(1), path.at(12)), (None, None));
        assert!(Path::through_parts([].iter(), 1.0).is_err());
    }
}
