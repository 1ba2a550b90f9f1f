//! Real pictures, each beside the rendered picture of the same camera: to be looked at by a person.

use std::path::Path;

use image::{RgbImage, imageops};
use synthesis::{SynthesisError, view::picture_from};

use crate::{
    evaluate::calibration::{AnnotatedView, CalibrationEvaluationError, annotated_views},
    report::Progress,
};

/// Width of one picture in the sheet, pixels.
const WIDTH_PX: u32 = 800;
/// Room between pictures, pixels.
const GAP_PX: u32 = 8;

/// Why no sheet could be made.
#[derive(Debug, thiserror::Error)]
pub enum SheetError {
    /// The annotated pictures could not be read.
    #[error(transparent)]
    Annotated(#[from] CalibrationEvaluationError),
    /// Our picture could not be rendered.
    #[error(transparent)]
    Synthesis(#[from] SynthesisError),
    /// No picture has a camera.
    #[error("{0}: none of its pictures has points enough for a camera")]
    NoCamera(String),
}

/// One row for each of `count` pictures spread over the annotated ones: left the real one, right ours from the same camera.
///
/// # Errors
/// When no annotated picture has a camera or ours cannot be rendered.
pub fn sheet(annotated: &Path, count: usize, seed: u64, progress: &Progress) -> Result<RgbImage, SheetError> {
    let views = annotated_views(annotated, progress)?;
    if views.is_empty() {
        return Err(SheetError::NoCamera(annotated.display().to_string()));
    }
    let count = count.clamp(1, views.len());
    let chosen = (0..count).map(|row| &views[row * views.len() / count]);
    let mut rows = Vec::new();
    for (row, AnnotatedView { picture, camera }) in chosen.enumerate() {
        let ours = picture_from(camera, seed.wrapping_add(row as u64))?;
        let height = WIDTH_PX * camera.height_px / camera.width_px.max(1);
        rows.push(
            [picture, &ours].map(|p| imageops::resize(p, WIDTH_PX, height, imageops::FilterType::Lanczos3)),
        );
        progress.advance(1);
    }
    let height: u32 = rows.iter().map(|row| row[0].height() + GAP_PX).sum();
    let mut sheet = RgbImage::new(2 * WIDTH_PX + GAP_PX, height);
    let mut top = 0;
    for [real, ours] in rows {
        imageops::replace(&mut sheet, &real, 0, top);
        imageops::replace(&mut sheet, &ours, i64::from(WIDTH_PX + GAP_PX), top);
        top += i64::from(real.height() + GAP_PX);
    }
    Ok(sheet)
}
