//! What a broadcast chain does to light: lens blur, edge enhancement, tone, noise, chroma subsampling, compression.

use glam::Vec3;
use image::{Rgb, RgbImage};
use rand::Rng;

use crate::{SynthesisError, outfit::to_srgb, render::Light};

/// Settings of the chain.
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
            jpeg: rng.random_bool(0.9).then(|| rng.random_range(35..92)),
        }
    }

    /// Turns light into a picture.
    pub fn expose(&self, light: &Light, rng: &mut impl Rng) -> Result<RgbImage, SynthesisError> {
        let [width, height] = light.size;
        let blurred = gaussian(&light.pixels, light.size, self.blur_px);
        let mut tones: Vec<Vec3> = blurred
            .iter()
            .map(|&l| {
                let l = l * self.exposure * Vec3::from(self.white);
                // A soft shoulder keeps white shirts from clipping.
                let l = l
                    .to_array()
                    .map(|c| if c < 0.7 { c } else { 0.7 + 0.3 * (1.0 - (-(c - 0.7) / 0.3).exp()) });
                Vec3::from(to_srgb(Vec3::from(l)))
            })
            .collect();
        if self.sharpen > 0.0 {
            let soft = gaussian(&tones, light.size, 1.0);
            tones.iter_mut().zip(&soft).for_each(|(tone, soft)| *tone += (*tone - *soft) * self.sharpen);
        }
        let mut image = RgbImage::new(width as u32, height as u32);
        for (pixel, tone) in image.pixels_mut().zip(&tones) {
            let grey = tone.dot(Vec3::new(0.299, 0.587, 0.114));
            let tone = Vec3::splat(grey) + (*tone - Vec3::splat(grey)) * self.saturation;
            let grain = self.noise * normal(rng);
            *pixel = Rgb(tone.to_array().map(|c| {
                let own = if self.noise > 0.0 { self.noise * 0.5 * normal(rng) } else { 0.0 };
                ((c + grain + own) * 255.0 + 0.5).clamp(0.0, 255.0) as u8
            }));
        }
        match self.jpeg {
            Some(quality) => compress(&subsampled(&image), quality),
            None => Ok(image),
        }
    }
}

/// Approximately normal, cheap: the sum of four uniform values.
fn normal(rng: &mut impl Rng) -> f32 {
    let bits: u64 = rng.random();
    let sum: u64 = (0..4).map(|k| (bits >> (16 * k)) & 0xffff).sum();
    (sum as f32 / 65_536.0 - 2.0) * 1.732
}

fn gaussian(values: &[Vec3], [width, height]: [usize; 2], sigma: f32) -> Vec<Vec3> {
    if sigma < 0.05 {
        return values.to_vec();
    }
    let radius = (sigma * 2.5).ceil() as usize;
    let kernel: Vec<f32> =
        (0..=2 * radius).map(|k| (-((k as f32 - radius as f32) / sigma).powi(2) / 2.0).exp()).collect();
    let sum: f32 = kernel.iter().sum();
    let kernel: Vec<f32> = kernel.iter().map(|k| k / sum).collect();
    let mut across = vec![Vec3::ZERO; values.len()];
    for y in 0..height {
        let row = &values[y * width..(y + 1) * width];
        for x in 0..width {
            let mut total = Vec3::ZERO;
            for (k, weight) in kernel.iter().enumerate() {
                total += row[(x + k).saturating_sub(radius).min(width - 1)] * *weight;
            }
            across[y * width + x] = total;
        }
    }
    let mut out = vec![Vec3::ZERO; values.len()];
    for y in 0..height {
        for (k, weight) in kernel.iter().enumerate() {
            let from = (y + k).saturating_sub(radius).min(height - 1) * width;
            let (target, source) = (&mut out[y * width..(y + 1) * width], &across[from..from + width]);
            target.iter_mut().zip(source).for_each(|(t, s)| *t += *s * *weight);
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
