//! What both eyes are drawn into: the runtime's swapchain, its images as canvases, and the renderer for their format.
//!
//! With multiview one pass draws both layers of an image; without it each layer has its own pass and submission.

use image::RgbaImage;
use openxr::{
    CompositionLayerProjectionView, Extent2Di, Offset2Di, Rect2Di, Session, Swapchain, SwapchainCreateFlags,
    SwapchainCreateInfo, SwapchainSubImage, SwapchainUsageFlags, Vulkan,
};
use wgpu::{CommandEncoderDescriptor, Texture, TextureFormat, TextureTransition, TextureUses};

use super::{XrError, ffi::graphics::Graphics, table::Table};
use crate::{
    camera::EyeView,
    offscreen::read_layer,
    renderer::{Canvas, InRoom, PictureFormat, RoomScene, Sight, Surroundings},
    scene::{FrameScene, Stage},
};

/// Swapchain formats that the renderer can draw, the best first, with Vulkan's numbers for them.
const FORMATS: [(TextureFormat, ash::vk::Format); 2] = [
    (TextureFormat::Rgba8UnormSrgb, ash::vk::Format::R8G8B8A8_SRGB),
    (TextureFormat::Bgra8UnormSrgb, ash::vk::Format::B8G8R8A8_SRGB),
];

/// How long an image is waited for before the session counts as lost, nanoseconds.
pub(super) const IMAGE_TIMEOUT_NS: i64 = 5_000_000_000;

/// How a swapchain's pictures look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Picture {
    pub(super) size_px: (u32, u32),
    pub(super) layers: u32,
    pub(super) format: TextureFormat,
}

/// A swapchain with its images as textures. Fields are dropped in this order: textures before the swapchain.
pub(super) struct Images {
    pub(super) textures: Vec<Texture>,
    pub(super) swapchain: Swapchain<Vulkan>,
    pub(super) picture: Picture,
}

impl Images {
    pub(super) fn new(
        graphics: &Graphics,
        session: &Session<Vulkan>,
        size_px: (u32, u32),
        layers: u32,
    ) -> Result<Self, XrError> {
        let offered = session.enumerate_swapchain_formats()?;
        let (format, raw) = FORMATS
            .into_iter()
            .find(|(_, raw)| offered.iter().any(|offered| i64::from(*offered) == i64::from(raw.as_raw())))
            .ok_or_else(|| XrError::Graphics("the runtime offers no 8-bit sRGB pictures".to_owned()))?;
        let swapchain = session.create_swapchain(&SwapchainCreateInfo {
            create_flags: SwapchainCreateFlags::EMPTY,
            usage_flags: SwapchainUsageFlags::COLOR_ATTACHMENT
                | SwapchainUsageFlags::SAMPLED
                | SwapchainUsageFlags::TRANSFER_SRC,
            format: raw.as_raw() as _,
            sample_count: 1,
            width: size_px.0,
            height: size_px.1,
            face_count: 1,
            array_size: layers,
            mip_count: 1,
        })?;
        let images = swapchain.enumerate_images()?;
        let textures = images.into_iter().map(|image| graphics.wrap_image(image, size_px, layers, format));
        let textures = textures.collect::<Result<_, _>>()?;
        Ok(Self { textures, swapchain, picture: Picture { size_px, layers, format } })
    }

    /// The part of the swapchain that a layer of it shows.
    pub(super) fn layer(&self, layer: u32) -> SwapchainSubImage<'_, Vulkan> {
        let (width, height) = self.picture.size_px;
        SwapchainSubImage::new().swapchain(&self.swapchain).image_array_index(layer).image_rect(Rect2Di {
            offset: Offset2Di { x: 0, y: 0 },
            extent: Extent2Di { width: width as i32, height: height as i32 },
        })
    }
}

/// Both eyes' pictures and the renderer that draws them.
pub(super) struct Eyes {
    /// Per image of the swapchain: one canvas of two layers, or two of one.
    canvases: Vec<Vec<Canvas>>,
    in_room: InRoom,
    /// The table's revision of the surfaces that are known to the renderer.
    room: Option<u32>,
    pub(super) images: Images,
    pub(super) format: PictureFormat,
}

impl Eyes {
    pub(super) fn new(
        graphics: &Graphics,
        session: &Session<Vulkan>,
        stage: &Stage,
        size_px: (u32, u32),
        samples: u32,
        (surroundings, sight): (Surroundings, Sight),
    ) -> Result<Self, XrError> {
        let images = Images::new(graphics, session, size_px, 2)?;
        let views = graphics.views_per_pass(samples);
        if views == 1 {
            tracing::warn!("{} has no multiview: each eye is drawn in a pass of its own", graphics.adapter);
        }
        let format = PictureFormat { colour: images.picture.format, samples, views, surroundings };
        let mut canvases: Vec<Vec<Canvas>> = Vec::new();
        for texture in &images.textures {
            let like = canvases.first().and_then(|canvases| canvases.first());
            let of_layer = |layer| Canvas::of_layers(&graphics.device, texture, layer, format, like);
            let of_image = (0..2).step_by(views as usize).map(of_layer).collect();
            canvases.push(of_image);
        }
        let in_room = InRoom::new(&graphics.device, &graphics.queue, stage, format, sight);
        Ok(Self { canvases, in_room, room: None, images, format })
    }

    /// Puts another frame of the match on the stage.
    pub(super) fn upload(&mut self, graphics: &Graphics, frame: &FrameScene) {
        self.in_room.upload(&graphics.device, &graphics.queue, frame);
    }

    /// Draws both eyes into an image of the swapchain.
    pub(super) fn draw(
        &mut self,
        graphics: &Graphics,
        image: usize,
        table: &Table,
        scene: &RoomScene<'_>,
        eyes: &[EyeView; 2],
    ) -> Result<(), XrError> {
        let (device, queue) = (&graphics.device, &graphics.queue);
        if self.room != Some(table.revision()) {
            self.in_room.know(device, queue, table.surfaces());
            self.room = Some(table.revision());
        }
        self.in_room.prepare(device, queue, scene);
        let canvases = self.canvases.get(image).ok_or_else(no_such_image)?;
        for (canvas, eyes) in canvases.iter().zip(eyes.chunks(self.format.views as usize)) {
            let mut encoder = graphics.device.create_command_encoder(&CommandEncoderDescriptor::default());
            self.in_room.draw(&graphics.queue, &mut encoder, canvas, eyes);
            graphics.queue.submit([encoder.finish()]);
        }
        Ok(())
    }

    /// The pixels of both eyes of an image that was drawn; waits for the GPU.
    pub(super) fn read_back(&self, graphics: &Graphics, image: usize) -> Result<[RgbaImage; 2], XrError> {
        let texture = self.images.textures.get(image).ok_or_else(no_such_image)?;
        let pictures = [0, 1].map(|layer| read_layer(&graphics.device, &graphics.queue, texture, layer));
        // The runtime wants its image back as a colour attachment.
        let mut encoder = graphics.device.create_command_encoder(&CommandEncoderDescriptor::default());
        let back = TextureTransition { texture, selector: None, state: TextureUses::COLOR_TARGET };
        encoder.transition_resources(std::iter::empty(), std::iter::once(back));
        graphics.queue.submit([encoder.finish()]);
        let [left, right] = pictures;
        let swap = self.format.colour == TextureFormat::Bgra8UnormSrgb;
        Ok([in_rgb_order(left?, swap), in_rgb_order(right?, swap)])
    }

    /// Both eyes as the runtime's compositor wants them.
    pub(super) fn layers<'a>(
        &'a self,
        views: &[openxr::View; 2],
    ) -> [CompositionLayerProjectionView<'a, Vulkan>; 2] {
        [0, 1].map(|eye| {
            CompositionLayerProjectionView::new()
                .pose(views[eye].pose)
                .fov(views[eye].fov)
                .sub_image(self.images.layer(eye as u32))
        })
    }
}

fn no_such_image() -> XrError {
    XrError::Graphics("the runtime hands out a swapchain image that it did not list".to_owned())
}

fn in_rgb_order(mut picture: RgbaImage, swapped: bool) -> RgbaImage {
    if swapped {
        picture.pixels_mut().for_each(|pixel| pixel.0.swap(0, 2));
    }
    picture
}
