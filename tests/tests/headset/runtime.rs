//! Monado without a headset, and the player on it, both inside the Debian folder that `cargo xtask setup` makes.
//!
//! Monado runs in a network namespace of its own: its `remote` driver listens on every address of a fixed port. Programs
//! are ended by what holds them: bubblewrap ends its children when it ends, and mounts live only inside it.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use tempfile::TempDir;

/// What the runtime says of the head.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Head {
    /// Moves all the time.
    Wobbling,
    /// Held still, looking down at the table.
    Still,
    /// The same, and the right controller points at the table.
    Pointing,
    /// The same, and it pulls its trigger.
    Selecting,
}

/// The folder with the runtime; `None`, with the reason printed, when there is none.
pub fn folder() -> Option<PathBuf> {
    let folder = std::env::var_os("HOLOPITCH_OPENXR_ROOT").map(PathBuf::from);
    let folder = folder.filter(|folder| folder.join("usr/bin/monado-service").is_file());
    if folder.is_none() {
        println!("skipped: no OpenXR runtime: `cargo xtask setup` makes one as root (HOLOPITCH_OPENXR_ROOT)");
    }
    folder
}

/// Through which extension the layer tells of its planes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Planes {
    /// XR_EXT_plane_detection.
    Detected,
    /// XR_EXT_spatial_plane_tracking, and anchors through XR_EXT_spatial_anchor.
    Tracked,
}

impl Planes {
    fn folder(self) -> &'static str {
        match self {
            Self::Detected => "layer",
            Self::Tracked => "layer-spatial",
        }
    }

    fn manifest(self) -> String {
        let extensions: &[&str] = match self {
            Self::Detected => &["plane_detection"],
            Self::Tracked => &["future", "spatial_entity", "spatial_plane_tracking", "spatial_anchor"],
        };
        let offered = extensions
            .iter()
            .map(|name| format!(r#"{{ "name": "XR_EXT_{name}", "extension_version": "1" }}"#));
        LAYER_MANIFEST.replace("EXTENSIONS", &offered.collect::<Vec<_>>().join(", "))
    }
}

/// A file beside the test programs: `target/debug/NAME`.
fn built(name: &str) -> PathBuf {
    let program = std::env::current_exe().expect("this program has a path");
    let path = program.ancestors().nth(2).expect("target/debug").join(name);
    assert!(path.is_file(), "{} is missing: `cargo build -p player -p fakeplanes` makes it", path.display());
    path
}

/// A running Monado, and the folder that the player shares with the test.
pub struct Runtime {
    root: PathBuf,
    pub shared: TempDir,
    head: Head,
    service: Option<Child>,
}

impl Runtime {
    /// Starts Monado and waits until it listens.
    pub fn start(root: PathBuf, head: Head) -> Self {
        let shared = tempfile::tempdir().expect("a folder");
        for name in ["run", "out", "stream", "layer", "layer-spatial"] {
            fs::create_dir(shared.path().join(name)).expect("a folder");
        }
        let layer = built("libfakeplanes.so");
        fs::copy(layer, shared.path().join("layer/libfakeplanes.so")).expect("the layer");
        let layers = [Planes::Detected, Planes::Tracked].map(|planes| (planes.folder(), planes.manifest()));
        for (folder, manifest) in layers {
            fs::write(shared.path().join(folder).join("fakeplanes.json"), manifest).expect("a manifest");
        }
        let mut runtime = Self { root, shared, head, service: None };
        runtime.begin();
        runtime
    }

    /// Starts Monado, again after [`kill`](Self::kill).
    pub fn begin(&mut self) {
        let mut command = self.inside();
        command.args(["--unshare-net", "--unshare-pid", "--setenv", "XRT_COMPOSITOR_NULL", "1"]);
        // Monado ends when its standard input does: a FIFO that nobody closes keeps it.
        let mut script = "mkfifo /tmp/in && { sleep 100000 > /tmp/in & }".to_owned();
        if self.head != Head::Wobbling {
            command.args(["--setenv", "P_OVERRIDE_ACTIVE_CONFIG", "remote", "--ro-bind"]);
            command.arg(env!("CARGO_BIN_EXE_remote_head")).arg("/opt/remote_head");
            let argument = match self.head {
                Head::Wobbling | Head::Still => "",
                Head::Pointing => "point",
                Head::Selecting => "select",
            };
            script += &format!(" && {{ /opt/remote_head {argument} > /mnt/run/head & }}");
        }
        script += " && exec monado-service < /tmp/in";
        let log = fs::File::create(self.shared.path().join("monado.log")).expect("a log");
        command.args(["sh", "-c", &script]).stdout(log.try_clone().expect("a log")).stderr(log);
        self.service = Some(command.spawn().expect("bwrap starts"));
        let head_is_set = || {
            self.head == Head::Wobbling
                || fs::read(self.run().join("head")).is_ok_and(|text| !text.is_empty())
        };
        let begun = Instant::now();
        while !(self.run().join("monado_comp_ipc").exists() && head_is_set()) {
            assert!(begun.elapsed() < Duration::from_secs(60), "Monado does not start: {}", self.log());
            thread::sleep(Duration::from_millis(100));
        }
    }

    /// Ends Monado without warning.
    pub fn kill(&mut self) {
        if let Some(mut service) = self.service.take() {
            service.kill().expect("it is ours");
            service.wait().expect("it ends");
        }
        for left in ["monado_comp_ipc", "monado.pid", "head"] {
            let _ = fs::remove_file(self.run().join(left));
        }
    }

    /// `player xr STREAM` inside the folder. `/mnt/out` is [`out`](Self::out).
    pub fn player(&self, stream: &str, arguments: &[&str]) -> Command {
        self.player_with(Planes::Detected, &[], stream, arguments)
    }

    /// The same under Vulkan's validation layer, which writes to a file in [`out`](Self::out); with a planted mistake.
    pub fn validated_player(&self, stream: &str, arguments: &[&str], log: &str, planted: bool) -> Command {
        let log = format!("/mnt/out/{log}");
        let mut environment = vec![
            ("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation"),
            ("VK_KHRONOS_VALIDATION_DEBUG_ACTION", "VK_DBG_LAYER_ACTION_LOG_MSG"),
            ("VK_KHRONOS_VALIDATION_LOG_FILENAME", &log),
        ];
        environment.extend(planted.then_some(("FAKEPLANES_PLANT_VULKAN_ERROR", "1")));
        self.player_with(Planes::Detected, &environment, stream, arguments)
    }

    /// The same with planes of a kind and further environment.
    pub fn player_with(
        &self,
        planes: Planes,
        environment: &[(&str, &str)],
        stream: &str,
        arguments: &[&str],
    ) -> Command {
        let mut command = self.inside();
        for (name, value) in environment {
            command.args(["--setenv", name, value]);
        }
        command.arg("--ro-bind").arg(built("player")).arg("/opt/player");
        command.args(["--setenv", "XR_RUNTIME_JSON", "/usr/share/openxr/1/openxr_monado.json"]);
        command.args(["--setenv", "XR_API_LAYER_PATH", &format!("/mnt/{}", planes.folder())]);
        command.args(["--setenv", "XR_ENABLE_API_LAYERS", "XR_APILAYER_HOLOPITCH_fakeplanes"]);
        command.args(["--setenv", "FAKEPLANES_LOSE_SESSION", "/mnt/out/lose"]);
        command.args(["/opt/player", "xr", stream]).args(arguments);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Where the player writes.
    pub fn out(&self) -> PathBuf {
        self.shared.path().join("out")
    }

    fn run(&self) -> PathBuf {
        self.shared.path().join("run")
    }

    fn log(&self) -> String {
        fs::read_to_string(self.shared.path().join("monado.log")).unwrap_or_default()
    }

    /// bubblewrap with the folder as its root, the shared folder as `/mnt`, and a clean environment.
    fn inside(&self) -> Command {
        let mut command = Command::new("bwrap");
        command.args(["--die-with-parent", "--bind"]).arg(&self.root).arg("/");
        command.args(["--proc", "/proc", "--dev", "/dev", "--tmpfs", "/tmp", "--bind"]);
        command.arg(self.shared.path()).args(["/mnt", "--clearenv"]);
        for (name, value) in [
            ("PATH", "/usr/bin:/bin"),
            ("HOME", "/tmp"),
            ("XDG_RUNTIME_DIR", "/mnt/run"),
            ("VK_DRIVER_FILES", "/usr/share/vulkan/icd.d/lvp_icd.json"),
        ] {
            command.args(["--setenv", name, value]);
        }
        command
    }
}

impl Drop for Runtime {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Fails with what the player said unless it succeeded.
pub fn succeeded(output: &Output) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}\n{}", text(&output.stdout), text(&output.stderr));
}

/// Waits until a file holds `text` so many times, or says what the file holds.
pub fn wait_for(path: &Path, text: &str, times: usize) {
    let begun = Instant::now();
    loop {
        let told = fs::read_to_string(path).unwrap_or_default();
        if told.matches(text).count() >= times {
            return;
        }
        assert!(begun.elapsed() < Duration::from_secs(60), "no `{text}` ({times} times) in:\n{told}");
        thread::sleep(Duration::from_millis(50));
    }
}

/// The figures that the player wrote.
pub fn figures(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(path).expect("figures")).expect("JSON")
}

const LAYER_MANIFEST: &str = r#"{
  "file_format_version": "1.0.0",
  "api_layer": {
    "name": "XR_APILAYER_HOLOPITCH_fakeplanes",
    "library_path": "/mnt/layer/libfakeplanes.so",
    "api_version": "1.0",
    "implementation_version": "1",
    "description": "A table for the tests",
    "instance_extensions": [EXTENSIONS]
  }
}
"#;
