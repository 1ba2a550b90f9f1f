//! The main camera: on a tripod over the halfway line, panning and zooming after the play, horizon level, no distortion.

use glam::{DVec3, Vec2, Vec3};
use protocol::camera::Camera;

use crate::trajectories::{Path2, smooth};

/// Where the main camera stands and how it frames the play.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tripod {
    /// World metres.
    pub position: DVec3,
    /// Wanted height of a player of 1.80 m at the middle of the picture, as a share of the picture's height.
    pub player_share: f64,
}

impl Default for Tripod {
    fn default() -> Self {
        Self { position: DVec3::new(0.0, 17.0, 62.0), player_share: 0.088 }
    }
}

/// One camera per sample of the paths.
#[must_use]
pub fn follow(
    tripod: &Tripod,
    size_px: (u32, u32),
    ball: &[Vec3],
    people: &[Path2],
    rate_hz: f32,
) -> Vec<Camera> {
    // The operator looks at the ball and at the people near it, late and smoothly.
    let aims: Vec<Vec2> = ball
        .iter()
        .enumerate()
        .map(|(k, ball)| {
            let at = Vec2::new(ball.x, ball.z);
            let (mut sum, mut weights) = (at * 4.5, 4.5);
            for person in people.iter().filter(|person| person.team.is_some()) {
                let weight = (-(person.xz[k].distance(at) / 14.0).powi(2)).exp();
                sum += person.xz[k] * weight;
                weights += weight;
            }
            let aim = sum / weights;
            Vec2::new(aim.x.clamp(-45.0, 45.0), (aim.y * 0.55).clamp(-16.0, 13.0))
        })
        .collect();
    let aims = smooth(&aims, 0.55 * rate_hz);
    aims.iter()
        .enumerate()
        .map(|(k, aim)| {
            let target = DVec3::new(f64::from(aim.x), 0.6, f64::from(aim.y));
            let distance = tripod.position.distance(target);
            // A slow breath of the zoom on top of keeping the size.
            let breath = 1.0 + 0.025 * (k as f64 / f64::from(rate_hz) * 0.9).sin();
            let focal = tripod.player_share * f64::from(size_px.1) * distance / 1.8 * breath;
            Camera::looking_at(size_px, focal, tripod.position, target)
        })
        .collect()
}
