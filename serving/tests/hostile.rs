//! Viewers that mean no good: the server refuses them in words or cuts them off, and goes on serving the others.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod support;

use std::{
    io::{Read, Write},
    time::Duration,
};

use serving::server::ServeOptions;
use support::{LONG, ask, client, connect, figure, find, options, raw, start, stream, wait_for};

/// Long enough for a machine that is busy with other tests to answer in, short enough to wait for.
const SHORT: Duration = Duration::from_secs(1);

#[test]
fn paths_lead_nowhere_but_into_the_folder() {
    let folder = stream();
    // Beside the folder, where a way out would lead.
    let beside = folder.path().with_extension("secret");
    std::fs::write(&beside, b"secret").unwrap();
    let name = beside.file_name().unwrap().to_str().unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(&beside, folder.path().join("link.glb")).unwrap();
    let server = start(folder.path(), false, options());
    let paths = [
        format!("/../{name}"),
        format!("/high/../../{name}"),
        format!("/%2e%2e/{name}"),
        format!("/%2E%2E%2F{name}"),
        format!("/..%2f{name}"),
        format!("/..%5c{name}"),
        format!("/..\\{name}"),
        format!("/%252e%252e/{name}"),
        format!("/%c0%ae%c0%ae/{name}"),
        format!("//{}", beside.display()),
        format!("/%2f{}", beside.display()),
        format!("http://test/../{name}"),
        format!("file://{}", beside.display()),
        "/link.glb".to_owned(),
        "/link%2eglb".to_owned(),
        "/.part-secret".to_owned(),
        "/%2epart-secret".to_owned(),
        "/high/../.part-secret".to_owned(),
        "/match.json%00".to_owned(),
        "/high".to_owned(),
        "/".to_owned(),
        "*".to_owned(),
        format!("/{}", "a".repeat(8000)),
        format!("/{}", "a/".repeat(4000)),
    ];
    for path in &paths {
        let answer = raw(
            server.address(),
            format!("GET {path} HTTP/1.1\r\nHost: test\r\nConnection: close\r\n\r\n").as_bytes(),
        );
        let status = answer.lines().next().unwrap_or_default();
        assert!(status.contains(" 404 ") || status.contains(" 400 "), "{path}: {status}");
        assert!(!answer.contains("secret"), "{path}: {answer}");
    }
    std::fs::remove_file(&beside).unwrap();
    assert_eq!(ask(&mut connect(server.address()), "/high/00000.glb").1, support::CHUNK);
}

#[test]
fn what_is_not_http_or_too_much_of_it_is_refused() {
    let folder = stream();
    let server = start(folder.path(), false, ServeOptions { header_timeout: SHORT, ..options() });
    let long = "a".repeat(100_000);
    let many = "X-Header: 1\r\n".repeat(10_000);
    let requests = [
        format!("GET /{long} HTTP/1.1\r\nHost: test\r\n\r\n"),
        format!("GET /match.json HTTP/1.1\r\nHost: test\r\nX-Header: {long}\r\n\r\n"),
        format!("GET /match.json HTTP/1.1\r\nHost: test\r\n{many}\r\n"),
        format!("{long}{long}"),
        "GET /match.json\r\n\r\n".to_owned(),
        "GET /match.json HTTP/9.9\r\n\r\n".to_owned(),
        "\0\0\0\0\0\0\0\0\r\n\r\n".to_owned(),
        "\r\n".repeat(50_000),
        "GET /match.json HTTP/1.1\r\nHost: test\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\nhello"
            .to_owned(),
        "POST /match.json HTTP/1.1\r\nHost: test\r\nContent-Length: 99999999999999999999\r\n\r\n".to_owned(),
        "DELETE /match.json HTTP/1.1\r\nHost: test\r\nConnection: close\r\n\r\n".to_owned(),
        "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\nthese are no frames at all, and there are many of them".to_owned(),
        // TLS where none is spoken.
        "\u{16}\u{3}\u{1}\u{2}\u{0}\u{1}\u{0}\u{1}".to_owned(),
        String::new(),
    ];
    for request in &requests {
        let answer = raw(server.address(), request.as_bytes());
        let shown: String = request.chars().take(40).collect();
        assert!(!answer.starts_with("HTTP/1.1 2"), "{shown:?}: {answer}");
    }
    assert!(folder.path().join("match.json").exists());
    assert_eq!(ask(&mut connect(server.address()), "/high/00000.glb").1, support::CHUNK);
    wait_for("all connections to end", || figure(server.address(), "holopitch_connections_open") == 1.0);
}

#[test]
fn whoever_dawdles_over_a_request_is_cut_off() {
    let folder = stream();
    for tls in [false, true] {
        let server = start(folder.path(), tls, ServeOptions { header_timeout: SHORT, ..options() });
        // Nothing at all; a byte now and then; a second request that never ends.
        let mut silent = connect(server.address());
        assert!(matches!(silent.read(&mut [0; 16]), Ok(0) | Err(_)));
        let mut slow = connect(server.address());
        wait_for("the slow one to be cut off", || {
            std::thread::sleep(Duration::from_millis(20));
            slow.write_all(b"G").is_err()
        });
        if !tls {
            let mut second = connect(server.address());
            ask(&mut second, "/high/00000.glb");
            second.write_all(b"GET /high").unwrap();
            let mut rest = String::new();
            let _ = second.read_to_string(&mut rest);
            assert!(!rest.contains("200 OK"), "{rest}");
            let cut = figure(server.address(), "holopitch_connections_cut_total{reason=\"NoRequest\"}");
            assert!(cut >= 2.0, "{cut}");
        }
        server.stop().unwrap();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn whoever_does_not_take_an_answer_is_cut_off() {
    let folder = stream();
    for (version, tls) in support::WAYS {
        let server = start(folder.path(), tls, ServeOptions { stall_timeout: SHORT, ..options() });
        let client = client(&server, version);
        let mut untaken = client.get(format!("{}high/big.glb", server.url())).send().await.unwrap();
        let figures = || async {
            let fresh = support::client(&server, version);
            fresh.get(format!("{}metrics", server.url())).send().await.unwrap().text().await.unwrap()
        };
        let until = std::time::Instant::now() + LONG;
        loop {
            let text = figures().await;
            if find(&text, "holopitch_connections_cut_total{reason=\"Stalled\"}") >= 1.0
                && find(&text, "holopitch_requests_in_flight") == 1.0
            {
                break;
            }
            assert!(std::time::Instant::now() < until, "{version:?}, TLS {tls}: still served\n{text}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        // What came in the meantime ends in an error, not in a file that looks whole.
        let mut received = 0;
        let ended = loop {
            match untaken.chunk().await {
                Ok(Some(piece)) => received += piece.len() as u64,
                Ok(None) => break true,
                Err(_) => break false,
            }
        };
        assert!(!ended && received < support::BIG, "{version:?}, TLS {tls}: {received}");
    }
}

#[test]
fn quiet_connections_are_closed() {
    let folder = stream();
    let server = start(folder.path(), false, ServeOptions { idle_timeout: SHORT, ..options() });
    let mut socket = connect(server.address());
    ask(&mut socket, "/high/00000.glb");
    assert!(matches!(socket.read(&mut [0; 16]), Ok(0) | Err(_)));
    wait_for("the figure", || {
        figure(server.address(), "holopitch_connections_cut_total{reason=\"Idle\"}") >= 1.0
    });
}

#[test]
fn more_connections_than_allowed_are_closed_and_told() {
    let folder = stream();
    let server = start(folder.path(), false, ServeOptions { max_connections: 4, ..options() });
    let mut allowed: Vec<_> = (0..4).map(|_| connect(server.address())).collect();
    for socket in &mut allowed {
        ask(socket, "/high/00000.glb");
    }
    for _ in 0..20 {
        let mut refused = connect(server.address());
        let _ = refused.write_all(b"GET /high/00000.glb HTTP/1.1\r\nHost: test\r\n\r\n");
        assert!(matches!(refused.read(&mut [0; 16]), Ok(0) | Err(_)));
    }
    let figures = String::from_utf8(ask(&mut allowed[0], "/metrics").1).unwrap();
    assert_eq!(find(&figures, "holopitch_connections_cut_total{reason=\"Full\"}"), 20.0);
    assert_eq!(find(&figures, "holopitch_connections_open"), 4.0);
    allowed.pop();
    wait_for("room for another", || {
        raw(server.address(), b"GET /high/00000.glb HTTP/1.1\r\nHost: test\r\nConnection: close\r\n\r\n")
            .contains("200 OK")
    });
}

#[test]
fn many_connections_that_come_and_go_leave_nothing_behind() {
    let folder = stream();
    let server = start(folder.path(), false, options());
    for round in 0..20 {
        let mut sockets: Vec<_> = (0..50).map(|_| connect(server.address())).collect();
        for (index, socket) in sockets.iter_mut().enumerate() {
            // Some leave in the middle of a big answer, some in the middle of a request.
            let request: &[u8] = if (index + round) % 2 == 0 {
                b"GET /high/big.glb HTTP/1.1\r\nHost: test\r\n\r\n"
            } else {
                b"GET /high"
            };
            let _ = socket.write_all(request);
        }
    }
    wait_for("all to be forgotten", || {
        let text = raw(server.address(), b"GET /metrics HTTP/1.1\r\nHost: test\r\nConnection: close\r\n\r\n");
        find(&text, "holopitch_connections_open") == 1.0 && find(&text, "holopitch_requests_in_flight") == 1.0
    });
    #[cfg(target_os = "linux")]
    wait_for("all files to be closed", || {
        let open = std::fs::read_dir("/proc/self/fd").unwrap().flatten();
        let path = folder.path().join("high/big.glb");
        open.filter(|entry| std::fs::read_link(entry.path()).is_ok_and(|target| target == path)).count() == 0
    });
}
