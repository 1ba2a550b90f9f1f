//! The match by itself: colour premultiplied by coverage, and the depth of every sample, for the composite to read.

use wgpu::{
    Color, CommandEncoder, Device, Extent3d, LoadOp, Operations, RenderPass, RenderPassColorAttachment,
    RenderPassDepthStencilAttachment, RenderPassDescriptor, StoreOp, Texture, TextureDescriptor,
    TextureDimension, TextureFormat, TextureUsages, TextureView,
};

use super::super::{COLOUR_FORMAT, DEPTH_FORMAT, SAMPLES};

/// Textures of one size.
pub(super) struct Layer {
    picture: Texture,
    samples: TextureView,
    pub(super) colour: TextureView,
    pub(super) depth: TextureView,
}

impl Layer {
    pub(super) fn new(device: &Device, (width, height): (u32, u32)) -> Self {
        let texture = |label, format: TextureFormat, sample_count, usage| {
            device.create_texture(&TextureDescriptor {
                label: Some(label),
                size: Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count,
                dimension: TextureDimension::D2,
                format,
                usage: TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let read = TextureUsages::TEXTURE_BINDING;
        let picture = texture("match", COLOUR_FORMAT, 1, read);
        let whole = |texture: &Texture| texture.create_view(&Default::default());
        Self {
            samples: whole(&texture("match samples", COLOUR_FORMAT, SAMPLES, TextureUsages::empty())),
            colour: whole(&picture),
            depth: whole(&texture("match depth", DEPTH_FORMAT, SAMPLES, read)),
            picture,
        }
    }

    pub(super) fn size_px(&self) -> (u32, u32) {
        (self.picture.width(), self.picture.height())
    }

    /// A pass into an empty layer.
    pub(super) fn begin<'a>(&self, encoder: &'a mut CommandEncoder) -> RenderPass<'a> {
        encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("match"),
            color_attachments: &[Some(RenderPassColorAttachment {
                view: &self.samples,
                depth_slice: None,
                resolve_target: Some(&self.colour),
                ops: Operations { load: LoadOp::Clear(Color::TRANSPARENT), store: StoreOp::Discard },
            })],
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(Operations { load: LoadOp::Clear(0.0), store: StoreOp::Store }),
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        })
    }
}
