//! The match in a room that the user of a headset sees: hidden by real surfaces, shadowed on the real table, faded while it is
//! a preview or a ghost, with the marks by which it is placed.
//!
//! One pass for any number of views, onto transparent or dark ground. There is no picture of the room here: what the
//! runtime knows of its surfaces stands for it, and nothing hides the match that is no known surface.

mod marks;
mod surfaces;
mod triangles;

pub use marks::Marks;

use glam::Vec3;
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, Buffer, BufferDescriptor, BufferUsages, Color,
    CommandEncoder, Device, PipelineLayoutDescriptor, Queue, RenderPipeline, VertexAttribute,
    vertex_attr_array,
};

use super::{
    Canvas, PictureFormat, Renderer, View,
    buffers::Triangles,
    cast::{Cast, Catcher},
    pipelines::{Kind, Mixing, build},
    view::{self, MOST_VIEWS, ViewUniform},
};
use crate::{
    camera::EyeView,
    placement::{Surface, TabletopPose},
    scene::{FrameScene, Stage},
};
use marks::{MarkMesh, MarkVertex};
use surfaces::{Hiding, catching};

/// The direction of the key light of `common.wgsl`, in pitch axes: players are lit from where their shadows fall away.
const KEY_LIGHT: Vec3 = Vec3::new(0.36, 0.84, 0.40);
/// Share of the light that it is. A headset tells nothing of the room's lamps: soft.
const KEY_SHARE: f32 = 0.4;

/// What the user sees beside the pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    /// The room, covered by the pictures where they are not transparent: shadows fall on the real table.
    Room,
    /// The room, with the pictures' light added to it: nothing real can be made darker.
    RoomPlusLight,
    /// Nothing: real surfaces neither hide the match nor catch its shadow.
    Nothing,
}

/// The match in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing<'a> {
    /// Where it stands or floats.
    pub pose: TabletopPose,
    /// 0 is not there, 1 is solid.
    pub opacity: f64,
    /// What is under it; `None` in the air.
    pub on: Option<&'a Surface>,
}

/// Everything that is drawn into the room.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RoomScene<'a> {
    /// The match.
    pub standing: Option<Standing<'a>>,
    /// What helps to place it.
    pub marks: Marks,
}

/// Draws the match into a room.
pub struct InRoom {
    renderer: Renderer,
    sight: Sight,
    room_view: Buffer,
    room: BindGroup,
    occluder: RenderPipeline,
    mark: RenderPipeline,
    fade: RenderPipeline,
    cast: Option<Cast>,
    /// Whether the shadow map shows the frame that was uploaded.
    cast_is_fresh: bool,
    hiding: Hiding,
    hides: Triangles,
    catches: Triangles,
    marks: Marks,
    marked: Triangles,
    /// The match as of the last [`Self::prepare`].
    standing: Option<(TabletopPose, f64)>,
}

impl InRoom {
    /// For a stage and pictures of a format, whose surroundings are transparent or dark.
    #[must_use]
    pub fn new(device: &Device, queue: &Queue, stage: &Stage, format: PictureFormat, sight: Sight) -> Self {
        let renderer = Renderer::with_format(device, queue, stage, format);
        let room_view = device.create_buffer(&BufferDescriptor {
            label: Some("room view"),
            size: (MOST_VIEWS * size_of::<ViewUniform>()) as u64,
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let room = device.create_bind_group(&BindGroupDescriptor {
            label: Some("room"),
            layout: &renderer.scene_layout,
            entries: &[
                BindGroupEntry { binding: 0, resource: room_view.as_entire_binding() },
                BindGroupEntry { binding: 1, resource: renderer.stage.as_entire_binding() },
            ],
        });
        let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
            label: Some("room"),
            bind_group_layouts: &[Some(&renderer.scene_layout)],
            ..Default::default()
        });
        let pipeline = |name, shader: &str, mixing, stride, attributes: &[VertexAttribute]| {
            let kind = Kind::triangles(name, shader, mixing, stride, attributes);
            build(device, format, &layout, &kind)
        };
        let Color { r, g, b, a } = format.surroundings.empty();
        let fade = format!(
            "const BEHIND = vec4<f32>({r:?}, {g:?}, {b:?}, {a:?});\n{}",
            include_str!("../shaders/fade.wgsl")
        );
        let mark = vertex_attr_array![0 => Float32x3, 1 => Float32, 2 => Unorm8x4];
        let half_turf_m = stage.layout.half_turf_m;
        let cast = (sight != Sight::Nothing)
            .then(|| Cast::new(device, &renderer.scene_layout, half_turf_m, format, Catcher::Outline));
        Self {
            occluder: pipeline(
                "occluder",
                include_str!("../shaders/occluder.wgsl"),
                Mixing::DepthOnly,
                size_of::<[f32; 3]>(),
                &vertex_attr_array![0 => Float32x3],
            ),
            mark: pipeline(
                "mark",
                include_str!("../shaders/mark.wgsl"),
                Mixing::Transparent,
                size_of::<MarkVertex>(),
                &mark,
            ),
            fade: pipeline("fade", &fade, Mixing::Fade, 0, &[]),
            renderer,
            sight,
            room_view,
            room,
            cast,
            cast_is_fresh: false,
            hiding: Hiding::default(),
            hides: Triangles::new(device),
            catches: Triangles::new(device),
            marks: Marks::default(),
            marked: Triangles::new(device),
            standing: None,
        }
    }

    /// Uploads the people and the ball of a frame; they stay until the next one.
    pub fn upload(&mut self, device: &Device, queue: &Queue, frame: &FrameScene) {
        self.renderer.upload(device, queue, frame);
        self.cast_is_fresh = false;
    }

    /// Takes note of all surfaces of the room that are known; they stay until the next time.
    pub fn know<'a>(&mut self, device: &Device, queue: &Queue, surfaces: impl Iterator<Item = &'a Surface>) {
        if self.sight != Sight::Nothing {
            self.hiding = Hiding::of(surfaces);
            self.hides.write(device, queue, &self.hiding.vertices, &self.hiding.indices);
        }
    }

    /// Takes note of where everything is, for all views that are drawn until the next time; submits the shadow map when there
    /// is another one.
    pub fn prepare(&mut self, device: &Device, queue: &Queue, scene: &RoomScene<'_>) {
        self.standing = scene.standing.map(|standing| (standing.pose, standing.opacity.clamp(0.0, 1.0)));
        if self.marks != scene.marks {
            let mesh = MarkMesh::of(&scene.marks);
            self.marked.write(device, queue, &mesh.vertices, &mesh.indices);
            self.marks.clone_from(&scene.marks);
        }
        self.catches.clear();
        let (Some(cast), Some(standing)) = (&self.cast, scene.standing) else { return };
        if let (Some(surface), Sight::Room) = (standing.on, self.sight) {
            let (corners, indices) = catching(surface, &standing.pose);
            self.catches.write(device, queue, &corners, &indices);
        }
        if !self.cast_is_fresh {
            let mut encoder = device.create_command_encoder(&Default::default());
            cast.draw(queue, &mut encoder, &self.renderer, KEY_LIGHT, KEY_SHARE);
            queue.submit([encoder.finish()]);
            self.cast_is_fresh = true;
        }
    }

    /// Draws what was prepared, seen by as many eyes as the format has views.
    ///
    /// The views take effect when the encoder is submitted: submit before drawing others.
    pub fn draw(&self, queue: &Queue, encoder: &mut CommandEncoder, canvas: &Canvas, eyes: &[EyeView]) {
        let write = |buffer: &Buffer, views: &[View]| {
            if let Some(uniform) = view::uniform(views) {
                queue.write_buffer(buffer, 0, bytemuck::bytes_of(&uniform));
            }
        };
        write(&self.room_view, &eyes.iter().map(EyeView::of_room).collect::<Vec<_>>());
        let standing = self.standing.filter(|(_, opacity)| *opacity > 0.0);
        if let Some((pose, _)) = &standing {
            write(&self.renderer.view, &eyes.iter().map(|eye| eye.of_pitch(pose)).collect::<Vec<_>>());
        }
        let mut pass = self.renderer.begin(encoder, canvas);
        pass.set_bind_group(0, &self.room, &[]);
        pass.set_pipeline(&self.occluder);
        for part in self.hiding.parts(standing.as_ref().map(|(pose, _)| pose)) {
            self.hides.draw_part(&mut pass, part);
        }
        if let Some((_, opacity)) = standing {
            pass.set_bind_group(0, &self.renderer.scene, &[]);
            if let Some(cast) = &self.cast {
                cast.draw_on_outline(&mut pass, &self.catches);
            }
            self.renderer.draw_ground(&mut pass);
            if let Some(cast) = &self.cast {
                cast.draw_on_turf(&mut pass);
            }
            self.renderer.draw_upright(&mut pass);
            if opacity < 1.0 {
                pass.set_pipeline(&self.fade);
                pass.set_blend_constant(Color { r: opacity, g: opacity, b: opacity, a: opacity });
                pass.draw(0..3, 0..1);
            }
        }
        pass.set_bind_group(0, &self.room, &[]);
        pass.set_pipeline(&self.mark);
        self.marked.draw(&mut pass);
    }
}

#[cfg(test)]
mod tests;
