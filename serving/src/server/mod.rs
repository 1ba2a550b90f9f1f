//! An HTTP server for one stream folder: HTTP/1.1 and HTTP/2, with or without TLS, for viewers that nobody vetted.
//!
//! `connections` accepts and bounds them, `files` finds what may be served, `answer` speaks HTTP, `body` feeds files to the
//! network no faster than it takes them, `metrics` counts.

mod answer;
mod body;
mod compressed;
mod connections;
mod files;
mod metrics;
mod options;
mod range;
mod tls;
mod watched;

use std::{
    future::Future,
    io,
    net::SocketAddr,
    path::{Path, PathBuf},
    thread,
    time::Duration,
};

use protocol::manifest::FILE_NAME;
use tokio::{net::TcpListener, runtime::Runtime, sync::oneshot};

pub use options::{DEFAULT_ADDRESS, ServeOptions, Tls};
pub use tls::TlsError;

use answer::Site;
use connections::Door;
use tls::Identity;

/// Connections that the system holds ready before they are accepted.
const BACKLOG: u32 = 1024;

/// Why a stream cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The folder is not a stream.
    #[error("{} has no {FILE_NAME}: give the folder that `reconstruct --out` wrote", folder.display())]
    NotAStream {
        /// The folder given.
        folder: PathBuf,
    },
    /// The address is taken or not ours.
    #[error("cannot listen on {address}: {source}; choose another with --listen ADDR")]
    Listen {
        /// The address given.
        address: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// The certificate or its key cannot be used.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// The server could not start or stopped by itself.
    #[error("the server stopped: {0}; start it again")]
    Stopped(#[from] io::Error),
}

/// A server running on threads of its own until it is stopped or dropped.
#[derive(Debug)]
pub struct Server {
    bound: Bound,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<thread::JoinHandle<()>>,
}

/// What is known once the server listens.
#[derive(Clone, Debug)]
struct Bound {
    address: SocketAddr,
    identity: Option<Identity>,
}

impl Server {
    /// Serves `folder`; port 0 takes any free one. Returns once connections are accepted.
    ///
    /// # Errors
    /// When the folder is not a stream, the address cannot be used, or the certificate cannot.
    pub fn start(folder: &Path, options: ServeOptions) -> Result<Self, ServeError> {
        let runtime = runtime()?;
        let (door, bound) = match open(&runtime, folder, options) {
            Ok(open) => open,
            Err(error) => {
                // The caller may itself be async code, which must not wait for a runtime to end.
                runtime.shutdown_background();
                return Err(error);
            }
        };
        let (stop, stopped) = oneshot::channel();
        let thread = thread::Builder::new().name("holopitch-serve".to_owned()).spawn(move || {
            run(&runtime, door, async {
                // A dropped sender stops the server as well.
                let _ = stopped.await;
            });
            wind_down(runtime);
        })?;
        Ok(Self { bound, stop: Some(stop), thread: Some(thread) })
    }

    /// The address in use.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.bound.address
    }

    /// The URL of the stream, as players take it.
    #[must_use]
    pub fn url(&self) -> String {
        self.bound.url()
    }

    /// The certificate in PEM form when the server made it itself: a client that is given it trusts this server.
    #[must_use]
    pub fn self_made_certificate(&self) -> Option<&str> {
        self.bound.identity.as_ref()?.self_made_pem.as_deref()
    }

    /// SHA-256 of the certificate, as browsers show it; nothing without TLS.
    #[must_use]
    pub fn fingerprint(&self) -> Option<&str> {
        self.bound.identity.as_ref().map(|identity| identity.fingerprint.as_str())
    }

    /// Takes no more connections, finishes the requests under way, at the latest at the deadline of the options, and stops.
    ///
    /// # Errors
    /// When the server had broken off by itself.
    pub fn stop(mut self) -> Result<(), ServeError> {
        self.stop.take();
        match self.thread.take().map(thread::JoinHandle::join) {
            Some(Err(_)) => Err(ServeError::Stopped(io::Error::other("its thread broke off"))),
            _ => Ok(()),
        }
    }
}

impl Bound {
    fn url(&self) -> String {
        let scheme = if self.identity.is_some() { "https" } else { "http" };
        format!("{scheme}://{}/", self.address)
    }
}

/// Serves `folder` until Ctrl-C or SIGTERM, printing where and how to watch.
///
/// # Errors
/// When the folder is not a stream, the address cannot be used, or the certificate cannot.
pub fn serve(folder: &Path, options: ServeOptions) -> Result<(), ServeError> {
    let runtime = runtime()?;
    let deadline_s = options.stop_deadline.as_secs_f32();
    let (door, bound) = open(&runtime, folder, options)?;
    // Before anything is said: whoever reads it may want to stop at once.
    let interrupted = {
        let _context = runtime.enter();
        interrupted()
    };
    let url = bound.url();
    println!("serving {} at {url}", folder.display());
    if let Some(identity) = &bound.identity {
        println!("certificate {}, SHA-256 {}", identity.origin(), identity.fingerprint);
    }
    println!("watch it with `player {url}`; figures at {url}metrics; stop with Ctrl-C");
    run(&runtime, door, async move {
        interrupted.await;
        println!("stopping: requests under way have {deadline_s} s");
    });
    wind_down(runtime);
    println!("stopped");
    Ok(())
}

/// Listens for Ctrl-C and, where there is one, SIGTERM; the future waits for either.
#[cfg(unix)]
fn interrupted() -> impl Future<Output = ()> {
    use tokio::signal::unix::{SignalKind, signal};
    let listen = |kind, name: &str| {
        signal(kind)
            .inspect_err(|error| {
                tracing::warn!("cannot listen for {name} ({error}): it ends the server at once")
            })
            .ok()
    };
    let (interrupt, terminate) =
        (listen(SignalKind::interrupt(), "Ctrl-C"), listen(SignalKind::terminate(), "SIGTERM"));
    let wait = |signal: Option<tokio::signal::unix::Signal>| async {
        match signal {
            Some(mut signal) => drop(signal.recv().await),
            None => std::future::pending().await,
        }
    };
    async move {
        tokio::select! {
            () = wait(interrupt) => {}
            () = wait(terminate) => {}
        }
    }
}

/// Waits for Ctrl-C.
#[cfg(not(unix))]
async fn interrupted() {
    if let Err(error) = tokio::signal::ctrl_c().await {
        tracing::warn!("cannot listen for Ctrl-C ({error}): stop the process to end the server");
        std::future::pending::<()>().await;
    }
}

fn runtime() -> io::Result<Runtime> {
    tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()
}

/// Listens, with everything that can be wrong found out before the first viewer comes.
fn open(runtime: &Runtime, folder: &Path, options: ServeOptions) -> Result<(Door, Bound), ServeError> {
    if !folder.join(FILE_NAME).is_file() {
        return Err(ServeError::NotAStream { folder: folder.to_owned() });
    }
    let tls = tls::acceptor(&options.tls, options.address)?;
    let _context = runtime.enter();
    let listen = |source| ServeError::Listen { address: options.address, source };
    let listener = listener(options.address).map_err(listen)?;
    let address = listener.local_addr().map_err(listen)?;
    let (acceptor, identity) = tls.unzip();
    let site = Site::new(folder.to_owned(), options.stall_timeout);
    Ok((Door::new(listener, acceptor, site, options), Bound { address, identity }))
}

/// A listener that can take the port again right after another server on it ended.
fn listener(address: SocketAddr) -> io::Result<TcpListener> {
    let socket = match address {
        SocketAddr::V4(_) => tokio::net::TcpSocket::new_v4()?,
        SocketAddr::V6(_) => tokio::net::TcpSocket::new_v6()?,
    };
    // On Windows this would let two servers share a port.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    socket.bind(address)?;
    socket.listen(BACKLOG)
}

fn run(runtime: &Runtime, door: Door, stopped: impl Future<Output = ()>) {
    runtime.block_on(door.stand_open(stopped));
}

/// A read of a file that hangs must not hold up the stop.
fn wind_down(runtime: Runtime) {
    runtime.shutdown_timeout(Duration::from_secs(1));
}
