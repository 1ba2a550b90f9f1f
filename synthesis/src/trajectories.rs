//! Where everybody and the ball are over time: read from a recording, or generated when there is none.
//! World metres: x along the touchline, z towards the main camera, y up.

use std::path::Path;

use glam::{Vec2, Vec3};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

use crate::SynthesisError;

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
    /// Reads a JSON file (see `assets/demo/README.md` for the form).
    pub fn open(path: &Path) -> Result<Self, SynthesisError> {
        let bytes = std::fs::read(path).map_err(|source| SynthesisError::Io {
            path: path.to_owned(),
            doing: "read",
            source,
        })?;
        let broken = |reason: String| SynthesisError::Asset { what: path.display().to_string(), reason };
        let all: Self = serde_json::from_slice(&bytes).map_err(|error| broken(error.to_string()))?;
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

    /// Paths of a made-up spell of play: two lines of four-four-two that follow a ball passed among them.
    #[must_use]
    pub fn generated(seed: u64, seconds: f64) -> Self {
        const FORMATION: [[f32; 2]; 11] = [
            [-48.0, 0.0],
            [-28.0, -21.0],
            [-31.0, -7.0],
            [-31.0, 7.0],
            [-28.0, 21.0],
            [-10.0, -23.0],
            [-13.0, -7.0],
            [-13.0, 8.0],
            [-9.0, 22.0],
            [4.0, -6.0],
            [6.0, 7.0],
        ];
        let rng = &mut Pcg64Mcg::seed_from_u64(seed);
        let rate_hz = 50.0;
        let samples = (seconds * rate_hz).ceil() as usize + 2;
        let mut pass = vec![Vec2::new(rng.random_range(-8.0..8.0), rng.random_range(-12.0..12.0))];
        while pass.len() < samples / 60 + 4 {
            let last = pass[pass.len() - 1];
            let next = last + Vec2::new(rng.random_range(-13.0..17.0), rng.random_range(-13.0..13.0));
            pass.push(next.clamp(Vec2::new(-44.0, -30.0), Vec2::new(44.0, 30.0)));
        }
        let ball: Vec<Vec3> = (0..samples)
            .map(|k| {
                let (leg, part) = (k / 60, (k % 60) as f32 / 60.0);
                let moved = (part * 1.6).min(1.0);
                let eased = 1.0 - (1.0 - moved) * (1.0 - moved);
                let at = pass[leg].lerp(pass[leg + 1], eased);
                Vec3::new(at.x, 0.11, at.y)
            })
            .collect();
        let mut people = Vec::new();
        for team in 0..2u8 {
            let side = if team == 0 { 1.0 } else { -1.0 };
            for (index, place) in FORMATION.iter().enumerate() {
                let keeper = index == 0;
                let home = Vec2::new(place[0] * side, place[1])
                    + Vec2::new(rng.random_range(-2.0..2.0), rng.random_range(-2.0..2.0));
                let (pace, turn) = (rng.random_range(0.15..0.4f32), rng.random_range(0.0..6.0f32));
                let mut at = home;
                let mut velocity = Vec2::ZERO;
                let xz = ball
                    .iter()
                    .enumerate()
                    .map(|(k, ball)| {
                        let ball = Vec2::new(ball.x, ball.z);
                        let follow = if keeper { Vec2::new(0.05, 0.08) } else { Vec2::new(0.62, 0.38) };
                        let roam =
                            Vec2::from_angle(turn + k as f32 / 50.0 * pace) * if keeper { 0.6 } else { 2.6 };
                        let wanted = home + ball * follow + roam;
                        let pull = (wanted - at) * 1.1 - velocity * 1.9;
                        velocity = (velocity + pull.clamp_length_max(4.0) / 50.0).clamp_length_max(7.4);
                        at += velocity / 50.0;
                        at
                    })
                    .collect();
                people.push(Path2 {
                    role: if keeper { Role::Goalkeeper } else { Role::Player },
                    team: Some(team),
                    number: Some(index as u8 + 1),
                    xz,
                });
            }
        }
        let official = |role: Role, place: &dyn Fn(Vec2, f32) -> Vec2| Path2 {
            role,
            team: None,
            number: None,
            xz: ball.iter().enumerate().map(|(k, b)| place(Vec2::new(b.x, b.z), k as f32 / 50.0)).collect(),
        };
        people.push(official(Role::Referee, &|b, t| {
            b * 0.55 + Vec2::new(-7.0, 5.0) + Vec2::from_angle(t * 0.2)
        }));
        people.push(official(Role::Assistant, &|b, _| Vec2::new((b.x * 0.6 + 14.0).clamp(0.0, 52.0), -35.2)));
        people.push(official(Role::Assistant, &|b, _| Vec2::new((b.x * 0.6 - 14.0).clamp(-52.0, 0.0), 35.2)));
        let mut all = Self { rate_hz, people, ball };
        all.people.iter_mut().for_each(|person| person.xz = smooth(&person.xz, 15.0));
        all
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
    fn a_generated_spell_has_22_players_and_3_officials_at_human_speeds() {
        let all = Trajectories::generated(3, 6.0);
        assert_eq!(all.people.iter().filter(|p| p.team.is_some()).count(), 22);
        assert_eq!(all.people.iter().filter(|p| p.team.is_none()).count(), 3);
        for person in &all.people {
            let fastest = person.xz.windows(2).map(|w| w[0].distance(w[1]) * 50.0).fold(0.0, f32::max);
            assert!(fastest < 12.0, "{:?} runs {fastest} m/s", person.role);
        }
    }

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
