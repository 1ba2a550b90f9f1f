//! Many viewers against one server in a process of its own, for minutes, with a restart in between.
//!
//!     cargo run --release -p serving --example soak -- --seconds 120 --viewers 100 [--stream FOLDER] [--tls]
//!
//! Every viewer fetches a chunk per second, now and then jumps somewhere else, and checks each chunk against the manifest's
//! BLAKE3. Half speak HTTP/2. In the middle the server is killed and started again. Prints one JSON object; ends with 1 when a
//! request outside the restart failed, a chunk was wrong, or a viewer was not served again.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::{
    fs,
    io::{BufRead, BufReader},
    net::SocketAddr,
    path::{Path, PathBuf},
    process::{Child, Command, ExitCode, Stdio},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use protocol::{hash, manifest::FileEntry};
use serving::server::{ServeOptions, Tls, serve};
use tokio::time::sleep;
use tokio_rustls::rustls::crypto::ring;

/// The made-up stream: chunks of about the size that matches have.
const CHUNKS: usize = 60;
const CHUNK_BYTES: usize = 1_000_000;
/// Every so many chunks a viewer jumps.
const JUMP: u64 = 10;
/// Requests may fail from the kill until this long after the server is back.
const GRACE: Duration = Duration::from_secs(2);

struct Arguments {
    seconds: u64,
    viewers: u64,
    stream: Option<PathBuf>,
    tls: bool,
    /// Set in the server's process.
    serve: Option<SocketAddr>,
}

fn arguments() -> Arguments {
    let mut arguments = Arguments { seconds: 120, viewers: 100, stream: None, tls: false, serve: None };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().unwrap_or_else(|| panic!("{word} needs a value"));
        match word.as_str() {
            "--seconds" => arguments.seconds = value().parse().expect("a number of seconds"),
            "--viewers" => arguments.viewers = value().parse().expect("a number of viewers"),
            "--stream" => arguments.stream = Some(value().into()),
            "--tls" => arguments.tls = true,
            "--serve" => arguments.serve = Some(value().parse().expect("an address")),
            _ => panic!("{word} is not known; see the head of this file"),
        }
    }
    arguments
}

fn main() -> ExitCode {
    let mut arguments = arguments();
    let _ = ring::default_provider().install_default();
    if let (Some(address), Some(stream)) = (arguments.serve, &arguments.stream) {
        let tls = if arguments.tls {
            let [certificate, key] = ["cert.pem", "key.pem"].map(|name| stream.with_extension(name));
            Tls::Files { certificate, key }
        } else {
            Tls::Off
        };
        serve(stream, ServeOptions { address, tls, ..ServeOptions::default() }).unwrap();
        return ExitCode::SUCCESS;
    }
    let made_up = tempfile::tempdir().unwrap();
    let stream = arguments.stream.take().unwrap_or_else(|| make_up(&made_up.path().join("stream")));
    if arguments.tls {
        // Given as files, so that it is the same after the restart.
        let made = rcgen::generate_simple_self_signed(vec!["127.0.0.1".to_owned()]).unwrap();
        fs::write(stream.with_extension("cert.pem"), made.cert.pem()).unwrap();
        fs::write(stream.with_extension("key.pem"), made.signing_key.serialize_pem()).unwrap();
    }
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().unwrap();
    runtime.block_on(soak(&arguments, &stream))
}

/// Writes a folder that passes for a stream; returns it.
fn make_up(folder: &Path) -> PathBuf {
    fs::create_dir_all(folder.join("high")).unwrap();
    let mut state = 1_u64;
    let entries: Vec<FileEntry> = (0..CHUNKS)
        .map(|index| {
            let path = format!("high/{index:05}.glb");
            let bytes: Vec<u8> = (0..CHUNK_BYTES).map(|_| next(&mut state) as u8).collect();
            fs::write(folder.join(&path), &bytes).unwrap();
            hash::entry(path, &bytes)
        })
        .collect();
    let chunks: Vec<_> = entries.iter().map(|entry| serde_json::json!({ "file": entry })).collect();
    let manifest = serde_json::json!({ "representations": [{ "chunks": chunks }] });
    fs::write(folder.join("match.json"), manifest.to_string()).unwrap();
    folder.to_owned()
}

/// Knuth's linear congruential numbers: enough for jumps.
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    *state >> 33
}

struct ServerProcess {
    process: Child,
    address: SocketAddr,
}

impl ServerProcess {
    fn start(stream: &Path, tls: bool, address: SocketAddr) -> Self {
        let mut process = Command::new(std::env::current_exe().unwrap())
            .args(["--serve", &address.to_string(), "--stream"])
            .arg(stream)
            .args(tls.then_some("--tls"))
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(process.stdout.take().unwrap()).lines().map(Result::unwrap);
        let line = lines.find(|line| line.starts_with("serving ")).expect("the server starts");
        let url = line.rsplit("//").next().unwrap();
        // The rest goes nowhere, but must be taken.
        std::thread::spawn(move || lines.for_each(drop));
        Self { process, address: url.trim_end_matches('/').parse().unwrap() }
    }

    /// Resident memory, MiB; 0 where the system does not tell.
    fn memory_mib(&self) -> f64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.process.id())).unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let kib = line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok());
        kib.unwrap_or(0.0) / 1024.0
    }
}

impl Drop for ServerProcess {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// What all viewers add to.
#[derive(Default)]
struct Counts {
    requests: AtomicU64,
    bytes: AtomicU64,
    wrong: AtomicU64,
    errors: AtomicU64,
    errors_around_restart: AtomicU64,
    /// The server is away, or was until a moment ago.
    restart: AtomicBool,
    stop: AtomicBool,
    seconds: Mutex<Vec<f32>>,
    /// The first request outside the restart that failed.
    first_error: Mutex<Option<String>>,
}

async fn soak(arguments: &Arguments, stream: &Path) -> ExitCode {
    let local = "127.0.0.1:0".parse().unwrap();
    let mut server = ServerProcess::start(stream, arguments.tls, local);
    let address = server.address;
    let scheme = if arguments.tls { "https" } else { "http" };
    let url = format!("{scheme}://{address}/");
    let counts = Arc::new(Counts::default());
    let viewers: Vec<_> = (0..arguments.viewers)
        .map(|index| {
            let client = client(index % 2 == 0, arguments.tls.then_some(stream));
            tokio::spawn(watch(client, url.clone(), index, counts.clone()))
        })
        .collect();

    let total = Duration::from_secs(arguments.seconds);
    let begun = Instant::now();
    let early = Duration::from_secs(10).min(total / 4);
    sleep(early).await;
    let memory_early = server.memory_mib();
    sleep((total / 2).saturating_sub(begun.elapsed())).await;
    let memory_middle = server.memory_mib();

    let served_before = counts.requests.load(Ordering::Relaxed);
    counts.restart.store(true, Ordering::Relaxed);
    drop(server);
    sleep(Duration::from_secs(1)).await;
    server = ServerProcess::start(stream, arguments.tls, address);
    sleep(GRACE).await;
    counts.restart.store(false, Ordering::Relaxed);

    let restarted = Instant::now();
    sleep(early).await;
    let memory_after_restart = server.memory_mib();
    let rest = total.saturating_sub(begun.elapsed());
    sleep(rest).await;
    let memory_end = server.memory_mib();
    counts.stop.store(true, Ordering::Relaxed);
    let mut resumed = 0;
    for viewer in viewers {
        resumed += u64::from(viewer.await.unwrap().is_some_and(|last| last > restarted));
    }

    let mut seconds = std::mem::take(&mut *counts.seconds.lock().unwrap());
    seconds.sort_by(f32::total_cmp);
    let at = |share: f64| seconds.get(((seconds.len() as f64 * share) as usize).min(seconds.len() - 1));
    let millis = |share| at(share).map(|second| f64::from((second * 100_000.0).round()) / 100.0);
    let round = |mib: f64| (mib * 10.0).round() / 10.0;
    let load = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
    println!(
        "{:#}",
        serde_json::json!({
            "seconds": begun.elapsed().as_secs(),
            "viewers": arguments.viewers,
            "tls": arguments.tls,
            "requests": load(&counts.requests),
            "requests_before_restart": served_before,
            "errors": load(&counts.errors),
            "first_error": *counts.first_error.lock().unwrap(),
            "errors_around_restart": load(&counts.errors_around_restart),
            "wrong_chunks": load(&counts.wrong),
            "viewers_resumed": resumed,
            "bytes": load(&counts.bytes),
            "latency_ms": { "p50": millis(0.5), "p95": millis(0.95), "p99": millis(0.99), "max": millis(1.0) },
            "server_memory_mib": {
                "early": round(memory_early),
                "before_restart": round(memory_middle),
                "early_after_restart": round(memory_after_restart),
                "end": round(memory_end),
            },
        })
    );
    let good = load(&counts.errors) == 0 && load(&counts.wrong) == 0 && resumed == arguments.viewers;
    if good { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn client(http2: bool, tls: Option<&Path>) -> reqwest::Client {
    let mut builder = reqwest::Client::builder().no_proxy().timeout(Duration::from_secs(10));
    if tls.is_none() {
        builder = builder.tls_certs_only([]);
    }
    if let Some(stream) = tls {
        let pem = fs::read(stream.with_extension("cert.pem")).unwrap();
        builder = builder.tls_certs_only([reqwest::Certificate::from_pem(&pem).unwrap()]);
    }
    builder = match (http2, tls) {
        (true, None) => builder.http2_prior_knowledge(),
        (true, Some(_)) => builder,
        (false, _) => builder.http1_only(),
    };
    builder.build().unwrap()
}

/// One viewer, until the end; returns when it last got a chunk.
async fn watch(client: reqwest::Client, url: String, seed: u64, counts: Arc<Counts>) -> Option<Instant> {
    let mut random = seed;
    for _ in 0..8 {
        next(&mut random);
    }
    // Not all in the same moment.
    sleep(Duration::from_millis(next(&mut random) % 1000)).await;
    let (mut entries, mut place, mut fetched, mut last) = (Vec::new(), 0, 0, None);
    let mut due = Instant::now();
    while !counts.stop.load(Ordering::Relaxed) {
        let begun = Instant::now();
        let result = if entries.is_empty() {
            get(&client, &format!("{url}match.json")).await.map(|bytes| {
                entries = chunks(&bytes);
                place = next(&mut random) as usize;
            })
        } else {
            let entry = &entries[place % entries.len()];
            get(&client, &format!("{url}{}", entry.path)).await.map(|bytes| {
                if hash::verify(&bytes, entry).is_err() {
                    counts.wrong.fetch_add(1, Ordering::Relaxed);
                }
                counts.bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
                last = Some(Instant::now());
                fetched += 1;
                place = if fetched % JUMP == 0 { next(&mut random) as usize } else { place + 1 };
            })
        };
        match result {
            Ok(()) => {
                counts.requests.fetch_add(1, Ordering::Relaxed);
                counts.seconds.lock().unwrap().push(begun.elapsed().as_secs_f32());
            }
            Err(_) if counts.restart.load(Ordering::Relaxed) => {
                counts.errors_around_restart.fetch_add(1, Ordering::Relaxed);
            }
            Err(error) => {
                counts.errors.fetch_add(1, Ordering::Relaxed);
                counts.first_error.lock().unwrap().get_or_insert(format!("{error:?}"));
            }
        }
        due = (due + Duration::from_secs(1)).max(Instant::now());
        tokio::time::sleep_until(due.into()).await;
    }
    last
}

async fn get(client: &reqwest::Client, url: &str) -> reqwest::Result<Vec<u8>> {
    Ok(client.get(url).send().await?.error_for_status()?.bytes().await?.to_vec())
}

/// The chunks of the first representation.
fn chunks(manifest: &[u8]) -> Vec<FileEntry> {
    let mut manifest: serde_json::Value = serde_json::from_slice(manifest).expect("a manifest");
    let chunks = manifest["representations"][0]["chunks"].take();
    let chunks = chunks.as_array().expect("chunks").iter();
    chunks.map(|chunk| serde_json::from_value(chunk["file"].clone()).expect("an entry")).collect()
}
