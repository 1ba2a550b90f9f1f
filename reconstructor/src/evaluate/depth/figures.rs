//! The measures, and what they are made of.

use std::collections::BTreeMap;

use serde::Serialize;

use super::super::planes::Squares;

/// The measures over players, pooled over pixels (DESIGN: depth).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DepthFigures {
    /// Players measured.
    pub players: usize,
    /// Root mean square error of the seen surface's distance from the upright plane, metres.
    pub rmse_m: f64,
    /// The same after the best scale and translation per player (the paper's st-RMSE), metres.
    pub st_rmse_m: f64,
    /// Root mean square error of the last surface's distance at the same pixels, metres.
    pub back_rmse_m: f64,
    /// Error of the upright plane itself, metres.
    pub flat_plane_rmse_m: f64,
    /// Error of the best plane per player, fitted to the truth, metres.
    pub tilted_plane_rmse_m: f64,
    /// Mean intersection over union of the depth map's mask and the true one.
    pub mask_iou: f64,
    /// Mean intersection over union of the segmentation's mask, which the network is given, and the true one.
    pub given_mask_iou: f64,
    /// Share of the pairs of limbs, both seen and at least 0.1 m apart in depth, of which the right one is nearer.
    pub limb_order_accuracy: Option<f64>,
    /// Such pairs.
    pub limb_pairs: usize,
}

/// What `evaluate depth` prints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DepthReport {
    /// Over everybody measured.
    #[serde(flatten)]
    pub all: DepthFigures,
    /// Players whose pose or depth failed: not in the figures.
    pub failed: usize,
    /// By the player's height in the clip, pixels.
    pub by_height_px: BTreeMap<u32, DepthFigures>,
    /// By motion clip or formula.
    pub by_motion: BTreeMap<String, DepthFigures>,
}

/// What figures are made of.
#[derive(Clone, Debug, Default)]
pub(super) struct Tally {
    pub(super) players: usize,
    pub(super) squares: Squares,
    pub(super) back: f64,
    pub(super) iou: f64,
    pub(super) given_iou: f64,
    pub(super) limbs: usize,
    pub(super) limbs_right: usize,
}

impl Tally {
    /// Adds that of others.
    pub(super) fn add(&mut self, other: &Self) {
        self.players += other.players;
        self.squares.add(other.squares);
        self.back += other.back;
        self.iou += other.iou;
        self.given_iou += other.given_iou;
        self.limbs += other.limbs;
        self.limbs_right += other.limbs_right;
    }

    /// The measures.
    pub(super) fn figures(&self) -> DepthFigures {
        let players = self.players.max(1) as f64;
        DepthFigures {
            players: self.players,
            rmse_m: self.squares.root_mean(self.squares.error),
            st_rmse_m: self.squares.root_mean(self.squares.scaled),
            back_rmse_m: self.squares.root_mean(self.back),
            flat_plane_rmse_m: self.squares.root_mean(self.squares.flat),
            tilted_plane_rmse_m: self.squares.root_mean(self.squares.tilted),
            mask_iou: self.iou / players,
            given_mask_iou: self.given_iou / players,
            limb_order_accuracy: (self.limbs > 0).then(|| self.limbs_right as f64 / self.limbs as f64),
            limb_pairs: self.limbs,
        }
    }
}
