//! A recorded room in the window: the mouse points at surfaces, places the match, moves, turns and scales it.
//!
//! All of placing is [`Placement`]; here the mouse becomes its events, and what it says is drawn.

use std::{sync::Arc, time::Duration};

use egui::{
    Color32, CornerRadius, Image, Key, Modifiers, PointerButton, Pos2, Rect, Response, Sense, Shape, Stroke,
    TextureId, Ui, Vec2, WidgetInfo, load::SizedTexture,
};
use egui_wgpu::RenderState;
use glam::{DVec2, DVec3};
use protocol::pitch::Pitch;

use crate::{
    ar::{RoomLight, RoomPicture},
    placement::{
        Surface, TabletopPose,
        gesture::{Event, Look, Options, Placement, Pointer, Ray, Shown},
    },
    renderer::{OnTable, RealTable, Target},
    scene::FrameScene,
};

/// One turn of a mouse wheel, in egui's points, and what it does.
const WHEEL_POINTS: f64 = 50.0;
const SCALE_STEP: f64 = 0.06;
const TURN_STEP: f64 = 0.09;
const HIGHLIGHT: Color32 = Color32::from_rgb(120, 220, 160);

/// A recorded room: its picture, and the surfaces that were found in it.
#[derive(Clone, Debug)]
pub struct Room {
    /// What the camera saw.
    pub picture: RoomPicture,
    /// In the frame of the picture's camera.
    pub surfaces: Vec<Surface>,
    /// Against gravity.
    pub up: DVec3,
}

/// The room, the state of placing, and what they are drawn with.
pub(super) struct RoomView {
    room: Room,
    placement: Placement,
    graphics: Option<RenderState>,
    table: Option<(Pitch, RealTable)>,
    frame: Option<Arc<FrameScene>>,
    picture: Option<(Target, TextureId)>,
    light: RoomLight,
    lit_on: Option<crate::placement::SurfaceId>,
    drawn: Option<Option<OnTable>>,
}

impl RoomView {
    pub(super) fn new(graphics: Option<RenderState>, room: Room, pitch: Pitch, now: Duration) -> Self {
        let mut placement = Placement::new(pitch, Options::mouse(room.up));
        placement.handle(Event::Surfaces(room.surfaces.clone()), now);
        let camera = room.picture.camera;
        let viewer = Ray { origin_m: camera.position_m, direction: camera.rotation.row(2) };
        placement.handle(Event::Viewer(viewer), now);
        let light = RoomLight::neutral(room.up);
        Self {
            room,
            placement,
            graphics,
            table: None,
            frame: None,
            picture: None,
            light,
            lit_on: None,
            drawn: None,
        }
    }

    pub(super) fn placement(&self) -> &Placement {
        &self.placement
    }

    /// Something other than the mouse: a button.
    pub(super) fn handle(&mut self, event: Event, now: Duration) {
        self.placement.handle(event, now);
    }

    /// Puts another frame on the table.
    pub(super) fn show_frame(&mut self, frame: &Arc<FrameScene>) {
        self.frame = Some(frame.clone());
        if let (Some((_, table)), Some(graphics)) = (&mut self.table, &self.graphics) {
            table.upload(&graphics.device, &graphics.queue, frame);
        }
        self.drawn = None;
    }

    /// What the placement wants the viewer to know or do.
    pub(super) fn hint(&self) -> String {
        let shown = self.placement.shown();
        if let Some(misfit) = shown.misfit {
            return misfit.to_string();
        }
        match shown.model.map(|model| model.look) {
            None if self.room.surfaces.is_empty() => "No surface was found in this scan".to_owned(),
            None => "Point at a table".to_owned(),
            Some(Look::Preview) => "Click to place the match here".to_owned(),
            Some(_) => "Drag to move · wheel scales, with Shift turns · corners turn and scale · Esc lifts"
                .to_owned(),
        }
    }

    /// Fills the space that is left with the room and follows the mouse.
    pub(super) fn ui(&mut self, ui: &mut Ui, pitch: Pitch, now: Duration) {
        let space = ui.available_rect_before_wrap();
        let (width, height) = self.room.picture.colour.dimensions();
        let picture = Vec2::new(width.max(1) as f32, height.max(1) as f32);
        let size = picture * (space.width() / picture.x).min(space.height() / picture.y).max(0.01);
        let rect = Rect::from_center_size(space.center(), size);
        let pixels = size * ui.pixels_per_point();
        let sense = Sense::click_and_drag();
        let response = match self.texture(pixels.x.round() as u32, pixels.y.round() as u32) {
            Some(texture) => ui
                .put(rect, Image::new(SizedTexture::new(texture, size)).fit_to_exact_size(size).sense(sense)),
            None => ui.allocate_rect(rect, sense),
        };
        response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, "Room"));
        self.follow_mouse(ui, &response, now);
        self.placement.advance(now);
        while self.placement.poll_output().is_some() {}
        let shown = self.placement.shown();
        self.draw(pitch, &shown);
        self.mark(ui, rect, &shown);
        if self.placement.wakes_at().is_some() {
            ui.ctx().request_repaint();
        }
    }

    fn follow_mouse(&mut self, ui: &Ui, response: &Response, now: Duration) {
        let mouse = Pointer::Right;
        let hand = response.interact_pointer_pos().or(response.hover_pos());
        match hand {
            Some(at) => {
                let ray = self.ray(response.rect, at);
                self.placement.handle(Event::Point(mouse, ray), now);
            }
            None => self.placement.handle(Event::PointAway(mouse), now),
        }
        let (pressed, released, shift) = ui.input(|input| {
            (
                input.pointer.button_pressed(PointerButton::Primary),
                input.pointer.button_released(PointerButton::Primary),
                input.modifiers.shift,
            )
        });
        if pressed && response.contains_pointer() {
            self.placement.handle(Event::Press(mouse), now);
        }
        if released {
            self.placement.handle(Event::Release(mouse), now);
        }
        if response.hovered() {
            // With Shift some systems turn the wheel's way sideways.
            let wheel = ui.input(|input| input.smooth_scroll_delta());
            let steps = f64::from(wheel.x + wheel.y) / WHEEL_POINTS;
            if steps != 0.0 {
                let event = if shift {
                    Event::Turn(steps * TURN_STEP)
                } else {
                    Event::Scale((steps * SCALE_STEP).exp())
                };
                self.placement.handle(event, now);
            }
        }
        if ui.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Escape)) {
            self.placement.handle(Event::Cancel, now);
        }
    }

    /// The room's ray through a place of the window.
    fn ray(&self, rect: Rect, at: Pos2) -> Ray {
        let camera = &self.room.picture.camera;
        let share = (at - rect.min) / rect.size();
        let size = DVec2::new(f64::from(camera.size_px[0]), f64::from(camera.size_px[1]));
        camera.ray(DVec2::new(f64::from(share.x), f64::from(share.y)) * size - 0.5)
    }

    /// Where a point of the room is in the window.
    fn place(&self, rect: Rect, point: DVec3) -> Option<Pos2> {
        let camera = &self.room.picture.camera;
        let (pixel, _) = camera.project(point)?;
        let size = DVec2::new(f64::from(camera.size_px[0]), f64::from(camera.size_px[1]));
        let share = (pixel + 0.5) / size;
        Some(rect.min + Vec2::new(share.x as f32, share.y as f32) * rect.size())
    }

    /// The outline of the highlighted surface, and the handles.
    fn mark(&self, ui: &Ui, rect: Rect, shown: &Shown) {
        let painter = ui.painter_at(rect);
        let highlighted =
            shown.highlighted.and_then(|id| self.placement.surfaces().find(|surface| surface.id == id));
        if let Some(surface) = highlighted {
            let corners: Option<Vec<Pos2>> =
                surface.outline_m.iter().map(|corner| self.place(rect, *corner)).collect();
            if let Some(corners) = corners {
                painter.add(Shape::closed_line(
                    corners.clone(),
                    Stroke::new(7.0, HIGHLIGHT.gamma_multiply(0.3)),
                ));
                painter.add(Shape::closed_line(corners, Stroke::new(2.0, HIGHLIGHT)));
            }
        }
        for handle in shown.handles_m.into_iter().flatten() {
            if let Some(at) = self.place(rect, handle) {
                painter.circle(at, 5.0, HIGHLIGHT.gamma_multiply(0.5), Stroke::new(1.5, HIGHLIGHT));
            }
        }
        if self.graphics.is_none() {
            painter.rect_filled(rect, CornerRadius::ZERO, Color32::from_gray(30));
        }
    }

    /// The texture of the wanted size; a new one when the window changed. `None` without a graphics device.
    fn texture(&mut self, width_px: u32, height_px: u32) -> Option<TextureId> {
        let graphics = self.graphics.as_ref()?;
        if let Some((target, id)) = &self.picture
            && target.size_px() == (width_px.max(1), height_px.max(1))
        {
            return Some(*id);
        }
        let target = Target::new(&graphics.device, width_px, height_px);
        let filter = wgpu::FilterMode::Linear;
        let mut painter = graphics.renderer.write();
        let id = match &self.picture {
            Some((_, id)) => {
                let view = &target.encoded_view;
                painter.update_egui_texture_from_wgpu_texture(&graphics.device, view, filter, *id);
                *id
            }
            None => painter.register_native_texture(&graphics.device, &target.encoded_view, filter),
        };
        self.picture = Some((target, id));
        self.drawn = None;
        Some(id)
    }

    /// Draws unless the picture is already this one.
    fn draw(&mut self, pitch: Pitch, shown: &Shown) {
        let Some(graphics) = &self.graphics else { return };
        let (device, queue) = (&graphics.device, &graphics.queue);
        let standing_on = self.placement.standing().and_then(|(_, id)| id).or(shown.highlighted);
        if let Some(surface) = self.placement.surfaces().find(|surface| Some(surface.id) == standing_on)
            && self.lit_on != standing_on
        {
            self.light = RoomLight::estimate(&self.room.picture, surface);
            self.lit_on = standing_on;
        }
        if self.table.as_ref().is_none_or(|(built, _)| *built != pitch) {
            let mut table = RealTable::new(device, queue, pitch);
            table.show_room(device, queue, &self.room.picture);
            if let Some(frame) = &self.frame {
                table.upload(device, queue, frame);
            }
            self.table = Some((pitch, table));
            self.drawn = None;
        }
        let on_table = shown.model.map(|model| {
            let pose: TabletopPose = model.pose;
            OnTable { pose, light: self.light, opacity: model.opacity }
        });
        if self.drawn == Some(on_table) {
            return;
        }
        if let (Some((_, table)), Some((target, _))) = (&mut self.table, &self.picture) {
            let mut encoder = device.create_command_encoder(&Default::default());
            table.draw(device, queue, &mut encoder, target, on_table.as_ref());
            queue.submit([encoder.finish()]);
            self.drawn = Some(on_table);
        }
    }
}
