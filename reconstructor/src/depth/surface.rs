//! The network's answer over its window, and how it is brought back to the pixels of the clip.

use glam::DVec2;

use super::{
    DepthMap,
    window::{GRID, Window},
};
use crate::geometry::Mask;

/// Weight below which a cell says nothing about the player's depth.
const FAINT: f64 = 1e-3;

/// Distance from the upright plane and probability of the player, 64×64 cells over a window.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowSurface {
    window: Window,
    offset_m: Vec<f32>,
    presence: Vec<f32>,
}

impl WindowSurface {
    /// Both planes row by row, 64×64; missing numbers count as 0, numbers that are none as 0 too.
    pub(super) fn new(window: Window, mut offset_m: Vec<f32>, mut presence: Vec<f32>) -> Self {
        for plane in [&mut offset_m, &mut presence] {
            plane.resize(GRID * GRID, 0.0);
            plane.iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
        }
        Self { window, offset_m, presence }
    }

    /// The square of the picture that the network saw.
    #[must_use]
    pub fn window(&self) -> Window {
        self.window
    }

    /// Probability that a pixel of the clip belongs to the player; 0 outside the window.
    #[must_use]
    pub fn presence_at(&self, pixel: DVec2) -> f64 {
        let place = self.window.place(pixel, GRID);
        if place.cmplt(DVec2::splat(-0.5)).any() || place.cmpgt(DVec2::splat(GRID as f64 - 0.5)).any() {
            return 0.0;
        }
        corners(place).iter().map(|&(cell, share)| share * self.presence_of(cell)).sum()
    }

    /// Distance from the upright plane at a pixel of the clip, metres, positive away.
    ///
    /// Bilinear over the cells that belong to the player, each as much as it does, so that the background next to an
    /// outline does not bend the surface. Outside the window the nearest cells answer.
    #[must_use]
    pub fn offset_at(&self, pixel: DVec2) -> f64 {
        let (mut sum, mut plain, mut weight) = (0.0, 0.0, 0.0);
        for (cell, share) in corners(self.window.place(pixel, GRID)) {
            let offset = f64::from(self.offset_m.get(cell).copied().unwrap_or(0.0));
            let part = share * self.presence_of(cell);
            sum += part * offset;
            plain += share * offset;
            weight += part;
        }
        if weight > FAINT { sum / weight } else { plain }
    }

    /// The depth of the player's pixels: those of `mask` that the network takes for the player too.
    #[must_use]
    pub fn on_mask(&self, mask: &Mask) -> DepthMap {
        let mut coverage = Vec::with_capacity(mask.coverage.len());
        let mut offset_m = Vec::with_capacity(mask.coverage.len());
        let columns = mask.width.max(1) as usize;
        for (i, &given) in mask.coverage.iter().enumerate() {
            let x = (i % columns) as f64 + f64::from(mask.x0);
            let y = (i / columns) as f64 + f64::from(mask.y0);
            let pixel = DVec2::new(x, y);
            let kept = given.min((255.0 * self.presence_at(pixel)).round() as u8);
            coverage.push(kept);
            offset_m.push(if kept == 0 { 0.0 } else { self.offset_at(pixel) as f32 });
        }
        DepthMap { mask: Mask { coverage, ..*mask }, offset_m }
    }

    fn presence_of(&self, cell: usize) -> f64 {
        f64::from(self.presence.get(cell).copied().unwrap_or(0.0))
    }
}

/// The four cells around a place on the grid and the share of each; places outside count as on the border.
fn corners(place: DVec2) -> [(usize, f64); 4] {
    let place = place.clamp(DVec2::ZERO, DVec2::splat(GRID as f64 - 1.0));
    let low = place.floor().min(DVec2::splat(GRID as f64 - 2.0));
    let t = place - low;
    let first = low.y as usize * GRID + low.x as usize;
    [
        (first, (1.0 - t.x) * (1.0 - t.y)),
        (first + 1, t.x * (1.0 - t.y)),
        (first + GRID, (1.0 - t.x) * t.y),
        (first + GRID + 1, t.x * t.y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A player in the left half, 0.3 m behind the plane, before a background that says −0.4 m.
    fn half() -> WindowSurface {
        let window = Window { centre_px: DVec2::splat(31.5), side_px: 64.0 };
        let left = |i: usize| i % GRID < 32;
        let offset = (0..GRID * GRID).map(|i| if left(i) { 0.3 } else { -0.4 }).collect();
        let presence = (0..GRID * GRID).map(|i| if left(i) { 1.0 } else { 0.0 }).collect();
        WindowSurface::new(window, offset, presence)
    }

    #[test]
    fn the_outline_does_not_bend_towards_the_background() {
        let surface = half();
        assert!((surface.presence_at(DVec2::new(31.25, 10.0)) - 0.75).abs() < 1e-9);
        assert!((surface.offset_at(DVec2::new(31.75, 10.0)) - 0.3).abs() < 1e-6);
        assert_eq!(surface.presence_at(DVec2::new(-1.0, 10.0)), 0.0);
    }

    #[test]
    fn pixels_that_the_network_rejects_leave_the_mask() {
        let mask = Mask { x0: 20, y0: 5, width: 20, height: 2, coverage: vec![200; 40] };
        let depth = half().on_mask(&mask);
        assert_eq!((depth.mask.at(25, 5), depth.mask.at(38, 6)), (200, 0));
        assert_eq!(depth.offset_m.len(), 40);
        assert!((depth.offset_m[0] - 0.3).abs() < 1e-6);
        assert_eq!(depth.offset_m[39], 0.0);
    }

    #[test]
    fn short_or_broken_answers_are_background() {
        let window = Window { centre_px: DVec2::ZERO, side_px: 64.0 };
        let surface = WindowSurface::new(window, vec![f32::NAN; 3], vec![f32::INFINITY; 9]);
        assert_eq!(surface.presence_at(DVec2::ZERO), 0.0);
        assert_eq!(surface.offset_at(DVec2::splat(1e12)), 0.0);
    }
}
