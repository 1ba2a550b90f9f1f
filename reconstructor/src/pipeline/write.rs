//! The last stages: meshes, moved onto their paths, into the stream, and the figures of every frame.

use std::{
    collections::{BTreeMap, btree_map::Entry},
    ops::Range,
    time::{Duration, Instant},
};

use protocol::{
    chunk::FrameQuality,
    manifest::{Person as StreamPerson, PersonId, Profile, Segment, SegmentKind},
};

use super::{
    PipelineError,
    air::{self, Heights},
    frames::each_frame,
    players::{FrameMasks, PersonDepth, of_frame},
    run::Run,
    work::Results,
};
use crate::{
    ball::BallEstimate,
    calibration::CameraEstimate,
    depth::{self, DepthMap, Moment, View},
    detection::Detection,
    encode::{StreamFrame, StreamHeader, StreamWriter},
    ingest::Clip,
    mesh::{self, BodySurface, Figure, MeshBudget, Skin},
    numbers::ShirtNumber,
    pose::Person,
    report::{Failure, FrameFigures, Loss, Progress, Stage},
    shots::ShotList,
    teams::Member,
    trajectory::{self, Path},
};

/// Depth maps are steadied with those of this many frames before and after.
const STEADY_FRAMES: usize = 2;

/// All that the last stages need.
pub(super) struct Scene<'a> {
    pub(super) out: &'a std::path::Path,
    pub(super) profile: Profile,
    pub(super) budget: MeshBudget,
    pub(super) detections: &'a [Vec<Detection>],
    pub(super) cameras: &'a [CameraEstimate],
    pub(super) people: &'a [Vec<Person>],
    pub(super) members: &'a [Member],
    pub(super) numbers: &'a BTreeMap<PersonId, ShirtNumber>,
    pub(super) masks: &'a [FrameMasks<'a>],
    pub(super) depths: &'a Results,
    pub(super) skins: &'a BTreeMap<PersonId, Skin>,
    pub(super) paths: &'a BTreeMap<PersonId, Path>,
    pub(super) ball: &'a [Option<BallEstimate>],
    pub(super) heights_m: &'a Heights,
}

impl Run<'_> {
    /// Meshes, moved onto their paths, to the stream; the figures of every frame.
    pub(super) fn write(&mut self, scene: &Scene<'_>) -> Result<Vec<FrameFigures>, PipelineError> {
        let started = Instant::now();
        let wanted: Vec<bool> = scene.cameras.iter().map(|estimate| estimate.camera.is_some()).collect();
        let progress = self.reporter.progress(Stage::Mesh, wanted.iter().filter(|wanted| **wanted).count());
        let mut writing = Writing {
            writer: StreamWriter::create(scene.out, &self.header(scene), scene.profile)?,
            figures: self.figures(scene),
            failures: Vec::new(),
            encode: Duration::ZERO,
        };
        let budget = scene.budget;
        let read = each_frame(
            || self.clip.frames(),
            self.options.threads,
            &wanted,
            || Ok(Depths::default()),
            |depths, frame| {
                let camera = scene.cameras.get(frame.index).and_then(|estimate| estimate.camera);
                depths.turn_to(frame.index, scene.depths, &self.shots);
                let mut lifted = Vec::new();
                for (id, found, _) in of_frame(frame.index, scene.masks, scene.people) {
                    if let (Some(camera), Some(map)) = (&camera, depths.steadied(scene, id)) {
                        let above_ground_m = scene.heights_m.get(&(frame.index, id)).copied().unwrap_or(0.0);
                        let figure = Figure { person: id, frame: frame.index, above_ground_m };
                        let body = mesh::lift(
                            &frame.image,
                            camera,
                            figure,
                            found,
                            &map,
                            scene.skins.get(&id),
                            &budget,
                        );
                        lifted.push((id, body.map_err(|error| error.to_string())));
                    }
                }
                Ok(lifted)
            },
            |index, lifted| writing.frame(&self.clip, index, lifted, scene, &progress),
        )?;
        drop(progress);
        self.check_all_read(read, wanted.iter().filter(|wanted| **wanted).count())?;
        let finishing = Instant::now();
        let Writing { writer, figures, failures, encode } = writing;
        writer.finish()?;
        for failure in failures {
            self.reporter.note(failure);
        }
        let encode = encode + finishing.elapsed();
        self.reporter.stage_done(Stage::Mesh, started.elapsed().saturating_sub(encode), 0);
        self.reporter.stage_done(Stage::Encode, encode, 0);
        Ok(figures)
    }

    fn header(&self, scene: &Scene<'_>) -> StreamHeader {
        let number_of = |member: &Member| scene.numbers.get(&member.person);
        let people = scene.members.iter().map(|member| StreamPerson {
            id: member.person,
            team: member.team.map(|team| team.name().to_owned()),
            team_confidence: member.team.map(|_| member.team_confidence as f32),
            role_confidence: member.role.map(|_| member.role_confidence as f32),
            role: member.role.map(|role| role.name().to_owned()),
            number: number_of(member).map(|read| read.number),
            number_confidence: number_of(member).map(|read| read.confidence as f32),
            shirt_rgb: member.shirt_rgb,
        });
        StreamHeader {
            timescale: self.clip.info().timescale,
            pitch: self.pitch,
            people: people.collect(),
            segments: self.segments(scene.cameras),
        }
    }

    /// The shots of the clip as they are shown, and the stretches without a camera between them.
    fn segments(&self, cameras: &[CameraEstimate]) -> Vec<Segment> {
        let frames = &self.clip.info().frames;
        let shown = |range: &Range<usize>| {
            cameras.get(range.clone()).into_iter().flatten().any(|estimate| estimate.camera.is_some())
        };
        let mut ranges: Vec<Range<usize>> = self.shots.shots.iter().map(|shot| shot.frames.clone()).collect();
        ranges.extend(self.shots.transitions.iter().map(|transition| transition.frames.clone()));
        ranges.sort_by_key(|range| range.start);
        let mut segments: Vec<Segment> = Vec::new();
        for range in ranges {
            let (Some(first), Some(last)) = (frames.get(range.start), frames.get(range.end - 1)) else {
                continue;
            };
            let kind = if shown(&range) { SegmentKind::Shot } else { SegmentKind::Gap };
            let duration = last.start + last.duration - first.start;
            match segments.last_mut() {
                // A dissolve beside a close-up: one stretch without a camera.
                Some(before) if before.kind == SegmentKind::Gap && kind == SegmentKind::Gap => {
                    before.duration = before.duration + duration;
                }
                _ => segments.push(Segment { start: first.start, duration, kind }),
            }
        }
        segments
    }

    /// The figures of every frame, before it is known who has a mesh.
    fn figures(&self, scene: &Scene<'_>) -> Vec<FrameFigures> {
        let frames = self.clip.info().frames.iter().enumerate();
        frames
            .map(|(index, frame)| {
                let estimate = scene.cameras.get(index).cloned().unwrap_or_default();
                let source =
                    estimate.camera.is_some().then(|| format!("{:?}", estimate.source).to_lowercase());
                FrameFigures {
                    frame: frame.clip_frame,
                    camera_solved: estimate.camera.is_some(),
                    camera_source: source.unwrap_or_default(),
                    line_residual_median_px: estimate.line_residual_median_px,
                    people_detected: scene.detections.get(index).map_or(0, Vec::len),
                    people_with_mesh: 0,
                    track_confidence_mean: None,
                }
            })
            .collect()
    }
}

/// The depth maps of a frame and of those around it; what the next frame needs, too, is not read again.
#[derive(Default)]
struct Depths {
    index: usize,
    frames: BTreeMap<usize, BTreeMap<u32, PersonDepth>>,
}

impl Depths {
    /// Has those of frame `index` and of its neighbours in the same shot: frames of another shot are of another camera.
    fn turn_to(&mut self, index: usize, depths: &Results, shots: &ShotList) {
        let shot = shots.shot_of(index);
        let around = index.saturating_sub(STEADY_FRAMES)..=index + STEADY_FRAMES;
        self.index = index;
        self.frames.retain(|frame, _| around.contains(frame) && shots.shot_of(*frame) == shot);
        for frame in around.filter(|&frame| shots.shot_of(frame) == shot) {
            if let Entry::Vacant(place) = self.frames.entry(frame)
                && let Some(maps) = depths.load(frame)
            {
                place.insert(maps);
            }
        }
    }

    /// The steadied depth map of somebody; `None` when there is none in this frame.
    fn steadied(&self, scene: &Scene<'_>, id: PersonId) -> Option<DepthMap> {
        let moments = self.frames.iter().filter_map(|(&frame, maps)| {
            let map = maps.get(&id.0)?.as_ref().ok()?;
            let camera = scene.cameras.get(frame)?.camera?;
            let person_index = scene.masks.get(frame)?.get(&id)?.sighting.person_index;
            let person = scene.people.get(frame)?.get(person_index)?;
            let view = View::from_camera(&camera, person.ground_m)?;
            Some(Moment { steps: frame as i32 - self.index as i32, map, joints: &person.joints, view })
        });
        let (own, others): (Vec<Moment<'_>>, Vec<Moment<'_>>) = moments.partition(|moment| moment.steps == 0);
        own.first().map(|own| depth::steady(own, &others))
    }
}

/// A stream being written, and what there is to say about it.
struct Writing {
    writer: StreamWriter,
    figures: Vec<FrameFigures>,
    failures: Vec<Failure>,
    encode: Duration,
}

impl Writing {
    /// Adds one frame.
    fn frame(
        &mut self,
        clip: &Clip,
        index: usize,
        lifted: Vec<(PersonId, Result<BodySurface, String>)>,
        scene: &Scene<'_>,
        progress: &Progress,
    ) -> Result<(), PipelineError> {
        let (Some(time), Some(figures)) = (clip.info().frames.get(index), self.figures.get_mut(index)) else {
            return Ok(());
        };
        let mut surfaces = Vec::new();
        for (person, body) in lifted {
            match body {
                Ok(surface) => {
                    if surface.clustered {
                        let reason = "simplified by clustering: the body may not be closed".to_owned();
                        let (stage, frame, person) = (Stage::Mesh, Some(time.clip_frame), Some(person.0));
                        self.failures.push(Failure { stage, loss: Loss::Fallback, frame, person, reason });
                    }
                    surfaces.push(surface);
                }
                Err(reason) => self.failures.push(Failure {
                    stage: Stage::Mesh,
                    loss: Loss::LeftOut,
                    frame: Some(time.clip_frame),
                    person: Some(person.0),
                    reason,
                }),
            }
        }
        trajectory::place(&mut surfaces, scene.paths);
        figures.people_with_mesh = surfaces.len();
        let confidence: f64 = surfaces.iter().map(|surface| f64::from(surface.confidence)).sum();
        figures.track_confidence_mean = (!surfaces.is_empty()).then(|| confidence / surfaces.len() as f64);
        let started = Instant::now();
        self.writer.push_frame(StreamFrame {
            clip_frame: time.clip_frame,
            start: time.start,
            duration: time.duration,
            camera: scene.cameras.get(index).and_then(|estimate| estimate.camera),
            quality: FrameQuality {
                line_residual_px: figures.line_residual_median_px.map(|residual| residual as f32),
                track_confidence: figures.track_confidence_mean.map(|confidence| confidence as f32),
            },
            ball: scene.ball.get(index).copied().flatten().map(air::in_stream),
            surfaces,
        })?;
        self.encode += started.elapsed();
        progress.advance(1);
        Ok(())
    }
}
