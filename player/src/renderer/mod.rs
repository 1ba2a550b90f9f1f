//! The scene on the GPU: uploads a stage and a frame, and draws them from a camera into a target.
//!
//! No threads, files or clock. Deterministic: 4× multisampling, integer noise, no anisotropic filtering, so that a
//! software adapter gives the same picture to the bit every time.

mod atlas;
mod buffers;
mod cast;
mod in_room;
mod pipelines;
mod real_table;
mod target;
mod view;

pub use in_room::{InRoom, Marks, RoomScene, Sight, Standing};
pub use real_table::{OnTable, RealTable};
pub use target::{Canvas, PictureFormat, Surroundings, Target};
pub use view::View;

use bytemuck::{Pod, Zeroable};
use wgpu::{
    AddressMode, BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout, BindGroupLayoutDescriptor,
    BindGroupLayoutEntry, BindingType, Buffer, BufferBindingType, BufferDescriptor, BufferUsages,
    CommandEncoder, Device, FilterMode, LoadOp, Operations, PipelineLayoutDescriptor, Queue, RenderPass,
    RenderPassColorAttachment, RenderPassDepthStencilAttachment, RenderPassDescriptor, Sampler,
    SamplerDescriptor, ShaderStages, StoreOp, TextureFormat,
};

use crate::{
    camera::ViewCamera,
    scene::{FrameScene, Stage, TURF_THICKNESS_M},
};
use atlas::AtlasTexture;
use buffers::{Growing, Triangles};
use pipelines::{Pipelines, multiview_mask};
use view::{MOST_VIEWS, ViewUniform};

/// Pictures are linear light in the shaders and sRGB bytes in memory.
pub const COLOUR_FORMAT: TextureFormat = TextureFormat::Rgba8UnormSrgb;
const DEPTH_FORMAT: TextureFormat = TextureFormat::Depth32Float;
/// Samples per pixel.
pub const SAMPLES: u32 = 4;
/// Markings that fit the shader's array; a pitch has 27.
const MOST_MARKINGS: usize = 60;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct StageUniform {
    half_pitch_m: [f32; 2],
    half_turf_m: [f32; 2],
    half_table_m: [f32; 2],
    turf_corner_m: f32,
    turf_thickness_m: f32,
    marking_count: u32,
    padding: [u32; 3],
    markings: [[[f32; 4]; 2]; MOST_MARKINGS],
}

/// How surfaces that no camera saw are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Guessed {
    /// Like those that were seen.
    #[default]
    Solid,
    /// Pale and transparent.
    Ghosted,
    /// Not at all.
    Hidden,
}

impl Guessed {
    /// All of them, in the order of menus.
    pub const ALL: [Self; 3] = [Self::Solid, Self::Ghosted, Self::Hidden];

    /// The one after it, round and round.
    #[must_use]
    pub fn next(self) -> Self {
        match self {
            Self::Solid => Self::Ghosted,
            Self::Ghosted => Self::Hidden,
            Self::Hidden => Self::Solid,
        }
    }

    /// Its name in menus and commands.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Solid => "solid",
            Self::Ghosted => "ghosted",
            Self::Hidden => "hidden",
        }
    }
}

/// Everything on the GPU that a picture of the table needs.
pub struct Renderer {
    format: PictureFormat,
    pipelines: Pipelines,
    view: Buffer,
    stage: Buffer,
    scene_layout: BindGroupLayout,
    scene: BindGroup,
    atlas_layout: BindGroupLayout,
    atlas: AtlasTexture,
    ground: Triangles,
    fixtures: Triangles,
    nets: Triangles,
    bodies: Triangles,
    /// Indices of the bodies that are of what was seen; the others are guessed.
    seen_indices: u32,
    guessed: Guessed,
    ball: Triangles,
    shadows: Growing,
    shadow_count: u32,
}

impl Renderer {
    /// Builds the pipelines for pictures on a screen ([`Target`]) and uploads a stage.
    #[must_use]
    pub fn new(device: &Device, queue: &Queue, stage: &Stage) -> Self {
        Self::with_format(device, queue, stage, PictureFormat::default())
    }

    /// Builds the pipelines for pictures of another format and uploads a stage.
    #[must_use]
    pub fn with_format(device: &Device, queue: &Queue, stage: &Stage, format: PictureFormat) -> Self {
        let uniform = |label, size: usize| {
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let view = uniform("view", MOST_VIEWS * size_of::<ViewUniform>());
        let stage_sizes = uniform("stage", size_of::<StageUniform>());
        queue.write_buffer(&stage_sizes, 0, bytemuck::bytes_of(&stage_uniform(stage)));

        let uniform_entry = |binding| BindGroupLayoutEntry {
            binding,
            visibility: ShaderStages::VERTEX_FRAGMENT,
            ty: BindingType::Buffer {
                ty: BufferBindingType::Uniform,
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let scene_layout = device.create_bind_group_layout(&BindGroupLayoutDescriptor {
            label: Some("scene"),
            entries: &[uniform_entry(0), uniform_entry(1)],
        });
        let scene = device.create_bind_group(&BindGroupDescriptor {
            label: Some("scene"),
            layout: &scene_layout,
            entries: &[
                BindGroupEntry { binding: 0, resource: view.as_entire_binding() },
                BindGroupEntry { binding: 1, resource: stage_sizes.as_entire_binding() },
            ],
        });
        let atlas_layout = atlas::layout(device);
        let layout = |bind_group_layouts| {
            device.create_pipeline_layout(&PipelineLayoutDescriptor {
                label: None,
                bind_group_layouts,
                ..Default::default()
            })
        };
        let pipelines = Pipelines::new(
            device,
            format,
            &layout(&[Some(&scene_layout)]),
            &layout(&[Some(&scene_layout), Some(&atlas_layout)]),
        );

        let triangles = || Triangles::new(device);
        let (mut ground, mut fixtures, mut nets) = (triangles(), triangles(), triangles());
        ground.write(device, queue, &stage.ground.vertices, &stage.ground.indices);
        fixtures.write(device, queue, &stage.solids.vertices, &stage.solids.indices);
        nets.write(device, queue, &stage.nets.vertices, &stage.nets.indices);
        Self {
            format,
            pipelines,
            view,
            stage: stage_sizes,
            scene_layout,
            scene,
            atlas: AtlasTexture::white(device, queue, &atlas_layout),
            atlas_layout,
            ground,
            fixtures,
            nets,
            bodies: triangles(),
            seen_indices: 0,
            guessed: Guessed::default(),
            ball: triangles(),
            shadows: Growing::new(device, BufferUsages::VERTEX),
            shadow_count: 0,
        }
    }

    /// How surfaces that no camera saw are drawn from now on.
    pub fn show_guessed(&mut self, guessed: Guessed) {
        self.guessed = guessed;
    }

    /// Uploads the people and the ball of a frame; they stay until the next one.
    pub fn upload(&mut self, device: &Device, queue: &Queue, frame: &FrameScene) {
        self.bodies.write(device, queue, &frame.vertices, &frame.indices);
        self.seen_indices = frame.seen_indices as u32;
        match &frame.ball {
            Some(ball) => self.ball.write(device, queue, &ball.vertices, &ball.indices),
            None => self.ball.clear(),
        }
        self.shadows.write(device, queue, &frame.shadows);
        self.shadow_count = frame.shadows.len() as u32;
        self.atlas.upload(device, queue, &self.atlas_layout, frame.atlas.as_ref());
    }

    /// Draws what was uploaded, seen from `camera`, into `target`.
    pub fn draw(&self, queue: &Queue, encoder: &mut CommandEncoder, target: &Target, camera: &ViewCamera) {
        self.draw_views(queue, encoder, &target.canvas, &[camera.into()]);
    }

    /// Draws what was uploaded into a canvas of this renderer's format: as many views as the format has, in one pass.
    ///
    /// The views take effect when the encoder is submitted: submit before drawing other views.
    pub fn draw_views(&self, queue: &Queue, encoder: &mut CommandEncoder, canvas: &Canvas, views: &[View]) {
        let Some(uniform) = view::uniform(views) else { return };
        queue.write_buffer(&self.view, 0, bytemuck::bytes_of(&uniform));

        let backdrop = self.format.surroundings == Surroundings::Backdrop;
        let mut pass = self.begin(encoder, canvas);
        pass.set_bind_group(0, &self.scene, &[]);
        if backdrop {
            pass.set_pipeline(&self.pipelines.backdrop);
            pass.draw(0..3, 0..1);
        }
        self.draw_ground(&mut pass);
        self.draw_upright(&mut pass);
    }

    /// A pass into an empty canvas.
    fn begin<'a>(&self, encoder: &'a mut CommandEncoder, canvas: &Canvas) -> RenderPass<'a> {
        let store = if canvas.resolved.is_some() { StoreOp::Discard } else { StoreOp::Store };
        encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("table"),
            color_attachments: &[Some(RenderPassColorAttachment {
                view: &canvas.colour,
                depth_slice: None,
                resolve_target: canvas.resolved.as_ref(),
                ops: Operations { load: LoadOp::Clear(self.format.surroundings.empty()), store },
            })],
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: &canvas.depth,
                // Reversed depth: infinity is 0.
                depth_ops: Some(Operations { load: LoadOp::Clear(0.0), store: StoreOp::Discard }),
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: multiview_mask(self.format.views),
        })
    }

    /// What lies: turf, table and contact shadows. The scene's bind group must be set.
    fn draw_ground(&self, pass: &mut RenderPass<'_>) {
        pass.set_pipeline(&self.pipelines.ground);
        self.ground.draw(pass);
        if self.shadow_count > 0 {
            pass.set_pipeline(&self.pipelines.shadow);
            pass.set_vertex_buffer(0, self.shadows.buffer().slice(..));
            pass.draw(0..4, 0..self.shadow_count);
        }
    }

    /// What stands: goals, ball, people, and last the nets, which let through what is behind them.
    fn draw_upright(&self, pass: &mut RenderPass<'_>) {
        pass.set_pipeline(&self.pipelines.solid);
        self.fixtures.draw(pass);
        self.ball.draw(pass);
        pass.set_pipeline(&self.pipelines.body);
        pass.set_bind_group(1, self.atlas.bind_group(), &[]);
        let seen = self.seen_indices;
        self.bodies.draw_part(pass, 0..if self.guessed == Guessed::Solid { u32::MAX } else { seen });
        if self.guessed == Guessed::Ghosted {
            pass.set_pipeline(&self.pipelines.ghost);
            self.bodies.draw_part(pass, seen..u32::MAX);
        }
        pass.set_pipeline(&self.pipelines.net);
        self.nets.draw(pass);
    }
}

fn stage_uniform(stage: &Stage) -> StageUniform {
    let narrow = |pair: [f64; 2]| pair.map(|value| value as f32);
    let layout = &stage.layout;
    let mut markings = [[[0.0; 4]; 2]; MOST_MARKINGS];
    for (slot, marking) in markings.iter_mut().zip(&stage.markings) {
        *slot = *marking;
    }
    StageUniform {
        half_pitch_m: narrow(layout.half_pitch_m),
        half_turf_m: narrow(layout.half_turf_m),
        half_table_m: narrow(layout.half_table_m),
        turf_corner_m: layout.turf_corner_m as f32,
        turf_thickness_m: TURF_THICKNESS_M as f32,
        marking_count: stage.markings.len().min(MOST_MARKINGS) as u32,
        padding: [0; 3],
        markings,
    }
}

/// Samples a picture between its pixels; outside it the border goes on.
fn linear_sampler(device: &Device, label: &str) -> Sampler {
    device.create_sampler(&SamplerDescriptor {
        label: Some(label),
        address_mode_u: AddressMode::ClampToEdge,
        address_mode_v: AddressMode::ClampToEdge,
        mag_filter: FilterMode::Linear,
        min_filter: FilterMode::Linear,
        ..Default::default()
    })
}
