//! What several test programs share: kept pictures, the excerpt of the demo stream that they show, and how eyes see it.

// Tests may panic: that is how they fail.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod excerpt;
pub mod over;
pub mod snapshot;
