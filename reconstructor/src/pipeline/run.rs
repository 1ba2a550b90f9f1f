//! One reconstruction under way: the clip, the work folder and the stages, each timed, resumed and reported.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::{Duration, Instant},
};

use protocol::{
    chunk::FrameQuality,
    manifest::{Person as StreamPerson, PersonId},
};
use serde::{Serialize, de::DeserializeOwned};

use super::{
    PipelineError, ReconstructOptions,
    frames::each_frame,
    kit,
    work::{Fingerprint, Results, WorkFolder},
};
use crate::{
    calibration::{self, Calibration, CalibrationError, CameraEstimate},
    depth::{self, DepthError, DepthEstimator, DepthMap},
    detection::{self, Detection, Detector},
    encode::{StreamFrame, StreamHeader, StreamWriter},
    inference,
    ingest::{Clip, Frame},
    mesh::{self, BodySurface},
    pose::{self, Person, PoseEstimator},
    report::{Failure, FrameFigures, Loss, Progress, ReconstructReport, Reporter, Stage},
    segmentation::{self, InstanceMaskSegmenter, PlayerMask},
    tracking::{self, Track},
    trajectory::{self, Path},
};

/// A depth map, or why there is none, and the shirt's colour.
type PersonDepth = (Result<DepthMap, String>, Option<[u8; 3]>);

/// The masks of a frame: whose, which of the frame's people, which pixels.
type FrameMasks<'a> = BTreeMap<PersonId, &'a PlayerMask>;

/// All that the last stages need.
pub(super) struct Scene<'a> {
    pub(super) detections: &'a [Vec<Detection>],
    pub(super) cameras: &'a [CameraEstimate],
    pub(super) people: &'a [Vec<Person>],
    pub(super) tracks: &'a [Track],
    pub(super) masks: &'a [FrameMasks<'a>],
    pub(super) depths: &'a Depths,
    pub(super) paths: &'a BTreeMap<PersonId, Path>,
}

/// Where the depth maps are, and what was learnt with them.
pub(super) struct Depths {
    results: Results,
    shirts: BTreeMap<PersonId, [u8; 3]>,
}

/// A reconstruction under way.
pub(super) struct Run<'a> {
    options: &'a ReconstructOptions,
    reporter: &'a mut Reporter,
    clip: Clip,
    calibration: Calibration,
    work: WorkFolder,
    /// Grows stage by stage, so that a stage's results also depend on all stages before it.
    fingerprint: Fingerprint,
}

impl<'a> Run<'a> {
    /// Opens everything that can be wrong before the long work begins.
    pub(super) fn open(
        options: &'a ReconstructOptions,
        reporter: &'a mut Reporter,
    ) -> Result<Self, PipelineError> {
        let started = Instant::now();
        let calibration = Calibration::read(&options.calibration)?;
        inference::initialize(None)?;
        let clip = Clip::open(&options.clip, options.frames.clone())?;
        let info = clip.info();
        calibration.check(info.width_px, info.height_px)?;
        if !info.frames.iter().any(|frame| frame.clip_frame == calibration.frame) {
            return Err(CalibrationError::FrameOutside {
                frame: calibration.frame,
                start: info.frames.first().map_or(0, |frame| frame.clip_frame),
                end: info.frames.last().map_or(0, |frame| frame.clip_frame + 1),
            }
            .into());
        }
        // A folder that cannot be written is known now, not after the long work.
        std::fs::create_dir_all(&options.out)
            .map_err(|source| PipelineError::Out { path: options.out.clone(), source })?;
        let fingerprint = Fingerprint::of_clip(&options.clip)
            .map_err(|source| PipelineError::Work { doing: "read", path: options.clip.clone(), source })?
            .with_program()?;
        let frames: Vec<u8> =
            clip.info().frames.iter().flat_map(|frame| frame.clip_frame.to_le_bytes()).collect();
        let work = WorkFolder::open(options.work.as_deref())?;
        reporter.stage_done(Stage::Ingest, started.elapsed(), 0);
        Ok(Self { options, reporter, clip, calibration, work, fingerprint: fingerprint.with(&frames) })
    }

    fn frame_count(&self) -> usize {
        self.clip.info().frames.len()
    }

    fn clip_frame(&self, index: usize) -> Option<u32> {
        self.clip.info().frames.get(index).map(|frame| frame.clip_frame)
    }

    /// The folder of a stage's results; `parts` is what they depend on besides the stages before.
    fn results(&mut self, stage: Stage, model: &str, parts: &[&[u8]]) -> Result<Results, PipelineError> {
        let mut fingerprint = self.fingerprint.clone().with(stage.name().as_bytes());
        if !model.is_empty() {
            fingerprint = fingerprint.with_file(&inference::model_path(model)?)?;
        }
        self.fingerprint = parts.iter().fold(fingerprint, |fingerprint, part| fingerprint.with(part));
        self.work.results(stage.name(), &self.fingerprint)
    }

    /// Runs a stage frame by frame: what the work folder has is taken from there, the rest is made in parallel and kept.
    fn per_frame<W, R>(
        &mut self,
        stage: Stage,
        results: &Results,
        wanted: &[bool],
        make: impl Fn() -> Result<W, PipelineError> + Sync,
        work: impl Fn(&mut W, &Frame) -> Result<R, PipelineError> + Sync,
    ) -> Result<Vec<Option<R>>, PipelineError>
    where
        R: Serialize + DeserializeOwned + Send,
    {
        let started = Instant::now();
        let mut all: Vec<Option<R>> = wanted
            .iter()
            .enumerate()
            .map(|(index, wanted)| wanted.then(|| results.load(index)).flatten())
            .collect();
        let missing: Vec<bool> =
            all.iter().zip(wanted).map(|(kept, wanted)| *wanted && kept.is_none()).collect();
        let resumed = all.iter().flatten().count();
        let to_do = missing.iter().filter(|missing| **missing).count();
        if resumed > 0 {
            tracing::info!("{}: {resumed} frames taken from the work folder, {to_do} to do", stage.name());
        }
        let progress = self.reporter.progress(stage, to_do);
        let read = each_frame(
            || self.clip.frames(),
            self.options.threads,
            &missing,
            make,
            work,
            |index, result| {
                results.save(index, &result)?;
                progress.advance(1);
                if let Some(place) = all.get_mut(index) {
                    *place = Some(result);
                }
                Ok(())
            },
        )?;
        drop(progress);
        self.check_all_read(read, to_do)?;
        self.reporter.stage_done(stage, started.elapsed(), resumed);
        Ok(all)
    }

    /// A clip that gave fewer frames than before has changed or is damaged.
    fn check_all_read(&self, read: usize, expected: usize) -> Result<(), PipelineError> {
        let clip = self.options.clip.clone();
        if read < expected { Err(PipelineError::FramesMissing { clip, read, expected }) } else { Ok(()) }
    }

    /// People in every frame.
    pub(super) fn detect(&mut self) -> Result<Vec<Vec<Detection>>, PipelineError> {
        let results = self.results(Stage::Detection, detection::MODEL, &[])?;
        let wanted = vec![true; self.frame_count()];
        let found = self.per_frame(
            Stage::Detection,
            &results,
            &wanted,
            || Ok(Detector::load()?),
            |detector, frame| Ok(detector.detect(&frame.image)?),
        )?;
        Ok(found.into_iter().map(Option::unwrap_or_default).collect())
    }

    /// The camera of every frame.
    pub(super) fn calibrate(
        &mut self,
        detections: &[Vec<Detection>],
    ) -> Result<Vec<CameraEstimate>, PipelineError> {
        let started = Instant::now();
        let given = format!("{:?}", self.calibration);
        let results = self.results(Stage::Calibration, "", &[given.as_bytes()])?;
        let kept: Option<Vec<CameraEstimate>> = results.load(0);
        let resumed = kept.as_ref().map_or(0, Vec::len);
        let cameras = match kept {
            Some(cameras) if cameras.len() == self.frame_count() => cameras,
            _ => {
                let progress = self.reporter.progress(Stage::Calibration, self.frame_count());
                let cameras = calibration::calibrate(&self.clip, detections, &self.calibration, &progress)?;
                results.save(0, &cameras)?;
                cameras
            }
        };
        for (index, estimate) in cameras.iter().enumerate() {
            let (loss, reason) = match (&estimate.camera, &estimate.reason) {
                (None, reason) => (Loss::LeftOut, reason.clone().unwrap_or_else(|| "no camera".to_owned())),
                (Some(_), Some(reason)) => (Loss::Fallback, reason.clone()),
                (Some(_), None) => continue,
            };
            let frame = self.clip_frame(index);
            self.reporter.note(Failure { stage: Stage::Calibration, loss, frame, person: None, reason });
        }
        if cameras.iter().all(|estimate| estimate.camera.is_none()) {
            return Err(PipelineError::NoCamera {
                clip: self.options.clip.clone(),
                frames: cameras.len(),
                reason: cameras.first().and_then(|c| c.reason.clone()).unwrap_or_default(),
            });
        }
        self.reporter.stage_done(Stage::Calibration, started.elapsed(), resumed);
        Ok(cameras)
    }

    /// Everybody on the pitch, in every frame that has a camera.
    pub(super) fn pose(
        &mut self,
        detections: &[Vec<Detection>],
        cameras: &[CameraEstimate],
    ) -> Result<Vec<Vec<Person>>, PipelineError> {
        let results = self.results(Stage::Pose, pose::MODEL, &[])?;
        let wanted: Vec<bool> = cameras.iter().map(|estimate| estimate.camera.is_some()).collect();
        let pitch = self.calibration.pitch;
        let people = self.per_frame(
            Stage::Pose,
            &results,
            &wanted,
            || Ok(PoseEstimator::load()?),
            |estimator, frame| {
                let camera = cameras.get(frame.index).and_then(|estimate| estimate.camera);
                let found = detections.get(frame.index).map_or(&[][..], Vec::as_slice);
                match camera {
                    Some(camera) => Ok(estimator.people(&frame.image, found, &camera, &pitch)?),
                    None => Ok(Vec::new()),
                }
            },
        )?;
        Ok(people.into_iter().map(Option::unwrap_or_default).collect())
    }

    /// Who is who.
    pub(super) fn track(&mut self, people: &[Vec<Person>]) -> Result<Vec<Track>, PipelineError> {
        let started = Instant::now();
        let tracks = tracking::track(people, self.clip.info(), &self.options.tracking);
        self.reporter.stage_done(Stage::Tracking, started.elapsed(), 0);
        if tracks.is_empty() {
            return Err(PipelineError::Nobody {
                clip: self.options.clip.clone(),
                frames: self.frame_count(),
                seen: people.iter().map(Vec::len).sum(),
            });
        }
        Ok(tracks)
    }

    /// Which pixels belong to whom.
    pub(super) fn segment(&mut self, people: &[Vec<Person>], tracks: &[Track]) -> Vec<PlayerMask> {
        let started = Instant::now();
        let masks = segmentation::segment(people, tracks, &mut InstanceMaskSegmenter);
        let kept: BTreeSet<(usize, usize)> =
            masks.iter().map(|mask| (mask.sighting.frame, mask.sighting.person_index)).collect();
        for track in tracks {
            for sighting in track.sightings.iter().filter(|s| !kept.contains(&(s.frame, s.person_index))) {
                let frame = self.clip_frame(sighting.frame);
                let reason = "hidden: none of its pixels is its own".to_owned();
                let (stage, person) = (Stage::Segmentation, Some(track.person.0));
                self.reporter.note(Failure { stage, loss: Loss::LeftOut, frame, person, reason });
            }
        }
        self.reporter.stage_done(Stage::Segmentation, started.elapsed(), 0);
        masks
    }

    /// The depth map of every mask; they stay in the work folder.
    pub(super) fn depth(
        &mut self,
        cameras: &[CameraEstimate],
        people: &[Vec<Person>],
        masks: &[FrameMasks<'_>],
    ) -> Result<Depths, PipelineError> {
        let settings = format!("{:?}", self.options.tracking);
        let results = self.results(Stage::Depth, depth::MODEL_NAME, &[settings.as_bytes()])?;
        let wanted: Vec<bool> = masks.iter().map(|masks| !masks.is_empty()).collect();
        let depths = self.per_frame(
            Stage::Depth,
            &results,
            &wanted,
            || Ok(DepthEstimator::load()?),
            |estimator, frame| {
                let mut all: BTreeMap<u32, PersonDepth> = BTreeMap::new();
                let Some(camera) = cameras.get(frame.index).and_then(|estimate| estimate.camera) else {
                    return Ok(all);
                };
                for (id, found, mask) in of_frame(frame.index, masks, people) {
                    let map = match estimator.estimate(&frame.image, &camera, found, mask) {
                        Ok(map) => Ok(map),
                        // The network itself is broken: that is not this player's fault.
                        Err(error @ DepthError::Inference(_)) => return Err(error.into()),
                        Err(error) => Err(error.to_string()),
                    };
                    all.insert(id.0, (map, kit::shirt_rgb(&frame.image, found, mask)));
                }
                Ok(all)
            },
        )?;
        let mut colours: BTreeMap<PersonId, Vec<[u8; 3]>> = BTreeMap::new();
        for (index, frame) in depths.into_iter().enumerate() {
            for (person, (map, shirt)) in frame.unwrap_or_default() {
                colours.entry(PersonId(person)).or_default().extend(shirt);
                if let Err(reason) = map {
                    let (stage, frame) = (Stage::Depth, self.clip_frame(index));
                    self.reporter.note(Failure {
                        stage,
                        loss: Loss::LeftOut,
                        frame,
                        person: Some(person),
                        reason,
                    });
                }
            }
        }
        let shirts =
            colours.iter().filter_map(|(id, samples)| Some((*id, kit::middle_rgb(samples)?))).collect();
        Ok(Depths { results, shirts })
    }

    /// The smooth path of everybody. Paths need only the anchors, so they are solved before the surfaces are lifted, and
    /// each surface is moved as it comes: no more than a few frames of surfaces are in memory.
    pub(super) fn smooth(&mut self, people: &[Vec<Person>], tracks: &[Track]) -> BTreeMap<PersonId, Path> {
        let started = Instant::now();
        let info = self.clip.info();
        let seconds: f64 = info.frames.iter().map(|frame| info.timescale.seconds(frame.duration)).sum();
        let weight = self.options.smoothing.weight(info.frames.len() as f64 / seconds.max(1e-3));
        let mut paths = BTreeMap::new();
        for track in tracks {
            let anchors = track.sightings.iter().filter_map(|sighting| {
                let person = people.get(sighting.frame)?.get(sighting.person_index)?;
                Some((sighting.frame, person.ground_m))
            });
            match Path::through(&anchors.collect(), weight) {
                Ok(path) => {
                    paths.insert(track.person, path);
                }
                Err(error) => self.reporter.note(Failure {
                    stage: Stage::Trajectory,
                    loss: Loss::Fallback,
                    frame: None,
                    person: Some(track.person.0),
                    reason: format!("{error}; its places stay as measured"),
                }),
            }
        }
        self.reporter.stage_done(Stage::Trajectory, started.elapsed(), 0);
        paths
    }

    /// Meshes, moved onto their paths, to the stream; the figures of every frame.
    pub(super) fn write(&mut self, scene: &Scene<'_>) -> Result<Vec<FrameFigures>, PipelineError> {
        let started = Instant::now();
        let wanted: Vec<bool> = scene.cameras.iter().map(|estimate| estimate.camera.is_some()).collect();
        let progress = self.reporter.progress(Stage::Mesh, wanted.iter().filter(|wanted| **wanted).count());
        let mut writing = Writing {
            writer: StreamWriter::create(&self.options.out, &self.header(scene))?,
            figures: self.figures(scene),
            failures: Vec::new(),
            encode: Duration::ZERO,
        };
        let budget = self.options.budget;
        let read = each_frame(
            || self.clip.frames(),
            self.options.threads,
            &wanted,
            || Ok(()),
            |(), frame| {
                let camera = scene.cameras.get(frame.index).and_then(|estimate| estimate.camera);
                let depths: BTreeMap<u32, PersonDepth> =
                    scene.depths.results.load(frame.index).unwrap_or_default();
                let mut lifted = Vec::new();
                for (id, found, _) in of_frame(frame.index, scene.masks, scene.people) {
                    if let (Some(camera), Some((Ok(map), _))) = (&camera, depths.get(&id.0)) {
                        let body = mesh::lift(&frame.image, camera, id, frame.index, found, map, &budget);
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
        let people = scene.tracks.iter().map(|track| StreamPerson {
            id: track.person,
            team: None,
            role: None,
            number: None,
            shirt_rgb: scene.depths.shirts.get(&track.person).copied(),
        });
        StreamHeader {
            timescale: self.clip.info().timescale,
            pitch: self.calibration.pitch,
            people: people.collect(),
        }
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

    /// The report.
    pub(super) fn finish(self, figures: Vec<FrameFigures>, people: usize) -> ReconstructReport {
        self.reporter.finish(figures, people)
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
                Ok(surface) => surfaces.push(surface),
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
            ball: None,
            surfaces,
        })?;
        self.encode += started.elapsed();
        progress.advance(1);
        Ok(())
    }
}

/// The people of a frame with a mask.
fn of_frame<'a>(
    index: usize,
    masks: &'a [FrameMasks<'a>],
    people: &'a [Vec<Person>],
) -> impl Iterator<Item = (PersonId, &'a Person, &'a crate::geometry::Mask)> {
    let frame = masks.get(index).into_iter().flatten();
    frame.filter_map(move |(id, found)| {
        let person = people.get(index)?.get(found.sighting.person_index)?;
        Some((*id, person, &found.mask))
    })
}

/// Masks by frame and person.
pub(super) fn by_frame<'a>(masks: &'a [PlayerMask], tracks: &[Track], frames: usize) -> Vec<FrameMasks<'a>> {
    let mut id_of = BTreeMap::new();
    for track in tracks {
        for sighting in &track.sightings {
            id_of.insert((sighting.frame, sighting.person_index), track.person);
        }
    }
    let mut all = vec![FrameMasks::new(); frames];
    for mask in masks {
        let (frame, person_index) = (mask.sighting.frame, mask.sighting.person_index);
        if let (Some(place), Some(id)) = (all.get_mut(frame), id_of.get(&(frame, person_index))) {
            place.insert(*id, mask);
        }
    }
    all
}
