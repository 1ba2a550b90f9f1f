//! How well masks fit (DESIGN section 6), method by method, and how far joints are from the true ones: on a rendered clip with maps.
//!
//! A true mask is the pixels of a person that nothing covers. Counted are people in view of whom at least a quarter is seen, in frames of
//! one picture, whom tracking follows: people are matched one to one by the overlap of their boxes, at most [`MATCH_RADIUS_M`] apart on the
//! pitch. A matched person without a mask counts with an overlap of 0.

mod figures;
mod truth;

use std::path::PathBuf;

use image::GrayImage;

pub use figures::{MethodFigures, SegmentationFigures};

use crate::{
    assignment::{Pair, most_gain},
    geometry::Mask,
    ingest::IngestError,
    pipeline::{Observation, ObserveOptions, PipelineError, observe},
    pose::Person,
    report::{Progress, Reporter, thread_cpu_s},
    segmentation::{self, FrameSeen, Method, PlayerMask, SegmentationError, Segmenter},
    tracking::TrackingLimits,
};
use figures::{Compared, MethodTally, joint_errors_m};
use truth::{TrueFrame, TruePerson};

use super::{
    frame_truth::{self, TruthError},
    matches::MATCH_RADIUS_M,
};

/// Overlap of boxes (intersection over union) below which two people are never the same.
const BOX_OVERLAP_MIN: f64 = 0.2;
/// People of whom less is seen do not count, as in the labels of our sets.
const VISIBLE_SHARE_MIN: f64 = 0.25;
/// Somebody overlaps with others when their boxes overlap by more than this, or when less than this share of him is seen.
const BOXES_OVERLAP: f64 = 0.05;
const WHOLE_SHARE: f64 = 0.95;

/// Why masks could not be measured.
#[derive(Debug, thiserror::Error)]
pub enum SegmentationEvaluationError {
    /// The truth.
    #[error(transparent)]
    Truth(#[from] TruthError),
    /// What was to be seen before masks.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The clip.
    #[error(transparent)]
    Ingest(#[from] IngestError),
    /// The masks.
    #[error(transparent)]
    Segmentation(#[from] SegmentationError),
}

/// What is measured.
#[derive(Clone, Debug)]
pub struct SegmentationOptions {
    /// Folder of a rendered clip with maps.
    pub data: PathBuf,
    /// Where results of the stages before are kept; a temporary folder when `None`.
    pub work: Option<PathBuf>,
    /// The methods; the first one's figures stand for the stage.
    pub methods: Vec<Method>,
}

/// Looks at the clip as the product does, makes masks by each method and holds them against the truth.
///
/// # Errors
/// When the folder is no rendered clip with maps, or a stage before masks fails.
pub fn evaluate(options: &SegmentationOptions) -> Result<SegmentationFigures, SegmentationEvaluationError> {
    let true_frames: Vec<TrueFrame> = frame_truth::frames(&options.data)?;
    let observing = ObserveOptions {
        clip: options.data.join("clip.mp4"),
        calibration: None,
        pitch: Some(frame_truth::clip(&options.data)?.pitch),
        frames: None,
        work: options.work.clone(),
        tracking: TrackingLimits::default(),
        threads: std::thread::available_parallelism().map_or(1, usize::from),
    };
    let looked = observe(&observing, &mut Reporter::new())?;
    let pairs = all_pairs(&true_frames, &looked);
    let mut tallies = masks_of(&options.methods, &looked)?;
    let size = (looked.clip.info().width_px, looked.clip.info().height_px);
    let mut figures = SegmentationFigures::default();
    let mut joints_m = Vec::new();
    let progress = Progress::new("against the truth", true_frames.len() as u64);
    for (index, (frame, pairs)) in true_frames.iter().zip(&pairs).enumerate() {
        progress.advance(1);
        figures.person_frames_true += frame.people.iter().filter(|person| counts(frame, person)).count();
        if pairs.is_empty() {
            continue;
        }
        let map = truth::people_map(&options.data, frame.frame, size)?;
        let mut areas = [0_usize; 256];
        for label in map.as_raw() {
            areas[usize::from(*label)] += 1;
        }
        let people = looked.seen.people.get(index).map_or(&[][..], Vec::as_slice);
        for &(true_index, person_index) in pairs {
            let (Some(true_person), Some(person)) = (frame.people.get(true_index), people.get(person_index))
            else {
                continue;
            };
            figures.person_frames_matched += 1;
            joints_m.extend(joint_errors_m(&frame.camera, true_person, person, &map));
            let compared = compared(frame, true_person);
            for tally in &mut tallies {
                let mask = tally.mask(index, person_index);
                let iou = true_person
                    .label()
                    .map_or(0.0, |label| overlap(mask, &map, label, areas[usize::from(label)]));
                tally.add(&compared, iou);
            }
        }
    }
    drop(progress);
    figures.finish(tallies, &joints_m);
    Ok(figures)
}

/// Runs every method over the clip at once: its pictures are read a single time.
fn masks_of(
    methods: &[Method],
    looked: &Observation,
) -> Result<Vec<MethodTally>, SegmentationEvaluationError> {
    let frames = looked.seen.people.len();
    let followed = segmentation::followed(&looked.seen.tracks, frames);
    let mut running: Vec<(MethodTally, Box<dyn Segmenter>, Vec<PlayerMask>)> = Vec::new();
    for &method in methods {
        running.push((MethodTally::new(method), method.open()?, Vec::new()));
    }
    let progress = Progress::new("masks", frames as u64);
    for frame in looked.clip.frames()? {
        let frame = frame?;
        let (Some(people), Some(followed)) = (looked.seen.people.get(frame.index), followed.get(frame.index))
        else {
            continue;
        };
        let passing = FrameSeen { index: frame.index, picture: &frame.image, people, followed };
        for (tally, segmenter, masks) in &mut running {
            let started = thread_cpu_s();
            masks.extend(segmenter.push(&passing)?);
            tally.cpu_s += thread_cpu_s() - started;
        }
        progress.advance(1);
    }
    let mut tallies = Vec::new();
    for (mut tally, mut segmenter, mut masks) in running {
        let started = thread_cpu_s();
        masks.extend(segmenter.finish()?);
        let settled = segmentation::settled(masks, &looked.seen.people);
        tally.cpu_s += thread_cpu_s() - started;
        tally.keep(settled);
        tallies.push(tally);
    }
    Ok(tallies)
}

fn counts(frame: &TrueFrame, person: &TruePerson) -> bool {
    !frame.shot.is_mixed() && person.in_view && person.visible_share >= VISIBLE_SHARE_MIN
}

/// Who of the truth (index in its people) is whom of ours (index in ours), frame by frame.
fn all_pairs(true_frames: &[TrueFrame], looked: &Observation) -> Vec<Vec<(usize, usize)>> {
    let followed = segmentation::followed(&looked.seen.tracks, looked.seen.people.len());
    let frames = true_frames.iter().zip(looked.seen.people.iter().zip(followed));
    frames
        .map(|(frame, (people, followed))| {
            let ours: Vec<(usize, &Person)> =
                followed.iter().filter_map(|&(_, index)| Some((index, people.get(index)?))).collect();
            let true_people: Vec<(usize, &TruePerson)> =
                frame.people.iter().enumerate().filter(|(_, person)| counts(frame, person)).collect();
            pairs(&true_people, &ours)
        })
        .collect()
}

fn pairs(true_people: &[(usize, &TruePerson)], ours: &[(usize, &Person)]) -> Vec<(usize, usize)> {
    let mut fitting = Vec::new();
    for (row, (_, truth)) in true_people.iter().enumerate() {
        for (column, (_, person)) in ours.iter().enumerate() {
            // Behind a goal nothing in the picture tells the two ends of the pitch apart; boxes tell people apart all the same.
            let turned = -person.ground_m;
            let apart_m = truth.anchor_m.distance(person.ground_m).min(truth.anchor_m.distance(turned));
            let overlap = truth.bounds().iou(&person.bounds);
            if apart_m <= MATCH_RADIUS_M && overlap >= BOX_OVERLAP_MIN {
                fitting.push(Pair { row, column, gain: overlap });
            }
        }
    }
    let ours_of = most_gain(true_people.len(), ours.len(), &fitting);
    let chosen = true_people.iter().zip(ours_of);
    chosen.filter_map(|((index, _), column)| Some((*index, ours.get(column?)?.0))).collect()
}

/// What of a true person decides in which figures the mask counts.
fn compared(frame: &TrueFrame, person: &TruePerson) -> Compared {
    let bounds = person.bounds();
    let touched =
        frame.people.iter().any(|other| other.id != person.id && other.bounds().iou(&bounds) > BOXES_OVERLAP);
    Compared { height_px: bounds.size().y, overlapping: touched || person.visible_share < WHOLE_SHARE }
}

/// Intersection over union of a mask (coverage of at least one half) with the `area_px` pixels of one label.
fn overlap(mask: Option<&Mask>, map: &GrayImage, label: u8, area_px: usize) -> f64 {
    let empty = Mask::default();
    let mask = mask.unwrap_or(&empty);
    let (mut both, mut ours) = (0_usize, 0_usize);
    let width = mask.width.max(1) as usize;
    for (i, _) in mask.coverage.iter().enumerate().filter(|(_, coverage)| **coverage >= 128) {
        let at = |start: i32, offset: usize| u32::try_from(i64::from(start) + offset as i64).ok();
        let pixel = at(mask.x0, i % width).zip(at(mask.y0, i / width));
        let value = pixel.and_then(|(x, y)| map.get_pixel_checked(x, y));
        ours += 1;
        both += usize::from(value.is_some_and(|value| value.0[0] == label));
    }
    both as f64 / (area_px + ours - both).max(1) as f64
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};
    use image::Luma;

    use super::*;
    use crate::segmentation::tests::upright;

    #[test]
    fn overlap_counts_pixels_of_the_label_only() {
        let mut map = GrayImage::new(40, 40);
        for (x, y) in (10..20).flat_map(|x| (10..20).map(move |y| (x, y))) {
            map.put_pixel(x, y, Luma([3]));
        }
        map.put_pixel(30, 30, Luma([4]));
        let mask = |x0: i32| Mask { x0, y0: 10, width: 10, height: 10, coverage: vec![128; 100] };
        assert_eq!(overlap(Some(&mask(10)), &map, 3, 100), 1.0);
        assert_eq!(overlap(Some(&mask(15)), &map, 3, 100), 50.0 / 150.0);
        assert_eq!(overlap(Some(&mask(-5)), &map, 3, 100), 0.0);
        assert_eq!(overlap(None, &map, 3, 100), 0.0);
        assert_eq!(overlap(Some(&mask(10)), &map, 9, 0), 0.0);
    }

    fn true_person(id: u32, x: f64) -> TruePerson {
        let text = format!(
            r#"{{"id":{id},"box_px":[{},0,{},60],"in_view":true,"visible_share":1.0,"anchor_m":[{x},0,0],"joints_px":[]}}"#,
            x - 8.0,
            x + 8.0
        );
        serde_json::from_str(&text).unwrap()
    }

    #[test]
    fn people_are_matched_by_box_and_never_over_a_distance() {
        let at = |x: i32| Person { ground_m: DVec3::new(f64::from(x), 0.0, 0.0), ..upright(x, 8) };
        let (a, b) = (true_person(1, 100.0), true_person(2, 104.0));
        let ours = [at(105), at(101), at(300)];
        let truth = [(0, &a), (1, &b)];
        let numbered: Vec<(usize, &Person)> = ours.iter().enumerate().collect();
        // Within 1.5 m only: person 2 is 1 m from the first of ours, person 1 is 1 m from the second.
        assert_eq!(pairs(&truth, &numbered), [(0, 1), (1, 0)]);
        let far = Person { ground_m: DVec3::new(90.0, 0.0, 0.0), ..upright(101, 8) };
        assert_eq!(pairs(&truth[..1], &[(5, &far)]), []);
        let turned = Person { ground_m: DVec3::new(-100.0, 0.0, 0.0), ..upright(101, 8) };
        assert_eq!(pairs(&truth[..1], &[(5, &turned)]), [(0, 5)]);
        let elsewhere =
            Person { bounds: crate::geometry::PixelBox { min: DVec2::ZERO, max: DVec2::ONE }, ..at(101) };
        assert_eq!(pairs(&truth[..1], &[(5, &elsewhere)]), []);
    }
}
