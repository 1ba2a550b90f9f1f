//! The quality ladder: what each rung keeps of a run.

use image::{RgbaImage, imageops};
use protocol::{
    chunk::{PixelImage, Quantisation},
    compact::{Quality, Run},
    mesh::Mesh,
};

/// A rung.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rung {
    /// Its name, also the folder of its chunks.
    pub id: &'static str,
    /// What the codec may lose.
    pub quality: Quality,
    /// Share of the triangles that is kept.
    triangles: f32,
    /// Width and height of the textures are divided by this.
    shrink: u32,
}

/// The rungs, best last. Where they lie was chosen by rate and distortion: `docs/stream.md`.
pub const LADDER: [Rung; 3] = [
    Rung {
        id: "low",
        quality: Quality {
            rest: Quantisation { position_bits: 9, uv_bits: 8 },
            point_step_m: 0.06,
            texture_step: 36.0,
        },
        triangles: 0.5,
        shrink: 2,
    },
    Rung {
        id: "medium",
        quality: Quality {
            rest: Quantisation { position_bits: 9, uv_bits: 9 },
            point_step_m: 0.03,
            texture_step: 30.0,
        },
        triangles: 1.0,
        shrink: 1,
    },
    Rung { id: "high", quality: Quality::HIGH, triangles: 1.0, shrink: 1 },
];

impl Rung {
    /// The run as this rung keeps it.
    #[must_use]
    pub fn of(&self, run: &Run) -> Run {
        let run = if self.triangles < 1.0 { simplified(run, self.triangles) } else { run.clone() };
        if self.shrink == 1 {
            return run;
        }
        Run { textures: run.textures.iter().map(|texture| shrunk(texture, self.shrink)).collect(), ..run }
    }
}

/// Fewer triangles over some of the vertices.
fn simplified(run: &Run, share: f32) -> Run {
    let mesh = &run.mesh;
    let indices: Vec<u32> = mesh.triangles.as_flattened().to_vec();
    let wanted = (mesh.triangles.len() as f32 * share) as usize * 3;
    let kept = meshopt::simplify_decoder(
        &indices,
        &mesh.positions_m,
        wanted,
        1.0,
        meshopt::SimplifyOptions::None,
        None,
    );
    if kept.is_empty() {
        return run.clone();
    }
    let mut place = vec![u32::MAX; mesh.positions_m.len()];
    let mut vertices = Vec::new();
    let triangles = kept.as_chunks::<3>().0.iter().map(|corners| {
        corners.map(|vertex| {
            let place = &mut place[vertex as usize];
            if *place == u32::MAX {
                *place = vertices.len() as u32;
                vertices.push(vertex as usize);
            }
            *place
        })
    });
    let triangles = triangles.collect();
    let chosen = |all: &[[f32; 3]]| vertices.iter().filter_map(|vertex| all.get(*vertex).copied()).collect();
    Run {
        mesh: Mesh {
            positions_m: chosen(&mesh.positions_m),
            uvs: vertices.iter().filter_map(|vertex| mesh.uvs.get(*vertex).copied()).collect(),
            triangles,
        },
        positions_m: run.positions_m.iter().map(|positions| chosen(positions)).collect(),
        ..run.clone()
    }
}

fn shrunk(texture: &PixelImage, by: u32) -> PixelImage {
    let (width, height) = (texture.width_px, texture.height_px);
    let Some(picture) = RgbaImage::from_raw(width, height, texture.rgba.clone()) else {
        return texture.clone();
    };
    let (width_px, height_px) = (width.div_ceil(by), height.div_ceil(by));
    let small = imageops::resize(&picture, width_px, height_px, imageops::FilterType::Triangle);
    PixelImage { width_px, height_px, rgba: small.into_raw() }
}

#[cfg(test)]
mod tests {
    use protocol::manifest::PersonId;

    use super::*;

    #[test]
    fn a_low_rung_has_fewer_triangles_and_pixels_in_every_frame() {
        let side = 12u32;
        let vertex = |k: u32| [(k % side) as f32 * 0.1, (k / side) as f32 * 0.1, ((k * 7) % 5) as f32 * 0.01];
        let positions: Vec<[f32; 3]> = (0..side * side).map(vertex).collect();
        let corner = |k: u32| [[k, k + 1, k + side], [k + 1, k + side + 1, k + side]];
        let cells = (0..side * (side - 1)).filter(|k| k % side + 1 < side);
        let run = Run {
            person: PersonId(1),
            frames: vec![0, 1],
            anchors_m: vec![glam::Vec3::ZERO; 2],
            mesh: Mesh {
                uvs: positions.iter().map(|p| [p[0] / 1.2, p[1] / 1.2]).collect(),
                positions_m: positions.clone(),
                triangles: cells.flat_map(corner).collect(),
            },
            positions_m: vec![
                positions.clone(),
                positions.iter().map(|p| [p[0], p[1] + 0.5, p[2]]).collect(),
            ],
            textures: vec![PixelImage { width_px: 31, height_px: 20, rgba: vec![80; 31 * 20 * 4] }; 2],
            guessed_from_u: None,
            colour: [0; 3],
        };
        let low = LADDER[0].of(&run);
        assert!(low.mesh.triangles.len() <= run.mesh.triangles.len() / 2 && !low.mesh.triangles.is_empty());
        assert_eq!(low.positions_m[0], low.mesh.positions_m);
        for (rest, moved) in low.positions_m[0].iter().zip(&low.positions_m[1]) {
            assert_eq!(rest[1] + 0.5, moved[1]);
        }
        assert_eq!((low.textures[1].width_px, low.textures[1].height_px), (16, 10));
        assert_eq!(low.textures[1].rgba.len(), 16 * 10 * 4);
        assert_eq!(LADDER[2].of(&run), run);
    }
}
