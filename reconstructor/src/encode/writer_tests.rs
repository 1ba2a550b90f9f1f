//! Folders written, overwritten, read back, and disks that refuse.

use std::fs;

use glam::Vec3;
use image::{Rgb, RgbImage};
use protocol::{
    chunk::FrameQuality,
    limits::Limits,
    manifest::{FILE_NAME, Person, PersonId, SegmentKind},
    pitch::Pitch,
    sample,
    time::{Ticks, Timescale},
};

use super::*;
use crate::encode::{EncodeError, FileError, StreamError, StreamReader, read_stream};

fn header(people: u32) -> StreamHeader {
    StreamHeader {
        timescale: Timescale { numerator: 30_000, denominator: 1 },
        pitch: Pitch::default(),
        people: (0..people)
            .map(|id| Person {
                id: PersonId(id),
                team: None,
                team_confidence: None,
                role: None,
                role_confidence: None,
                number: None,
                number_confidence: None,
                shirt_rgb: None,
            })
            .collect(),
        segments: Vec::new(),
    }
}

/// The picture of a frame's atlas.
fn atlas_of(frame: &ChunkFrame) -> RgbImage {
    match frame.atlas.as_ref().unwrap() {
        FrameAtlas::Encoded(file) => image::load_from_memory(&file.bytes).unwrap().to_rgb8(),
        FrameAtlas::Pixels(picture) => {
            let pixels =
                picture.rgba.as_chunks::<4>().0.iter().flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]);
            RgbImage::from_raw(picture.width_px, picture.height_px, pixels.collect()).unwrap()
        }
    }
}

#[test]
fn a_shot_begins_a_chunk_and_segments_end_with_the_stream() {
    let folder = tempfile::tempdir().unwrap();
    let ticks = |frames: u32| frame(frames, 0).start;
    let segment =
        |from: u32, to: u32, kind| Segment { start: ticks(from), duration: ticks(to) - ticks(from), kind };
    let segments = vec![
        segment(0, 10, SegmentKind::Shot),
        segment(10, 14, SegmentKind::Gap),
        segment(14, 90, SegmentKind::Shot),
        segment(90, 95, SegmentKind::Gap),
    ];
    let mut writer =
        StreamWriter::create(folder.path(), &StreamHeader { segments, ..header(1) }, Profile::Plain).unwrap();
    for index in (0..10).chain(14..20) {
        writer.push_frame(frame(index, 1)).unwrap();
    }
    let manifest = writer.finish().unwrap();
    let starts: Vec<Ticks> = manifest.representations[0].chunks.iter().map(|chunk| chunk.start).collect();
    assert_eq!(starts, [ticks(0), ticks(14)]);
    assert_eq!(manifest.segments.len(), 3);
    assert_eq!(manifest.segments[2].duration, ticks(20) - ticks(14));
}

/// The sample's people as surfaces: one flat colour per person.
fn frame(index: u32, people: u32) -> StreamFrame {
    let sample = sample::frame_of(index, people);
    StreamFrame {
        clip_frame: sample.clip_frame,
        start: sample.start,
        duration: sample.duration,
        camera: sample.camera,
        quality: FrameQuality::default(),
        ball: sample.ball,
        surfaces: sample
            .bodies
            .into_iter()
            .map(|body| BodySurface {
                person: body.person,
                frame: index as usize,
                anchor_m: body.anchor_m.as_dvec3(),
                mesh: body.mesh,
                texture: RgbImage::from_pixel(40, 90, colour(body.person)),
                guessed_from_u: 0.5,
                confidence: 1.0,
                clustered: false,
            })
            .collect(),
    }
}

fn colour(person: PersonId) -> Rgb<u8> {
    Rgb([40 + 60 * person.0 as u8, 200 - 50 * person.0 as u8, 90])
}

fn write(folder: &Path, frames: u32, people: u32) -> Manifest {
    let mut writer = StreamWriter::create(folder, &header(people), Profile::Plain).unwrap();
    for index in 0..frames {
        writer.push_frame(frame(index, people)).unwrap();
    }
    writer.finish().unwrap()
}

#[test]
fn a_stream_comes_back_with_its_people_colours_and_times() {
    let folder = tempfile::tempdir().unwrap();
    let written = write(folder.path(), 65, 3);
    let (manifest, chunks) = read_stream(folder.path(), &Limits::default()).unwrap();
    assert_eq!(manifest, written);
    assert_eq!(chunks.iter().map(|chunk| chunk.frames.len()).collect::<Vec<_>>(), [30, 30, 5]);
    assert_eq!(manifest.duration, Ticks(65 * 1001));
    for (index, frame) in chunks.iter().flat_map(|chunk| &chunk.frames).enumerate() {
        assert_eq!(frame.start, Ticks(index as i64 * 1001));
        let atlas = atlas_of(frame);
        for body in &frame.bodies {
            assert_eq!(body.anchor_m, sample::anchor_of(index as u32, body.person.0));
            let [u, v] = body.mesh.uvs[0];
            let pixel =
                atlas.get_pixel((u * atlas.width() as f32) as u32, (v * atlas.height() as f32) as u32);
            let difference = pixel.0.iter().zip(colour(body.person).0).map(|(a, b)| a.abs_diff(b)).max();
            assert!(difference.unwrap() < 12, "person {} has colour {pixel:?}", body.person.0);
        }
    }
    let pitch = StreamReader::open(folder.path(), &Limits::default()).unwrap().static_scene().unwrap();
    assert!(pitch.unwrap().starts_with(b"glTF"));
}

#[test]
fn an_older_longer_stream_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), 95, 1);
    let mut writer = StreamWriter::create(folder.path(), &header(1), Profile::Plain).unwrap();
    assert!(
        !folder.path().join(FILE_NAME).exists(),
        "the old manifest would name chunks that are going away"
    );
    writer.push_frame(frame(0, 1)).unwrap();
    writer.finish().unwrap();
    let mut names: Vec<_> = fs::read_dir(folder.path().join("high"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["00000.glb"]);
}

#[test]
fn a_body_without_triangles_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = StreamWriter::create(folder.path(), &header(2), Profile::Plain).unwrap();
    let mut first = frame(0, 2);
    first.surfaces[0].mesh.triangles.clear();
    writer.push_frame(first).unwrap();
    writer.finish().unwrap();
    let (_, chunks) = read_stream(folder.path(), &Limits::default()).unwrap();
    let people: Vec<_> = chunks[0].frames[0].bodies.iter().map(|body| body.person.0).collect();
    assert_eq!(people, [1]);
}

#[test]
fn wrong_order_strangers_and_nothing_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = StreamWriter::create(folder.path(), &header(1), Profile::Plain).unwrap();
    writer.push_frame(frame(1, 1)).unwrap();
    assert!(matches!(writer.push_frame(frame(0, 1)), Err(EncodeError::Order { clip_frame: 150 })));
    assert!(matches!(
        writer.push_frame(frame(2, 2)),
        Err(EncodeError::UnknownPerson { person: PersonId(1), .. })
    ));
    let empty = StreamWriter::create(folder.path(), &header(1), Profile::Plain).unwrap();
    assert!(matches!(empty.finish(), Err(EncodeError::NoFrames)));
}

#[test]
fn a_full_disk_names_the_file_and_leaves_no_manifest() {
    // /dev/full is a disk that is always full; the chunks' folder is a link to it in spirit: a file where a folder
    // should be is the nearest thing that needs no privileges.
    let folder = tempfile::tempdir().unwrap();
    let mut writer = StreamWriter::create(folder.path(), &header(1), Profile::Plain).unwrap();
    fs::remove_dir_all(folder.path().join("high")).unwrap();
    fs::write(folder.path().join("high"), b"in the way").unwrap();
    writer.push_frame(frame(0, 1)).unwrap();
    let message = writer.finish().unwrap_err().to_string();
    assert!(message.contains("high/00000.glb") && message.contains("; "), "{message}");
    assert!(!folder.path().join(FILE_NAME).exists());
    let full =
        FileError::new("write", Path::new("stream/high/00007.glb"))(std::io::ErrorKind::StorageFull.into());
    assert!(full.to_string().contains("free some space"), "{full}");
}

#[test]
fn a_missing_stream_is_one_clear_line() {
    let folder = tempfile::tempdir().unwrap();
    let error = StreamReader::open(folder.path(), &Limits::default()).unwrap_err();
    assert!(matches!(error, StreamError::File(_)));
    assert!(error.to_string().contains(FILE_NAME) && !error.to_string().contains('\n'), "{error}");
}

#[test]
fn the_middle_of_a_player_moves_by_less_than_half_a_millimetre() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), 1, 3);
    let (_, chunks) = read_stream(folder.path(), &Limits::default()).unwrap();
    let original = frame(0, 3);
    for (surface, body) in original.surfaces.iter().zip(&chunks[0].frames[0].bodies) {
        let mean = |mesh: &Mesh| {
            mesh.positions_m.iter().map(|p| Vec3::from_array(*p)).sum::<Vec3>()
                / mesh.positions_m.len() as f32
        };
        let moved = (mean(&surface.mesh) - mean(&body.mesh)).length();
        assert!(moved < 0.0005, "person {} moved by {moved} m", body.person.0);
        assert!((surface.anchor_m - body.anchor_m.as_dvec3()).length() < 1e-6);
    }
}
