//! The table in the window: drawn into a texture that egui shows, turned by the mouse.

use egui::{Image, PointerButton, Sense, TextureId, Ui, Vec2, WidgetInfo, load::SizedTexture};
use egui_wgpu::RenderState;
use glam::DVec2;
use protocol::{camera::Camera, pitch::Pitch};

use super::Look;
use crate::{
    camera::{OrbitCamera, Preset, ViewCamera},
    renderer::{Guessed, Renderer, Target},
    scene::{FrameScene, Stage},
};

/// One turn of a mouse wheel, in egui's points.
const WHEEL_POINTS: f64 = 50.0;

/// The picture of the table and what it is drawn with.
pub(super) struct SceneView {
    graphics: RenderState,
    stage: Option<(Pitch, Renderer)>,
    frame: Option<std::sync::Arc<FrameScene>>,
    picture: Option<(Target, TextureId)>,
    /// What the picture shows already.
    drawn: Option<(ViewCamera, Guessed)>,
}

impl SceneView {
    pub(super) fn new(graphics: RenderState) -> Self {
        Self { graphics, stage: None, frame: None, picture: None, drawn: None }
    }

    /// Puts another frame on the table.
    pub(super) fn show_frame(&mut self, frame: &std::sync::Arc<FrameScene>) {
        self.frame = Some(frame.clone());
        if let Some((_, renderer)) = &mut self.stage {
            renderer.upload(&self.graphics.device, &self.graphics.queue, frame);
        }
        self.drawn = None;
    }

    /// Fills the space that is left and follows the mouse.
    pub(super) fn ui(
        &mut self,
        ui: &mut Ui,
        pitch: &Pitch,
        broadcast: Option<&Camera>,
        look: &mut Look,
        guessed: Guessed,
    ) {
        let size = ui.available_size().max(Vec2::splat(1.0));
        let aspect = f64::from(size.x / size.y);
        let pixels = size * ui.pixels_per_point();
        let texture = self.texture(pixels.x.round() as u32, pixels.y.round() as u32);
        let image = Image::new(SizedTexture::new(texture, size)).fit_to_exact_size(size);
        let response = ui.add(image.sense(Sense::click_and_drag()));
        response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, "Table"));

        let mut camera = view_of(*look, pitch, broadcast, aspect);
        let drag = response.drag_delta() / size.y;
        let drag = DVec2::new(f64::from(drag.x), f64::from(drag.y));
        let turning = response.dragged_by(PointerButton::Primary);
        let panning =
            response.dragged_by(PointerButton::Secondary) || response.dragged_by(PointerButton::Middle);
        let wheel =
            if response.hovered() { f64::from(ui.input(|input| input.smooth_scroll_delta().y)) } else { 0.0 };
        if (turning || panning) && drag != DVec2::ZERO || wheel != 0.0 {
            let mut orbit = match *look {
                Look::Orbit(orbit) => orbit,
                Look::Preset(Preset::Table) => OrbitCamera::table(pitch, aspect),
                Look::Preset(_) => OrbitCamera::from_view(&camera, pitch),
            };
            let shift = ui.input(|input| input.modifiers.shift);
            if panning || turning && shift {
                orbit.pan(drag);
            } else if turning {
                orbit.turn(drag);
            }
            orbit.zoom(wheel / WHEEL_POINTS);
            camera = orbit.view(aspect);
            *look = Look::Orbit(orbit);
        }
        self.draw(pitch, &camera, guessed);
    }

    /// The texture of the wanted size; a new one when the window changed.
    fn texture(&mut self, width_px: u32, height_px: u32) -> TextureId {
        if let Some((target, id)) = &self.picture
            && target.size_px() == (width_px.max(1), height_px.max(1))
        {
            return *id;
        }
        let target = Target::new(&self.graphics.device, width_px, height_px);
        let filter = wgpu::FilterMode::Linear;
        let mut painter = self.graphics.renderer.write();
        let id = match &self.picture {
            Some((_, id)) => {
                painter.update_egui_texture_from_wgpu_texture(
                    &self.graphics.device,
                    &target.encoded_view,
                    filter,
                    *id,
                );
                *id
            }
            None => painter.register_native_texture(&self.graphics.device, &target.encoded_view, filter),
        };
        self.picture = Some((target, id));
        self.drawn = None;
        id
    }

    /// Draws unless the picture is already this one.
    fn draw(&mut self, pitch: &Pitch, camera: &ViewCamera, guessed: Guessed) {
        let (device, queue) = (&self.graphics.device, &self.graphics.queue);
        if self.stage.as_ref().is_none_or(|(built, _)| built != pitch) {
            let mut renderer = Renderer::new(device, queue, &Stage::new(*pitch));
            if let Some(frame) = &self.frame {
                renderer.upload(device, queue, frame);
            }
            self.stage = Some((*pitch, renderer));
            self.drawn = None;
        }
        if self.drawn == Some((*camera, guessed)) {
            return;
        }
        if let (Some((_, renderer)), Some((target, _))) = (&mut self.stage, &self.picture) {
            renderer.show_guessed(guessed);
            let mut encoder = device.create_command_encoder(&Default::default());
            renderer.draw(queue, &mut encoder, target, camera);
            queue.submit([encoder.finish()]);
            self.drawn = Some((*camera, guessed));
        }
    }
}

/// The view of a look; without a broadcast camera the main stand's view of the whole table.
fn view_of(look: Look, pitch: &Pitch, broadcast: Option<&Camera>, aspect: f64) -> ViewCamera {
    match look {
        Look::Orbit(orbit) => orbit.view(aspect),
        Look::Preset(preset) => preset
            .view(pitch, broadcast, aspect)
            .unwrap_or_else(|| OrbitCamera::table(pitch, aspect).view(aspect)),
    }
}
