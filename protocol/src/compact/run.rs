//! A decoded run: its body and its texture in any of its frames.

use glam::Vec3;

use super::{
    klt::Basis,
    texture::{self, TILE_PX, TILE_VALUES},
};
use crate::{
    atlas::{Layout, Place},
    chunk::{Body, PixelImage},
    manifest::PersonId,
    mesh::Mesh,
};

/// A person with one mesh for some frames.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DecodedRun {
    pub(super) person: PersonId,
    /// Places of its frames in the chunk, rising.
    pub(super) frames: Vec<usize>,
    pub(super) anchors_m: Vec<Vec3>,
    pub(super) guessed_from_u: Option<f32>,
    /// At rest; texture coordinates into the atlas.
    pub(super) mesh: Mesh,
    pub(super) of_vertex: Vec<u32>,
    pub(super) point_waves: Basis,
    /// Metres, wave by wave, point by point.
    pub(super) point_shares: Vec<[f32; 3]>,
    pub(super) texture_waves: Basis,
    pub(super) texture_px: [usize; 2],
    pub(super) columns: usize,
    /// The stored tiles of the texture, by place.
    pub(super) tiles: Vec<usize>,
    /// Wave by wave, tile by tile; and whether there is anything.
    pub(super) texture_shares: Vec<f32>,
    pub(super) filled: Vec<bool>,
}

impl DecodedRun {
    pub(super) fn scale_uvs(&mut self, map: impl Fn([f32; 2]) -> [f32; 2]) {
        self.mesh.uvs.iter_mut().for_each(|uv| *uv = map(*uv));
        // The same map along u: it does not mix the axes.
        self.guessed_from_u = self.guessed_from_u.map(|u| map([u, 0.0])[0]);
    }

    /// Makes texture coordinates ones of the atlas.
    pub(super) fn move_to(&mut self, place: &Place, atlas: &Layout) {
        let along = |start: u32, length: u32, value: f32, whole: u32| {
            (start as f32 + value * length as f32) / whole.max(1) as f32
        };
        let (place, width, height) = (*place, atlas.width, atlas.height);
        self.scale_uvs(|[u, v]| {
            [along(place.x, place.width, u, width), along(place.y, place.height, v, height)]
        });
    }

    /// The body in the run's frame `at`.
    pub(super) fn body(&self, at: usize) -> Body {
        let points = self.point_shares.len().checked_div(self.point_waves.waves()).unwrap_or(0);
        let mut moves = vec![[0.0f32; 3]; points];
        for (wave, shares) in self.point_shares.chunks_exact(points.max(1)).enumerate() {
            let weight = self.point_waves.at(wave, at);
            for (moved, share) in moves.iter_mut().zip(shares) {
                for axis in 0..3 {
                    moved[axis] += weight * share[axis];
                }
            }
        }
        let mut mesh = self.mesh.clone();
        for (position, point) in mesh.positions_m.iter_mut().zip(&self.of_vertex) {
            let moved = moves.get(*point as usize).copied().unwrap_or_default();
            *position = [0, 1, 2].map(|axis| position[axis] + moved[axis]);
        }
        let anchor_m = self.anchors_m.get(at).copied().unwrap_or_default();
        Body { person: self.person, anchor_m, mesh, guessed_from_u: self.guessed_from_u }
    }

    /// Draws the texture in the run's frame `at` into the atlas.
    pub(super) fn paint(&self, at: usize, place: &Place, picture: &mut PixelImage) {
        let row_bytes = picture.width_px as usize * 4;
        let weights: Vec<f32> =
            (0..self.texture_waves.waves()).map(|wave| self.texture_waves.at(wave, at)).collect();
        let all = self.tiles.len();
        let shares = self.texture_shares.as_chunks::<TILE_VALUES>().0;
        for (index, tile) in self.tiles.iter().enumerate() {
            let mut values = [0.0f32; TILE_VALUES];
            for (wave, weight) in weights.iter().enumerate() {
                // Most of a late wave is empty.
                if !self.filled.get(wave * all + index).copied().unwrap_or(false) {
                    continue;
                }
                let Some(share) = shares.get(wave * all + index) else { continue };
                for (value, share) in values.iter_mut().zip(share) {
                    *value += weight * share;
                }
            }
            let x = place.x as usize + tile % self.columns.max(1) * TILE_PX;
            let y = place.y as usize + tile / self.columns.max(1) * TILE_PX;
            if let Some(out) = picture.rgba.get_mut(y * row_bytes + x * 4..) {
                texture::paint(&values, out, row_bytes);
            }
        }
    }
}
