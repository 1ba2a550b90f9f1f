//! Graphics that broadcasters lay over the picture: a score box in one of several layouts, and a fictional channel's logo.

use glam::{Vec2, Vec3};
use image::{Rgb, RgbImage};
use rand::{Rng, seq::IndexedRandom};

use crate::{lettering, outfit::Srgb};

/// How the score box is laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Clock, team, score, team in one row.
    Bar,
    /// Team and goals, goals and team, then the clock.
    Split,
    /// One row per team, the clock below.
    Stacked,
    /// Team, score, team; the clock below the score.
    Centred,
}

/// The style of a channel's graphics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Where everything of the score box is.
    pub layout: Layout,
    /// Its top left corner in units of a picture of 720 lines.
    pub corner: [f32; 2],
    /// Height of a row in the same units.
    pub row: f32,
    /// Background and letters.
    pub ground: Srgb,
    /// Letters on the background.
    pub ink: Srgb,
    /// Background of the score.
    pub accent: Srgb,
    /// Letters on the accent.
    pub accent_ink: Srgb,
    /// How opaque it is.
    pub share: f32,
    /// Whether the score box is shown.
    pub score_shown: bool,
    /// The channel's mark, when shown: distance from the right border and from the top, and how opaque it is.
    pub logo: Option<[f32; 3]>,
}

impl Style {
    /// The plain style of the demonstration.
    #[must_use]
    pub fn plain() -> Self {
        Self {
            layout: Layout::Bar,
            corner: [92.0, 40.0],
            row: 32.0,
            ground: [0.04, 0.07, 0.13],
            ink: [0.95, 0.96, 0.98],
            accent: [0.05, 0.42, 0.35],
            accent_ink: [0.95, 0.96, 0.98],
            share: 0.95,
            score_shown: true,
            logo: Some([84.0, 56.0, 1.0]),
        }
    }

    /// A style drawn at random.
    pub fn drawn(rng: &mut impl Rng) -> Self {
        let layouts = [Layout::Bar, Layout::Split, Layout::Stacked, Layout::Centred];
        let dark: [Srgb; 4] =
            [[0.04, 0.07, 0.13], [0.02, 0.02, 0.02], [0.16, 0.04, 0.22], [0.05, 0.12, 0.30]];
        let light: [Srgb; 3] = [[0.95, 0.96, 0.98], [0.90, 0.92, 0.94], [0.98, 0.96, 0.90]];
        let (dark, light) = (*dark.choose(rng).unwrap_or(&dark[0]), *light.choose(rng).unwrap_or(&light[0]));
        let (ground, ink) = if rng.random_bool(0.6) { (dark, light) } else { (light, dark) };
        let accents: [Srgb; 4] =
            [[0.05, 0.42, 0.35], [0.62, 0.05, 0.10], [0.08, 0.20, 0.60], [0.20, 0.20, 0.22]];
        let logo = rng.random_bool(0.7).then(|| {
            let low = rng.random_bool(0.35);
            let down = if low { rng.random_range(640.0..680.0) } else { rng.random_range(44.0..70.0) };
            [rng.random_range(60.0..110.0), down, rng.random_range(0.35..1.0)]
        });
        Self {
            layout: *layouts.choose(rng).unwrap_or(&Layout::Bar),
            corner: [rng.random_range(48.0..120.0), rng.random_range(28.0..56.0)],
            row: rng.random_range(24.0..34.0),
            ground,
            ink,
            accent: *accents.choose(rng).unwrap_or(&accents[0]),
            accent_ink: [0.96, 0.97, 0.98],
            share: rng.random_range(0.80..1.0),
            score_shown: rng.random_bool(0.85),
            logo,
        }
    }
}

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
    /// How it looks.
    pub style: Style,
}

/// A box with text in it, in units of a picture of 720 lines.
#[derive(Clone, Debug, PartialEq)]
struct Cell {
    low: Vec2,
    size: Vec2,
    text: String,
    ground: Srgb,
    ink: Srgb,
}

impl Cell {
    /// Width of a letter: as high as 56 % of the row, or as wide as fits.
    fn glyph(&self) -> f32 {
        let fits = (self.size.x - 6.0) / lettering::width(&self.text).max(1.0);
        (self.size.y * 0.56 / lettering::HEIGHT).min(fits)
    }
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

fn write(image: &mut RgbImage, text: &str, at: Vec2, glyph: f32, weight: f32, colour: Srgb, share: f32) {
    let size = Vec2::new(lettering::width(text), lettering::HEIGHT) * glyph;
    for y in (at.y - 3.0).max(0.0) as u32..(at.y + size.y + 4.0) as u32 {
        for x in (at.x - 3.0).max(0.0) as u32..(at.x + size.x + 4.0) as u32 {
            let p = (Vec2::new(x as f32, y as f32) - at) / glyph;
            mix(image, x, y, colour, share * lettering::ink(text, p, weight, 1.0 / glyph));
        }
    }
}

/// A disc with a ring and a small pitch in it: the fictional broadcaster's mark.
fn mark(image: &mut RgbImage, centre: Vec2, radius: f32, share: f32) {
    for y in (centre.y - radius - 2.0).max(0.0) as u32..(centre.y + radius + 3.0) as u32 {
        for x in (centre.x - radius - 2.0).max(0.0) as u32..(centre.x + radius + 3.0) as u32 {
            let p = Vec2::new(x as f32, y as f32) - centre;
            let edge = |distance: f32| (distance + 0.5).clamp(0.0, 1.0) * share;
            mix(image, x, y, [0.05, 0.55, 0.45], edge(radius - p.length()));
            mix(image, x, y, [0.95, 0.98, 0.97], edge(1.1 - (p.length() - radius * 0.52).abs()));
            let line = edge(0.9 - p.x.abs()) * edge(radius - 1.0 - p.length());
            mix(image, x, y, [0.95, 0.98, 0.97], line);
        }
    }
}

impl ScoreBoard {
    /// The boxes of the graphic at a moment.
    fn cells(&self, seconds: f64) -> Vec<Cell> {
        let style = &self.style;
        let clock = self.clock_seconds + seconds.max(0.0) as u32;
        let time = format!("{:02}:{:02}", (clock / 60) % 100, clock % 60);
        let [home, away] = self.score.map(|goals| goals.to_string());
        let high = style.row;
        let cell = |x: f32, y: f32, width: f32, text: &str, accent: bool| Cell {
            low: Vec2::from(style.corner) + Vec2::new(x, y) * high,
            size: Vec2::new(width, 1.0) * high,
            text: text.to_owned(),
            ground: if accent { style.accent } else { style.ground },
            ink: if accent { style.accent_ink } else { style.ink },
        };
        let [first, second] = [0, 1].map(|side| self.teams[side].as_str());
        match style.layout {
            Layout::Bar => vec![
                cell(0.0, 0.0, 2.6, &time, false),
                cell(2.6, 0.0, 2.8, first, false),
                cell(5.4, 0.0, 2.6, &format!("{home}-{away}"), true),
                cell(8.0, 0.0, 2.8, second, false),
            ],
            Layout::Split => vec![
                cell(0.0, 0.0, 2.7, first, false),
                cell(2.7, 0.0, 1.2, &home, true),
                cell(3.9, 0.0, 1.2, &away, true),
                cell(5.1, 0.0, 2.7, second, false),
                cell(7.9, 0.0, 2.4, &time, false),
            ],
            Layout::Stacked => vec![
                cell(0.0, 0.0, 2.8, first, false),
                cell(2.8, 0.0, 1.2, &home, true),
                cell(0.0, 1.0, 2.8, second, false),
                cell(2.8, 1.0, 1.2, &away, true),
                cell(0.0, 2.05, 4.0, &time, false),
            ],
            Layout::Centred => vec![
                cell(0.0, 0.0, 2.8, first, false),
                cell(2.8, 0.0, 2.4, &format!("{home}-{away}"), true),
                cell(5.2, 0.0, 2.8, second, false),
                cell(2.8, 1.0, 2.4, &time, false),
            ],
        }
    }

    /// Draws the graphics for a moment; sizes follow the picture's height.
    pub fn draw(&self, image: &mut RgbImage, seconds: f64) {
        let unit = image.height() as f32 / 720.0;
        let style = &self.style;
        if style.score_shown {
            for cell in self.cells(seconds) {
                let (low, high) = (cell.low * unit, (cell.low + cell.size) * unit);
                panel(image, low, high, cell.ground, style.share);
                if let Some(side) = self.teams.iter().position(|team| *team == cell.text) {
                    // The team's colour along its name.
                    let band = Vec2::new(low.x + 4.0 * unit, high.y - 5.0 * unit);
                    panel(
                        image,
                        band,
                        Vec2::new(high.x - 4.0 * unit, high.y - 2.0 * unit),
                        self.colours[side],
                        1.0,
                    );
                }
                let glyph = cell.glyph() * unit;
                let text = Vec2::new(lettering::width(&cell.text), lettering::HEIGHT) * glyph;
                write(
                    image,
                    &cell.text,
                    (low + high - text) / 2.0 - Vec2::Y * unit,
                    glyph,
                    0.24,
                    cell.ink,
                    1.0,
                );
            }
        }
        if let Some([right, down, share]) = style.logo {
            let centre = Vec2::new(image.width() as f32 - right * unit, down * unit);
            mark(image, centre, 19.0 * unit, share);
            let glyph = 8.2 * unit;
            let width = lettering::width("HOLOPITCH") * glyph;
            let at = centre - Vec2::new(width + 26.0 * unit, glyph * 0.8);
            write(image, "HOLOPITCH", at, glyph, 0.22, [0.95, 0.96, 0.98], share);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    fn board(style: Style) -> ScoreBoard {
        ScoreBoard {
            teams: ["HAR".into(), "FOR".into()],
            colours: [[0.9, 0.1, 0.1], [0.1, 0.1, 0.9]],
            score: [2, 10],
            clock_seconds: 27 * 60 + 14,
            style,
        }
    }

    /// Contrast of two colours as the Web Content Accessibility Guidelines define it.
    fn contrast(a: Srgb, b: Srgb) -> f32 {
        let bright = |c: Srgb| crate::outfit::linear(c).dot(Vec3::new(0.2126, 0.7152, 0.0722)) + 0.05;
        let (a, b) = (bright(a), bright(b));
        a.max(b) / a.min(b)
    }

    #[test]
    fn every_layout_is_inside_the_picture_apart_and_legible() {
        let rng = &mut Pcg64Mcg::seed_from_u64(8);
        let mut layouts = Vec::new();
        for _ in 0..60 {
            let style = Style { score_shown: true, ..Style::drawn(rng) };
            layouts.push(style.layout as u8);
            let board = board(style);
            let cells = board.cells(0.0);
            for (k, cell) in cells.iter().enumerate() {
                let high = cell.low + cell.size;
                assert!(cell.low.min_element() >= 0.0 && high.x < 640.0 && high.y < 200.0);
                assert!(
                    lettering::width(&cell.text) * cell.glyph() <= cell.size.x - 5.0,
                    "{} runs over",
                    cell.text
                );
                assert!(cell.glyph() * lettering::HEIGHT >= 11.0, "{} is too small", cell.text);
                // 4.5 is what the guidelines ask of small text.
                assert!(contrast(cell.ground, cell.ink) > 4.5, "{:?} on {:?}", cell.ink, cell.ground);
                for other in &cells[k + 1..] {
                    let apart = (cell.low + cell.size - 0.01).cmple(other.low).any()
                        || (other.low + other.size - 0.01).cmple(cell.low).any();
                    assert!(apart, "{} covers {}", cell.text, other.text);
                }
            }
        }
        layouts.sort_unstable();
        layouts.dedup();
        assert_eq!(layouts.len(), 4);
    }

    #[test]
    fn the_clock_runs_and_nothing_is_drawn_when_nothing_is_shown() {
        let shown = |style: Style, seconds: f64| {
            let mut image = RgbImage::from_pixel(1280, 720, Rgb([60, 100, 50]));
            board(style).draw(&mut image, seconds);
            image
        };
        assert_ne!(shown(Style::plain(), 0.0), shown(Style::plain(), 1.0));
        assert_eq!(shown(Style::plain(), 0.0), shown(Style::plain(), 0.9));
        let empty = Style { score_shown: false, logo: None, ..Style::plain() };
        assert!(shown(empty, 0.0).pixels().all(|p| p.0 == [60, 100, 50]));
    }
}
