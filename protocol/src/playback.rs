//! The playback state machine.
