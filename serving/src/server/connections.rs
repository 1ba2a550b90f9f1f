//! Connections in, bounded in number and in patience, and all of them ended when the server stops.

use std::{
    future::{Future, pending},
    io,
    pin::pin,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use hyper::service::service_fn;
use hyper_util::{
    rt::{TokioExecutor, TokioIo, TokioTimer},
    server::conn::auto,
};
use tokio::{
    io::{AsyncRead, AsyncWrite},
    net::{TcpListener, TcpStream},
    sync::{Notify, Semaphore, watch},
    task::JoinSet,
    time::{sleep, timeout},
};
use tokio_rustls::TlsAcceptor;

use super::{answer::Site, metrics::Cut, options::ServeOptions, watched::Watched};

/// A request's head at most, bytes, headers at most, and requests at a time on one HTTP/2 connection: all far more than
/// viewers need. What the server holds for one connection follows from them.
const HEAD_BYTES: usize = 16 * 1024;
const HEADERS: usize = 64;
const STREAMS: u32 = 32;
/// What HTTP/2 may hold ready for one answer, bytes.
const SEND_BUFFER: usize = 64 * 1024;
/// How long to wait when the system has no room for another connection.
const BREATH: Duration = Duration::from_millis(50);

/// The way in to a site.
pub(super) struct Door {
    listener: TcpListener,
    room: Arc<Semaphore>,
    shared: Arc<Shared>,
}

/// What every connection needs.
struct Shared {
    tls: Option<TlsAcceptor>,
    site: Arc<Site>,
    options: ServeOptions,
}

/// What a connection's parts tell each other.
#[derive(Default)]
struct Signs {
    /// A whole request came.
    heard: AtomicBool,
    /// The viewer does not take its answer.
    cut: Arc<Notify>,
}

impl Door {
    pub(super) fn new(
        listener: TcpListener,
        tls: Option<TlsAcceptor>,
        site: Arc<Site>,
        options: ServeOptions,
    ) -> Self {
        let room = Arc::new(Semaphore::new(options.max_connections.min(Semaphore::MAX_PERMITS)));
        Self { listener, room, shared: Arc::new(Shared { tls, site, options }) }
    }

    /// Lets viewers in until `stopped`, then waits for the requests under way, at most until the deadline.
    pub(super) async fn stand_open(self, stopped: impl Future<Output = ()>) {
        let Self { listener, room, shared } = self;
        let (stopping, stop) = watch::channel(false);
        let mut connections = JoinSet::new();
        let mut stopped = pin!(stopped);
        let mut trouble = false;
        loop {
            let accepted = tokio::select! {
                () = &mut stopped => break,
                Some(_) = connections.join_next() => continue,
                accepted = listener.accept() => accepted,
            };
            let socket = match accepted {
                Ok((socket, _)) => socket,
                Err(error) => {
                    // A viewer that left before it was let in is none of our business; a full table of descriptors is.
                    if !is_viewers(&error) {
                        if !trouble {
                            tracing::warn!(
                                "cannot accept viewers: {error}; raise the limit of open files (ulimit -n) or lower --max-connections"
                            );
                        }
                        trouble = true;
                        sleep(BREATH).await;
                    }
                    continue;
                }
            };
            trouble = false;
            let Ok(place) = room.clone().try_acquire_owned() else {
                shared.site.metrics.cut(Cut::Full);
                continue;
            };
            let (shared, stop) = (shared.clone(), stop.clone());
            connections.spawn(async move {
                connection(socket, &shared, stop).await;
                drop(place);
            });
        }
        // From here on the port is free.
        drop(listener);
        stopping.send_replace(true);
        let finished = async { while connections.join_next().await.is_some() {} };
        if timeout(shared.options.stop_deadline, finished).await.is_err() {
            tracing::warn!("{} connections were not done in time and were cut off", connections.len());
            for _ in 0..connections.len() {
                shared.site.metrics.cut(Cut::Stopped);
            }
            connections.shutdown().await;
        }
    }
}

fn is_viewers(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset, Interrupted};
    matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset | Interrupted)
}

/// One viewer's connection, to its end.
async fn connection(socket: TcpStream, shared: &Shared, stop: watch::Receiver<bool>) {
    let _open = shared.site.metrics.connection();
    let options = &shared.options;
    // Answers are written whole; waiting for more only delays their ends.
    if let Err(error) = socket.set_nodelay(true) {
        tracing::debug!("no TCP_NODELAY: {error}");
    }
    let socket =
        Watched::new(socket, shared.site.metrics.clone(), options.idle_timeout, options.stall_timeout);
    let signs = Arc::new(Signs::default());
    let work = async {
        match &shared.tls {
            None => requests(socket, shared, &signs, stop).await,
            Some(tls) => match tls.accept(socket).await {
                Ok(socket) => requests(socket, shared, &signs, stop).await,
                Err(error) => tracing::debug!("TLS was not agreed: {error}"),
            },
        }
    };
    let unheard = async {
        sleep(options.header_timeout).await;
        if signs.heard.load(Ordering::Relaxed) {
            pending::<()>().await;
        }
        shared.site.metrics.cut(Cut::NoRequest);
    };
    tokio::select! {
        () = work => {}
        () = unheard => {}
        () = signs.cut.notified() => {}
    }
}

/// The requests of one connection, until it ends or the server stops.
async fn requests<S>(socket: S, shared: &Shared, signs: &Arc<Signs>, mut stop: watch::Receiver<bool>)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let (site, signs) = (shared.site.clone(), signs.clone());
    let service = service_fn(move |request| {
        signs.heard.store(true, Ordering::Relaxed);
        site.clone().answer(request, signs.cut.clone())
    });
    let builder = builder(&shared.options);
    let mut connection = pin!(builder.serve_connection(TokioIo::new(socket), service));
    let result = tokio::select! {
        result = &mut connection => result,
        // A dropped sender means that the server is gone.
        () = async { drop(stop.wait_for(|stop| *stop).await) } => {
            connection.as_mut().graceful_shutdown();
            connection.await
        }
    };
    if let Err(error) = result {
        tracing::debug!("a connection broke off: {error}");
    }
}

fn builder(options: &ServeOptions) -> auto::Builder<TokioExecutor> {
    let mut builder = auto::Builder::new(TokioExecutor::new());
    builder
        .http1()
        .timer(TokioTimer::new())
        .header_read_timeout(options.header_timeout)
        .max_buf_size(HEAD_BYTES)
        .max_headers(HEADERS);
    builder
        .http2()
        .timer(TokioTimer::new())
        .max_concurrent_streams(STREAMS)
        .max_header_list_size(HEAD_BYTES as u32)
        .max_send_buf_size(SEND_BUFFER)
        // Nobody sends us bodies.
        .initial_stream_window_size(64 * 1024)
        .initial_connection_window_size(64 * 1024);
    builder
}
