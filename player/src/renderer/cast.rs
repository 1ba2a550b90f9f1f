//! The shadow that a light throws: a map of the ground in which everything upright is flattened along the light, and the
//! invisible ground that shows it on the real table and on the turf.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout, BindGroupLayoutDescriptor,
    BindGroupLayoutEntry, BindingResource, BindingType, Buffer, BufferBindingType, BufferDescriptor,
    BufferUsages, Color, ColorTargetState, ColorWrites, CommandEncoder, Device, Extent3d, FragmentState,
    LoadOp, MultisampleState, Operations, PipelineLayoutDescriptor, PrimitiveState, Queue, RenderPass,
    RenderPassColorAttachment, RenderPassDescriptor, RenderPipeline, RenderPipelineDescriptor,
    SamplerBindingType, ShaderModuleDescriptor, ShaderSource, ShaderStages, StoreOp, TextureDescriptor,
    TextureDimension, TextureFormat, TextureSampleType, TextureUsages, TextureView, TextureViewDimension,
    VertexBufferLayout, VertexState, VertexStepMode, vertex_attr_array,
};

use super::{
    PictureFormat, Renderer,
    buffers::Triangles,
    linear_sampler,
    pipelines::{Kind, Mixing, build},
};
use crate::scene::{BodyVertex, SolidVertex};

const PATCH: &str = concat!(include_str!("shaders/catcher.wgsl"), include_str!("shaders/catcher_patch.wgsl"));
const OUTLINE: &str =
    concat!(include_str!("shaders/catcher.wgsl"), include_str!("shaders/catcher_surface.wgsl"));
/// Ground around the turf that shadows may reach, metres of the pitch.
const AROUND_M: f64 = 20.0;
/// Pixels of the map per metre of the pitch.
const PX_PER_M: f64 = 12.0;
/// The map shows which share of the light is taken: eight bits are enough.
const MAP_FORMAT: TextureFormat = TextureFormat::R8Unorm;
/// The lowest light that throws a shadow of finite length.
const LEAST_HEIGHT: f32 = 0.3;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LightUniform {
    shift: [f32; 2],
    half_m: [f32; 2],
    strength: f32,
    padding: [f32; 3],
}

/// What shows the shadow around the turf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Catcher {
    /// A patch of the table's plane; something else knows where the table ends.
    Patch,
    /// Triangles of (x, z) in metres of the pitch: the outline of a surface.
    Outline,
}

/// The map and what draws and shows it.
pub(super) struct Cast {
    half_m: Vec2,
    light: Buffer,
    map: TextureView,
    casting: BindGroup,
    caught: BindGroup,
    from_bodies: RenderPipeline,
    from_solids: RenderPipeline,
    on_table: RenderPipeline,
    on_turf: RenderPipeline,
}

impl Cast {
    pub(super) fn new(
        device: &Device,
        scene_layout: &BindGroupLayout,
        half_turf_m: [f64; 2],
        format: PictureFormat,
        around: Catcher,
    ) -> Self {
        let half_m = half_turf_m.map(|half| half + AROUND_M);
        let [width, height] = half_m.map(|half| (2.0 * half * PX_PER_M) as u32);
        let most = device.limits().max_texture_dimension_2d;
        let map = device
            .create_texture(&TextureDescriptor {
                label: Some("shadow map"),
                size: Extent3d {
                    width: width.clamp(1, most),
                    height: height.clamp(1, most),
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format: MAP_FORMAT,
                usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            })
            .create_view(&Default::default());
        let light = device.create_buffer(&BufferDescriptor {
            label: Some("room light"),
            size: size_of::<LightUniform>() as u64,
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let sampler = linear_sampler(device, "shadow map");
        let (casting_layout, caught_layout) = layouts(device);
        let casting = device.create_bind_group(&BindGroupDescriptor {
            label: Some("casting"),
            layout: &casting_layout,
            entries: &[BindGroupEntry { binding: 0, resource: light.as_entire_binding() }],
        });
        let caught = device.create_bind_group(&BindGroupDescriptor {
            label: Some("caught"),
            layout: &caught_layout,
            entries: &[
                BindGroupEntry { binding: 0, resource: light.as_entire_binding() },
                BindGroupEntry { binding: 1, resource: BindingResource::TextureView(&map) },
                BindGroupEntry { binding: 2, resource: BindingResource::Sampler(&sampler) },
            ],
        });
        let catching = device.create_pipeline_layout(&PipelineLayoutDescriptor {
            label: Some("catcher"),
            bind_group_layouts: &[Some(scene_layout), Some(&caught_layout)],
            ..Default::default()
        });
        let catcher = |mixing, around| {
            let outline = vertex_attr_array![0 => Float32x2];
            let (shader, stride, attributes): (_, _, &[_]) = match around {
                Catcher::Patch => (PATCH, 0, &[]),
                Catcher::Outline => (OUTLINE, size_of::<[f32; 2]>(), &outline),
            };
            let kind = Kind::triangles("catcher", shader, mixing, stride, attributes);
            build(device, format, &catching, &kind)
        };
        Self {
            half_m: Vec2::from(half_m.map(|half| half as f32)),
            light,
            map,
            casting,
            caught,
            from_bodies: caster(device, &casting_layout, size_of::<BodyVertex>()),
            from_solids: caster(device, &casting_layout, size_of::<SolidVertex>()),
            on_table: catcher(Mixing::TransparentWithDepth, around),
            on_turf: catcher(Mixing::Transparent, Catcher::Patch),
        }
    }

    /// Draws the map of what was uploaded, for light from a direction in pitch axes.
    pub(super) fn draw(
        &self,
        queue: &Queue,
        encoder: &mut CommandEncoder,
        renderer: &Renderer,
        towards: Vec3,
        strength: f32,
    ) {
        let height = towards.y.max(LEAST_HEIGHT);
        let uniform = LightUniform {
            shift: [-towards.x / height, -towards.z / height],
            half_m: self.half_m.into(),
            strength: strength.clamp(0.0, 1.0),
            padding: [0.0; 3],
        };
        queue.write_buffer(&self.light, 0, bytemuck::bytes_of(&uniform));
        let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("shadow map"),
            color_attachments: &[Some(RenderPassColorAttachment {
                view: &self.map,
                depth_slice: None,
                resolve_target: None,
                ops: Operations { load: LoadOp::Clear(Color::TRANSPARENT), store: StoreOp::Store },
            })],
            depth_stencil_attachment: None,
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_bind_group(0, &self.casting, &[]);
        pass.set_pipeline(&self.from_solids);
        renderer.fixtures.draw(&mut pass);
        renderer.ball.draw(&mut pass);
        pass.set_pipeline(&self.from_bodies);
        renderer.bodies.draw(&mut pass);
    }

    /// The shadow on the table around the turf; leaves the table's depth. For [`Catcher::Patch`]. The scene's bind group must
    /// be set.
    pub(super) fn draw_on_table(&self, pass: &mut RenderPass<'_>) {
        pass.set_pipeline(&self.on_table);
        pass.set_bind_group(1, &self.caught, &[]);
        pass.draw(0..6, 0..1);
    }

    /// The same on the triangles of an outline, for [`Catcher::Outline`].
    pub(super) fn draw_on_outline(&self, pass: &mut RenderPass<'_>, outline: &Triangles) {
        pass.set_pipeline(&self.on_table);
        pass.set_bind_group(1, &self.caught, &[]);
        outline.draw(pass);
    }

    /// The shadow on the turf, after the turf.
    pub(super) fn draw_on_turf(&self, pass: &mut RenderPass<'_>) {
        pass.set_pipeline(&self.on_turf);
        pass.set_bind_group(1, &self.caught, &[]);
        pass.draw(6..12, 0..1);
    }
}

fn layouts(device: &Device) -> (BindGroupLayout, BindGroupLayout) {
    let entry = |binding, visibility, ty| BindGroupLayoutEntry { binding, visibility, ty, count: None };
    let uniform = BindingType::Buffer {
        ty: BufferBindingType::Uniform,
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let map = BindingType::Texture {
        sample_type: TextureSampleType::Float { filterable: true },
        view_dimension: TextureViewDimension::D2,
        multisampled: false,
    };
    let casting = device.create_bind_group_layout(&BindGroupLayoutDescriptor {
        label: Some("casting"),
        entries: &[entry(0, ShaderStages::VERTEX, uniform)],
    });
    let caught = device.create_bind_group_layout(&BindGroupLayoutDescriptor {
        label: Some("caught"),
        entries: &[
            entry(0, ShaderStages::VERTEX_FRAGMENT, uniform),
            entry(1, ShaderStages::FRAGMENT, map),
            entry(2, ShaderStages::FRAGMENT, BindingType::Sampler(SamplerBindingType::Filtering)),
        ],
    });
    (casting, caught)
}

/// Draws vertices whose position comes first, flattened.
fn caster(device: &Device, layout: &BindGroupLayout, stride: usize) -> RenderPipeline {
    let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
        label: Some("cast"),
        bind_group_layouts: &[Some(layout)],
        ..Default::default()
    });
    let module = device.create_shader_module(ShaderModuleDescriptor {
        label: Some("cast"),
        source: ShaderSource::Wgsl(include_str!("shaders/cast.wgsl").into()),
    });
    device.create_render_pipeline(&RenderPipelineDescriptor {
        label: Some("cast"),
        layout: Some(&layout),
        vertex: VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: Default::default(),
            buffers: &[Some(VertexBufferLayout {
                array_stride: stride as u64,
                step_mode: VertexStepMode::Vertex,
                attributes: &vertex_attr_array![0 => Float32x3],
            })],
        },
        primitive: PrimitiveState::default(),
        depth_stencil: None,
        multisample: MultisampleState::default(),
        fragment: Some(FragmentState {
            module: &module,
            entry_point: Some("fragment"),
            compilation_options: Default::default(),
            targets: &[Some(ColorTargetState {
                format: MAP_FORMAT,
                blend: None,
                write_mask: ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}
