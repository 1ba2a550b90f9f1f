//! A mesh of the document whose geometry is Draco data, for both profiles.

use super::draco;
use crate::gltf::{
    Accessor, Attributes, Builder, DracoExtension, Mesh, Primitive, PrimitiveExtensions, component,
};

/// Adds a mesh whose geometry is the Draco data `bytes`, which decodes to `stored`; its accessors say what a reader will really find there.
pub(crate) fn draco_mesh(
    builder: &mut Builder,
    bytes: &[u8],
    stored: &crate::mesh::Mesh,
    material: usize,
) -> usize {
    let buffer_view = builder.view(bytes, None);
    let vertices = stored.positions_m.len();
    let accessor = |component_type, count, kind: &str| Accessor {
        buffer_view: None,
        byte_offset: 0,
        component_type,
        count,
        kind: kind.to_owned(),
        min: Vec::new(),
        max: Vec::new(),
    };
    let (min, max) = bounds(&stored.positions_m);
    let position = builder.accessor(Accessor { min, max, ..accessor(component::F32, vertices, "VEC3") });
    let uv = builder.accessor(accessor(component::F32, vertices, "VEC2"));
    // The largest 16-bit index is reserved.
    let index_type = if vertices <= usize::from(u16::MAX) { component::U16 } else { component::U32 };
    let indices = builder.accessor(accessor(index_type, stored.triangles.len() * 3, "SCALAR"));
    let extension = DracoExtension {
        buffer_view,
        attributes: Attributes { position: draco::POSITION_ID, uv: Some(draco::UV_ID), normal: None },
    };
    builder.document.meshes.push(Mesh {
        name: String::new(),
        primitives: vec![Primitive {
            attributes: Attributes { position, uv: Some(uv), normal: None },
            indices: Some(indices),
            material: Some(material),
            extensions: Some(PrimitiveExtensions { draco: Some(extension) }),
        }],
    });
    builder.document.meshes.len() - 1
}

/// Smallest and largest value of each component.
pub(super) fn bounds<const N: usize>(values: &[[f32; N]]) -> (Vec<f32>, Vec<f32>) {
    let (mut min, mut max) = ([f32::INFINITY; N], [f32::NEG_INFINITY; N]);
    for value in values {
        for axis in 0..N {
            min[axis] = min[axis].min(value[axis]);
            max[axis] = max[axis].max(value[axis]);
        }
    }
    (min.to_vec(), max.to_vec())
}
