//! Pixels to triangles: the outline follows the mask's half-covered line between pixels, faces join neighbouring pixels
//! and are cut where the depth jumps.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::{MeshError, VirtualPlane};
use crate::depth::DepthMap;

/// Neighbouring pixels whose depths differ by more than this belong to different parts of the body, metres. The paper's
/// public code uses the same figure.
pub const DEPTH_JUMP_M: f64 = 0.1;

/// A small player's pixels are far apart, so a slanted limb steps far from pixel to pixel: the depth may always change by
/// this many pixel widths.
pub const DEPTH_JUMP_PIXELS: f64 = 2.5;

/// Coverage from which a pixel is inside.
const INSIDE: u8 = 128;
/// Pieces smaller than this share of the largest piece are dropped.
const PIECE_SHARE: f64 = 0.04;
/// A body of fewer triangles is no body.
const LEAST_TRIANGLES: usize = 24;

/// Triangles over the pixels of a frame.
#[derive(Clone, Debug, Default)]
pub(super) struct PixelSurface {
    /// World metres.
    pub(super) points_m: Vec<DVec3>,
    /// Where each point is seen, pixels of the clip.
    pub(super) pixels: Vec<DVec2>,
    /// Counter-clockwise seen from the camera.
    pub(super) triangles: Vec<[u32; 3]>,
}

/// A corner of the outline: a pixel itself, or the point between an inside pixel and an outside neighbour where the
/// coverage crosses one half.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Corner {
    Pixel(i32, i32),
    Between { inside: (i32, i32), outside: (i32, i32) },
}

struct Builder<'a> {
    depth: &'a DepthMap,
    plane: &'a VirtualPlane,
    jump_m: f64,
    surface: PixelSurface,
    offsets_m: Vec<f64>,
    index_of: HashMap<Corner, Option<u32>>,
}

/// The surface of a depth map; `footprint_m` is the width of a pixel at the player.
pub(super) fn connect(
    depth: &DepthMap,
    plane: &VirtualPlane,
    footprint_m: f64,
) -> Result<PixelSurface, MeshError> {
    let mask = &depth.mask;
    let area = mask.width as usize * mask.height as usize;
    if mask.coverage.len() != area || depth.offset_m.len() != area {
        return Err(MeshError::Sizes {
            width: mask.width,
            height: mask.height,
            coverage: mask.coverage.len(),
            offsets: depth.offset_m.len(),
        });
    }
    let mut builder = Builder {
        depth,
        plane,
        jump_m: DEPTH_JUMP_M.max(DEPTH_JUMP_PIXELS * footprint_m),
        surface: PixelSurface::default(),
        offsets_m: Vec::new(),
        index_of: HashMap::new(),
    };
    // Cells between pixel centres, one ring more than the mask so that its edge gets an outline too.
    for y in mask.y0.saturating_sub(1)..mask.y0.saturating_add_unsigned(mask.height) {
        for x in mask.x0.saturating_sub(1)..mask.x0.saturating_add_unsigned(mask.width) {
            builder.cell(x, y);
        }
    }
    Ok(builder.surface)
}

impl Builder<'_> {
    /// Adds the part of one cell that is inside. Its corners go round counter-clockwise as the camera sees them.
    fn cell(&mut self, x: i32, y: i32) {
        let corners = [(x, y), (x, y + 1), (x + 1, y + 1), (x + 1, y)];
        let inside = corners.map(|(x, y)| self.depth.mask.at(x, y) >= INSIDE);
        if !inside.contains(&true) {
            return;
        }
        let mut outline = Vec::with_capacity(6);
        for here in 0..4 {
            let next = (here + 1) % 4;
            if inside[here] {
                outline.push(Corner::Pixel(corners[here].0, corners[here].1));
            }
            if inside[here] != inside[next] {
                let (a, b) = if inside[here] { (here, next) } else { (next, here) };
                outline.push(Corner::Between { inside: corners[a], outside: corners[b] });
            }
        }
        let points: Vec<u32> = outline.iter().filter_map(|&corner| self.vertex(corner)).collect();
        // A fan from each corner in turn; the one that survives the cuts best, then with the smallest steps, is taken.
        let best = (0..points.len())
            .map(|first| self.fan(&points, first))
            .max_by(|a, b| a.0.len().cmp(&b.0.len()).then(b.1.total_cmp(&a.1)));
        if let Some((triangles, _)) = best {
            self.surface.triangles.extend(triangles);
        }
    }

    /// The uncut triangles of a fan over a convex outline, and the largest step in depth among them.
    fn fan(&self, points: &[u32], first: usize) -> (Vec<[u32; 3]>, f64) {
        let at = |i: usize| points[(first + i) % points.len()];
        let mut steepest = 0.0_f64;
        let mut kept = Vec::with_capacity(4);
        for i in 1..points.len().saturating_sub(1) {
            let triangle = [at(0), at(i), at(i + 1)];
            let depths = triangle.map(|index| self.offsets_m[index as usize]);
            let low = depths.iter().copied().fold(f64::INFINITY, f64::min);
            let high = depths.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            if high - low <= self.jump_m {
                steepest = steepest.max(high - low);
                kept.push(triangle);
            }
        }
        (kept, steepest)
    }

    /// The vertex at a corner; `None` when its depth is not a number or lies behind the camera.
    fn vertex(&mut self, corner: Corner) -> Option<u32> {
        if let Some(known) = self.index_of.get(&corner) {
            return *known;
        }
        let mask = &self.depth.mask;
        // The depth of an outline point is its inside pixel's: outside there is none.
        let (pixel, (x, y)) = match corner {
            Corner::Pixel(x, y) => (DVec2::new(f64::from(x), f64::from(y)), (x, y)),
            Corner::Between { inside, outside } => {
                let position = |(x, y): (i32, i32)| DVec2::new(f64::from(x), f64::from(y));
                let (covered, empty) =
                    (f64::from(mask.at(inside.0, inside.1)), f64::from(mask.at(outside.0, outside.1)));
                let half = f64::from(INSIDE) - 0.5;
                let t = ((covered - half) / (covered - empty).max(1.0)).clamp(0.05, 0.95);
                (position(inside).lerp(position(outside), t), inside)
            }
        };
        let column = (i64::from(x) - i64::from(mask.x0)) as usize;
        let row = (i64::from(y) - i64::from(mask.y0)) as usize;
        let offset_m = self.depth.offset_m.get(row * mask.width as usize + column).copied();
        let offset_m = f64::from(offset_m.unwrap_or(f32::NAN));
        let index = self.plane.point(pixel, offset_m).map(|point| {
            self.surface.points_m.push(point);
            self.surface.pixels.push(pixel);
            self.offsets_m.push(offset_m);
            self.surface.points_m.len() as u32 - 1
        });
        self.index_of.insert(corner, index);
        index
    }
}

impl PixelSurface {
    /// Drops the pieces that are small beside the largest one, and every point that no triangle uses.
    pub(super) fn keep_large_pieces(&mut self) -> Result<(), MeshError> {
        let mut leader: Vec<u32> = (0..self.points_m.len() as u32).collect();
        for &[a, b, c] in &self.triangles {
            let root = find(&mut leader, a);
            for other in [b, c] {
                let other = find(&mut leader, other);
                leader[other as usize] = root;
            }
        }
        let mut sizes: HashMap<u32, usize> = HashMap::new();
        let pieces: Vec<u32> = self.triangles.iter().map(|t| find(&mut leader, t[0])).collect();
        for &piece in &pieces {
            *sizes.entry(piece).or_default() += 1;
        }
        let largest = sizes.values().copied().max().unwrap_or(0);
        if largest < LEAST_TRIANGLES {
            return Err(MeshError::TooSmall { triangles: largest });
        }
        let least = (largest as f64 * PIECE_SHARE).ceil() as usize;
        let kept = self.triangles.iter().zip(&pieces).filter(|(_, piece)| sizes[*piece] >= least.max(4));
        let kept: Vec<[u32; 3]> = kept.map(|(triangle, _)| *triangle).collect();
        let mut new_index = vec![u32::MAX; self.points_m.len()];
        let (mut points_m, mut pixels) = (Vec::new(), Vec::new());
        self.triangles = kept
            .iter()
            .map(|triangle| {
                triangle.map(|old| {
                    let old = old as usize;
                    if new_index[old] == u32::MAX {
                        new_index[old] = points_m.len() as u32;
                        points_m.push(self.points_m[old]);
                        pixels.push(self.pixels[old]);
                    }
                    new_index[old]
                })
            })
            .collect();
        (self.points_m, self.pixels) = (points_m, pixels);
        Ok(())
    }
}

/// The leader of `index`'s piece, shortening the way to it.
fn find(leader: &mut [u32], mut index: u32) -> u32 {
    while leader[index as usize] != index {
        let above = leader[leader[index as usize] as usize];
        leader[index as usize] = above;
        index = above;
    }
    index
}
