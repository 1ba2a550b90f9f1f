//! Streams and clients for the tests.

#![allow(dead_code, clippy::unwrap_used, clippy::expect_used)]

use std::{
    io::{Read, Write},
    net::{SocketAddr, TcpStream},
    path::Path,
    time::{Duration, Instant},
};

use serving::server::{ServeOptions, Server, Tls};
use tokio_rustls::rustls::crypto::ring;

/// Nothing on loopback takes this long; a test that waits for more has failed.
pub const LONG: Duration = Duration::from_secs(30);

/// The content of `high/00000.glb`.
pub const CHUNK: &[u8] = b"0123456789";
/// The length of `high/big.glb`, which holds zeros: more than sockets and HTTP/2 windows buffer.
pub const BIG: u64 = 64 * 1024 * 1024;

/// A folder that passes for a stream.
pub fn stream() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("high")).unwrap();
    replace(folder.path(), "match.json", manifest(1).as_bytes());
    replace(folder.path(), "high/00000.glb", CHUNK);
    std::fs::File::create(folder.path().join("high/big.glb")).unwrap().set_len(BIG).unwrap();
    std::fs::write(folder.path().join(".part-secret"), b"secret").unwrap();
    folder
}

/// JSON that is worth compressing.
pub fn manifest(version: u32) -> String {
    format!("{{\"version\":{version},\"chunks\":[{}0]}}", "\"high/00000.glb\",".repeat(200))
}

/// Writes a file as the encoder does.
pub fn replace(folder: &Path, name: &str, bytes: &[u8]) {
    let mut file = tempfile::NamedTempFile::new_in(folder).unwrap();
    file.write_all(bytes).unwrap();
    file.persist(folder.join(name)).unwrap();
}

/// Any free port of this machine.
pub fn options() -> ServeOptions {
    ServeOptions { address: "127.0.0.1:0".parse().unwrap(), ..ServeOptions::default() }
}

/// The four ways to speak to a server: version of HTTP, with TLS or without.
pub const WAYS: [(reqwest::Version, bool); 4] = [
    (reqwest::Version::HTTP_11, false),
    (reqwest::Version::HTTP_2, false),
    (reqwest::Version::HTTP_11, true),
    (reqwest::Version::HTTP_2, true),
];

/// A server with or without TLS.
pub fn start(folder: &Path, tls: bool, options: ServeOptions) -> Server {
    let tls = if tls { Tls::SelfMade } else { Tls::Off };
    Server::start(folder, ServeOptions { tls, ..options }).unwrap()
}

/// A client that speaks this version, and trusts the server's own certificate only.
pub fn client(server: &Server, version: reqwest::Version) -> reqwest::Client {
    // reqwest takes the process's; the first test wins.
    let _ = ring::default_provider().install_default();
    let mut builder = reqwest::Client::builder().timeout(LONG).no_proxy();
    if let Some(certificate) = server.self_made_certificate() {
        let certificate = reqwest::Certificate::from_pem(certificate.as_bytes()).unwrap();
        builder = builder.tls_certs_only([certificate]);
        if version == reqwest::Version::HTTP_11 {
            builder = builder.http1_only();
        }
    } else {
        // Nor does a machine without any certificates matter.
        builder = builder.tls_certs_only([]);
        if version == reqwest::Version::HTTP_2 {
            builder = builder.http2_prior_knowledge();
        }
    }
    builder.build().unwrap()
}

/// Sends `request` as it is and returns everything that comes back until the server closes, or nothing more does.
pub fn raw(address: SocketAddr, request: &[u8]) -> String {
    let mut socket = connect(address);
    // The server may have closed before it read everything.
    let _ = socket.write_all(request);
    let mut answer = Vec::new();
    let mut piece = [0; 4096];
    while let Ok(count @ 1..) = socket.read(&mut piece) {
        answer.extend_from_slice(&piece[..count]);
    }
    String::from_utf8_lossy(&answer).into_owned()
}

pub fn connect(address: SocketAddr) -> TcpStream {
    let socket = TcpStream::connect_timeout(&address, LONG).unwrap();
    socket.set_read_timeout(Some(LONG)).unwrap();
    socket.set_write_timeout(Some(LONG)).unwrap();
    socket
}

/// Asks on an open connection and returns the head and the body.
pub fn ask(socket: &mut TcpStream, path: &str) -> (String, Vec<u8>) {
    write!(socket, "GET {path} HTTP/1.1\r\nHost: test\r\n\r\n").unwrap();
    let head = read_head(socket);
    let length = head
        .lines()
        .find_map(|line| line.strip_prefix("content-length: "))
        .map_or(0, |length| length.parse().unwrap());
    let mut body = vec![0; length];
    socket.read_exact(&mut body).unwrap();
    (head, body)
}

/// The head of an answer, in lower case.
pub fn read_head(socket: &mut TcpStream) -> String {
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        let mut byte = [0];
        socket.read_exact(&mut byte).unwrap();
        head.push(byte[0]);
    }
    String::from_utf8(head).unwrap().to_lowercase()
}

/// One of the server's figures; 0 when there is none yet.
pub fn figure(address: SocketAddr, name: &str) -> f64 {
    let answer = raw(address, b"GET /metrics HTTP/1.1\r\nHost: test\r\nConnection: close\r\n\r\n");
    find(&answer, name)
}

/// One figure in the text of `/metrics`.
pub fn find(text: &str, name: &str) -> f64 {
    let value = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    value.map_or(0.0, |value| value.trim().parse().unwrap())
}

/// Waits until the condition holds, and fails when it never does.
pub fn wait_for(what: &str, mut condition: impl FnMut() -> bool) {
    let until = Instant::now() + LONG;
    while !condition() {
        assert!(Instant::now() < until, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}
