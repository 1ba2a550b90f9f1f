//! What viewers rely on, over both versions of HTTP, with TLS and without.

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod support;

use reqwest::{Client, Method, Response, StatusCode, header};
use support::{BIG, CHUNK, WAYS, ask, client, connect, manifest, options, replace, start, stream};

/// Names and values.
type Headers<'a> = &'a [(&'a str, &'a str)];

async fn get(client: &Client, url: String, headers: &[(&str, &str)]) -> Response {
    headers
        .iter()
        .fold(client.get(url), |request, (name, value)| request.header(*name, *value))
        .send()
        .await
        .unwrap()
}

fn head<'a>(response: &'a Response, name: &str) -> &'a str {
    response.headers().get(name).map_or("", |value| value.to_str().unwrap())
}

// Two threads, as a client must answer while the server stops.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn files_ranges_conditions_types_and_origins() {
    let folder = stream();
    for (version, tls) in WAYS {
        let server = start(folder.path(), tls, options());
        let client = client(&server, version);
        let chunk = || format!("{}high/00000.glb", server.url());

        let whole = get(&client, chunk(), &[("origin", "https://example.org")]).await;
        assert_eq!((whole.status(), whole.version()), (StatusCode::OK, version));
        assert_eq!(head(&whole, "content-type"), "model/gltf-binary");
        assert_eq!(head(&whole, "content-length"), "10");
        assert_eq!(head(&whole, "accept-ranges"), "bytes");
        assert_eq!(head(&whole, "cache-control"), "no-cache");
        assert_eq!(head(&whole, "access-control-allow-origin"), "*");
        for exposed in ["etag", "content-range"] {
            assert!(head(&whole, "access-control-expose-headers").contains(exposed));
        }
        let (tag, date) = (head(&whole, "etag").to_owned(), head(&whole, "last-modified").to_owned());
        assert!(tag.starts_with('"') && !date.is_empty(), "{tag} {date}");
        assert_eq!(whole.bytes().await.unwrap(), CHUNK);

        let older = "Mon, 01 Jan 2001 00:00:00 GMT";
        let (all, part, none) = (StatusCode::OK, StatusCode::PARTIAL_CONTENT, StatusCode::NOT_MODIFIED);
        let failed = StatusCode::PRECONDITION_FAILED;
        let cases: [(Headers<'_>, StatusCode, &str); 18] = [
            (&[("range", "bytes=3-5")], part, "345"),
            (&[("range", "bytes=-2")], part, "89"),
            (&[("range", "bytes=8-")], part, "89"),
            (&[("range", "bytes=0-1,4-5")], all, "0123456789"),
            (&[("range", "bytes=x")], all, "0123456789"),
            (&[("range", "bytes=3-5"), ("if-range", &tag)], part, "345"),
            (&[("range", "bytes=3-5"), ("if-range", "\"other\"")], all, "0123456789"),
            (&[("range", "bytes=3-5"), ("if-range", older)], all, "0123456789"),
            (&[("range", "bytes=3-5"), ("if-range", "nonsense")], all, "0123456789"),
            (&[("if-none-match", &tag)], none, ""),
            (&[("if-none-match", "*")], none, ""),
            (&[("if-none-match", "\"other\"")], all, "0123456789"),
            (&[("if-none-match", "\"other\""), ("if-modified-since", &date)], all, "0123456789"),
            (&[("if-modified-since", &date)], none, ""),
            (&[("if-modified-since", older)], all, "0123456789"),
            (&[("if-match", "\"other\"")], failed, ""),
            (&[("if-none-match", &tag), ("range", "bytes=3-5")], none, ""),
            (&[("range", "bytes=10-20")], StatusCode::RANGE_NOT_SATISFIABLE, "416 Range Not Satisfiable\n"),
        ];
        for (headers, status, body) in cases {
            let response = get(&client, chunk(), headers).await;
            assert_eq!(response.status(), status, "{headers:?}");
            if status == part && body == "345" {
                assert_eq!(head(&response, "content-range"), "bytes 3-5/10");
            }
            if status == StatusCode::RANGE_NOT_SATISFIABLE {
                assert_eq!(head(&response, "content-range"), "bytes */10");
            }
            if status == none {
                assert_eq!(head(&response, "etag"), tag);
            }
            assert_eq!(response.text().await.unwrap(), body, "{headers:?}");
        }

        let response = client.head(chunk()).send().await.unwrap();
        assert_eq!((response.status(), head(&response, "content-length")), (StatusCode::OK, "10"));
        assert!(response.bytes().await.unwrap().is_empty());
        let response = client.request(Method::OPTIONS, chunk()).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::NO_CONTENT);
        assert_eq!(head(&response, "access-control-allow-headers"), "*");
        let response = client.post(chunk()).body("x").send().await.unwrap();
        assert_eq!(response.status(), StatusCode::METHOD_NOT_ALLOWED);
        for path in ["none", "high", "high/", "", ".part-secret", "%2e%2e/secret"] {
            let response = get(&client, format!("{}{path}", server.url()), &[]).await;
            assert_eq!(response.status(), StatusCode::NOT_FOUND, "{path}");
            assert_eq!(head(&response, "cache-control"), "no-store");
        }
        server.stop().unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn only_json_is_compressed_and_has_a_tag_of_its_own() {
    let folder = stream();
    for (version, tls) in WAYS {
        let server = start(folder.path(), tls, options());
        let client = client(&server, version);
        let url = || format!("{}match.json", server.url());

        let plain = get(&client, url(), &[]).await;
        assert_eq!((head(&plain, "content-encoding"), head(&plain, "vary")), ("", "accept-encoding"));
        let plain_tag = head(&plain, "etag").to_owned();
        assert_eq!(head(&plain, "content-type"), "application/json");
        assert_eq!(plain.text().await.unwrap(), manifest(1));

        for _ in 0..2 {
            let packed = get(&client, url(), &[("accept-encoding", "br, gzip")]).await;
            assert_eq!(
                (head(&packed, "content-encoding"), head(&packed, "vary")),
                ("gzip", "accept-encoding")
            );
            let packed_tag = head(&packed, "etag").to_owned();
            assert_ne!(packed_tag, plain_tag);
            let bytes = packed.bytes().await.unwrap();
            assert!(bytes.len() < manifest(1).len() / 4);
            let text = std::io::read_to_string(flate2::read::GzDecoder::new(&bytes[..])).unwrap();
            assert_eq!(text, manifest(1));
            let same = [("accept-encoding", "gzip"), ("if-none-match", packed_tag.as_str())];
            assert_eq!(get(&client, url(), &same).await.status(), StatusCode::NOT_MODIFIED);
        }

        let part = get(&client, url(), &[("accept-encoding", "gzip"), ("range", "bytes=0-9")]).await;
        assert_eq!((part.status(), head(&part, "content-encoding")), (StatusCode::PARTIAL_CONTENT, ""));
        let chunk =
            get(&client, format!("{}high/big.glb", server.url()), &[("accept-encoding", "gzip")]).await;
        assert_eq!((head(&chunk, "content-encoding"), chunk.content_length()), ("", Some(BIG)));
    }
}

#[tokio::test]
async fn a_stream_that_grows_or_is_rebuilt_is_served_as_it_is_now() {
    let folder = stream();
    let server = start(folder.path(), false, options());
    let client = client(&server, reqwest::Version::HTTP_2);
    let url = |name: &str| format!("{}{name}", server.url());

    let absent = get(&client, url("high/00001.glb"), &[]).await;
    assert_eq!((absent.status(), head(&absent, "cache-control")), (StatusCode::NOT_FOUND, "no-store"));
    replace(folder.path(), "high/00001.glb", b"new");
    assert_eq!(get(&client, url("high/00001.glb"), &[]).await.text().await.unwrap(), "new");

    for version in 2..5 {
        let gzip = [("accept-encoding", "gzip")];
        let old = get(&client, url("match.json"), &gzip).await;
        let tag = head(&old, header::ETAG.as_str()).to_owned();
        replace(folder.path(), "match.json", manifest(version).as_bytes());
        let new = get(&client, url("match.json"), &[gzip[0], ("if-none-match", tag.as_str())]).await;
        assert_eq!(new.status(), StatusCode::OK);
        let bytes = new.bytes().await.unwrap();
        let text = std::io::read_to_string(flate2::read::GzDecoder::new(&bytes[..])).unwrap();
        assert_eq!(text, manifest(version));
    }

    // Whoever started with the old file gets the old file.
    let mut response = get(&client, url("high/big.glb"), &[]).await;
    let mut received = response.chunk().await.unwrap().unwrap().len() as u64;
    replace(folder.path(), "high/big.glb", b"short");
    while let Some(piece) = response.chunk().await.unwrap() {
        assert!(piece.iter().all(|byte| *byte == 0));
        received += piece.len() as u64;
    }
    assert_eq!(received, BIG);

    // A folder of the same name, made anew.
    let path = folder.path().to_owned();
    std::fs::rename(&path, path.with_extension("old")).unwrap();
    std::fs::create_dir(&path).unwrap();
    std::fs::write(path.join("match.json"), b"again").unwrap();
    assert_eq!(get(&client, url("match.json"), &[]).await.text().await.unwrap(), "again");
    std::fs::remove_dir_all(path.with_extension("old")).unwrap();
}

#[test]
fn the_figures_say_what_happened() {
    let folder = stream();
    let server = start(folder.path(), false, options());
    // One connection, so that each request comes after the one before has been counted.
    let mut socket = connect(server.address());
    for path in ["/high/00000.glb", "/high/big.glb", "/none"] {
        ask(&mut socket, path);
    }
    let (head, text) = ask(&mut socket, "/metrics");
    assert!(head.contains("content-type: application/openmetrics-text"), "{head}");
    let text = String::from_utf8(text).unwrap();
    let figure = |name: &str| support::find(&text, name);
    assert_eq!(figure("holopitch_requests_total{status=\"2xx\"}"), 2.0);
    assert_eq!(figure("holopitch_requests_total{status=\"4xx\"}"), 1.0);
    assert_eq!(figure("holopitch_request_seconds_count"), 3.0);
    assert_eq!(figure("holopitch_requests_in_flight"), 1.0);
    assert_eq!(figure("holopitch_connections_open"), 1.0);
    assert!(figure("holopitch_sent_bytes_total") > BIG as f64);
    assert!(text.ends_with("# EOF\n"));
}

#[tokio::test]
async fn only_those_who_know_the_certificate_trust_it() {
    let folder = stream();
    let (server, other) = (start(folder.path(), true, options()), start(folder.path(), true, options()));
    assert!(server.url().starts_with("https://127.0.0.1:"));
    assert_ne!(server.fingerprint(), other.fingerprint());
    let stranger = client(&other, reqwest::Version::HTTP_2);
    assert!(stranger.get(server.url()).send().await.unwrap_err().is_connect());
    let friend = client(&server, reqwest::Version::HTTP_2);
    let by_name = format!("https://localhost:{}/match.json", server.address().port());
    assert_eq!(get(&friend, by_name, &[]).await.status(), StatusCode::OK);
}
