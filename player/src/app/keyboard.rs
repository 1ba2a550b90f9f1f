//! The keys: space plays, arrows step, Home and End go to the ends, G changes how guessed surfaces are shown.

use std::time::Duration;

use egui::{Key, Modifiers, Ui};

use crate::{renderer::Guessed, session::Session};

/// Takes the keys out of the input before a focused widget sees them: space would press the last clicked button.
pub(super) fn apply(ui: &Ui, session: &mut Session, guessed: &mut Guessed, now: Duration) {
    let pressed = |modifiers: Modifiers, key: Key| {
        ui.input_mut(|input| input.count_and_consume_key(modifiers, key)) as i32
    };
    if pressed(Modifiers::NONE, Key::Space) % 2 == 1 {
        session.toggle(now);
    }
    let steps = pressed(Modifiers::SHIFT, Key::ArrowRight) * 10
        - pressed(Modifiers::SHIFT, Key::ArrowLeft) * 10
        + pressed(Modifiers::NONE, Key::ArrowRight)
        - pressed(Modifiers::NONE, Key::ArrowLeft);
    if steps != 0 {
        session.step(steps, now);
    }
    for _ in 0..pressed(Modifiers::NONE, Key::G) {
        *guessed = guessed.next();
    }
    if pressed(Modifiers::NONE, Key::Home) > 0 {
        session.seek(0, now);
    }
    if pressed(Modifiers::NONE, Key::End) > 0 {
        session.seek(u32::MAX, now);
    }
}
