//! How far a camera and the network's evidence agree, and how likely such a camera is right.

use glam::DVec2;
use protocol::camera::Camera;

use super::{
    evidence::Evidence,
    refine::{Named, distances},
};

/// A named point or cell of a line agrees when the camera puts it within this share of the picture's width.
const NEAR: f64 = 0.010;
/// Lines shorter than this share of the picture's width need not be seen.
const LENGTH_MIN: f64 = 0.06;
/// Places nearer to the edge than this share of the width need not be seen.
const MARGIN: f64 = 0.015;

/// Slope and offset of the agreement's logit: what `training/pitch/confidence.py` printed.
const CALIBRATED: (f64, f64) = (1.072, -2.967);

/// How evidence and camera agree, shares 0..1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Agreement {
    /// Of what the network named, by how sure it was: what the camera explains.
    pub(super) explained: f64,
    /// Of the painted lines that the camera shows: what the network sees there.
    pub(super) seen: f64,
    /// Weight of the agreeing points and kinds of lines: about how many there are.
    pub(super) support: f64,
}

impl Agreement {
    pub(super) fn of(camera: &Camera, evidence: &Evidence, named: &Named) -> Self {
        let (points, lines) = distances(camera, evidence, named);
        let near = NEAR * f64::from(camera.width_px);
        let (mut agreeing, mut all, mut support) = (0.0, 0.0, 0.0);
        for (point, distance) in evidence.points.iter().zip(&points) {
            all += point.score;
            if *distance <= near {
                agreeing += point.score;
                support += point.score;
            }
        }
        // A line counts like a point for every 4 of its cells.
        let mut of_kind = std::collections::BTreeMap::<usize, f64>::new();
        for (cell, distance) in evidence.lines.iter().zip(&lines) {
            all += cell.score / 4.0;
            if *distance <= near {
                agreeing += cell.score / 4.0;
                *of_kind.entry(cell.name).or_default() += cell.score / 4.0;
            }
        }
        support += of_kind.values().map(|weight| weight.min(1.0)).sum::<f64>();
        let explained = if all > 0.0 { agreeing / all } else { 0.0 };
        Self { explained, seen: seen(camera, evidence, named), support }
    }

    /// Probability that the camera is right: that nine of ten points of the pitch are within 2 % of the picture's width. A
    /// logistic function of the shares with weights set by hand, its slope and offset fitted to rendered pictures, plain and
    /// spoiled, of matches that no network was trained on (`training/pitch/confidence.py`). Real pictures are harder; the evaluation's
    /// reliability table says by how much.
    pub(super) fn confidence(&self) -> f64 {
        let agreement = 8.0 * (self.explained - 0.6) + 6.0 * (self.seen - 0.45) + 0.25 * (self.support - 6.0);
        1.0 / (1.0 + (-(CALIBRATED.0 * agreement + CALIBRATED.1)).exp())
    }
}

/// Share of the lines that the camera shows, by their length in the picture, that the network sees there too.
fn seen(camera: &Camera, evidence: &Evidence, named: &Named) -> f64 {
    let width = f64::from(camera.width_px);
    let margin = MARGIN * width;
    let limit = DVec2::new(width, f64::from(camera.height_px)) - 1.0 - margin;
    let (mut shown, mut there) = (0.0, 0.0);
    for (name, line) in named.lines.iter().enumerate() {
        let pixels: Vec<Option<DVec2>> = line.iter().map(|&point| camera.project(point)).collect();
        let (mut length, mut found) = (0.0, 0.0);
        for pair in pixels.windows(2) {
            let [Some(a), Some(b)] = pair else { continue };
            let middle = (*a + *b) / 2.0;
            if middle.cmpge(DVec2::splat(margin)).all() && middle.cmple(limit).all() {
                let step = a.distance(*b);
                length += step;
                found += if evidence.shows(name, middle) { step } else { 0.0 };
            }
        }
        if length >= LENGTH_MIN * width {
            shown += length;
            there += found;
        }
    }
    if shown > 0.0 { there / shown } else { 0.0 }
}
