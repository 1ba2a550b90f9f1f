//! Streams in object storage, against an S3 server in a process of its own (s3s-fs, which keeps objects as files).

#![allow(clippy::unwrap_used, clippy::expect_used)]

mod support;

use std::{
    io::{BufRead, BufReader},
    path::Path,
    process::{Child, Command, Stdio},
    sync::{
        atomic::{AtomicBool, AtomicU32, Ordering},
        mpsc,
    },
    time::Duration,
};

use hyper_util::{
    rt::{TokioExecutor, TokioIo},
    server::conn::auto,
};
use object_store::{
    Attribute, ClientConfigKey, GetOptions, ObjectStore, ObjectStoreExt,
    aws::{AmazonS3, AmazonS3Builder, AmazonS3ConfigKey},
};
use s3s::{auth::SimpleAuth, service::S3ServiceBuilder};
use serving::destination::{Destination, DestinationError, FileKind};
use support::{manifest, wait_for};
use tokio_rustls::rustls::crypto::ring;

const FOLDER: &str = "HOLOPITCH_TEST_S3_FOLDER";
const PORT: &str = "HOLOPITCH_TEST_S3_PORT";
const KEY: &str = "viewer";
const SECRET: &str = "correct horse";
const BUCKET: &str = "streams";
const CHUNKS: usize = 40;

/// Not a test of its own: the server process that the others start.
#[test]
fn an_s3_server_process() {
    let (Ok(folder), Ok(port)) = (std::env::var(FOLDER), std::env::var(PORT)) else { return };
    let mut service = S3ServiceBuilder::new(s3s_fs::FileSystem::new(folder).unwrap());
    service.set_auth(SimpleAuth::from_single(KEY, SECRET));
    let service = service.build();
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    runtime.block_on(async {
        let address = ("127.0.0.1", port.parse::<u16>().unwrap());
        let listener = tokio::net::TcpListener::bind(address).await.unwrap();
        println!("\nlistening on {}", listener.local_addr().unwrap().port());
        loop {
            let (socket, _) = listener.accept().await.unwrap();
            let service = service.clone();
            tokio::spawn(async move {
                let builder = auto::Builder::new(TokioExecutor::new());
                let _ = builder.serve_connection(TokioIo::new(socket), service).await;
            });
        }
    });
}

/// The server process; killed when dropped.
struct Storage {
    process: Child,
    port: u16,
}

impl Storage {
    fn start(folder: &Path, port: u16) -> Self {
        let mut process = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "an_s3_server_process", "--nocapture"])
            .envs([(FOLDER, folder.as_os_str()), (PORT, port.to_string().as_ref())])
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(process.stdout.take().unwrap()).lines().map(Result::unwrap);
        let port = lines.find_map(|line| line.strip_prefix("listening on ")?.parse().ok()).unwrap();
        Self { process, port }
    }

    fn destination(&self, url: &str, secret: &str) -> Destination {
        let endpoint = format!("http://127.0.0.1:{}", self.port);
        let settings = [
            ("AWS_ENDPOINT", endpoint.as_str()),
            ("AWS_ALLOW_HTTP", "true"),
            ("AWS_ACCESS_KEY_ID", KEY),
            ("AWS_SECRET_ACCESS_KEY", secret),
            ("AWS_REGION", "us-east-1"),
            // A machine without any certificates will do.
            ("AWS_DISABLE_SYSTEM_CERTIFICATES", "true"),
        ];
        Destination::with_settings(url, settings.map(|(key, value)| (key.to_owned(), value.to_owned())))
            .unwrap()
    }

    /// A reader that is not ours.
    fn reader(&self) -> AmazonS3 {
        let _ = ring::default_provider().install_default();
        AmazonS3Builder::new()
            .with_endpoint(format!("http://127.0.0.1:{}", self.port))
            .with_allow_http(true)
            .with_access_key_id(KEY)
            .with_secret_access_key(SECRET)
            .with_bucket_name(BUCKET)
            .with_config(AmazonS3ConfigKey::Client(ClientConfigKey::NoSystemCertificates), "true")
            .build()
            .unwrap()
    }
}

impl Drop for Storage {
    fn drop(&mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join(BUCKET)).unwrap();
    folder
}

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap()
}

/// Bytes that are another chunk's nowhere.
fn chunk(index: usize) -> Vec<u8> {
    (0..100_000usize).map(|place| ((place * 31 + index * 7) % 251) as u8).collect()
}

fn name(index: usize) -> String {
    format!("high/{index:05}.glb")
}

/// Uploads the stream; waits in the middle until told to go on.
fn upload(place: &Destination, go_on: &mpsc::Receiver<()>) -> Result<(), DestinationError> {
    for index in 0..CHUNKS {
        if index == CHUNKS / 2 {
            go_on.recv().unwrap();
        }
        place.put(&name(index), &chunk(index), FileKind::Geometry)?;
    }
    place.put("match.json", manifest(1).as_bytes(), FileKind::Manifest)
}

#[test]
fn a_stream_is_uploaded_over_a_restart_with_its_manifest_last() {
    let folder = folder();
    let storage = Storage::start(folder.path(), 0);
    let port = storage.port;
    let place = storage.destination("s3://streams/matches/7/", SECRET);
    let reader = storage.reader();
    let prefix = object_store::path::Path::from("matches/7");
    let (done, looks) = (AtomicBool::new(false), AtomicU32::new(0));
    let (go_on, told) = mpsc::channel();
    std::thread::scope(|scope| {
        let uploading = scope.spawn(|| {
            let told = told;
            let result = upload(&place, &told);
            done.store(true, Ordering::Relaxed);
            result
        });
        let looking = scope.spawn(|| {
            // Whoever finds the manifest finds everything.
            runtime().block_on(async {
                let (manifest, high) = (prefix.clone().join("match.json"), prefix.clone().join("high"));
                while !done.load(Ordering::Relaxed) {
                    let found = reader.head(&manifest).await.is_ok();
                    let Ok(chunks) = reader.list_with_delimiter(Some(&high)).await else { continue };
                    let count = chunks.objects.len();
                    assert!(!found || count == CHUNKS, "a manifest with {count} chunks");
                    if !found && count == CHUNKS / 2 {
                        looks.fetch_add(1, Ordering::Relaxed);
                    }
                }
            });
        });
        wait_for("half of the stream to be seen", || {
            looks.load(Ordering::Relaxed) > 0 || uploading.is_finished()
        });
        // Killed, not stopped, and the upload goes on with nobody there.
        drop(storage);
        go_on.send(()).unwrap();
        std::thread::sleep(Duration::from_millis(500));
        assert!(!uploading.is_finished(), "the upload gave up: {:?}", uploading.join());
        let _storage = Storage::start(folder.path(), port);
        uploading.join().unwrap().unwrap();
        looking.join().unwrap();
        read_back(&place, &reader, &prefix);
    });
}

/// Everything is there, whole and in parts, with the labels that viewers need.
fn read_back(place: &Destination, reader: &AmazonS3, prefix: &object_store::path::Path) {
    let mut names: Vec<String> = (0..CHUNKS).map(name).collect();
    names.push("match.json".to_owned());
    assert_eq!(place.list().unwrap(), names);
    runtime().block_on(async {
        for index in 0..CHUNKS {
            let path: object_store::path::Path =
                prefix.parts().chain(object_store::path::Path::from(name(index)).parts()).collect();
            let bytes = chunk(index);
            assert_eq!(reader.get(&path).await.unwrap().bytes().await.unwrap(), bytes);
            assert_eq!(reader.get_range(&path, 1000..70_000).await.unwrap(), bytes[1000..70_000]);
            let answer = reader.get_opts(&path, GetOptions::default()).await.unwrap();
            assert_eq!(answer.attributes.get(&Attribute::ContentType).unwrap().as_ref(), "model/gltf-binary");
            assert_eq!(answer.attributes.get(&Attribute::CacheControl).unwrap().as_ref(), "no-cache");
        }
        let answer = reader.get(&prefix.clone().join("match.json")).await.unwrap();
        assert_eq!(answer.attributes.get(&Attribute::ContentType).unwrap().as_ref(), "application/json");
        assert_eq!(answer.bytes().await.unwrap(), manifest(1));
    });
}

#[test]
fn an_older_stream_goes_manifest_first_and_neighbours_stay() {
    let folder = folder();
    let storage = Storage::start(folder.path(), 0);
    let place = storage.destination("s3://streams/a", SECRET);
    let neighbour = storage.destination("s3://streams/ab", SECRET);
    for index in 0..3 {
        place.put(&name(index), b"old", FileKind::Geometry).unwrap();
        neighbour.put(&name(index), b"other", FileKind::Geometry).unwrap();
    }
    place.put("match.json", b"{}", FileKind::Manifest).unwrap();
    assert_eq!(place.remove_stale(|path| path != name(1)).unwrap(), 3);
    assert_eq!(place.list().unwrap(), [name(1)]);
    assert_eq!(neighbour.list().unwrap().len(), 3);
    place.delete(&name(1)).unwrap();
    place.delete(&name(1)).unwrap();
    assert_eq!(place.list().unwrap(), Vec::<String>::new());
}

#[test]
fn wrong_credentials_and_buckets_are_told_in_words() {
    let folder = folder();
    let storage = Storage::start(folder.path(), 0);
    let put = |url: &str, secret: &str| {
        let place = storage.destination(url, secret);
        place.put("high/00000.glb", b"chunk", FileKind::Geometry).unwrap_err()
    };
    let error = put("s3://streams/a", "wrong");
    assert!(matches!(error, DestinationError::Object { .. }));
    let error = error.to_string();
    for words in
        ["cannot write s3://streams/a/high/00000.glb", "SignatureDoesNotMatch", "check the credentials"]
    {
        assert!(error.contains(words), "{words}: {error}");
    }
    let listing = storage.destination("s3://streams/a", "wrong").list().unwrap_err().to_string();
    assert!(listing.contains("check the credentials"), "{listing}");
    assert!(!error.contains("wrong") && !error.contains('\n'), "{error}");

    // This server makes a bucket for whoever writes to one; others refuse that in the same words.
    let error = storage.destination("s3://nowhere/a", SECRET).list().unwrap_err().to_string();
    for words in ["cannot list s3://nowhere/a", "NoSuchBucket", "name of the bucket"] {
        assert!(error.contains(words), "{words}: {error}");
    }
    let error = storage.destination("s3://streams/a", SECRET).read("none.glb").unwrap_err().to_string();
    assert!(error.contains("cannot read s3://streams/a/none.glb"), "{error}");
}
