//! One OpenXR session from its first event to its last: connects, obeys the runtime's states, and runs frames in between.

use std::{
    sync::atomic::Ordering,
    thread,
    time::{Duration, Instant},
};

use openxr::{
    Event, EventDataBuffer, FrameStream, FrameWaiter, Posef, ReferenceSpaceType, Session as XrSession, Space,
    Time, Vulkan,
};

use protocol::pitch::Pitch;

use super::{
    XrError,
    anchors::Anchors,
    eyes::Eyes,
    ffi::{graphics::Graphics, passthrough::CameraPicture},
    headset::{Headset, VIEWS},
    input::{Input, profile_in_use},
    lifecycle::{Action, Lifecycle},
    panel::Panel,
    panel_layer::PanelLayer,
    planes::{self, RuntimePlanes},
    room::{self, Rigid},
    run::{Show, XrOptions},
};
use crate::{
    camera::EyeView,
    renderer::{PictureFormat, Sight},
    scene::Stage,
};

/// How long scripts wait for the stream's first frame.
const SCRIPT_PATIENCE: Duration = Duration::from_secs(60);
/// Between two looks at the events of a session that is not running.
const IDLE: Duration = Duration::from_millis(10);

/// How a session ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ended {
    /// The user left, or the script has what it wanted.
    Left,
    /// The runtime took it away.
    Lost,
}

/// A space of the runtime that moves.
#[derive(Clone, Copy, Debug)]
struct SpaceChange {
    kind: ReferenceSpaceType,
    /// From this time of display on.
    from: Time,
    /// Its new origin in its old frame, when the runtime says so.
    origin: Option<Rigid>,
}

/// A headset with a session on it. Fields are dropped in this order: what hangs on the session before the session.
pub(super) struct Connection {
    pub(super) eyes: Option<Eyes>,
    /// The pitch that the eyes' pictures were built for.
    pub(super) pitch: Pitch,
    pub(super) panel: PanelLayer,
    pub(super) camera_picture: Option<CameraPicture>,
    pub(super) planes: Option<Box<dyn RuntimePlanes>>,
    pub(super) anchors: Anchors,
    /// Spaces that are going to move.
    changes: Vec<SpaceChange>,
    pub(super) input: Input,
    pub(super) space: Space,
    pub(super) waiter: FrameWaiter,
    pub(super) stream: FrameStream<Vulkan>,
    pub(super) session: XrSession<Vulkan>,
    pub(super) graphics: Graphics,
    pub(super) headset: Headset,
    pub(super) life: Lifecycle,
    pub(super) uploaded: bool,
    pub(super) last_eyes: Option<[EyeView; 2]>,
    /// The runtime's time that is the zero of the match's clock, nanoseconds.
    pub(super) clock_zero_ns: Option<i64>,
    leaving: bool,
}

impl Connection {
    /// Connects; the session begins when the runtime is ready.
    pub(super) fn open(show: &mut Show, options: &XrOptions) -> Result<Self, XrError> {
        let headset = Headset::find()?;
        let graphics = Graphics::open(&headset.instance, headset.system)?;
        let (session, waiter, stream) = graphics.create_session(&headset.instance, headset.system)?;
        let space = session.create_reference_space(ReferenceSpaceType::LOCAL, Posef::IDENTITY)?;
        let input = Input::new(&headset, &session)?;
        let panel = PanelLayer::new(&graphics, &session)?;
        let planes = planes::source(&headset, &session)?;
        let anchors = Anchors::new(&headset, &session)?;
        let camera_picture =
            headset.mixing.camera_layer.then(|| CameraPicture::start(&session)).transpose()?;
        if headset.mixing.sight() == Sight::RoomPlusLight {
            tracing::warn!("{} adds light to the room: no shadow falls on the real table", headset.runtime);
        }
        let figures = &mut show.figures;
        figures.runtime.clone_from(&headset.runtime);
        figures.headset.clone_from(&headset.name);
        figures.adapter.clone_from(&graphics.adapter);
        figures.blend_mode = format!("{:?}", headset.mixing.blend_mode);
        figures.multiview = graphics.views_per_pass(options.samples) == 2;
        figures.samples = options.samples;
        figures.plane_source = planes.as_ref().map_or("none", |planes| planes.name()).to_owned();
        figures.anchor = anchors.name().to_owned();
        figures.sessions += 1;
        // The new session's pictures know nothing of the letters that the old one's had.
        show.panel = Panel::default();
        show.panel_stale = true;
        Ok(Self {
            eyes: None,
            pitch: show.pitch(),
            panel,
            camera_picture,
            planes,
            anchors,
            changes: Vec::new(),
            input,
            space,
            waiter,
            stream,
            session,
            graphics,
            headset,
            life: Lifecycle::default(),
            uploaded: false,
            last_eyes: None,
            clock_zero_ns: None,
            leaving: false,
        })
    }

    /// Shows the match until the session ends.
    pub(super) fn show(&mut self, show: &mut Show, options: &XrOptions) -> Result<Ended, XrError> {
        let begun = Instant::now();
        // Compiling shaders takes a while: better now than in a frame.
        self.prepare(show, options, false)?;
        loop {
            if let Some(ended) = self.take_events()? {
                return Ok(ended);
            }
            if !self.life.is_running() {
                show.player.update(show.now());
                thread::sleep(IDLE);
                continue;
            }
            if self.leaving {
                self.idle_frame()?;
                continue;
            }
            self.frame(show, options)?;
            if let Some(wanted) = options.exit_after_frames {
                if show.log.frames >= u64::from(wanted) {
                    self.leaving = true;
                    self.session.request_exit()?;
                } else if show.log.frames == 0 && begun.elapsed() > SCRIPT_PATIENCE {
                    let problem = show.player.problem().unwrap_or("no frame of the match within a minute");
                    return Err(XrError::Stream(problem.to_owned()));
                }
            }
        }
    }

    /// Takes in what the runtime reports.
    fn take_events(&mut self) -> Result<Option<Ended>, XrError> {
        let mut buffer = EventDataBuffer::new();
        while let Some(event) = self.headset.instance.poll_event(&mut buffer)? {
            let action = match event {
                Event::SessionStateChanged(change) => {
                    tracing::info!("session: {:?}", change.state());
                    self.life.on_state(change.state())
                }
                Event::InstanceLossPending(_) => Action::Rebuild,
                Event::UserPresenceChangedEXT(change) => {
                    tracing::info!(
                        "headset {}",
                        if change.is_user_present() { "put on" } else { "taken off" }
                    );
                    self.life.on_presence(change.is_user_present());
                    Action::Continue
                }
                Event::ReferenceSpaceChangePending(change) => {
                    let origin = change.pose_valid().then(|| room::rigid(change.pose_in_previous_space()));
                    let (kind, from) = (change.reference_space_type(), change.change_time());
                    self.changes.push(SpaceChange { kind, from, origin });
                    Action::Continue
                }
                Event::SpatialDiscoveryRecommendedEXT(_) => {
                    if let Some(planes) = &mut self.planes {
                        planes.look();
                    }
                    Action::Continue
                }
                Event::InteractionProfileChanged(_) => {
                    for hand in ["/user/hand/left", "/user/hand/right"] {
                        let profile = profile_in_use(&self.headset.instance, &self.session, hand);
                        tracing::info!("{hand}: {}", profile.as_deref().unwrap_or("nothing"));
                    }
                    Action::Continue
                }
                Event::EventsLost(lost) => {
                    tracing::warn!("the runtime dropped {} events", lost.lost_event_count());
                    Action::Continue
                }
                _ => Action::Continue,
            };
            match action {
                Action::Continue => {}
                Action::Begin => {
                    self.session.begin(VIEWS)?;
                }
                Action::End => {
                    self.session.end()?;
                }
                Action::Exit => return Ok(Some(Ended::Left)),
                Action::Rebuild => return Ok(Some(Ended::Lost)),
            }
        }
        Ok(None)
    }

    /// Lets the match stay where it is for the viewer when a space moves in a frame that is shown at `time`.
    pub(super) fn move_spaces(&mut self, show: &mut Show, time: Time, now: Duration) {
        let due = |change: &SpaceChange| change.from.as_nanos() <= time.as_nanos();
        for change in self.changes.extract_if(.., |change| due(change)).collect::<Vec<_>>() {
            tracing::info!("the {:?} space has moved: {:?}", change.kind, change.origin);
            if self.anchors.space_changed(change.kind, change.origin) {
                tracing::warn!("the runtime does not say how far: the match may stand somewhere else now");
            }
            if let (ReferenceSpaceType::LOCAL, Some(origin)) = (change.kind, change.origin) {
                show.recentred(origin, now);
            }
        }
    }

    /// A frame without pictures, as the runtime demands while it takes its leave.
    fn idle_frame(&mut self) -> Result<(), XrError> {
        let state = self.waiter.wait()?;
        self.stream.begin()?;
        Ok(self.stream.end(state.predicted_display_time, self.headset.mixing.blend_mode, &[])?)
    }

    pub(super) fn graphics(&self) -> &Graphics {
        &self.graphics
    }

    /// The eyes of the last frame.
    pub(super) fn last_eyes(&self) -> Option<[EyeView; 2]> {
        self.last_eyes
    }

    /// What the user sees beside the pictures.
    pub(super) fn sight(&self) -> Sight {
        self.headset.mixing.sight()
    }

    pub(super) fn format(&self) -> PictureFormat {
        self.eyes.as_ref().map_or_else(PictureFormat::default, |eyes| eyes.format)
    }

    /// What the match stands on: without a view of the room also a table top.
    pub(super) fn stage(&self, show: &Show) -> Stage {
        if self.headset.mixing.sees_room() {
            Stage::on_real_table(show.pitch())
        } else {
            Stage::new(show.pitch())
        }
    }

    /// Mistakes that the graphics library has found so far.
    pub(super) fn graphics_errors(&self) -> u64 {
        self.graphics.errors.load(Ordering::Relaxed)
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        // Nothing of the runtime's may be in use by the GPU when it is given back.
        let _ = self.graphics.device.poll(wgpu::PollType::wait_indefinitely());
    }
}
