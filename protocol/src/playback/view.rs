//! What the caller draws.

use super::{Failure, ShownFrame};
use crate::time::Ticks;

/// What playback is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaybackState {
    /// Standing where the user left it.
    Paused,
    /// Time runs.
    Playing,
    /// Time would run, but the next frames have not arrived, or a live stream has no newer ones yet.
    Buffering,
    /// Standing on the last frame.
    Ended,
    /// Standing because a chunk could not be fetched; `play` or `seek` tries again.
    Failed,
}

/// What to draw now.
#[derive(Debug)]
pub struct FrameView<C> {
    /// The frame to show; `None` only until the first chunk has arrived.
    pub shown: Option<ShownFrame<C>>,
    /// Where the play head stands. Differs from the time of `shown` while that is held.
    pub position: Ticks,
    /// What playback is doing.
    pub state: PlaybackState,
    /// Whether `shown` is held because the frame at `position` has not arrived or cannot be read.
    pub held: bool,
    /// Why the frame at `position` cannot be shown, once no further attempt is made.
    pub failure: Option<Failure>,
}
