//! `player STREAM`: the desktop window, and the flags that let a script look at it.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
};

use anyhow::{Context, anyhow};
use eframe::{NativeOptions, Renderer};
use egui::{ColorImage, ViewportBuilder, ViewportCommand};
use player::{
    app::{PlayerApp, Room},
    placement::Finder,
    scan::RecordedRoom,
    session::Session,
    source::{Location, loader::Loader},
};
use protocol::limits::Limits;

#[derive(clap::Args)]
pub(super) struct WindowArguments {
    /// Folder of the stream, or its http:// address.
    #[arg(value_name = "STREAM|URL", required = true)]
    stream: Option<String>,
    /// Show the match in this recorded room, a cloud with rows and colours, and place it there with the mouse.
    #[arg(long, value_name = "FILE.pcd")]
    scan: Option<PathBuf>,
    /// The colour picture of the scan, when the cloud has no colours.
    #[arg(long, value_name = "FILE.png|.jpg", requires = "scan")]
    image: Option<PathBuf>,
    /// For scripts: close the window after this many frames of the match were shown.
    #[arg(long, value_name = "N")]
    exit_after_frames: Option<u32>,
    /// For scripts: write what the window shows before it closes. Needs --exit-after-frames.
    #[arg(long, value_name = "PNG", requires = "exit_after_frames")]
    screenshot: Option<PathBuf>,
}

pub(super) fn run(arguments: &WindowArguments) -> anyhow::Result<()> {
    let text = arguments.stream.as_deref().context("no stream given")?;
    let location = Location::parse(text)?;
    if let Location::Folder(folder) = &location
        && !folder.is_dir()
    {
        return Err(anyhow!("{text}: there is no such folder: give the folder that holds match.json"));
    }
    let room =
        arguments.scan.as_deref().map(|scan| read_room(scan, arguments.image.as_deref())).transpose()?;
    let outcome = Arc::new(Mutex::new(None));
    let script = arguments.exit_after_frames.map(|frames| Script {
        frames,
        screenshot: arguments.screenshot.clone(),
        shown: 0,
        last: None,
        started: false,
        asked: false,
        picture: Arc::default(),
        outcome: outcome.clone(),
    });
    let options = NativeOptions {
        renderer: Renderer::Wgpu,
        viewport: ViewportBuilder::default()
            .with_title(format!("Holopitch – {text}"))
            .with_inner_size([1280.0, 800.0])
            .with_min_inner_size([480.0, 320.0]),
        ..NativeOptions::default()
    };
    let build = move |context: &eframe::CreationContext<'_>| {
        let wake = context.egui_ctx.clone();
        let loader = Loader::start(location.clone(), Limits::default(), move || wake.request_repaint())?;
        let mut app = PlayerApp::new(context, &location, Session::new(loader));
        if let Some(room) = room {
            app = app.in_room(context, room);
        }
        Ok(Box::new(Window { app, script }) as Box<dyn eframe::App>)
    };
    eframe::run_native("holopitch-player", options, Box::new(build)).map_err(|error| {
        anyhow!(
            "no window: {error}: check that a display and a graphics driver are there, or use `player render`"
        )
    })?;
    let outcome = outcome.lock().unwrap_or_else(PoisonError::into_inner).take();
    outcome.unwrap_or(Ok(()))
}

/// A scan with the surfaces that are found in it.
fn read_room(scan: &Path, image: Option<&Path>) -> anyhow::Result<Room> {
    let recorded = RecordedRoom::from_cloud(scan, image)?;
    let finding = Finder::default().find(&recorded.cloud);
    let surfaces: Vec<_> = finding.surfaces.into_iter().map(|found| found.surface).collect();
    if surfaces.is_empty() {
        tracing::warn!("{}: no surface was found, so the match cannot be placed", scan.display());
    }
    Ok(Room { picture: recorded.picture, surfaces, up: finding.up.direction })
}

type Outcome = Arc<Mutex<Option<anyhow::Result<()>>>>;

/// The application and, when a script asked for it, somebody who watches it.
struct Window {
    app: PlayerApp,
    script: Option<Script>,
}

/// Plays, counts frames, takes the picture and closes.
struct Script {
    frames: u32,
    screenshot: Option<PathBuf>,
    shown: u32,
    last: Option<u32>,
    started: bool,
    asked: bool,
    picture: Arc<Mutex<Option<Arc<ColorImage>>>>,
    outcome: Outcome,
}

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        self.app.ui(ui, frame);
        if let Some(script) = &mut self.script {
            script.watch(ui.ctx(), &mut self.app);
        }
    }
}

impl Script {
    fn watch(&mut self, context: &egui::Context, app: &mut PlayerApp) {
        if let Some(problem) = app.session().problem() {
            self.finish(context, Err(anyhow!("{problem}")));
            return;
        }
        if !self.started && app.session().timeline().is_some() {
            app.play();
            self.started = true;
        }
        let shown = app.session().shown().map(|shown| shown.scene.clip_frame);
        if shown.is_some() && shown != self.last {
            self.last = shown;
            self.shown += 1;
        }
        let ended = self.shown > 1 && !app.session().is_playing() && !app.session().is_waiting();
        if self.shown < self.frames && !ended {
            context.request_repaint();
            return;
        }
        let Some(path) = &self.screenshot else {
            self.finish(context, Ok(()));
            return;
        };
        let picture = self.picture.lock().unwrap_or_else(PoisonError::into_inner).take();
        match picture {
            Some(picture) => {
                let [width, height] = picture.size.map(|side| side as u32);
                let saved =
                    image::save_buffer(path, picture.as_raw(), width, height, image::ColorType::Rgba8);
                let saved = saved.with_context(|| format!("{}: cannot be written", path.display()));
                self.finish(context, saved);
            }
            None if !self.asked => {
                self.asked = true;
                let (slot, wake) = (self.picture.clone(), context.clone());
                context.request_screenshot(move |picture| {
                    *slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(picture);
                    wake.request_repaint();
                });
                context.request_repaint();
            }
            None => context.request_repaint(),
        }
    }

    fn finish(&self, context: &egui::Context, result: anyhow::Result<()>) {
        self.outcome.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(result);
        context.send_viewport_cmd(ViewportCommand::Close);
    }
}
