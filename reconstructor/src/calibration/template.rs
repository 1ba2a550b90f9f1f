//! The synthetic field of section 4.1: points along the painted lines, and which of them a camera shows.
//!
//! Marks (centre, penalty) are left out: a few pixels wide, they are no lines, and at a distance they are not seen at all.

use glam::{DVec2, DVec3};
use protocol::{
    camera::Camera,
    pitch::{Marking, Pitch},
};

use crate::geometry::PixelBox;

/// Distance between points along a line, metres.
const SPACING_M: f64 = 0.4;
/// Points of one line closer than this in the picture are thinned out, at 720 rows.
const LEAST_SPACING_PX: f64 = 3.0;
/// Points nearer to the edge of the picture than this are not used, at 720 rows: the line filter needs its surroundings.
const EDGE_PX: f64 = 9.0;

/// A point of the painted lines.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// World metres.
    pub(super) point: DVec3,
    /// Unit vector along the line, world.
    along: DVec3,
    /// Which marking it belongs to.
    marking: usize,
}

/// Points along every line and arc of a pitch.
pub(super) fn samples(pitch: &Pitch) -> Vec<Sample> {
    let mut all = Vec::new();
    for (marking, shape) in pitch.markings().into_iter().enumerate() {
        if matches!(shape, Marking::Spot { .. }) {
            continue;
        }
        let points: Vec<DVec3> = shape.sample(SPACING_M).iter().map(|p| DVec3::new(p.x, 0.0, p.y)).collect();
        for (i, &point) in points.iter().enumerate() {
            let before = points.get(i.wrapping_sub(1)).unwrap_or(&point);
            let after = points.get(i + 1).unwrap_or(&point);
            all.push(Sample { point, along: (*after - *before).normalize_or(DVec3::X), marking });
        }
    }
    all
}

impl Sample {
    /// Unit normal of the line in the picture where this point is; `None` behind the camera or seen end-on.
    pub(super) fn normal(&self, camera: &Camera, pixel: DVec2) -> Option<DVec2> {
        let ahead = camera.project(self.point + self.along * 0.05)?;
        (ahead - pixel).perp().try_normalize()
    }
}

/// The samples that a camera shows inside the picture and outside the boxes of people.
pub(super) fn visible(camera: &Camera, samples: &[Sample], people: &[PixelBox]) -> Vec<Sample> {
    let scale = f64::from(camera.height_px) / 720.0;
    let edge = EDGE_PX * scale;
    let size = DVec2::new(f64::from(camera.width_px), f64::from(camera.height_px)) - 1.0 - edge;
    let mut last: Option<(usize, DVec2)> = None;
    let mut shown = Vec::new();
    for sample in samples {
        let Some(pixel) = camera.project(sample.point) else { continue };
        if !(pixel.cmpge(DVec2::splat(edge)).all() && pixel.cmple(size).all()) || folded(camera, sample.point)
        {
            continue;
        }
        let crowded = last.is_some_and(|(marking, at)| {
            marking == sample.marking && at.distance(pixel) < LEAST_SPACING_PX * scale
        });
        if crowded || people.iter().any(|person| person.contains(pixel)) {
            continue;
        }
        last = Some((sample.marking, pixel));
        shown.push(*sample);
    }
    shown
}

/// Whether a point is so far off the axis that negative distortion folds it back into the picture.
fn folded(camera: &Camera, world: DVec3) -> bool {
    let p = camera.to_camera(world);
    let n = p.truncate() / p.z;
    1.0 + 3.0 * camera.k1 * n.length_squared() <= 0.2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visible_samples_are_in_the_picture_and_not_on_people() {
        let camera =
            Camera::looking_at((1280, 720), 1500.0, DVec3::new(0.0, 18.0, 75.0), DVec3::new(0.0, 0.0, -5.0));
        let all = samples(&Pitch::default());
        let shown = visible(&camera, &all, &[]);
        assert!(shown.len() > 200 && shown.len() < all.len());
        let whole = PixelBox { min: DVec2::ZERO, max: DVec2::new(640.0, 720.0) };
        let right = visible(&camera, &all, &[whole]);
        assert!(!right.is_empty() && right.len() < shown.len());
        assert!(right.iter().all(|s| camera.project(s.point).unwrap().x > 640.0));
        for sample in &shown {
            let pixel = camera.project(sample.point).unwrap();
            let normal = sample.normal(&camera, pixel).unwrap();
            assert!((normal.length() - 1.0).abs() < 1e-9);
        }
    }
}
