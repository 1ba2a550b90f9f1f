//! What a reconstruction did and what it could not do: figures per frame, times per stage, and every person or frame that
//! was left out or done in a lesser way. The pipeline hands one [`Reporter`] round and ends with a [`ReconstructReport`].

mod progress;

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

pub use progress::Progress;

/// Failures kept one by one; beyond this only counted, so that a bad hour of film does not make a bad gigabyte of report.
const FAILURES_KEPT: usize = 5_000;

/// A stage of the pipeline, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Clip to frames.
    Ingest,
    /// People in each frame.
    Detection,
    /// Camera of each frame.
    Calibration,
    /// Joints and place on the pitch of each person.
    Pose,
    /// Who is who over time.
    Tracking,
    /// Shirt numbers.
    Numbers,
    /// Who is in the air.
    Jumps,
    /// The ball.
    Ball,
    /// Which pixels belong to whom.
    Segmentation,
    /// Joints in space of each player.
    Lifting,
    /// Depth map of each player.
    Depth,
    /// What each player looks like all round.
    Skin,
    /// Textured mesh of each player.
    Mesh,
    /// Smooth paths.
    Trajectory,
    /// The stream.
    Encode,
}

impl Stage {
    /// Every stage, in order.
    pub const ALL: [Self; 15] = [
        Self::Ingest,
        Self::Detection,
        Self::Calibration,
        Self::Pose,
        Self::Tracking,
        Self::Numbers,
        Self::Jumps,
        Self::Ball,
        Self::Segmentation,
        Self::Lifting,
        Self::Depth,
        Self::Skin,
        Self::Mesh,
        Self::Trajectory,
        Self::Encode,
    ];

    /// Its name as in the report and the module tree.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Ingest => "ingest",
            Self::Detection => "detection",
            Self::Calibration => "calibration",
            Self::Pose => "pose",
            Self::Tracking => "tracking",
            Self::Numbers => "numbers",
            Self::Jumps => "jumps",
            Self::Ball => "ball",
            Self::Segmentation => "segmentation",
            Self::Lifting => "lifting",
            Self::Depth => "depth",
            Self::Skin => "skin",
            Self::Mesh => "mesh",
            Self::Trajectory => "trajectory",
            Self::Encode => "encode",
        }
    }
}

/// How much was lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Loss {
    /// The frame or the person is missing from the stream.
    LeftOut,
    /// Done in a lesser way.
    Fallback,
}

/// Something a stage could not do as it should.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// Which stage.
    pub stage: Stage,
    /// What it cost.
    pub loss: Loss,
    /// Frame of the whole clip, when it concerns one.
    pub frame: Option<u32>,
    /// Person of the stream, when it concerns one.
    pub person: Option<u32>,
    /// Why, in plain words.
    pub reason: String,
}

/// Figures of one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameFigures {
    /// Index of the frame in the whole clip.
    pub frame: u32,
    /// Whether the frame has a camera; without one it is not in the stream.
    pub camera_solved: bool,
    /// Where the camera came from: `correspondences`, `lines`, …; empty without a camera.
    pub camera_source: String,
    /// Median distance of the drawn pitch lines from the lines seen, pixels of the clip.
    pub line_residual_median_px: Option<f64>,
    /// Boxes that the detector gave.
    pub people_detected: usize,
    /// People that stand in the stream.
    pub people_with_mesh: usize,
    /// Mean pose confidence of the people in the stream, 0..1.
    pub track_confidence_mean: Option<f64>,
}

/// Time that one stage took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageFigures {
    /// Which stage.
    pub stage: Stage,
    /// Wall-clock seconds in this run; next to nothing when the result was taken from the work folder.
    pub seconds: f64,
    /// Frames or other units whose results were taken from the work folder.
    pub resumed: usize,
}

/// The report of one `reconstruct` run; `--report` writes it as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReconstructReport {
    /// Frames of the chosen range.
    pub frames: usize,
    /// Frames with a camera.
    pub cameras_solved: usize,
    /// Median over the frames of their median line residual, pixels of the clip.
    pub line_residual_median_px: Option<f64>,
    /// The largest of the frames' median line residuals, pixels of the clip.
    pub line_residual_worst_px: Option<f64>,
    /// People with a mesh per frame of the chosen range, mean.
    pub people_with_mesh_mean: f64,
    /// People followed over time.
    pub people: usize,
    /// Of them, those whose shirt number was read.
    pub numbers_read: usize,
    /// Wall-clock seconds of this run.
    pub seconds: f64,
    /// Wall-clock seconds of this run per frame of the range.
    pub seconds_per_frame: f64,
    /// Time per stage.
    pub stages: Vec<StageFigures>,
    /// What was left out or done in a lesser way.
    pub failures: Vec<Failure>,
    /// Failures beyond those listed.
    pub failures_not_listed: usize,
    /// Figures per frame.
    pub per_frame: Vec<FrameFigures>,
}

/// Gathers what happens during a reconstruction.
#[derive(Debug)]
pub struct Reporter {
    visible: bool,
    started: Instant,
    stages: Vec<StageFigures>,
    failures: Vec<Failure>,
    failures_not_listed: usize,
}

impl Reporter {
    /// A reporter that shows progress on standard error.
    #[must_use]
    pub fn new() -> Self {
        Self {
            visible: true,
            started: Instant::now(),
            stages: Vec::new(),
            failures: Vec::new(),
            failures_not_listed: 0,
        }
    }

    /// A reporter that shows nothing, for tests.
    #[must_use]
    pub fn quiet() -> Self {
        Self { visible: false, ..Self::new() }
    }

    /// Progress of `stage` over `total` steps.
    #[must_use]
    pub fn progress(&self, stage: Stage, total: usize) -> Progress {
        if self.visible { Progress::new(stage.name(), total as u64) } else { Progress::hidden() }
    }

    /// Notes something that a stage could not do as it should. What costs a whole frame is also a warning in the log.
    pub fn note(&mut self, failure: Failure) {
        if failure.person.is_none() {
            let frame = failure.frame.map(|frame| format!("frame {frame}: ")).unwrap_or_default();
            tracing::warn!("{}: {frame}{}", failure.stage.name(), failure.reason);
        }
        if self.failures.len() < FAILURES_KEPT {
            self.failures.push(failure);
        } else {
            self.failures_not_listed += 1;
        }
    }

    /// Notes that `stage` is over. Says in the log what it took and how many people it left out.
    pub fn stage_done(&mut self, stage: Stage, took: Duration, resumed: usize) {
        let seconds = took.as_secs_f64();
        let count = |loss| self.failures.iter().filter(|f| f.stage == stage && f.loss == loss).count();
        let (left_out, fallbacks) = (count(Loss::LeftOut), count(Loss::Fallback));
        let kept =
            if resumed > 0 { format!(", {resumed} taken from the work folder") } else { String::new() };
        tracing::info!("{}: {seconds:.1} s{kept}", stage.name());
        if left_out + fallbacks > 0 {
            tracing::warn!(
                "{}: {left_out} left out, {fallbacks} done in a lesser way; the report lists them",
                stage.name()
            );
        }
        self.stages.push(StageFigures { stage, seconds, resumed });
    }

    /// Failures noted so far.
    #[must_use]
    pub fn failures(&self) -> &[Failure] {
        &self.failures
    }

    /// The report over the given frames and `people` tracks, of which `numbers_read` have a shirt number.
    #[must_use]
    pub fn finish(
        &self,
        per_frame: Vec<FrameFigures>,
        people: usize,
        numbers_read: usize,
    ) -> ReconstructReport {
        let frames = per_frame.len();
        let residuals: Vec<f64> = per_frame.iter().filter_map(|f| f.line_residual_median_px).collect();
        let with_mesh: usize = per_frame.iter().map(|f| f.people_with_mesh).sum();
        let seconds = self.started.elapsed().as_secs_f64();
        ReconstructReport {
            frames,
            cameras_solved: per_frame.iter().filter(|f| f.camera_solved).count(),
            line_residual_median_px: median(&residuals),
            line_residual_worst_px: residuals.iter().copied().reduce(f64::max),
            people_with_mesh_mean: with_mesh as f64 / frames.max(1) as f64,
            people,
            numbers_read,
            seconds,
            seconds_per_frame: seconds / frames.max(1) as f64,
            stages: self.stages.clone(),
            failures: self.failures.clone(),
            failures_not_listed: self.failures_not_listed,
            per_frame,
        }
    }
}

impl Default for Reporter {
    fn default() -> Self {
        Self::new()
    }
}

/// Processor time that this thread has used, seconds; 0 where the system does not tell (only Linux does, in schedstat).
pub(crate) fn thread_cpu_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds: Option<f64> = text.split_whitespace().next().and_then(|word| word.parse().ok());
    nanoseconds.unwrap_or(0.0) * 1e-9
}

/// Processor time that all threads of the program have used, seconds; 0 where the system does not tell as Linux does.
pub(crate) fn process_cpu_s() -> f64 {
    /// Linux counts in hundredths of a second whatever the kernel's own tick is (`man 5 proc`, USER_HZ).
    const TICKS_PER_S: f64 = 100.0;
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name may hold anything, so fields count from the last bracket: user and system time are the 14th and 15th of all.
    let fields = text.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.skip(11).take(2).filter_map(|word| word.parse::<f64>().ok()).sum::<f64>() / TICKS_PER_S
}

/// The median (mean of the two middle values for an even count); `None` of nothing.
pub(crate) fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let upper = *sorted.get(sorted.len() / 2)?;
    if sorted.len() % 2 == 1 {
        return Some(upper);
    }
    sorted.get(sorted.len() / 2 - 1).map(|lower| (lower + upper) / 2.0)
}

/// The smallest value that at least a `share` of all does not exceed; `None` of nothing.
pub(crate) fn quantile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    // A hair less, so that 0.9 of ten values is the ninth whatever the rounding.
    let place = (sorted.len() as f64 * share - 1e-9).ceil().max(1.0) as usize - 1;
    sorted.get(place).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(frame: u32, residual: Option<f64>, people_with_mesh: usize) -> FrameFigures {
        FrameFigures {
            frame,
            camera_solved: residual.is_some(),
            line_residual_median_px: residual,
            people_with_mesh,
            ..FrameFigures::default()
        }
    }

    #[test]
    fn the_summary_counts_frames_without_a_camera() {
        let frames = vec![frame(5, Some(1.0), 10), frame(6, None, 0), frame(7, Some(3.0), 14)];
        let report = Reporter::quiet().finish(frames, 16, 5);
        assert_eq!((report.frames, report.cameras_solved, report.people), (3, 2, 16));
        assert_eq!(report.numbers_read, 5);
        assert_eq!(report.line_residual_median_px, Some(2.0));
        assert_eq!(report.line_residual_worst_px, Some(3.0));
        assert_eq!(report.people_with_mesh_mean, 8.0);
    }

    #[test]
    fn failures_are_bounded_but_counted() {
        let mut reporter = Reporter::quiet();
        for frame in 0..FAILURES_KEPT as u32 + 3 {
            reporter.note(Failure {
                stage: Stage::Depth,
                loss: Loss::LeftOut,
                frame: Some(frame),
                person: Some(1),
                reason: "too small".into(),
            });
        }
        let report = reporter.finish(Vec::new(), 0, 0);
        assert_eq!(report.failures.len(), FAILURES_KEPT);
        assert_eq!(report.failures_not_listed, 3);
    }

    #[test]
    fn quantiles_of_few_and_none() {
        assert_eq!(quantile(&[], 0.9), None);
        assert_eq!(quantile(&[3.0, 1.0, 2.0], 0.9), Some(3.0));
        assert_eq!(quantile(&[3.0, 1.0, 2.0], 0.1), Some(1.0));
        let ten: Vec<f64> = (1..=10).map(f64::from).collect();
        assert_eq!(
            (quantile(&ten, 0.9), quantile(&ten, 0.0), quantile(&ten, 1.0)),
            (Some(9.0), Some(1.0), Some(10.0))
        );
    }

    #[test]
    fn median_of_even_and_odd_counts() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), Some(2.5));
    }
}
