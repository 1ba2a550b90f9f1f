//! The truth of a rendered clip as tracking is measured on: boxes, who counts, teams, roles, shots.

use std::{collections::BTreeMap, path::Path};

use glam::DVec2;
use protocol::pitch::Pitch;
use serde::Deserialize;

use super::{
    super::frame_truth::{self, ShotLine, TruthError, WhoTruth},
    scores::TrackedBox,
};
use crate::geometry::PixelBox;

/// Boxes of a frame at most; a line more is a broken file.
const BOXES_MAX: usize = 10_000;

/// One frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct TrueFrame {
    /// Number of the shot; `None` where two pictures are mixed.
    pub(super) shot: Option<usize>,
    pub(super) counts: Vec<TrackedBox>,
    /// Mostly outside the picture.
    pub(super) ignored: Vec<TrackedBox>,
}

/// All of it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Truth {
    pub(super) pitch: Pitch,
    pub(super) people: BTreeMap<u32, WhoTruth>,
    pub(super) frames: Vec<TrueFrame>,
}

#[derive(Deserialize)]
struct Line {
    shot: ShotLine,
}

impl Truth {
    pub(super) fn read(data: &Path) -> Result<Self, TruthError> {
        let whole = frame_truth::clip(data)?;
        let lines: Vec<Line> = frame_truth::frames(data)?;
        let shown = |Line { shot }: Line| (!shot.is_mixed()).then_some(shot.shot);
        let frames = lines.into_iter().map(|line| TrueFrame { shot: shown(line), ..TrueFrame::default() });
        let mut frames: Vec<TrueFrame> = frames.collect();
        let path = data.join("mot/gt/gt.txt");
        let text = std::fs::read_to_string(&path).map_err(|error| TruthError::read(&path, error))?;
        for (line, row) in text.lines().enumerate() {
            let wrong = |reason: String| TruthError::line(&path, line + 1, reason);
            let row = Row::read(row).map_err(wrong)?;
            let frame = row.frame.checked_sub(1).and_then(|frame| frames.get_mut(frame));
            let frame = frame.ok_or_else(|| wrong(format!("frame {} is not in frames.jsonl", row.frame)))?;
            if frame.counts.len() + frame.ignored.len() >= BOXES_MAX {
                return Err(wrong(format!("more than {BOXES_MAX} people in a frame")));
            }
            if frame.counts.iter().chain(&frame.ignored).any(|other| other.id == row.person.id) {
                return Err(wrong(format!("person {} twice in frame {}", row.person.id + 1, row.frame)));
            }
            if row.counts { frame.counts.push(row.person) } else { frame.ignored.push(row.person) }
        }
        let people = whole.people.into_iter().map(|person| (person.id, person)).collect();
        Ok(Self { pitch: whole.pitch, people, frames })
    }
}

/// A line of `gt.txt`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row {
    /// From 1.
    frame: usize,
    person: TrackedBox,
    counts: bool,
}

impl Row {
    fn read(text: &str) -> Result<Self, String> {
        let fields: Vec<f64> = text
            .split(',')
            .map(|word| word.trim().parse().map_err(|_| format!("`{word}` is no number")))
            .collect::<Result<_, String>>()?;
        let [frame, id, left, top, width, height, counts, ..] = fields[..] else {
            return Err(format!("{} fields instead of at least 7", fields.len()));
        };
        let whole = |value: f64, name: &str| {
            let fits = value.fract() == 0.0 && (1.0..=f64::from(u32::MAX)).contains(&value);
            if fits { Ok(value as u32) } else { Err(format!("{name} {value} is no whole number from 1")) }
        };
        if ![left, top, width, height].iter().all(|v| v.is_finite()) || width < 0.0 || height < 0.0 {
            return Err(format!("{width} × {height} px at {left}, {top} is no box"));
        }
        // Pixel 1 of the format begins half a pixel before the middle of the first pixel, which is 0 here.
        let min = DVec2::new(left, top) - 1.5;
        let bounds = PixelBox { min, max: min + DVec2::new(width, height) };
        let person = TrackedBox { id: whole(id, "identity")? - 1, bounds };
        Ok(Self { frame: whole(frame, "frame")? as usize, person, counts: counts != 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_a_box_in_our_pixels() {
        let row = Row::read("3,2,9.5,20.5,10,30,0,1,0.5").unwrap();
        assert_eq!((row.frame, row.person.id, row.counts), (3, 1, false));
        assert_eq!(row.person.bounds, PixelBox { min: DVec2::new(8.0, 19.0), max: DVec2::new(18.0, 49.0) });
    }

    #[test]
    fn broken_rows_are_explained() {
        for broken in [
            "",
            "1,2,3",
            "1,1,a,2,3,4,1",
            "0,1,1,1,1,1,1",
            "1,0,1,1,1,1,1",
            "1,1.5,1,1,1,1,1",
            "1,1,nan,1,1,1,1",
            "1,1,1,1,-4,1,1",
            "1,1,1,inf,1,1,1",
        ] {
            assert!(!Row::read(broken).unwrap_err().is_empty(), "{broken}");
        }
    }

    #[test]
    fn a_broken_file_is_named_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        let error = |_: ()| Truth::read(folder.path()).unwrap_err().to_string();
        assert!(error(()).contains("truth.json"));
        write("truth.json", r#"{"pitch":{"length_m":105.0,"width_m":68.0},"people":[]}"#);
        write("frames.jsonl", "{\"shot\":{\"shot\":0,\"mixed_with\":null}}\nno\n");
        assert!(error(()).contains("frames.jsonl, line 2"), "{}", error(()));
        write("frames.jsonl", "{\"shot\":{\"shot\":0,\"mixed_with\":null}}\n");
        std::fs::create_dir_all(folder.path().join("mot/gt")).unwrap();
        for (text, wrong) in
            [("1,1,1,1,1,1,1\n2,1,1,1,1,1,1\n", "line 2"), ("1,1,1,1,1,1,1\n1,1,1,1,1,1,1\n", "twice")]
        {
            write("mot/gt/gt.txt", text);
            assert!(error(()).contains(wrong), "{}", error(()));
        }
        write("mot/gt/gt.txt", "1,1,1,1,1,1,1\n1,2,1,1,1,1,0\n");
        let frame = &Truth::read(folder.path()).unwrap().frames[0];
        assert_eq!((frame.shot, frame.counts.len(), frame.ignored.len()), (Some(0), 1, 1));
    }
}
