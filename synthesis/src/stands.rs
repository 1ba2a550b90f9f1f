//! What stands behind the lines: boards, barrier, fascia and rows of people. Colours by position along and up the wall.

use glam::{Vec2, Vec3};

use crate::{
    lettering, noise,
    outfit::{Srgb, linear},
    stadium::Stadium,
};

impl Stadium {
    pub(crate) fn board(&self, along: f32, height: f32, sample: f32) -> Vec3 {
        const WIDTH: f32 = 9.0;
        let index = (along / WIDTH).floor();
        let x = along - index * WIDTH;
        let pick = (index as i32 + 1000).unsigned_abs() as usize;
        let Some(board) = self.boards.get(pick % self.boards.len().max(1)) else { return Vec3::splat(0.1) };
        let glyph = 0.38;
        let width = lettering::width(&board.text) * glyph;
        let place = Vec2::new((x - (WIDTH - width) / 2.0) / glyph, (0.78 - height) / glyph);
        let ink = lettering::ink(&board.text, place, 0.26, sample / glyph);
        let seam = if x < 0.06 { 0.6 } else { 1.0 };
        linear(board.ground).lerp(linear(board.ink), ink) * seam
    }

    pub(crate) fn barrier(&self, along: f32, height: f32, sample: f32) -> Vec3 {
        let rail = if (height - 1.25).abs() < 0.05 { 0.5 } else { 0.0 };
        let post = if (along / 1.5).rem_euclid(1.0) < 0.08f32.max(sample / 3.0) { 0.25 } else { 0.0 };
        Vec3::splat(0.05 + 0.12 * f32::max(rail, post)) * Vec3::new(0.95, 1.0, 1.1)
    }

    pub(crate) fn fascia(&self, along: f32, height: f32, sample: f32) -> Vec3 {
        if !(2.0..3.4).contains(&height) {
            return Vec3::new(0.020, 0.021, 0.025);
        }
        let text = "HOLOPITCH";
        let place = Vec2::new(along.rem_euclid(24.0) / 0.5 - 4.0, (3.1 - height) / 0.5);
        let ink = lettering::ink(text, place, 0.22, sample / 0.5);
        linear([0.03, 0.07, 0.20]).lerp(linear([0.55, 0.75, 0.95]), ink) * 0.6
    }

    /// Rows of people; `along` and `up` in metres, averaged over a few points of the pixel.
    pub(crate) fn seats(&self, along: f32, up: f32, sample: f32) -> Vec3 {
        let mut sum = Vec3::ZERO;
        const SIDE: i32 = 2;
        for k in 0..SIDE * SIDE {
            let dx = ((k % SIDE) as f32 + 0.5) / SIDE as f32 - 0.5;
            let dy = ((k / SIDE) as f32 + 0.5) / SIDE as f32 - 0.5;
            sum += self.seat(along + dx * sample, up + dy * sample * 1.3);
        }
        sum / (SIDE * SIDE) as f32
    }

    fn seat(&self, along: f32, up: f32) -> Vec3 {
        const ROW: f32 = 0.86;
        const PLACE: f32 = 0.56;
        let block = (along / 17.0).floor();
        let in_block = along - block * 17.0;
        if in_block < 1.1 {
            // Stairs between the blocks.
            let step = (up / (ROW / 2.0)).rem_euclid(1.0);
            return Vec3::splat(if step < 0.5 { 0.10 } else { 0.16 });
        }
        let row = (up / ROW).floor();
        let v = up - row * ROW; // 0 at the feet
        let lean = noise::unit(row as i32, block as i32, self.seed ^ 21) * PLACE;
        let place = ((in_block + lean) / PLACE).floor();
        let key = |salt: u32| noise::unit(place as i32 + block as i32 * 64, row as i32, self.seed ^ salt);
        let u = in_block + lean - place * PLACE - PLACE / 2.0 + (key(31) - 0.5) * 0.14;
        if key(32) > 0.93 {
            return linear([0.16, 0.20, 0.34]) * if v > 0.45 { 0.35 } else { 0.7 }; // an empty seat
        }
        let tall = 0.92 + 0.16 * (key(33) - 0.5);
        let shade = 0.75 + 0.5 * key(34);
        let from_head = Vec2::new(u, v - tall * 0.80);
        if from_head.length_squared() < 0.0125 {
            // Hair and hats on top, a face below.
            if from_head.y > 0.03 {
                return Vec3::splat(0.02 + 0.10 * key(43).powi(4));
            }
            let tone = key(35).powi(2);
            return linear([0.86 - 0.5 * tone, 0.68 - 0.45 * tone, 0.58 - 0.42 * tone]) * shade;
        }
        let shoulders = 0.25 - 1.6 * (v - tall * 0.56).max(0.0);
        if u.abs() < shoulders && v > 0.10 {
            let choice = key(36);
            let coat: Srgb = if choice < 0.42 {
                let grey = 0.10 + 0.18 * key(37);
                [grey, grey, grey * 1.12]
            } else if choice < 0.68 {
                [0.30 + 0.42 * key(38), 0.30 + 0.42 * key(38), 0.34 + 0.42 * key(38)]
            } else if choice < 0.86 && !self.crowd.is_empty() {
                self.crowd[(key(39) * self.crowd.len() as f32) as usize % self.crowd.len()]
            } else {
                [0.1 + key(40) * 0.6, 0.1 + key(41) * 0.45, 0.1 + key(42) * 0.45]
            };
            let fold = 0.45 + 0.35 * (v - 0.10) / 0.6;
            return linear(coat) * shade * fold;
        }
        Vec3::splat(0.022)
    }
}
