//! Mₒ of the paper's section 4.3: which cells belong to the player and which to the field or to others, grown from the skeletons.
//!
//! oₚ is 0 on the player's own bones and where the mask network is sure, 2 on other people's, 1 where the background is sure, and spreads between them along colours that are
//! alike and across no edge. The paper writes Levin's row-normalised energy; its public code solves a random walk. Here it is the
//! quadratic form of the same affinities, the graph's Laplacian, whose minimum is the random walk's.

use image::RgbImage;

use super::{
    exclusive::{Claim, limb_px},
    grid::Grid,
    minimum::GridEnergy,
};
use crate::pose::{Person, index};

/// Colours (0..1 per channel) that differ by this much are bound exp(−1) as strongly.
const COLOUR_SCALE: f64 = 0.12;
/// The same for the strength of an edge: the largest difference of a channel across two cells.
const EDGE_SCALE: f64 = 0.35;
/// No link is weaker: a cell that no seed reaches would have no value.
const LINK_MIN: f64 = 1e-5;
/// How strongly seeds are held, and all others to the background, so that cells without any link to a seed belong to it.
const SEED: f64 = 100.0;
const DRIFT: f64 = 1e-5;
/// Bones are seeds where the mask network gives the person at least this; joints on limbs may lie beside them.
const SEED_COVERAGE: f32 = 0.35;
/// Cells to which the mask network gives at least this are seeds, too. Thin skeletons alone lose against the background's many seeds on
/// players of 40 pixels (docs/segmentation.md).
const SURE_COVERAGE: f32 = 0.95;
/// Cells with less coverage than this by anybody, and farther than this many limbs from all bones, are background.
const BACKGROUND_COVERAGE: f32 = 0.04;
const BACKGROUND_LIMBS: f64 = 1.5;
/// The paper's threshold on oₚ.
pub(super) const THRESHOLD: f64 = 0.5;

/// oₚ for every cell, 0..2; `None` when there is no seed of the person's own.
pub(super) fn association<'a>(
    grid: &Grid,
    colours: &[[f32; 3]],
    person: &Person,
    others: impl Iterator<Item = &'a Person>,
) -> Option<Vec<f64>> {
    let own = Rival::of(person, grid);
    let others: Vec<Rival> = others.map(|other| Rival::of(other, grid)).collect();
    let mut anchor = vec![DRIFT; grid.len()];
    let mut wanted = vec![1.0; grid.len()];
    let mut seeded = false;
    for i in 0..grid.len() {
        let pixel = grid.centre(i);
        let half = (0.5 * grid.cell_px).max(0.35 * own.limb_px);
        let on_bone = |rival: &Rival| {
            rival.claim.squared_distance_px(pixel) <= half * half && rival.covers(i) >= SEED_COVERAGE
        };
        let seeds = |rival: &Rival| on_bone(rival) || rival.covers(i) >= SURE_COVERAGE;
        let rival = others.iter().filter(|other| seeds(other)).max_by(|a, b| a.feet_px.total_cmp(&b.feet_px));
        let seed = match (seeds(&own), rival) {
            // Where seeds cross, the one in front is seen.
            (true, Some(other)) if other.feet_px > own.feet_px => Some(2.0),
            (true, _) => Some(0.0),
            (false, Some(_)) => Some(2.0),
            (false, None) => {
                let mut all = others.iter().chain([&own]);
                let far = |r: &Rival| {
                    r.covers(i) < BACKGROUND_COVERAGE
                        && r.claim.squared_distance_px(pixel) > (BACKGROUND_LIMBS * r.limb_px).powi(2)
                };
                all.all(far).then_some(1.0)
            }
        };
        if let Some(value) = seed {
            (anchor[i], wanted[i]) = (SEED, value);
            seeded |= value == 0.0;
        }
    }
    if !seeded {
        return None;
    }
    let (right, down) = links(grid, colours);
    let energy = GridEnergy { width: grid.width, height: grid.height, right, down, anchor, wanted };
    energy.minimum()
}

/// The affinities of neighbouring cells: exp(−‖colour difference‖²) · exp(−edge²).
fn links(grid: &Grid, colours: &[[f32; 3]]) -> (Vec<f64>, Vec<f64>) {
    let (width, height) = (grid.width, grid.height);
    let at = |x: usize, y: usize| {
        colours.get(y.min(height - 1) * width + x.min(width - 1)).copied().unwrap_or_default()
    };
    let edge = |x: usize, y: usize| {
        let across =
            |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let horizontal = across(at(x + 1, y), at(x.saturating_sub(1), y));
        f64::from(horizontal.max(across(at(x, y + 1), at(x, y.saturating_sub(1)))))
    };
    let bond = |a: (usize, usize), b: (usize, usize)| {
        let colour =
            at(a.0, a.1).iter().zip(at(b.0, b.1)).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
        let edge = (edge(a.0, a.1).powi(2) + edge(b.0, b.1).powi(2)) / 2.0;
        (-colour / COLOUR_SCALE.powi(2) - edge / EDGE_SCALE.powi(2)).exp().max(LINK_MIN)
    };
    let cells = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    cells.map(|(x, y)| (bond((x, y), (x + 1, y)), bond((x, y), (x, y + 1)))).unzip()
}

/// Somebody as the seeds see them.
struct Rival {
    claim: Claim,
    limb_px: f64,
    coverage: Vec<f32>,
    feet_px: f64,
}

impl Rival {
    fn of(person: &Person, grid: &Grid) -> Self {
        Self {
            claim: Claim::of(person),
            limb_px: limb_px(person),
            coverage: grid.coverage(&person.mask),
            feet_px: feet_px(person),
        }
    }

    fn covers(&self, cell: usize) -> f32 {
        self.coverage.get(cell).copied().unwrap_or(0.0)
    }
}

/// The lowest row of the feet: whose feet are lower in the picture stands nearer to a camera above the pitch.
pub(super) fn feet_px(person: &Person) -> f64 {
    let feet = person.joints.iter().skip(index::LEFT_ANKLE).take(6).map(|joint| joint.pixel.y);
    feet.fold(f64::NEG_INFINITY, f64::max)
}

/// Everything of a crop that the energy and the CRF need.
pub(super) fn crop(picture: &RgbImage, person: &Person, rows_max: usize) -> Option<(Grid, Vec<[f32; 3]>)> {
    let grid = Grid::over(&person.bounds, MARGIN, rows_max, picture.dimensions())?;
    Some((grid, grid.colours(picture)))
}

/// Around a person's box, as a share of its height.
const MARGIN: f64 = 0.12;
