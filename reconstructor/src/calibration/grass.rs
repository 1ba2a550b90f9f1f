//! Which colours of a picture are grass: the most frequent green of this frame, in ratios of red and green to brightness,
//! so that shade and floodlight matter little.

use image::RgbImage;

/// Bins per axis of the chromaticity histogram.
const BINS: usize = 48;
/// Every n-th pixel in both directions is looked at to learn the colour.
const STRIDE: usize = 4;
/// Least share of the picture that is green when a pitch is in view.
pub(super) const LEAST_SHARE: f64 = 0.08;
/// Standard deviations that still count as grass.
const WIDTH_SIGMAS: f32 = 4.0;
/// Least standard deviation of the ratios: coding noise.
const LEAST_SIGMA: f32 = 0.015;
/// Darker than this (sum of the three channels), a colour has no hue.
const LEAST_SUM: u32 = 70;

/// Table of grass colours for one frame, five bits per channel.
pub(super) struct Grass {
    table: Vec<bool>,
    /// Share of the picture that is grass, 0..1.
    pub(super) share: f64,
}

impl Grass {
    /// Learns the grass of a picture.
    pub(super) fn learn(image: &RgbImage) -> Self {
        let sampled = || {
            let rows = image.rows().step_by(STRIDE);
            rows.flat_map(|row| row.step_by(STRIDE))
                .filter_map(|pixel| ratios(pixel.0).filter(|&r| is_green(r)))
        };
        let mut histogram = vec![0_u32; BINS * BINS];
        let bin = |[r, g]: [f32; 2]| {
            let index = |v: f32| ((v * BINS as f32) as usize).min(BINS - 1);
            index(g) * BINS + index(r)
        };
        for r in sampled() {
            histogram[bin(r)] += 1;
        }
        let peak = histogram.iter().enumerate().max_by_key(|&(_, &n)| n).map_or(0, |(i, _)| i);
        let middle = [(peak % BINS) as f32 + 0.5, (peak / BINS) as f32 + 0.5].map(|v| v / BINS as f32);

        // Mean and covariance of the greens about the peak.
        let (mut n, mut mean) = (0.0_f32, [0.0_f32; 2]);
        let mut second = [0.0_f32; 3];
        let near = 4.5 / BINS as f32;
        for r in sampled().filter(|r| (r[0] - middle[0]).abs() < near && (r[1] - middle[1]).abs() < near) {
            let d = [r[0] - middle[0], r[1] - middle[1]];
            n += 1.0;
            mean[0] += d[0];
            mean[1] += d[1];
            second[0] += d[0] * d[0];
            second[1] += d[0] * d[1];
            second[2] += d[1] * d[1];
        }
        let n = n.max(1.0);
        let mean = mean.map(|v| v / n);
        let floor = LEAST_SIGMA * LEAST_SIGMA;
        let (xx, xy, yy) = (
            second[0] / n - mean[0] * mean[0] + floor,
            second[1] / n - mean[0] * mean[1],
            second[2] / n - mean[1] * mean[1] + floor,
        );
        let determinant = (xx * yy - xy * xy).max(1e-12);
        let is_grass = |r: [f32; 2]| {
            let d = [r[0] - middle[0] - mean[0], r[1] - middle[1] - mean[1]];
            let squared = (yy * d[0] * d[0] - 2.0 * xy * d[0] * d[1] + xx * d[1] * d[1]) / determinant;
            squared < WIDTH_SIGMAS * WIDTH_SIGMAS && is_green(r)
        };
        let table: Vec<bool> = (0..1_usize << 15)
            .map(|code| {
                let channel = |shift: usize| (((code >> shift) & 31) << 3) as u8 | 4;
                ratios([channel(10), channel(5), channel(0)]).is_some_and(is_grass)
            })
            .collect();
        let mut grass = Self { table, share: 0.0 };
        let (mut all, mut green) = (0_usize, 0_usize);
        for pixel in image.rows().step_by(STRIDE).flat_map(|row| row.step_by(STRIDE)) {
            all += 1;
            green += usize::from(grass.contains(pixel.0));
        }
        grass.share = green as f64 / all.max(1) as f64;
        grass
    }

    /// Whether a colour is grass.
    pub(super) fn contains(&self, [r, g, b]: [u8; 3]) -> bool {
        let code = (usize::from(r >> 3) << 10) | (usize::from(g >> 3) << 5) | usize::from(b >> 3);
        self.table.get(code).copied().unwrap_or(false)
    }
}

/// Share of red and of green in a colour; `None` when it is too dark to tell.
fn ratios([r, g, b]: [u8; 3]) -> Option<[f32; 2]> {
    let sum = u32::from(r) + u32::from(g) + u32::from(b);
    (sum >= LEAST_SUM).then(|| [f32::from(r) / sum as f32, f32::from(g) / sum as f32])
}

fn is_green([r, g]: [f32; 2]) -> bool {
    let b = 1.0 - r - g;
    g > r * 1.04 && g > b * 1.1
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    #[test]
    fn the_commonest_green_is_grass_in_sun_and_shade() {
        let image = RgbImage::from_fn(200, 100, |x, y| match (x, y) {
            (_, 0..30) => Rgb([90, 90, 100]),
            (0..60, _) => Rgb([85, 130, 10]),
            (150.., 80..) => Rgb([230, 230, 230]),
            _ => Rgb([60, 95, 8]),
        });
        let grass = Grass::learn(&image);
        assert!((0.55..0.7).contains(&grass.share), "{}", grass.share);
        assert!(grass.contains([85, 130, 10]) && grass.contains([72, 110, 9]));
        for other in [[230, 230, 230], [90, 90, 100], [180, 30, 40], [30, 60, 200]] {
            assert!(!grass.contains(other), "{other:?}");
        }
    }

    #[test]
    fn a_picture_without_green_has_no_grass() {
        let image = RgbImage::from_pixel(100, 100, Rgb([120, 110, 115]));
        assert!(Grass::learn(&image).share < 0.01);
    }
}
