//! The figures of masks, by method and by height, and of joints.

use std::collections::BTreeMap;

use glam::DVec2;
use image::GrayImage;
use protocol::camera::Camera;
use serde::Serialize;

use super::truth::TruePerson;
use crate::{
    geometry::Mask,
    pose::{Person, index, lift_upright},
    report::{median, quantile},
    segmentation::{Method, PlayerMask},
};

/// Upper ends of the height classes, pixels of the true box; the last class has none.
const HEIGHTS_PX: [f64; 4] = [30.0, 45.0, 70.0, 110.0];

/// Joints that count: those that the depth network reads.
const JOINTS: [usize; 17] = [
    index::NOSE,
    index::LEFT_SHOULDER,
    index::RIGHT_SHOULDER,
    index::LEFT_ELBOW,
    index::RIGHT_ELBOW,
    index::LEFT_WRIST,
    index::RIGHT_WRIST,
    index::LEFT_HIP,
    index::RIGHT_HIP,
    index::LEFT_KNEE,
    index::RIGHT_KNEE,
    index::LEFT_ANKLE,
    index::RIGHT_ANKLE,
    index::LEFT_HEEL,
    index::RIGHT_HEEL,
    index::LEFT_TOE,
    index::RIGHT_TOE,
];

/// Figures of masks and joints.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SegmentationFigures {
    /// Mean intersection over union of the first method's masks with the true visible ones, over matched person-frames.
    pub mask_iou: f64,
    /// The same over people who overlap with others.
    pub mask_iou_overlapping: Option<f64>,
    /// Processor time of the first method, seconds on one core for one person in one frame.
    pub cpu_s_per_person_frame: f64,
    /// People in view, at least a quarter seen, over all frames.
    pub person_frames_true: usize,
    /// Those that tracking follows.
    pub person_frames_matched: usize,
    /// Distance of a joint from the true one, both lifted on the person's true virtual plane by the true camera; joints that are seen in
    /// the truth; median, metres.
    pub joint_error_median_m: Option<f64>,
    /// The same, not exceeded by 90 %.
    pub joint_error_p90_m: Option<f64>,
    /// Joints compared.
    pub joints: usize,
    /// Every method.
    pub methods: Vec<MethodFigures>,
}

/// Figures of one method.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MethodFigures {
    /// Which.
    pub method: &'static str,
    /// Mean over matched person-frames.
    pub mask_iou: f64,
    /// Median over them.
    pub mask_iou_median: Option<f64>,
    /// Not fallen short of by 90 %.
    pub mask_iou_p10: Option<f64>,
    /// Mean over people who overlap with others.
    pub mask_iou_overlapping: Option<f64>,
    /// Those people over all frames.
    pub person_frames_overlapping: usize,
    /// Mean by height of the true box.
    pub by_height: Vec<HeightFigures>,
    /// Processor time on one core, seconds for one person in one frame.
    pub cpu_s_per_person_frame: f64,
}

/// Figures of people of one height.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct HeightFigures {
    /// Heights below this, pixels; `None` for the tallest.
    pub below_px: Option<f64>,
    /// Person-frames.
    pub person_frames: usize,
    /// Mean over them.
    pub mask_iou: f64,
}

/// What of a true person decides in which figures the mask counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Compared {
    pub(super) height_px: f64,
    pub(super) overlapping: bool,
}

/// One method's masks and what was measured on them.
pub(super) struct MethodTally {
    method: Method,
    masks: BTreeMap<(usize, usize), Mask>,
    measured: Vec<(Compared, f64)>,
    pub(super) cpu_s: f64,
}

impl MethodTally {
    pub(super) fn new(method: Method) -> Self {
        Self { method, masks: BTreeMap::new(), measured: Vec::new(), cpu_s: 0.0 }
    }

    pub(super) fn keep(&mut self, frames: BTreeMap<usize, Vec<PlayerMask>>) {
        let masks = frames.into_values().flatten();
        self.masks =
            masks.map(|found| ((found.sighting.frame, found.sighting.person_index), found.mask)).collect();
    }

    pub(super) fn mask(&self, frame: usize, person_index: usize) -> Option<&Mask> {
        self.masks.get(&(frame, person_index))
    }

    pub(super) fn add(&mut self, compared: &Compared, iou: f64) {
        self.measured.push((*compared, iou));
    }

    fn figures(&self) -> MethodFigures {
        let all: Vec<f64> = self.measured.iter().map(|(_, iou)| *iou).collect();
        let overlapping: Vec<f64> =
            self.measured.iter().filter(|(compared, _)| compared.overlapping).map(|(_, iou)| *iou).collect();
        MethodFigures {
            method: self.method.name(),
            mask_iou: mean(&all).unwrap_or(0.0),
            mask_iou_median: median(&all),
            mask_iou_p10: quantile(&all, 0.1),
            mask_iou_overlapping: mean(&overlapping),
            person_frames_overlapping: overlapping.len(),
            by_height: self.by_height(),
            cpu_s_per_person_frame: self.cpu_s / self.masks.len().max(1) as f64,
        }
    }

    fn by_height(&self) -> Vec<HeightFigures> {
        let lows = [0.0].into_iter().chain(HEIGHTS_PX);
        let highs = HEIGHTS_PX.into_iter().map(Some).chain([None]);
        lows.zip(highs)
            .map(|(low, high)| {
                let inside = |height: f64| height >= low && high.is_none_or(|high| height < high);
                let of_class: Vec<f64> =
                    self.measured.iter().filter(|(c, _)| inside(c.height_px)).map(|(_, iou)| *iou).collect();
                HeightFigures {
                    below_px: high,
                    person_frames: of_class.len(),
                    mask_iou: mean(&of_class).unwrap_or(0.0),
                }
            })
            .collect()
    }
}

impl SegmentationFigures {
    pub(super) fn finish(&mut self, tallies: Vec<MethodTally>, joints_m: &[f64]) {
        self.methods = tallies.iter().map(MethodTally::figures).collect();
        if let Some(first) = self.methods.first() {
            self.mask_iou = first.mask_iou;
            self.mask_iou_overlapping = first.mask_iou_overlapping;
            self.cpu_s_per_person_frame = first.cpu_s_per_person_frame;
        }
        self.joints = joints_m.len();
        self.joint_error_median_m = median(joints_m);
        self.joint_error_p90_m = quantile(joints_m, 0.9);
    }
}

/// Distances of the joints that are seen in the truth, metres on the person's true virtual plane: the upright plane through the true
/// anchor that faces the camera. A joint is seen when its pixel, or one beside it, is the person's in the map.
pub(super) fn joint_errors_m(
    camera: &Camera,
    truth: &TruePerson,
    person: &Person,
    map: &GrayImage,
) -> Vec<f64> {
    let lift = |pixel: DVec2| lift_upright(camera, pixel, truth.anchor_m);
    let Some(label) = truth.label() else { return Vec::new() };
    let seen = |pixel: DVec2| {
        let (x, y) = (pixel.x.round() as i64, pixel.y.round() as i64);
        let beside = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy)));
        beside
            .filter_map(|(x, y)| map.get_pixel_checked(u32::try_from(x).ok()?, u32::try_from(y).ok()?))
            .any(|value| value.0[0] == label)
    };
    let error = |joint: usize| {
        let (true_px, our_px) = (*truth.joints_px.get(joint)?, person.joints.get(joint)?.pixel);
        let distance = seen(true_px).then(|| Some(lift(true_px)?.distance(lift(our_px)?)))??;
        distance.is_finite().then_some(distance)
    };
    JOINTS.into_iter().filter_map(error).collect()
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_and_overlaps_are_told_apart() {
        let mut tally = MethodTally::new(Method::Network);
        for (height_px, overlapping, iou) in [(20.0, false, 0.8), (30.0, true, 0.6), (200.0, false, 1.0)] {
            tally.add(&Compared { height_px, overlapping }, iou);
        }
        let figures = tally.figures();
        assert!((figures.mask_iou - 0.8).abs() < 1e-12);
        assert_eq!((figures.mask_iou_overlapping, figures.person_frames_overlapping), (Some(0.6), 1));
        assert_eq!(figures.mask_iou_p10, Some(0.6));
        let counts: Vec<usize> = figures.by_height.iter().map(|class| class.person_frames).collect();
        assert_eq!(counts, [1, 1, 0, 0, 1]);
        assert_eq!(MethodTally::new(Method::Network).figures().mask_iou_overlapping, None);
    }
}
