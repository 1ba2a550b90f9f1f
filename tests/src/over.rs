//! What a headset's compositor does with the pictures of the eyes.

use image::{Rgba, RgbaImage};

/// Premultiplied colours over the room, in linear light; `room` gives the colour behind a pixel.
#[must_use]
pub fn over(room: impl Fn(u32, u32) -> [u8; 3], front: &RgbaImage) -> RgbaImage {
    let linear = |byte: u8| {
        let value = f64::from(byte) / 255.0;
        if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    };
    let encoded = |light: f64| {
        let value = if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
        (value * 255.0).round().clamp(0.0, 255.0) as u8
    };
    RgbaImage::from_fn(front.width(), front.height(), |x, y| {
        let (back, front) = (room(x, y), front.get_pixel(x, y).0);
        let through = 1.0 - f64::from(front[3]) / 255.0;
        let [r, g, b] = [0, 1, 2].map(|i| encoded(linear(front[i]) + linear(back[i]) * through));
        Rgba([r, g, b, 255])
    })
}
