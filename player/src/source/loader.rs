//! Loads a stream beside the user interface: one thread fetches and decodes chunks (and reads the manifest of a
//! live stream again), one builds frames.
//!
//! Callers say what they want, most urgent first; a new list replaces the old one, so that a scrub over the whole
//! match does not leave a queue of stale work behind.

use std::{
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        mpsc::{self, Receiver, Sender},
    },
    thread,
    time::{Duration, Instant},
};

use protocol::{content::AnyChunk, limits::Limits, manifest::Manifest, playback::Request};

use super::{Location, SourceError, Stream};
use crate::scene::FrameScene;

/// A frame by its chunk and its place in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameKey {
    /// Index of the chunk in the stream.
    pub chunk: usize,
    /// Index of the frame in the chunk.
    pub frame: usize,
}

/// What the loader reports.
#[derive(Debug)]
pub enum Event {
    /// The manifest was read.
    Opened(Box<Manifest>),
    /// The manifest could not be read; nothing more will come until [`Loader::retry`].
    NotOpened(SourceError),
    /// A chunk was asked for.
    Chunk {
        /// What was asked.
        request: Request,
        /// Its content and how it came, or why it is not there.
        result: Result<Fetched, SourceError>,
    },
    /// The manifest of a live stream was read again.
    Manifest(Result<Box<Manifest>, SourceError>),
    /// A frame is ready to be uploaded.
    Frame {
        /// Which.
        key: FrameKey,
        /// Its scene, or why it cannot be shown.
        result: Result<Arc<FrameScene>, SourceError>,
    },
}

/// A chunk that came.
#[derive(Debug)]
pub struct Fetched {
    /// Its content.
    pub chunk: Arc<AnyChunk>,
    /// Length of its file.
    pub bytes: u64,
    /// How long reading or downloading it took.
    pub fetch: Duration,
    /// When its last byte was there.
    pub finished: Instant,
}

/// What the first thread does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Work {
    Manifest,
    Chunk(Request),
}

/// What a frame is built from.
#[derive(Clone, Debug)]
pub struct FrameSource {
    /// The chunk that the frame lies in.
    pub chunk: Arc<AnyChunk>,
    /// The representation that the chunk came in, for messages.
    pub representation: usize,
}

/// A stream that is being loaded.
pub struct Loader {
    events: Receiver<Event>,
    work: Arc<Wanted<Work, ()>>,
    frames: Arc<Wanted<FrameKey, FrameSource>>,
    retries: Arc<Wanted<(), ()>>,
}

impl Loader {
    /// Starts the threads; `wake` is called after every event.
    pub fn start(
        location: Location,
        limits: Limits,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Result<Self, SourceError> {
        let (sender, events) = mpsc::channel();
        let report = Report { sender, wake: Arc::new(wake) };
        let loader = Self { events, work: Arc::default(), frames: Arc::default(), retries: Arc::default() };
        let (work, frames, retries) = (loader.work.clone(), loader.frames.clone(), loader.retries.clone());
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(SourceError::Start)?;
        thread::Builder::new()
            .name("stream".to_owned())
            .spawn(move || {
                let Some(stream) = open(&runtime, &location, limits, &retries, &report) else { return };
                let stream = Arc::new(Mutex::new(Arc::new(stream)));
                let (frame_stream, frame_report) = (stream.clone(), report.clone());
                let builder = thread::Builder::new().name("frames".to_owned());
                if let Err(error) = builder.spawn(move || build_frames(&frame_stream, &frames, &frame_report))
                {
                    report.send(Event::NotOpened(SourceError::Start(error)));
                    return;
                }
                while let Some((item, ())) = work.next() {
                    // What is not wanted any more must not keep waiting what is.
                    let doing = async {
                        tokio::select! {
                            event = carry_out(item, &stream) => Some(event),
                            () = work.current_dropped() => None,
                        }
                    };
                    if let Some(event) = runtime.block_on(doing) {
                        report.send(event);
                    }
                }
            })
            .map_err(SourceError::Start)?;
        Ok(loader)
    }

    /// Replaces the list of what to load: the manifest again or not, and chunks, most urgent first. What is being loaded
    /// and is not in the list is stopped.
    pub fn want(&self, manifest: bool, chunks: &[Request]) {
        let manifest = manifest.then_some((Work::Manifest, ()));
        let chunks = chunks.iter().map(|&request| (Work::Chunk(request), ()));
        self.work.replace(manifest.into_iter().chain(chunks).collect());
    }

    /// Replaces the list of frames to build, most urgent first.
    pub fn want_frames(&self, wanted: Vec<(FrameKey, FrameSource)>) {
        self.frames.replace(wanted);
    }

    /// Tries again to read the manifest after [`Event::NotOpened`].
    pub fn retry(&self) {
        self.retries.replace(vec![((), ())]);
    }

    /// The next thing that happened, if something did.
    #[must_use]
    pub fn next_event(&self) -> Option<Event> {
        self.events.try_recv().ok()
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        self.work.close();
        self.frames.close();
        self.retries.close();
    }
}

#[derive(Clone)]
struct Report {
    sender: Sender<Event>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Report {
    /// When nobody listens any more, the lists are closed too and the threads end by themselves.
    fn send(&self, event: Event) {
        if self.sender.send(event).is_ok() {
            (self.wake)();
        }
    }
}

fn open(
    runtime: &tokio::runtime::Runtime,
    location: &Location,
    limits: Limits,
    retries: &Wanted<(), ()>,
    report: &Report,
) -> Option<Stream> {
    loop {
        match runtime.block_on(Stream::open(location.clone(), limits)) {
            Ok(stream) => {
                report.send(Event::Opened(Box::new(stream.manifest.clone())));
                return Some(stream);
            }
            Err(error) => report.send(Event::NotOpened(error)),
        }
        retries.next()?;
    }
}

/// The stream as its newest manifest tells it.
fn newest(stream: &Mutex<Arc<Stream>>) -> MutexGuard<'_, Arc<Stream>> {
    stream.lock().unwrap_or_else(PoisonError::into_inner)
}

async fn carry_out(work: Work, stream: &Mutex<Arc<Stream>>) -> Event {
    let current = newest(stream).clone();
    match work {
        Work::Manifest => Event::Manifest(current.read_again().await.map(|updated| {
            let manifest = Box::new(updated.manifest.clone());
            // An older copy from some cache must not make chunks disappear.
            if has_all_of(&updated.manifest, &current.manifest) {
                *newest(stream) = Arc::new(updated);
            }
            manifest
        })),
        Work::Chunk(request) => {
            let result = current.chunk(request.representation, request.chunk).await;
            let result = result.map(|loaded| Fetched {
                bytes: loaded.file.len() as u64,
                fetch: loaded.fetch,
                finished: loaded.started + loaded.fetch,
                chunk: Arc::new(loaded.chunk),
            });
            Event::Chunk { request, result }
        }
    }
}

/// Whether a manifest has at least as many chunks as another in every representation.
fn has_all_of(new: &Manifest, old: &Manifest) -> bool {
    let counts = |manifest: &Manifest| {
        manifest.representations.iter().map(|item| item.chunks.len()).collect::<Vec<_>>()
    };
    let (new, old) = (counts(new), counts(old));
    new.len() == old.len() && new.iter().zip(&old).all(|(new, old)| new >= old)
}

fn build_frames(stream: &Mutex<Arc<Stream>>, wanted: &Wanted<FrameKey, FrameSource>, report: &Report) {
    while let Some((key, FrameSource { chunk, representation })) = wanted.next() {
        let Some(frame) = chunk.frame(key.frame) else { continue };
        let stream = newest(stream).clone();
        let scene = FrameScene::new(&frame, &stream.manifest.people, stream.limits());
        let result = scene.map(Arc::new).map_err(|problem| SourceError::Atlas {
            file: stream.chunk_name(representation, key.chunk),
            clip_frame: frame.clip_frame,
            problem,
        });
        report.send(Event::Frame { key, result });
    }
}

/// A list of work that one thread takes from the front and another replaces as a whole.
struct Wanted<K, T> {
    state: Mutex<State<K, T>>,
    changed: Condvar,
    /// Told when what is being worked on is wanted no more.
    dropped: tokio::sync::Notify,
}

struct State<K, T> {
    items: Vec<(K, T)>,
    /// What is being worked on; not taken up again while it is.
    current: Option<K>,
    /// Whether the newest list has it no more.
    current_dropped: bool,
    closed: bool,
}

impl<K, T> Default for Wanted<K, T> {
    fn default() -> Self {
        let state = State { items: Vec::new(), current: None, current_dropped: false, closed: false };
        Self { state: Mutex::new(state), changed: Condvar::new(), dropped: tokio::sync::Notify::new() }
    }
}

impl<K: Copy + PartialEq, T> Wanted<K, T> {
    /// A panic while the lock was held leaves a list that is still whole: it is only ever replaced or popped.
    fn lock(&self) -> MutexGuard<'_, State<K, T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn replace(&self, mut wanted: Vec<(K, T)>) {
        wanted.reverse();
        let mut state = self.lock();
        let current = state.current;
        state.current_dropped = current.is_some_and(|current| wanted.iter().all(|(key, _)| *key != current));
        if state.current_dropped {
            self.dropped.notify_one();
        }
        wanted.retain(|(key, _)| Some(*key) != current);
        state.items = wanted;
        self.changed.notify_one();
    }

    /// The most urgent item, waiting for one; `None` when the list was closed.
    fn next(&self) -> Option<(K, T)> {
        let mut state = self.lock();
        (state.current, state.current_dropped) = (None, false);
        loop {
            if state.closed {
                return None;
            }
            if let Some((key, item)) = state.items.pop() {
                state.current = Some(key);
                return Some((key, item));
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Waits until what is being worked on is wanted no more, or nothing is.
    async fn current_dropped(&self) {
        loop {
            let (dropped, closed) = {
                let state = self.lock();
                (state.current_dropped, state.closed)
            };
            if dropped || closed {
                return;
            }
            // It may have been meant for the item before: look again.
            self.dropped.notified().await;
        }
    }

    fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
        self.dropped.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_list_counts_in_its_order_without_what_is_being_done() {
        let wanted = Wanted::default();
        wanted.replace(vec![(1, ()), (2, ()), (3, ())]);
        assert_eq!(wanted.next(), Some((1, ())));
        wanted.replace(vec![(1, ()), (7, ()), (8, ())]);
        assert_eq!((wanted.next(), wanted.next()), (Some((7, ())), Some((8, ()))));
        wanted.close();
        wanted.replace(vec![(9, ())]);
        assert_eq!(wanted.next(), None);
    }

    #[tokio::test]
    async fn what_is_wanted_no_more_is_stopped_and_nothing_else() {
        let wanted = Wanted::default();
        wanted.replace(vec![(1, ()), (2, ())]);
        assert_eq!(wanted.next(), Some((1, ())));
        wanted.replace(vec![(2, ())]);
        wanted.current_dropped().await;
        assert_eq!(wanted.next(), Some((2, ())));
        wanted.replace(vec![(2, ()), (3, ())]);
        let waiting = tokio::time::timeout(Duration::from_millis(20), wanted.current_dropped());
        assert!(waiting.await.is_err(), "2 is still wanted");
    }
}
