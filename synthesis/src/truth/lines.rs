//! Where the paint of the pitch lies in a picture, marking by marking, and where its points are.

use glam::DVec2;
use image::{GrayImage, Luma};
use protocol::{
    camera::Camera,
    pitch::{Marking, Pitch},
};

use super::{PitchPoint, rounded};
use crate::{correspondences::candidates, stadium::Stadium};

/// What the markings of [`Pitch::markings`] are, in its order: value `k + 1` of a line map is name `k`.
pub const MARKING_NAMES: &[&str] = &[
    "far touchline",
    "near touchline",
    "halfway line",
    "centre circle",
    "centre mark",
    "left goal line",
    "left penalty area, far side",
    "left penalty area, front",
    "left penalty area, near side",
    "left goal area, far side",
    "left goal area, front",
    "left goal area, near side",
    "left penalty mark",
    "left penalty arc",
    "left far corner arc",
    "left near corner arc",
    "right goal line",
    "right penalty area, far side",
    "right penalty area, front",
    "right penalty area, near side",
    "right goal area, far side",
    "right goal area, front",
    "right goal area, near side",
    "right penalty mark",
    "right penalty arc",
    "right far corner arc",
    "right near corner arc",
];

/// For every pixel 0, or the marking whose paint covers its middle, counted from 1 in the order of [`MARKING_NAMES`].
/// Paint counts as it lies on the pitch, whether somebody stands before it or not.
#[must_use]
pub fn line_map(camera: &Camera, stadium: &Stadium) -> GrayImage {
    let (pitch, line_m) = (&stadium.pitch, stadium.turf.line_m());
    let mut map = GrayImage::new(camera.width_px, camera.height_px);
    for (index, marking) in pitch.markings().iter().enumerate() {
        let value = Luma([index as u8 + 1]);
        let reach_m = match marking {
            Marking::Spot { radius_m, .. } => *radius_m,
            Marking::Line { .. } | Marking::Arc { .. } => line_m / 2.0,
        };
        // Along the marking in steps shorter than the paint is wide, each with the pixels that the paint may touch.
        for place in marking.sample(SPACING_M) {
            let Some([low, high]) = reach(camera, place, reach_m + SPACING_M) else { continue };
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    if map.get_pixel(x, y)[0] == 0 && covered(camera, marking, line_m, x, y) {
                        map.put_pixel(x, y, value);
                    }
                }
            }
        }
    }
    map
}

const SPACING_M: f64 = 0.1;

fn covered(camera: &Camera, marking: &Marking, line_m: f64, x: u32, y: u32) -> bool {
    let ground = camera.ground_point(DVec2::new(f64::from(x), f64::from(y)));
    ground.is_some_and(|point| marking.covers_painted(DVec2::new(point.x, point.z), line_m))
}

/// First and last pixel of the picture within `radius_m` of a place of the pitch; `None` when there is none.
fn reach(camera: &Camera, place: DVec2, radius_m: f64) -> Option<[[u32; 2]; 2]> {
    let (mut low, mut high) = (DVec2::MAX, DVec2::MIN);
    for corner in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        let at = place + DVec2::from(corner) * radius_m;
        let pixel = camera.project(glam::DVec3::new(at.x, 0.0, at.y))?;
        low = low.min(pixel);
        high = high.max(pixel);
    }
    let last = DVec2::new(f64::from(camera.width_px) - 1.0, f64::from(camera.height_px) - 1.0);
    let (low, high) = (low.ceil().max(DVec2::ZERO), high.floor().min(last));
    (low.cmple(high).all()).then(|| [low, high].map(|p| p.as_uvec2().to_array()))
}

/// The named points inside the picture.
pub(super) fn points_in_picture(camera: &Camera, pitch: &Pitch) -> Vec<PitchPoint> {
    let size = DVec2::new(f64::from(camera.width_px), f64::from(camera.height_px));
    candidates(pitch)
        .into_iter()
        .filter_map(|(name, world)| {
            let px = camera.project(world)?;
            let inside = px.cmpge(DVec2::splat(-0.5)).all() && px.cmplt(size - 0.5).all();
            inside.then(|| PitchPoint {
                name,
                px: rounded(px.to_array(), 2),
                world_m: rounded(world.to_array(), 3),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        turf::{Turf, TurfLook},
        venue::Venue,
    };
    use glam::DVec3;
    use protocol::pitch::LINE_WIDTH_M;

    #[test]
    fn every_marking_has_its_name() {
        assert_eq!(Pitch::default().markings().len(), MARKING_NAMES.len());
        let named = |name: &str| {
            let index = MARKING_NAMES.iter().position(|n| *n == name).unwrap();
            Pitch::default().markings()[index].sample(1.0)[0]
        };
        assert!(named("near touchline").y > 30.0 && named("far touchline").y < -30.0);
        assert!(named("right penalty area, front").x > 0.0 && named("left penalty mark").x < -40.0);
    }

    /// The quick walk along the markings finds the same pixels as asking every marking at every pixel.
    #[test]
    fn the_map_is_complete() {
        let pitch = Pitch::default();
        let mut camera =
            Camera::looking_at((320, 180), 500.0, DVec3::new(4.0, 15.0, 60.0), DVec3::new(-38.0, 0.0, 4.0));
        camera.k1 = -0.05;
        let mut venue = Venue::plain(1, pitch, [[0.5; 3]; 2]);
        let map = line_map(&camera, &venue.stadium);
        let markings = pitch.markings();
        let mut painted = 0;
        for (x, y, value) in map.enumerate_pixels() {
            let any = markings.iter().position(|marking| covered(&camera, marking, LINE_WIDTH_M, x, y));
            assert_eq!(usize::from(value[0]), any.map_or(0, |k| k + 1), "pixel {x}, {y}");
            painted += usize::from(value[0] > 0);
        }
        assert!(painted > 200, "{painted} painted pixels");
        // Narrower paint is narrower in the map.
        let look = TurfLook { line_m: 0.08, ..TurfLook::default() };
        venue.stadium.turf = Turf::new(&pitch, look, 1);
        let narrow = line_map(&camera, &venue.stadium).pixels().filter(|value| value[0] > 0).count();
        assert!(narrow * 10 < painted * 9, "{narrow} painted pixels of {painted}");
    }
}
