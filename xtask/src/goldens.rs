//! Draws the kept pictures of the tests anew, on request from a new excerpt of the demo stream.

use anyhow::Result;

use crate::{demo, process::cargo, setup, test};

/// Replaces `tests/goldens/*.png` by what is drawn now; with `stream`, first `assets/demo/excerpt` by what the
/// reconstructor makes of the demo clip's first frames now.
pub(crate) fn run(stream: bool) -> Result<()> {
    setup::everything()?;
    // The same build as that of the tests: another selection of packages would compile everything again.
    cargo(&["build", "--workspace", "--all-targets"])?;
    if stream {
        demo::reconstruct("assets/demo/excerpt", &["--frames", "0..6", "--profile", "plain"])?;
    }
    test::cargo_test(&["--test", "golden", "--test", "headset"], "HOLOPITCH_UPDATE_GOLDENS")
}
