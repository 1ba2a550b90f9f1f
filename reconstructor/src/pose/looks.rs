//! What somebody looks like in one picture: the colours of shirt, shorts and socks, and how high the head is. Trackers tell
//! people apart by it, and teams are found with it.

use glam::DVec2;
use image::RgbImage;
use serde::{Deserialize, Serialize};

use super::{Joint, Person, index, silhouette::INSIDE};

/// Joints below this visibility do not say where a garment is.
const VISIBLE: f32 = 0.3;
/// Samples across and along a garment.
const GRID: usize = 8;
/// Fewer samples on the person's own pixels than this say nothing.
const LEAST_SAMPLES: usize = 6;
/// Of the samples, the middle part by lightness that the mean is taken over: creases, numbers and borders are left out, stripes
/// stay a steady mixture.
const MIDDLE: std::ops::Range<f64> = 0.1..0.9;

/// A colour in CIE L*a*b* (white point D65): differences are about as large as they look.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Lab {
    /// Lightness, 0..100.
    pub l: f32,
    /// From green to red.
    pub a: f32,
    /// From blue to yellow.
    pub b: f32,
}

/// What somebody looks like in one picture; `None` for what is hidden or too small.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Looks {
    /// Mean colour of shirt, shorts and socks.
    pub kit: [Option<Lab>; 3],
    /// Height of the nose above the pitch, metres: of an upright person it tells the build.
    pub nose_m: Option<f32>,
}

impl Lab {
    /// From sRGB.
    #[must_use]
    pub fn from_srgb(rgb: [u8; 3]) -> Self {
        let [r, g, b] = rgb.map(|value| {
            let value = f32::from(value) / 255.0;
            if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        });
        let f = |t: f32| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
        let x = f((0.412_456 * r + 0.357_576 * g + 0.180_438 * b) / 0.950_47);
        let y = f(0.212_673 * r + 0.715_152 * g + 0.072_175 * b);
        let z = f((0.019_334 * r + 0.119_192 * g + 0.950_304 * b) / 1.088_83);
        Self { l: 116.0 * y - 16.0, a: 500.0 * (x - y), b: 200.0 * (y - z) }
    }

    /// To sRGB, clipped to what it can show.
    #[must_use]
    pub fn to_srgb(self) -> [u8; 3] {
        let y = (self.l + 16.0) / 116.0;
        let f = |t: f32| if t > 0.206_893 { t.powi(3) } else { (t - 16.0 / 116.0) / 7.787 };
        let (x, y, z) = (0.950_47 * f(y + self.a / 500.0), f(y), 1.088_83 * f(y - self.b / 200.0));
        let linear = [
            3.240_454 * x - 1.537_139 * y - 0.498_531 * z,
            -0.969_266 * x + 1.876_011 * y + 0.041_556 * z,
            0.055_643 * x - 0.204_026 * y + 1.057_225 * z,
        ];
        linear.map(|value| {
            let value = value.clamp(0.0, 1.0);
            let coded =
                if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 };
            (coded * 255.0).round() as u8
        })
    }
}

/// What the person at `place` looks like; pixels that also belong to another of `people` do not count. `nose_m` is the lifted nose's
/// height.
pub(super) fn of(picture: &RgbImage, people: &[Person], place: usize, nose_m: Option<f64>) -> Looks {
    let Some(person) = people.get(place) else { return Looks::default() };
    let rivals: Vec<&Person> = people
        .iter()
        .enumerate()
        .filter(|(i, other)| *i != place && touch(person, other))
        .map(|(_, o)| o)
        .collect();
    let mean = |garment: Option<Vec<DVec2>>| -> Option<Lab> {
        let own = |pixel: &DVec2| {
            let (x, y) = (pixel.x.round() as i32, pixel.y.round() as i32);
            let inside = |person: &Person| person.mask.at(x, y) >= INSIDE;
            (inside(person) && !rivals.iter().any(|rival| inside(rival))).then_some((x, y))
        };
        let colour = |(x, y): (i32, i32)| {
            let (x, y) = (u32::try_from(x).ok()?, u32::try_from(y).ok()?);
            picture.get_pixel_checked(x, y).map(|pixel| Lab::from_srgb(pixel.0))
        };
        middle_mean(garment?.iter().filter_map(own).filter_map(colour).collect())
    };
    let joints = &person.joints;
    Looks {
        kit: [mean(shirt(joints)), mean(shorts(joints)), mean(socks(joints))],
        nose_m: nose_m.map(|m| m as f32),
    }
}

fn touch(a: &Person, b: &Person) -> bool {
    a.bounds.min.cmple(b.bounds.max).all() && b.bounds.min.cmple(a.bounds.max).all()
}

/// The mean colour of the middle samples.
fn middle_mean(mut samples: Vec<Lab>) -> Option<Lab> {
    if samples.len() < LEAST_SAMPLES {
        return None;
    }
    samples.sort_by(|a, b| a.l.total_cmp(&b.l));
    let place = |part: f64| (part * samples.len() as f64).round() as usize;
    let middle = samples.get(place(MIDDLE.start)..place(MIDDLE.end))?;
    let mean = |of: fn(&Lab) -> f32| middle.iter().map(of).sum::<f32>() / middle.len().max(1) as f32;
    Some(Lab { l: mean(|c| c.l), a: mean(|c| c.a), b: mean(|c| c.b) })
}

fn seen(joints: &[Joint], joint: usize) -> Option<DVec2> {
    joints.get(joint).filter(|j| j.visibility >= VISIBLE && j.pixel.is_finite()).map(|j| j.pixel)
}

/// `count` places from 0 to 1.
fn steps(count: usize) -> impl Iterator<Item = f64> + Clone {
    (0..count).map(move |i| i as f64 / (count - 1).max(1) as f64)
}

/// Pixels of the inner part between shoulders and hips: arms and shorts stay out.
fn shirt(joints: &[Joint]) -> Option<Vec<DVec2>> {
    let corner = |joint| seen(joints, joint);
    let (left, right) = (corner(index::LEFT_SHOULDER)?, corner(index::RIGHT_SHOULDER)?);
    let (left_hip, right_hip) = (corner(index::LEFT_HIP)?, corner(index::RIGHT_HIP)?);
    let across = |v: f64| (left.lerp(left_hip, v), right.lerp(right_hip, v));
    let places = steps(GRID).flat_map(|v| {
        let (from, to) = across(0.1 + 0.65 * v);
        steps(GRID).map(move |u| from.lerp(to, 0.2 + 0.6 * u))
    });
    Some(places.collect())
}

/// Pixels over both thighs.
fn shorts(joints: &[Joint]) -> Option<Vec<DVec2>> {
    let legs = [(index::LEFT_HIP, index::LEFT_KNEE), (index::RIGHT_HIP, index::RIGHT_KNEE)];
    along(joints, legs, 0.05..0.5, 0.07)
}

/// Pixels over both shins.
fn socks(joints: &[Joint]) -> Option<Vec<DVec2>> {
    let legs = [(index::LEFT_KNEE, index::LEFT_ANKLE), (index::RIGHT_KNEE, index::RIGHT_ANKLE)];
    along(joints, legs, 0.35..0.85, 0.05)
}

/// Pixels along a part of bones, as wide as `half_width` of the bone's length to both sides.
fn along(
    joints: &[Joint],
    bones: [(usize, usize); 2],
    part: std::ops::Range<f64>,
    half_width: f64,
) -> Option<Vec<DVec2>> {
    let mut places = Vec::new();
    for (from, to) in bones {
        let (Some(from), Some(to)) = (seen(joints, from), seen(joints, to)) else { continue };
        let aside = (to - from).perp() * half_width;
        for v in steps(GRID) {
            let middle = from.lerp(to, part.start + (part.end - part.start) * v);
            places.extend([-1.0, 0.0, 1.0].map(|side| middle + aside * side));
        }
    }
    (!places.is_empty()).then_some(places)
}

#[cfg(test)]
mod tests {
    use image::Rgb;
    use proptest::prelude::*;

    use super::*;
    use crate::{
        geometry::{Mask, PixelBox},
        pose::JOINTS,
    };

    /// A standing figure 100 px tall in a blue shirt, white shorts and red socks on grass.
    fn figure() -> (RgbImage, Person) {
        let mut picture = RgbImage::from_pixel(100, 120, Rgb([0, 120, 0]));
        for (x, y) in (30..60).flat_map(|x| (0..110).map(move |y| (x, y))) {
            let colour = match y {
                20..50 => [10, 20, 200],
                50..75 => [240, 240, 240],
                75..105 => [200, 10, 10],
                _ => [150, 110, 90],
            };
            picture.put_pixel(x, y, Rgb(colour));
        }
        let mut joints = vec![Joint { pixel: DVec2::ZERO, depth_m: 0.0, visibility: 0.9 }; JOINTS];
        for (left, x, y) in [
            (index::LEFT_SHOULDER, 57.0, 20.0),
            (index::LEFT_HIP, 53.0, 52.0),
            (index::LEFT_KNEE, 53.0, 78.0),
            (index::LEFT_ANKLE, 53.0, 105.0),
        ] {
            joints[left].pixel = DVec2::new(x, y);
            joints[left + 1].pixel = DVec2::new(90.0 - x, y);
        }
        let person = Person {
            bounds: PixelBox { min: DVec2::new(30.0, 0.0), max: DVec2::new(60.0, 110.0) },
            score: 1.0,
            pose_score: 1.0,
            joints,
            mask: Mask { x0: 30, y0: 0, width: 30, height: 110, coverage: vec![255; 30 * 110] },
            ..Person::blank()
        };
        (picture, person)
    }

    #[test]
    fn each_garment_has_its_colour() {
        let (picture, person) = figure();
        let looks = of(&picture, std::slice::from_ref(&person), 0, Some(1.65));
        let kit = looks.kit.map(|colour| colour.unwrap().to_srgb());
        assert_eq!(kit, [[10, 20, 200], [240, 240, 240], [200, 10, 10]]);
        assert_eq!(looks.nose_m, Some(1.65));
    }

    #[test]
    fn what_somebody_else_covers_does_not_count() {
        let (picture, person) = figure();
        let mut other = person.clone();
        other.mask = Mask { x0: 30, y0: 0, width: 30, height: 60, coverage: vec![255; 30 * 60] };
        let kit = of(&picture, &[person.clone(), other], 0, None).kit;
        assert!(kit[0].is_none() && kit[2].is_some(), "{kit:?}");
        let mut lost = person;
        lost.joints.clear();
        assert_eq!(of(&picture, &[lost], 0, None), Looks::default());
        assert_eq!(of(&picture, &[], 3, None), Looks::default());
    }

    proptest! {
        #[test]
        fn colours_survive_the_way_to_lab_and_back(rgb: [u8; 3]) {
            let back = Lab::from_srgb(rgb).to_srgb();
            prop_assert!(back.iter().zip(rgb).all(|(a, b)| a.abs_diff(b) <= 1), "{rgb:?} became {back:?}");
        }
    }
}
