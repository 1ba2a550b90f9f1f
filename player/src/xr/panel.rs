//! The panel beside the match: play, step, scrub, speed and follow, pointed at by a ray.
//!
//! Widgets and geometry only; no runtime and no GPU, so that tests press its buttons as a hand would.

use std::time::Duration;

use egui::{
    Button, Color32, Context, CornerRadius, Event, FontId, Frame, FullOutput, Margin, Modifiers,
    PointerButton, Pos2, RawInput, Rect, RichText, TextStyle, Ui, Vec2, WidgetInfo, pos2, vec2,
};
use glam::{DQuat, DVec3};
use protocol::playback::Speed;

use crate::{app::timeline_slider, placement::TabletopPose, session::Session, timeline::speed_label};

/// Width and height in the room, metres.
pub const SIZE_M: [f64; 2] = [0.56, 0.175];
/// Pixels of its picture.
pub const SIZE_PX: [u32; 2] = [1024, 320];
/// Pixels per point of the user interface: letters as large as those of a book at arm's length.
pub const PIXELS_PER_POINT: f32 = 2.0;
/// From the edge of the match to the panel, and from the table up to its middle, metres.
const BESIDE_M: f64 = 0.12;
const ABOVE_M: f64 = 0.12;
/// The panel goes round the match when the viewer has gone round this far, radians.
const GOES_ROUND: f64 = 0.45;
/// Speeds of the buttons, per cent.
const SPEEDS: [u16; 4] = [25, 50, 100, 200];

/// Where the panel is: its middle, and its axes (x right, y up, z towards the viewer) in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PanelPose {
    /// Middle, room metres.
    pub position_m: DVec3,
    /// From the panel's axes to the room's.
    pub orientation: DQuat,
    /// Direction from the match to the panel when it was put there, radians about `up`.
    azimuth: f64,
}

impl PanelPose {
    /// Between the match and the viewer, tilted towards the eyes; where it was while the viewer stays on that side.
    #[must_use]
    pub fn beside(pose: &TabletopPose, half_turf_m: [f64; 2], viewer_m: DVec3, before: Option<Self>) -> Self {
        let up = pose.up();
        let towards = (viewer_m - pose.position_m).reject_from_normalized(up);
        let (along, across) = (pose.orientation * DVec3::X, pose.orientation * DVec3::Z);
        let seen_from = towards.dot(along).atan2(towards.dot(across));
        let azimuth = match before {
            Some(before) if turn(before.azimuth, seen_from).abs() < GOES_ROUND => before.azimuth,
            _ => seen_from,
        };
        let outward = along * azimuth.sin() + across * azimuth.cos();
        // To the edge of the turf in that direction.
        let reach = (half_turf_m[0] / azimuth.sin().abs().max(1e-9))
            .min(half_turf_m[1] / azimuth.cos().abs().max(1e-9));
        let position_m = pose.position_m + outward * (reach * pose.scale + BESIDE_M) + up * ABOVE_M;
        let facing = (viewer_m - position_m).try_normalize().unwrap_or(outward);
        let right = up.cross(facing).try_normalize().unwrap_or(along);
        let orientation =
            DQuat::from_mat3(&glam::DMat3::from_cols(right, facing.cross(right), facing)).normalize();
        Self { position_m, orientation, azimuth }
    }

    /// Where a ray meets the panel, in points from its top-left corner; `None` when it misses or comes from behind.
    #[must_use]
    pub fn hit(&self, origin_m: DVec3, direction: DVec3) -> Option<Pos2> {
        let to_panel = self.orientation.inverse();
        let (from, along) = (to_panel * (origin_m - self.position_m), to_panel * direction);
        let distance = -from.z / along.z;
        if !(from.z > 0.0 && distance.is_finite() && distance > 0.0) {
            return None;
        }
        let at = from + along * distance;
        let [x, y] = [at.x / SIZE_M[0] + 0.5, 0.5 - at.y / SIZE_M[1]];
        let size = size_points();
        let inside = (0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y);
        inside.then(|| pos2(x as f32 * size.x, y as f32 * size.y))
    }
}

/// The smallest turn from one angle to another, radians.
fn turn(from: f64, to: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    (to - from + PI).rem_euclid(TAU) - PI
}

fn size_points() -> Vec2 {
    vec2(SIZE_PX[0] as f32, SIZE_PX[1] as f32) / PIXELS_PER_POINT
}

/// What the ray does on the panel this frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PanelPointer {
    /// Where, in points; `None` when nothing points at it.
    pub at: Option<Pos2>,
    /// Whether it is pressed.
    pub pressed: bool,
}

/// The panel.
pub struct Panel {
    context: Context,
    before: PanelPointer,
}

impl Default for Panel {
    fn default() -> Self {
        let context = Context::default();
        context.set_theme(egui::Theme::Dark);
        context.all_styles_mut(|style| {
            for (text, size) in [(TextStyle::Button, 17.0), (TextStyle::Body, 15.0), (TextStyle::Small, 13.0)]
            {
                style.text_styles.insert(text, FontId::proportional(size));
            }
            style.spacing.slider_rail_height = 8.0;
            style.spacing.interact_size.y = 28.0;
        });
        Self { context, before: PanelPointer::default() }
    }
}

impl Panel {
    /// One pass: feeds the ray to the widgets and the widgets' wishes to the session and to `follow`. `hint` is said in passing.
    pub fn run(
        &mut self,
        session: &mut Session,
        follow: &mut bool,
        hint: Option<&str>,
        pointer: PanelPointer,
        now: Duration,
    ) -> FullOutput {
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, size_points())),
            time: Some(now.as_secs_f64()),
            events: events(self.before, pointer),
            ..RawInput::default()
        };
        self.context.set_pixels_per_point(PIXELS_PER_POINT);
        self.before = pointer;
        self.context.run_ui(input, |ui| {
            contents(ui, session, follow, hint, now);
            if let Some(at) = pointer.at {
                let radius = if pointer.pressed { 4.0 } else { 6.0 };
                ui.painter().circle_filled(at, radius, Color32::from_rgba_unmultiplied(255, 255, 255, 210));
            }
        })
    }

    /// Triangles of what [`run`](Self::run) returned.
    pub fn tessellate(&self, shapes: Vec<egui::epaint::ClippedShape>) -> Vec<egui::ClippedPrimitive> {
        self.context.tessellate(shapes, PIXELS_PER_POINT)
    }
}

/// The difference between two frames of the ray, as a mouse would tell it.
fn events(before: PanelPointer, now: PanelPointer) -> Vec<Event> {
    let button = |pos, pressed| Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    let mut events = Vec::new();
    match (before.at, now.at) {
        (_, Some(at)) => {
            events.push(Event::PointerMoved(at));
            // A press that began elsewhere does not count when it slides onto the panel.
            let began_here = before.at.is_some() || !now.pressed;
            if now.pressed != before.pressed && began_here {
                events.push(button(at, now.pressed));
            }
        }
        (Some(last), None) => {
            if before.pressed {
                events.push(button(last, false));
            }
            events.push(Event::PointerGone);
        }
        (None, None) => {}
    }
    events
}

fn contents(ui: &mut Ui, session: &mut Session, follow: &mut bool, hint: Option<&str>, now: Duration) {
    let frame = Frame::new()
        .fill(Color32::from_rgba_unmultiplied(22, 24, 29, 235))
        .corner_radius(CornerRadius::same(14))
        .inner_margin(Margin::symmetric(16, 12));
    frame.show(ui, |ui| {
        ui.set_min_size(ui.available_size());
        ui.horizontal(|ui| {
            ui.label(RichText::new(position(session)).strong());
            if let Some(problem) = session.problem().or(hint) {
                ui.label(RichText::new(problem).small().color(Color32::from_rgb(240, 170, 90)));
            } else if session.is_waiting() {
                ui.label(RichText::new("loading …").small());
            }
        });
        ui.add_space(4.0);
        timeline_slider(ui, session, now);
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            let ready = session.timeline().is_some();
            if button(ui, ready, false, "‹", "Step back").clicked() {
                session.step(-1, now);
            }
            let name = if session.is_playing() { "Pause" } else { "Play" };
            if button(ui, ready, false, name, name).clicked() {
                session.toggle(now);
            }
            if button(ui, ready, false, "›", "Step forward").clicked() {
                session.step(1, now);
            }
            ui.add_space(6.0);
            for speed in SPEEDS.map(Speed::percent) {
                let label = speed_label(speed);
                if button(ui, ready, session.speed() == speed, &label, &label).clicked() {
                    session.set_speed(speed, now);
                }
            }
            ui.add_space(6.0);
            if button(ui, ready, *follow, "Follow", "Follow the ball").clicked() {
                *follow = !*follow;
            }
        });
    });
}

/// "0:01.23 / 0:10.00"
fn position(session: &Session) -> String {
    let Some(timeline) = session.timeline() else { return "–".to_owned() };
    let end = timeline.start + timeline.duration;
    format!("{} / {}", timeline.label(session.position()), timeline.label(end))
}

fn button(ui: &mut Ui, enabled: bool, chosen: bool, face: &str, name: &str) -> egui::Response {
    let width = if face.chars().count() > 1 { 62.0 } else { 36.0 };
    let response = ui.add_enabled(enabled, Button::new(face).selected(chosen).min_size(vec2(width, 36.0)));
    response.widget_info(|| WidgetInfo::selected(egui::Role::Button, enabled, chosen, name));
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose() -> TabletopPose {
        TabletopPose::upright(DVec3::new(0.0, 0.75, -1.0), DVec3::Y, DVec3::X, 0.01)
    }

    fn watching() -> (tempfile::TempDir, Session) {
        use crate::source::{Location, loader::Loader};
        let folder = tempfile::tempdir().unwrap();
        let stream = protocol::sample::match_of(40, 4).unwrap();
        for (path, bytes) in &stream.files {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        }
        let manifest = folder.path().join(protocol::manifest::FILE_NAME);
        std::fs::write(manifest, stream.manifest.to_json().unwrap()).unwrap();
        let location = Location::parse(folder.path().to_str().unwrap()).unwrap();
        let loader = Loader::start(location, protocol::limits::Limits::default(), || {}).unwrap();
        let mut session = Session::new(loader);
        while session.shown().is_none() {
            session.update(Duration::ZERO);
            std::thread::sleep(Duration::from_millis(5));
        }
        (folder, session)
    }

    /// A ray that presses everywhere along the buttons plays, changes the speed and follows; one on the slider scrubs.
    #[test]
    fn every_button_can_be_pressed_by_a_ray() {
        let (_folder, mut session) = watching();
        let (mut panel, mut follow) = (Panel::default(), false);
        let (mut played, mut followed, mut speeds) = (false, false, std::collections::BTreeSet::new());
        let mut time = Duration::ZERO;
        let mut press = |session: &mut Session, follow: &mut bool, x: f32, y: f32| {
            for pressed in [false, true, false] {
                time += Duration::from_millis(300);
                let pointer = PanelPointer { at: Some(pos2(x, y)), pressed };
                panel.run(session, follow, None, pointer, time).drop_without_applying_deltas();
                session.update(time);
            }
        };
        let size = size_points();
        for x in (0..size.x as u32).step_by(12) {
            press(&mut session, &mut follow, x as f32, size.y - 40.0);
            played |= session.is_playing();
            followed |= follow;
            speeds.insert(session.speed().as_percent());
        }
        assert!(played && followed, "played {played}, followed {followed}");
        assert_eq!(speeds.into_iter().collect::<Vec<_>>(), SPEEDS);
        let before = session.position();
        for y in (30..100).step_by(5) {
            press(&mut session, &mut follow, size.x * 0.7, y as f32);
        }
        assert!(session.position() != before, "the slider scrubs");
    }

    #[test]
    fn it_stands_between_the_match_and_the_viewer_and_stays_while_he_leans() {
        let viewer = DVec3::new(0.0, 1.6, 0.3);
        let panel = PanelPose::beside(&pose(), [57.0, 38.5], viewer, None);
        assert!((panel.position_m.z - (-1.0 + 0.385 + BESIDE_M)).abs() < 1e-9, "{}", panel.position_m);
        assert!((panel.orientation * DVec3::Z).dot((viewer - panel.position_m).normalize()) > 0.999);
        assert!((panel.orientation * DVec3::X).dot(DVec3::X) > 0.999, "it is not upside down");
        let leaned = PanelPose::beside(&pose(), [57.0, 38.5], viewer + DVec3::X * 0.3, Some(panel));
        assert!(leaned.position_m.distance(panel.position_m) < 1e-9);
        let behind = PanelPose::beside(&pose(), [57.0, 38.5], DVec3::new(0.1, 1.6, -3.0), Some(panel));
        assert!(behind.position_m.z < -1.385, "it goes round with the viewer: {}", behind.position_m);
    }

    #[test]
    fn rays_hit_points_and_miss_from_behind() {
        let panel = PanelPose::beside(&pose(), [57.0, 38.5], DVec3::new(0.0, 1.6, 0.3), None);
        let front = panel.position_m + panel.orientation * DVec3::new(0.0, 0.0, 0.5);
        let back = panel.orientation * DVec3::NEG_Z;
        let size = size_points();
        let middle = panel.hit(front, back).unwrap();
        assert!((middle - (size / 2.0).to_pos2()).length() < 1e-3, "{middle:?}");
        let corner = front + panel.orientation * DVec3::new(-SIZE_M[0] / 2.0, SIZE_M[1] / 2.0, 0.0) * 0.999;
        assert!(panel.hit(corner, back).unwrap().to_vec2().length() < 1.0);
        assert_eq!(panel.hit(front, -back), None);
        assert_eq!(panel.hit(front + panel.orientation * DVec3::X, back), None);
        let behind = panel.position_m - panel.orientation * DVec3::Z;
        assert_eq!(panel.hit(behind, -back), None);
    }

    #[test]
    fn a_press_that_slides_onto_the_panel_presses_nothing() {
        let at = Some(pos2(10.0, 10.0));
        let pressed = |at| PanelPointer { at, pressed: true };
        let free = |at| PanelPointer { at, pressed: false };
        let buttons = |before, now| {
            events(before, now).iter().filter(|event| matches!(event, Event::PointerButton { .. })).count()
        };
        assert_eq!(buttons(free(None), pressed(at)), 0);
        assert_eq!(buttons(free(at), pressed(at)), 1);
        assert_eq!(buttons(pressed(at), free(at)), 1);
        assert_eq!(buttons(pressed(at), pressed(None)), 1, "sliding off lets go");
        assert_eq!(buttons(free(None), free(None)), 0);
    }
}
