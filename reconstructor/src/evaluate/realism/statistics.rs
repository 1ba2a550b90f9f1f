//! What is measured on one labelled picture of 1280×720: people, kits, grass, lines, sharpness, colour.

use glam::{DVec2, DVec3, Vec3};
use image::RgbImage;

use super::{
    LabelledPicture,
    surroundings::{Planes, lab},
};
use crate::{geometry::PixelBox, report::median};

/// What is measured, with its unit, and the values of one picture: one for measures of the picture, one each for measures
/// of people or lines.
pub(super) type Measured = [(&'static str, Vec<f64>); 16];

pub(super) fn measure(LabelledPicture { picture, people, .. }: &LabelledPicture) -> Measured {
    let planes = Planes::new(picture);
    let grass = Grass::of(picture, &planes);
    let of_grass = |channel: usize| grass.colour.iter().map(|colour| colour[channel]).collect();
    let lines = lines(&planes, people);
    let [fine, middle, coarse] = bands(&planes);
    let decibels = |a: f64, b: f64| 10.0 * (a / b.max(1e-9)).max(1e-9).log10();
    let outside = outside(picture, &planes);
    [
        ("people per picture", vec![people.len() as f64]),
        ("player height, px", people.iter().map(|person| person.size().y).collect()),
        (
            "contrast of kit to grass, CIE76 ΔE",
            people.iter().filter_map(|person| kit_contrast(picture, &planes, person)).collect(),
        ),
        (
            "sharpness of players, steepest step as a share of their range",
            people.iter().filter_map(|person| sharpness(&planes, person)).collect(),
        ),
        ("luminance of the grass, 0..255", of_grass(0)),
        ("hue of the grass, degrees", of_grass(1)),
        ("saturation of the grass, 0..1", of_grass(2)),
        ("noise of the grass, levels", grass.noise.into_iter().collect()),
        (
            "mowing and shade: spread of the grass in blocks of 16 px, levels",
            grass.spread.into_iter().collect(),
        ),
        ("line width, px", lines.iter().map(|(width, _)| *width).collect()),
        ("contrast of lines to grass, levels", lines.iter().map(|(_, contrast)| *contrast).collect()),
        (
            "share of the picture that is grass",
            vec![planes.grass.iter().filter(|&&grass| grass).count() as f64 / planes.grass.len() as f64],
        ),
        ("detail at 1–2 px as a share of 2–4 px, dB", vec![decibels(fine, middle)]),
        ("detail at 2–4 px as a share of 4–8 px, dB", vec![decibels(middle, coarse)]),
        ("luminance outside the grass, 0..255", outside.iter().map(|[luminance, _]| *luminance).collect()),
        ("saturation outside the grass, 0..1", outside.iter().map(|[_, saturation]| *saturation).collect()),
    ]
}

/// Mean luminance and saturation of what is not grass; `None` when that is next to nothing.
fn outside(picture: &RgbImage, planes: &Planes) -> Option<[f64; 2]> {
    let pixels = picture.pixels().zip(&planes.luminance).zip(&planes.grass);
    let (mut sums, mut count) = ([0.0; 2], 0.0);
    for ((pixel, &luminance), _) in pixels.filter(|(_, grass)| !**grass) {
        sums[0] += f64::from(luminance);
        sums[1] += saturation_of(pixel.0);
        count += 1.0;
    }
    (count > 1000.0).then(|| sums.map(|sum| sum / count))
}

/// Saturation as in HSV.
fn saturation_of(rgb: [u8; 3]) -> f64 {
    let (low, high) = (rgb[0].min(rgb[1]).min(rgb[2]), rgb[0].max(rgb[1]).max(rgb[2]));
    f64::from(high - low) / f64::from(high.max(1))
}

/// Distance in CIELAB of the trunk's mean colour from the median grass round the box.
fn kit_contrast(picture: &RgbImage, planes: &Planes, person: &PixelBox) -> Option<f64> {
    let (middle, size) = (person.centre(), person.size());
    let trunk =
        PixelBox { min: middle - size * DVec2::new(0.15, 0.30), max: middle + size * DVec2::new(0.15, 0.0) };
    let around = PixelBox { min: person.min - 0.4 * size.x, max: person.max + 0.4 * size.x };
    let colours = |bounds: &PixelBox, keep: &dyn Fn(DVec2, usize) -> bool| -> Vec<Vec3> {
        planes
            .inside(bounds)
            .filter(|&(x, y)| keep(DVec2::new(f64::from(x), f64::from(y)), planes.place(x, y)))
            .map(|(x, y)| lab(picture.get_pixel(x, y).0))
            .collect()
    };
    let kit = colours(&trunk, &|_, _| true);
    let grass = colours(&around, &|at, place| !person.contains(at) && planes.grass[place]);
    if kit.len() < 4 || grass.len() < 12 {
        return None;
    }
    let kit = kit.iter().sum::<Vec3>() / kit.len() as f32;
    let middle = |k: usize| median(&grass.iter().map(|c| f64::from(c[k])).collect::<Vec<_>>());
    let ground = DVec3::new(middle(0)?, middle(1)?, middle(2)?).as_vec3();
    Some(f64::from(kit.distance(ground)))
}

/// The steepest steps between neighbouring pixels of a person, as a share of the range of its luminance.
fn sharpness(planes: &Planes, person: &PixelBox) -> Option<f64> {
    let (mut levels, mut steps) = (Vec::new(), Vec::new());
    for (x, y) in planes.inside(person) {
        let here = planes.luminance[planes.place(x, y)];
        levels.push(here);
        if x + 1 < planes.size.0 && y + 1 < planes.size.1 {
            let right = planes.luminance[planes.place(x + 1, y)];
            let below = planes.luminance[planes.place(x, y + 1)];
            steps.push((right - here).abs().max((below - here).abs()));
        }
    }
    if steps.len() < 60 {
        return None;
    }
    levels.sort_by(f32::total_cmp);
    steps.sort_by(f32::total_cmp);
    let range = levels[levels.len() * 97 / 100] - levels[levels.len() * 3 / 100];
    (range > 10.0).then(|| f64::from(steps[steps.len() * 97 / 100] / range))
}

struct Grass {
    colour: Option<[f64; 3]>,
    noise: Option<f64>,
    spread: Option<f64>,
}

impl Grass {
    fn of(picture: &RgbImage, planes: &Planes) -> Self {
        let (mut luminances, mut hues, mut saturations) = (Vec::new(), Vec::new(), Vec::new());
        for (place, pixel) in
            picture.pixels().enumerate().filter(|(place, _)| planes.grass[*place]).step_by(7)
        {
            luminances.push(f64::from(planes.luminance[place]));
            hues.push(hue(pixel.0));
            saturations.push(saturation_of(pixel.0));
        }
        if luminances.len() < 500 {
            return Self { colour: None, noise: None, spread: None };
        }
        let colour = [luminances, hues, saturations].map(|values| median(&values).unwrap_or_default());
        let (noise, spread) = planes.grass_noise_and_spread();
        Self { colour: Some(colour), noise, spread }
    }
}

fn hue(rgb: [u8; 3]) -> f64 {
    let [r, g, b] = rgb.map(f64::from);
    let (low, high) = (r.min(g).min(b), r.max(g).max(b));
    let range = (high - low).max(1e-3);
    let sixth = if high == g {
        2.0 + (b - r) / range
    } else if high == r {
        (g - b) / range
    } else {
        4.0 + (r - g) / range
    };
    (sixth * 60.0).rem_euclid(360.0)
}

/// Widest line that is looked for, pixels.
const LINE_MAX_PX: usize = 16;

/// Width and contrast of painted lines where a row or a column crosses them: bright between grass on both sides.
/// Of both directions the one that crosses more squarely gives the width.
fn lines(planes: &Planes, people: &[PixelBox]) -> Vec<(f64, f64)> {
    /// Every so many rows is looked at.
    const ROWS: usize = 6;
    let mut found = Vec::new();
    let (width, height) = planes.size;
    for y in (0..height).step_by(ROWS) {
        for x in (0..width).step_by(2) {
            let at = DVec2::new(f64::from(x), f64::from(y));
            let wider = |b: &PixelBox| PixelBox { min: b.min - 4.0, max: b.max + 4.0 };
            let peak = planes.luminance[planes.place(x, y)];
            if peak < 90.0 || people.iter().any(|person| wider(person).contains(at)) {
                continue;
            }
            let crossings = [(1i64, 0i64), (0, 1)].map(|step| planes.crossing((x, y), step, LINE_MAX_PX));
            let best = crossings.into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
            found.extend(best);
        }
    }
    found
}

/// Mean squared detail of the luminance at 1–2, 2–4 and 4–8 pixels (differences of halved pictures).
fn bands(planes: &Planes) -> [f64; 3] {
    let mut level = planes.clone_luminance();
    [0; 3].map(|_| {
        let (energy, smaller) = level.detail();
        level = smaller;
        energy
    })
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::{super::surroundings::is_grass, *};

    const GREEN: [u8; 3] = [70, 130, 50];

    fn painted(line_px: u32) -> LabelledPicture {
        let picture = RgbImage::from_fn(1280, 720, |x, y| {
            let on_line = (600..600 + line_px).contains(&x);
            let on_player = (200..230).contains(&x) && (300..380).contains(&y);
            Rgb(if on_player {
                [220, 30, 30]
            } else if on_line {
                [230, 235, 230]
            } else {
                GREEN
            })
        });
        let people = vec![PixelBox { min: DVec2::new(199.5, 299.5), max: DVec2::new(229.5, 379.5) }];
        LabelledPicture { picture, people, balls: Vec::new() }
    }

    fn named<'a>(found: &'a Measured, name: &str) -> &'a [f64] {
        &found.iter().find(|(measure, _)| *measure == name).unwrap().1
    }

    #[test]
    fn a_painted_picture_has_the_widths_heights_and_colours_it_was_painted_with() {
        for line_px in [2, 5] {
            let found = measure(&painted(line_px));
            let values = |name: &str| named(&found, name);
            assert_eq!(values("people per picture"), [1.0]);
            assert_eq!(values("player height, px"), [80.0]);
            let width = median(values("line width, px")).unwrap();
            assert!((width - f64::from(line_px)).abs() < 0.6, "{width} px for {line_px}");
            let contrast = values("contrast of lines to grass, levels")[0];
            assert!((contrast - 118.0).abs() < 20.0, "contrast {contrast}");
            let hue = values("hue of the grass, degrees")[0];
            let saturation = values("saturation of the grass, 0..1")[0];
            assert!(
                (hue - 105.0).abs() < 1.0 && (saturation - 80.0 / 130.0).abs() < 0.01,
                "{hue} {saturation}"
            );
            assert!(values("noise of the grass, levels")[0] < 0.1, "there is no noise");
            let kit = lab([220, 30, 30]).distance(lab(GREEN));
            assert!((values("contrast of kit to grass, CIE76 ΔE")[0] - f64::from(kit)).abs() < 0.5);
            assert!(is_grass(GREEN) && !is_grass([230, 235, 230]) && !is_grass([220, 30, 30]));
        }
    }

    #[test]
    fn blur_takes_fine_detail_and_sharpness_away() {
        let mut sharp = painted(3);
        sharp.people[0].max.x += 12.0;
        let soft = LabelledPicture { picture: image::imageops::blur(&sharp.picture, 1.5), ..sharp.clone() };
        let (sharp, soft) = (measure(&sharp), measure(&soft));
        let both = |name: &str| [named(&sharp, name)[0], named(&soft, name)[0]];
        let [fine, blurred] = both("detail at 1–2 px as a share of 2–4 px, dB");
        assert!(blurred < fine - 3.0, "{blurred} and {fine} dB");
        let [crisp, soft] = both("sharpness of players, steepest step as a share of their range");
        assert!(soft < 0.7 * crisp);
    }
}
