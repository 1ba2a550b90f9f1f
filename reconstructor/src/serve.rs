//! A small static HTTP/1.1 server for one stream folder: ranges, content types and access from any web page.
//!
//! A stream needs no more than this; any other static server or CDN does as well.

use std::{
    io,
    net::SocketAddr,
    path::{Path, PathBuf},
    thread,
};

use axum::{
    Router,
    extract::Request,
    http::{HeaderValue, header::CACHE_CONTROL},
    middleware::{Next, from_fn},
    response::Response,
};
use protocol::manifest::FILE_NAME;
use tokio::{net::TcpListener, sync::oneshot};
use tower_http::{cors::CorsLayer, services::ServeDir};

/// Where `reconstructor serve` listens unless told otherwise: this machine only.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8420";

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
    /// The server could not start or stopped by itself.
    #[error("the server stopped: {0}")]
    Stopped(#[from] io::Error),
}

/// A server running on a thread of its own until it is stopped or dropped.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<thread::JoinHandle<io::Result<()>>>,
}

impl Server {
    /// Serves `folder` at `address`; port 0 takes any free one. Returns once connections are accepted.
    ///
    /// # Errors
    /// When the folder is not a stream or the address cannot be used.
    pub fn start(folder: &Path, address: SocketAddr) -> Result<Self, ServeError> {
        let runtime = runtime()?;
        let listener = runtime.block_on(bind(folder, address))?;
        let address = listener.local_addr()?;
        let (stop, stopped) = oneshot::channel();
        let router = router(folder);
        let thread = thread::Builder::new().name("holopitch-serve".to_owned()).spawn(move || {
            runtime.block_on(async {
                let wait = async {
                    // A dropped sender stops the server as well.
                    let _ = stopped.await;
                };
                axum::serve(listener, router).with_graceful_shutdown(wait).await
            })
        })?;
        Ok(Self { address, stop: Some(stop), thread: Some(thread) })
    }

    /// The address in use.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The URL of the stream, as players take it.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/", self.address)
    }

    /// Finishes the requests under way and stops.
    ///
    /// # Errors
    /// When the server had stopped by itself.
    pub fn stop(mut self) -> Result<(), ServeError> {
        self.stop.take();
        match self.thread.take().map(thread::JoinHandle::join) {
            Some(Ok(result)) => Ok(result?),
            Some(Err(_)) => Err(ServeError::Stopped(io::Error::other("its thread broke off"))),
            None => Ok(()),
        }
    }
}

/// Serves `folder` until Ctrl-C, printing where.
///
/// # Errors
/// When the folder is not a stream or the address cannot be used.
pub fn serve(folder: &Path, address: SocketAddr) -> Result<(), ServeError> {
    runtime()?.block_on(async {
        let listener = bind(folder, address).await?;
        let url = format!("http://{}/", listener.local_addr()?);
        println!("serving {} at {url}", folder.display());
        println!("watch it with `player {url}`; stop with Ctrl-C");
        let interrupt = async {
            if let Err(error) = tokio::signal::ctrl_c().await {
                tracing::warn!("cannot listen for Ctrl-C ({error}): stop the process to end the server");
                std::future::pending::<()>().await;
            }
        };
        axum::serve(listener, router(folder)).with_graceful_shutdown(interrupt).await?;
        println!("stopped");
        Ok(())
    })
}

fn runtime() -> io::Result<tokio::runtime::Runtime> {
    tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()
}

async fn bind(folder: &Path, address: SocketAddr) -> Result<TcpListener, ServeError> {
    if !folder.join(FILE_NAME).is_file() {
        return Err(ServeError::NotAStream { folder: folder.to_owned() });
    }
    TcpListener::bind(address).await.map_err(|source| ServeError::Listen { address, source })
}

fn router(folder: &Path) -> Router {
    // Streams are public by nature: a player in a web page of any origin may read them.
    let cors = CorsLayer::permissive();
    Router::new().fallback_service(ServeDir::new(folder)).layer(from_fn(revalidate)).layer(cors)
}

/// A stream rebuilt in the same folder keeps its URLs, so caches ask whether a file has changed.
async fn revalidate(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    response
}

#[cfg(test)]
mod tests {
    use std::{
        io::{Read, Write},
        net::TcpStream,
    };

    use super::*;

    fn stream() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("high")).unwrap();
        std::fs::write(folder.path().join(FILE_NAME), b"{}").unwrap();
        std::fs::write(folder.path().join("high/00000.glb"), b"0123456789").unwrap();
        folder
    }

    /// The head and the body of the answer.
    fn get(address: SocketAddr, path: &str, header: &str) -> (String, Vec<u8>) {
        let mut socket = TcpStream::connect(address).unwrap();
        write!(socket, "GET {path} HTTP/1.1\r\nHost: test\r\nConnection: close\r\n{header}\r\n").unwrap();
        let mut answer = Vec::new();
        socket.read_to_end(&mut answer).unwrap();
        let end = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        (String::from_utf8(answer[..end].to_vec()).unwrap().to_lowercase(), answer[end + 4..].to_vec())
    }

    #[test]
    fn files_ranges_types_and_origins() {
        let folder = stream();
        let server = Server::start(folder.path(), "127.0.0.1:0".parse().unwrap()).unwrap();
        let (head, body) = get(server.address(), "/high/00000.glb", "Origin: https://example.org\r\n");
        assert!(head.starts_with("http/1.1 200"), "{head}");
        assert!(head.contains("content-type: model/gltf-binary"), "{head}");
        assert!(head.contains("access-control-allow-origin: *"), "{head}");
        assert_eq!(body, b"0123456789");

        let (head, body) = get(server.address(), "/high/00000.glb", "Range: bytes=3-5\r\n");
        assert!(head.starts_with("http/1.1 206") && head.contains("content-range: bytes 3-5/10"), "{head}");
        assert_eq!(body, b"345");

        let (head, _) = get(server.address(), "/match.json", "");
        assert!(head.contains("content-type: application/json"), "{head}");
        let (head, _) = get(server.address(), "/../secret", "");
        assert!(!head.starts_with("http/1.1 200"), "{head}");
        let address = server.address();
        server.stop().unwrap();
        assert!(TcpStream::connect(address).is_err(), "still listening after stop");
    }

    #[test]
    fn a_folder_without_a_stream_and_a_taken_port_are_refused() {
        let empty = tempfile::tempdir().unwrap();
        let any = "127.0.0.1:0".parse().unwrap();
        assert!(matches!(Server::start(empty.path(), any), Err(ServeError::NotAStream { .. })));
        let folder = stream();
        let server = Server::start(folder.path(), any).unwrap();
        let again = Server::start(folder.path(), server.address());
        assert!(matches!(again, Err(ServeError::Listen { .. })));
    }
}
