//! Data sets rendered by the project, under `target/datasets`.

use anyhow::Result;

use crate::process::cargo;

/// The data sets there are.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(crate) enum Name {
    /// Player crops with depth to train on
    DepthTrain,
    /// Player crops with depth of held-out motion clips, bodies and kits
    DepthTest,
}

/// Renders the data set.
pub(crate) fn run(name: Name, count: Option<usize>) -> Result<()> {
    let (split, folder, default_count, seed) = match name {
        Name::DepthTrain => ("train", "target/datasets/depth-train", 12_000, "1"),
        Name::DepthTest => ("test", "target/datasets/depth-test", 1_000, "2"),
    };
    let count = count.unwrap_or(default_count).to_string();
    cargo(&[
        "run",
        "--package",
        "synthesis",
        "--bin",
        "dataset",
        "--",
        "depth",
        "--split",
        split,
        "--out",
        folder,
        "--count",
        &count,
        "--seed",
        seed,
    ])
}
