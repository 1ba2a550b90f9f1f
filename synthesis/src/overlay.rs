//! The score graphic that broadcasters lay over the picture: clock, teams, score, a fictional logo.

use glam::{Vec2, Vec3};
use image::{Rgb, RgbImage};

use crate::{lettering, outfit::Srgb};

/// What the graphic shows.
#[derive(Clone, Debug, PartialEq)]
pub struct ScoreBoard {
    /// Three letters of each team.
    pub teams: [String; 2],
    /// Its colour.
    pub colours: [Srgb; 2],
    /// Goals.
    pub score: [u8; 2],
    /// Seconds played at the first frame.
    pub clock_seconds: u32,
}

fn mix(image: &mut RgbImage, x: u32, y: u32, colour: Srgb, share: f32) {
    if share <= 0.0 || x >= image.width() || y >= image.height() {
        return;
    }
    let old = image.get_pixel(x, y).0.map(|c| f32::from(c) / 255.0);
    let new = Vec3::from(old).lerp(Vec3::from(colour), share.min(1.0)).to_array();
    image.put_pixel(x, y, Rgb(new.map(|c| (c * 255.0 + 0.5) as u8)));
}

/// A box with smooth edges.
fn panel(image: &mut RgbImage, low: Vec2, high: Vec2, colour: Srgb, share: f32) {
    for y in low.y.floor().max(0.0) as u32..=high.y.ceil().max(0.0) as u32 {
        for x in low.x.floor().max(0.0) as u32..=high.x.ceil().max(0.0) as u32 {
            let p = Vec2::new(x as f32, y as f32);
            let inside =
                (p - low + 0.5).clamp(Vec2::ZERO, Vec2::ONE) * (high - p + 0.5).clamp(Vec2::ZERO, Vec2::ONE);
            mix(image, x, y, colour, share * inside.x * inside.y);
        }
    }
}

fn write(image: &mut RgbImage, text: &str, at: Vec2, glyph: f32, weight: f32, colour: Srgb) {
    let size = Vec2::new(lettering::width(text), lettering::HEIGHT) * glyph;
    for y in (at.y - 3.0).max(0.0) as u32..(at.y + size.y + 4.0) as u32 {
        for x in (at.x - 3.0).max(0.0) as u32..(at.x + size.x + 4.0) as u32 {
            let p = (Vec2::new(x as f32, y as f32) - at) / glyph;
            mix(image, x, y, colour, lettering::ink(text, p, weight, 1.0 / glyph));
        }
    }
}

/// A disc with a ring and a small pitch in it: the fictional broadcaster's mark.
fn logo(image: &mut RgbImage, centre: Vec2, radius: f32) {
    for y in (centre.y - radius - 2.0).max(0.0) as u32..(centre.y + radius + 3.0) as u32 {
        for x in (centre.x - radius - 2.0).max(0.0) as u32..(centre.x + radius + 3.0) as u32 {
            let p = Vec2::new(x as f32, y as f32) - centre;
            let edge = |distance: f32| (distance + 0.5).clamp(0.0, 1.0);
            mix(image, x, y, [0.05, 0.55, 0.45], edge(radius - p.length()));
            mix(image, x, y, [0.95, 0.98, 0.97], edge(1.1 - (p.length() - radius * 0.52).abs()));
            let line = edge(0.9 - p.x.abs()) * edge(radius - 1.0 - p.length());
            mix(image, x, y, [0.95, 0.98, 0.97], line);
        }
    }
}

impl ScoreBoard {
    /// Draws the graphic for a moment, in the top left corner; sizes follow the picture's height.
    pub fn draw(&self, image: &mut RgbImage, seconds: f64) {
        let unit = image.height() as f32 / 720.0;
        let at = |x: f32, y: f32| Vec2::new(x, y) * unit;
        let (dark, light): (Srgb, Srgb) = ([0.04, 0.07, 0.13], [0.95, 0.96, 0.98]);
        panel(image, at(92.0, 40.0), at(452.0, 72.0), dark, 0.93);
        panel(image, at(92.0, 40.0), at(172.0, 72.0), [0.90, 0.92, 0.95], 0.95);
        let clock = self.clock_seconds + seconds.max(0.0) as u32;
        let time = format!("{:02}:{:02}", (clock / 60) % 100, clock % 60);
        write(image, &time, at(103.0, 48.0), 9.2 * unit, 0.22, dark);
        for (side, x) in [(0, 184.0), (1, 374.0)] {
            panel(image, at(x, 44.0), at(x + 5.0, 68.0), self.colours[side], 1.0);
            write(image, &self.teams[side], at(x + 14.0, 47.0), 11.0 * unit, 0.2, light);
        }
        panel(image, at(262.0, 40.0), at(364.0, 72.0), [0.05, 0.55, 0.45], 0.97);
        let score = format!("{}-{}", self.score[0], self.score[1]);
        write(image, &score, at(287.0, 46.0), 12.5 * unit, 0.24, light);
        panel(image, at(1066.0, 40.0), at(1196.0, 72.0), dark, 0.75);
        logo(image, at(1196.0, 56.0), 19.0 * unit);
        write(image, "HOLOPITCH", at(1078.0, 49.0), 8.2 * unit, 0.2, light);
    }
}
