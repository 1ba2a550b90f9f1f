//! The picture of the room on the GPU, and the pass that lays the match over it.

use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use wgpu::{
    BindGroupDescriptor, BindGroupEntry, BindGroupLayout, BindGroupLayoutDescriptor, BindGroupLayoutEntry,
    BindingResource, BindingType, Buffer, BufferBindingType, BufferDescriptor, BufferUsages, Color,
    ColorTargetState, ColorWrites, CommandEncoder, Device, Extent3d, FragmentState, LoadOp, MultisampleState,
    Operations, PipelineLayoutDescriptor, PrimitiveState, Queue, RenderPassColorAttachment,
    RenderPassDescriptor, RenderPipeline, RenderPipelineDescriptor, Sampler, SamplerBindingType,
    ShaderModuleDescriptor, ShaderSource, ShaderStages, StoreOp, TexelCopyBufferLayout, TextureDescriptor,
    TextureDimension, TextureFormat, TextureSampleType, TextureUsages, TextureView, TextureViewDimension,
    VertexState,
};

use super::{
    super::{COLOUR_FORMAT, linear_sampler},
    layer::Layer,
};
use crate::ar::{NEAR_M, RoomCamera, RoomPicture};

/// What a structured-light sensor may be wrong by before the match is taken to be hidden: a part that does not depend
/// on distance (calibration, the edge of a patch) and the random error of 1.4 mm at 1 m, growing with its square
/// (Khoshelham and Elberink 2012), twice.
const SLACK_M: f32 = 0.008;
const SLACK_PER_M2: f32 = 0.003;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct CompositeUniform {
    light: [f32; 4],
    picture_px: [f32; 2],
    target_px: [f32; 2],
    near_m: f32,
    slack_m: f32,
    slack_per_m2: f32,
    padding: f32,
}

/// Colour and depth of a room.
struct Room {
    camera: RoomCamera,
    colour: TextureView,
    depth: TextureView,
}

pub(super) struct Composite {
    uniform: Buffer,
    layout: BindGroupLayout,
    pipeline: RenderPipeline,
    sampler: Sampler,
    room: Option<Room>,
}

impl Composite {
    pub(super) fn new(device: &Device) -> Self {
        let layout = layout(device);
        Self {
            uniform: device.create_buffer(&BufferDescriptor {
                label: Some("composite"),
                size: size_of::<CompositeUniform>() as u64,
                usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            pipeline: pipeline(device, &layout),
            layout,
            sampler: linear_sampler(device, "room"),
            room: None,
        }
    }

    /// The camera of the picture that is shown.
    pub(super) fn camera(&self) -> Option<RoomCamera> {
        self.room.as_ref().map(|room| room.camera)
    }

    pub(super) fn upload(&mut self, device: &Device, queue: &Queue, room: &RoomPicture) {
        let (width, height) = room.colour.dimensions();
        let most = device.limits().max_texture_dimension_2d;
        if width == 0 || height == 0 || width.max(height) > most {
            tracing::warn!("a picture of {width} × {height} px is more than this GPU takes ({most} px)");
            self.room = None;
            return;
        }
        let texture = |label, format: TextureFormat, bytes: &[u8]| {
            let size = Extent3d { width, height, depth_or_array_layers: 1 };
            let texture = device.create_texture(&TextureDescriptor {
                label: Some(label),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format,
                usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
                view_formats: &[],
            });
            // Four bytes a pixel, both of them.
            let rows =
                TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * width), rows_per_image: None };
            queue.write_texture(texture.as_image_copy(), bytes, rows, size);
            texture.create_view(&Default::default())
        };
        self.room = Some(Room {
            camera: room.camera,
            colour: texture("room", TextureFormat::Rgba8UnormSrgb, &room.colour),
            depth: texture("room depth", TextureFormat::R32Float, bytemuck::cast_slice(&room.depth_m)),
        });
    }

    /// Lays the layer over the room; `light` tints it, its fourth value is its opacity.
    pub(super) fn draw(
        &self,
        device: &Device,
        queue: &Queue,
        encoder: &mut CommandEncoder,
        layer: &Layer,
        finished: &TextureView,
        light: Vec4,
    ) {
        let Some(room) = &self.room else { return };
        let size = |width: u32, height: u32| [width as f32, height as f32];
        let uniform = CompositeUniform {
            light: light.into(),
            picture_px: size(room.camera.size_px[0], room.camera.size_px[1]),
            target_px: size(layer.size_px().0, layer.size_px().1),
            near_m: NEAR_M as f32,
            slack_m: SLACK_M,
            slack_per_m2: SLACK_PER_M2,
            padding: 0.0,
        };
        queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
        let view = |binding, view| BindGroupEntry { binding, resource: BindingResource::TextureView(view) };
        let bind_group = device.create_bind_group(&BindGroupDescriptor {
            label: Some("composite"),
            layout: &self.layout,
            entries: &[
                BindGroupEntry { binding: 0, resource: self.uniform.as_entire_binding() },
                view(1, &room.colour),
                BindGroupEntry { binding: 2, resource: BindingResource::Sampler(&self.sampler) },
                view(3, &room.depth),
                view(4, &layer.colour),
                view(5, &layer.depth),
            ],
        });
        let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("composite"),
            color_attachments: &[Some(RenderPassColorAttachment {
                view: finished,
                depth_slice: None,
                resolve_target: None,
                ops: Operations { load: LoadOp::Clear(Color::BLACK), store: StoreOp::Store },
            })],
            depth_stencil_attachment: None,
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        pass.draw(0..3, 0..1);
    }
}

fn layout(device: &Device) -> BindGroupLayout {
    let entry =
        |binding, ty| BindGroupLayoutEntry { binding, visibility: ShaderStages::FRAGMENT, ty, count: None };
    let texture = |binding, sample_type, multisampled| {
        entry(
            binding,
            BindingType::Texture { sample_type, view_dimension: TextureViewDimension::D2, multisampled },
        )
    };
    let float = |filterable| TextureSampleType::Float { filterable };
    device.create_bind_group_layout(&BindGroupLayoutDescriptor {
        label: Some("composite"),
        entries: &[
            entry(
                0,
                BindingType::Buffer {
                    ty: BufferBindingType::Uniform,
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
            ),
            texture(1, float(true), false),
            entry(2, BindingType::Sampler(SamplerBindingType::Filtering)),
            texture(3, float(false), false),
            texture(4, float(false), false),
            texture(5, TextureSampleType::Depth, true),
        ],
    })
}

fn pipeline(device: &Device, layout: &BindGroupLayout) -> RenderPipeline {
    let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
        label: Some("composite"),
        bind_group_layouts: &[Some(layout)],
        ..Default::default()
    });
    let module = device.create_shader_module(ShaderModuleDescriptor {
        label: Some("composite"),
        source: ShaderSource::Wgsl(include_str!("../shaders/composite.wgsl").into()),
    });
    device.create_render_pipeline(&RenderPipelineDescriptor {
        label: Some("composite"),
        layout: Some(&layout),
        vertex: VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: PrimitiveState::default(),
        depth_stencil: None,
        multisample: MultisampleState::default(),
        fragment: Some(FragmentState {
            module: &module,
            entry_point: Some("fragment"),
            compilation_options: Default::default(),
            targets: &[Some(ColorTargetState {
                format: COLOUR_FORMAT,
                blend: None,
                write_mask: ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}
