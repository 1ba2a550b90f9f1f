//! Somebody who watches a made-up match over a made-up link.

use std::{sync::Arc, time::Duration};

use super::{
    Action, FakeContent, FaultKind, Figures, Link, MadeUpMatch, TraceEvent, TraceLine,
    link::{Finished, Network},
};
use crate::{
    manifest::Manifest,
    playback::{
        FailureKind, FrameView, Playback, PlaybackConfig, PlaybackError, PlaybackState, Request, Transfer,
    },
    time::Ticks,
};

/// Round trips before the first request can be sent: TCP and TLS 1.3.
const SET_UP: u32 = 2;
/// Verifying and decoding a chunk.
const DECODING: Duration = Duration::from_millis(20);
/// Rounds without time passing that are one too many.
const ROUNDS: u32 = 50;

/// What is on the link.
#[derive(Clone, Copy, Debug)]
enum Item {
    Manifest,
    Chunk(Request),
}

/// See the module.
#[derive(Debug)]
pub struct Viewer {
    /// What is watched with.
    pub playback: Playback<FakeContent>,
    /// Since the address was opened.
    pub now: Duration,
    /// What happened.
    pub trace: Vec<TraceLine>,
    /// Whether fetches that are not waited for any more are stopped.
    pub stops_fetches: bool,
    world: MadeUpMatch,
    network: Network<Item>,
    /// Fetched and being decoded: when it is done.
    decoding: Vec<(Duration, Finished<Item>, Request)>,
    state: Option<PlaybackState>,
    sought_at: Option<Duration>,
    last_position: Ticks,
    shown_in: Vec<f64>,
    longest_seek: Option<Duration>,
    largest_latency: Option<Duration>,
    most_buffered_bytes: u64,
    busy: bool,
}

impl Viewer {
    /// Opens the address: connects, reads the manifest, lets time run.
    ///
    /// # Errors
    /// When there is nothing to play.
    pub fn open(world: MadeUpMatch, link: Link, config: PlaybackConfig) -> Result<Self, PlaybackError> {
        let mut network = Network::new(link);
        network.ask(Item::Manifest, json_bytes(&world.manifest_at(Duration::ZERO)), SET_UP);
        let mut now = Duration::ZERO;
        while let Some(next) = network.next_event() {
            now = next;
            if !network.advance(now).is_empty() {
                break;
            }
        }
        let manifest = world.manifest_at(now);
        let mut playback = Playback::new(&manifest, config)?;
        playback.play(now);
        let mut viewer = Self {
            last_position: playback.position(now),
            playback,
            now,
            trace: Vec::new(),
            stops_fetches: true,
            shown_in: vec![0.0; world.bits_per_second.len()],
            world,
            network,
            decoding: Vec::new(),
            state: None,
            sought_at: None,
            longest_seek: None,
            largest_latency: None,
            most_buffered_bytes: 0,
            busy: false,
        };
        viewer.note(TraceEvent::Manifest { chunks: manifest.representations[0].chunks.len() });
        Ok(viewer)
    }

    /// What the user does.
    pub fn act(&mut self, action: Action) {
        let now = self.now;
        self.note(TraceEvent::User(action));
        match action {
            Action::Play => self.playback.play(now),
            Action::Pause => self.playback.pause(now),
            Action::Seek(target) => self.playback.seek(now, target),
            Action::GoLive => self.playback.go_live(now),
            Action::SetSpeed(speed) => self.playback.set_speed(now, speed),
        }
        if matches!(action, Action::Seek(_) | Action::GoLive) {
            self.sought_at = Some(now);
            self.last_position = self.playback.position(now);
        }
    }

    /// Watches for a while.
    pub fn watch(&mut self, duration: Duration) {
        let until = self.now + duration;
        let mut rounds = 0;
        loop {
            self.exchange();
            self.look();
            if self.now >= until {
                return;
            }
            let decoded = self.decoding.iter().map(|(at, ..)| *at).min();
            let wake = self.playback.poll_timeout(self.now);
            let next = wake.into_iter().chain(self.network.next_event()).chain(decoded).min();
            let next = next.unwrap_or(until).min(until);
            rounds = if next > self.now { 0 } else { rounds + 1 };
            // A caller that cannot sleep would spin; here time is pushed on and the fault told.
            let next = if rounds > ROUNDS { self.now + Duration::from_millis(1) } else { next.max(self.now) };
            self.busy |= rounds > ROUNDS;
            self.now = next;
            for done in self.network.advance(next) {
                self.take(done);
            }
        }
    }

    /// How well it went so far.
    #[must_use]
    pub fn figures(&self, name: &str) -> Figures {
        let stats = self.playback.stats(self.now);
        let shown: f64 = self.shown_in.iter().sum();
        let ms = |duration: Duration| duration.as_secs_f64() * 1e3;
        let asked = |line: &&TraceLine| matches!(line.event, TraceEvent::Asked { .. });
        Figures {
            name: name.to_owned(),
            first_frame_ms: stats.first_frame_at.map(ms),
            stalls: stats.stalls,
            stalled_ms: ms(stats.stalled),
            switches: stats.switches,
            shown_in: self.shown_in.iter().map(|time| if shown > 0.0 { time / shown } else { 0.0 }).collect(),
            bytes: stats.bytes,
            requests: self.trace.iter().filter(asked).count(),
            longest_seek_ms: self.longest_seek.map(ms),
            bits_per_second: stats.bits_per_second,
            ahead_ms: ms(stats.ahead),
            most_buffered_bytes: self.most_buffered_bytes,
            latency_ms: stats.latency.map(ms),
            largest_latency_ms: self.largest_latency.map(ms),
            state: format!("{:?}", self.state.unwrap_or(PlaybackState::Paused)),
            busy: self.busy,
        }
    }

    /// Sends what is asked for, delivers what is decoded, stops what nobody waits for.
    fn exchange(&mut self) {
        let now = self.now;
        let (done, decoding) =
            std::mem::take(&mut self.decoding).into_iter().partition(|(at, ..)| *at <= now);
        self.decoding = decoding;
        let done: Vec<(Duration, Finished<Item>, Request)> = done;
        for (_, finished, request) in done {
            self.deliver(&finished, request);
        }
        if self.playback.poll_manifest(now) {
            self.network.ask(Item::Manifest, json_bytes(&self.world.manifest_at(now)), 0);
        }
        while let Some(request) = self.playback.poll_request(now) {
            let Request { chunk, representation, .. } = request;
            let manifest = self.world.manifest_at(now);
            let bytes = manifest.representations[representation].chunks[chunk].file.bytes;
            self.network.ask(Item::Chunk(request), bytes, 0);
            self.note(TraceEvent::Asked { chunk, representation });
        }
        if self.stops_fetches {
            let playback = &self.playback;
            let unwanted = |item: &Item| matches!(item, Item::Chunk(request) if !playback.awaits(*request));
            for item in self.network.stop(unwanted) {
                if let Item::Chunk(request) = item {
                    self.note(TraceEvent::Dropped { chunk: request.chunk });
                }
            }
        }
    }

    fn take(&mut self, done: Finished<Item>) {
        match done.what {
            Item::Manifest if done.fault.is_some() => self.playback.on_manifest_failure(self.now),
            Item::Manifest => {
                // What the server had when it was asked.
                let manifest = self.world.manifest_at(done.started);
                if self.playback.update(self.now, &manifest).is_ok_and(|grown| grown) {
                    self.note(TraceEvent::Manifest { chunks: manifest.representations[0].chunks.len() });
                }
            }
            Item::Chunk(request) if done.fault == Some(FaultKind::Error) => {
                self.fail(request, FailureKind::Unreachable, "the server answers 503");
            }
            Item::Chunk(request) => self.decoding.push((self.now + DECODING, done, request)),
        }
    }

    fn deliver(&mut self, done: &Finished<Item>, request: Request) {
        let Request { chunk, representation, .. } = request;
        if done.fault == Some(FaultKind::Corrupt) {
            self.fail(request, FailureKind::Corrupt, "its hash differs");
            return;
        }
        let transfer = Transfer { bytes: done.bytes, started: done.started, finished: done.finished };
        let content = Arc::new(self.world.content(chunk));
        self.playback.on_chunk(self.now, request, content, transfer);
        self.note(TraceEvent::Came { chunk, representation, took: done.finished - done.started });
    }

    fn fail(&mut self, request: Request, kind: FailureKind, message: &str) {
        self.playback.on_failure(self.now, request, kind, message.to_owned());
        self.note(TraceEvent::Failed { chunk: request.chunk, kind });
    }

    /// Looks at the picture.
    fn look(&mut self) {
        let FrameView { shown, position, state, held, .. } = self.playback.frame(self.now);
        if shown.is_some() && self.state.is_none() {
            self.note(TraceEvent::FirstFrame);
        }
        if self.state != Some(state) && shown.is_some() {
            self.state = Some(state);
            self.note(TraceEvent::State(state));
        }
        if !held && let Some(at) = self.sought_at.take() {
            self.longest_seek = self.longest_seek.max(Some(self.now - at));
        }
        let stats = self.playback.stats(self.now);
        self.most_buffered_bytes = self.most_buffered_bytes.max(stats.buffered_bytes);
        if state == PlaybackState::Playing {
            self.largest_latency = self.largest_latency.max(stats.latency);
        }
        if let Some(time) = shown.and_then(|shown| self.shown_in.get_mut(shown.representation)) {
            *time += (position - self.last_position).0.max(0) as f64;
        }
        self.last_position = position;
    }

    fn note(&mut self, event: TraceEvent) {
        self.trace.push(TraceLine { at: self.now, event });
    }
}

fn json_bytes(manifest: &Manifest) -> u64 {
    manifest.to_json().map_or(0, |json| json.len() as u64)
}
