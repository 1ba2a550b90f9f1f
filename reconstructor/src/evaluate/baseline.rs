//! A frame stored by itself: one Draco mesh per body and one JPEG, what the compact profile is held against.

use image::RgbImage;
use protocol::{
    chunk::{self, ChunkError, Quantisation},
    compact::Run,
    mesh::Mesh,
};

use crate::encode::{Atlas, EncodeError};

/// Draco's speed and JPEG's quality.
const SPEED: u8 = 3;
const QUALITY: u8 = 75;

/// A frame as it is read back.
pub(super) struct Baseline {
    /// Geometry and texture.
    pub(super) bytes: usize,
    /// The bodies in the order given.
    pub(super) meshes: Vec<Mesh>,
    /// The texture of them all.
    pub(super) atlas: RgbImage,
    packed: Atlas,
}

impl Baseline {
    /// Stores the given frames of runs, whose textures are `pictures`.
    pub(super) fn new(
        bodies: &[(&Run, usize)],
        pictures: &[RgbImage],
        clip_frame: u32,
        quantisation: Quantisation,
    ) -> Result<Self, EncodeError> {
        let packed = Atlas::pack(&pictures.iter().collect::<Vec<_>>(), clip_frame);
        let texture = |message| EncodeError::Texture { clip_frame, message };
        let jpeg = packed.jpeg(QUALITY).map_err(|error| texture(error.to_string()))?.bytes;
        let atlas = image::load_from_memory(&jpeg).map_err(|error| texture(error.to_string()))?.to_rgb8();
        let mut frame = Self { bytes: jpeg.len(), meshes: Vec::with_capacity(bodies.len()), atlas, packed };
        for (index, (run, at)) in bodies.iter().enumerate() {
            let uvs = run.mesh.uvs.iter().map(|uv| frame.packed.uv(index, *uv)).collect();
            let mesh = Mesh { positions_m: run.positions_m[*at].clone(), uvs, ..run.mesh.clone() };
            let (bytes, stored) = chunk::geometry(&mesh, quantisation, SPEED).map_err(|problem| {
                EncodeError::Codec(ChunkError::Body { frame: run.frames[*at], person: run.person, problem })
            })?;
            frame.bytes += bytes.len();
            frame.meshes.push(stored);
        }
        Ok(frame)
    }

    /// A texture coordinate of body `index` as one of the atlas.
    pub(super) fn atlas_uv(&self, index: usize, [u, v]: [f64; 2]) -> [f64; 2] {
        self.packed.uv(index, [u as f32, v as f32]).map(f64::from)
    }
}
