//! What a camera on its tripod does to the picture between two frames, near enough for thumbnails: a shift and a zoom.

use super::thumbnail::{HEIGHT, Thumbnail, WIDTH};

/// Farthest shift looked for between frames, pixels of the half-size thumbnail: a quarter of the picture's width, a pan that
/// crosses the pitch in half a second.
const REACH: (i32, i32) = (8, 4);
/// Rounds of refinement.
const ROUNDS: usize = 4;
/// Largest zoom in one refinement: a lens takes seconds from end to end.
const ZOOM_MAX: f32 = 0.15;

/// Where a pixel's content was before: `source = centre + zoom · (pixel − centre) + shift`, in thumbnail pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Motion {
    zoom: f32,
    shift: [f32; 2],
}

const CENTRE: [f32; 2] = [(WIDTH as f32 - 1.0) / 2.0, (HEIGHT as f32 - 1.0) / 2.0];

impl Motion {
    /// The camera stands still.
    pub(super) const NONE: Self = Self { zoom: 1.0, shift: [0.0; 2] };

    /// Where the content at a pixel was before.
    pub(super) fn source(&self, x: f32, y: f32) -> [f32; 2] {
        let [cx, cy] = CENTRE;
        [cx + self.zoom * (x - cx) + self.shift[0], cy + self.zoom * (y - cy) + self.shift[1]]
    }

    /// This motion and then `next`.
    pub(super) fn then(&self, next: &Self) -> Self {
        let shift = [0, 1].map(|axis| self.shift[axis] + self.zoom * next.shift[axis]);
        Self { zoom: self.zoom * next.zoom, shift }
    }

    /// The motion that best turns `before` into `after`: search over whole pixels at half size, then Lucas–Kanade.
    pub(super) fn between(before: &Thumbnail, after: &Thumbnail) -> Self {
        let (small_before, small_after) = (halved(before.luma()), halved(after.luma()));
        let mut best = (f32::INFINITY, (0, 0));
        for dy in -REACH.1..=REACH.1 {
            for dx in -REACH.0..=REACH.0 {
                let cost = shifted_difference(&small_before, &small_after, dx, dy);
                if cost < best.0 {
                    best = (cost, (dx, dy));
                }
            }
        }
        let (dx, dy) = best.1;
        let searched = Self { zoom: 1.0, shift: [2.0 * dx as f32, 2.0 * dy as f32] };
        let refined = searched.refined(before, after);
        [refined, searched, Self::NONE]
            .into_iter()
            .map(|motion| (motion.difference(before, after), motion))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(Self::NONE, |(_, motion)| motion)
    }

    /// Mean absolute difference of brightness that this motion leaves; infinite when too little is seen in both.
    fn difference(&self, before: &Thumbnail, after: &Thumbnail) -> f32 {
        let warped = before.warped(self);
        let pixels =
            warped.planes[0].iter().zip(after.luma()).zip(&warped.inside).filter(|(_, inside)| **inside);
        let (sum, count) = pixels.fold((0.0, 0_usize), |(sum, n), ((a, b), _)| (sum + (a - b).abs(), n + 1));
        if count * 2 < WIDTH * HEIGHT { f32::INFINITY } else { sum / count as f32 }
    }

    /// Least squares on the linearised brightness (Lucas and Kanade 1981) for shift, zoom and a common change of light.
    fn refined(mut self, before: &Thumbnail, after: &Thumbnail) -> Self {
        for _ in 0..ROUNDS {
            let warped = before.warped(&self);
            let moved = &warped.planes[0];
            let mut matrix = nalgebra::Matrix4::<f32>::zeros();
            let mut right = nalgebra::Vector4::<f32>::zeros();
            for y in 1..HEIGHT - 1 {
                for x in 1..WIDTH - 1 {
                    let at = y * WIDTH + x;
                    let around = [at, at - 1, at + 1, at - WIDTH, at + WIDTH];
                    if !around.iter().all(|&i| warped.inside[i]) {
                        continue;
                    }
                    let (gx, gy) = (
                        (moved[at + 1] - moved[at - 1]) / 2.0,
                        (moved[at + WIDTH] - moved[at - WIDTH]) / 2.0,
                    );
                    let (u, v) = (x as f32 - CENTRE[0], y as f32 - CENTRE[1]);
                    let row = nalgebra::Vector4::new(gx, gy, gx * u + gy * v, 1.0);
                    let residual = after.luma()[at] - moved[at];
                    // Geman and McClure's weight: players who run the other way do not steer.
                    let weight = 1.0 / (1.0 + (residual / 12.0).powi(2)).powi(2);
                    matrix += row * row.transpose() * weight;
                    right += row * (residual * weight);
                }
            }
            matrix += nalgebra::Matrix4::from_diagonal_element(1e-3);
            let Some(step) = matrix.cholesky().map(|factor| factor.solve(&right)) else { break };
            let next = Self {
                zoom: (self.zoom + step[2]).clamp(1.0 - ZOOM_MAX, 1.0 + ZOOM_MAX),
                shift: [self.shift[0] + step[0].clamp(-2.0, 2.0), self.shift[1] + step[1].clamp(-2.0, 2.0)],
            };
            if !(next.zoom.is_finite() && next.shift.iter().all(|v| v.is_finite())) {
                break;
            }
            self = next;
        }
        self
    }
}

/// Means of two by two pixels.
fn halved(plane: &[f32]) -> Vec<f32> {
    let mut small = Vec::with_capacity(WIDTH * HEIGHT / 4);
    for y in (0..HEIGHT).step_by(2) {
        for x in (0..WIDTH).step_by(2) {
            let at = y * WIDTH + x;
            small.push((plane[at] + plane[at + 1] + plane[at + WIDTH] + plane[at + WIDTH + 1]) / 4.0);
        }
    }
    small
}

/// Mean absolute difference of half-size pictures when the content comes from `(dx, dy)` away.
fn shifted_difference(before: &[f32], after: &[f32], dx: i32, dy: i32) -> f32 {
    let (width, height) = (WIDTH as i32 / 2, HEIGHT as i32 / 2);
    let (x0, x1) = (0.max(-dx), width.min(width - dx));
    let (mut sum, mut count) = (0.0, 0);
    for y in 0.max(-dy)..height.min(height - dy) {
        let here = (y * width) as usize;
        let there = ((y + dy) * width) as usize;
        let a = &after[here + x0 as usize..here + x1 as usize];
        let b = &before[there + (x0 + dx) as usize..there + (x1 + dx) as usize];
        sum += a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>();
        count += a.len();
    }
    sum / count.max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shots::tests::scene;

    #[test]
    fn pans_and_zooms_are_found() {
        for (shift, zoom) in [([0.0, 0.0], 1.0), ([7.3, -1.4], 1.0), ([-12.0, 3.0], 1.0), ([0.6, 0.2], 1.03)]
        {
            let wanted = Motion { zoom, shift };
            let before = scene(3, |x, y| [x, y]);
            let after = scene(3, |x, y| wanted.source(x, y));
            let found = Motion::between(&before, &after);
            for corner in [[8.0, 8.0], [55.0, 8.0], [30.0, 28.0]] {
                let [a, b] = [wanted, found].map(|motion| motion.source(corner[0], corner[1]));
                let off = (a[0] - b[0]).hypot(a[1] - b[1]);
                assert!(off < 0.5, "{wanted:?} came out as {found:?}, {off} off");
            }
        }
    }

    #[test]
    fn motions_one_after_the_other_compose() {
        let (a, b) = (Motion { zoom: 1.02, shift: [3.0, 1.0] }, Motion { zoom: 0.97, shift: [-1.0, 2.0] });
        let [x, y] = b.source(10.0, 20.0);
        let [wanted, found] = [a.source(x, y), a.then(&b).source(10.0, 20.0)];
        assert!((wanted[0] - found[0]).hypot(wanted[1] - found[1]) < 1e-3, "{wanted:?} {found:?}");
    }
}
