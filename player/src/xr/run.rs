//! The match on a headset from start to end: connects, shows frames, and connects again when the headset was lost.
//!
//! The stream, the play head and the place of the match live here, outside the OpenXR session, and survive its loss.

use std::{
    path::PathBuf,
    thread,
    time::{Duration, Instant},
};

use protocol::pitch::Pitch;
use serde::Serialize;

use super::{
    XrError,
    connection::{Connection, Ended},
    cost::{self, Cost},
    figures::{FrameRecord, Spread},
    follow::Follow,
    frame_log::FrameLog,
    headset::Headset,
    lifecycle::PlayGuard,
    panel::{Panel, PanelPointer, PanelPose},
    room::Rigid,
    table::Table,
};
use crate::{scene::Layout, session::Session};

/// How long a lost headset is waited for.
const WAIT_FOR_RETURN: Duration = Duration::from_secs(60);
const TRY_EVERY: Duration = Duration::from_millis(500);

/// How the match is shown, and what scripts want to know.
#[derive(Clone, Debug)]
pub struct XrOptions {
    /// Leave after this many frames with the match on show.
    pub exit_after_frames: Option<u32>,
    /// Stand at this frame of the match instead of playing.
    pub frame: Option<u32>,
    /// Put the match on the first table that is found, without a hand.
    pub place: bool,
    /// Folder for the pictures of both eyes of the last frame.
    pub capture: Option<PathBuf>,
    /// Share of the size that the runtime recommends for the pictures.
    pub resolution_scale: f64,
    /// Samples per pixel: 1 or 4.
    pub samples: u32,
    /// Keep a record of every frame.
    pub trace: bool,
    /// Compare the cost of one view and of two before leaving.
    pub compare_cost: bool,
}

/// What was measured.
#[derive(Clone, Debug, Default, Serialize)]
pub struct XrFigures {
    /// The runtime's name and version.
    pub runtime: String,
    /// The headset's name.
    pub headset: String,
    /// The GPU's name.
    pub adapter: String,
    /// Width of one eye's picture.
    pub width_px: u32,
    /// Its height.
    pub height_px: u32,
    /// Samples per pixel.
    pub samples: u32,
    /// Whether both eyes are drawn in one pass.
    pub multiview: bool,
    /// How the pictures mix with the room.
    pub blend_mode: String,
    /// Where the planes of the room come from.
    pub plane_source: String,
    /// What keeps the match in its place: an anchor of the runtime, or one of its spaces.
    pub anchor: String,
    /// How often the runtime corrected that place.
    pub anchor_corrections: u32,
    /// How often the room's frame was moved, by the user or by the runtime.
    pub frame_moves: u32,
    /// Level planes that the source has reported last.
    pub planes: usize,
    /// Whether the match stands on one of them.
    pub on_a_plane: bool,
    /// Frames drawn for both eyes.
    pub frames: u64,
    /// Periods of the display that passed without a frame of ours.
    pub dropped_frames: u64,
    /// Period of the display, milliseconds.
    pub display_period_ms: f64,
    /// Processor time of the frame loop's thread per frame.
    pub frame_cpu: Spread,
    /// Wall time of a frame outside the runtime's calls.
    pub frame_own: Spread,
    /// Wall time of a frame inside the runtime's calls: its pacing, its images, the GPU's backlog.
    pub frame_runtime: Spread,
    /// Frames during which the match waited for data.
    pub stalled_frames: u64,
    /// Wall time of those frames outside the runtime's calls.
    pub stalled_frame_own: Spread,
    /// One view against two.
    pub cost: Option<Cost>,
    /// Mistakes that the graphics library found in what the player asked of it.
    pub graphics_errors: u64,
    /// Sessions begun: more than one after a loss.
    pub sessions: u32,
    /// Sessions or instances lost.
    pub losses: u32,
    /// Every frame (the first 110,000), when asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub trace: Vec<FrameRecord>,
}

/// What outlives a session.
pub(super) struct Show {
    pub(super) player: Session,
    pub(super) table: Table,
    pub(super) follow: Follow,
    pub(super) panel: Panel,
    pub(super) panel_pose: Option<PanelPose>,
    pub(super) pointer: PanelPointer,
    /// What the panel says of the surface that is pointed at.
    pub(super) hint: Option<String>,
    /// Whether the panel has to be drawn although nothing points at it.
    pub(super) panel_stale: bool,
    pub(super) guard: PlayGuard,
    pub(super) log: FrameLog,
    pub(super) figures: XrFigures,
    pub(super) started: Instant,
    pub(super) has_started_playing: bool,
}

impl Show {
    fn new(player: Session) -> Self {
        Self {
            player,
            table: Table::new(Pitch::default()),
            follow: Follow::default(),
            panel: Panel::default(),
            panel_pose: None,
            pointer: PanelPointer::default(),
            hint: None,
            panel_stale: true,
            guard: PlayGuard::default(),
            log: FrameLog::default(),
            figures: XrFigures::default(),
            started: Instant::now(),
            has_started_playing: false,
        }
    }

    /// The match's clock between sessions and before the first frame.
    pub(super) fn now(&self) -> Duration {
        self.started.elapsed()
    }

    /// The stream's pitch, or the usual one before it is known.
    pub(super) fn pitch(&self) -> Pitch {
        self.player.manifest().map_or_else(Pitch::default, |manifest| manifest.pitch)
    }

    /// Half length and half width of the turf, metres of the pitch.
    pub(super) fn half_turf_m(&self) -> [f64; 2] {
        Layout::around(self.pitch()).half_turf_m
    }

    /// The room frame has moved: its new origin in the old frame.
    pub(super) fn recentred(&mut self, (place_m, turn): Rigid, now: Duration) {
        self.figures.frame_moves += 1;
        self.table.recentred(place_m, turn, now);
        self.panel_pose = None;
    }
}

/// Shows what `player` plays until the user leaves or the options say so.
pub fn run(player: Session, options: &XrOptions) -> Result<XrFigures, XrError> {
    let mut show = Show::new(player);
    loop {
        let ended = Connection::open(&mut show, options).and_then(|mut connection| {
            let ended = connection.show(&mut show, options);
            show.figures.graphics_errors += connection.graphics_errors();
            let ended = ended?;
            if ended == Ended::Left && options.compare_cost {
                show.figures.cost = cost::compare(&connection, &show)?;
            }
            Ok(ended)
        });
        match ended {
            Ok(Ended::Left) => return Ok(finish(show)),
            Ok(Ended::Lost) => wait_for_return(&mut show, "the session was lost")?,
            Err(error) if error.is_loss() && show.figures.sessions > 0 => {
                wait_for_return(&mut show, &error.to_string())?;
            }
            Err(error) => return Err(error),
        }
    }
}

/// Pauses the match and waits until a headset is there again.
fn wait_for_return(show: &mut Show, reason: &str) -> Result<(), XrError> {
    show.figures.losses += 1;
    tracing::warn!("{reason}: waiting for the headset to come back");
    let lost = Instant::now();
    loop {
        let now = show.now();
        if show.guard.toggles(false, show.player.is_playing()) {
            show.player.toggle(now);
        }
        show.player.update(now);
        thread::sleep(TRY_EVERY);
        match Headset::find() {
            Ok(_) => return Ok(()),
            Err(error) if lost.elapsed() > WAIT_FOR_RETURN => {
                let reason = format!("{reason}; now: {error}");
                return Err(XrError::Gone { seconds: WAIT_FOR_RETURN.as_secs(), reason });
            }
            Err(error) => tracing::debug!("not yet: {error}"),
        }
    }
}

fn finish(show: Show) -> XrFigures {
    let Show { mut figures, log, .. } = show;
    figures.frames = log.frames;
    figures.dropped_frames = log.dropped;
    figures.frame_cpu = log.cpu.spread();
    figures.frame_own = log.own.spread();
    figures.frame_runtime = log.runtime.spread();
    figures.stalled_frames = log.stalled;
    figures.stalled_frame_own = log.stalled_own.spread();
    figures.trace = log.trace;
    figures
}
