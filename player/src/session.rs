//! One stream being watched: the play head, what is loaded around it, and the frame on show.
//!
//! Owns no clock: the caller says what time it is. A frame that cannot be had leaves the last good one on show.

use std::{collections::BTreeMap, sync::Arc};

use protocol::{
    chunk::{Chunk, FrameQuality},
    manifest::Manifest,
    time::Ticks,
};

use crate::{
    scene::FrameScene,
    source::{
        SourceError,
        loader::{Event, FrameKey, Loader},
    },
    timeline::{Nanoseconds, PlayHead, Speed, Timeline},
};

/// Frames built ahead of the play head.
const FRAMES_AHEAD: usize = 6;
/// Built frames kept, the ones ahead included.
const FRAMES_KEPT: usize = 24;
/// Chunks kept around the play head.
const CHUNKS_KEPT: usize = 6;
/// How long to wait before asking a server again that was away.
const RETRY_AFTER: Nanoseconds = 2_000_000_000;

/// The frame on show.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Where it lies in the stream.
    pub key: FrameKey,
    /// When it starts.
    pub start: Ticks,
    /// Its index in the stream, 0-based.
    pub frame: u32,
    /// How far it can be trusted.
    pub quality: FrameQuality,
    /// What it looks like.
    pub scene: Arc<FrameScene>,
}

/// A problem, in words for the person who watches.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// What is wrong and what to do.
    pub message: String,
    /// When to try again, if that may help.
    retry_at: Option<Nanoseconds>,
}

/// A stream being watched.
pub struct Session {
    loader: Loader,
    manifest: Option<Manifest>,
    timeline: Option<Timeline>,
    head: PlayHead,
    chunks: BTreeMap<usize, Arc<Chunk>>,
    frames: BTreeMap<FrameKey, Arc<FrameScene>>,
    broken: BTreeMap<FrameKey, String>,
    broken_chunks: BTreeMap<usize, String>,
    shown: Option<Shown>,
    problem: Option<Problem>,
    wanted_chunks: Vec<usize>,
    wanted_frames: Vec<FrameKey>,
    waiting: bool,
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
            head: PlayHead::default(),
            chunks: BTreeMap::new(),
            frames: BTreeMap::new(),
            broken: BTreeMap::new(),
            broken_chunks: BTreeMap::new(),
            shown: None,
            problem: None,
            wanted_chunks: Vec::new(),
            wanted_frames: Vec::new(),
            waiting: false,
            stalls: 0,
        }
    }

    /// The stream's manifest, once it was read.
    #[must_use]
    pub fn manifest(&self) -> Option<&Manifest> {
        self.manifest.as_ref()
    }

    /// The timeline, once the first chunk was read.
    #[must_use]
    pub fn timeline(&self) -> Option<&Timeline> {
        self.timeline.as_ref()
    }

    /// The play head.
    #[must_use]
    pub fn head(&self) -> &PlayHead {
        &self.head
    }

    /// The frame on show; the last good one while another is loading or missing.
    #[must_use]
    pub fn shown(&self) -> Option<&Shown> {
        self.shown.as_ref()
    }

    /// What is wrong at the moment, if anything.
    #[must_use]
    pub fn problem(&self) -> Option<&str> {
        self.problem.as_ref().map(|problem| problem.message.as_str())
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
    pub fn toggle(&mut self, now: Nanoseconds) {
        let Some(timeline) = &self.timeline else { return };
        if self.head.is_playing() { self.head.pause() } else { self.head.play(timeline, now) }
    }

    /// Goes to a frame of the stream, 0-based.
    pub fn seek(&mut self, frame: u32, now: Nanoseconds) {
        if let Some(timeline) = &self.timeline {
            self.head.seek(timeline, frame, now);
        }
    }

    /// Stops and moves by whole frames.
    pub fn step(&mut self, frames: i64) {
        if let Some(timeline) = &self.timeline {
            self.head.step(timeline, frames);
        }
    }

    /// Plays at another speed.
    pub fn set_speed(&mut self, speed: Speed, now: Nanoseconds) {
        self.head.set_speed(speed, now);
    }

    /// Takes in what was loaded, moves the head, asks for what is needed next. Returns whether another frame is on
    /// show than before.
    pub fn update(&mut self, now: Nanoseconds) -> bool {
        while let Some(event) = self.loader.next_event() {
            self.take(event, now);
        }
        if let Some(Problem { retry_at: Some(at), .. }) = &self.problem
            && now >= *at
        {
            self.problem = None;
            self.wanted_chunks.clear();
            self.loader.retry();
        }
        if self.waiting {
            self.head.hold(now);
        } else if let Some(timeline) = &self.timeline {
            self.head.advance(timeline, now);
        }
        let changed = self.show();
        self.ask();
        changed
    }

    fn take(&mut self, event: Event, now: Nanoseconds) {
        match event {
            Event::Opened(manifest) => {
                self.problem = None;
                self.manifest = Some(*manifest);
            }
            Event::NotOpened(error) => self.set_problem(&error, now),
            Event::Chunk { index, result: Ok(chunk), .. } => {
                self.problem = None;
                if let (None, Some(manifest), Some(first)) =
                    (&self.timeline, &self.manifest, chunk.frames.first())
                {
                    let (timescale, duration) = (manifest.timescale, manifest.duration);
                    self.timeline = Some(Timeline { timescale, duration, frame: first.duration });
                }
                self.chunks.insert(index, chunk);
            }
            Event::Chunk { index, result: Err(error), .. } => {
                if !error.is_temporary() {
                    self.broken_chunks.insert(index, error.to_string());
                }
                self.set_problem(&error, now);
            }
            Event::Frame { key, result: Ok(scene) } => {
                self.frames.insert(key, scene);
            }
            Event::Frame { key, result: Err(error) } => {
                tracing::warn!("{error}");
                self.broken.insert(key, error.to_string());
            }
        }
    }

    fn set_problem(&mut self, error: &SourceError, now: Nanoseconds) {
        tracing::warn!("{error}");
        let (message, retry_at) = if error.is_temporary() {
            (format!("{error}. The last picture stays; trying again."), Some(now + RETRY_AFTER))
        } else {
            (error.to_string(), None)
        };
        self.problem = Some(Problem { message, retry_at });
    }

    /// The chunk under the head.
    fn chunk_under_head(&self) -> usize {
        let chunks = self.manifest.as_ref().and_then(|manifest| manifest.representations.last());
        let position = self.head.position();
        chunks
            .map_or(0, |best| best.chunks.partition_point(|chunk| chunk.start <= position).saturating_sub(1))
    }

    /// The frame under the head, when its chunk is there.
    fn frame_under_head(&self) -> Option<FrameKey> {
        let index = self.chunk_under_head();
        let chunk = self.chunks.get(&index)?;
        let position = self.head.position();
        let frame = chunk.frames.partition_point(|frame| frame.start <= position).saturating_sub(1);
        Some(FrameKey { chunk: index, frame })
    }

    /// Puts the frame under the head on show, if it is there.
    fn show(&mut self) -> bool {
        let was_waiting = self.waiting;
        let key = self.frame_under_head();
        let ready = key.and_then(|key| {
            let scene = self.frames.get(&key)?.clone();
            let frame = self.chunks.get(&key.chunk)?.frames.get(key.frame)?;
            Some((key, scene, frame.start, frame.quality))
        });
        let broken = key.and_then(|key| self.broken.get(&key));
        let broken = broken.or_else(|| self.broken_chunks.get(&self.chunk_under_head())).cloned();
        match (ready, broken) {
            (Some((key, scene, start, quality)), _) => {
                self.waiting = false;
                if self.problem.as_ref().is_some_and(|problem| problem.retry_at.is_none()) {
                    self.problem = None;
                }
                let changed = self.shown.as_ref().map(|shown| shown.key) != Some(key);
                let frame = self.timeline.map_or(0, |timeline| timeline.frame_at(start));
                self.shown = Some(Shown { key, start, frame, quality, scene });
                changed
            }
            (None, Some(message)) => {
                // Nothing to wait for: the last good frame stays and playing goes on past the gap.
                self.waiting = false;
                self.problem = Some(Problem { message, retry_at: None });
                false
            }
            (None, None) => {
                self.waiting = true;
                if !was_waiting && self.head.is_playing() && self.shown.is_some() {
                    self.stalls += 1;
                }
                false
            }
        }
    }

    /// Asks for the frames from the head on and for their chunks and the next; forgets what is far away.
    fn ask(&mut self) {
        let Some(manifest) = &self.manifest else { return };
        let count = manifest.representations.last().map_or(0, |best| best.chunks.len());
        let current = self.chunk_under_head();
        if self.chunks.len() > CHUNKS_KEPT {
            self.chunks.retain(|&index, _| index + 2 >= current && index <= current + 2);
        }
        let missing = |index: &usize| {
            *index < count && !self.chunks.contains_key(index) && !self.broken_chunks.contains_key(index)
        };
        let away = self.problem.as_ref().is_some_and(|problem| problem.retry_at.is_some());
        let wanted: Vec<usize> =
            if away { Vec::new() } else { [current, current + 1].into_iter().filter(missing).collect() };
        if wanted != self.wanted_chunks {
            self.loader.want_chunks(&wanted);
            self.wanted_chunks = wanted;
        }

        let Some(head) = self.frame_under_head() else { return };
        let ahead: Vec<FrameKey> = self
            .chunks
            .range(head.chunk..)
            .take_while(|(index, _)| **index <= head.chunk + 1)
            .flat_map(|(&chunk, content)| {
                (0..content.frames.len()).map(move |frame| FrameKey { chunk, frame })
            })
            .skip_while(|key| *key < head)
            .take(FRAMES_AHEAD)
            .collect();
        if self.frames.len() > FRAMES_KEPT {
            self.frames.retain(|key, _| ahead.contains(key));
        }
        let wanted: Vec<FrameKey> = ahead
            .into_iter()
            .filter(|key| !self.frames.contains_key(key) && !self.broken.contains_key(key))
            .collect();
        if wanted != self.wanted_frames {
            let items = wanted.iter().filter_map(|key| Some((*key, self.chunks.get(&key.chunk)?.clone())));
            self.loader.want_frames(items.collect());
            self.wanted_frames = wanted;
        }
    }
}
