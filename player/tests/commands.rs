//! The command line: exit codes, one-line errors, and what the commands write.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::process::{Command, Output};

use protocol::{manifest::FILE_NAME, sample::FIRST_CLIP_FRAME};

fn player(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_player")).args(arguments).output().expect("the player starts")
}

fn error_line(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(text.lines().count(), 1, "not one line: {text}");
    text
}

#[test]
fn help_has_an_example_for_every_command() {
    for command in [
        &["--help"][..],
        &["render", "--help"],
        &["inspect", "--help"],
        &["bench", "--help"],
        &["xr", "--help"],
    ] {
        let output = player(command);
        assert_eq!(output.status.code(), Some(0), "{command:?}");
        assert!(String::from_utf8_lossy(&output.stdout).contains("Examples:"), "{command:?}");
    }
}

#[test]
fn wrong_usage_is_exit_code_2() {
    for arguments in [
        &[][..],
        &["render", "somewhere"],
        &["render", "x", "--frame", "0", "--camera", "blimp", "--size", "10x10", "--out", "a.png"],
        &["render", "x", "--frame", "0", "--camera", "top", "--size", "0x10", "--out", "a.png"],
        &["somewhere", "--screenshot", "a.png"],
    ] {
        assert_eq!(player(arguments).status.code(), Some(2), "{arguments:?}");
    }
}

#[test]
fn a_stream_that_is_not_there_is_one_line_and_exit_code_1() {
    for arguments in [
        &["no-such-stream"][..],
        &["inspect", "no-such-stream"],
        &["inspect", "https://127.0.0.1:9/"],
        &["inspect", "http://127.0.0.1:9/"],
    ] {
        let output = player(arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        let line = error_line(&output);
        let address = arguments.last().unwrap();
        assert!(line.contains(address), "{line}");
    }
}

#[test]
fn a_stream_is_read_over_https_from_those_who_are_trusted() {
    use serving::server::{ServeOptions, Server, Tls};
    let folder = tempfile::tempdir().unwrap();
    support::write_match(folder.path(), 40);
    let address = "127.0.0.1:0".parse().unwrap();
    let server =
        Server::start(folder.path(), ServeOptions { address, tls: Tls::SelfMade, ..Default::default() })
            .unwrap();
    let certificate = folder.path().join("certificate.pem");
    std::fs::write(&certificate, server.self_made_certificate().unwrap()).unwrap();
    let inspect = |trusted: Option<&std::path::Path>| {
        Command::new(env!("CARGO_BIN_EXE_player"))
            .args(["inspect", &server.url()])
            .envs(trusted.map(|file| ("SSL_CERT_FILE", file)))
            .output()
            .unwrap()
    };
    let friend = inspect(Some(&certificate));
    assert!(friend.status.success(), "{}", String::from_utf8_lossy(&friend.stderr));
    let stranger = inspect(None);
    assert_eq!(stranger.status.code(), Some(1));
    let line = error_line(&stranger);
    assert!(line.contains(&server.url()), "{line}");
}

#[test]
fn a_machine_without_a_headset_is_one_line_and_exit_code_1() {
    let folder = tempfile::tempdir().unwrap();
    support::write_match(folder.path(), 5);
    let output = Command::new(env!("CARGO_BIN_EXE_player"))
        .args(["xr", folder.path().to_str().unwrap()])
        .env("XR_RUNTIME_JSON", folder.path().join("no-runtime.json"))
        .env("XR_LOADER_DEBUG", "none")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let line = error_line(&output);
    assert!(
        line.contains("OpenXR") && line.contains("install") || line.contains("XR_RUNTIME_JSON"),
        "{line}"
    );
}

#[test]
fn inspect_counts_and_a_changed_byte_is_found() {
    let folder = tempfile::tempdir().unwrap();
    support::write_match(folder.path(), 45);
    let (stream, json) = (folder.path().to_str().unwrap(), folder.path().join("figures.json"));
    let output = player(&["inspect", stream, "--json", json.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let figures: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert_eq!(figures["frames"], 45);
    assert_eq!(figures["people_per_frame_mean"], 6.0);
    assert_eq!(figures["first_clip_frame"], FIRST_CLIP_FRAME);
    assert_eq!(figures["hashes_verified"], 2);
    let parts =
        ["geometry_bytes", "texture_bytes", "index_bytes"].map(|part| figures[part].as_u64().unwrap());
    assert_eq!(parts.iter().sum::<u64>(), figures["chunk_bytes"].as_u64().unwrap());
    assert!(parts.iter().all(|bytes| *bytes > 0));

    let chunk = folder.path().join("high/00001.glb");
    let mut bytes = std::fs::read(&chunk).unwrap();
    bytes[200] ^= 1;
    std::fs::write(&chunk, bytes).unwrap();
    let output = player(&["inspect", stream]);
    assert_eq!(output.status.code(), Some(1));
    let line = error_line(&output);
    assert!(line.contains("00001.glb") && line.contains("BLAKE3"), "{line}");
}

#[test]
fn a_manifest_that_is_cut_short_is_named() {
    let folder = tempfile::tempdir().unwrap();
    support::write_match(folder.path(), 5);
    let path = folder.path().join(FILE_NAME);
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, &text[..text.len() / 2]).unwrap();
    let output = player(&["inspect", folder.path().to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    assert!(error_line(&output).contains(FILE_NAME));
}

#[test]
fn a_turntable_needs_somebody_who_is_there() {
    let folder = tempfile::tempdir().unwrap();
    support::write_match(folder.path(), 35);
    let stream = folder.path().to_str().unwrap();
    let out = folder.path().join("a.png");
    let common = ["render", stream, "--frame", "3", "--size", "48x64", "--out", out.to_str().unwrap()];
    let output = player(&[&common[..], &["--turntable", "4", "--person", "77"]].concat());
    assert_eq!(output.status.code(), Some(1));
    assert!(error_line(&output).contains("person 77 is not in this frame: it has 0, 1, 2, 3, 4, 5"));
    for wrong in [&["--turntable", "4"][..], &["--person", "1"], &["--camera", "top", "--guessed", "maybe"]] {
        assert_eq!(player(&[&common[..], wrong].concat()).status.code(), Some(2), "{wrong:?}");
    }
}

#[test]
fn frames_beyond_the_end_are_refused_with_the_range() {
    let folder = tempfile::tempdir().unwrap();
    support::write_match(folder.path(), 35);
    let out = folder.path().join("a.png");
    let arguments = ["--camera", "top", "--size", "64x36", "--out", out.to_str().unwrap()];
    let stream = folder.path().to_str().unwrap();
    let output = player(&[&["render", stream, "--frame", "35"], &arguments[..]].concat());
    assert_eq!(output.status.code(), Some(1));
    assert!(error_line(&output).contains("frames 0 to 34"));
    assert!(!out.exists());
}
