//! The colour of a person's surface: kit pattern, number, skin, hair, and how light falls on it.

use glam::{Vec2, Vec3};

use crate::{
    body::Bone,
    figure::{Figure, Material},
    lettering, noise,
    outfit::{Pattern, linear},
};

/// Light on the pitch: lamps (sun or floodlights) and the sky. Radiance is linear; a white surface facing all of it is 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Lights {
    /// Direction towards the lamp (unit) and its colour times strength.
    pub lamps: Vec<(Vec3, Vec3)>,
    /// Light from above.
    pub sky: Vec3,
    /// Light thrown back by the grass.
    pub bounce: Vec3,
}

impl Lights {
    /// Light that falls on a surface with unit normal `normal`; `open` is the share of the sky that it sees.
    #[must_use]
    pub fn on(&self, normal: Vec3, open: f32) -> Vec3 {
        let up = 0.5 + 0.5 * normal.y;
        let ambient = (self.sky * up + self.bounce * (1.0 - up)) * open;
        self.lamps
            .iter()
            .fold(ambient, |sum, (direction, colour)| sum + *colour * normal.dot(*direction).max(0.0))
    }

    /// Evening match: four masts, weak sky.
    #[must_use]
    pub fn floodlights() -> Self {
        let mast = |x: f32, z: f32, strength: f32| {
            (Vec3::new(x, 34.0, z).normalize(), Vec3::new(1.0, 0.985, 0.95) * strength)
        };
        Self {
            lamps: vec![
                mast(70.0, 55.0, 0.27),
                mast(-70.0, 55.0, 0.27),
                mast(70.0, -55.0, 0.20),
                mast(-70.0, -55.0, 0.20),
            ],
            sky: Vec3::new(0.44, 0.46, 0.50),
            bounce: Vec3::new(0.17, 0.20, 0.11),
        }
    }

    /// Sunshine from `direction`, `strength` 0 (overcast) to 1.
    #[must_use]
    pub fn sun(direction: Vec3, strength: f32) -> Self {
        let direction = direction.normalize_or(Vec3::Y);
        let side = direction.cross(Vec3::Y).normalize_or(Vec3::X);
        let colour = Vec3::new(1.0, 0.96, 0.88) * (0.85 * strength / 3.0);
        // Three neighbouring suns soften the edge of the shadow.
        let lamps =
            [-0.02f32, 0.0, 0.02].map(|turn| ((direction + side * turn).normalize(), colour)).to_vec();
        Self {
            lamps,
            sky: Vec3::new(0.55, 0.60, 0.68) * (1.25 - 0.65 * strength),
            bounce: Vec3::new(0.16, 0.20, 0.10) * (0.6 + 0.4 * strength),
        }
    }
}

/// Where on a figure a sample lies.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// Rest position.
    pub rest: Vec3,
    /// Unit normal in the world, not yet wrinkled.
    pub normal: Vec3,
    /// Distance to the nearest hem, metres.
    pub hem_m: f32,
    /// What it is made of.
    pub material: Material,
}

/// Stripes of two colours, softened over `soft` metres.
fn stripe(at: f32, wide: f32) -> f32 {
    let place = (at / wide).rem_euclid(2.0);
    if place < 1.0 { 0.0 } else { 1.0 }
}

/// The colour of a surface without light, linear; world light is applied by [`lit`].
#[must_use]
pub fn albedo(figure: &Figure, point: &SurfacePoint) -> Vec3 {
    let outfit = &figure.outfit;
    let kit = &outfit.kit;
    let rest = point.rest;
    match point.material {
        Material::Skin => skin(figure, rest),
        Material::Hair => outfit.hair.map_or(Vec3::splat(0.05), |hair| {
            linear(hair.colour) * (0.8 + 0.4 * noise::value(Vec2::new(rest.x, rest.z) * 60.0, 5).abs())
        }),
        Material::Eye => linear([0.35, 0.33, 0.32]),
        Material::Shirt | Material::Sleeve => {
            let (shirt, second) = (linear(kit.shirt), linear(kit.second));
            let sleeve = point.material == Material::Sleeve;
            if point.hem_m < 0.018 && (sleeve || rest.y > figure.body.head(Bone::Neck).y - 0.08) {
                return linear(kit.trim);
            }
            if !sleeve && let Some(ink) = shirt_number(figure, rest) {
                let base = shirt;
                return base.lerp(linear(kit.number), ink);
            }
            let mix = match kit.pattern {
                Pattern::Plain => 0.0,
                Pattern::Stripes(wide) => stripe(rest.x + wide / 2.0, wide),
                Pattern::Hoops(high) => stripe(rest.y, high),
                Pattern::Halves => f32::from(u8::from(rest.x > 0.0)),
                Pattern::Sleeves => f32::from(u8::from(sleeve)),
                Pattern::Sash(wide) => {
                    f32::from(u8::from(!sleeve && (rest.x - rest.y + 0.3).abs() < wide && rest.z > 0.0))
                }
            };
            let cloth = shirt.lerp(second, mix);
            match sponsor(figure, rest).filter(|_| !sleeve) {
                Some((ink, colour)) => cloth.lerp(colour, ink),
                None => cloth,
            }
        }
        Material::Shorts => {
            let side = Vec2::new(rest.z - figure.body.hips().z, 0.0).x.abs();
            let piping = side < 0.012 && rest.x.abs() > 0.12;
            if piping { linear(kit.trim) } else { linear(kit.shorts) }
        }
        Material::Sock => {
            if point.hem_m < 0.045 && point.hem_m > 0.02 && rest.y > figure.body.head(Bone::FootL).y + 0.15 {
                linear(kit.trim)
            } else {
                linear(kit.socks)
            }
        }
        Material::Glove => {
            let colour = linear(outfit.gloves.unwrap_or(outfit.skin));
            // The strap round the wrist.
            if point.hem_m < 0.035 { colour * 0.45 } else { colour }
        }
        Material::Boot => {
            let sole = figure.body.head(Bone::FootL).y - rest.y > 0.070;
            if sole { linear([0.12, 0.12, 0.12]) } else { linear(outfit.boots) }
        }
    }
}

fn skin(figure: &Figure, rest: Vec3) -> Vec3 {
    let outfit = &figure.outfit;
    let base = linear(outfit.skin);
    let head = figure.body.head(Bone::Head);
    let p = rest - head;
    let mut colour = base;
    if p.y > -0.06 && p.z > 0.05 && p.x.abs() < 0.08 {
        // Sockets and brows, and the mouth: dark at a distance, they make a face read as one.
        let brow = ((p.x.abs() - 0.032) / 0.022).powi(2) + ((p.y - 0.052) / 0.016).powi(2);
        let mouth = (p.x / 0.026).powi(2) + ((p.y + 0.028) / 0.009).powi(2);
        if brow < 1.0 {
            colour *= 0.55;
        } else if mouth < 1.0 {
            colour *= Vec3::new(0.75, 0.5, 0.5);
        }
    }
    if outfit.hair.is_none_or(|hair| hair.volume_m < 0.01) {
        // Stubble of a shaved head.
        let high = p.y - 0.12 + 0.9 * (0.10 - p.z).clamp(0.0, 0.2);
        if high > 0.0 && outfit.hair.is_some() {
            colour *= 0.8;
        }
    }
    colour
}

/// A glyph's width, and the metres that one unit of its height takes, on the back: 27 cm tall with strokes of 3 cm, where competitions
/// ask for 25 to 35 cm and 2 to 5 cm.
const BACK_GLYPH_M: Vec2 = Vec2::new(0.115, 0.150);

/// Ink of the number at a rest point of the trunk, when it lies in the box of the number.
fn shirt_number(figure: &Figure, rest: Vec3) -> Option<f32> {
    let number = figure.outfit.number?;
    let chest = figure.body.head(Bone::Spine3);
    let text = number.to_string();
    // Big on the back (seen from behind, left is +x), small on the chest.
    let (glyph_m, top, across) = if rest.z < chest.z - 0.02 {
        (BACK_GLYPH_M, chest.y + 0.205, -rest.x)
    } else if rest.z > chest.z + 0.05 {
        (Vec2::splat(0.036), chest.y + 0.125, rest.x + 0.075)
    } else {
        return None;
    };
    let place = Vec2::new(across / glyph_m.x + lettering::width(&text) / 2.0, (top - rest.y) / glyph_m.y);
    let inside = place.x > -0.3
        && place.x < lettering::width(&text) + 0.3
        && place.y > -0.3
        && place.y < lettering::HEIGHT + 0.3;
    inside.then(|| lettering::ink(&text, place, 0.24, 0.06))
}

/// The sponsor's block at a rest point of the chest: how much of it covers the cloth there, and its colour.
fn sponsor(figure: &Figure, rest: Vec3) -> Option<(f32, Vec3)> {
    let sponsor = figure.outfit.kit.sponsor.as_ref()?;
    let chest = figure.body.head(Bone::Spine3);
    if rest.z < chest.z + 0.05 {
        return None;
    }
    let wide = lettering::width(&sponsor.text);
    let glyph_m = (0.25 / wide).min(0.034);
    let place = Vec2::new(rest.x / glyph_m + wide / 2.0, (chest.y + 0.035 - rest.y) / glyph_m);
    let edge = 0.5;
    let inside =
        place.x > -edge && place.x < wide + edge && place.y > -edge && place.y < lettering::HEIGHT + edge;
    inside.then(|| {
        let ink = lettering::ink(&sponsor.text, place, 0.26, 0.08);
        match sponsor.bar {
            Some(bar) => (1.0, linear(bar).lerp(linear(sponsor.ink), ink)),
            None => (ink, linear(sponsor.ink)),
        }
    })
}

/// Light leaving a surface point.
#[must_use]
pub fn lit(
    figure: &Figure,
    point: &SurfacePoint,
    towards_camera: Vec3,
    lights: &Lights,
    height_m: f32,
) -> Vec3 {
    let cloth = matches!(point.material, Material::Shirt | Material::Sleeve | Material::Shorts);
    let mut normal = point.normal;
    if cloth {
        let strength = 0.20 + 9.0 * figure.outfit.looseness_m;
        normal += (noise::wrinkle(point.rest * Vec3::new(13.0, 9.0, 13.0), 11) * 0.7
            + noise::wrinkle(point.rest * 27.0, 23) * 0.45)
            * strength;
    }
    let normal = normal.normalize_or(point.normal);
    // Open cloth is seen from both sides.
    let normal = if point.normal.dot(towards_camera) < 0.0 { -normal } else { normal };
    // Close to the ground less of the sky is seen, and limbs shade each other.
    let open = 0.72 + 0.28 * (height_m / 1.2).clamp(0.0, 1.0);
    let colour = albedo(figure, point) * lights.on(normal, open);
    let shine = match point.material {
        Material::Skin => 0.045,
        Material::Hair => 0.03,
        Material::Boot => 0.08,
        _ => 0.012,
    };
    let glint: f32 = lights
        .lamps
        .iter()
        .map(|(direction, radiance)| {
            (*direction + towards_camera).normalize_or(normal).dot(normal).max(0.0).powi(24) * radiance.y
        })
        .sum();
    colour + Vec3::splat(glint * shine)
}
