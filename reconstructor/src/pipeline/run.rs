//! One reconstruction under way: the clip, the work folder, and the stages that look at whole frames. Each stage is
//! timed, resumed and reported.

use std::time::Instant;

use protocol::pitch::Pitch;
use serde::{Serialize, de::DeserializeOwned};

use super::{
    ObserveOptions, PipelineError,
    frames::each_frame,
    work::{Fingerprint, Results, WorkFolder},
};
use crate::{
    calibration::{self, CameraEstimate, ClipCameras, Finders, Given, Known},
    detection::{self, Detection, Detector, Found},
    inference,
    ingest::{Clip, Frame},
    pose::{self, Person, PoseEstimator},
    report::{Failure, FrameFigures, Loss, ReconstructReport, Reporter, Stage},
    shots::{self, ShotList},
};

/// A clip that is being looked at, and then reconstructed.
pub(super) struct Run<'a> {
    pub(super) options: &'a ObserveOptions,
    pub(super) reporter: &'a mut Reporter,
    pub(super) clip: Clip,
    pub(super) pitch: Pitch,
    pub(super) shots: ShotList,
    given: Option<Given>,
    work: WorkFolder,
    /// Grows stage by stage, so that a stage's results also depend on all stages before it.
    fingerprint: Fingerprint,
}

impl<'a> Run<'a> {
    /// Opens everything that can be wrong before the long work begins.
    pub(super) fn open(
        options: &'a ObserveOptions,
        reporter: &'a mut Reporter,
    ) -> Result<Self, PipelineError> {
        let started = Instant::now();
        let given = options.calibration.as_deref().map(Given::read).transpose()?;
        let pitch = options.pitch.or(given.as_ref().and_then(Given::pitch)).unwrap_or_default();
        inference::initialize(None)?;
        let (clip, shots) = shots::open(&options.clip, options.frames.clone())?;
        let known = Known { pitch, given: given.as_ref(), finders: None, apart: false };
        calibration::check_given(clip.info(), &known).map_err(|source| PipelineError::Correspondences {
            path: options.calibration.clone().unwrap_or_default(),
            source: Box::new(source),
        })?;
        let fingerprint = Fingerprint::of_clip(&options.clip)
            .map_err(|source| PipelineError::Work { doing: "read", path: options.clip.clone(), source })?
            .with_program()?;
        let frames: Vec<u8> =
            clip.info().frames.iter().flat_map(|frame| frame.clip_frame.to_le_bytes()).collect();
        let work = WorkFolder::open(options.work.as_deref())?;
        reporter.stage_done(Stage::Ingest, started.elapsed(), 0);
        let fingerprint = fingerprint.with(&frames);
        Ok(Self { options, reporter, clip, pitch, shots, given, work, fingerprint })
    }

    pub(super) fn frame_count(&self) -> usize {
        self.clip.info().frames.len()
    }

    pub(super) fn clip_frame(&self, index: usize) -> Option<u32> {
        self.clip.info().frames.get(index).map(|frame| frame.clip_frame)
    }

    /// The folder of a stage's results; `parts` is what they depend on besides the stages before.
    pub(super) fn results(
        &mut self,
        stage: Stage,
        model: &str,
        parts: &[&[u8]],
    ) -> Result<Results, PipelineError> {
        let mut fingerprint = self.fingerprint.clone().with(stage.name().as_bytes());
        if !model.is_empty() {
            fingerprint = fingerprint.with_file(&inference::model_path(model)?)?;
        }
        self.fingerprint = parts.iter().fold(fingerprint, |fingerprint, part| fingerprint.with(part));
        self.work.results(stage.name(), &self.fingerprint)
    }

    /// Runs a stage frame by frame: what the work folder has is taken from there, the rest is made in parallel and kept.
    pub(super) fn per_frame<W, R>(
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
    pub(super) fn check_all_read(&self, read: usize, expected: usize) -> Result<(), PipelineError> {
        let clip = self.options.clip.clone();
        if read < expected { Err(PipelineError::FramesMissing { clip, read, expected }) } else { Ok(()) }
    }

    /// People and what may be the ball, in every frame.
    pub(super) fn detect(&mut self) -> Result<Vec<Found>, PipelineError> {
        let results = self.results(Stage::Detection, detection::MODEL, &[])?;
        // Between shots there is no camera, so nobody could be placed.
        let wanted: Vec<bool> =
            (0..self.frame_count()).map(|frame| self.shots.shot_of(frame).is_some()).collect();
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
        let settings = format!("{:?} {:?} {:?}", self.pitch, self.given, self.shots);
        // The network decides only in shots without a given camera, and may be missing when there are none.
        let model = if inference::model_path(calibration::MODEL).is_ok() { calibration::MODEL } else { "" };
        let results = self.results(Stage::Calibration, model, &[settings.as_bytes()])?;
        let kept: Option<ClipCameras> = results.load(0);
        let resumed = kept.as_ref().map_or(0, |cameras| cameras.frames.len());
        let cameras = match kept {
            Some(cameras) if cameras.frames.len() == self.frame_count() => cameras,
            _ => {
                let progress = self.reporter.progress(Stage::Calibration, self.frame_count());
                let finders = Finders::new(&calibration::shipped);
                let known = Known {
                    pitch: self.pitch,
                    given: self.given.as_ref(),
                    finders: Some(&finders),
                    apart: false,
                };
                let cameras =
                    calibration::calibrate_shots(&self.clip, detections, &self.shots, &known, &progress)?;
                results.save(0, &cameras)?;
                cameras
            }
        };
        let mut cameras = cameras.frames;
        // The camera may be known in a dissolve, but people of two pictures would stand on one pitch.
        for transition in &self.shots.transitions {
            let mixed = cameras.get_mut(transition.frames.clone()).into_iter().flatten();
            mixed.for_each(|estimate| *estimate = CameraEstimate::unsolved(transition.kind.name()));
        }
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
        let refiner = inference::model_path(pose::JOINTS_MODEL)?;
        self.fingerprint = self.fingerprint.clone().with_file(&refiner)?;
        let results = self.results(Stage::Pose, pose::MODEL, &[])?;
        let wanted: Vec<bool> = cameras.iter().map(|estimate| estimate.camera.is_some()).collect();
        let pitch = self.pitch;
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

    /// The report.
    pub(super) fn finish(
        self,
        figures: Vec<FrameFigures>,
        people: usize,
        numbers: usize,
    ) -> ReconstructReport {
        self.reporter.finish(figures, people, numbers)
    }
}
