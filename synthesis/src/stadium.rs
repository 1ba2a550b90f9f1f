//! The empty stadium as rays meet it: grass first, round it boards, stands in tiers, roofs, and beyond them the sky.
//! One upright profile per side of the pitch; the sides meet in the corners where their planes do.

use glam::{Vec2, Vec3};
use protocol::pitch::Pitch;

use crate::{
    crowd::{Crowd, CrowdLook},
    outfit::Srgb,
    paint::Lights,
    rays::PixelRays,
    stands::Wall,
    turf::{Turf, TurfLook},
};

/// An advertising board.
#[derive(Clone, Debug, PartialEq)]
pub struct Board {
    /// What stands on it.
    pub text: String,
    /// Its colour.
    pub ground: Srgb,
    /// The colour of the text.
    pub ink: Srgb,
}

/// A row of boards along a side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardRow {
    /// Distance behind the line, metres.
    pub gap_m: f32,
    /// Lower and upper edge, metres above the ground.
    pub high_m: [f32; 2],
    /// Whether it shines by itself (LED), with the same text all along.
    pub led: bool,
}

/// A block of seats rising outwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tier {
    /// Distance of its first row behind the foot of the stand, metres.
    pub from_m: f32,
    /// Height of its first row, metres.
    pub low_m: f32,
    /// Rise per metre.
    pub slope: f32,
    /// How far it reaches outwards, metres.
    pub deep_m: f32,
}

/// A roof over a stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roof {
    /// Distance of its front edge behind the foot of the stand, metres; negative reaches over the boards.
    pub edge_m: f32,
    /// Height, metres.
    pub height_m: f32,
    /// How far it reaches outwards, metres.
    pub deep_m: f32,
    /// Half its length along the side, metres.
    pub half_m: f32,
}

/// Everything beyond one line of the pitch.
#[derive(Clone, Debug, PartialEq)]
pub struct Side {
    /// Unit vector away from the pitch.
    pub outward: Vec3,
    /// Distance of the line from the centre mark, metres.
    pub line_m: f32,
    /// Half the length of the boards, metres.
    pub half_m: f32,
    /// Boards, front row first.
    pub boards: Vec<BoardRow>,
    /// Where the stand begins behind the line, and the height of its barrier, metres.
    pub foot_m: f32,
    /// Height of the wall in front of the first row, metres.
    pub barrier_m: f32,
    /// Seats.
    pub tiers: Vec<Tier>,
    /// Its roof.
    pub roof: Option<Roof>,
}

/// What surrounds the grass.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// The four sides: far, right, left, near.
    pub sides: [Side; 4],
    /// Boards, repeated round the pitch.
    pub boards: Vec<Board>,
    /// The people in the stands.
    pub crowd: CrowdLook,
    /// Colour of the roofs from below, linear.
    pub roof: Vec3,
    /// Colour of barriers and fascias, linear.
    pub structure: Vec3,
    /// Light from above the roofs, linear.
    pub sky: Vec3,
}

/// How a stadium looks.
#[derive(Clone, Debug)]
pub struct Stadium {
    /// The pitch.
    pub pitch: Pitch,
    /// The grass and its lines.
    pub turf: Turf,
    /// What surrounds it.
    pub around: Surroundings,
    /// The lights.
    pub lights: Lights,
    /// Whether the lamps are the sun, which roofs keep off the grass.
    pub sunny: bool,
    /// Varies what is drawn on boards and seats.
    pub seed: u32,
    pub(crate) crowd: Crowd,
    half: Vec2,
    /// What the lamps give a level surface.
    level: Vec3,
}

/// What a ray through the empty stadium meets.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Light, linear.
    pub light: Vec3,
    /// Depth along the optical axis, metres.
    pub depth_m: f32,
    /// Whether it is a wall, behind which people can stand.
    pub upright: bool,
}

/// Shares of light that people and things keep off a place of the ground.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shadow {
    /// Of the lamps' light.
    pub lamps: f32,
    /// Of the sky's light.
    pub sky: f32,
}

/// The nearest thing so far.
pub(crate) struct Nearest {
    pub(crate) depth: f32,
    pub(crate) wall: Option<Wall>,
}

impl Side {
    /// Offers what a ray meets on this side.
    fn meet(&self, origin: Vec3, direction: Vec3, nearest: &mut Nearest) {
        let (start, speed) = (origin.dot(self.outward) - self.line_m, direction.dot(self.outward));
        let along_axis = self.outward.cross(Vec3::Y);
        let mut offer = |depth: f32, wall: &dyn Fn(f32, f32) -> Option<Wall>| {
            if depth > 0.5 && depth < nearest.depth {
                let point = origin + direction * depth;
                if let Some(wall) = wall(point.dot(along_axis), point.y) {
                    (nearest.depth, nearest.wall) = (depth, Some(wall));
                }
            }
        };
        let upright = |at: f32| (at - start) / speed;
        for (row, board) in self.boards.iter().enumerate() {
            offer(upright(board.gap_m), &|along, height| {
                let inside =
                    height >= board.high_m[0] && height < board.high_m[1] && along.abs() <= self.half_m;
                inside.then_some(if speed > 0.0 { Wall::Board { row, along, height } } else { Wall::Back })
            });
        }
        if speed > 0.0 {
            offer(upright(self.foot_m), &|along, height| {
                (0.0..self.barrier_m).contains(&height).then_some(Wall::Barrier { along, height })
            });
        }
        for (index, tier) in self.tiers.iter().enumerate() {
            let first = self.foot_m + tier.from_m;
            // A camera in the stand looks out of an opening.
            if start > first && origin.y < tier.low_m + tier.slope * (start - first) + 1.0 {
                continue;
            }
            // height = low + slope · (out − first)
            let a = direction.y - tier.slope * speed;
            let depth = (tier.low_m + tier.slope * (start - first) - origin.y) / a;
            offer(depth, &|along, _| {
                let out = start + speed * depth - first;
                let up = out * (1.0 + tier.slope * tier.slope).sqrt() + index as f32 * 30.72;
                let back = out / tier.deep_m;
                (0.0..1.0).contains(&back).then_some(Wall::Seats {
                    along,
                    up,
                    back,
                    from_behind: speed < 0.0,
                })
            });
            if index > 0 && speed > 0.0 {
                let foot = tier.low_m - 5.5;
                offer(upright(first), &|along, height| {
                    (foot..tier.low_m)
                        .contains(&height)
                        .then_some(Wall::Fascia { along, height: height - foot })
                });
            }
        }
        if let Some(roof) = &self.roof {
            let edge = self.foot_m + roof.edge_m;
            let over = |along: f32| along.abs() <= roof.half_m;
            offer((roof.height_m - origin.y) / direction.y, &|along, _| {
                let out = start + speed * (roof.height_m - origin.y) / direction.y - edge;
                ((0.0..roof.deep_m).contains(&out) && over(along)).then_some(Wall::Roof)
            });
            if speed > 0.0 {
                offer(upright(edge), &|along, height| {
                    let inside = (0.0..1.6).contains(&(height - roof.height_m)) && over(along);
                    inside.then_some(Wall::RoofEdge)
                });
            }
        }
    }

    /// Share of the sun that passes this side's stand and roof to a point.
    fn passes(&self, point: Vec3, towards: Vec3) -> f32 {
        let speed = towards.dot(self.outward);
        if speed <= 1e-3 {
            return 1.0;
        }
        let (edge, height, half) = match &self.roof {
            Some(roof) => (self.foot_m + roof.edge_m, roof.height_m, roof.half_m),
            None => match self.tiers.last() {
                Some(tier) => (
                    self.foot_m + tier.from_m + tier.deep_m,
                    tier.low_m + tier.slope * tier.deep_m,
                    self.half_m + 20.0,
                ),
                None => return 1.0,
            },
        };
        let way = (self.line_m + edge - point.dot(self.outward)) / speed;
        if way <= 0.0 {
            return 1.0;
        }
        let at = point + towards * way;
        // The sun is half a degree wide: the edge of a shadow grows soft with the way.
        let soft = 0.012 * way;
        let above = ((at.y - height) / soft + 0.5).clamp(0.0, 1.0);
        let beside = ((at.dot(self.outward.cross(Vec3::Y)).abs() - half) / soft + 0.5).clamp(0.0, 1.0);
        above.max(beside)
    }
}

impl Stadium {
    /// A stadium with the given looks.
    #[must_use]
    pub fn new(
        pitch: Pitch,
        turf: TurfLook,
        around: Surroundings,
        lights: Lights,
        sunny: bool,
        seed: u32,
    ) -> Self {
        let level = lights.lamps.iter().map(|(towards, colour)| *colour * towards.y.max(0.0)).sum();
        Self {
            pitch,
            turf: Turf::new(&pitch, turf, seed),
            crowd: Crowd::new(around.crowd.clone(), seed),
            around,
            lights,
            sunny,
            seed,
            half: Vec2::new(pitch.length_m as f32, pitch.width_m as f32) / 2.0,
            level,
        }
    }

    /// Brightness of a white level surface in the open: what the iris is set by.
    #[must_use]
    pub fn level_light(&self) -> f32 {
        self.level.y + self.lights.sky.y
    }

    /// Share of the sun that reaches a point past stands and roofs; 1 for lamps that no roof hides.
    #[must_use]
    pub fn sun_at(&self, point: Vec3) -> f32 {
        match self.lights.lamps.first() {
            Some((towards, _)) if self.sunny => {
                self.around.sides.iter().map(|side| side.passes(point, *towards)).product()
            }
            _ => 1.0,
        }
    }

    /// The light on somebody who stands at `point`: the sun is weaker in the stands' shade.
    #[must_use]
    pub fn lights_at(&self, point: Vec3) -> Lights {
        let sun = self.sun_at(point);
        let mut lights = self.lights.clone();
        if sun < 1.0 {
            lights.lamps.iter_mut().for_each(|(_, colour)| *colour *= sun);
            lights.bounce *= 0.4 + 0.6 * sun;
        }
        lights
    }

    /// What the camera sees at a pixel when nobody is there.
    #[must_use]
    pub fn see(&self, rays: &PixelRays, pixel: Vec2, shadow: impl FnOnce() -> Shadow) -> Seen {
        let view = rays.through(pixel);
        let (origin, direction) = (rays.origin, view.direction);
        let mut nearest = Nearest { depth: f32::MAX, wall: None };
        let mut place = Vec2::ZERO;
        let mut on_grass = false;
        if direction.y < -1e-6 {
            nearest.depth = -origin.y / direction.y;
            let hit = origin + direction * nearest.depth;
            place = Vec2::new(hit.x, hit.z);
            on_grass = (place.abs() - self.half).max_element() < 1.0;
        }
        let ground = nearest.depth;
        for side in &self.around.sides {
            // Nothing stands over the grass: only what the camera looks across can be in front of it, and stands and
            // boards are low enough to hide no more than its border.
            let border = Vec3::new(place.x, 0.0, place.y).dot(side.outward) > side.line_m - 5.0;
            if !on_grass || (border && origin.dot(side.outward) > side.line_m) {
                side.meet(origin, direction, &mut nearest);
            }
        }
        if let Some(wall) = nearest.wall {
            let sample = nearest.depth * view.across.length();
            let light = self.wall(&wall, origin + direction * nearest.depth, sample);
            return Seen { light, depth_m: nearest.depth, upright: true };
        }
        if ground == f32::MAX {
            let up = (direction.y / direction.length()).clamp(0.0, 1.0);
            return Seen { light: self.around.sky * (1.15 - 0.5 * up), depth_m: 1e6, upright: false };
        }
        // How far the hit moves on the ground per pixel across and down.
        let slide = |step: Vec3| {
            let moved = ground * (step - direction * (step.y / direction.y));
            Vec2::new(moved.x, moved.z)
        };
        let albedo = self.turf.albedo(place, [slide(view.across), slide(view.down)]);
        let shadow = shadow();
        let sun = if self.sunny { self.sun_at(Vec3::new(place.x, 0.0, place.y)) } else { 1.0 };
        let lamps = self.level * (sun * (1.0 - shadow.lamps));
        Seen {
            light: albedo * (lamps + self.lights.sky * (1.0 - 0.6 * shadow.sky)),
            depth_m: ground,
            upright: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::venue::Venue;

    #[test]
    fn a_roof_shades_the_pitch_up_to_where_its_edge_projects() {
        let mut stadium = Venue::plain(1, Pitch::default(), [[0.9; 3], [0.1; 3]]).stadium;
        let towards = Vec3::new(0.7, 0.5, 0.1).normalize();
        stadium.lights.lamps = vec![(towards, Vec3::ONE)];
        stadium.sunny = true;
        let roof = Roof { edge_m: 3.0, height_m: 22.0, deep_m: 30.0, half_m: 60.0 };
        let side = &mut stadium.around.sides[1];
        side.roof = Some(roof);
        let edge = side.line_m + side.foot_m + roof.edge_m - roof.height_m * towards.x / towards.y;
        assert!(edge.abs() < 50.0, "the edge of the shade lies on the pitch");
        let sun = |x: f32, y: f32| stadium.sun_at(Vec3::new(x, y, 4.0));
        assert_eq!((sun(edge - 1.0, 0.0), sun(edge + 1.0, 0.0)), (1.0, 0.0));
        assert!((0.2..0.8).contains(&sun(edge, 0.0)), "soft at the edge");
        // Somebody's head is in the sun a little longer than the feet.
        assert!(sun(edge + 1.0, 1.8) > 0.9);
        let light = |x: f32| stadium.lights_at(Vec3::new(x, 1.0, 4.0)).lamps[0].1.y;
        assert!(light(edge - 4.0) > 0.99 && light(edge + 4.0) < 0.01);
        stadium.sunny = false;
        assert_eq!(stadium.sun_at(Vec3::new(edge + 1.0, 0.0, 4.0)), 1.0);
    }
}
