//! One body's mesh to and from Draco, with every count bounded before the decoder may allocate for it.

use draco_core::{
    DataType, DecodeLimits, DecoderBuffer, EncoderBuffer, EncoderOptions, GeometryAttributeType, MeshDecoder,
    MeshEncoder, PointAttribute, PointIndex,
};

use super::Quantisation;
use crate::mesh::Mesh;

/// Draco's id of the position attribute in files written here.
pub(crate) const POSITION_ID: usize = 0;
/// Draco's id of the texture coordinates in files written here.
pub(crate) const UV_ID: usize = 1;

/// Bytes of one decoded vertex (three plus two floats).
pub(crate) const VERTEX_BYTES: usize = 20;
/// Bytes of one decoded triangle.
pub(crate) const TRIANGLE_BYTES: usize = 12;

/// Encoder speed, 0 smallest to 10 fastest; the README says what it costs.
const SPEED: i32 = 4;

/// What a compressed mesh says it holds; the decoded one must hold exactly this.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) vertices: usize,
    pub(crate) triangles: usize,
}

/// Which Draco attribute carries what.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AttributeIds {
    pub(crate) position: usize,
    pub(crate) uv: usize,
}

/// Compresses a mesh. Vertices may come back in another order and unused ones do not come back.
pub(crate) fn encode(mesh: &Mesh, quantisation: Quantisation) -> Result<Vec<u8>, String> {
    encode_at(mesh, quantisation, SPEED)
}

pub(crate) fn encode_at(mesh: &Mesh, quantisation: Quantisation, speed: i32) -> Result<Vec<u8>, String> {
    check(mesh)?;
    // Draco drops triangles that name a vertex twice; so do we, to know what it will keep.
    let triangles: Vec<u32> =
        mesh.triangles.iter().filter(|[a, b, c]| a != b && b != c && a != c).flatten().copied().collect();
    if triangles.is_empty() {
        return Err("it has no triangle: leave the body out".to_owned());
    }
    let vertices = mesh.positions_m.len();
    let attribute = |kind, components: u8, values: &[f32]| -> Result<PointAttribute, String> {
        let mut attribute = PointAttribute::new();
        attribute
            .try_init(kind, components, DataType::Float32, false, vertices)
            .map_err(|error| error.to_string())?;
        attribute.buffer_mut().update_f32s_le(0, values);
        Ok(attribute)
    };
    let mut source = draco_core::Mesh::new();
    source.set_num_points(vertices);
    source.add_attribute(attribute(GeometryAttributeType::Position, 3, mesh.positions_m.as_flattened())?);
    source.add_attribute(attribute(GeometryAttributeType::TexCoord, 2, mesh.uvs.as_flattened())?);
    source.set_num_faces(triangles.len() / 3); // before the faces: otherwise none are kept
    source.set_faces_from_flat_indices(&triangles);
    // A vertex that no triangle uses would widen the box that positions are rounded in.
    source.remove_points_unused_by_faces();

    let mut options = EncoderOptions::new();
    options.set_global_int("encoding_speed", speed);
    options.set_global_int("decoding_speed", speed);
    options.set_attribute_quantization(POSITION_ID as i32, i32::from(quantisation.position_bits));
    options.set_attribute_quantization(UV_ID as i32, i32::from(quantisation.uv_bits));
    let mut out = EncoderBuffer::new();
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(source);
    encoder.encode(&options, &mut out).map_err(|error| error.to_string())?;
    Ok(out.data().to_vec())
}

/// Refuses what would come out of the encoder as something else.
fn check(mesh: &Mesh) -> Result<(), String> {
    if mesh.positions_m.len() != mesh.uvs.len() {
        return Err(format!("it has {} positions but {} uvs", mesh.positions_m.len(), mesh.uvs.len()));
    }
    if let Some(index) = mesh.triangles.iter().flatten().find(|&&i| i as usize >= mesh.positions_m.len()) {
        return Err(format!("a triangle uses vertex {index} of {}", mesh.positions_m.len()));
    }
    let mut values = mesh.positions_m.as_flattened().iter().chain(mesh.uvs.as_flattened());
    if !values.all(|value| value.is_finite()) {
        return Err("a vertex has a coordinate that is not a number".to_owned());
    }
    Ok(())
}

/// Decompresses a mesh that says it has `counts`; the caller has checked those against its limits.
pub(crate) fn decode(bytes: &[u8], ids: AttributeIds, counts: Counts) -> Result<Mesh, String> {
    // Other encoders may add normals or colours: room for them, but no more.
    let attribute_bytes = counts.vertices.saturating_mul(VERTEX_BYTES).saturating_mul(3) as u64;
    let limits = DecodeLimits::default()
        .with_max_points(counts.vertices as u64)
        .with_max_faces(counts.triangles as u64)
        .with_max_decoded_bytes(attribute_bytes);
    let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
    let mut decoded = draco_core::Mesh::new();
    MeshDecoder::new().decode(&mut buffer, &mut decoded).map_err(|error| error.to_string())?;
    let actual = Counts { vertices: decoded.num_points(), triangles: decoded.num_faces() };
    if actual != counts {
        return Err(format!(
            "the accessors promise {} vertices and {} triangles, the Draco data has {} and {}",
            counts.vertices, counts.triangles, actual.vertices, actual.triangles
        ));
    }
    read(&decoded, ids)
}

/// Decompresses a mesh just written here, to learn what a reader will see.
pub(crate) fn decode_own(bytes: &[u8]) -> Result<Mesh, String> {
    let mut decoded = draco_core::Mesh::new();
    MeshDecoder::new()
        .decode(&mut DecoderBuffer::new(bytes), &mut decoded)
        .map_err(|error| error.to_string())?;
    read(&decoded, AttributeIds { position: POSITION_ID, uv: UV_ID })
}

fn read(decoded: &draco_core::Mesh, ids: AttributeIds) -> Result<Mesh, String> {
    let vertices = decoded.num_points();
    let channel = |id: usize, kind, components: u8, name: &str| -> Result<Vec<f32>, String> {
        let attribute = u32::try_from(id)
            .ok()
            .and_then(|id| decoded.attribute_by_unique_id(id))
            .filter(|a| a.attribute_type() == kind && a.num_components() == components)
            .ok_or_else(|| format!("the Draco data has no {name} attribute with id {id}"))?;
        let values = attribute.read_f32s(vertices, usize::from(components));
        if !values.iter().all(|value| value.is_finite()) {
            return Err(format!("a {name} in the Draco data is not a number"));
        }
        Ok(values)
    };
    let positions = channel(ids.position, GeometryAttributeType::Position, 3, "position")?;
    let uvs = channel(ids.uv, GeometryAttributeType::TexCoord, 2, "texture coordinate")?;
    let triangles: Vec<[u32; 3]> =
        decoded.faces().iter().map(|face| face.map(|PointIndex(index)| index)).collect();
    if triangles.iter().flatten().any(|&index| index as usize >= vertices) {
        return Err("a triangle in the Draco data uses a vertex that does not exist".to_owned());
    }
    Ok(Mesh {
        positions_m: positions.as_chunks::<3>().0.to_vec(),
        uvs: uvs.as_chunks::<2>().0.to_vec(),
        triangles,
    })
}

#[cfg(test)]
mod tests {
    use std::{f32::consts::TAU, time::Instant};

    use glam::Vec3;

    use super::*;

    /// A bumpy upright shell of 1,000 triangles, 1.8 m tall, seen in a crop of 60 × 120 pixels of a 1024-pixel atlas.
    fn body() -> Mesh {
        let (rows, columns) = (26, 20);
        let mut mesh = Mesh::default();
        for row in 0..rows {
            for column in 0..=columns {
                let (v, u) = (row as f32 / (rows - 1) as f32, column as f32 / columns as f32);
                let bump = 1.0
                    + 0.08 * (7.3 * v * TAU).sin() * (3.1 * u * TAU).cos()
                    + 0.02 * (91.0 * u + 57.0 * v).sin();
                let radius = bump * (0.12 + 0.12 * (v * TAU / 2.0).sin());
                mesh.positions_m.push([radius * (u * TAU).cos(), 1.8 * v, radius * (u * TAU).sin()]);
                mesh.uvs.push([0.3 + u * 60.0 / 1024.0, 0.6 + (1.0 - v) * 120.0 / 1024.0]);
                if row > 0 && column > 0 {
                    let here = row * (columns + 1) + column;
                    let below = here - columns - 1;
                    mesh.triangles.push([below - 1, below, here]);
                    mesh.triangles.push([below - 1, here, here - 1]);
                }
            }
        }
        mesh
    }

    /// Largest distance from a vertex to the same vertex after the codec, metres and pixels of the atlas.
    fn error(before: &Mesh, after: &Mesh) -> (f32, f32) {
        let mut worst = (0.0f32, 0.0f32);
        for (position, uv) in before.positions_m.iter().zip(&before.uvs) {
            let (metres, pixels) = after
                .positions_m
                .iter()
                .zip(&after.uvs)
                .map(|(p, q)| {
                    let metres = Vec3::from_array(*p).distance(Vec3::from_array(*position));
                    (metres, 1024.0 * (q[0] - uv[0]).abs().max((q[1] - uv[1]).abs()))
                })
                .min_by(|a, b| (a.0 + a.1).total_cmp(&(b.0 + b.1)))
                .unwrap();
            worst = (worst.0.max(metres), worst.1.max(pixels));
        }
        worst
    }

    #[test]
    fn the_codec_moves_a_body_by_less_than_a_millimetre_and_a_tenth_of_a_pixel() {
        let body = body();
        println!("{} vertices, {} triangles", body.positions_m.len(), body.triangles.len());
        for (position_bits, uv_bits, speed) in
            [(11, 10, 3), (11, 10, SPEED), (11, 10, 5), (11, 10, 7), (10, 10, SPEED), (12, 12, SPEED)]
        {
            let start = Instant::now();
            let bytes = encode_at(&body, Quantisation { position_bits, uv_bits }, speed).unwrap();
            let encoded = start.elapsed();
            let start = Instant::now();
            let back = decode_own(&bytes).unwrap();
            let decoded = start.elapsed();
            let (metres, pixels) = error(&body, &back);
            println!(
                "{position_bits}/{uv_bits} bits, speed {speed}: {} bytes, {:.2} mm, {pixels:.3} px, encode {encoded:?}, decode {decoded:?}",
                bytes.len(),
                1000.0 * metres
            );
            if (position_bits, uv_bits, speed) == (11, 10, SPEED) {
                assert!(metres < 0.001 && pixels < 0.1, "{metres} m, {pixels} px");
                assert!(bytes.len() < 6_000, "{} bytes", bytes.len());
            }
        }
    }
}
