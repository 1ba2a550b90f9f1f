//! The render pipelines: one per kind of thing, all with the same target, depth and samples.

use std::num::NonZeroU32;

use wgpu::{
    BlendComponent, BlendFactor, BlendOperation, BlendState, ColorTargetState, ColorWrites, CompareFunction,
    DepthStencilState, Device, FragmentState, MultisampleState, PipelineLayout, PrimitiveState,
    PrimitiveTopology, RenderPipeline, RenderPipelineDescriptor, ShaderModuleDescriptor, ShaderSource,
    VertexAttribute, VertexBufferLayout, VertexState, VertexStepMode, vertex_attr_array,
};

use super::{DEPTH_FORMAT, PictureFormat, view::for_two_views};
use crate::scene::{BodyVertex, GroundVertex, NetVertex, Shadow, SolidVertex};

const COMMON: &str = include_str!("shaders/common.wgsl");

/// One pipeline per kind of thing, in drawing order.
pub(super) struct Pipelines {
    pub(super) backdrop: RenderPipeline,
    pub(super) ground: RenderPipeline,
    pub(super) solid: RenderPipeline,
    pub(super) shadow: RenderPipeline,
    pub(super) body: RenderPipeline,
    pub(super) ghost: RenderPipeline,
    pub(super) net: RenderPipeline,
}

/// How a pipeline treats what is already in the picture.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Mixing {
    /// Behind everything, no depth.
    Background,
    /// Hides what is farther.
    Opaque,
    /// Tints what is farther, hides nothing.
    Transparent,
    /// Tints what is farther and keeps its depth.
    TransparentWithDepth,
    /// Leaves its depth and no colour.
    DepthOnly,
    /// Over everything: the blend constant is the share of the picture that stays.
    Fade,
}

/// The picture times the blend constant, and what is drawn times the rest.
const FADING: BlendState = {
    let component = BlendComponent {
        src_factor: BlendFactor::OneMinusConstant,
        dst_factor: BlendFactor::Constant,
        operation: BlendOperation::Add,
    };
    BlendState { color: component, alpha: component }
};

pub(super) struct Kind<'a> {
    pub(super) name: &'a str,
    pub(super) shader: &'a str,
    pub(super) mixing: Mixing,
    pub(super) topology: PrimitiveTopology,
    pub(super) step_mode: VertexStepMode,
    pub(super) stride: usize,
    pub(super) attributes: &'a [VertexAttribute],
}

impl<'a> Kind<'a> {
    /// Triangles from vertices of their own.
    pub(super) fn triangles(
        name: &'static str,
        shader: &'a str,
        mixing: Mixing,
        stride: usize,
        attributes: &'a [VertexAttribute],
    ) -> Self {
        Self {
            name,
            shader,
            mixing,
            topology: PrimitiveTopology::TriangleList,
            step_mode: VertexStepMode::Vertex,
            stride,
            attributes,
        }
    }
}

impl Pipelines {
    /// `plain` binds the view, `textured` also an atlas.
    pub(super) fn new(
        device: &Device,
        format: PictureFormat,
        plain: &PipelineLayout,
        textured: &PipelineLayout,
    ) -> Self {
        let build = |layout, kind: &Kind<'_>| build(device, format, layout, kind);
        let ground_attributes = vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Uint32];
        let solid_attributes = vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3];
        let shadow_attributes = vertex_attr_array![0 => Float32x2, 1 => Float32x2, 2 => Float32];
        let body_attributes = vertex_attr_array![0 => Float32x3, 1 => Float32x2, 2 => Unorm8x4];
        let net_attributes = vertex_attr_array![0 => Float32x3, 1 => Float32x2];
        Self {
            backdrop: build(
                plain,
                &Kind::triangles(
                    "backdrop",
                    include_str!("shaders/backdrop.wgsl"),
                    Mixing::Background,
                    0,
                    &[],
                ),
            ),
            ground: build(
                plain,
                &Kind::triangles(
                    "ground",
                    include_str!("shaders/ground.wgsl"),
                    Mixing::Opaque,
                    size_of::<GroundVertex>(),
                    &ground_attributes,
                ),
            ),
            solid: build(
                plain,
                &Kind::triangles(
                    "solid",
                    include_str!("shaders/solid.wgsl"),
                    Mixing::Opaque,
                    size_of::<SolidVertex>(),
                    &solid_attributes,
                ),
            ),
            shadow: build(
                plain,
                &Kind {
                    name: "shadow",
                    shader: include_str!("shaders/shadow.wgsl"),
                    mixing: Mixing::Transparent,
                    topology: PrimitiveTopology::TriangleStrip,
                    step_mode: VertexStepMode::Instance,
                    stride: size_of::<Shadow>(),
                    attributes: &shadow_attributes,
                },
            ),
            body: build(
                textured,
                &Kind::triangles(
                    "body",
                    include_str!("shaders/body.wgsl"),
                    Mixing::Opaque,
                    size_of::<BodyVertex>(),
                    &body_attributes,
                ),
            ),
            ghost: build(
                textured,
                &Kind::triangles(
                    "ghost",
                    include_str!("shaders/ghost.wgsl"),
                    Mixing::Transparent,
                    size_of::<BodyVertex>(),
                    &body_attributes,
                ),
            ),
            net: build(
                plain,
                &Kind::triangles(
                    "net",
                    include_str!("shaders/net.wgsl"),
                    Mixing::Transparent,
                    size_of::<NetVertex>(),
                    &net_attributes,
                ),
            ),
        }
    }
}

/// The bits of the views that a pass or a pipeline draws at once; `None` for a single one.
pub(super) fn multiview_mask(views: u32) -> Option<NonZeroU32> {
    NonZeroU32::new((1 << views) - 1).filter(|_| views > 1)
}

pub(super) fn build(
    device: &Device,
    format: PictureFormat,
    layout: &PipelineLayout,
    kind: &Kind<'_>,
) -> RenderPipeline {
    let source = format!("{COMMON}\n{}", kind.shader);
    let source = if format.views > 1 { for_two_views(&source) } else { source };
    let module = device.create_shader_module(ShaderModuleDescriptor {
        label: Some(kind.name),
        source: ShaderSource::Wgsl(source.into()),
    });
    let buffer = VertexBufferLayout {
        array_stride: kind.stride as u64,
        step_mode: kind.step_mode,
        attributes: kind.attributes,
    };
    let buffers = [Some(buffer)];
    device.create_render_pipeline(&RenderPipelineDescriptor {
        label: Some(kind.name),
        layout: Some(layout),
        vertex: VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: Default::default(),
            buffers: if kind.stride == 0 { &[] } else { &buffers },
        },
        // People without what is guessed of them are open surfaces: both sides are drawn.
        primitive: PrimitiveState { topology: kind.topology, cull_mode: None, ..Default::default() },
        depth_stencil: Some(DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(!matches!(
                kind.mixing,
                Mixing::Background | Mixing::Transparent | Mixing::Fade
            )),
            // Reversed depth: nearer is larger.
            depth_compare: Some(match kind.mixing {
                Mixing::Background | Mixing::Fade => CompareFunction::Always,
                _ => CompareFunction::GreaterEqual,
            }),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: MultisampleState { count: format.samples, ..Default::default() },
        fragment: Some(FragmentState {
            module: &module,
            entry_point: Some("fragment"),
            compilation_options: Default::default(),
            targets: &[Some(ColorTargetState {
                format: format.colour,
                blend: match kind.mixing {
                    Mixing::Transparent | Mixing::TransparentWithDepth => Some(BlendState::ALPHA_BLENDING),
                    Mixing::Fade => Some(FADING),
                    Mixing::Background | Mixing::Opaque | Mixing::DepthOnly => None,
                },
                write_mask: if kind.mixing == Mixing::DepthOnly {
                    ColorWrites::empty()
                } else {
                    ColorWrites::ALL
                },
            })],
        }),
        multiview_mask: multiview_mask(format.views),
        cache: None,
    })
}
