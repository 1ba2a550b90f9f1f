//! The panel's picture in a swapchain of its own: the runtime puts it into the room as a quad, sharper than drawn into the
//! eyes' pictures and at no cost to them.

use std::time::{Duration, Instant};

use egui::FullOutput;
use egui_wgpu::{Renderer, RendererOptions, ScreenDescriptor};
use openxr::{CompositionLayerFlags, CompositionLayerQuad, Extent2Df, EyeVisibility, Session, Space, Vulkan};
use wgpu::{
    Color, CommandEncoderDescriptor, LoadOp, Operations, RenderPassColorAttachment, RenderPassDescriptor,
    StoreOp, TextureViewDescriptor,
};

use super::{
    XrError,
    eyes::{IMAGE_TIMEOUT_NS, Images},
    ffi::graphics::Graphics,
    panel::{PIXELS_PER_POINT, Panel, PanelPose, SIZE_M, SIZE_PX},
    room,
};

/// The panel's swapchain and what draws into it.
pub(super) struct PanelLayer {
    renderer: Renderer,
    images: Images,
    /// Whether there is a picture to show.
    drawn: bool,
}

impl PanelLayer {
    pub(super) fn new(graphics: &Graphics, session: &Session<Vulkan>) -> Result<Self, XrError> {
        let images = Images::new(graphics, session, (SIZE_PX[0], SIZE_PX[1]), 1)?;
        let renderer = Renderer::new(&graphics.device, images.picture.format, RendererOptions::PREDICTABLE);
        Ok(Self { renderer, images, drawn: false })
    }

    /// Draws what a pass of the panel gave. Returns the time spent in the runtime's calls.
    pub(super) fn draw(
        &mut self,
        graphics: &Graphics,
        panel: &Panel,
        output: FullOutput,
    ) -> Result<Duration, XrError> {
        let FullOutput { mut textures_delta, shapes, .. } = output;
        let (device, queue) = (&graphics.device, &graphics.queue);
        for (id, deltas) in textures_delta.set.drain() {
            for delta in deltas {
                self.renderer.update_texture(device, queue, id, &delta);
            }
        }
        let jobs = panel.tessellate(shapes);
        let screen = ScreenDescriptor { size_in_pixels: SIZE_PX, pixels_per_point: PIXELS_PER_POINT };
        let began = Instant::now();
        let image = self.images.swapchain.acquire_image()? as usize;
        self.images.swapchain.wait_image(openxr::Duration::from_nanos(IMAGE_TIMEOUT_NS))?;
        let mut in_runtime = began.elapsed();
        if let Some(texture) = self.images.textures.get(image) {
            let view = texture.create_view(&TextureViewDescriptor::default());
            let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
            let mut commands = self.renderer.update_buffers(device, queue, &mut encoder, &jobs, &screen);
            {
                let pass = encoder.begin_render_pass(&RenderPassDescriptor {
                    label: Some("panel"),
                    color_attachments: &[Some(RenderPassColorAttachment {
                        view: &view,
                        depth_slice: None,
                        resolve_target: None,
                        ops: Operations { load: LoadOp::Clear(Color::TRANSPARENT), store: StoreOp::Store },
                    })],
                    ..Default::default()
                });
                self.renderer.render(&mut pass.forget_lifetime(), &jobs, &screen);
            }
            commands.push(encoder.finish());
            queue.submit(commands);
        }
        let began = Instant::now();
        self.images.swapchain.release_image()?;
        in_runtime += began.elapsed();
        for id in textures_delta.free.drain() {
            self.renderer.free_texture(&id);
        }
        self.drawn = true;
        Ok(in_runtime)
    }

    /// The quad for the runtime; `None` before there is a picture.
    pub(super) fn layer<'a>(
        &'a self,
        space: &'a Space,
        pose: &PanelPose,
    ) -> Option<CompositionLayerQuad<'a, Vulkan>> {
        let [width, height] = SIZE_M.map(|side| side as f32);
        self.drawn.then(|| {
            CompositionLayerQuad::new()
                .layer_flags(CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA)
                .space(space)
                .eye_visibility(EyeVisibility::BOTH)
                .sub_image(self.images.layer(0))
                .pose(room::pose(pose.position_m, pose.orientation))
                .size(Extent2Df { width, height })
        })
    }
}
