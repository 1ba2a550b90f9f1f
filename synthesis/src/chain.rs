//! Everything between the light and the viewer that a broadcast adds: shutter, lens and sensor, and the encoder's bitrate.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::{sensor::Sensor, stadium::Stadium, venue::Setting};

/// How the video is encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// Constant quality: x264's CRF, 0 (best) to 51.
    Quality(u8),
    /// A broadcaster's budget.
    Budget {
        /// Bits per second.
        bits_per_second: u32,
        /// Frames from one key frame to the next.
        key_every: u32,
    },
}

/// The chain of one production: the same for all frames of a clip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain {
    /// Lens and sensor.
    pub sensor: Sensor,
    /// How long the shutter is open, as a share of the time from frame to frame; 0 freezes everything.
    pub shutter: f32,
    /// Samples along each side of a pixel.
    pub side: usize,
    /// The encoder.
    pub rate: Rate,
}

impl Chain {
    /// The chain of a setting; drawn from the seed, set for the light of the stadium and the size of the picture.
    #[must_use]
    pub fn new(setting: Setting, seed: u64, stadium: &Stadium, size_px: (u32, u32)) -> Self {
        match setting {
            Setting::Plain => {
                Self { sensor: Sensor::clean(), shutter: 0.0, side: 3, rate: Rate::Quality(20) }
            }
            Setting::Drawn => Self::drawn(seed, stadium, size_px),
        }
    }

    fn drawn(seed: u64, stadium: &Stadium, (width, height): (u32, u32)) -> Self {
        let rng = &mut Pcg64Mcg::seed_from_u64(seed ^ 0xCA_3E4A);
        let mut gain = || 1.0 + rng.random_range(-0.04..0.04f32);
        let white = [gain(), 1.0, gain()];
        // The iris is set on the grass; somebody sets it, so not always alike.
        let exposure = rng.random_range(0.90..1.32) * 1.04 / stadium.level_light().max(0.05);
        // Blur is given for 720 lines: larger pictures of the same lens are softer in pixels.
        let lines = height as f32 / 720.0;
        let sensor = Sensor {
            blur_px: rng.random_range(0.35..0.85) * lines.max(0.5),
            sharpen: if rng.random_bool(0.75) { rng.random_range(0.1..0.8) } else { 0.0 },
            exposure,
            white,
            saturation: rng.random_range(0.85..1.2),
            // Most productions are quiet, and encoders take what is left.
            noise: 0.001 + 0.012 * rng.random_range(0.0..1.0f32).powi(2),
            fringe: if rng.random_bool(0.5) { rng.random_range(-0.0009..0.0009) } else { 0.0 },
            vignette: rng.random_range(0.0..0.14),
            jpeg: None,
        };
        // 1/50 s at 25 frames to 1/500 s.
        let shutter = 25.0 / 50.0 * 0.1f32.powf(rng.random_range(0.0..1.0));
        // 3 to 10 Mbit/s at 1280 × 720, as sports channels and web streams have.
        let pixels = width as f32 * height as f32 / (1280.0 * 720.0);
        let bits = 3.0e6 * (10.0f32 / 3.0).powf(rng.random_range(0.0..1.0)) * pixels.powf(0.8);
        let rate = Rate::Budget { bits_per_second: bits as u32, key_every: rng.random_range(12..64) };
        Self { sensor, shutter, side: 3, rate }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::venue::{Venue, pitch_of};

    #[test]
    fn chains_differ_by_seed_and_expose_every_light_alike() {
        let mut shutters = Vec::new();
        for seed in 0..30 {
            let venue = Venue::drawn(seed, pitch_of(seed), [[0.9; 3], [0.1; 3]]);
            let chain = Chain::new(Setting::Drawn, seed, &venue.stadium, (1280, 720));
            assert_eq!(chain, Chain::new(Setting::Drawn, seed, &venue.stadium, (1280, 720)));
            let level = chain.sensor.exposure * venue.stadium.level_light();
            assert!((0.8..1.4).contains(&level), "seed {seed}: {level}");
            assert!((0.049..=0.5).contains(&chain.shutter));
            shutters.push(chain.shutter);
        }
        let (low, high) = shutters.iter().fold((f32::MAX, 0.0f32), |(l, h), s| (l.min(*s), h.max(*s)));
        assert!(high > 3.0 * low, "{low} to {high}");
    }
}
