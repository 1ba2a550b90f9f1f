//! The light of a room, estimated from one picture of it with depth.
//!
//! Colour: shades of grey (Finlayson and Trezzi 2004, Minkowski norm p = 6), that is, the strong pixels of a picture are
//! on average grey. Strength: mean luminance of the picture and of the table, against a grey of 18 %; the geometric mean
//! of both, as a white table alone would be taken for a bright lamp. Direction: least squares of luminance over the
//! surface normals that the depth gives, L = a + b·n (first-order irradiance, Basri and Jacobs 2003); used only where the
//! normals differ enough and the fit explains something. All of it is an estimate from unknown surfaces: one picture
//! cannot tell a dark wall from a dim lamp, so every figure is kept within limits.

use glam::{DVec2, DVec3, Vec3};

use super::RoomPicture;
use crate::placement::Surface;

/// Minkowski norm of the shades of grey.
const NORM: i32 = 6;
/// Luminance of a picture that is exposed as usual.
const MIDDLE_GREY: f64 = 0.18;
/// What the estimate may do to the match's colours: strength, and each channel against the mean.
const STRENGTH_LIMITS: [f64; 2] = [0.45, 1.5];
const TINT_LIMITS: [f64; 2] = [0.8, 1.25];
/// Share of the estimated tint that is used; the rest is a camera's own white balance and coloured walls.
const TINT_SHARE: f64 = 0.7;
/// A direction counts when the fit explains this share of the luminance's variance.
const LEAST_EXPLAINED: f64 = 0.1;
/// Lowest light that is believed: its height over its reach. Lamps and windows of rooms are above the table.
const LEAST_ELEVATION: f64 = 0.6;
/// Strength of the shadow when no direction could be measured: soft, from above.
const UNMEASURED: f64 = 0.3;
/// What a measured light may throw as shadow.
const SHARE_LIMITS: [f64; 2] = [0.15, 0.7];
/// Pixels within this of the table's plane are the table, metres.
const ON_PLANE_M: f64 = 0.012;
/// The light's direction is looked for this far around the table's middle, metres.
const NEAR_TABLE_M: f64 = 1.0;
/// Every so many pixels are looked at.
const STEP_PX: u32 = 3;
/// Distance of the neighbours that give a normal, pixels.
const NORMAL_PX: u32 = 6;

/// How the match is lit on a real table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoomLight {
    /// Factors of the match's linear red, green and blue.
    pub colour: Vec3,
    /// Unit direction towards the light, in the room.
    pub towards: DVec3,
    /// Share of the light that comes from that direction, 0..1: how dark cast shadows are.
    pub directed: f64,
    /// Whether the direction was measured; otherwise it is above and a little to the left of the viewer.
    pub measured: bool,
}

impl RoomLight {
    /// Neutral light from above.
    #[must_use]
    pub fn neutral(up: DVec3) -> Self {
        Self { colour: Vec3::ONE, towards: up, directed: UNMEASURED, measured: false }
    }

    /// The light in a picture, for a match on `table`.
    #[must_use]
    pub fn estimate(picture: &RoomPicture, table: &Surface) -> Self {
        let up = table.plane.normal;
        let middle = table.outline_m.iter().sum::<DVec3>() / table.outline_m.len().max(1) as f64;
        let (width, height) = picture.colour.dimensions();
        let mut grey = Grey::default();
        let mut shading = Shading::default();
        for row in (0..height).step_by(STEP_PX as usize) {
            for column in (0..width).step_by(STEP_PX as usize) {
                let colour = linear(picture.colour.get_pixel(column, row).0);
                let point = picture.point_m(column, row);
                let on_table = point.is_some_and(|point| table.plane.distance_m(point).abs() < ON_PLANE_M);
                grey.add(colour, on_table);
                // Only what stands on the table: the table itself is one normal with many shadows, floor and walls lie
                // in other light and in the table's shadow.
                let near = point.is_some_and(|point| {
                    table.plane.distance_m(point) > ON_PLANE_M && point.distance(middle) < NEAR_TABLE_M
                });
                if near && let Some(normal) = normal(picture, column, row) {
                    shading.add(normal, colour);
                }
            }
        }
        let fallback = {
            let right = picture.camera.rotation.row(0);
            let back = -picture.camera.rotation.row(2);
            (up * 1.6 - right * 0.5 + back * 0.2).normalize_or(up)
        };
        let (towards, directed, measured) = match shading.direction(up) {
            Some((towards, share)) => (raised(towards, up), share, true),
            None => (fallback, UNMEASURED, false),
        };
        Self { colour: grey.light(), towards, directed, measured }
    }
}

/// A direction lifted until it comes from above.
fn raised(towards: DVec3, up: DVec3) -> DVec3 {
    let height = towards.dot(up);
    let level = towards - up * height;
    let least = LEAST_ELEVATION * level.length();
    (level + up * height.max(least)).normalize_or(up)
}

fn linear(srgb: [u8; 4]) -> DVec3 {
    let [red, green, blue, _] = srgb.map(|value| {
        let value = f64::from(value) / 255.0;
        if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    });
    DVec3::new(red, green, blue)
}

fn luminance(linear: DVec3) -> f64 {
    linear.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// The normal of the surface in a pixel, towards the camera; `None` at edges and where depth is unknown.
fn normal(picture: &RoomPicture, column: u32, row: u32) -> Option<DVec3> {
    let at = |column: u32, row: u32| picture.point_m(column, row);
    let middle = at(column, row)?;
    let (left, right) = (at(column.checked_sub(NORMAL_PX)?, row)?, at(column + NORMAL_PX, row)?);
    let (above, below) = (at(column, row.checked_sub(NORMAL_PX)?)?, at(column, row + NORMAL_PX)?);
    // A jump in depth is an edge between two things.
    let reach = 0.03 * middle.distance(picture.camera.position_m);
    let bent = (left + right) / 2.0 - middle;
    let bent = bent.length().max(((above + below) / 2.0 - middle).length());
    if bent > 0.25 * reach || left.distance(right) > 2.0 * reach || above.distance(below) > 2.0 * reach {
        return None;
    }
    let normal = (right - left).cross(above - below).try_normalize()?;
    let outward = normal.dot(picture.camera.position_m - middle);
    Some(normal * outward.signum())
}

/// Sums for colour and strength.
#[derive(Default)]
struct Grey {
    powers: DVec3,
    mean: DVec2,
    count: DVec2,
    colours: f64,
}

impl Grey {
    fn add(&mut self, colour: DVec3, on_table: bool) {
        // What is blown out has lost its colour.
        if colour.max_element() < 0.95 {
            self.powers += colour.powf(f64::from(NORM));
            self.colours += 1.0;
        }
        let all = DVec2::new(1.0, f64::from(u8::from(on_table)));
        self.mean += all * luminance(colour);
        self.count += all;
    }

    fn light(&self) -> Vec3 {
        let mean = self.mean / self.count.max(DVec2::ONE);
        // Without a table in the picture, or a black one, the whole picture speaks.
        let table = if mean.y > 0.0 { mean.y } else { mean.x };
        let strength = ((mean.x * table).sqrt() / MIDDLE_GREY).sqrt();
        let strength = strength.clamp(STRENGTH_LIMITS[0], STRENGTH_LIMITS[1]);
        let grey = (self.powers / self.colours.max(1.0)).powf(1.0 / f64::from(NORM));
        let tint = grey / (grey.element_sum() / 3.0);
        let tint = if tint.is_finite() { DVec3::ONE.lerp(tint, TINT_SHARE) } else { DVec3::ONE };
        let tint = tint.clamp(DVec3::splat(TINT_LIMITS[0]), DVec3::splat(TINT_LIMITS[1]));
        (tint * strength).as_vec3()
    }
}

/// Chromaticities that are told apart, along red and green.
const MATERIALS: usize = 24;
/// Pixels that make a material.
const LEAST_PIXELS: f64 = 60.0;
/// Darker pixels have no colour to speak of.
const LEAST_LUMINANCE: f64 = 0.004;
/// Directions that are tried, evenly over the half sphere.
const DIRECTIONS: u32 = 256;

/// A pixel with a normal.
struct Lit {
    normal: DVec3,
    luminance: f64,
    material: usize,
}

/// Luminance over normals.
#[derive(Default)]
struct Shading {
    pixels: Vec<Lit>,
}

impl Shading {
    fn add(&mut self, normal: DVec3, colour: DVec3) {
        let luminance = luminance(colour);
        if luminance < LEAST_LUMINANCE || colour.max_element() > 0.95 {
            return;
        }
        let bin =
            |channel: f64| ((channel / colour.element_sum() * MATERIALS as f64) as usize).min(MATERIALS - 1);
        self.pixels.push(Lit { normal, luminance, material: bin(colour.x) * MATERIALS + bin(colour.y) });
    }

    /// Direction towards the light and its share; `None` when no direction explains enough.
    fn direction(mut self, up: DVec3) -> Option<(DVec3, f64)> {
        let mut means = [(0.0, 0.0); MATERIALS * MATERIALS];
        for pixel in &self.pixels {
            let (count, sum) = &mut means[pixel.material];
            (*count, *sum) = (*count + 1.0, *sum + pixel.luminance);
        }
        self.pixels.retain(|pixel| means[pixel.material].0 >= LEAST_PIXELS);
        // In units of the material's own mean, so that its albedo falls out.
        let mut variance = 0.0;
        for pixel in &mut self.pixels {
            let (count, sum) = means[pixel.material];
            pixel.luminance = pixel.luminance * count / sum - 1.0;
            variance += pixel.luminance * pixel.luminance;
        }
        let count = self.pixels.len() as f64;
        let tried = (0..DIRECTIONS).map(|index| {
            let towards = half_sphere(index, up);
            let mut facing_of = [0.0; MATERIALS * MATERIALS];
            let (mut squares, mut product) = (0.0, 0.0);
            for pixel in &self.pixels {
                let facing = pixel.normal.dot(towards).max(0.0);
                facing_of[pixel.material] += facing;
                squares += facing * facing;
                product += facing * pixel.luminance;
            }
            let sums = facing_of.iter().zip(&means).filter(|(_, (count, _))| *count >= LEAST_PIXELS);
            let (mut mean_facing, mut between) = (0.0, 0.0);
            for (sum, (count, _)) in sums {
                mean_facing += sum;
                between += sum * sum / count;
            }
            let within = squares - between;
            let gain = product / within;
            (gain * product / variance, towards, gain, mean_facing / count)
        });
        let (explained, towards, gain, mean_facing) =
            tried.filter(|(_, _, gain, _)| *gain > 0.0).max_by(|a, b| a.0.total_cmp(&b.0))?;
        if explained.is_nan() || explained <= LEAST_EXPLAINED {
            return None;
        }
        // Of the mean luminance, 1, this much does not come from the light.
        let ambient = (1.0 - gain * mean_facing).max(0.1);
        Some((towards, (gain / (gain + ambient)).clamp(SHARE_LIMITS[0], SHARE_LIMITS[1])))
    }
}

/// Directions spread evenly over the half sphere around `up` (golden spiral).
fn half_sphere(index: u32, up: DVec3) -> DVec3 {
    let height = (f64::from(index) + 0.5) / f64::from(DIRECTIONS);
    let across = up.any_orthonormal_vector();
    let angle = f64::from(index) * std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let level = across * angle.cos() + up.cross(across) * angle.sin();
    up * height + level * (1.0 - height * height).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ar::synthetic::{Lamp, SyntheticRoom};

    #[test]
    fn the_direction_of_the_lamp_is_found() {
        for towards in [DVec3::new(0.6, 1.0, 0.3), DVec3::new(-0.5, 1.0, 0.5)] {
            let room =
                SyntheticRoom { lamp: Lamp { towards, ..Lamp::default() }, ..SyntheticRoom::default() };
            let picture = room.picture(&room.cameras()[0]);
            let light = RoomLight::estimate(&picture, &room.table());
            let off = light.towards.angle_between(towards.normalize()).to_degrees();
            println!("lamp {towards}: found {} ({off:.0}° off), {light:?}", light.towards);
            assert!(light.measured && off < 45.0, "{off}° off: {light:?}");
        }
    }

    #[test]
    fn a_warm_or_dim_lamp_shows_in_the_match() {
        let light_of = |colour: Vec3| {
            let room = SyntheticRoom { lamp: Lamp { colour, ..Lamp::default() }, ..SyntheticRoom::default() };
            RoomLight::estimate(&room.picture(&room.cameras()[0]), &room.table()).colour
        };
        let white = light_of(Vec3::ONE);
        let warm = light_of(Vec3::new(1.0, 0.75, 0.5));
        let dim = light_of(Vec3::splat(0.3));
        assert!(warm.x / warm.z > white.x / white.z * 1.1, "{white} and {warm}");
        assert!(dim.element_sum() < 0.8 * white.element_sum(), "{white} and {dim}");
    }

    #[test]
    fn a_picture_without_depth_or_light_is_no_failure() {
        let room = SyntheticRoom::default();
        let camera = room.cameras()[0];
        let [width, height] = camera.size_px;
        let black = image::RgbaImage::new(width, height);
        let picture = RoomPicture::new(black, vec![0.0; (width * height) as usize], camera).unwrap();
        let light = RoomLight::estimate(&picture, &room.table());
        assert!(!light.measured && light.colour.is_finite() && light.colour.min_element() > 0.0);
        assert!(light.towards.dot(DVec3::Y) > 0.8);
    }
}
