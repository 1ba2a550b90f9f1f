//! The timeline and the row of buttons. Every control has a name for assistive technology.

use std::time::Duration;

use egui::{Button, ComboBox, Rect, Response, Slider, Stroke, Ui, WidgetInfo};

use protocol::{manifest::Segment, playback::Speed};

use super::Look;
use crate::{
    camera::Preset,
    placement::gesture::Event,
    renderer::Guessed,
    session::Session,
    timeline::{SPEEDS_PERCENT, Timeline, speed_label},
};

/// One press of a button turns by this angle, radians, and scales by this factor.
const TURN_STEP: f64 = 0.26;
const SCALE_STEP: f64 = 1.1;

/// The slider over the whole match.
pub(crate) fn timeline(ui: &mut Ui, session: &mut Session, now: Duration) {
    let Some(timeline) = session.timeline().copied() else {
        ui.add_enabled_ui(false, |ui| slider(ui, &mut 0, 0));
        return;
    };
    let mut frame = timeline.frame_at(session.position());
    let response = slider(ui, &mut frame, timeline.frames() - 1);
    if response.changed() {
        session.seek(frame, now);
    }
    marks(ui, response.rect, &timeline, session.segments());
}

/// Where shots begin, and what the broadcast did not show, on the slider's rail.
fn marks(ui: &Ui, rail: Rect, timeline: &Timeline, segments: &[Segment]) {
    // The handle's middle travels this much less than the slider is wide.
    let inset = ui.style().spacing.interact_size.y.min(rail.height()) / 2.5;
    let x = |share: f32| egui::lerp(rail.left() + inset..=rail.right() - inset, share);
    for mark in timeline.marks(segments) {
        let (left, right) = (x(mark.start), x(mark.end));
        let colour = ui.visuals().weak_text_color();
        if mark.is_gap {
            let band =
                Rect::from_x_y_ranges(left..=right.max(left + 1.0), rail.center().y + 5.0..=rail.bottom());
            ui.painter().rect_filled(band, 0.0, colour);
        } else if mark.start > 0.0 {
            ui.painter().vline(left, rail.center().y + 3.0..=rail.bottom(), Stroke::new(1.5, colour));
        }
    }
}

fn slider(ui: &mut Ui, frame: &mut u32, last: u32) -> Response {
    ui.spacing_mut().slider_width = ui.available_width();
    let response = ui.add(Slider::new(frame, 0..=last.max(1)).show_value(false).trailing_fill(true));
    let value = f64::from(*frame);
    let enabled = response.enabled();
    response.widget_info(|| WidgetInfo::slider(enabled, value, "Timeline"));
    response
}

/// Play, step, speed, camera and guessed surfaces (in a recorded room there is one camera, and all is solid), and where we are.
pub(super) fn buttons(
    ui: &mut Ui,
    session: &mut Session,
    look: Option<(&mut Look, &mut Guessed)>,
    now: Duration,
) {
    ui.horizontal(|ui| {
        let ready = session.timeline().is_some();
        let playing = session.is_playing();
        if button(ui, ready, "«", "First frame").clicked() {
            session.seek(0, now);
        }
        if button(ui, ready, "‹", "Step back").clicked() {
            session.step(-1, now);
        }
        let name = if playing { "Pause" } else { "Play" };
        if button(ui, ready, name, name).clicked() {
            session.toggle(now);
        }
        if button(ui, ready, "›", "Step forward").clicked() {
            session.step(1, now);
        }
        if button(ui, ready, "»", "Last frame").clicked() {
            session.seek(u32::MAX, now);
        }
        ui.add_space(8.0);
        speed_menu(ui, session, now);
        if let Some((look, guessed)) = look {
            camera_menu(ui, look);
            guessed_menu(ui, guessed);
        }
        ui.add_space(8.0);
        ui.label(position(session));
    });
}

/// What a mouse wheel and Escape do, as buttons for those who have neither.
pub(super) fn placing(ui: &mut Ui, standing: bool) -> Vec<Event> {
    let choices = [
        ("Turn left", Event::Turn(TURN_STEP)),
        ("Turn right", Event::Turn(-TURN_STEP)),
        ("Smaller", Event::Scale(1.0 / SCALE_STEP)),
        ("Larger", Event::Scale(SCALE_STEP)),
        ("Lift", Event::Cancel),
    ];
    let clicked = |(name, event)| button(ui, standing, name, name).clicked().then_some(event);
    choices.into_iter().filter_map(clicked).collect()
}

/// "0:01.23 / 0:10.00 · frame 37 of 300 · clip frame 187"
fn position(session: &Session) -> String {
    let Some(timeline) = session.timeline() else { return "–".to_owned() };
    let moment = timeline.label(session.position());
    let length = timeline.label(timeline.start + timeline.duration);
    let Some(shown) = session.shown() else { return format!("{moment} / {length}") };
    format!(
        "{moment} / {length} · frame {} of {} · clip frame {}",
        shown.frame,
        timeline.frames(),
        shown.scene.clip_frame
    )
}

fn button(ui: &mut Ui, enabled: bool, face: &str, name: &str) -> Response {
    // Wide enough for both "Play" and "Pause", so that the row stays where it is.
    let width = if face == name { 58.0 } else { 30.0 };
    let response = ui.add_enabled(enabled, Button::new(face).min_size(egui::vec2(width, 24.0)));
    response.widget_info(|| WidgetInfo::labeled(egui::Role::Button, enabled, name));
    response.on_hover_text(name)
}

fn speed_menu(ui: &mut Ui, session: &mut Session, now: Duration) {
    let speed = session.speed();
    let menu =
        ComboBox::from_id_salt("speed").width(64.0).selected_text(speed_label(speed)).show_ui(ui, |ui| {
            for choice in SPEEDS_PERCENT.map(Speed::percent) {
                if ui.selectable_label(choice == speed, speed_label(choice)).clicked() {
                    session.set_speed(choice, now);
                }
            }
        });
    name_menu(&menu.response, "Speed", &speed_label(speed));
}

fn camera_menu(ui: &mut Ui, look: &mut Look) {
    let current = match look {
        Look::Preset(preset) => preset.label(),
        Look::Orbit(_) => "Free",
    };
    let menu = ComboBox::from_id_salt("camera").width(104.0).selected_text(current).show_ui(ui, |ui| {
        for preset in Preset::ALL {
            if ui.selectable_label(*look == Look::Preset(preset), preset.label()).clicked() {
                *look = Look::Preset(preset);
            }
        }
    });
    name_menu(&menu.response, "Camera", current);
}

/// What no camera saw of people: as if it had been seen, pale, or not at all.
fn guessed_menu(ui: &mut Ui, guessed: &mut Guessed) {
    let label = |guessed: Guessed| match guessed {
        Guessed::Solid => "Guessed: solid",
        Guessed::Ghosted => "Guessed: ghosted",
        Guessed::Hidden => "Guessed: hidden",
    };
    let current = label(*guessed);
    let menu = ComboBox::from_id_salt("guessed").width(128.0).selected_text(current).show_ui(ui, |ui| {
        for choice in Guessed::ALL {
            if ui.selectable_label(*guessed == choice, label(choice)).clicked() {
                *guessed = choice;
            }
        }
    });
    name_menu(&menu.response, "Guessed surfaces", guessed.name());
}

fn name_menu(response: &Response, name: &str, value: &str) {
    response.widget_info(|| {
        let mut info = WidgetInfo::labeled(egui::Role::ComboBox, true, name);
        info.current_text_value = Some(value.to_owned());
        info
    });
}
