//! The life of an OpenXR session as a state machine: what the runtime reports goes in, what to do comes out.
//!
//! No runtime in here, so that every way through it is tested. The states are those of the OpenXR specification, chapter
//! "Session Lifecycle".

use openxr::SessionState;

/// What the frame loop has to do after a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Nothing.
    Continue,
    /// Begin the session: frames may run from now on.
    Begin,
    /// End the session: no frames until it is ready again.
    End,
    /// The user or the runtime wants the program to go.
    Exit,
    /// Throw the session away and make a new one.
    Rebuild,
}

/// Where the session stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lifecycle {
    state: SessionState,
    running: bool,
    /// Whether somebody wears the headset; true where the runtime cannot tell.
    present: bool,
}

impl Default for Lifecycle {
    fn default() -> Self {
        Self { state: SessionState::UNKNOWN, running: false, present: true }
    }
}

impl Lifecycle {
    /// The runtime reports a state.
    pub fn on_state(&mut self, state: SessionState) -> Action {
        self.state = state;
        match state {
            SessionState::READY if !self.running => {
                self.running = true;
                Action::Begin
            }
            SessionState::STOPPING if self.running => {
                self.running = false;
                Action::End
            }
            SessionState::EXITING => {
                self.running = false;
                Action::Exit
            }
            SessionState::LOSS_PENDING => {
                self.running = false;
                Action::Rebuild
            }
            _ => Action::Continue,
        }
    }

    /// The headset is put on or taken off.
    pub fn on_presence(&mut self, present: bool) {
        self.present = present;
    }

    /// Whether frames are to be waited for and drawn.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.running
    }

    /// Whether somebody looks at the match: it plays only then. A system menu over it takes the input away but not the
    /// sight; a headset on the table takes both.
    #[must_use]
    pub fn is_watched(&self) -> bool {
        self.running && self.present && matches!(self.state, SessionState::VISIBLE | SessionState::FOCUSED)
    }

    /// Whether hands and controllers speak to us.
    #[must_use]
    pub fn has_input(&self) -> bool {
        self.running && self.state == SessionState::FOCUSED
    }
}

/// Stops the match while nobody watches and lets it go on afterwards, unless the user has stopped it meanwhile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlayGuard {
    stopped_by_us: bool,
}

impl PlayGuard {
    /// Whether play is to be toggled now.
    pub fn toggles(&mut self, watched: bool, playing: bool) -> bool {
        match (watched, playing) {
            (false, true) => {
                self.stopped_by_us = true;
                true
            }
            (true, false) if self.stopped_by_us => {
                self.stopped_by_us = false;
                true
            }
            (true, true) => {
                self.stopped_by_us = false;
                false
            }
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_specifications_way_from_ready_to_exit() {
        let mut life = Lifecycle::default();
        assert!(!life.is_running());
        assert_eq!(life.on_state(SessionState::IDLE), Action::Continue);
        assert_eq!(life.on_state(SessionState::READY), Action::Begin);
        assert_eq!(life.on_state(SessionState::SYNCHRONIZED), Action::Continue);
        assert!(life.is_running() && !life.is_watched());
        life.on_state(SessionState::VISIBLE);
        assert!(life.is_watched() && !life.has_input());
        life.on_state(SessionState::FOCUSED);
        assert!(life.is_watched() && life.has_input());
        assert_eq!(life.on_state(SessionState::STOPPING), Action::End);
        assert!(!life.is_running());
        life.on_state(SessionState::IDLE);
        assert_eq!(life.on_state(SessionState::READY), Action::Begin, "taken off and put on again");
        assert_eq!(life.on_state(SessionState::EXITING), Action::Exit);
        assert!(!life.is_running());
    }

    #[test]
    fn a_lost_session_is_rebuilt_from_any_state() {
        for before in [SessionState::IDLE, SessionState::FOCUSED, SessionState::SYNCHRONIZED] {
            let mut life = Lifecycle::default();
            life.on_state(SessionState::READY);
            life.on_state(before);
            assert_eq!(life.on_state(SessionState::LOSS_PENDING), Action::Rebuild);
            assert!(!life.is_running() && !life.is_watched());
        }
    }

    #[test]
    fn the_match_stops_when_the_headset_is_taken_off_and_goes_on_when_it_is_back() {
        let mut life = Lifecycle::default();
        life.on_state(SessionState::READY);
        life.on_state(SessionState::FOCUSED);
        let mut guard = PlayGuard::default();
        assert!(!guard.toggles(life.is_watched(), true));
        life.on_presence(false);
        assert!(guard.toggles(life.is_watched(), true), "stops");
        assert!(!guard.toggles(life.is_watched(), false), "once");
        life.on_presence(true);
        assert!(guard.toggles(life.is_watched(), false), "goes on");
        assert!(!guard.toggles(life.is_watched(), true));
        // Paused by hand: taking the headset off and on changes nothing.
        assert!(!guard.toggles(true, false) && !guard.toggles(false, false) && !guard.toggles(true, false));
    }
}
