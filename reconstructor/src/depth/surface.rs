//! The network's answer over its window, and what of it is kept as a player's depth map.

use glam::DVec2;

use super::{
    DepthMap,
    map::millimetres,
    window::{PICTURE_SIZE, Window},
};
use crate::geometry::Mask;

/// Planes of the answer.
pub(super) const PLANES: usize = 6;
/// Weight below which a cell says nothing about the player's depth.
const FAINT: f64 = 1e-3;
/// Pixels this far from the segmentation's mask are not the player's, whatever the network says.
const REACH_PX: i32 = 2;

const SEEN: usize = 0;
const BODY: usize = 1;
const FRONT: usize = 2;
const BACK: usize = 3;

/// What the network says of each of 128×128 cells over a window: probabilities that the cell shows the player, and that the player is
/// there, hidden or not; metres from the upright plane to the body's first and last surface; the errors to expect of both, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowSurface {
    window: Window,
    planes: [Vec<f32>; PLANES],
}

impl WindowSurface {
    /// The planes row by row; missing numbers count as 0, numbers that are none as 0 too.
    pub(super) fn new(window: Window, mut planes: [Vec<f32>; PLANES]) -> Self {
        for plane in &mut planes {
            plane.resize(PICTURE_SIZE * PICTURE_SIZE, 0.0);
            plane.iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
        }
        Self { window, planes }
    }

    /// The square of the picture that the network saw.
    #[must_use]
    pub fn window(&self) -> Window {
        self.window
    }

    /// Metres from the upright plane to the body's first and last surface at a pixel of the clip, positive away.
    ///
    /// Bilinear over the cells that belong to the player, each as much as it does, so that the background next to an
    /// outline does not bend the surface. Outside the window the nearest cells answer.
    #[must_use]
    pub fn offsets_at(&self, pixel: DVec2) -> [f64; 2] {
        let corners = corners(self.window.place(pixel, PICTURE_SIZE));
        [FRONT, BACK].map(|plane| {
            let (mut sum, mut plain, mut weight) = (0.0, 0.0, 0.0);
            for (cell, share) in corners {
                let offset = self.value(plane, cell);
                let part = share * self.value(BODY, cell);
                sum += part * offset;
                plain += share * offset;
                weight += part;
            }
            if weight > FAINT { sum / weight } else { plain }
        })
    }

    /// The depth of the player's cells: those that the network takes for the player and that lie at or near `mask`, the
    /// segmentation's.
    #[must_use]
    pub fn on_mask(&self, mask: &Mask) -> DepthMap {
        let near = grown(mask);
        let pixel = |i: usize| {
            let (x, y) = (i % PICTURE_SIZE, i / PICTURE_SIZE);
            DVec2::new(self.window.cell(0, x, PICTURE_SIZE), self.window.cell(1, y, PICTURE_SIZE))
        };
        let coverage: Vec<u8> = (0..PICTURE_SIZE * PICTURE_SIZE)
            .map(|i| {
                let at = pixel(i).round();
                let near = near.at(at.x as i32, at.y as i32) > 0;
                if near { (255.0 * self.value(SEEN, i)).round() as u8 } else { 0 }
            })
            .collect();
        let (mut x0, mut y0, mut x1, mut y1) = (PICTURE_SIZE, PICTURE_SIZE, 0, 0);
        for i in (0..coverage.len()).filter(|&i| coverage.get(i).is_some_and(|&c| c > 0)) {
            let (x, y) = (i % PICTURE_SIZE, i / PICTURE_SIZE);
            (x0, y0, x1, y1) = (x0.min(x), y0.min(y), x1.max(x), y1.max(y));
        }
        let (width, height) = if x0 > x1 { (0, 0) } else { (x1 - x0 + 1, y1 - y0 + 1) };
        let mut map = DepthMap {
            first_px: pixel(y0.min(PICTURE_SIZE - 1) * PICTURE_SIZE + x0.min(PICTURE_SIZE - 1)),
            cell_px: self.window.side_px / PICTURE_SIZE as f64,
            width: width as u32,
            height: height as u32,
            ..DepthMap::default()
        };
        for i in (0..height).flat_map(|y| (0..width).map(move |x| (y + y0) * PICTURE_SIZE + x + x0)) {
            let kept = coverage.get(i).copied().unwrap_or(0);
            map.coverage.push(kept);
            let [front, back] = [FRONT, BACK].map(|plane| millimetres(self.value(plane, i)));
            map.front_mm.push(front);
            map.back_mm.push(back.max(front));
        }
        map
    }

    /// A plane's value in a cell; 0 outside.
    pub(super) fn value(&self, plane: usize, cell: usize) -> f64 {
        f64::from(self.planes.get(plane).and_then(|plane| plane.get(cell)).copied().unwrap_or(0.0))
    }
}

/// A mask that is not 0 within [`REACH_PX`] of where the given one is at least half covered.
fn grown(mask: &Mask) -> Mask {
    let (width, height) =
        (mask.width as usize + 2 * REACH_PX as usize, mask.height as usize + 2 * REACH_PX as usize);
    let mut coverage = vec![0; width * height];
    let columns = mask.width.max(1) as usize;
    for (i, _) in mask.coverage.iter().enumerate().filter(|(_, c)| **c >= 128) {
        let (x, y) = (i % columns, i / columns);
        for row in coverage.chunks_exact_mut(width).skip(y).take(2 * REACH_PX as usize + 1) {
            row.iter_mut().skip(x).take(2 * REACH_PX as usize + 1).for_each(|c| *c = 255);
        }
    }
    Mask {
        x0: mask.x0.saturating_sub(REACH_PX),
        y0: mask.y0.saturating_sub(REACH_PX),
        width: width as u32,
        height: height as u32,
        coverage,
    }
}

/// The four cells around a place on the grid and the share of each; places outside count as on the border.
fn corners(place: DVec2) -> [(usize, f64); 4] {
    let place = place.clamp(DVec2::ZERO, DVec2::splat(PICTURE_SIZE as f64 - 1.0));
    let low = place.floor().min(DVec2::splat(PICTURE_SIZE as f64 - 2.0));
    let t = place - low;
    let first = low.y as usize * PICTURE_SIZE + low.x as usize;
    [
        (first, (1.0 - t.x) * (1.0 - t.y)),
        (first + 1, t.x * (1.0 - t.y)),
        (first + PICTURE_SIZE, (1.0 - t.x) * t.y),
        (first + PICTURE_SIZE + 1, t.x * t.y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A player in the left half, 0.3 m behind the plane and 0.2 m thick, before a background that says −0.4 m.
    fn half() -> WindowSurface {
        let window = Window { centre_px: DVec2::splat(63.5), side_px: 128.0 };
        let plane = |left: f32, right: f32| {
            let cells = 0..PICTURE_SIZE * PICTURE_SIZE;
            cells.map(|i| if i % PICTURE_SIZE < 64 { left } else { right }).collect::<Vec<f32>>()
        };
        let planes = [
            plane(1.0, 0.0),
            plane(1.0, 0.0),
            plane(0.3, -0.4),
            plane(0.5, -0.4),
            plane(0.02, 0.2),
            plane(0.03, 0.2),
        ];
        WindowSurface::new(window, planes)
    }

    #[test]
    fn the_outline_does_not_bend_towards_the_background() {
        let surface = half();
        let [front, back] = surface.offsets_at(DVec2::new(63.75, 10.0));
        assert!((front - 0.3).abs() < 1e-6 && (back - 0.5).abs() < 1e-6);
    }

    #[test]
    fn cells_that_the_network_or_the_segmentation_rejects_leave_the_map() {
        let mask = Mask { x0: 50, y0: 5, width: 40, height: 2, coverage: vec![200; 80] };
        let map = half().on_mask(&mask);
        assert!(map.is_whole());
        assert_eq!(map.mask().at(55, 5), 255);
        assert_eq!(map.mask().at(70, 6), 0, "the network says no");
        assert_eq!(map.mask().at(55, 12), 0, "far from the mask");
        assert_eq!((map.first_px, map.width), (DVec2::new(48.0, 3.0), 16));
        assert_eq!((map.front_mm[0], map.back_mm[0]), (300, 500));
    }

    #[test]
    fn short_or_broken_answers_are_background() {
        let window = Window { centre_px: DVec2::ZERO, side_px: 64.0 };
        let planes = [0, 1, 2, 3, 4, 5].map(|k| vec![if k % 2 == 0 { f32::NAN } else { f32::INFINITY }; 3]);
        let surface = WindowSurface::new(window, planes);
        assert_eq!(surface.value(SEEN, 0), 0.0);
        assert_eq!(surface.offsets_at(DVec2::splat(1e12)), [0.0, 0.0]);
        assert_eq!(
            surface.on_mask(&Mask { width: 5, height: 1, coverage: vec![255; 5], ..Mask::default() }).width,
            0
        );
    }
}
