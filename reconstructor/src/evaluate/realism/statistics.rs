//! What is measured on one labelled picture of 1280×720: people, kits, grass, lines, sharpness, colour.

use glam::{DVec2, Vec3};
use image::RgbImage;

use super::{
    LabelledPicture,
    surroundings::{Planes, lab, median},
};
use crate::geometry::PixelBox;

/// The measures, in the order of [`Statistics::values`].
pub(super) const NAMES: [&str; 16] = [
    "people per picture",
    "player height, px",
    "contrast of kit to grass, CIE76 ΔE",
    "sharpness of players, steepest step as a share of their range",
    "luminance of the grass, 0..255",
    "hue of the grass, degrees",
    "saturation of the grass, 0..1",
    "noise of the grass, levels",
    "mowing and shade: spread of the grass in blocks of 16 px, levels",
    "line width, px",
    "contrast of lines to grass, levels",
    "share of the picture that is grass",
    "detail at 1–2 px as a share of 2–4 px, dB",
    "detail at 2–4 px as a share of 4–8 px, dB",
    "luminance outside the grass, 0..255",
    "saturation outside the grass, 0..1",
];

/// The values of one picture: one for measures of the picture, one each for measures of people or lines.
pub(super) struct Statistics {
    pub(super) values: [Vec<f64>; NAMES.len()],
}

pub(super) fn measure(labelled: &LabelledPicture) -> Statistics {
    let planes = Planes::new(&labelled.picture);
    let mut values: [Vec<f64>; NAMES.len()] = Default::default();
    values[0].push(labelled.people.len() as f64);
    for person in &labelled.people {
        values[1].push(person.size().y);
        values[2].extend(kit_contrast(&labelled.picture, &planes, person));
        values[3].extend(sharpness(&planes, person));
    }
    let grass = Grass::of(&labelled.picture, &planes);
    if let Some([luminance, hue, saturation]) = grass.colour {
        values[4].push(luminance);
        values[5].push(hue);
        values[6].push(saturation);
    }
    values[7].extend(grass.noise);
    values[8].extend(grass.spread);
    for (width, contrast) in lines(&planes, &labelled.people) {
        values[9].push(width);
        values[10].push(contrast);
    }
    values[11].push(planes.grass.iter().filter(|&&g| g).count() as f64 / planes.grass.len() as f64);
    let [fine, middle, coarse] = bands(&planes);
    values[12].push(10.0 * (fine / middle.max(1e-9)).max(1e-9).log10());
    values[13].push(10.0 * (middle / coarse.max(1e-9)).max(1e-9).log10());
    let (mut luminance, mut saturation, mut count) = (0.0, 0.0, 0.0);
    for (place, pixel) in labelled.picture.pixels().enumerate().filter(|(place, _)| !planes.grass[*place]) {
        luminance += f64::from(planes.luminance[place]);
        saturation += saturation_of(pixel.0);
        count += 1.0;
    }
    if count > 1000.0 {
        values[14].push(luminance / count);
        values[15].push(saturation / count);
    }
    Statistics { values }
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
    let ground = Vec3::from([0, 1, 2].map(|k| median(grass.iter().map(|c| c[k]).collect())));
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
            luminances.push(planes.luminance[place]);
            hues.push(hue(pixel.0));
            saturations.push(saturation_of(pixel.0) as f32);
        }
        if luminances.len() < 500 {
            return Self { colour: None, noise: None, spread: None };
        }
        let colour = [luminances, hues, saturations].map(|values| f64::from(median(values)));
        let (noise, spread) = planes.grass_noise_and_spread();
        Self { colour: Some(colour), noise, spread }
    }
}

fn hue(rgb: [u8; 3]) -> f32 {
    let [r, g, b] = rgb.map(f32::from);
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
const LINE_MAX_PX: u32 = 16;

/// Width and contrast of painted lines where a row or a column crosses them: bright between grass on both sides.
/// Of both directions the one that crosses more squarely gives the width.
fn lines(planes: &Planes, people: &[PixelBox]) -> Vec<(f64, f64)> {
    const STEP: u32 = 6;
    let mut found = Vec::new();
    let (width, height) = planes.size;
    for y in (LINE_MAX_PX..height.saturating_sub(LINE_MAX_PX)).step_by(STEP as usize) {
        for x in (LINE_MAX_PX..width.saturating_sub(LINE_MAX_PX)).step_by(2) {
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
        LabelledPicture { picture, people }
    }

    #[test]
    fn a_painted_picture_has_the_widths_heights_and_colours_it_was_painted_with() {
        for line_px in [2, 5] {
            let found = measure(&painted(line_px)).values;
            assert_eq!(found[0], [1.0]);
            assert_eq!(found[1], [80.0]);
            let width = median(found[9].iter().map(|&w| w as f32).collect());
            assert!((width - line_px as f32).abs() < 0.6, "{width} px for {line_px}");
            assert!((found[10][0] - 118.0).abs() < 20.0, "contrast {}", found[10][0]);
            let (hue, saturation) = (found[5][0], found[6][0]);
            assert!(
                (hue - 105.0).abs() < 1.0 && (saturation - 80.0 / 130.0).abs() < 0.01,
                "{hue} {saturation}"
            );
            assert!(found[7][0] < 0.1, "there is no noise");
            let kit = lab([220, 30, 30]).distance(lab(GREEN));
            assert!((found[2][0] - f64::from(kit)).abs() < 0.5);
            assert!(is_grass(GREEN) && !is_grass([230, 235, 230]) && !is_grass([220, 30, 30]));
        }
    }

    #[test]
    fn blur_takes_fine_detail_and_sharpness_away() {
        let mut sharp = painted(3);
        sharp.people[0].max.x += 12.0;
        let soft = LabelledPicture { picture: image::imageops::blur(&sharp.picture, 1.5), ..sharp.clone() };
        let (sharp, soft) = (measure(&sharp).values, measure(&soft).values);
        assert!(soft[12][0] < sharp[12][0] - 3.0, "{} and {} dB", soft[12][0], sharp[12][0]);
        assert!(soft[3][0] < 0.7 * sharp[3][0]);
    }
}
