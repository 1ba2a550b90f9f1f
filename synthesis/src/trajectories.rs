//! Where everybody and the ball are over time: read from a recording, or generated when there is none.
//! World metres: x along the touchline, z towards the main camera, y up.

use std::path::Path;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::{SynthesisError, recordings};

/// What somebody does on the pitch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)] // the names say it
pub enum Role {
    Player,
    Goalkeeper,
    Referee,
    Assistant,
}

/// One person's path.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Path2 {
    /// What the person does.
    pub role: Role,
    /// Team 0 or 1; `None` for officials.
    pub team: Option<u8>,
    /// Shirt number.
    pub number: Option<u8>,
    /// Position (x, z) at every sample.
    pub xz: Vec<Vec2>,
}

/// Everybody's path at a fixed rate.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trajectories {
    /// Samples per second.
    pub rate_hz: f64,
    /// People.
    pub people: Vec<Path2>,
    /// The ball's middle at every sample.
    pub ball: Vec<Vec3>,
}

/// Most people and samples that a file may hold.
const MOST_PEOPLE: usize = 100;
const MOST_SAMPLES: usize = 1_000_000;

impl Trajectories {
    /// Reads a JSON file (see `assets/demo/README.md` for the form), or a table of [`crate::recordings`] whose name ends
    /// in `.csv`.
    pub fn open(path: &Path) -> Result<Self, SynthesisError> {
        let bytes = std::fs::read(path).map_err(|source| SynthesisError::Io {
            path: path.to_owned(),
            doing: "read",
            source,
        })?;
        let broken = |reason: String| SynthesisError::Asset { what: path.display().to_string(), reason };
        let all: Self = if path.extension().is_some_and(|extension| extension == "csv") {
            recordings::last_row(&String::from_utf8_lossy(&bytes), &path.display().to_string())?
        } else {
            serde_json::from_slice(&bytes).map_err(|error| broken(error.to_string()))?
        };
        let samples = all.ball.len();
        let sizes = (2..=MOST_SAMPLES).contains(&samples) && (1..=MOST_PEOPLE).contains(&all.people.len());
        if !sizes || all.people.iter().any(|p| p.xz.len() != samples) {
            return Err(broken(
                "the ball and every person need the same number of samples, at least 2".into(),
            ));
        }
        let finite = all.ball.iter().all(|p| p.is_finite() && p.length() < 1e3)
            && all.people.iter().flat_map(|p| &p.xz).all(|p| p.is_finite() && p.length() < 1e3);
        if !finite || !(1.0..=1000.0).contains(&all.rate_hz) {
            return Err(broken(
                "a position is not a number within 1 km, or the rate is not 1..1000 Hz".into(),
            ));
        }
        Ok(all)
    }

    /// Paths of a made-up spell of play (see [`crate::generated`]).
    #[must_use]
    pub fn generated(seed: u64, seconds: f64) -> Self {
        crate::generated::generated(seed, seconds)
    }

    /// The same paths at another rate, from `start_seconds` on, `count` samples; ends are held.
    #[must_use]
    pub fn resampled(&self, start_seconds: f64, rate_hz: f64, count: usize) -> Self {
        let place = |k: usize| (start_seconds + k as f64 / rate_hz) * self.rate_hz;
        let mix = |k: usize, samples: usize| {
            let at = place(k).clamp(0.0, (samples - 1) as f64);
            let first = (at as usize).min(samples - 2);
            (first, (at - first as f64) as f32)
        };
        let sigma = (0.14 * self.rate_hz) as f32; // recordings shiver by some centimetres
        let people = self
            .people
            .iter()
            .map(|person| {
                let calm = smooth(&person.xz, sigma);
                let xz = (0..count)
                    .map(|k| {
                        let (first, share) = mix(k, calm.len());
                        calm[first].lerp(calm[first + 1], share)
                    })
                    .collect();
                Path2 { xz, ..person.clone() }
            })
            .collect();
        let ball = (0..count)
            .map(|k| {
                let (first, share) = mix(k, self.ball.len());
                let at = self.ball[first].lerp(self.ball[first + 1], share);
                Vec3::new(at.x, at.y.max(0.11), at.z)
            })
            .collect();
        Self { rate_hz, people, ball }
    }
}

/// Gaussian mean over time, `sigma` samples wide; ends are held.
#[must_use]
pub fn smooth(path: &[Vec2], sigma: f32) -> Vec<Vec2> {
    let radius = (sigma * 3.0).ceil() as isize;
    let weights: Vec<f32> =
        (-radius..=radius).map(|k| (-(k as f32 / sigma.max(1e-3)).powi(2) / 2.0).exp()).collect();
    let total: f32 = weights.iter().sum();
    let last = path.len() as isize - 1;
    (0..=last)
        .map(|k| {
            let sum: Vec2 = weights
                .iter()
                .enumerate()
                .map(|(w, weight)| path[(k + w as isize - radius).clamp(0, last) as usize] * *weight)
                .sum();
            sum / total
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_of_different_lengths_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("t.json");
        let good = r#"{"rate_hz":50,"people":[{"role":"player","team":0,"number":4,"xz":[[0,0],[1,0]]}],"ball":[[0,0,0],[1,0,0]]}"#;
        std::fs::write(&file, good).unwrap();
        assert_eq!(Trajectories::open(&file).unwrap().people.len(), 1);
        for bad in [
            good.replace("[[0,0],[1,0]]", "[[0,0]]"),
            good.replace("50", "0"),
            good.replace("[0,0],", "[1e9,0],"),
        ] {
            std::fs::write(&file, bad).unwrap();
            assert!(Trajectories::open(&file).is_err());
        }
    }
}
