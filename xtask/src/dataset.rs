//! Data sets rendered by the project, under `target/datasets`.

use anyhow::Result;

use crate::process::cargo;

/// The data sets there are.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(crate) enum Name {
    /// Player crops with depth to train on
    DepthTrain,
    /// Player crops with depth to choose among trained networks
    DepthValidation,
    /// Player crops with depth of held-out motion clips, bodies and kits
    DepthTest,
    /// Broadcast pictures with cameras, people and ball to train on
    FramesTrain,
    /// Broadcast pictures to choose among trained networks
    FramesValidation,
    /// Broadcast pictures of matches that no training ever sees
    FramesTest,
}

/// Kind, split, default count and seed of each. The seeds of test sets are fixed here: nothing is trained on them.
fn recipe(name: Name) -> (&'static str, &'static str, usize, &'static str) {
    match name {
        Name::DepthTrain => ("depth", "train", 12_000, "1"),
        Name::DepthValidation => ("depth", "validation", 1_000, "3"),
        Name::DepthTest => ("depth", "test", 1_000, "2"),
        Name::FramesTrain => ("frames", "train", 2_000, "1"),
        Name::FramesValidation => ("frames", "validation", 200, "3"),
        Name::FramesTest => ("frames", "test", 200, "2"),
    }
}

/// Renders the data set.
pub(crate) fn run(name: Name, count: Option<usize>) -> Result<()> {
    let (kind, split, default_count, seed) = recipe(name);
    let count = count.unwrap_or(default_count).to_string();
    let folder = format!("target/datasets/{kind}-{split}");
    let program = ["run", "--package", "synthesis", "--bin", "dataset", "--", kind];
    let options = ["--split", split, "--out", &folder, "--count", &count, "--seed", seed];
    cargo(&[&program[..], &options].concat())
}
