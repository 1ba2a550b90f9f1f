//! Luminance and grass of a picture, and the small measures that only need those.

use glam::{DVec2, Mat3, Vec3};
use image::RgbImage;

use crate::geometry::PixelBox;

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

/// CIELAB of an sRGB colour, white D65.
pub(super) fn lab(rgb: [u8; 3]) -> Vec3 {
    let linear = Vec3::from(rgb.map(|c| {
        let c = f32::from(c) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    }));
    let xyz = Mat3::from_cols_array(&[
        0.412_456_4,
        0.212_672_9,
        0.019_333_9,
        0.357_576_1,
        0.715_152_2,
        0.119_192,
        0.180_437_5,
        0.072_175,
        0.950_304_1,
    ]) * linear
        / Vec3::new(0.950_47, 1.0, 1.088_83);
    let f =
        Vec3::from(xyz.to_array().map(|t| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 }));
    Vec3::new(116.0 * f.y - 16.0, 500.0 * (f.x - f.y), 200.0 * (f.y - f.z))
}

/// The median; 0 of nothing.
pub(super) fn median(mut values: Vec<f32>) -> f32 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
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
                    differences.extend(row.windows(3).map(|w| (w[1] - (w[0] + w[2]) / 2.0).abs()));
                }
            }
        }
        if means.len() < 20 {
            return (None, None);
        }
        // Of noise with the standard deviation s the difference has √1.5 s, and its median is 0.6745 of that.
        let noise = f64::from(median(differences)) / (0.6745 * 1.5f64.sqrt());
        let mean = means.iter().sum::<f32>() / means.len() as f32;
        let spread = (means.iter().map(|m| (m - mean).powi(2)).sum::<f32>() / means.len() as f32).sqrt();
        (Some(noise), Some(f64::from(spread)))
    }

    /// Width and contrast of a line crossed at a pixel along a step: full width at half height, with grass on both sides.
    pub(super) fn crossing(&self, (x, y): (u32, u32), (dx, dy): (i64, i64), most: u32) -> Option<(f64, f64)> {
        let at = |k: i64| {
            let (px, py) = (i64::from(x) + k * dx, i64::from(y) + k * dy);
            let inside = px >= 0 && py >= 0 && px < i64::from(self.size.0) && py < i64::from(self.size.1);
            inside.then(|| self.place(px as u32, py as u32))
        };
        let level = |k: i64| at(k).map(|place| self.luminance[place]);
        let peak = level(0)?;
        // The pixel is the brightest of the crossing, the first of several.
        let most = i64::from(most);
        let mut ends = [0.0; 2];
        let mut ground = 0.0;
        for (end, sign) in ends.iter_mut().zip([-1i64, 1]) {
            let grass = (1..=most).find(|&k| {
                at(sign * k).is_some_and(|place| self.grass[place])
                    && level(sign * k).is_some_and(|l| l < 0.75 * peak)
            })?;
            let beyond: Option<f32> = (grass + 1..grass + 4).map(|k| level(sign * k)).sum();
            if !(grass + 1..grass + 4).all(|k| at(sign * k).is_some_and(|place| self.grass[place])) {
                return None;
            }
            let beyond = beyond? / 3.0;
            if peak - beyond < 18.0 {
                return None;
            }
            let half = (peak + beyond) / 2.0;
            let last = (1..=grass + 1).find(|&k| level(sign * k).is_some_and(|l| l < half))?;
            let (inner, outer) = (level(sign * (last - 1))?, level(sign * last)?);
            if (1..last).any(|k| level(sign * k).is_some_and(|l| l > peak || (sign < 0 && l >= peak))) {
                return None;
            }
            *end = (last - 1) as f32 + (inner - half) / (inner - outer).max(1e-3);
            ground += beyond / 2.0;
        }
        Some((f64::from(ends[0] + ends[1]), f64::from(peak - ground)))
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
