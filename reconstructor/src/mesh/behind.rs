//! The colours of what the camera did not see: those that it saw at other times; else those of the same height of the body, without face and
//! number; and at the outline those that are seen there, so that no seam shows.

use glam::DVec2;
use image::{GrayImage, Luma, Rgb, RgbImage};
use imageproc::distance_transform::{Norm, distance_transform};

use super::{
    skin::{Skin, Wearer},
    texture::CutOut,
};
use crate::{
    geometry::Mask,
    pose::{Person, index},
};

/// Colours are averaged over this much to either side, metres: a number goes, a sleeve stays.
const ACROSS_M: f64 = 0.12;
/// And over this much up and down.
const ALONG_M: f64 = 0.02;
/// A shirt ends this far above the shoulders' joints, metres.
const COLLAR_M: f64 = 0.08;
/// From this far inside the outline on, all is guessed, metres.
const BLEND_M: f64 = 0.06;
/// A head reaches no farther to the side of the nose, metres.
const HEAD_M: f64 = 0.17;
/// The upper part of a head that shows hair from every side, of the way down to the neck.
const HAIR: f64 = 0.3;

/// A picture of the size of `seen` with the colours of the body's other side.
pub(super) fn colours(seen: &CutOut, mask: &Mask, person: &Person, pixels_per_metre: f64) -> RgbImage {
    let (width, height) = seen.image.dimensions();
    let body = |x: u32, y: u32| mask.at(seen.x0 + x as i32, seen.y0 + y as i32) >= 128;
    let reach = |metres: f64| ((metres * pixels_per_metre).round() as u32).clamp(1, 64);
    let (across, along) = (reach(ACROSS_M), reach(ALONG_M).min(8));
    let mean = |columns: std::ops::RangeInclusive<u32>, rows: std::ops::RangeInclusive<u32>| {
        let (mut sum, mut count) = ([0u32; 3], 0u32);
        for y in rows {
            for x in columns.clone().filter(|&x| body(x, y)) {
                if let Some(Rgb(colour)) = seen.image.get_pixel_checked(x, y) {
                    sum = std::array::from_fn(|i| sum[i] + u32::from(colour[i]));
                    count += 1;
                }
            }
        }
        (count > 0).then(|| Rgb(sum.map(|channel| (channel / count) as u8)))
    };
    let (right, bottom) = (width.saturating_sub(1), height.saturating_sub(1));
    let mut guessed = RgbImage::from_fn(width, height, |x, y| {
        let columns = x.saturating_sub(across)..=(x + across).min(right);
        let rows = y.saturating_sub(along)..=(y + along).min(bottom);
        mean(columns, rows).unwrap_or_else(|| *seen.image.get_pixel(x, y))
    });
    // Whoever shows his face shows hair on the other side, and the other way round: the top of the head is the better guess.
    let top = (0..height).find(|&y| (0..width).any(|x| body(x, y)));
    let corner = DVec2::new(f64::from(seen.x0), f64::from(seen.y0));
    let nose = person.joints.get(index::NOSE).map(|nose| nose.pixel - corner);
    if let (Some(top), Some(nose)) = (top, nose) {
        // The nose is in the middle of the head; whoever is bent forward shows little of it above the shoulders.
        let shoulders = [index::LEFT_SHOULDER, index::RIGHT_SHOULDER].into_iter();
        let shoulders =
            shoulders.filter_map(|joint| Some(person.joints.get(joint)?.pixel.y - f64::from(seen.y0)));
        let collar = shoulders.fold(f64::INFINITY, f64::min) - COLLAR_M * pixels_per_metre;
        let chin = (2.0 * nose.y - f64::from(top))
            .min(collar)
            .clamp(f64::from(top) + 1.0, f64::from(bottom).max(f64::from(top) + 1.0));
        let hair = f64::from(top) + HAIR * (chin - f64::from(top));
        if let Some(hair) = mean(0..=right, top..=(hair as u32).min(bottom)) {
            for y in top..=(chin as u32).min(bottom) {
                let head = (0..width).filter(|&x| (f64::from(x) - nose.x).abs() <= HEAD_M * pixels_per_metre);
                head.for_each(|x| guessed.put_pixel(x, y, hair));
            }
        }
    }
    guessed
}

/// Lays what was seen of the far side at other times over the guess.
pub(super) fn paint_seen(guessed: &mut RgbImage, seen: &CutOut, skin: &Skin, wearer: &Wearer<'_>) {
    for (x, y, Rgb(guess)) in guessed.enumerate_pixels_mut() {
        let pixel = DVec2::new(f64::from(seen.x0) + f64::from(x), f64::from(seen.y0) + f64::from(y));
        if let Some((colour, sure)) = wearer.far_side(skin, pixel) {
            for (guess, colour) in guess.iter_mut().zip(colour) {
                *guess = (f32::from(*guess) * (1.0 - sure) + colour * sure).round() as u8;
            }
        }
    }
}

/// Lets the guess run into what is seen at the outline, so that no seam shows.
pub(super) fn blend(guessed: &mut RgbImage, seen: &CutOut, mask: &Mask, pixels_per_metre: f64) {
    let (width, height) = guessed.dimensions();
    let body = |x: u32, y: u32| mask.at(seen.x0 + x as i32, seen.y0 + y as i32) >= 128;
    let outside = GrayImage::from_fn(width, height, |x, y| Luma([if body(x, y) { 0 } else { u8::MAX }]));
    let inside_px = distance_transform(&outside, Norm::L1);
    let blend_px = (BLEND_M * pixels_per_metre).max(1.0) as f32;
    for ((guess, Rgb(seen)), steps) in guessed.pixels_mut().zip(seen.image.pixels()).zip(inside_px.pixels()) {
        let share = (f32::from(steps.0[0]) / blend_px).min(1.0);
        let Rgb(guess) = guess;
        for (guess, &seen) in guess.iter_mut().zip(seen) {
            *guess = (f32::from(*guess) * share + f32::from(seen) * (1.0 - share)).round() as u8;
        }
    }
}
