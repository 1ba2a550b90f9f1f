//! Light for a match, drawn at random: floodlight masts, lamps along the roofs, sun, clouds.

use std::f32::consts::{PI, TAU};

use glam::Vec3;
use rand::Rng;

use crate::paint::Lights;

/// The light of a match.
pub(crate) struct Sky {
    /// On the pitch.
    pub(crate) lights: Lights,
    /// Whether its lamp is the sun.
    pub(crate) sunny: bool,
    /// Seen over the roofs.
    pub(crate) above: Vec3,
    /// Brightness of the stands.
    pub(crate) stands: f32,
}

/// One of four kinds of light.
pub(crate) fn light(rng: &mut impl Rng) -> Sky {
    let grass = Vec3::new(0.17, 0.20, 0.11);
    match rng.random_range(0..20) {
        // Four masts: four soft shadows.
        0..5 => {
            let mut lights = Lights::floodlights();
            let (far, strength) = (rng.random_range(0.85..1.3f32), rng.random_range(0.85..1.15f32));
            for (towards, colour) in &mut lights.lamps {
                *towards = Vec3::new(towards.x * far, towards.y, towards.z).normalize();
                *colour *= strength * rng.random_range(0.8..1.2f32);
            }
            Sky {
                lights,
                sunny: false,
                above: Vec3::new(0.006, 0.008, 0.014),
                stands: rng.random_range(0.3..0.75),
            }
        }
        // Lamps along the roofs: light from all sides, hardly a shadow.
        5..9 => {
            let lamp = |x: f32, z: f32| (Vec3::new(x, 38.0, z).normalize(), Vec3::splat(0.085));
            let lamps = [(55.0, 52.0), (-55.0, 52.0), (55.0, -52.0), (-55.0, -52.0)].map(|(x, z)| lamp(x, z));
            let lights = Lights { lamps: lamps.to_vec(), sky: Vec3::new(0.68, 0.70, 0.73), bounce: grass };
            Sky {
                lights,
                sunny: false,
                above: Vec3::new(0.006, 0.008, 0.014),
                stands: rng.random_range(0.3..0.8),
            }
        }
        // Sun.
        9..15 => {
            let (around, high) = (rng.random_range(0.0..TAU), rng.random_range(0.28..1.1f32));
            let direction = Vec3::new(around.cos() * high.cos(), high.sin(), around.sin() * high.cos());
            let warm = 1.0 - 0.25 * (1.0 - high / 1.1);
            let strength = rng.random_range(0.75..1.15f32);
            // The camera is set so that sunlit grass is well exposed: a low sun lights level ground less.
            let level = (0.55 * strength / high.sin()).min(1.4);
            let lights = Lights {
                lamps: vec![(
                    direction,
                    Vec3::new(1.0, 0.6 + 0.4 * warm * 0.97, 0.35 + 0.6 * warm * 0.92) * level,
                )],
                sky: Vec3::new(0.25, 0.29, 0.36) * rng.random_range(0.7..1.3f32),
                bounce: grass,
            };
            Sky {
                lights,
                sunny: true,
                above: Vec3::new(0.42, 0.58, 0.85),
                stands: rng.random_range(0.3..0.7),
            }
        }
        // Clouds.
        _ => {
            let bright = rng.random_range(0.75..1.0f32);
            let lights = Lights {
                lamps: vec![(
                    Vec3::new(rng.random_range(-0.4..0.4f32), 1.0, (rng.random_range(0.0..PI)).cos() * 0.4)
                        .normalize(),
                    Vec3::splat(0.10),
                )],
                sky: Vec3::new(0.78, 0.82, 0.88) * bright,
                bounce: grass,
            };
            Sky {
                lights,
                sunny: false,
                above: Vec3::new(0.72, 0.76, 0.80),
                stands: rng.random_range(0.4..0.85),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn suns_are_up_and_every_kind_of_light_comes() {
        let rng = &mut Pcg64Mcg::seed_from_u64(2);
        let (mut sunny, mut night) = (0, 0);
        for _ in 0..200 {
            let sky = light(rng);
            assert!(sky.lights.lamps.iter().all(|(towards, _)| towards.y > 0.2 && towards.is_normalized()));
            sunny += usize::from(sky.sunny);
            night += usize::from(sky.above.y < 0.1);
        }
        assert!((40..90).contains(&sunny) && (60..120).contains(&night), "{sunny} sunny, {night} at night");
    }
}
