//! What is drawn into: a multisampled picture and depth, resolved into a texture that can be shown or read back.

use wgpu::{
    Color, Device, Extent3d, Texture, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages,
    TextureView, TextureViewDescriptor, TextureViewDimension,
};

use super::{COLOUR_FORMAT, DEPTH_FORMAT, SAMPLES};

/// The same bytes without the sRGB conversion: what egui wants to sample.
pub const ENCODED_FORMAT: TextureFormat = TextureFormat::Rgba8Unorm;

/// What the pictures of a renderer have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureFormat {
    /// Of the finished picture; an sRGB format, as the shaders work in linear light.
    pub colour: TextureFormat,
    /// Samples per pixel: 1 or 4.
    pub samples: u32,
    /// Views drawn in one pass: 1, or 2 on a device with `MULTIVIEW`, each on its own layer of the picture.
    pub views: u32,
    /// What is seen where there is no stage.
    pub surroundings: Surroundings,
}

impl Default for PictureFormat {
    fn default() -> Self {
        Self { colour: COLOUR_FORMAT, samples: SAMPLES, views: 1, surroundings: Surroundings::Backdrop }
    }
}

/// What is seen where there is no stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surroundings {
    /// A quiet dark room.
    Backdrop,
    /// The same darkness everywhere, for a headset that hides the room.
    Dark,
    /// Nothing: the picture is transparent there. Colours are premultiplied by alpha.
    Transparent,
}

impl Surroundings {
    /// What an empty picture is cleared to, linear light. The backdrop is drawn, not cleared.
    pub(super) fn empty(self) -> Color {
        match self {
            Self::Backdrop => Color::BLACK,
            // The corners of the backdrop.
            Self::Dark => Color { r: 0.022, g: 0.024, b: 0.029, a: 1.0 },
            Self::Transparent => Color::TRANSPARENT,
        }
    }
}

/// The attachments of a pass: everything a renderer needs to draw a picture, whoever owns the picture.
pub struct Canvas {
    pub(super) colour: TextureView,
    /// Where the samples are averaged to; `None` with one sample per pixel.
    pub(super) resolved: Option<TextureView>,
    pub(super) depth: TextureView,
}

impl Canvas {
    /// For drawing into layers `first_layer..first_layer + format.views` of a picture that somebody else made (a swapchain
    /// image). Samples and depth are shared with `like` when there is one: pictures drawn in turn need only one of each.
    #[must_use]
    pub fn of_layers(
        device: &Device,
        picture: &Texture,
        first_layer: u32,
        format: PictureFormat,
        like: Option<&Self>,
    ) -> Self {
        let view = TextureViewDescriptor {
            dimension: Some(dimension(format.views)),
            base_array_layer: first_layer,
            array_layer_count: Some(format.views),
            usage: Some(TextureUsages::RENDER_ATTACHMENT),
            ..Default::default()
        };
        let finished = picture.create_view(&view);
        let size = Extent3d { depth_or_array_layers: format.views, ..picture.size() };
        let attachment = |label, texture_format| {
            let texture = device.create_texture(&TextureDescriptor {
                label: Some(label),
                size,
                mip_level_count: 1,
                sample_count: format.samples,
                dimension: TextureDimension::D2,
                format: texture_format,
                usage: TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            texture.create_view(&TextureViewDescriptor {
                dimension: Some(dimension(format.views)),
                ..Default::default()
            })
        };
        let depth = like.map_or_else(|| attachment("depth", DEPTH_FORMAT), |like| like.depth.clone());
        if format.samples == 1 {
            return Self { colour: finished, resolved: None, depth };
        }
        let samples = like.map_or_else(|| attachment("samples", format.colour), |like| like.colour.clone());
        Self { colour: samples, resolved: Some(finished), depth }
    }
}

fn dimension(views: u32) -> TextureViewDimension {
    if views > 1 { TextureViewDimension::D2Array } else { TextureViewDimension::D2 }
}

/// A picture of a fixed size with its canvas.
pub struct Target {
    /// The finished picture: sRGB bytes.
    pub texture: Texture,
    /// The picture as sRGB-encoded values, for a user interface that blends them as they are.
    pub encoded_view: TextureView,
    pub(super) canvas: Canvas,
}

impl Target {
    /// A target of the given size, at least 1 × 1 px and at most what the device allows, for a renderer made by
    /// [`Renderer::new`](super::Renderer::new).
    #[must_use]
    pub fn new(device: &Device, width_px: u32, height_px: u32) -> Self {
        let most = device.limits().max_texture_dimension_2d;
        let attachment = TextureUsages::RENDER_ATTACHMENT;
        let texture = device.create_texture(&TextureDescriptor {
            label: Some("picture"),
            size: Extent3d {
                width: width_px.clamp(1, most),
                height: height_px.clamp(1, most),
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format: COLOUR_FORMAT,
            usage: attachment | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC,
            view_formats: &[ENCODED_FORMAT],
        });
        Self {
            encoded_view: texture.create_view(&TextureViewDescriptor {
                label: Some("encoded"),
                format: Some(ENCODED_FORMAT),
                usage: Some(TextureUsages::TEXTURE_BINDING),
                ..Default::default()
            }),
            canvas: Canvas::of_layers(device, &texture, 0, PictureFormat::default(), None),
            texture,
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
