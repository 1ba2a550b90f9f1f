//! Installing what is missing: Debian packages, ONNX Runtime's library and the glTF validator.
//!
//! Everything comes from the package registries through their own clients. System packages go where apt puts them;
//! the rest goes under `target/setup`.

use std::{
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail};

use crate::{
    openxr,
    process::{cargo, on_path, output, run, run_command},
    root,
};

/// Something the machine must have, how to see that it is there, and the Debian packages that bring it.
struct Requirement {
    probe: Probe,
    packages: &'static [&'static str],
}

enum Probe {
    /// A program on the PATH.
    Program(&'static str),
    /// A library that pkg-config knows.
    Library(&'static str),
    /// A package, by name, for what has neither.
    Package(&'static str),
}

const BUILD: &[Requirement] = &[
    Requirement { probe: Probe::Program("c++"), packages: &["build-essential"] },
    Requirement { probe: Probe::Program("pkg-config"), packages: &["pkg-config"] },
    Requirement { probe: Probe::Library("libavcodec"), packages: &["libavcodec-dev"] },
    Requirement { probe: Probe::Library("libavformat"), packages: &["libavformat-dev"] },
    Requirement { probe: Probe::Library("libswscale"), packages: &["libswscale-dev"] },
    Requirement { probe: Probe::Package("libclang-dev"), packages: &["libclang-dev"] },
    Requirement { probe: Probe::Program("python3"), packages: &["python3"] },
    Requirement { probe: Probe::Package("python3-pip"), packages: &["python3-pip"] },
    Requirement { probe: Probe::Package("libvulkan1"), packages: &["libvulkan1"] },
    Requirement { probe: Probe::Package("mesa-vulkan-drivers"), packages: &["mesa-vulkan-drivers"] },
];

const TEST: &[Requirement] = &[
    Requirement { probe: Probe::Program("ffmpeg"), packages: &["ffmpeg"] },
    Requirement { probe: Probe::Program("node"), packages: &["nodejs"] },
    Requirement { probe: Probe::Program("npm"), packages: &["npm"] },
    Requirement { probe: Probe::Program("xvfb-run"), packages: &["xvfb", "xauth"] },
    Requirement {
        probe: Probe::Package("libxkbcommon-x11-0"),
        packages: &[
            "libxkbcommon-x11-0",
            "libx11-xcb1",
            "libxcursor1",
            "libxi6",
            "libxrandr2",
            "libgl1",
            "libegl1",
            "libgl1-mesa-dri",
        ],
    },
];

/// What making the headset's test runtime needs (see `openxr`).
const HEADSET: &[Requirement] = &[
    Requirement { probe: Probe::Program("debootstrap"), packages: &["debootstrap"] },
    Requirement { probe: Probe::Program("bwrap"), packages: &["bubblewrap"] },
];

/// ONNX Runtime: version and SHA-256 of the wheel that holds the library.
const ONNX_RUNTIME: (&str, &str) =
    ("1.31.1", "5752bd508126ae7c49894d3b9d2e83f0c3d487319246d04c444b393308d7ad7f");
const CARGO_DENY: &str = "0.20.2";
const GLTF_VALIDATOR: &str = "gltf-validator@2.0.0-dev.3.10";

/// What building and running needs.
pub(crate) fn to_run() -> Result<()> {
    println!("set-up: system packages, ONNX Runtime {}", ONNX_RUNTIME.0);
    install(BUILD)?;
    onnx_runtime()
}

/// What the tests need on top.
pub(crate) fn everything() -> Result<()> {
    to_run()?;
    install(TEST)?;
    gltf_validator()?;
    openxr::folder().map(|_| ())
}

/// The tools that make the folder of the headset's test runtime and run programs in it.
pub(crate) fn install_headset_tools() -> Result<()> {
    install(HEADSET)
}

/// Environment of the programs that xtask starts: where the downloaded library is, and software Vulkan for tests.
pub(crate) fn environment() -> Vec<(&'static str, OsString)> {
    let mut variables = vec![("HOLOPITCH_ONNXRUNTIME", library().into_os_string())];
    // Mesa complains on standard error about machines without one, once for every device.
    if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        let run = folder().join("run");
        if fs::create_dir_all(&run).is_ok() {
            variables.push(("XDG_RUNTIME_DIR", run.into_os_string()));
        }
    }
    variables
}

/// The Vulkan driver file of lavapipe, so that pictures are the same on every machine.
pub(crate) fn software_vulkan() -> Result<PathBuf> {
    let folder = Path::new("/usr/share/vulkan/icd.d");
    let entries = fs::read_dir(folder).with_context(|| format!("{} is missing", folder.display()))?;
    entries
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .find(|path| path.file_name().is_some_and(|n| n.to_string_lossy().starts_with("lvp_icd")))
        .with_context(|| format!("no lvp_icd*.json in {}; install mesa-vulkan-drivers", folder.display()))
}

fn folder() -> PathBuf {
    root().join("target/setup")
}

fn library() -> PathBuf {
    folder().join("onnxruntime/libonnxruntime.so")
}

fn present(probe: &Probe) -> bool {
    match probe {
        Probe::Program(name) => on_path(name),
        Probe::Library(name) => output("pkg-config", &["--exists", name]).is_some(),
        Probe::Package(name) => output("dpkg-query", &["-W", "-f=${Status}", name])
            .is_some_and(|status| status.contains("install ok installed")),
    }
}

fn install(requirements: &[Requirement]) -> Result<()> {
    let missing: Vec<&str> =
        requirements.iter().filter(|r| !present(&r.probe)).flat_map(|r| r.packages).copied().collect();
    if missing.is_empty() {
        println!("  system packages: all there");
        return Ok(());
    }
    println!("  system packages missing: {}", missing.join(" "));
    if !on_path("apt-get") {
        bail!("this is not a Debian machine: install the equivalents of: {}", missing.join(" "));
    }
    let is_root = output("id", &["-u"]).is_some_and(|id| id.trim() == "0");
    let apt = |arguments: &[&str]| {
        let mut command = Command::new(if is_root { "apt-get" } else { "sudo" });
        if !is_root {
            command.arg("apt-get");
        }
        run_command(command.args(arguments).env("DEBIAN_FRONTEND", "noninteractive"))
    };
    apt(&["update", "-q"])?;
    let mut arguments = vec!["install", "-q", "-y", "--no-install-recommends"];
    arguments.extend(&missing);
    apt(&arguments)
}

/// Fetches the wheel with pip, which checks the hash, and unpacks the one library out of it.
fn onnx_runtime() -> Result<()> {
    let (version, hash) = ONNX_RUNTIME;
    let done = folder().join(format!("onnxruntime/{version}.done"));
    if done.is_file() && library().is_file() {
        println!("  ONNX Runtime {version}: there");
        return Ok(());
    }
    let download = folder().join("download");
    fs::create_dir_all(&download).with_context(|| format!("cannot make {}", download.display()))?;
    fs::create_dir_all(folder().join("onnxruntime"))?;
    let pinned = download.join("requirements.txt");
    fs::write(&pinned, format!("onnxruntime=={version} --hash=sha256:{hash}\n"))
        .with_context(|| format!("cannot write {}", pinned.display()))?;
    let (download_text, pinned_text) = (path_text(&download)?, path_text(&pinned)?);
    run(
        "/usr/bin/python3",
        &[
            "-m",
            "pip",
            "download",
            "--quiet",
            "--no-deps",
            "--require-hashes",
            "--only-binary=:all:",
            "--python-version=3.11",
            "--implementation=cp",
            "--platform=manylinux_2_28_x86_64",
            "--dest",
            download_text,
            "--requirement",
            pinned_text,
        ],
    )?;
    let wheel = download.join(format!("onnxruntime-{version}-cp311-cp311-manylinux_2_28_x86_64.whl"));
    let unpacked = folder().join("onnxruntime/wheel");
    run("/usr/bin/python3", &["-m", "zipfile", "-e", path_text(&wheel)?, path_text(&unpacked)?])?;
    let inside = unpacked.join(format!("onnxruntime/capi/libonnxruntime.so.{version}"));
    fs::rename(&inside, library())
        .with_context(|| format!("cannot move {} to {}", inside.display(), library().display()))?;
    fs::remove_dir_all(&unpacked)?;
    fs::remove_dir_all(&download)?;
    fs::write(&done, "")?;
    Ok(())
}

/// Where `cargo-deny` is, built from the registry when it is not there yet.
pub(crate) fn cargo_deny() -> Result<PathBuf> {
    let prefix = folder().join("cargo");
    let binary = prefix.join("bin/cargo-deny");
    if !binary.is_file() {
        let version = format!("--version={CARGO_DENY}");
        cargo(&[
            "install",
            "--quiet",
            "--locked",
            "--debug",
            &version,
            "--root",
            path_text(&prefix)?,
            "cargo-deny",
        ])?;
    }
    Ok(binary)
}

/// Khronos' validator, for the conformance tests.
fn gltf_validator() -> Result<()> {
    let prefix = folder().join("node");
    if prefix.join("node_modules/gltf-validator/package.json").is_file() {
        println!("  glTF validator: there");
        return Ok(());
    }
    fs::create_dir_all(&prefix)?;
    let prefix = path_text(&prefix)?.to_owned();
    run("npm", &["install", "--no-audit", "--no-fund", "--silent", "--prefix", &prefix, GLTF_VALIDATOR])
}

fn path_text(path: &Path) -> Result<&str> {
    path.to_str().with_context(|| format!("{} is not valid UTF-8; move the project", path.display()))
}
