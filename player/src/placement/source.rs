//! Where the surfaces of a room come from: a headset's runtime, a recording, or the finder over a depth camera.

use std::time::Duration;

use super::Surface;

/// A source of surfaces. It may work in the background: asking never waits.
pub trait PlaneSource {
    /// What it is, in words.
    fn name(&self) -> &str;

    /// All surfaces that are known at `now`, in the room frame; `None` when nothing has changed since the last time. Ids
    /// are the same from one time to the next.
    fn poll(&mut self, now: Duration) -> Option<Vec<Surface>>;
}
