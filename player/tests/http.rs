//! Streams over HTTP: the same frames as from a folder, and a server that goes away leaves the last good one.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::{
    net::SocketAddr,
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use axum::{Router, extract::Request, http::StatusCode, response::IntoResponse};
use player::{
    session::Session,
    source::{Location, SourceError, Stream, loader::Loader},
};
use protocol::{limits::Limits, sample};
use tokio::runtime::Runtime;

const FRAMES: u32 = 240;

/// A static file server that can be told to stop answering.
struct Server {
    address: SocketAddr,
    away: Arc<AtomicBool>,
    _runtime: Runtime,
}

impl Server {
    fn start(folder: PathBuf) -> Self {
        let runtime =
            tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let listener = runtime.block_on(tokio::net::TcpListener::bind("127.0.0.1:0")).unwrap();
        let address = listener.local_addr().unwrap();
        let away = Arc::new(AtomicBool::new(false));
        let shut = away.clone();
        let answer = move |request: Request| {
            let path = folder.join(request.uri().path().trim_start_matches('/'));
            let shut = shut.load(Ordering::Relaxed);
            async move {
                if shut {
                    return StatusCode::SERVICE_UNAVAILABLE.into_response();
                }
                match std::fs::read(path) {
                    Ok(bytes) => bytes.into_response(),
                    Err(_) => StatusCode::NOT_FOUND.into_response(),
                }
            }
        };
        runtime.spawn(async move { axum::serve(listener, Router::new().fallback(answer)).await });
        Self { address, away, _runtime: runtime }
    }

    fn url(&self) -> String {
        format!("http://{}/", self.address)
    }
}

fn runtime() -> Runtime {
    tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap()
}

#[test]
fn a_stream_over_http_is_the_stream_in_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    support::write_match(folder.path(), 40);
    let server = Server::start(folder.path().to_owned());
    runtime().block_on(async {
        let open = |text: String| async move {
            Stream::open(Location::parse(&text).unwrap(), Limits::default()).await.unwrap()
        };
        let local = open(folder.path().display().to_string()).await;
        let remote = open(server.url()).await;
        assert_eq!(local.manifest, remote.manifest);
        for index in 0..local.chunks().len() {
            let best = local.best();
            let remote = remote.chunk(best, index).await.unwrap();
            let local = local.chunk(best, index).await.unwrap();
            assert_eq!(local.chunk, remote.chunk);
        }
    });
}

#[test]
fn a_missing_stream_names_its_address_and_the_status() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path().to_owned());
    let location = Location::parse(&server.url()).unwrap();
    let error = runtime().block_on(Stream::open(location, Limits::default())).err().unwrap();
    assert!(matches!(error, SourceError::Status { status: 404, .. }), "{error}");
    assert!(error.to_string().contains("match.json"), "{error}");
}

#[test]
fn while_the_server_is_away_the_last_frame_stays_and_play_resumes_when_it_is_back() {
    let folder = tempfile::tempdir().unwrap();
    support::write_match(folder.path(), FRAMES);
    let server = Server::start(folder.path().to_owned());
    let location = Location::parse(&server.url()).unwrap();
    let mut session = Session::new(Loader::start(location, Limits::default(), || {}).unwrap());
    let started = Instant::now();
    let wait_for = |session: &mut Session, what: &str, condition: &dyn Fn(&Session) -> bool| {
        let until = Instant::now() + Duration::from_secs(30);
        while !condition(session) {
            session.update(started.elapsed());
            assert!(Instant::now() < until, "waited in vain for {what}: {:?}", session.problem());
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    wait_for(&mut session, "the first frame", &|session| session.shown().is_some());

    server.away.store(true, Ordering::Relaxed);
    session.seek(FRAMES - 1, started.elapsed());
    wait_for(&mut session, "a message", &|session| {
        session.problem().is_some_and(|problem| problem.contains("503") && problem.contains("trying again"))
    });
    let shown = session.shown().expect("the last good frame stays").scene.clip_frame;
    assert_eq!(shown, sample::FIRST_CLIP_FRAME);

    server.away.store(false, Ordering::Relaxed);
    wait_for(&mut session, "the wanted frame", &|session| {
        session.shown().is_some_and(|shown| shown.frame == FRAMES - 1)
    });
    assert_eq!(session.problem(), None);
}

/// Somebody whose computer draws three pictures a second still sees the match move, from start to end.
#[test]
fn a_slow_machine_shows_fewer_frames_and_not_none() {
    let folder = tempfile::tempdir().unwrap();
    support::write_match(folder.path(), 90);
    let location = Location::parse(folder.path().to_str().unwrap()).unwrap();
    let mut session = Session::new(Loader::start(location, Limits::default(), || {}).unwrap());
    let until = Instant::now() + Duration::from_secs(30);
    let mut now = Duration::ZERO;
    let mut shown = Vec::new();
    loop {
        session.update(now);
        let frame = session.shown().map(|shown| shown.frame);
        if frame != shown.last().copied() {
            shown.extend(frame);
        }
        if shown.len() == 1 && !session.is_playing() {
            session.toggle(now);
        }
        if shown.last() == Some(&89) {
            break;
        }
        assert!(Instant::now() < until, "frames {shown:?}, then nothing; problem {:?}", session.problem());
        // The test's clock: a third of a second per picture, whatever the real one says.
        now += Duration::from_millis(333);
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(shown.len() >= 6, "only frames {shown:?} of three seconds were shown");
    assert!(shown.is_sorted(), "{shown:?}");
}
