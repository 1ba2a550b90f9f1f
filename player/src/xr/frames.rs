//! A frame of the headset: wait for the runtime, let the match run to the predicted time of display, see what hands and head
//! do, draw both eyes and the panel, hand the pictures over.
//!
//! Nothing in it waits for a file, the network or the decoder: they have threads of their own. What the runtime's calls
//! take is measured apart, as pacing and the GPU's backlog are in them.

use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use glam::{DQuat, DVec3};
use openxr::{
    CompositionLayerBase, CompositionLayerFlags, CompositionLayerProjection, FrameState, Time,
    ViewStateFlags, Vulkan,
};

use super::{
    XrError,
    anchors::Moved,
    connection::Connection,
    eyes::{Eyes, IMAGE_TIMEOUT_NS},
    ffi::clock::thread_cpu_time,
    figures::{FrameRecord, milliseconds},
    follow,
    headset::VIEWS,
    input::HandState,
    panel::{PanelPointer, PanelPose},
    room,
    run::{Show, XrOptions},
    table::Table,
};
use crate::session::Session;

/// Where time goes in a frame.
struct Watch {
    begun: Instant,
    cpu: Duration,
    /// Spent in calls of the runtime since `begun`, and in waiting for it before.
    in_runtime: Duration,
    waited: Duration,
    /// Spent on what only scripts ask for.
    aside: Duration,
}

impl Watch {
    /// Starts after the runtime has let the frame begin.
    fn start(waited: Duration) -> Self {
        let none = Duration::ZERO;
        Self { begun: Instant::now(), cpu: thread_cpu_time(), in_runtime: none, waited, aside: none }
    }

    /// A call of the runtime.
    fn runtime<T>(&mut self, call: impl FnOnce() -> openxr::Result<T>) -> Result<T, XrError> {
        let begun = Instant::now();
        let result = call();
        self.in_runtime += begun.elapsed();
        Ok(result?)
    }

    fn record(&self, time: Time, player: &Session, uploaded: bool, centre_m: DVec3) -> FrameRecord {
        FrameRecord {
            centre_m: centre_m.into(),
            predicted_display_ns: time.as_nanos(),
            cpu_ms: milliseconds(thread_cpu_time().saturating_sub(self.cpu)),
            own_ms: milliseconds(self.begun.elapsed().saturating_sub(self.in_runtime + self.aside)),
            runtime_ms: milliseconds(self.waited + self.in_runtime),
            match_frame: player.shown().map(|shown| shown.frame),
            stalled: player.is_waiting(),
            uploaded,
        }
    }
}

impl Connection {
    /// One frame.
    pub(super) fn frame(&mut self, show: &mut Show, options: &XrOptions) -> Result<(), XrError> {
        let waiting = Instant::now();
        let state = self.waiter.wait()?;
        let mut watch = Watch::start(waiting.elapsed());
        let (time, blend_mode) = (state.predicted_display_time, self.headset.mixing.blend_mode);
        watch.runtime(|| self.stream.begin())?;
        let now = self.match_time(&state, show.started);
        let changed = self.play(show, options, now);
        let (flags, located) = watch.runtime(|| self.session.locate_views(VIEWS, time, &self.space))?;
        let Ok(located) = <[openxr::View; 2]>::try_from(located) else {
            return Err(XrError::NoRuntime("it locates a number of views that is not two".to_owned()));
        };
        self.move_spaces(show, time, now);
        show.table.tracked(flags.contains(ViewStateFlags::POSITION_VALID), now);
        if !state.should_render || !flags.contains(ViewStateFlags::ORIENTATION_VALID) {
            return watch.runtime(|| self.stream.end(time, blend_mode, &[]));
        }
        self.prepare(show, options, changed)?;
        let head = room::head(&located);
        let began = Instant::now();
        let hands = self.sense(show, options, time, head, now)?;
        // Reading hands and planes is the runtime's work but for a few vectors.
        watch.in_runtime += began.elapsed();
        self.interact(show, hands, head, changed, now, &mut watch)?;

        let looking = [0, 1].map(|eye| room::eye(&located[eye]));
        self.last_eyes = Some(looking);
        let Some(eyes) = &mut self.eyes else { return Ok(()) };
        let image = watch.runtime(|| eyes.images.swapchain.acquire_image())? as usize;
        watch.runtime(|| eyes.images.swapchain.wait_image(openxr::Duration::from_nanos(IMAGE_TIMEOUT_NS)))?;
        eyes.draw(&self.graphics, image, &show.table, &show.table.scene(&show.follow), &looking)?;
        let on_show = shows_the_match(&show.player, options) && is_still(&show.table, options);
        let last = options.exit_after_frames.is_some_and(|wanted| show.log.frames + 1 >= u64::from(wanted));
        if let (true, true, Some(folder)) = (last, on_show, &options.capture) {
            let began = Instant::now();
            save(folder, &eyes.read_back(&self.graphics, image)?)?;
            watch.aside += began.elapsed();
        }
        watch.runtime(|| eyes.images.swapchain.release_image())?;

        let projected = eyes.layers(&located);
        let seen_through = if self.headset.mixing.sees_room() {
            CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA
        } else {
            CompositionLayerFlags::EMPTY
        };
        let world =
            CompositionLayerProjection::new().layer_flags(seen_through).space(&self.space).views(&projected);
        let quad = show.panel_pose.and_then(|pose| self.panel.layer(&self.space, &pose));
        let mut layers: Vec<&CompositionLayerBase<'_, Vulkan>> = Vec::with_capacity(3);
        if let Some(camera) = &self.camera_picture {
            layers.push(camera.layer());
        }
        layers.push(&world);
        if let Some(quad) = &quad {
            layers.push(quad);
        }
        watch.runtime(|| self.stream.end(time, blend_mode, &layers))?;
        if on_show {
            let period_ns = u64::try_from(state.predicted_display_period.as_nanos()).unwrap_or_default();
            show.figures.display_period_ms = period_ns as f64 / 1e6;
            (show.figures.planes, show.figures.on_a_plane) = show.table.stands();
            let centre_m = show.follow.applied(&show.table.pose()).position_m;
            let record = watch.record(time, &show.player, changed, centre_m);
            show.log.add(record, Duration::from_nanos(period_ns), options.trace);
        }
        Ok(())
    }

    /// The time that the match is at when this frame is seen: the runtime's prediction, on a clock that started with the
    /// program.
    fn match_time(&mut self, state: &FrameState, started: Instant) -> Duration {
        let predicted_ns = state.predicted_display_time.as_nanos();
        let elapsed_ns = i64::try_from(started.elapsed().as_nanos()).unwrap_or(i64::MAX);
        let zero = *self.clock_zero_ns.get_or_insert(predicted_ns.saturating_sub(elapsed_ns));
        Duration::from_nanos(u64::try_from(predicted_ns.saturating_sub(zero)).unwrap_or_default())
    }

    /// Lets the match run, stop or stand as the session and the options want it. Returns whether its frame changed.
    fn play(&mut self, show: &mut Show, options: &XrOptions, now: Duration) -> bool {
        let changed = show.player.update(now);
        if show.player.timeline().is_some() && !show.has_started_playing {
            show.has_started_playing = true;
            match options.frame {
                Some(frame) => show.player.seek(frame, now),
                None => show.player.toggle(now),
            }
        }
        if show.guard.toggles(self.life.is_watched(), show.player.is_playing()) {
            show.player.toggle(now);
        }
        changed
    }

    /// Builds the eyes' pictures, again when the stream's pitch turns out to be another, and uploads the frame on show.
    pub(super) fn prepare(
        &mut self,
        show: &mut Show,
        options: &XrOptions,
        changed: bool,
    ) -> Result<(), XrError> {
        let pitch = show.pitch();
        if self.eyes.is_none() || self.pitch != pitch {
            self.pitch = pitch;
            self.uploaded = false;
            // The GPU may still draw into the pictures that are about to go.
            let _ = self.graphics.device.poll(wgpu::PollType::wait_indefinitely());
            let scaled = |recommended: u32, most: u32| {
                ((f64::from(recommended) * options.resolution_scale).round() as u32).clamp(1, most.max(1))
            };
            let (recommended, most) = (self.headset.recommended_px, self.headset.most_px);
            let size = (scaled(recommended.0, most.0), scaled(recommended.1, most.1));
            (show.figures.width_px, show.figures.height_px) = size;
            let around = (self.headset.mixing.surroundings, self.sight());
            let stage = self.stage(show);
            let eyes = Eyes::new(&self.graphics, &self.session, &stage, size, options.samples, around)?;
            self.eyes = Some(eyes);
        }
        if let (Some(eyes), Some(shown), true) =
            (&mut self.eyes, show.player.shown(), changed || !self.uploaded)
        {
            eyes.upload(&self.graphics, &shown.scene);
            self.uploaded = true;
        }
        Ok(())
    }

    /// What the runtime knows of planes and hands.
    fn sense(
        &mut self,
        show: &mut Show,
        options: &XrOptions,
        time: Time,
        head: (DVec3, DQuat),
        now: Duration,
    ) -> Result<[HandState; 2], XrError> {
        if let Some(planes) = &mut self.planes {
            planes.set_time(time);
            if let Some(surfaces) = planes.poll(now) {
                show.table.know(surfaces, options.place, now);
            }
        }
        let wanted = show.table.anchor();
        match self.anchors.update(&self.session, wanted, (&self.space, time), now)? {
            Some(Moved::Anchor(generation, place)) => {
                show.figures.anchor_corrections += 1;
                show.table.anchor_moved(generation, place, now);
            }
            Some(Moved::Frame(origin)) => show.recentred(origin, now),
            None => {}
        }
        self.anchors.name().clone_into(&mut show.figures.anchor);
        if self.life.has_input() {
            self.input.read(&self.session, &self.space, time, head)
        } else {
            Ok([HandState::default(); 2])
        }
    }

    /// Lets hands press the panel or move the match.
    fn interact(
        &mut self,
        show: &mut Show,
        hands: [HandState; 2],
        head: (DVec3, DQuat),
        changed: bool,
        now: Duration,
        watch: &mut Watch,
    ) -> Result<(), XrError> {
        let pose = show.table.pose();
        let panel_pose = PanelPose::beside(&pose, show.half_turf_m(), head.0, show.panel_pose);
        show.panel_pose = Some(panel_pose);
        let at = hands.map(|hand| hand.ray.and_then(|(origin, direction)| panel_pose.hit(origin, direction)));
        let slide_m = show.follow.slide_m(&pose);
        show.table.follow(head, hands, at.map(|at| at.is_some()), slide_m, now);
        // The right hand first: two rays on one panel are one too many.
        let pointer = [1, 0]
            .into_iter()
            .find_map(|hand| at[hand].map(|at| PanelPointer { at: Some(at), pressed: hands[hand].select }))
            .unwrap_or_default();
        // While a place is chosen the whole pitch is shown there.
        let middle_m = if show.table.is_placed() {
            show.player.shown().and_then(|shown| follow::ball(&shown.scene))
        } else {
            Some(DVec3::ZERO)
        };
        show.follow.advance(middle_m, now);
        let hint = show.table.hint();
        let stale = changed || pointer != show.pointer || hint != show.hint || show.panel_stale;
        (show.pointer, show.hint) = (pointer, hint);
        if stale {
            let output =
                show.panel.run(&mut show.player, &mut show.follow.on, show.hint.as_deref(), pointer, now);
            let in_runtime = self.panel.draw(&self.graphics, &show.panel, output)?;
            watch.in_runtime += in_runtime;
            show.panel_stale = false;
        }
        Ok(())
    }
}

/// Whether the wanted frame is on show: any, or the one that the options name.
fn shows_the_match(player: &Session, options: &XrOptions) -> bool {
    match (player.shown(), options.frame) {
        (Some(shown), Some(frame)) => {
            shown.frame == frame.min(player.timeline().map_or(0, |timeline| timeline.frames() - 1))
        }
        (shown, _) => shown.is_some(),
    }
}

/// Whether a picture can be taken: the match fades in first.
fn is_still(table: &Table, options: &XrOptions) -> bool {
    options.frame.is_none() || table.is_settled()
}

fn save(folder: &Path, [left, right]: &[image::RgbaImage; 2]) -> Result<(), XrError> {
    let failed = |path: &Path, reason: String| XrError::Write { path: path.display().to_string(), reason };
    fs::create_dir_all(folder).map_err(|error| failed(folder, error.to_string()))?;
    for (name, picture) in [("left.png", left), ("right.png", right)] {
        let path = folder.join(name);
        picture.save(&path).map_err(|error| failed(&path, error.to_string()))?;
    }
    Ok(())
}
