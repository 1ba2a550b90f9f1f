//! Luminance and grass of a picture, and the small measures that only need those.

use glam::{DVec2, Vec3};
use image::RgbImage;
use synthesis::outfit;

use crate::{geometry::PixelBox, report::median};

/// Luminance and grass, row by row.
pub(super) struct Planes {
    pub(super) size: (u32, u32),
    /// Gamma-encoded luma (BT.709 weights), 0..255.
    pub(super) luminance: Vec<f32>,
    pub(super) grass: Vec<bool>,
}

/// Whether a colour is that of grass: green strongest, neither grey nor dark.
pub(super) fn is_grass([r, g, b]: [u8; 3]) -> bool {
    let (red, green, blue) = (i32::from(r), i32::from(g), i32::from(b));
    let low = red.min(blue);
    green > 40 && green >= red + 4 && green >= blue + 8 && (green - low) * 100 > 18 * green
}

/// CIELAB of an 8-bit sRGB colour.
pub(super) fn lab(rgb: [u8; 3]) -> Vec3 {
    outfit::lab(rgb.map(|c| f32::from(c) / 255.0))
}

impl Planes {
    pub(super) fn new(picture: &RgbImage) -> Self {
        let luma = |[r, g, b]: [u8; 3]| 0.2126 * f32::from(r) + 0.7152 * f32::from(g) + 0.0722 * f32::from(b);
        Self {
            size: picture.dimensions(),
            luminance: picture.pixels().map(|pixel| luma(pixel.0)).collect(),
            grass: picture.pixels().map(|pixel| is_grass(pixel.0)).collect(),
        }
    }

    pub(super) fn place(&self, x: u32, y: u32) -> usize {
        y as usize * self.size.0 as usize + x as usize
    }

    /// The pixels of the picture inside a box.
    pub(super) fn inside(&self, bounds: &PixelBox) -> impl Iterator<Item = (u32, u32)> + use<> {
        let last = DVec2::new(f64::from(self.size.0) - 1.0, f64::from(self.size.1) - 1.0);
        let low = bounds.min.ceil().clamp(DVec2::ZERO, last).as_uvec2();
        let high = bounds.max.floor().clamp(DVec2::ZERO, last).as_uvec2();
        (low.y..=high.y).flat_map(move |y| (low.x..=high.x).map(move |x| (x, y)))
    }

    /// Noise as the median difference from the mean of both neighbours, and the spread of the means of blocks of 16 pixels.
    pub(super) fn grass_noise_and_spread(&self) -> (Option<f64>, Option<f64>) {
        const BLOCK: u32 = 16;
        let (mut differences, mut means) = (Vec::new(), Vec::new());
        for top in (0..self.size.1 - BLOCK).step_by(BLOCK as usize) {
            for left in (0..self.size.0 - BLOCK).step_by(BLOCK as usize) {
                let places = || (0..BLOCK * BLOCK).map(move |k| (left + k % BLOCK, top + k / BLOCK));
                if !places().all(|(x, y)| self.grass[self.place(x, y)]) {
                    continue;
                }
                means.push(
                    places().map(|(x, y)| self.luminance[self.place(x, y)]).sum::<f32>()
                        / (BLOCK * BLOCK) as f32,
                );
                for y in top..top + BLOCK {
                    let row = self.place(left, y);
                    let row = &self.luminance[row..row + BLOCK as usize];
                    differences.extend(row.windows(3).map(|w| f64::from((w[1] - (w[0] + w[2]) / 2.0).abs())));
                }
            }
        }
        if means.len() < 20 {
            return (None, None);
        }
        // Of noise with the standard deviation s the difference has √1.5 s, and its median is 0.6745 of that.
        let noise = median(&differences).map(|middle| middle / (0.6745 * 1.5f64.sqrt()));
        let mean = means.iter().sum::<f32>() / means.len() as f32;
        let spread = (means.iter().map(|m| (m - mean).powi(2)).sum::<f32>() / means.len() as f32).sqrt();
        (noise, Some(f64::from(spread)))
    }

    /// Width and contrast of a line crossed at a pixel along a step: full width at half height, with grass on both sides.
    /// The pixel must be the brightest of the crossing, the first of several.
    pub(super) fn crossing(
        &self,
        (x, y): (u32, u32),
        (dx, dy): (i64, i64),
        most_px: usize,
    ) -> Option<(f64, f64)> {
        /// Pixels of grass beyond the line that tell its level.
        const BEYOND: usize = 3;
        let peak = self.luminance[self.place(x, y)];
        // Distance of the half height from the pixel, and the level of the grass, on one side.
        let flank = |sign: i64| {
            // Level and grass from the pixel outwards, as far as the picture goes.
            let profile: Vec<(f32, bool)> = (0..(most_px + BEYOND + 1) as i64)
                .map_while(|k| {
                    let px =
                        u32::try_from(i64::from(x) + sign * k * dx).ok().filter(|px| *px < self.size.0)?;
                    let py =
                        u32::try_from(i64::from(y) + sign * k * dy).ok().filter(|py| *py < self.size.1)?;
                    let place = self.place(px, py);
                    Some((self.luminance[place], self.grass[place]))
                })
                .collect();
            let grass = profile.iter().position(|&(level, grass)| grass && level < 0.75 * peak)?;
            let beyond = profile.get(grass + 1..grass + 1 + BEYOND)?;
            let ground = beyond.iter().map(|(level, _)| level).sum::<f32>() / BEYOND as f32;
            if peak - ground < 18.0 || !beyond.iter().all(|(_, grass)| *grass) {
                return None;
            }
            let half = (peak + ground) / 2.0;
            let outer = profile.iter().position(|&(level, _)| level < half)?;
            let line = profile.get(1..outer)?;
            if line.iter().any(|&(level, _)| level > peak || (sign < 0 && level >= peak)) {
                return None;
            }
            let (inner_level, outer_level) = (profile.get(outer - 1)?.0, profile[outer].0);
            let part = (inner_level - half) / (inner_level - outer_level).max(1e-3);
            Some(((outer - 1) as f32 + part, ground))
        };
        let ((before, ground_before), (after, ground_after)) = (flank(-1)?, flank(1)?);
        let contrast = peak - (ground_before + ground_after) / 2.0;
        Some((f64::from(before + after), f64::from(contrast)))
    }

    pub(super) fn clone_luminance(&self) -> Level {
        Level { size: self.size, values: self.luminance.clone() }
    }
}

/// One level of a pyramid.
pub(super) struct Level {
    size: (u32, u32),
    values: Vec<f32>,
}

impl Level {
    /// Mean square of what halving the resolution takes away, and the halved level.
    pub(super) fn detail(&self) -> (f64, Self) {
        let (width, height) = (self.size.0 / 2, self.size.1 / 2);
        let mut halved = Vec::with_capacity((width * height) as usize);
        let mut energy = 0.0f64;
        for y in 0..height {
            for x in 0..width {
                let corner = (2 * y * self.size.0 + 2 * x) as usize;
                let below = corner + self.size.0 as usize;
                let four = [
                    self.values[corner],
                    self.values[corner + 1],
                    self.values[below],
                    self.values[below + 1],
                ];
                let mean = four.iter().sum::<f32>() / 4.0;
                energy += four.iter().map(|v| f64::from((v - mean).powi(2))).sum::<f64>();
                halved.push(mean);
            }
        }
        let count = f64::from(width * height * 4).max(1.0);
        (energy / count, Self { size: (width, height), values: halved })
    }
}
