//! The surface of a body in the world, without crumbs and within its budget.

use std::collections::HashMap;

use glam::DVec3;

use super::{MeshError, VirtualPlane, decimate, nets::Net, volume::Volume};
use crate::depth::DepthMap;

/// Pieces smaller than this share of the largest piece are dropped.
const PIECE_SHARE: f64 = 0.04;
/// A body of fewer triangles is no body.
const LEAST_TRIANGLES: usize = 24;

/// Triangles of the world.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    /// World metres.
    pub(super) points_m: Vec<DVec3>,
    /// Counter-clockwise seen from outside.
    pub(super) triangles: Vec<[u32; 3]>,
}

/// A net over the cells of a depth map, brought to the world; what would lie behind the camera is left out.
pub(super) fn lifted(net: &Net, volume: &Volume, depth: &DepthMap, plane: &VirtualPlane) -> Surface {
    let points: Option<Vec<DVec3>> = net
        .places
        .iter()
        .map(|&place| {
            let (cell, offset_m) = volume.place(place);
            plane.point(depth.pixel(cell), offset_m)
        })
        .collect();
    match points {
        Some(points_m) => Surface { points_m, triangles: net.triangles.clone() },
        None => Surface::default(),
    }
}

impl Surface {
    /// Fewer triangles, as many as the budget allows. Says whether the surface may have lost its closedness.
    pub(super) fn simplify(&mut self, triangles: usize) -> bool {
        let simplified = decimate::to_budget(&self.points_m, &self.triangles, triangles);
        self.keep(&simplified.triangles);
        simplified.clustered
    }

    /// Keeps some triangles and the points they use, in order of first use.
    fn keep(&mut self, triangles: &[[u32; 3]]) {
        let mut new_index = vec![u32::MAX; self.points_m.len()];
        let mut points_m = Vec::new();
        let kept = triangles.iter().map(|triangle| {
            triangle.map(|old| {
                let old = old as usize;
                if new_index[old] == u32::MAX {
                    new_index[old] = points_m.len() as u32;
                    points_m.push(self.points_m[old]);
                }
                new_index[old]
            })
        });
        self.triangles = kept.collect();
        self.points_m = points_m;
    }

    /// Drops the pieces that are small beside the largest one, and every point that no triangle uses.
    pub(super) fn keep_large(&mut self) -> Result<(), MeshError> {
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
        self.keep(&kept);
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
