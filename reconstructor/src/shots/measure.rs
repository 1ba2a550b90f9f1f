//! How much of the difference between two frames the camera's motion leaves unexplained, and in which pattern.

use super::{
    motion::Motion,
    thumbnail::{CHANNELS, HEIGHT, Thumbnail, WIDTH},
};

/// Pixels of the thumbnail that are compared together: what moves on its own has moved by about one of them.
const BLOCK: (usize, usize) = (8, 6);
/// Cells of the pattern, thumbnail pixels each way.
const CELL: usize = 4;
/// Cells across and down.
const CELLS: (usize, usize) = (WIDTH / CELL, HEIGHT / CELL);
/// A cell's change is held to this many times the middle change of all cells, which is taken to be at least
/// [`LEAST_CELL`] levels.
const CELL_MAX: f32 = 4.0;
const LEAST_CELL: f32 = 0.25;
/// Coding noise and what the linear model leaves, levels of 255.
const NOISE: f32 = 4.0;
/// Share of the picture that must be seen in both frames before they can be compared.
const LEAST_OVERLAP: f32 = 0.3;

/// Differences in a coarse grid, all channels.
pub(super) type Pattern = Vec<f32>;

/// How different two frames are once `motion` is taken out: in the middle one of all blocks, the squared difference over the sum
/// of both pictures' variances. 0 is the same scene, about 1 two scenes that have nothing in common; players and graphics
/// change fewer than half of the blocks and so nothing. A common change of brightness does not count, and every block may
/// have moved by a pixel more or not have followed the camera. `None` when too little is seen in both.
pub(super) fn difference(before: &Thumbnail, after: &Thumbnail, motion: &Motion) -> Option<f32> {
    let (moved, still) = (before.warped(motion), before.warped(&Motion::NONE));
    let seen = moved.inside.iter().filter(|inside| **inside).count();
    if (seen as f32) < LEAST_OVERLAP * (WIDTH * HEIGHT) as f32 {
        return None;
    }
    let light = moved.planes[0]
        .iter()
        .zip(after.luma())
        .zip(&moved.inside)
        .filter_map(|((a, b), inside)| inside.then_some(b - a))
        .sum::<f32>()
        / seen as f32;
    let scale = before.contrast() + after.contrast() + 2.0 * NOISE * NOISE;
    let mut blocks = Vec::new();
    for top in (0..HEIGHT).step_by(BLOCK.1) {
        for left in (0..WIDTH).step_by(BLOCK.0) {
            let candidates = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
            let followed = candidates
                .filter_map(|by| block(&moved.planes, &moved.inside, after, (left, top), by, light))
                .reduce(f32::min);
            let Some(followed) = followed else { continue };
            let fixed = block(&still.planes, &still.inside, after, (left, top), (0, 0), 0.0);
            blocks.push(fixed.map_or(followed, |fixed| fixed.min(followed)) / scale);
        }
    }
    blocks.sort_by(f32::total_cmp);
    blocks.get(blocks.len() / 2).copied()
}

/// Mean squared difference of a block, all channels, when its content lies `by` away in `planes`.
fn block(
    planes: &[Vec<f32>; CHANNELS],
    inside: &[bool],
    after: &Thumbnail,
    (left, top): (usize, usize),
    (dx, dy): (i32, i32),
    light: f32,
) -> Option<f32> {
    let (mut sum, mut count) = (0.0, 0);
    for y in top..(top + BLOCK.1).min(HEIGHT) {
        for x in left..(left + BLOCK.0).min(WIDTH) {
            let (u, v) = (x as i32 + dx, y as i32 + dy);
            if u < 0 || v < 0 || u >= WIDTH as i32 || v >= HEIGHT as i32 {
                continue;
            }
            let (from, to) = (v as usize * WIDTH + u as usize, y * WIDTH + x);
            if !inside[from] {
                continue;
            }
            for (channel, (before, after)) in planes.iter().zip(&after.planes).enumerate() {
                let light = if channel == 0 { light } else { 0.0 };
                let off = after[to] - before[from] - light;
                sum += off * off;
            }
            count += 1;
        }
    }
    (count * 2 >= BLOCK.0 * BLOCK.1).then(|| sum / count as f32)
}

/// What the camera's motion leaves of the step from one frame to the next, averaged over cells. A player who runs on the spot in a
/// close-up changes few cells by much; they are held to a few times the middle one.
pub(super) fn pattern(before: &Thumbnail, after: &Thumbnail, motion: &Motion) -> Pattern {
    let moved = before.warped(motion);
    let mut cells = vec![0.0; CELLS.0 * CELLS.1 * CHANNELS];
    for (channel, (a, b)) in moved.planes.iter().zip(&after.planes).enumerate() {
        for (at, inside) in moved.inside.iter().enumerate() {
            if *inside {
                let (x, y) = (at % WIDTH / CELL, at / WIDTH / CELL);
                cells[(channel * CELLS.1 + y) * CELLS.0 + x] += (b[at] - a[at]) / (CELL * CELL) as f32;
            }
        }
    }
    for channel in cells.chunks_mut(CELLS.0 * CELLS.1) {
        let mut sizes: Vec<f32> = channel.iter().map(|v| v.abs()).collect();
        sizes.sort_by(f32::total_cmp);
        let most = CELL_MAX * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0).max(LEAST_CELL);
        channel.iter_mut().for_each(|v| *v = v.clamp(-most, most));
    }
    cells
}

/// Squared length of a pattern per cell.
pub(super) fn energy(pattern: &[f32]) -> f32 {
    pattern.iter().map(|v| v * v).sum::<f32>() / (CELLS.0 * CELLS.1) as f32
}
