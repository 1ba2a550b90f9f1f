//! Starting, stopping and starting again.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod support;

use std::{
    io::{BufRead, BufReader, Read, Write},
    net::TcpStream,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::atomic::{AtomicBool, AtomicU32, Ordering},
    time::{Duration, Instant},
};

use serving::server::{ServeError, ServeOptions, Server, Tls, serve};
use support::{BIG, CHUNK, LONG, ask, client, connect, options, raw, read_head, start, stream, wait_for};

/// The folder that [`a_server_process`] serves.
const FOLDER: &str = "HOLOPITCH_TEST_SERVE";

#[test]
fn a_stop_lets_requests_under_way_finish() {
    let folder = stream();
    let server = start(folder.path(), false, ServeOptions { stop_deadline: LONG, ..options() });
    let address = server.address();
    let mut idle = connect(address);
    ask(&mut idle, "/high/00000.glb");
    let mut busy = connect(address);
    busy.write_all(b"GET /high/big.glb HTTP/1.1\r\nHost: test\r\n\r\n").unwrap();
    assert!(read_head(&mut busy).contains("200 ok"));
    let stopping = std::thread::spawn(move || server.stop());
    wait_for("the port to be closed", || TcpStream::connect(address).is_err());
    // Who waits for nothing is let go, who is being served is served.
    assert_eq!(idle.read(&mut [0; 16]).unwrap(), 0);
    assert!(!stopping.is_finished());
    let received = std::io::copy(&mut busy, &mut std::io::sink()).unwrap();
    assert_eq!(received, BIG);
    stopping.join().unwrap().unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_lets_http2_answers_finish() {
    let folder = stream();
    for tls in [false, true] {
        let server = start(folder.path(), tls, ServeOptions { stop_deadline: LONG, ..options() });
        let client = client(&server, reqwest::Version::HTTP_2);
        let mut response = client.get(format!("{}high/big.glb", server.url())).send().await.unwrap();
        let address = server.address();
        let stopping = tokio::task::spawn_blocking(move || server.stop());
        wait_for("the port to be closed", || TcpStream::connect(address).is_err());
        let mut received = 0;
        while let Some(piece) = response.chunk().await.unwrap() {
            received += piece.len() as u64;
        }
        assert_eq!(received, BIG);
        stopping.await.unwrap().unwrap();
    }
}

#[test]
fn a_stop_waits_no_longer_than_its_deadline() {
    let folder = stream();
    let deadline = Duration::from_millis(300);
    let server = start(folder.path(), false, ServeOptions { stop_deadline: deadline, ..options() });
    let mut stuck = connect(server.address());
    stuck.write_all(b"GET /high/big.glb HTTP/1.1\r\nHost: test\r\n\r\n").unwrap();
    read_head(&mut stuck);
    let begun = Instant::now();
    server.stop().unwrap();
    // Far below the time after which a stalled viewer would be cut off anyway.
    assert!(begun.elapsed() >= deadline && begun.elapsed() < ServeOptions::default().stall_timeout);
    // Not a file that looks whole.
    let mut received = Vec::new();
    let _ = stuck.read_to_end(&mut received);
    assert!((received.len() as u64) < BIG);
}

#[test]
fn a_dropped_server_ends_too() {
    let folder = stream();
    let server = start(folder.path(), false, options());
    let address = server.address();
    drop(server);
    wait_for("the port to be closed", || TcpStream::connect(address).is_err());
}

#[test]
fn viewers_that_retry_get_over_a_restart_on_the_same_port() {
    const VIEWERS: usize = 8;
    let folder = stream();
    let server = start(folder.path(), false, options());
    let address = server.address();
    let (done, answers) = (AtomicBool::new(false), AtomicU32::new(0));
    std::thread::scope(|scope| {
        for _ in 0..VIEWERS {
            scope.spawn(|| {
                while !done.load(Ordering::Relaxed) {
                    let Ok(mut socket) = TcpStream::connect(address) else {
                        std::thread::sleep(Duration::from_millis(2));
                        continue;
                    };
                    let request = b"GET /high/00000.glb HTTP/1.1\r\nHost: test\r\nConnection: close\r\n\r\n";
                    let mut answer = Vec::new();
                    if socket.write_all(request).is_err()
                        || socket.read_to_end(&mut answer).is_err()
                        || answer.is_empty()
                    {
                        continue;
                    }
                    // Whatever is answered at all is right.
                    assert!(answer.starts_with(b"HTTP/1.1 200") && answer.ends_with(CHUNK));
                    answers.fetch_add(1, Ordering::Relaxed);
                }
            });
        }
        let more =
            |than: u32| wait_for("viewers to be served", || answers.load(Ordering::Relaxed) > than + 50);
        let mut server = server;
        for _ in 0..5 {
            more(answers.load(Ordering::Relaxed));
            server.stop().unwrap();
            server = Server::start(folder.path(), ServeOptions { address, ..options() }).unwrap();
            more(answers.load(Ordering::Relaxed));
        }
        done.store(true, Ordering::Relaxed);
        server.stop().unwrap();
    });
}

#[test]
fn what_cannot_be_served_is_told_before_anybody_comes() {
    let empty = tempfile::tempdir().unwrap();
    let error = Server::start(empty.path(), options()).unwrap_err();
    assert!(
        matches!(error, ServeError::NotAStream { .. }) && error.to_string().contains("match.json"),
        "{error}"
    );

    let folder = stream();
    let server = start(folder.path(), false, options());
    let error =
        Server::start(folder.path(), ServeOptions { address: server.address(), ..options() }).unwrap_err();
    assert!(matches!(error, ServeError::Listen { .. }) && error.to_string().contains("--listen"), "{error}");

    let tls = Tls::Files { certificate: PathBuf::from("none.pem"), key: PathBuf::from("none.key") };
    let error = Server::start(folder.path(), ServeOptions { tls, ..options() }).unwrap_err();
    assert!(matches!(error, ServeError::Tls(_)) && error.to_string().contains("none.pem"), "{error}");
}

/// Not a test of its own: the process that the next one starts.
#[test]
fn a_server_process() {
    let Some(folder) = std::env::var_os(FOLDER) else { return };
    serve(Path::new(&folder), ServeOptions { tls: Tls::SelfMade, ..options() }).unwrap();
}

#[cfg(unix)]
#[test]
fn a_server_process_says_where_it_is_and_ends_on_a_signal() {
    for signal in ["-TERM", "-INT"] {
        let folder = stream();
        let mut process = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "a_server_process", "--nocapture"])
            .env(FOLDER, folder.path())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(process.stdout.take().unwrap()).lines().map(Result::unwrap);
        let serving = lines.find(|line| line.contains("serving ")).unwrap();
        let url = serving.rsplit(' ').next().unwrap().to_owned();
        assert!(url.starts_with("https://127.0.0.1:"), "{serving}");
        assert!(lines.next().unwrap().contains("SHA-256"));
        assert!(lines.next().unwrap().contains(&format!("player {url}")));
        let address = url.trim_start_matches("https://").trim_end_matches('/').parse().unwrap();
        assert!(!raw(address, b"this is no TLS\r\n\r\n").contains("200"));
        let killed = Command::new("kill").args([signal, &process.id().to_string()]).status().unwrap();
        assert!(killed.success());
        assert!(lines.any(|line| line == "stopped"));
        let until = Instant::now() + LONG;
        while process.try_wait().unwrap().is_none() {
            assert!(Instant::now() < until, "the process goes on after {signal}");
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(process.wait().unwrap().success());
    }
}
