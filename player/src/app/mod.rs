//! The desktop window: the table in the middle, the timeline and the controls below.
//!
//! Fetching and decoding happen in the session's threads; this thread only asks, uploads and draws.

mod controls;
mod keyboard;
mod room_view;
mod scene_view;

pub use room_view::Room;

use std::time::{Duration, Instant};

use egui::{CentralPanel, Color32, Panel, RichText, Ui};
use protocol::pitch::Pitch;

use crate::{
    camera::{OrbitCamera, Preset},
    placement::gesture::Placement,
    renderer::Guessed,
    session::Session,
    source::Location,
};
pub(crate) use controls::timeline as timeline_slider;
use room_view::RoomView;
use scene_view::SceneView;

/// How the table is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Look {
    /// A preset; the broadcast one follows the clip's camera frame by frame.
    Preset(Preset),
    /// The mouse has it.
    Orbit(OrbitCamera),
}

/// The application.
pub struct PlayerApp {
    name: String,
    session: Session,
    view: Option<SceneView>,
    look: Look,
    guessed: Guessed,
    room: Option<RoomView>,
    started: Instant,
}

impl PlayerApp {
    /// Shows the stream at `location`, loaded by `session`. Without a graphics device there are controls but no table.
    #[must_use]
    pub fn new(context: &eframe::CreationContext<'_>, location: &Location, session: Session) -> Self {
        context.egui_ctx.set_theme(egui::Theme::Dark);
        Self {
            name: location.name_of(""),
            session,
            view: context.wgpu_render_state.clone().map(SceneView::new),
            look: Look::Preset(Preset::Table),
            guessed: Guessed::default(),
            room: None,
            started: Instant::now(),
        }
    }

    /// Shows a recorded room instead of a table of its own; the match is placed in it with the mouse.
    #[must_use]
    pub fn in_room(mut self, context: &eframe::CreationContext<'_>, room: Room) -> Self {
        let now = self.now();
        self.room = Some(RoomView::new(context.wgpu_render_state.clone(), room, self.pitch(), now));
        self
    }

    /// The state of placing, in a recorded room.
    #[must_use]
    pub fn placement(&self) -> Option<&Placement> {
        self.room.as_ref().map(RoomView::placement)
    }

    /// What is being watched.
    #[must_use]
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// How surfaces that no camera saw are shown.
    #[must_use]
    pub fn guessed(&self) -> Guessed {
        self.guessed
    }

    /// Plays, if it does not already.
    pub fn play(&mut self) {
        if !self.session.is_playing() {
            let now = self.now();
            self.session.toggle(now);
        }
    }

    fn now(&self) -> Duration {
        self.started.elapsed()
    }

    fn pitch(&self) -> Pitch {
        self.session.manifest().map_or_else(Pitch::default, |manifest| manifest.pitch)
    }

    /// One line under the controls: what is on show, or what is wrong.
    fn status(&self) -> (String, Color32) {
        let quiet = Color32::from_gray(150);
        if let Some(problem) = self.session.problem() {
            return (problem.to_owned(), Color32::from_rgb(240, 170, 90));
        }
        let Some(shown) = self.session.shown() else {
            return (format!("Opening {} …", self.name), quiet);
        };
        let mut parts = vec![format!("{} people", shown.scene.people)];
        if let Some(residual) = shown.quality.line_residual_px {
            parts.push(format!("lines fit to {residual:.1} px"));
        }
        if let Some(confidence) = shown.quality.track_confidence {
            parts.push(format!("tracks {:.0} % sure", confidence * 100.0));
        }
        if self.session.is_waiting() {
            parts.push("loading …".to_owned());
        }
        if self.look == Look::Preset(Preset::Broadcast) && shown.scene.camera.is_none() {
            parts.push("this frame has no broadcast camera".to_owned());
        }
        (parts.join(" · "), quiet)
    }
}

impl eframe::App for PlayerApp {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        let now = self.now();
        keyboard::apply(ui, &mut self.session, &mut self.guessed, now);
        let changed = self.session.update(now);
        if let (true, Some(shown)) = (changed, self.session.shown()) {
            if let Some(room) = &mut self.room {
                room.show_frame(&shown.scene);
            } else if let Some(view) = &mut self.view {
                view.show_frame(&shown.scene);
            }
        }
        Panel::bottom("controls").show(ui, |ui| {
            ui.add_space(6.0);
            controls::timeline(ui, &mut self.session, now);
            let look = self.room.is_none().then_some((&mut self.look, &mut self.guessed));
            controls::buttons(ui, &mut self.session, look, now);
            if let Some(room) = &mut self.room {
                ui.horizontal(|ui| {
                    let standing = room.placement().standing().is_some();
                    for event in controls::placing(ui, standing) {
                        room.handle(event, now);
                    }
                    ui.label(room.hint());
                });
            }
            let (status, colour) = self.status();
            ui.add(egui::Label::new(RichText::new(status).color(colour).small()).wrap());
            ui.add_space(4.0);
        });
        let pitch = self.pitch();
        CentralPanel::default().frame(egui::Frame::NONE).show(ui, |ui| match &mut self.view {
            _ if self.room.is_some() => {
                if let Some(room) = &mut self.room {
                    room.ui(ui, pitch, now);
                }
            }
            Some(view) => {
                let camera = self.session.shown().and_then(|shown| shown.scene.camera);
                view.ui(ui, &pitch, camera.as_ref(), &mut self.look, self.guessed);
            }
            None => {
                ui.centered_and_justified(|ui| {
                    ui.label("No graphics device: the table cannot be drawn. Install a Vulkan driver.");
                });
            }
        });
        if let Some(wait) = self.session.next_update(self.now()) {
            ui.ctx().request_repaint_after(wait);
        }
    }
}
