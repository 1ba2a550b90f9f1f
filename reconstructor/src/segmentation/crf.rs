//! M_CNN of the paper's section 4.3: a dense CRF over the aligned crops of one player in a block of frames.
//!
//! Every cell of every frame is bound to every other one by a Gaussian of place, time and colour (Krähenbühl & Koltun 2011); mean field
//! with two labels, messages by the permutohedral lattice.

use super::lattice::Lattice;

/// Standard deviations of the Gaussian: place as a share of the body's height, time in frames, colour 0..1 per channel.
const PLACE: f32 = 0.05;
const TIME_FRAMES: f32 = 3.0;
const COLOUR: f32 = 0.07;
/// How much the others weigh against a cell's own unary, in units of a logit.
const PAIRWISE: f32 = 4.0;
const STEPS: usize = 8;
/// Unary probabilities are kept this far from 0 and 1: the network is never that sure at a rim.
const UNSURE: f32 = 0.02;

/// One cell of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    /// Relative to the body's middle, in body heights.
    pub(super) place: [f32; 2],
    /// Frames since the first of the block.
    pub(super) time_frames: f32,
    /// 0..1.
    pub(super) colour: [f32; 3],
    /// Probability of the person by the network alone, 0..1.
    pub(super) unary: f32,
}

impl Cell {
    fn features(&self) -> [f32; 6] {
        let [x, y] = self.place;
        let [r, g, b] = self.colour;
        [x / PLACE, y / PLACE, self.time_frames / TIME_FRAMES, r / COLOUR, g / COLOUR, b / COLOUR]
    }

    fn logit(&self) -> f32 {
        let p = if self.unary.is_nan() { 0.0 } else { self.unary }.clamp(UNSURE, 1.0 - UNSURE);
        (p / (1.0 - p)).ln()
    }
}

/// The probability of the person in every cell after mean field.
pub(super) fn infer(cells: &[Cell]) -> Vec<f32> {
    let features: Vec<[f32; 6]> = cells.iter().map(Cell::features).collect();
    let lattice = Lattice::new(&features);
    let ones = lattice.filter(&vec![1.0; cells.len()]);
    let logits: Vec<f32> = cells.iter().map(Cell::logit).collect();
    let sigmoid = |logit: f32| 1.0 / (1.0 + (-logit).exp());
    let mut belief: Vec<f32> = logits.iter().map(|&logit| sigmoid(logit)).collect();
    for _ in 0..STEPS {
        let message = lattice.filter(&belief);
        for (((belief, logit), message), one) in belief.iter_mut().zip(&logits).zip(&message).zip(&ones) {
            let agree = if *one > 1e-6 { message / one } else { *belief };
            *belief = sigmoid(logit + PAIRWISE * (2.0 * agree - 1.0));
        }
    }
    belief
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A red disc on green over `frames` frames; the network misses the upper half of it in one of them.
    fn disc(frames: usize, side: usize) -> (Vec<Cell>, Vec<bool>) {
        let mut cells = Vec::new();
        let mut truth = Vec::new();
        for t in 0..frames {
            for i in 0..side * side {
                let place = [i % side, i / side].map(|v| v as f32 / side as f32 - 0.5);
                let inside = place[0].hypot(place[1]) < 0.3;
                let seen = inside && !(t == frames / 2 && place[1] < 0.0);
                let noise = ((i * 7 + t * 13) % 5) as f32 * 0.008;
                let colour = if inside { [0.8 - noise, 0.1, 0.1] } else { [0.1, 0.5 + noise, 0.1] };
                cells.push(Cell {
                    place,
                    time_frames: t as f32,
                    colour,
                    unary: if seen { 0.9 } else { 0.1 },
                });
                truth.push(inside);
            }
        }
        (cells, truth)
    }

    #[test]
    fn what_one_frame_misses_comes_from_the_others() {
        let (cells, truth) = disc(9, 24);
        let belief = infer(&cells);
        let wrong = |values: &mut dyn Iterator<Item = f32>| {
            values.zip(&truth).filter(|(v, t)| (*v > 0.5) != **t).count()
        };
        let before = wrong(&mut cells.iter().map(|cell| cell.unary));
        let after = wrong(&mut belief.iter().copied());
        assert!(before > 50 && after * 10 < before, "{before} became {after}");
    }

    #[test]
    fn nothing_and_what_is_no_number_do_no_harm() {
        assert!(infer(&[]).is_empty());
        let odd =
            Cell { place: [f32::NAN; 2], time_frames: 0.0, colour: [f32::INFINITY; 3], unary: f32::NAN };
        assert!(infer(&[odd, odd]).iter().all(|p| p.is_finite() && *p < 0.5));
    }
}
