//! What was seen, drawn over the frames: masks in the colour of their track with its id, the painted lines, and the ball with its way.

use std::path::Path;

use image::{Rgb, RgbImage};
use imageproc::drawing::{draw_hollow_circle_mut, draw_line_segment_mut};
use protocol::{camera::Camera, manifest::PersonId};

use super::{PipelineError, players::FrameMasks, run::Run};
use crate::{
    ball::BallEstimate,
    calibration::{CameraEstimate, overlay::draw as draw_lines},
    overlay::{OverlayWriter, label, mix},
};

/// A second of the ball's way before it.
const TRAIL_FRAMES: usize = 25;
const SEEN: Rgb<u8> = Rgb([255, 230, 0]);
/// A ball whose place follows from the frames around, or whose height is not known.
const INFERRED: Rgb<u8> = Rgb([170, 170, 170]);
const MASK_SHARE: f32 = 0.5;
const LABEL_PX: f32 = 13.0;

impl Run<'_> {
    /// Writes every frame with what was seen in it, to the folder or video `out`.
    pub(super) fn overlay(
        &mut self,
        out: &Path,
        cameras: &[CameraEstimate],
        masks: &[FrameMasks<'_>],
        ball: &[Option<BallEstimate>],
    ) -> Result<(), PipelineError> {
        let mut writer = OverlayWriter::create(out, self.clip.info().rate())?;
        for frame in self.clip.frames()? {
            let frame = frame?;
            let mut picture = frame.image;
            if let Some(camera) = cameras.get(frame.index).and_then(|estimate| estimate.camera) {
                draw_lines(&mut picture, &camera, &self.pitch);
                draw_masks(&mut picture, masks.get(frame.index).into_iter().flatten());
                let first = self.shots.shot_of(frame.index).map_or(frame.index, |shot| {
                    self.shots.shots.get(shot).map_or(frame.index, |shot| shot.frames.start)
                });
                let trail = first.max(frame.index.saturating_sub(TRAIL_FRAMES))..frame.index + 1;
                draw_ball(&mut picture, &camera, ball.get(trail).unwrap_or_default());
            }
            writer.push(self.clip_frame(frame.index).unwrap_or_default(), &picture)?;
        }
        Ok(writer.finish()?)
    }
}

fn draw_masks<'a>(
    picture: &mut RgbImage,
    masks: impl Iterator<Item = (&'a PersonId, &'a &'a crate::segmentation::PlayerMask)>,
) {
    let mut labels = Vec::new();
    for (person, found) in masks {
        let (mask, colour) = (&found.mask, colour_of(*person));
        let mut top: Option<(i32, i32)> = None;
        for (y, row) in (mask.y0..).zip(mask.coverage.chunks(mask.width.max(1) as usize)) {
            for (x, coverage) in (mask.x0..).zip(row) {
                mix(picture, x, y, colour, MASK_SHARE * f32::from(*coverage) / 255.0);
                if *coverage >= 128 && top.is_none() {
                    top = Some((x, y));
                }
            }
        }
        labels.extend(top.map(|top| (top, *person, colour)));
    }
    // Over all masks, so that a neighbour hides none.
    for ((x, y), person, colour) in labels {
        let place = glam::DVec2::new(f64::from(x), f64::from(y) - f64::from(LABEL_PX) - 4.0);
        label(picture, &person.0.to_string(), place, LABEL_PX, colour);
    }
}

/// The same id has the same colour in every run; ids one after the other differ clearly.
fn colour_of(person: PersonId) -> Rgb<u8> {
    // Steps of the golden angle round the colours.
    let hue = (person.0 as f32 * 0.618_034).fract() * 6.0;
    Rgb([5.0, 3.0, 1.0].map(|offset| {
        let k = (hue + offset) % 6.0;
        (255.0 * (1.0 - 0.85 * k.min(4.0 - k).clamp(0.0, 1.0))) as u8
    }))
}

fn draw_ball(picture: &mut RgbImage, camera: &Camera, way: &[Option<BallEstimate>]) {
    let project = |ball: &BallEstimate| {
        let at = camera.project(ball.position_m).filter(|at| camera.contains(*at))?;
        Some((at.x as f32, at.y as f32))
    };
    for pair in way.windows(2) {
        let [Some(from), Some(to)] = pair else { continue };
        if let (Some(a), Some(b)) = (project(from), project(to)) {
            draw_line_segment_mut(picture, a, b, ball_colour(to));
        }
    }
    let Some(Some(now)) = way.last() else { return };
    if let Some((x, y)) = project(now) {
        let middle = (x.round() as i32, y.round() as i32);
        for radius in [9, 10] {
            draw_hollow_circle_mut(picture, middle, radius, ball_colour(now));
        }
    }
}

fn ball_colour(ball: &BallEstimate) -> Rgb<u8> {
    if ball.seen && ball.height_known { SEEN } else { INFERRED }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{ball::BallState, geometry::Mask, segmentation::PlayerMask, tracking::Sighting};

    #[test]
    fn masks_and_ball_are_drawn_where_they_are() {
        let mut picture = RgbImage::from_pixel(200, 100, Rgb([0, 90, 0]));
        let found = PlayerMask {
            sighting: Sighting { frame: 0, person_index: 0 },
            mask: Mask { x0: 20, y0: 40, width: 10, height: 30, coverage: vec![255; 300] },
        };
        draw_masks(&mut picture, [(&PersonId(3), &&found)].into_iter());
        assert_ne!(*picture.get_pixel(25, 60), Rgb([0, 90, 0]));
        assert_eq!(*picture.get_pixel(40, 60), Rgb([0, 90, 0]));
        let camera =
            Camera::looking_at((200, 100), 300.0, DVec3::new(0.0, 18.0, 75.0), DVec3::new(0.0, 0.0, 0.0));
        let ball = BallEstimate {
            position_m: DVec3::new(0.0, 0.11, 0.0),
            sigma_along_m: 0.1,
            sigma_across_m: 0.1,
            height_known: true,
            state: BallState::Ground,
            seen: true,
        };
        draw_ball(&mut picture, &camera, &[None, Some(ball)]);
        assert!(picture.pixels().any(|pixel| *pixel == SEEN));
    }

    #[test]
    fn ids_one_after_the_other_have_other_colours() {
        let apart =
            |a: Rgb<u8>, b: Rgb<u8>| a.0.iter().zip(b.0).map(|(a, b)| u32::from(a.abs_diff(b))).sum::<u32>();
        for id in 1..40 {
            assert!(apart(colour_of(PersonId(id)), colour_of(PersonId(id + 1))) > 100, "{id}");
        }
    }
}
