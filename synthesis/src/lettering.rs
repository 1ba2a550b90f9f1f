//! Letters and digits as strokes, so that shirt numbers, boards and the score graphic are smooth at any size.
//! A glyph lives in a box 0..1 wide (from the left) and 0..1.6 high (from the top).

use glam::Vec2;

/// Height of a glyph in units of its width.
pub const HEIGHT: f32 = 1.6;
/// From one glyph to the next, in units of the width.
pub const ADVANCE: f32 = 1.38;

/// The strokes of a glyph as corners on a grid of 4 × 6 steps; '|' lifts the pen. Two characters per corner: x, y.
fn strokes(glyph: char) -> &'static str {
    match glyph {
        'A' => "06 01 10 30 41 46|03 43",
        'B' => "00 06 36 45 44 33 03|33 42 41 30 00",
        'C' => "41 30 10 01 05 16 36 45",
        'D' => "00 06 26 44 42 20 00",
        'E' => "40 00 06 46|03 33",
        'F' => "40 00 06|03 33",
        'G' => "41 30 10 01 05 16 36 45 43 23",
        'H' => "00 06|40 46|03 43",
        'I' => "20 26",
        'J' => "40 45 36 16 05",
        'K' => "00 06|40 03 46",
        'L' => "00 06 46",
        'M' => "06 00 23 40 46",
        'N' => "06 00 46 40",
        'O' | '0' => "10 30 41 45 36 16 05 01 10",
        'P' => "06 00 30 41 42 33 03",
        'Q' => "10 30 41 45 36 16 05 01 10|34 46",
        'R' => "06 00 30 41 42 33 03|23 46",
        'S' => "41 30 10 01 02 13 33 44 45 36 16 05",
        'T' => "00 40|20 26",
        'U' => "00 05 16 36 45 40",
        'V' => "00 26 40",
        'W' => "00 16 22 36 40",
        'X' => "00 46|40 06",
        'Y' => "00 23 40|23 26",
        'Z' => "00 40 06 46",
        '1' => "11 20 26|16 36",
        '2' => "01 10 30 41 42 06 46",
        '3' => "01 10 30 41 42 33 44 45 36 16 05|33 13",
        '4' => "36 30 04 44",
        '5' => "40 00 03 33 44 45 36 16 05",
        '6' => "41 30 10 01 05 16 36 45 44 33 03",
        '7' => "00 40 16",
        '8' => "10 30 41 42 33 13 02 01 10|13 04 05 16 36 45 44 33",
        '9' => "05 16 36 45 41 30 10 01 02 13 43",
        ':' => "22 22|24 24",
        '-' => "13 33",
        '.' => "26 26",
        _ => "",
    }
}

/// Distance from `p` to the strokes of `glyph`, in units of the glyph's width.
#[must_use]
pub fn distance(glyph: char, p: Vec2) -> f32 {
    let mut nearest = f32::MAX;
    for line in strokes(glyph).split('|') {
        let mut previous: Option<Vec2> = None;
        for corner in line.split(' ') {
            let mut digits = corner.bytes().map(|b| f32::from(b.wrapping_sub(b'0')));
            let (Some(x), Some(y)) = (digits.next(), digits.next()) else { continue };
            let corner = Vec2::new(x / 4.0, y / 6.0 * HEIGHT);
            let from = previous.unwrap_or(corner);
            let along = corner - from;
            let share = ((p - from).dot(along) / along.length_squared().max(1e-9)).clamp(0.0, 1.0);
            nearest = nearest.min(p.distance(from + along * share));
            previous = Some(corner);
        }
    }
    nearest
}

/// Width of a text in units of a glyph's width.
#[must_use]
pub fn width(text: &str) -> f32 {
    text.chars().count() as f32 * ADVANCE - (ADVANCE - 1.0)
}

/// How much of a sample of size `sample` (in glyph widths) at `p` from the text's top-left corner is ink, 0..1.
#[must_use]
pub fn ink(text: &str, p: Vec2, stroke: f32, sample: f32) -> f32 {
    if p.y < -0.3 || p.y > HEIGHT + 0.3 || p.x < -0.3 {
        return 0.0;
    }
    let index = ((p.x + (ADVANCE - 1.0) / 2.0) / ADVANCE).floor().max(0.0);
    match text.chars().nth(index as usize) {
        Some(glyph) => {
            let d = distance(glyph, p - Vec2::new(index * ADVANCE, 0.0));
            ((stroke / 2.0 - d) / sample.max(1e-4) + 0.5).clamp(0.0, 1.0)
        }
        None => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_letter_and_digit_has_strokes_inside_its_box() {
        for glyph in ('A'..='Z').chain('0'..='9') {
            assert!(!strokes(glyph).is_empty(), "{glyph}");
            assert!(distance(glyph, Vec2::new(0.5, 0.8)) < 0.8);
            assert!(distance(glyph, Vec2::new(5.0, 5.0)) > 3.0);
        }
    }
}
