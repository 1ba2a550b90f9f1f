//! Loads a stream beside the user interface: one thread fetches and decodes chunks, one builds frames.
//!
//! Callers say what they want, most urgent first; a new list replaces the old one, so that a scrub over the whole
//! match does not leave a queue of stale work behind.

use std::{
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        mpsc::{self, Receiver, Sender},
    },
    thread,
};

use protocol::{chunk::Chunk, limits::Limits, manifest::Manifest, playback::Request};

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
        /// Its content, or why it is not there.
        result: Result<Arc<Chunk>, SourceError>,
    },
    /// A frame is ready to be uploaded.
    Frame {
        /// Which.
        key: FrameKey,
        /// Its scene, or why it cannot be shown.
        result: Result<Arc<FrameScene>, SourceError>,
    },
}

/// A stream that is being loaded.
pub struct Loader {
    events: Receiver<Event>,
    chunks: Arc<Wanted<Request, ()>>,
    frames: Arc<Wanted<FrameKey, Arc<Chunk>>>,
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
        let loader = Self { events, chunks: Arc::default(), frames: Arc::default(), retries: Arc::default() };
        let (chunks, frames, retries) =
            (loader.chunks.clone(), loader.frames.clone(), loader.retries.clone());
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(SourceError::Start)?;
        thread::Builder::new()
            .name("stream".to_owned())
            .spawn(move || {
                let Some(stream) = open(&runtime, &location, limits, &retries, &report) else { return };
                let stream = Arc::new(stream);
                let (frame_stream, frame_report) = (stream.clone(), report.clone());
                let builder = thread::Builder::new().name("frames".to_owned());
                if let Err(error) = builder.spawn(move || build_frames(&frame_stream, &frames, &frame_report))
                {
                    report.send(Event::NotOpened(SourceError::Start(error)));
                    return;
                }
                while let Some((request, ())) = chunks.next() {
                    let result = runtime.block_on(stream.chunk(request.chunk));
                    let result = result.map(|loaded| Arc::new(loaded.chunk));
                    report.send(Event::Chunk { request, result });
                }
            })
            .map_err(SourceError::Start)?;
        Ok(loader)
    }

    /// Replaces the list of chunks to load, most urgent first.
    pub fn want_chunks(&self, wanted: &[Request]) {
        self.chunks.replace(wanted.iter().map(|&request| (request, ())).collect());
    }

    /// Replaces the list of frames to build, most urgent first.
    pub fn want_frames(&self, wanted: Vec<(FrameKey, Arc<Chunk>)>) {
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
        self.chunks.close();
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

fn build_frames(stream: &Stream, wanted: &Wanted<FrameKey, Arc<Chunk>>, report: &Report) {
    while let Some((key, chunk)) = wanted.next() {
        let Some(frame) = chunk.frames.get(key.frame) else { continue };
        let scene = FrameScene::new(frame, &stream.manifest.people, stream.limits());
        let result = scene.map(Arc::new).map_err(|problem| SourceError::Atlas {
            file: stream.chunk_name(key.chunk),
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
}

struct State<K, T> {
    items: Vec<(K, T)>,
    /// What is being worked on; not taken up again while it is.
    current: Option<K>,
    closed: bool,
}

impl<K, T> Default for Wanted<K, T> {
    fn default() -> Self {
        let state = State { items: Vec::new(), current: None, closed: false };
        Self { state: Mutex::new(state), changed: Condvar::new() }
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
        wanted.retain(|(key, _)| Some(*key) != current);
        state.items = wanted;
        self.changed.notify_one();
    }

    /// The most urgent item, waiting for one; `None` when the list was closed.
    fn next(&self) -> Option<(K, T)> {
        let mut state = self.lock();
        state.current = None;
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

    fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
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
}
