//! The people in the stands as one picture that repeats: rows of seats with people, aisles, empty places.
//! It is drawn once and kept at halved sizes (a mip map), so that a far stand is a quiet blur and a near one has faces.

use std::sync::{Arc, OnceLock};

use glam::{Vec2, Vec3};

use crate::{
    noise,
    outfit::{Srgb, linear},
};

/// Who is in the stands.
#[derive(Clone, Debug, PartialEq)]
pub struct CrowdLook {
    /// Colours that supporters wear.
    pub colours: Vec<Srgb>,
    /// Share of people in those colours.
    pub supporters: f32,
    /// Share of seats taken.
    pub full: f32,
    /// Colour of the seats.
    pub seats: Srgb,
    /// Brightness of the stands.
    pub light: f32,
}

/// One texel, metres.
const TEXEL_M: f32 = 0.06;
const WIDTH: usize = 1024;
const HEIGHT: usize = 512;
/// Rows and places of the repeated picture.
const ROWS: i32 = 36;
const PLACES: i32 = 112;
/// Aisles of the repeated picture.
const BLOCKS: f32 = 4.0;

/// The picture, drawn when it is first looked at.
#[derive(Clone, Debug)]
pub struct Crowd {
    look: CrowdLook,
    seed: u32,
    levels: Arc<OnceLock<Vec<Level>>>,
}

#[derive(Debug)]
struct Level {
    size: [usize; 2],
    texels: Vec<Vec3>,
}

impl Crowd {
    /// A crowd that looks like `look`.
    #[must_use]
    pub fn new(look: CrowdLook, seed: u32) -> Self {
        Self { look, seed, levels: Arc::new(OnceLock::new()) }
    }

    /// The crowd at a place, metres along and up the slope, averaged over about `sample_m`.
    #[must_use]
    pub fn colour(&self, along_m: f32, up_m: f32, sample_m: f32) -> Vec3 {
        let levels = self.levels.get_or_init(|| self.draw());
        // Half a level sharper than one texel per pixel: the camera's own blur does the rest.
        let level = ((sample_m / TEXEL_M).log2() - 0.3).clamp(0.0, (levels.len() - 1) as f32 - 1e-3);
        let index = level as usize;
        let at = Vec2::new(along_m, up_m) / TEXEL_M;
        let fine = levels[index].bilinear(at / (1 << index) as f32);
        fine.lerp(levels[index + 1].bilinear(at / (2 << index) as f32), level - index as f32)
    }

    fn draw(&self) -> Vec<Level> {
        let mut texels = Vec::with_capacity(WIDTH * HEIGHT);
        for y in 0..HEIGHT {
            for x in 0..WIDTH {
                texels.push(self.seat((x as f32 + 0.5) * TEXEL_M, (y as f32 + 0.5) * TEXEL_M));
            }
        }
        let mut levels = vec![Level { size: [WIDTH, HEIGHT], texels }];
        while let Some(last) = levels.last()
            && last.size[1] > 4
        {
            let size = last.size.map(|s| s / 2);
            let mut texels = Vec::with_capacity(size[0] * size[1]);
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let first = 2 * y * last.size[0] + 2 * x;
                    let below = first + last.size[0];
                    let four = [first, first + 1, below, below + 1].map(|k| last.texels[k]);
                    texels.push(four.iter().sum::<Vec3>() / 4.0);
                }
            }
            levels.push(Level { size, texels });
        }
        levels
    }

    /// One point of the picture.
    fn seat(&self, along: f32, up: f32) -> Vec3 {
        let (wide, high) = (WIDTH as f32 * TEXEL_M, HEIGHT as f32 * TEXEL_M);
        let (row_m, place_m, block_m) = (high / ROWS as f32, wide / PLACES as f32, wide / BLOCKS);
        let row = (up / row_m) as i32;
        let v = up - row as f32 * row_m; // 0 at the feet
        let in_block = along.rem_euclid(block_m);
        if in_block < 1.05 {
            // Stairs between the blocks, with somebody on them now and then.
            let busy = noise::unit(row, (along / block_m) as i32, self.seed ^ 77) > 0.93;
            if !(busy && (in_block - 0.5).abs() < 0.24 && v > 0.05) {
                let step = (up / (row_m / 2.0)).rem_euclid(1.0);
                return Vec3::splat(if step < 0.5 { 0.07 } else { 0.13 });
            }
        }
        // Who sits a row further down is in front: heads and shoulders reach over the feet of the next row.
        let lower = self.person(along, up, row - 1, v + row_m, [place_m, row_m]);
        lower.or_else(|| self.person(along, up, row, v, [place_m, row_m])).unwrap_or_else(|| {
            let place = (along / place_m) as i32;
            let taken = self.taken(place, row);
            if taken {
                return Vec3::splat(0.026);
            }
            let folded = if v < 0.45 { 0.75 } else { 0.4 };
            let gap = if (along - (place as f32 + 0.5) * place_m).abs() > 0.24 { 0.45 } else { 1.0 };
            linear(self.look.seats) * (0.6 * folded * gap)
        })
    }

    /// Whether somebody has taken a place. Empty ones come in patches.
    fn taken(&self, place: i32, row: i32) -> bool {
        let patch = noise::value(Vec2::new(place as f32 * 0.19, row as f32 * 0.43), self.seed ^ 51);
        let empty = (1.0 - self.look.full).min(0.5);
        noise::unit(place, row.rem_euclid(ROWS), self.seed ^ 32) <= self.look.full + 0.25 * patch * empty
    }

    /// The person of a row at a point `v` metres above their feet, if there is somebody.
    fn person(&self, along: f32, up: f32, row: i32, v: f32, [place_m, row_m]: [f32; 2]) -> Option<Vec3> {
        let row = row.rem_euclid(ROWS);
        let place = (along / place_m) as i32;
        let key = |salt: u32| noise::unit(place, row, self.seed ^ salt);
        if !self.taken(place, row) {
            return None;
        }
        let u = along - (place as f32 + 0.5) * place_m + (key(31) - 0.5) * 0.20;
        let stands = noise::value(Vec2::new(place as f32 * 0.11, row as f32 * 0.17), self.seed ^ 61) > 0.5;
        let tall = row_m * (1.02 + 0.28 * (key(33) - 0.5)) + if stands { 0.18 } else { 0.0 };
        let shade = 0.65 + 0.6 * key(34);
        let from_head = Vec2::new(u * (0.95 + 0.2 * key(46)), (v - tall + 0.12) * 0.85);
        if from_head.length_squared() < 0.0115 {
            if from_head.y > 0.02 + 0.05 * (key(44) - 0.5) {
                // Hair and hats on top, a face below.
                return Some(Vec3::splat(0.02 + 0.14 * key(43).powi(4)));
            }
            let tone = key(35).powi(2);
            return Some(linear([0.80 - 0.5 * tone, 0.62 - 0.42 * tone, 0.52 - 0.38 * tone]) * shade);
        }
        let neck = tall - 0.24;
        let shoulders = 0.17 + 0.05 * key(45) - 1.3 * (v - neck + 0.10).max(0.0);
        // Now and then an arm is up.
        let arm = key(47) > 0.93 && (u - 0.2).abs() < 0.05 && v > neck - 0.1 && v < tall + 0.12;
        if (u.abs() < shoulders && v > 0.02 && v < neck + 0.12) || arm {
            // Folds, arms and what people hold break a coat into light and dark.
            let creases = noise::value(Vec2::new(along, up) * 9.0, self.seed ^ 71);
            let fold = (0.35 + 0.45 * (v / neck).clamp(0.0, 1.0)) * (1.0 + 0.55 * creases);
            return Some(linear(self.coat(key(36), [key(37), key(38), key(39)])) * shade * fold);
        }
        None
    }

    fn coat(&self, choice: f32, random: [f32; 3]) -> Srgb {
        let club = self.look.supporters;
        if choice < club && !self.look.colours.is_empty() {
            return self.look.colours
                [(random[0] * self.look.colours.len() as f32) as usize % self.look.colours.len()];
        }
        match (choice - club) / (1.0 - club).max(1e-3) {
            c if c < 0.55 => {
                let grey = 0.07 + 0.20 * random[0];
                [grey, grey, grey * (1.0 + 0.25 * random[1])]
            }
            c if c < 0.80 => {
                let light = 0.30 + 0.45 * random[0];
                [light, light * (0.95 + 0.05 * random[1]), light * (0.85 + 0.2 * random[2])]
            }
            _ => {
                // Few clothes are of a pure colour.
                let mean = (random[0] + random[1] + random[2]) / 3.0;
                random.map(|r| 0.08 + 0.42 * (0.5 * mean + 0.5 * r))
            }
        }
    }
}

impl Level {
    /// Between four texels; the picture repeats.
    fn bilinear(&self, at: Vec2) -> Vec3 {
        let [width, height] = self.size;
        // Far enough from zero that truncation rounds down.
        let (x, y) = (at.x - 0.5 + (width * 64) as f32, at.y - 0.5 + (height * 64) as f32);
        let (x0, y0) = (x as usize, y as usize);
        let (fx, fy) = (x - x0 as f32, y - y0 as f32);
        // Sizes are powers of two.
        let (left, right) = (x0 & (width - 1), (x0 + 1) & (width - 1));
        let (top, bottom) = ((y0 & (height - 1)) * width, ((y0 + 1) & (height - 1)) * width);
        let above = self.texels[top + left].lerp(self.texels[top + right], fx);
        above.lerp(self.texels[bottom + left].lerp(self.texels[bottom + right], fx), fy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(full: f32) -> CrowdLook {
        CrowdLook {
            colours: vec![[0.8, 0.1, 0.1]],
            supporters: 0.4,
            full,
            seats: [0.1, 0.2, 0.8],
            light: 0.5,
        }
    }

    #[test]
    fn a_far_stand_is_a_quiet_blur_of_the_same_colour_as_a_near_one() {
        let crowd = Crowd::new(look(0.9), 4);
        let (mut near, mut far) = (Vec::new(), Vec::new());
        for k in 0..4000 {
            let (along, up) = ((k % 80) as f32 * 0.77, (k / 80) as f32 * 0.61);
            near.push(crowd.colour(along, up, 0.05));
            far.push(crowd.colour(along, up, 0.9));
        }
        let mean = |all: &[Vec3]| all.iter().sum::<Vec3>() / all.len() as f32;
        let spread = |all: &[Vec3]| {
            let m = mean(all);
            (all.iter().map(|c| (*c - m).length_squared()).sum::<f32>() / all.len() as f32).sqrt()
        };
        assert!((mean(&near) - mean(&far)).length() < 0.02, "{} and {}", mean(&near), mean(&far));
        assert!(spread(&far) < 0.5 * spread(&near));
    }

    #[test]
    fn an_empty_stand_shows_its_seats() {
        let blue = |full: f32| {
            let crowd = Crowd::new(look(full), 4);
            let colour = crowd.colour(20.0, 10.0, 3.0);
            colour.z / colour.x
        };
        assert!(blue(0.05) > 2.0 * blue(0.95));
    }
}
