//! A made-up match seen by a camera that somebody gives: to hold ours beside a real picture of the same view.

use glam::DVec2;
use image::RgbImage;
use protocol::{camera::Camera, pitch::Pitch};

use crate::{
    SynthesisError,
    clip::{FRAME_RATE, render_frame},
    fixture::{Fixture, FixtureOptions},
    trajectories::Trajectories,
};

/// Length of the match from which a moment is chosen, seconds.
const LENGTH_S: f64 = 24.0;

/// The picture that `camera` takes of the match of `seed`, at the moment when the ball is nearest to the middle of the
/// picture: a broadcast camera looks at the play.
pub fn picture_from(camera: &Camera, seed: u64) -> Result<RgbImage, SynthesisError> {
    let paths = Trajectories::generated(seed, LENGTH_S + 1.0);
    let mut fixture = Fixture::new(
        &paths,
        &FixtureOptions {
            seed,
            frames: (LENGTH_S * f64::from(FRAME_RATE)) as usize,
            rate_hz: f64::from(FRAME_RATE),
            size_px: (camera.width_px, camera.height_px),
            // Real pitches are taken to have the usual size.
            pitch: Some(Pitch::default()),
            ..FixtureOptions::default()
        },
    )?;
    let middle = DVec2::new(f64::from(camera.width_px), f64::from(camera.height_px)) / 2.0;
    let off_centre = |frame: &usize| {
        let px = camera.project(fixture.ball[*frame].as_dvec3());
        px.map_or(f64::INFINITY, |px| px.distance(middle))
    };
    let frame = (0..fixture.frames()).min_by(|a, b| off_centre(a).total_cmp(&off_centre(b))).unwrap_or(0);
    fixture.cameras[frame] = *camera;
    render_frame(&fixture, frame, seed)
}
