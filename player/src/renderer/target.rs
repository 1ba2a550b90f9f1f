//! What is drawn into: a multisampled picture and depth, resolved into a texture that can be shown or read back.

use wgpu::{
    Device, Extent3d, Texture, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages,
    TextureView, TextureViewDescriptor,
};

use super::{COLOUR_FORMAT, DEPTH_FORMAT, SAMPLES};

/// The same bytes without the sRGB conversion: what egui wants to sample.
pub const ENCODED_FORMAT: TextureFormat = TextureFormat::Rgba8Unorm;

/// A picture of a fixed size.
pub struct Target {
    /// The finished picture: sRGB bytes.
    pub texture: Texture,
    /// The picture as sRGB-encoded values, for a user interface that blends them as they are.
    pub encoded_view: TextureView,
    pub(super) resolved: TextureView,
    pub(super) samples: TextureView,
    pub(super) depth: TextureView,
}

impl Target {
    /// A target of the given size, at least 1 × 1 px and at most what the device allows.
    #[must_use]
    pub fn new(device: &Device, width_px: u32, height_px: u32) -> Self {
        let most = device.limits().max_texture_dimension_2d;
        let size = Extent3d {
            width: width_px.clamp(1, most),
            height: height_px.clamp(1, most),
            depth_or_array_layers: 1,
        };
        let texture = |label, format, sample_count, usage, view_formats| {
            device.create_texture(&TextureDescriptor {
                label: Some(label),
                size,
                mip_level_count: 1,
                sample_count,
                dimension: TextureDimension::D2,
                format,
                usage,
                view_formats,
            })
        };
        let attachment = TextureUsages::RENDER_ATTACHMENT;
        let shown = attachment | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC;
        let picture = texture("picture", COLOUR_FORMAT, 1, shown, &[ENCODED_FORMAT]);
        let samples = texture("samples", COLOUR_FORMAT, SAMPLES, attachment, &[]);
        let depth = texture("depth", DEPTH_FORMAT, SAMPLES, attachment, &[]);
        Self {
            encoded_view: picture.create_view(&TextureViewDescriptor {
                label: Some("encoded"),
                format: Some(ENCODED_FORMAT),
                usage: Some(TextureUsages::TEXTURE_BINDING),
                ..Default::default()
            }),
            resolved: picture
                .create_view(&TextureViewDescriptor { usage: Some(attachment), ..Default::default() }),
            samples: samples.create_view(&TextureViewDescriptor::default()),
            depth: depth.create_view(&TextureViewDescriptor::default()),
            texture: picture,
        }
    }

    /// Width and height, pixels.
    #[must_use]
    pub fn size_px(&self) -> (u32, u32) {
        (self.texture.width(), self.texture.height())
    }

    /// Width over height.
    #[must_use]
    pub fn aspect(&self) -> f64 {
        f64::from(self.texture.width()) / f64::from(self.texture.height())
    }
}
