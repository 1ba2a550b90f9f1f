//! The match on a real table: drawn transparent, shadowed on the real surface, and laid over a picture of the room.
//!
//! Three passes: the shadow that the room's light throws, the match with its depth, and the composite that hides what
//! something real stands in front of. The same samples and integer noise as elsewhere: the same picture every time.

mod composite;
mod layer;

use glam::Vec3;
use protocol::pitch::Pitch;
use wgpu::{CommandEncoder, Device, Queue, TextureViewDescriptor, vertex_attr_array};

use super::{
    PictureFormat, Renderer, Surroundings, Target,
    cast::{Cast, Catcher},
    pipelines::{Kind, Mixing, build},
    view,
};
use crate::{
    ar::{RoomLight, RoomPicture},
    placement::TabletopPose,
    scene::{FrameScene, NetVertex, Stage},
};
use composite::Composite;
use layer::Layer;

/// Where and how the match is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnTable {
    /// Where it stands in the room.
    pub pose: TabletopPose,
    /// The light of the room.
    pub light: RoomLight,
    /// 0 is not there, 1 is solid.
    pub opacity: f64,
}

/// Draws the match into pictures of a room.
pub struct RealTable {
    renderer: Renderer,
    net_depth: wgpu::RenderPipeline,
    cast: Cast,
    composite: Composite,
    layer: Option<Layer>,
}

const FORMAT: PictureFormat = PictureFormat {
    colour: super::COLOUR_FORMAT,
    samples: super::SAMPLES,
    views: 1,
    surroundings: Surroundings::Transparent,
};

impl RealTable {
    /// For matches on a pitch.
    #[must_use]
    pub fn new(device: &Device, queue: &Queue, pitch: Pitch) -> Self {
        let stage = Stage::on_real_table(pitch);
        let renderer = Renderer::with_format(device, queue, &stage, FORMAT);
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("net depth"),
            bind_group_layouts: &[Some(&renderer.scene_layout)],
            ..Default::default()
        });
        // Without depth a net in front of the wall would count as infinitely far and be hidden by it.
        let net_depth = build(
            device,
            FORMAT,
            &layout,
            &Kind {
                name: "net depth",
                shader: include_str!("../shaders/net.wgsl"),
                mixing: Mixing::DepthOnly,
                topology: wgpu::PrimitiveTopology::TriangleList,
                step_mode: wgpu::VertexStepMode::Vertex,
                stride: size_of::<NetVertex>(),
                attributes: &vertex_attr_array![0 => Float32x3, 1 => Float32x2],
            },
        );
        let cast =
            Cast::new(device, &renderer.scene_layout, stage.layout.half_turf_m, FORMAT, Catcher::Patch);
        Self { renderer, net_depth, cast, composite: Composite::new(device), layer: None }
    }

    /// Uploads the people and the ball of a frame; they stay until the next one.
    pub fn upload(&mut self, device: &Device, queue: &Queue, frame: &FrameScene) {
        self.renderer.upload(device, queue, frame);
    }

    /// Uploads a picture of the room; it stays until the next one.
    pub fn show_room(&mut self, device: &Device, queue: &Queue, room: &RoomPicture) {
        self.composite.upload(device, queue, room);
        // The layer is bound together with the picture.
        self.layer = None;
    }

    /// Draws the room and, when there is one, the match on its table. The target takes the whole picture, so it should
    /// have the picture's proportions. Nothing is drawn before [`Self::show_room`].
    ///
    /// Takes effect when the encoder is submitted: submit before drawing again.
    pub fn draw(
        &mut self,
        device: &Device,
        queue: &Queue,
        encoder: &mut CommandEncoder,
        target: &Target,
        on_table: Option<&OnTable>,
    ) {
        let Some(camera) = self.composite.camera() else { return };
        let size_px = target.size_px();
        if self.layer.as_ref().is_none_or(|layer| layer.size_px() != size_px) {
            self.layer = Some(Layer::new(device, size_px));
        }
        let Some(layer) = &self.layer else { return };
        let light = on_table.map_or(Vec3::ONE, |on_table| on_table.light.colour);
        let opacity = on_table.map_or(0.0, |on_table| on_table.opacity);
        if let Some(on_table) = on_table {
            let towards = on_table.pose.orientation.inverse() * on_table.light.towards;
            self.cast.draw(queue, encoder, &self.renderer, towards.as_vec3(), on_table.light.directed as f32);
            if let Some(uniform) = view::uniform(&[camera.of_pitch(&on_table.pose)]) {
                queue.write_buffer(&self.renderer.view, 0, bytemuck::bytes_of(&uniform));
            }
        }
        {
            let mut pass = layer.begin(encoder);
            if on_table.is_some() {
                pass.set_bind_group(0, &self.renderer.scene, &[]);
                self.cast.draw_on_table(&mut pass);
                self.renderer.draw_ground(&mut pass);
                self.cast.draw_on_turf(&mut pass);
                self.renderer.draw_upright(&mut pass);
                pass.set_pipeline(&self.net_depth);
                self.renderer.nets.draw(&mut pass);
            }
        }
        let finished = target.texture.create_view(&TextureViewDescriptor {
            usage: Some(wgpu::TextureUsages::RENDER_ATTACHMENT),
            ..Default::default()
        });
        self.composite.draw(device, queue, encoder, layer, &finished, light.extend(opacity as f32));
    }
}
