//! Colours of what stands behind the lines: boards, barriers, seats, fascias, roofs, by position along and up the wall.

use glam::{Vec2, Vec3};

use crate::{
    lettering,
    outfit::linear,
    stadium::{Board, Stadium},
};

/// What a ray met, with the place on it in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wall {
    /// The front of a board of a row.
    Board { row: usize, along: f32, height: f32 },
    /// A board from behind.
    Back,
    /// The wall in front of the first seats.
    Barrier { along: f32, height: f32 },
    /// A tier; `up` along its slope, `back` the share of its depth.
    Seats { along: f32, up: f32, back: f32, from_behind: bool },
    /// The front of an upper tier.
    Fascia { along: f32, height: f32 },
    /// A roof from below.
    Roof,
    /// The front of a roof.
    RoofEdge,
}

/// Length of a painted board, metres.
const BOARD_M: f32 = 7.5;
/// How often the text of a shining row comes again, metres.
const LED_M: f32 = 12.0;

impl Stadium {
    /// Light from a wall at a point; `sample` is the size of a pixel there, metres.
    pub(crate) fn wall(&self, wall: &Wall, point: Vec3, sample: f32) -> Vec3 {
        let day = self.lights.sky;
        match *wall {
            Wall::Board { row, along, height } => self.board(row, along, height, sample),
            Wall::Back => Vec3::new(0.05, 0.05, 0.055) * (day + 0.3),
            Wall::Barrier { along, height } => self.barrier(along, height, sample) * (0.4 + day),
            Wall::Seats { along, up, back, from_behind } => {
                let colour = self.around.crowd_colour(self, along, up, sample);
                // Less light under the roof, and the sun where it gets in.
                let deep = 1.0 - 0.45 * back;
                let sun = if self.sunny { self.sun_at(point) } else { 0.0 };
                let behind = if from_behind { 0.45 } else { 1.0 };
                colour * (self.around.crowd.light * behind * (deep + 1.5 * sun))
            }
            Wall::Fascia { along, height } => self.fascia(along, height, sample),
            Wall::Roof => self.around.roof,
            Wall::RoofEdge => self.around.structure * (day * 1.4 + 0.1),
        }
    }

    fn board(&self, row: usize, along: f32, height: f32, sample: f32) -> Vec3 {
        let boards = &self.around.boards;
        let count = boards.len().max(1);
        let [low, high] = self.around.sides[0].boards.get(row).map_or([0.0, 0.9], |row| row.high_m);
        let led = self.around.sides[0].boards.get(row).is_some_and(|row| row.led);
        let wide = if led { LED_M } else { BOARD_M };
        let index = (along / wide).floor();
        // A shining row shows one text all round; painted boards follow each other.
        let pick = if led { self.seed as usize + row } else { (index as i64 + 100_000) as usize * (row + 1) };
        let Some(board) = boards.get(pick % count) else { return Vec3::splat(0.1) };
        let glyph = (0.46 * (high - low)).min((wide - 0.5) / lettering::width(&board.text).max(1.0));
        let width = lettering::width(&board.text) * glyph;
        let x = along - index * wide - (wide - width) / 2.0;
        let top = (low + high + glyph * lettering::HEIGHT) / 2.0;
        let place = Vec2::new(x / glyph, (top - height) / glyph);
        let ink = lettering::ink(&board.text, place, 0.32, sample / glyph);
        let colour = board_colour(board, ink);
        if led {
            // Diodes: bright, a little blue, the same by day and night.
            return colour * Vec3::new(0.78, 0.80, 0.86);
        }
        let seam = if along - index * wide < 0.06f32.max(sample * 0.7) { 0.6 } else { 1.0 };
        let light = self.lights.sky + self.lights.lamps.iter().map(|lamp| lamp.1 * 0.5).sum::<Vec3>();
        colour * light.min(Vec3::splat(1.1)) * (0.9 * seam)
    }

    fn barrier(&self, along: f32, height: f32, sample: f32) -> Vec3 {
        let top = self.around.sides[0].barrier_m;
        let rail = if (height - top + 0.1).abs() < 0.05 { 0.5 } else { 0.0 };
        let post = if (along / 2.4).rem_euclid(1.0) < 0.03f32.max(sample / 5.0) { 0.15 } else { 0.0 };
        self.around.structure * (0.25 + f32::max(rail, post) + 0.1 * (along * 0.3).sin().max(0.0))
    }

    fn fascia(&self, along: f32, height: f32, sample: f32) -> Vec3 {
        if !(3.3..4.6).contains(&height) {
            // The dark gangway under the tier, then its edge.
            return if height > 4.6 { self.around.structure * 0.5 } else { Vec3::new(0.020, 0.021, 0.025) };
        }
        let Some(board) = self.around.boards.first() else { return Vec3::splat(0.05) };
        let place = Vec2::new(along.rem_euclid(24.0) / 0.5 - 4.0, (4.35 - height) / 0.5);
        let ink = lettering::ink(&board.text, place, 0.22, sample / 0.5);
        board_colour(board, ink) * 0.55
    }
}

fn board_colour(board: &Board, ink: f32) -> Vec3 {
    linear(board.ground).lerp(linear(board.ink), ink)
}

impl crate::stadium::Surroundings {
    fn crowd_colour(&self, stadium: &Stadium, along: f32, up: f32, sample: f32) -> Vec3 {
        // The picture repeats every 61 m; slow brightness hides it.
        let slow = crate::noise::value(Vec2::new(along * 0.07, up * 0.11), stadium.seed ^ 91);
        stadium.crowd.colour(along, up, sample) * (1.0 + 0.12 * slow)
    }
}
