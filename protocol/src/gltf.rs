//! The part of the glTF 2.0 document that Holopitch writes and reads, as plain data.
//!
//! Names and meaning are glTF's own (<https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html>); indices point into
//! the document's lists. Unknown fields are ignored on reading.

use serde::{Deserialize, Serialize};

/// Draco geometry in place of plain vertex data.
pub const DRACO: &str = "KHR_draco_mesh_compression";
/// Surfaces that show their texture as it is: the light of the stadium is already in it.
pub const UNLIT: &str = "KHR_materials_unlit";

/// A whole document, for writing.
#[derive(Clone, Debug, Default, Serialize)]
#[serde(rename_all = "camelCase")]
#[allow(missing_docs)] // glTF's own names
pub struct Document {
    pub asset: Asset,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub extensions_used: Vec<&'static str>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub extensions_required: Vec<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extensions: Option<serde_json::Value>,
    pub scene: usize,
    pub scenes: Vec<Scene>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub nodes: Vec<Node>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub meshes: Vec<Mesh>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub materials: Vec<Material>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub textures: Vec<Texture>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub samplers: Vec<Sampler>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub images: Vec<Image>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub animations: Vec<Animation>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub accessors: Vec<Accessor>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub buffer_views: Vec<BufferView>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub buffers: Vec<Buffer>,
}

/// Who wrote the file, and in which glTF version.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)]
pub struct Asset {
    pub version: &'static str,
    pub generator: String,
}

impl Default for Asset {
    fn default() -> Self {
        Self { version: "2.0", generator: format!("Holopitch {}", env!("CARGO_PKG_VERSION")) }
    }
}

/// Nodes to show.
#[derive(Clone, Debug, Default, Serialize)]
#[allow(missing_docs)]
pub struct Scene {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub nodes: Vec<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extras: Option<serde_json::Value>,
}

/// A thing with a place.
#[derive(Clone, Debug, Default, Serialize)]
#[allow(missing_docs)]
pub struct Node {
    pub name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<usize>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub children: Vec<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub translation: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<[f32; 3]>,
}

/// Geometry.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Mesh {
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    pub primitives: Vec<Primitive>,
}

/// One draw of a mesh; always triangles.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Primitive {
    pub attributes: Attributes,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub indices: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extensions: Option<PrimitiveExtensions>,
}

/// Accessors (in a primitive) or Draco attribute ids (in its extension).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Attributes {
    #[serde(rename = "POSITION")]
    pub position: usize,
    #[serde(rename = "NORMAL", skip_serializing_if = "Option::is_none")]
    pub normal: Option<usize>,
    #[serde(rename = "TEXCOORD_0", skip_serializing_if = "Option::is_none")]
    pub uv: Option<usize>,
}

/// Extensions of a primitive.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct PrimitiveExtensions {
    #[serde(rename = "KHR_draco_mesh_compression", skip_serializing_if = "Option::is_none")]
    pub draco: Option<DracoExtension>,
}

/// Where the Draco data of a primitive is.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
#[allow(missing_docs)]
pub struct DracoExtension {
    pub buffer_view: usize,
    pub attributes: Attributes,
}

/// How a surface looks.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
#[allow(missing_docs)]
pub struct Material {
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    pub pbr_metallic_roughness: Pbr,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extensions: Option<serde_json::Value>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub double_sided: bool,
}

impl Material {
    /// A material that shows its colour or texture as it is, whatever the light.
    #[must_use]
    pub fn unlit(name: String, colour: Option<[f32; 4]>, texture: Option<usize>) -> Self {
        Self {
            name,
            pbr_metallic_roughness: Pbr {
                base_color_factor: colour,
                base_color_texture: texture.map(|index| TextureInfo { index }),
                metallic_factor: 0.0,
                roughness_factor: 1.0,
            },
            extensions: Some(serde_json::json!({ UNLIT: {} })),
            double_sided: false,
        }
    }
}

/// The base colour; the rest is for viewers without [`UNLIT`].
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
#[allow(missing_docs)]
pub struct Pbr {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_color_factor: Option<[f32; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_color_texture: Option<TextureInfo>,
    pub metallic_factor: f32,
    pub roughness_factor: f32,
}

/// A reference to a texture.
#[derive(Clone, Copy, Debug, Serialize)]
#[allow(missing_docs)]
pub struct TextureInfo {
    pub index: usize,
}

/// An image and how it is sampled.
#[derive(Clone, Copy, Debug, Serialize)]
#[allow(missing_docs)]
pub struct Texture {
    pub sampler: usize,
    pub source: usize,
}

/// Filtering and wrapping, as OpenGL constants.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
#[allow(missing_docs)]
pub struct Sampler {
    pub mag_filter: u32,
    pub min_filter: u32,
    pub wrap_s: u32,
    pub wrap_t: u32,
}

impl Sampler {
    /// Linear, clamped, without smaller copies: those would let neighbours in an atlas run into each other.
    pub const ATLAS: Self = Self { mag_filter: 9729, min_filter: 9729, wrap_s: 33_071, wrap_t: 33_071 };
}

/// A picture inside the file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
#[allow(missing_docs)]
pub struct Image {
    pub buffer_view: usize,
    pub mime_type: String,
}

/// Motion: samplers of values over time and the node properties they drive.
#[derive(Clone, Debug, Default, Serialize)]
#[allow(missing_docs)]
pub struct Animation {
    pub name: String,
    pub channels: Vec<Channel>,
    pub samplers: Vec<AnimationSampler>,
}

/// One driven property.
#[derive(Clone, Copy, Debug, Serialize)]
#[allow(missing_docs)]
pub struct Channel {
    pub sampler: usize,
    pub target: Target,
}

/// The property that a channel drives.
#[derive(Clone, Copy, Debug, Serialize)]
#[allow(missing_docs)]
pub struct Target {
    pub node: usize,
    pub path: TargetPath,
}

/// Properties that Holopitch animates.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum TargetPath {
    Translation,
    Scale,
}

/// Values over time: accessors of seconds and of values.
#[derive(Clone, Copy, Debug, Serialize)]
#[allow(missing_docs)]
pub struct AnimationSampler {
    pub input: usize,
    pub output: usize,
    pub interpolation: Interpolation,
}

/// Between two keys.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "UPPERCASE")]
#[allow(missing_docs)]
pub enum Interpolation {
    Step,
}

/// A typed list of values.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
#[allow(missing_docs)]
pub struct Accessor {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub buffer_view: Option<usize>,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub byte_offset: usize,
    pub component_type: u32,
    pub count: usize,
    #[serde(rename = "type")]
    pub kind: String,
    #[serde(skip_deserializing, skip_serializing_if = "Vec::is_empty")]
    pub min: Vec<f32>,
    #[serde(skip_deserializing, skip_serializing_if = "Vec::is_empty")]
    pub max: Vec<f32>,
}

/// Component types of accessors.
#[allow(missing_docs)]
pub mod component {
    pub const U16: u32 = 5123;
    pub const U32: u32 = 5125;
    pub const F32: u32 = 5126;
}

/// A stretch of a buffer.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
#[allow(missing_docs)]
pub struct BufferView {
    pub buffer: usize,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub byte_offset: usize,
    pub byte_length: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<u32>,
}

/// The binary chunk of the file.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
#[allow(missing_docs)]
pub struct Buffer {
    pub byte_length: usize,
}

impl BufferView {
    /// Its bytes in the binary chunk `bin`; `None` when it leaves it.
    #[must_use]
    pub fn of<'a>(&self, bin: &'a [u8]) -> Option<&'a [u8]> {
        let end = self.byte_offset.checked_add(self.byte_length)?;
        bin.get(self.byte_offset..end).filter(|_| self.buffer == 0)
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
fn is_zero(value: &usize) -> bool {
    *value == 0
}

/// A document under construction together with its binary buffer.
#[derive(Clone, Debug, Default)]
pub struct Builder {
    /// The document so far; `buffers` is filled in by [`Builder::finish`].
    pub document: Document,
    bin: Vec<u8>,
}

impl Builder {
    /// Appends `bytes` as a buffer view on a four-byte boundary and returns its index.
    pub fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = BufferView { buffer: 0, byte_offset: self.bin.len(), byte_length: bytes.len(), target };
        self.bin.extend_from_slice(bytes);
        self.document.buffer_views.push(view);
        self.document.buffer_views.len() - 1
    }

    /// Appends an accessor and returns its index.
    pub fn accessor(&mut self, accessor: Accessor) -> usize {
        self.document.accessors.push(accessor);
        self.document.accessors.len() - 1
    }

    /// The finished GLB file.
    ///
    /// # Errors
    /// When the file would pass 4 GiB or the document has no form in JSON.
    pub fn finish(mut self) -> Result<Vec<u8>, crate::glb::GlbError> {
        if !self.bin.is_empty() {
            self.document.buffers.push(Buffer { byte_length: self.bin.len() });
        }
        let json = serde_json::to_vec(&self.document)
            .map_err(|error| crate::glb::GlbError::Json { message: error.to_string() })?;
        crate::glb::Glb { json: &json, bin: &self.bin }.write()
    }
}
