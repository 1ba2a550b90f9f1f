//! One stream being watched: drives the playback state machine, builds the frames it shows and keeps the last good one.
//!
//! Owns no clock: the caller says what time it is. While a due frame is still being built the match's clock stands, so
//! that a machine too slow for every frame shows fewer of them, and not none.

use std::{
    collections::BTreeMap,
    hash::{BuildHasher, Hasher, RandomState},
    sync::Arc,
    time::Duration,
};

use protocol::{
    chunk::FrameQuality,
    content::AnyChunk,
    manifest::{Manifest, Segment},
    playback::{
        FailureKind, Playback, PlaybackConfig, PlaybackState, Request, RetryConfig, ShownFrame, Speed,
        Transfer,
    },
    time::Ticks,
};

use crate::{
    scene::FrameScene,
    source::{
        SourceError,
        loader::{Event, Fetched, FrameKey, FrameSource, Loader},
    },
    timeline::Timeline,
};

/// Frames built ahead of the play head.
const FRAMES_AHEAD: usize = 6;
/// Built frames kept, the ones ahead included.
const FRAMES_KEPT: usize = 24;
/// How long to wait before asking again for a stream, or for a chunk that was given up.
const RETRY_AFTER: Duration = Duration::from_secs(2);

/// The frame on show.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Where it lies in the stream.
    pub key: FrameKey,
    /// Its index in the stream, 0-based.
    pub frame: u32,
    /// How far it can be trusted.
    pub quality: FrameQuality,
    /// What it looks like.
    pub scene: Arc<FrameScene>,
}

/// A stream being watched.
pub struct Session {
    loader: Loader,
    manifest: Option<Manifest>,
    timeline: Option<Timeline>,
    playback: Option<Playback<AnyChunk>>,
    /// Where the caller's clock stood at the last update, and how far the match's clock is behind it.
    updated_at: Duration,
    lag: Duration,
    building: bool,
    state: PlaybackState,
    position: Ticks,
    /// What the playback asked for and has not got.
    requests: Vec<Request>,
    /// Whether the manifest of a live stream is being read again.
    reading_manifest: bool,
    frames: BTreeMap<FrameKey, Arc<FrameScene>>,
    broken_frames: BTreeMap<FrameKey, String>,
    wanted_frames: Vec<FrameKey>,
    shown: Option<Shown>,
    waiting: bool,
    problem: Option<String>,
    retry_at: Option<Duration>,
    stalls: u32,
}

impl Session {
    /// Watches what `loader` loads.
    #[must_use]
    pub fn new(loader: Loader) -> Self {
        Self {
            loader,
            manifest: None,
            timeline: None,
            playback: None,
            updated_at: Duration::ZERO,
            lag: Duration::ZERO,
            building: false,
            state: PlaybackState::Paused,
            position: Ticks(0),
            requests: Vec::new(),
            reading_manifest: false,
            frames: BTreeMap::new(),
            broken_frames: BTreeMap::new(),
            wanted_frames: Vec::new(),
            shown: None,
            waiting: true,
            problem: None,
            retry_at: None,
            stalls: 0,
        }
    }

    /// The stream's manifest, once it was read.
    #[must_use]
    pub fn manifest(&self) -> Option<&Manifest> {
        self.manifest.as_ref()
    }

    /// The shots and gaps of the match, as far as the stream tells them.
    #[must_use]
    pub fn segments(&self) -> &[Segment] {
        self.manifest.as_ref().map_or(&[], |manifest| &manifest.segments)
    }

    /// The timeline, once the first chunk was read.
    #[must_use]
    pub fn timeline(&self) -> Option<&Timeline> {
        self.timeline.as_ref()
    }

    /// Where the play head stands.
    #[must_use]
    pub fn position(&self) -> Ticks {
        self.position
    }

    /// Whether the match runs, or would if its data were there.
    #[must_use]
    pub fn is_playing(&self) -> bool {
        matches!(self.state, PlaybackState::Playing | PlaybackState::Buffering | PlaybackState::Failed)
    }

    /// How fast it runs.
    #[must_use]
    pub fn speed(&self) -> Speed {
        self.playback.as_ref().map_or(Speed::NORMAL, |playback| playback.speed())
    }

    /// The frame on show; the last good one while another is loading or missing.
    #[must_use]
    pub fn shown(&self) -> Option<&Shown> {
        self.shown.as_ref()
    }

    /// What is wrong at the moment, if anything, in words.
    #[must_use]
    pub fn problem(&self) -> Option<&str> {
        self.problem.as_deref()
    }

    /// Whether the frame under the play head is not there yet.
    #[must_use]
    pub fn is_waiting(&self) -> bool {
        self.waiting
    }

    /// How often playing had to wait for data.
    #[must_use]
    pub fn stalls(&self) -> u32 {
        self.stalls
    }

    /// Starts or stops.
    pub fn toggle(&mut self, now: Duration) {
        let now = self.match_clock(now);
        let playing = self.is_playing();
        if let Some(playback) = &mut self.playback {
            if playing { playback.pause(now) } else { playback.play(now) }
        }
    }

    /// Goes to a frame of the stream, 0-based.
    pub fn seek(&mut self, frame: u32, now: Duration) {
        let now = self.match_clock(now);
        if let (Some(playback), Some(timeline)) = (&mut self.playback, &self.timeline) {
            playback.seek(now, timeline.start_of(frame));
        }
    }

    /// Stops and moves by whole frames.
    pub fn step(&mut self, frames: i32, now: Duration) {
        let now = self.match_clock(now);
        let at_end = self.state == PlaybackState::Ended;
        if let (Some(playback), Some(timeline)) = (&mut self.playback, &self.timeline) {
            // At its end the playback stands behind the last frame; a step back means the frame before that one.
            if at_end {
                playback.seek(now, timeline.start_of(u32::MAX));
            }
            playback.step(now, frames);
        }
    }

    /// Plays at another speed.
    pub fn set_speed(&mut self, speed: Speed, now: Duration) {
        let now = self.match_clock(now);
        if let Some(playback) = &mut self.playback {
            playback.set_speed(now, speed);
        }
    }

    /// Takes in what was loaded, lets time pass, asks for what is needed next. Returns whether another frame is on
    /// show than before.
    pub fn update(&mut self, now: Duration) -> bool {
        let now = self.match_clock(now);
        while let Some(event) = self.loader.next_event() {
            self.take(event, now);
        }
        self.retry(now);
        let changed = self.show(now);
        self.request(now);
        changed
    }

    /// When to come back although nothing was loaded and nobody did anything; `None` for never.
    #[must_use]
    pub fn next_update(&self, now: Duration) -> Option<Duration> {
        let now = now.saturating_sub(self.lag);
        let playback = self.playback.as_ref().and_then(|playback| playback.poll_timeout(now));
        playback.into_iter().chain(self.retry_at).min().map(|at| at.saturating_sub(now))
    }

    /// The caller's clock without the time that was spent waiting for frames to be built.
    fn match_clock(&mut self, now: Duration) -> Duration {
        if self.building {
            self.lag += now.saturating_sub(self.updated_at);
        }
        self.updated_at = self.updated_at.max(now);
        now.saturating_sub(self.lag)
    }

    fn take(&mut self, event: Event, now: Duration) {
        match event {
            Event::Opened(manifest) => {
                // Every viewer waits a little differently before asking a server again that was away.
                let seed = RandomState::new().build_hasher().finish();
                let retry = RetryConfig { seed, ..RetryConfig::default() };
                let config = PlaybackConfig { retry, ..PlaybackConfig::default() };
                match Playback::new(&manifest, config) {
                    Ok(playback) => {
                        self.playback = Some(playback);
                        self.problem = None;
                    }
                    Err(error) => self.problem = Some(error.to_string()),
                }
                self.manifest = Some(*manifest);
            }
            Event::NotOpened(error) => {
                self.problem = Some(in_words(&error));
                self.retry_at = error.is_temporary().then(|| now + RETRY_AFTER);
            }
            Event::Chunk { request, result } => self.take_chunk(request, result, now),
            Event::Manifest(result) => self.take_manifest(result, now),
            Event::Frame { key, result: Ok(scene) } => {
                self.frames.insert(key, scene);
            }
            Event::Frame { key, result: Err(error) } => {
                tracing::warn!("{error}");
                self.broken_frames.insert(key, error.to_string());
            }
        }
    }

    /// Follows a stream that grows.
    fn take_manifest(&mut self, result: Result<Box<Manifest>, SourceError>, now: Duration) {
        self.reading_manifest = false;
        let Some(playback) = &mut self.playback else { return };
        let updated = match result {
            Ok(manifest) => {
                let updated = playback.update(now, &manifest).map_err(|error| error.to_string());
                updated.map(|_| manifest)
            }
            Err(error) => {
                playback.on_manifest_failure(now);
                Err(error.to_string())
            }
        };
        match updated {
            Ok(manifest) => {
                self.manifest = Some(*manifest);
                if let Some(timeline) = &mut self.timeline {
                    timeline.duration = playback.end() - playback.start();
                }
            }
            // It is read again soon; what is there goes on meanwhile.
            Err(problem) => tracing::warn!("{problem}"),
        }
    }

    fn take_chunk(&mut self, request: Request, result: Result<Fetched, SourceError>, now: Duration) {
        self.requests.retain(|waiting| *waiting != request);
        let Some(playback) = &mut self.playback else { return };
        match result {
            Ok(Fetched { chunk, bytes, fetch, finished }) => {
                if let (None, Some(manifest), Some(first)) =
                    (&self.timeline, &self.manifest, chunk.frames().first())
                {
                    let (start, end) = (playback.start(), playback.end());
                    let (timescale, frame) = (manifest.timescale, first.duration);
                    self.timeline = Some(Timeline { timescale, start, duration: end - start, frame });
                }
                // The loader's clock told on the match's clock.
                let finished = now.saturating_sub(finished.elapsed());
                let transfer = Transfer { bytes, started: finished.saturating_sub(fetch), finished };
                playback.on_chunk(now, request, chunk, transfer);
                self.problem = None;
            }
            Err(error) => {
                tracing::warn!("{error}");
                let words = in_words(&error);
                let kind = if error.is_temporary() { FailureKind::Unreachable } else { FailureKind::Corrupt };
                playback.on_failure(now, request, kind, words.clone());
                // A server that is away is worth saying at once; a broken chunk only when it is due.
                if kind == FailureKind::Unreachable {
                    self.problem = Some(words);
                }
            }
        }
    }

    /// Tries again what was given up because the server was away.
    fn retry(&mut self, now: Duration) {
        if self.retry_at.is_some_and(|at| now >= at) {
            self.retry_at = None;
            match &mut self.playback {
                Some(playback) => playback.seek(now, playback.position(now)),
                None => self.loader.retry(),
            }
        }
    }

    /// Puts the frame under the play head on show, if it is there.
    fn show(&mut self, now: Duration) -> bool {
        let Some(playback) = &mut self.playback else { return false };
        let view = playback.frame(now);
        (self.state, self.position) = (view.state, view.position);
        if let Some(failure) = &view.failure {
            self.problem = Some(failure.message.clone());
            if failure.kind == FailureKind::Unreachable && self.retry_at.is_none() {
                self.retry_at = Some(now + RETRY_AFTER);
            }
        }
        let was_waiting = std::mem::replace(&mut self.waiting, view.held && view.failure.is_none());
        self.building = false;
        let Some(due) = &view.shown else { return false };
        let key = FrameKey { chunk: due.chunk_index, frame: due.frame_index };
        self.want_frames(due);
        if !view.held {
            self.problem = self.broken_frames.get(&key).cloned();
        }
        let (Some(scene), Some(frame)) = (self.frames.get(&key), due.frame()) else {
            self.building = !self.broken_frames.contains_key(&key);
            self.waiting |= self.building;
            if self.waiting && !was_waiting && self.is_playing() {
                self.stalls += 1;
            }
            return false;
        };
        if self.shown.as_ref().is_some_and(|shown| shown.key == key) {
            return false;
        }
        let index = self.timeline.map_or(0, |timeline| timeline.frame_at(frame.start));
        self.shown = Some(Shown { key, frame: index, quality: frame.quality, scene: scene.clone() });
        true
    }

    /// Hands the playback's requests to the loader.
    fn request(&mut self, now: Duration) {
        let Some(playback) = &mut self.playback else { return };
        let before = (self.reading_manifest, self.requests.clone());
        self.reading_manifest |= playback.poll_manifest(now);
        self.requests.extend(std::iter::from_fn(|| playback.poll_request(now)));
        // What was given up, or asked for before a seek, need not be loaded any more.
        self.requests.retain(|request| playback.awaits(*request));
        if before != (self.reading_manifest, self.requests.clone()) {
            self.loader.want(self.reading_manifest, &self.requests);
        }
    }

    /// Has the frames from `due` on built, and forgets what is far away.
    fn want_frames(&mut self, due: &ShownFrame<AnyChunk>) {
        let Some(playback) = &self.playback else { return };
        let (here, first) = (due.chunk_index, due.frame_index);
        let ahead: Vec<(FrameKey, FrameSource)> = (here..=here + 1)
            .filter_map(|chunk| Some((chunk, playback.content(chunk)?)))
            .flat_map(|(chunk, (content, representation))| {
                let source = FrameSource { chunk: content.clone(), representation };
                (0..content.frames().len()).map(move |frame| (FrameKey { chunk, frame }, source.clone()))
            })
            .skip_while(|(key, _)| (key.chunk, key.frame) < (here, first))
            .take(FRAMES_AHEAD)
            .collect();
        if self.frames.len() > FRAMES_KEPT {
            self.frames.retain(|key, _| ahead.iter().any(|(wanted, _)| wanted == key));
        }
        let wanted: Vec<(FrameKey, FrameSource)> = ahead
            .into_iter()
            .filter(|(key, _)| !self.frames.contains_key(key) && !self.broken_frames.contains_key(key))
            .collect();
        let keys: Vec<FrameKey> = wanted.iter().map(|(key, _)| *key).collect();
        if keys != self.wanted_frames {
            self.loader.want_frames(wanted);
            self.wanted_frames = keys;
        }
    }
}

/// What to tell the person who watches.
fn in_words(error: &SourceError) -> String {
    if error.is_temporary() {
        format!("{error}. The last picture stays; trying again.")
    } else {
        error.to_string()
    }
}
