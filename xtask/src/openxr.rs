//! The OpenXR runtime of the tests: Monado without a headset, in a Debian 13 folder of its own.
//!
//! Debian 12 has no runtime, and Debian 13's does not load into its processes; so the programs under test run inside the
//! folder too. It is made once (about a minute and a gigabyte) and only where that is possible: as root, on a machine with
//! debootstrap that reaches its mirror. Elsewhere the headset's tests are skipped, and say so.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result};

use crate::{
    process::{on_path, output, run_command},
    root, setup,
};

const RELEASE: &str = "trixie";
const MIRROR: &str = "http://deb.debian.org/debian";
/// What the folder holds beside the smallest Debian. The versions they were tried with: Monado 25.0.0, loader 1.1.47,
/// Mesa 25.0.7, validation layers 1.4.309; a release of Debian changes none of them but for security.
const PACKAGES: [&str; 6] = [
    "monado-service",
    "libopenxr1-monado",
    "libopenxr-loader1",
    "mesa-vulkan-drivers",
    "libvulkan1",
    "vulkan-validationlayers",
];
/// Marks a folder that was made to the end, and says with what.
const DONE: &str = "holopitch-packages.txt";

/// The folder; makes it when it is missing. `None`, with the reason printed, where that cannot be done.
pub(crate) fn folder() -> Result<Option<PathBuf>> {
    let folder = root().join("target/setup/openxr");
    if let Ok(versions) = fs::read_to_string(folder.join(DONE)) {
        println!("  OpenXR runtime: {}", versions.trim().replace('\n', ", "));
        return Ok(Some(folder));
    }
    match make(&folder) {
        Ok(()) => Ok(Some(folder)),
        Err(reason) => {
            println!("SKIPPED OpenXR runtime: {reason:#}: the headset's tests will be skipped");
            Ok(None)
        }
    }
}

fn make(folder: &Path) -> Result<()> {
    let is_root = output("id", &["-u"]).is_some_and(|id| id.trim() == "0");
    anyhow::ensure!(is_root, "only root can make a Debian folder");
    setup::install_headset_tools()?;
    anyhow::ensure!(on_path("debootstrap") && on_path("bwrap"), "debootstrap and bubblewrap are needed");
    let unfinished = folder.with_extension("unfinished");
    for old in [folder, &unfinished] {
        if old.exists() {
            fs::remove_dir_all(old).with_context(|| format!("{}: cannot be removed", old.display()))?;
        }
    }
    fs::create_dir_all(&unfinished).with_context(|| format!("{}: cannot be made", unfinished.display()))?;
    // In a mount namespace of its own, so that whatever it mounts is gone when it ends, however it ends.
    run_command(
        Command::new("unshare")
            .args(["--mount", "--propagation", "private", "debootstrap", "--variant=minbase"])
            .arg(format!("--include={}", PACKAGES.join(",")))
            .arg(RELEASE)
            .arg(&unfinished)
            .arg(MIRROR),
    )?;
    let packages = unfinished.join("var/cache/apt/archives");
    fs::remove_dir_all(&packages).with_context(|| format!("{}: cannot be emptied", packages.display()))?;
    let administration = format!("--admindir={}", unfinished.join("var/lib/dpkg").display());
    let mut question = vec![administration.as_str(), "-W", "-f=${Package} ${Version}\n"];
    question.extend(PACKAGES);
    let versions = output("dpkg-query", &question).context("dpkg-query does not know the packages")?;
    fs::write(unfinished.join(DONE), &versions)?;
    fs::rename(&unfinished, folder)
        .with_context(|| format!("{}: cannot be put in place", folder.display()))?;
    println!("  OpenXR runtime: {}", versions.trim().replace('\n', ", "));
    Ok(())
}
