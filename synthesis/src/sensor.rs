//! What a broadcast camera does to light: lens (colour fringes, dark corners, blur), tone, edge enhancement, noise, and for
//! single pictures chroma subsampling and compression. Works on flat rows of numbers, which compilers turn into vector code.

use glam::{Vec2, Vec3};
use image::{Rgb, RgbImage};
use rand::Rng;

use crate::{SynthesisError, outfit::to_srgb, render::Light};

/// Settings of lens and sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Standard deviation of the lens blur, pixels.
    pub blur_px: f32,
    /// Strength of the edge enhancement; 0 is none.
    pub sharpen: f32,
    /// Multiplies the light.
    pub exposure: f32,
    /// Gain of each channel.
    pub white: [f32; 3],
    /// Colour strength; 1 leaves it.
    pub saturation: f32,
    /// Standard deviation of the noise, 0..1 of the sRGB range.
    pub noise: f32,
    /// Lateral chromatic aberration: how much larger red is drawn than green, and blue smaller, as a share of the radius.
    pub fringe: f32,
    /// Light lost in the corners of the picture, 0..1.
    pub vignette: f32,
    /// JPEG quality that stands for the codec; `None` leaves the picture uncompressed.
    pub jpeg: Option<u8>,
}

impl Sensor {
    /// A clean main camera.
    #[must_use]
    pub fn clean() -> Self {
        Self {
            blur_px: 0.5,
            sharpen: 0.35,
            exposure: 1.18,
            white: [1.0; 3],
            saturation: 1.08,
            noise: 0.008,
            fringe: 0.0,
            vignette: 0.0,
            jpeg: None,
        }
    }

    /// A random chain, from crisp to poor.
    pub fn random(rng: &mut impl Rng) -> Self {
        let mut gain = || 1.0 + rng.random_range(-0.06..0.06f32);
        let white = [gain(), 1.0, gain()];
        Self {
            blur_px: rng.random_range(0.3..1.1),
            sharpen: if rng.random_bool(0.6) { rng.random_range(0.1..0.9) } else { 0.0 },
            exposure: rng.random_range(0.75..1.35),
            white,
            saturation: rng.random_range(0.75..1.35),
            noise: rng.random_range(0.0..0.022),
            fringe: if rng.random_bool(0.5) { rng.random_range(-0.0012..0.0012) } else { 0.0 },
            vignette: rng.random_range(0.0..0.2),
            jpeg: rng.random_bool(0.9).then(|| rng.random_range(35..92)),
        }
    }

    /// Turns light into a picture.
    pub fn expose(&self, light: &Light, rng: &mut impl Rng) -> Result<RgbImage, SynthesisError> {
        let [width, height] = light.size;
        let mut tones = if self.fringe == 0.0 { light.pixels.clone() } else { self.fringed(light) };
        if self.vignette > 0.0 {
            let radius = light.centre.length_squared().max(1.0);
            for (y, row) in tones.chunks_exact_mut(width).enumerate() {
                for (x, pixel) in row.iter_mut().enumerate() {
                    let off = (Vec2::new(x as f32, y as f32) - light.centre).length_squared() / radius;
                    *pixel *= 1.0 - self.vignette * off.min(1.5);
                }
            }
        }
        tones = gaussian(&tones, light.size, self.blur_px);
        let curve = Curve::new();
        let gain = Vec3::from(self.white) * self.exposure;
        tones.iter_mut().for_each(|tone| {
            let l = *tone * gain;
            *tone = Vec3::new(curve.at(l.x), curve.at(l.y), curve.at(l.z));
        });
        if self.sharpen > 0.0 {
            let soft = gaussian(&tones, light.size, 1.0);
            tones.iter_mut().zip(&soft).for_each(|(tone, soft)| *tone += (*tone - *soft) * self.sharpen);
        }
        let mut grain = Grain(rng.random::<u64>() | 1);
        let mut bytes = Vec::with_capacity(width * height * 3);
        for tone in &tones {
            let grey = tone.dot(Vec3::new(0.299, 0.587, 0.114));
            let tone = Vec3::splat(grey) + (*tone - Vec3::splat(grey)) * self.saturation;
            let [shared, own @ ..] = grain.four();
            let noise = (Vec3::splat(shared) + 0.5 * Vec3::from(own)) * self.noise;
            let value = (tone + noise) * 255.0 + 0.5;
            bytes.extend([value.x as u8, value.y as u8, value.z as u8]); // the cast clamps
        }
        let broken =
            || SynthesisError::Options("a picture of light has fewer pixels than its size says".into());
        let image = RgbImage::from_raw(width as u32, height as u32, bytes).ok_or_else(broken)?;
        match self.jpeg {
            Some(quality) => compress(&subsampled(&image), quality),
            None => Ok(image),
        }
    }

    /// Red drawn larger and blue smaller about the middle of the whole picture.
    fn fringed(&self, light: &Light) -> Vec<Vec3> {
        let [width, height] = light.size;
        let limit = Vec2::new(width as f32 - 1.0, height as f32 - 1.0);
        let sample = |at: Vec2, channel: usize| {
            let at = at.clamp(Vec2::ZERO, limit);
            let (x, y) = (at.x as usize, at.y as usize);
            let (right, below) = (usize::from(x + 1 < width), if y + 1 < height { width } else { 0 });
            let (fx, fy) = (at.x - x as f32, at.y - y as f32);
            let first = y * width + x;
            let value = |place: usize| light.pixels[place][channel];
            let top = value(first) + (value(first + right) - value(first)) * fx;
            let bottom = value(first + below) + (value(first + below + right) - value(first + below)) * fx;
            top + (bottom - top) * fy
        };
        let mut out = Vec::with_capacity(light.pixels.len());
        for y in 0..height {
            for x in 0..width {
                let pixel = Vec2::new(x as f32, y as f32);
                let away = (pixel - light.centre) * self.fringe;
                out.push(Vec3::new(
                    sample(pixel - away, 0),
                    light.pixels[y * width + x].y,
                    sample(pixel + away, 2),
                ));
            }
        }
        out
    }
}

/// Light to sRGB with a soft shoulder that keeps white shirts from clipping, as a table.
struct Curve(Vec<f32>);

impl Curve {
    const STEPS: f32 = 2048.0;

    fn new() -> Self {
        let tone = |l: f32| {
            let soft = if l < 0.7 { l } else { 0.7 + 0.3 * (1.0 - (-(l - 0.7) / 0.3).exp()) };
            to_srgb(Vec3::splat(soft))[0]
        };
        Self((0..=Self::STEPS as usize * 2 + 1).map(|k| tone(k as f32 / Self::STEPS)).collect())
    }

    fn at(&self, light: f32) -> f32 {
        let place = (light * Self::STEPS).clamp(0.0, 2.0 * Self::STEPS - 1.0);
        let index = place as usize;
        self.0[index] + (self.0[index + 1] - self.0[index]) * (place - index as f32)
    }
}

/// Approximately normal numbers, cheap: sums of bytes of Marsaglia's xorshift64.
struct Grain(u64);

impl Grain {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// Four numbers with standard deviation 1.
    fn four(&mut self) -> [f32; 4] {
        let (a, b) = (self.next(), self.next());
        let sum = |bits: u64| {
            // Four bytes each: pairs, then pairs of pairs.
            let pairs = (bits & 0x00ff_00ff_00ff_00ff) + (bits >> 8 & 0x00ff_00ff_00ff_00ff);
            let fours = (pairs & 0x0000_ffff_0000_ffff) + (pairs >> 16 & 0x0000_ffff_0000_ffff);
            [fours & 0xffff_ffff, fours >> 32].map(|s| (s as f32 - 510.0) / 147.8)
        };
        let ([p, q], [r, s]) = (sum(a), sum(b));
        [p, q, r, s]
    }
}

/// A Gaussian blur; beyond the border the outermost pixels repeat.
pub(crate) fn gaussian(values: &[Vec3], [width, height]: [usize; 2], sigma: f32) -> Vec<Vec3> {
    if sigma < 0.05 {
        return values.to_vec();
    }
    let radius = (sigma * 2.5).ceil() as usize;
    let kernel: Vec<f32> =
        (0..=2 * radius).map(|k| (-((k as f32 - radius as f32) / sigma).powi(2) / 2.0).exp()).collect();
    let sum: f32 = kernel.iter().sum();
    let kernel: Vec<f32> = kernel.iter().map(|k| k / sum).collect();
    let flat: &[f32] = bytemuck::cast_slice(values);
    let line = width * 3;
    let mut out = vec![Vec3::ZERO; values.len()];
    let (mut down, mut padded) = (vec![0.0f32; line], vec![0.0f32; line + radius * 6]);
    for (y, target) in bytemuck::cast_slice_mut::<Vec3, f32>(&mut out).chunks_exact_mut(line).enumerate() {
        down.fill(0.0);
        for (k, weight) in kernel.iter().enumerate() {
            let from = (y + k).saturating_sub(radius).min(height - 1) * line;
            down.iter_mut().zip(&flat[from..from + line]).for_each(|(d, v)| *d += v * weight);
        }
        for k in 0..radius {
            padded[k * 3..k * 3 + 3].copy_from_slice(&down[..3]);
            let end = (radius + width + k) * 3;
            padded[end..end + 3].copy_from_slice(&down[line - 3..]);
        }
        padded[radius * 3..radius * 3 + line].copy_from_slice(&down);
        for (k, weight) in kernel.iter().enumerate() {
            target.iter_mut().zip(&padded[k * 3..k * 3 + line]).for_each(|(t, v)| *t += v * weight);
        }
    }
    out
}
/// Halves the resolution of the colour, as 4:2:0 video does.
fn subsampled(image: &RgbImage) -> RgbImage {
    let (width, height) = image.dimensions();
    let luma = |p: &Rgb<u8>| 0.299 * f32::from(p[0]) + 0.587 * f32::from(p[1]) + 0.114 * f32::from(p[2]);
    let mut out = image.clone();
    for y in (0..height).step_by(2) {
        for x in (0..width).step_by(2) {
            let block =
                || (y..(y + 2).min(height)).flat_map(move |v| (x..(x + 2).min(width)).map(move |u| (u, v)));
            let count = block().count() as f32;
            let mut chroma = [0.0f32; 3];
            for (u, v) in block() {
                let pixel = image.get_pixel(u, v);
                let grey = luma(pixel);
                (0..3).for_each(|c| chroma[c] += (f32::from(pixel[c]) - grey) / count);
            }
            for (u, v) in block() {
                let grey = luma(image.get_pixel(u, v));
                out.put_pixel(u, v, Rgb(chroma.map(|c| (grey + c + 0.5).clamp(0.0, 255.0) as u8)));
            }
        }
    }
    out
}

fn compress(image: &RgbImage, quality: u8) -> Result<RgbImage, SynthesisError> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, quality);
    image.write_with_encoder(encoder).map_err(SynthesisError::Picture)?;
    Ok(image::load_from_memory_with_format(&bytes, image::ImageFormat::Jpeg)
        .map_err(SynthesisError::Picture)?
        .to_rgb8())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    fn quiet() -> Sensor {
        Sensor { blur_px: 0.0, sharpen: 0.0, noise: 0.0, exposure: 1.0, saturation: 1.0, ..Sensor::clean() }
    }

    fn light(size: [usize; 2], value: impl Fn(usize, usize) -> Vec3) -> Light {
        let pixels = (0..size[0] * size[1]).map(|k| value(k % size[0], k / size[0])).collect();
        Light { size, pixels, centre: Vec2::new(size[0] as f32 - 1.0, size[1] as f32 - 1.0) / 2.0 }
    }

    #[test]
    fn noise_has_the_strength_asked_for() {
        let grey = light([200, 200], |_, _| Vec3::splat(0.2));
        let rng = &mut Pcg64Mcg::seed_from_u64(3);
        let image = Sensor { noise: 0.02, ..quiet() }.expose(&grey, rng).unwrap();
        let mean = image.pixels().map(|p| f64::from(p[1])).sum::<f64>() / 40_000.0;
        let variance = image.pixels().map(|p| (f64::from(p[1]) - mean).powi(2)).sum::<f64>() / 40_000.0;
        // The shared part and half as much of each channel's own.
        let wanted = 0.02 * 255.0 * 1.25f64.sqrt();
        assert!((variance.sqrt() / wanted - 1.0).abs() < 0.05, "{} instead of {wanted}", variance.sqrt());
    }

    #[test]
    fn fringes_grow_towards_the_border_and_corners_are_darker() {
        let edges = light([400, 40], |x, _| Vec3::splat(if x / 20 % 2 == 0 { 0.1 } else { 0.5 }));
        let rng = &mut Pcg64Mcg::seed_from_u64(3);
        let image = Sensor { fringe: 0.004, ..quiet() }.expose(&edges, rng).unwrap();
        let apart = |columns: std::ops::Range<u32>| -> i32 {
            columns
                .map(|x| (i32::from(image.get_pixel(x, 20)[0]) - i32::from(image.get_pixel(x, 20)[2])).abs())
                .sum()
        };
        assert!(apart(340..399) > 3 * apart(170..229), "{} and {}", apart(340..399), apart(170..229));
        let even = light([101, 101], |_, _| Vec3::splat(0.3));
        let image = Sensor { vignette: 0.2, ..quiet() }.expose(&even, rng).unwrap();
        assert!(image.get_pixel(0, 0)[1] + 8 < image.get_pixel(50, 50)[1]);
    }

    #[test]
    fn a_blur_keeps_the_sum_and_has_its_width() {
        let mut values = vec![Vec3::ZERO; 31 * 31];
        values[15 * 31 + 15] = Vec3::ONE;
        let out = gaussian(&values, [31, 31], 2.0);
        let total: f32 = out.iter().map(|v| v.x).sum();
        let spread: f32 = out.iter().enumerate().map(|(k, v)| v.x * ((k % 31) as f32 - 15.0).powi(2)).sum();
        assert!((total - 1.0).abs() < 1e-4 && (spread.sqrt() - 2.0).abs() < 0.15, "{total} {spread}");
    }
}
