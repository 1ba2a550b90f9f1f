//! Tiny clips made by the `ffmpeg` program; skipped with a reason where it is absent.

use std::process::Command;

use tempfile::TempDir;

use super::*;

/// Runs `ffmpeg` with `arguments` (split at spaces) in a new folder; `None`, with a printed reason, when there is none.
fn make(arguments: &str) -> Option<TempDir> {
    let folder = tempfile::tempdir().unwrap();
    let result = Command::new("ffmpeg")
        .args(["-v", "error", "-y"])
        .args(arguments.split_whitespace())
        .current_dir(folder.path())
        .output();
    let reason = match result {
        Ok(output) if output.status.success() => return Some(folder),
        Ok(output) => String::from_utf8_lossy(&output.stderr).into_owned(),
        Err(error) => error.to_string(),
    };
    assert!(std::env::var_os("HOLOPITCH_REQUIRE_TOOLS").is_none(), "ffmpeg {arguments}: {reason}");
    eprintln!("skipped: ffmpeg {arguments}: {reason}");
    None
}

const NTSC: &str = "-f lavfi -i testsrc2=size=320x192:rate=30000/1001:duration=2";

#[test]
fn times_are_exact_at_ntsc_rate() {
    for (codec, file) in [
        ("libx264 -bf 2 -g 12", "a.mp4"),
        ("libx265 -x265-params log-level=none:keyint=12", "a.mkv"),
        ("libaom-av1 -cpu-used 8 -crf 40", "a.mp4"),
    ] {
        let video_timescale = if file == "a.mp4" { "-video_track_timescale 30000" } else { "" };
        let Some(folder) = make(&format!("{NTSC} -c:v {codec} -pix_fmt yuv420p {video_timescale} {file}"))
        else {
            continue;
        };
        let clip = Clip::open(&folder.path().join(file), Some(20..40)).unwrap();
        let info = clip.info();
        assert_eq!((info.width_px, info.height_px, info.frames.len()), (320, 192, 20), "{codec}");
        for (i, frame) in info.frames.iter().enumerate() {
            assert_eq!(frame.clip_frame as usize, 20 + i);
            let exact = i as f64 * 1001.0 / 30_000.0;
            // Matroska counts in milliseconds.
            let tolerance = if file == "a.mp4" { 1e-12 } else { 1.1e-3 };
            assert!((info.timescale.seconds(frame.start) - exact).abs() < tolerance, "{codec} frame {i}");
            assert!(
                (info.timescale.seconds(frame.duration) - 1001.0 / 30_000.0).abs() < tolerance.max(1e-12)
            );
            assert!(!frame.duplicate, "{codec} frame {i}");
        }
    }
}

/// Every frame of the clip has its own grey level, so that a picture tells its index.
fn ramp(options: &str) -> Option<TempDir> {
    make(&format!(
        "-f lavfi -i color=c=black:size=128x96:rate=25:duration=2,format=yuv420p,geq=lum=20+N*4:cb=128:cr=128 \
         -c:v libx264 -qp 0 {options}"
    ))
}

fn grey_levels(clip: &Clip) -> Vec<f64> {
    let mean =
        |frame: Frame| frame.image.as_raw().iter().map(|&v| f64::from(v)).sum::<f64>() / (128.0 * 96.0 * 3.0);
    clip.frames().unwrap().map(|frame| mean(frame.unwrap())).collect()
}

#[test]
fn a_range_gives_the_frames_it_names_whatever_the_key_frames() {
    for options in
        ["-g 250 clip.mp4", "-g 10 -bf 3 -x264-params open-gop=1 clip.mp4", "-g 7 clip.ts", "-g 7 clip.h264"]
    {
        let Some(folder) = ramp(options) else { return };
        let path = folder.path().join(options.split_whitespace().last().unwrap());
        let all = grey_levels(&Clip::open(&path, None).unwrap());
        assert_eq!(all.len(), 50, "{options}");
        for start in [0_u32, 1, 9, 10, 23, 48] {
            let range = start..(start + 2);
            let clip = Clip::open(&path, Some(range.clone())).unwrap();
            let part = grey_levels(&clip);
            assert_eq!(part, &all[range.start as usize..range.end as usize], "{options} {range:?}");
            assert_eq!(part, grey_levels(&clip), "reading again gives the same");
        }
        for (i, level) in all.iter().enumerate() {
            // Limited range: 16 is black, 235 is white.
            let expected = (20.0 + 4.0 * i as f64 - 16.0) * 255.0 / 219.0;
            assert!((level - expected).abs() < 1.5, "{options} frame {i}: {level} instead of {expected}");
        }
    }
}

#[test]
fn ranges_outside_the_clip_name_its_length() {
    let Some(folder) = ramp("clip.mp4") else { return };
    let path = folder.path().join("clip.mp4");
    for range in [10..10, 40..51, 60..70, Range { start: 20, end: 10 }] {
        let error = Clip::open(&path, Some(range.clone())).unwrap_err();
        assert!(matches!(error, IngestError::Range { available: 50, .. }), "{range:?}: {error}");
    }
    assert_eq!(Clip::open(&path, Some(49..50)).unwrap().info().frames.len(), 1);
}

#[test]
fn repeated_pictures_are_marked_and_moving_ones_are_not() {
    // 12.5 pictures a second shown at 25: every second frame repeats.
    let Some(folder) = make(
        "-f lavfi -i testsrc2=size=960x540:rate=25/2:duration=2,fps=25 -c:v libx264 -crf 20 -pix_fmt yuv420p a.mp4",
    ) else {
        return;
    };
    let clip = Clip::open(&folder.path().join("a.mp4"), Some(0..40)).unwrap();
    let marked: Vec<bool> = clip.info().frames.iter().map(|frame| frame.duplicate).collect();
    assert_eq!(marked.iter().filter(|&&duplicate| duplicate).count(), 20, "{marked:?}");
    assert!(marked.windows(2).all(|pair| pair[0] != pair[1]), "{marked:?}");
    let later = Clip::open(&folder.path().join("a.mp4"), Some(5..9)).unwrap();
    let part: Vec<bool> = later.info().frames.iter().map(|frame| frame.duplicate).collect();
    assert_eq!(part, &marked[5..9], "the frame before the range counts too");
}

#[test]
fn variable_rate_keeps_the_times_of_the_file() {
    let Some(folder) = make(&format!(
        "{NTSC} -vf select='not(eq(mod(n\\,5)\\,3))' -vsync vfr -c:v libx264 -video_track_timescale 30000 a.mp4"
    )) else {
        return;
    };
    let clip = Clip::open(&folder.path().join("a.mp4"), None).unwrap();
    let durations: Vec<i64> = clip.info().frames.iter().map(|frame| frame.duration.0).collect();
    assert_eq!(&durations[..8], &[1001, 1001, 2002, 1001, 1001, 1001, 2002, 1001]);
    let frames = &clip.info().frames;
    assert!(frames.windows(2).all(|pair| pair[0].start + pair[0].duration == pair[1].start));
}

#[test]
fn colours_follow_the_matrix_that_the_clip_names() {
    for (matrix, tag) in [("bt709", "bt709"), ("bt601", "smpte170m")] {
        let Some(folder) = make(&format!(
            "-f lavfi -i color=c=0x20A040:size=128x96:rate=25:duration=0.2,format=rgb24 -vf \
             scale=out_color_matrix={matrix}:out_range=tv,format=yuv420p -colorspace {tag} -color_range tv -c:v libx264 \
             -qp 0 a.mp4"
        )) else {
            return;
        };
        let clip = Clip::open(&folder.path().join("a.mp4"), None).unwrap();
        let frame = clip.frames().unwrap().next().unwrap().unwrap();
        let pixel = frame.image.get_pixel(60, 40).0;
        for (got, wanted) in pixel.iter().zip([0x20, 0xA0, 0x40]) {
            assert!(got.abs_diff(wanted) <= 3, "{matrix}: {pixel:?}");
        }
    }
}

#[test]
fn what_is_no_clip_gives_an_error_that_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let absent = folder.path().join("absent.mp4");
    assert!(matches!(Clip::open(&absent, None).unwrap_err(), IngestError::Open { .. }));
    assert!(matches!(Clip::open(folder.path(), None).unwrap_err(), IngestError::Open { .. }));
    let text = folder.path().join("text.mp4");
    std::fs::write(&text, "not a film").unwrap();
    let error = Clip::open(&text, None).unwrap_err();
    assert!(matches!(error, IngestError::Container { .. }), "{error}");
    assert!(error.to_string().contains("text.mp4"));
    // A play list would make FFmpeg open whatever it names.
    let list = folder.path().join("list.mp4");
    std::fs::write(&list, "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nother.ts\n").unwrap();
    assert!(matches!(Clip::open(&list, None).unwrap_err(), IngestError::Container { .. }));
    let Some(sound) = make("-f lavfi -i sine=duration=1 -c:a aac sound.mp4") else { return };
    let error = Clip::open(&sound.path().join("sound.mp4"), None).unwrap_err();
    assert!(matches!(error, IngestError::NoVideo { .. }), "{error}");
    let Some(small) = make("-f lavfi -i testsrc2=size=48x32:duration=0.2 -c:v libx264 small.mp4") else {
        return;
    };
    let error = Clip::open(&small.path().join("small.mp4"), None).unwrap_err();
    assert!(matches!(error, IngestError::PictureSize { width: 48, height: 32, .. }), "{error}");
}

#[test]
fn a_truncated_clip_can_be_read_up_to_the_damage() {
    let Some(folder) =
        make(&format!("{NTSC} -c:v libx264 -bf 0 -g 10 -pix_fmt yuv420p -movflags +faststart whole.mp4"))
    else {
        return;
    };
    let whole = std::fs::read(folder.path().join("whole.mp4")).unwrap();
    let cut = folder.path().join("cut.mp4");
    std::fs::write(&cut, &whole[..whole.len() * 2 / 3]).unwrap();
    let error = Clip::open(&cut, None).unwrap_err();
    let IngestError::Damaged { frame, .. } = error else { panic!("{error}") };
    assert!((20..55).contains(&frame), "{frame}");
    let clip = Clip::open(&cut, Some(0..frame)).unwrap();
    assert_eq!(clip.frames().unwrap().filter(Result::is_ok).count(), frame as usize);
    // The head alone has no picture at all.
    std::fs::write(&cut, &whole[..whole.len() / 50]).unwrap();
    let error = Clip::open(&cut, None).unwrap_err();
    assert!(matches!(error, IngestError::NoFrames { .. } | IngestError::Container { .. }), "{error}");
}

#[test]
fn flipped_bytes_never_panic_and_damage_is_named() {
    let Some(folder) =
        make(&format!("{NTSC} -c:v libx264 -bf 0 -g 30 -pix_fmt yuv420p -movflags +faststart whole.mp4"))
    else {
        return;
    };
    let whole = std::fs::read(folder.path().join("whole.mp4")).unwrap();
    let broken = folder.path().join("broken.mp4");
    let mut damaged = 0;
    for seed in 0..24_usize {
        let mut bytes = whole.clone();
        for k in 0..40 {
            let at = bytes.len() / 4 + (seed * 7919 + k * 104_729) % (bytes.len() / 2);
            bytes[at] ^= 1 << (k % 8);
        }
        std::fs::write(&broken, &bytes).unwrap();
        damaged +=
            usize::from(matches!(Clip::open(&broken, None), Err(IngestError::Damaged { frame: 1.., .. })));
    }
    assert!(damaged >= 20, "only {damaged} of 24 were noticed");
}

#[test]
fn the_real_clip_has_630_frames_although_its_header_says_772() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/clips/rma-sev-720p/soccer.mp4");
    if !path.exists() {
        eprintln!("skipped: {} is not here", path.display());
        return;
    }
    let clip = Clip::open(&path, None).unwrap();
    let info = clip.info();
    assert_eq!((info.width_px, info.height_px, info.frames.len()), (1280, 720, 630));
    assert_eq!(info.timescale, Timescale { numerator: 30_000, denominator: 1 });
    assert!(info.frames.iter().enumerate().all(|(i, frame)| frame.start == Ticks(1001 * i as i64)));
    assert_eq!(info.frames.iter().filter(|frame| frame.duplicate).count(), 0);
}
