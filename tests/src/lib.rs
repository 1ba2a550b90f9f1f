//! What several test programs share: kept pictures, and the excerpt of the demo stream that they show.

// Tests may panic: that is how they fail.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod excerpt;
pub mod snapshot;
