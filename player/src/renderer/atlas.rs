//! The texture of a frame's bodies on the GPU; kept while the size stays the same.

use image::RgbaImage;
use wgpu::{
    AddressMode, BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout, BindGroupLayoutDescriptor,
    BindGroupLayoutEntry, BindingResource, BindingType, Device, Extent3d, FilterMode, MipmapFilterMode,
    Origin3d, Queue, SamplerBindingType, SamplerDescriptor, ShaderStages, TexelCopyBufferLayout,
    TexelCopyTextureInfo, Texture, TextureAspect, TextureDescriptor, TextureDimension, TextureFormat,
    TextureSampleType, TextureUsages, TextureViewDescriptor, TextureViewDimension,
};

use crate::scene::Atlas;

/// A texture with the bind group that names it.
pub(super) struct AtlasTexture {
    texture: Texture,
    bind_group: BindGroup,
}

/// The layout of the bind group.
pub(super) fn layout(device: &Device) -> BindGroupLayout {
    let entry =
        |binding, ty| BindGroupLayoutEntry { binding, visibility: ShaderStages::FRAGMENT, ty, count: None };
    device.create_bind_group_layout(&BindGroupLayoutDescriptor {
        label: Some("atlas"),
        entries: &[
            entry(
                0,
                BindingType::Texture {
                    sample_type: TextureSampleType::Float { filterable: true },
                    view_dimension: TextureViewDimension::D2,
                    multisampled: false,
                },
            ),
            entry(1, BindingType::Sampler(SamplerBindingType::Filtering)),
        ],
    })
}

impl AtlasTexture {
    /// One white pixel: leaves the tint of the vertices as it is.
    pub(super) fn white(device: &Device, queue: &Queue, layout: &BindGroupLayout) -> Self {
        let white = Atlas { levels: vec![RgbaImage::from_pixel(1, 1, image::Rgba([255; 4]))] };
        let mut atlas = Self::with_size(device, layout, (1, 1), 1);
        atlas.write(queue, &white);
        atlas
    }

    /// Shows `atlas`, or white without one.
    pub(super) fn upload(
        &mut self,
        device: &Device,
        queue: &Queue,
        layout: &BindGroupLayout,
        atlas: Option<&Atlas>,
    ) {
        let most = device.limits().max_texture_dimension_2d;
        let fitting = atlas.filter(|atlas| {
            let (width, height) = atlas.size_px();
            let fits = width.max(height) <= most && width.min(height) > 0;
            if !fits {
                tracing::warn!("a texture of {width} × {height} px is more than this GPU takes ({most} px)");
            }
            fits
        });
        let Some(atlas) = fitting else {
            *self = Self::white(device, queue, layout);
            return;
        };
        let levels = atlas.levels.len() as u32;
        let held = (self.texture.width(), self.texture.height());
        if held != atlas.size_px() || self.texture.mip_level_count() != levels {
            *self = Self::with_size(device, layout, atlas.size_px(), levels);
        }
        self.write(queue, atlas);
    }

    pub(super) fn bind_group(&self) -> &BindGroup {
        &self.bind_group
    }

    fn with_size(
        device: &Device,
        layout: &BindGroupLayout,
        (width, height): (u32, u32),
        mip_level_count: u32,
    ) -> Self {
        let texture = device.create_texture(&TextureDescriptor {
            label: Some("atlas"),
            size: Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format: TextureFormat::Rgba8UnormSrgb,
            usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let sampler = device.create_sampler(&SamplerDescriptor {
            label: Some("atlas"),
            address_mode_u: AddressMode::ClampToEdge,
            address_mode_v: AddressMode::ClampToEdge,
            mag_filter: FilterMode::Linear,
            min_filter: FilterMode::Linear,
            mipmap_filter: MipmapFilterMode::Linear,
            ..Default::default()
        });
        let view = texture.create_view(&TextureViewDescriptor::default());
        let bind_group = device.create_bind_group(&BindGroupDescriptor {
            label: Some("atlas"),
            layout,
            entries: &[
                BindGroupEntry { binding: 0, resource: BindingResource::TextureView(&view) },
                BindGroupEntry { binding: 1, resource: BindingResource::Sampler(&sampler) },
            ],
        });
        Self { texture, bind_group }
    }

    fn write(&mut self, queue: &Queue, atlas: &Atlas) {
        for (level, picture) in (0..).zip(&atlas.levels) {
            queue.write_texture(
                TexelCopyTextureInfo {
                    texture: &self.texture,
                    mip_level: level,
                    origin: Origin3d::ZERO,
                    aspect: TextureAspect::All,
                },
                picture,
                TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(picture.width() * 4),
                    rows_per_image: None,
                },
                Extent3d { width: picture.width(), height: picture.height(), depth_or_array_layers: 1 },
            );
        }
    }
}
