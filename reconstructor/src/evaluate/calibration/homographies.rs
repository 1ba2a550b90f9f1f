//! Pictures with the homography of the pitch: the World Cup 2014 set (Homayounfar et al. 2017). Its small pictures are squeezed
//! to a square and have their field mask beside them; all are stretched back to 1280×720, for which the homographies hold.

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec2, DVec3};
use image::{GenericImageView, RgbImage, imageops};
use protocol::pitch::Pitch;
use serde::Deserialize;

use super::{
    CalibrationEvaluationError, CalibrationFigures, EvaluationOptions, by_guess,
    figures::{FrameErrors, overlap},
    locate_each, open_picture, parse,
};
use crate::report::Progress;

/// The set's pitch is 115 by 74 yards, with x from the left goal line and y from the far touchline.
const YARD_M: f64 = 0.9144;
const PITCH_YARDS: DVec2 = DVec2::new(115.0, 74.0);
/// Size of the pictures that the homographies hold for.
const SIZE_PX: (u32, u32) = (1280, 720);

#[derive(Clone, Debug, Deserialize)]
struct Annotation {
    name: String,
    image: PathBuf,
    h_pitch_yards_to_1280x720: [[f64; 3]; 3],
}

pub(super) fn evaluate(
    data: &Path,
    options: &EvaluationOptions,
    progress: &Progress,
) -> Result<CalibrationFigures, CalibrationEvaluationError> {
    let annotations: Vec<Annotation> = parse(&data.join("homographies.json"))?;
    let mut pictures: Vec<(PathBuf, Annotation)> =
        annotations.iter().map(|annotation| (data.join(&annotation.image), annotation.clone())).collect();
    pictures.extend(full_size(&data.join("full"), &annotations));
    let size = PITCH_YARDS * YARD_M;
    let pitch = Pitch { length_m: size.x, width_m: size.y };
    let measured = locate_each(&pictures, options, progress, |(path, annotation), finder| {
        let picture = stretched(open_picture(path)?);
        let guess = finder.find(&picture, &pitch)?;
        let homography =
            oriented(DMat3::from_cols_array_2d(&annotation.h_pitch_yards_to_1280x720).transpose());
        let frame = by_guess(guess.as_ref(), |camera| {
            let iou = camera.map(|camera| {
                let shown = |place: DVec2| {
                    let point = DVec3::new(place.x, 0.0, place.y);
                    camera.project(point).is_some_and(|pixel| camera.contains(pixel))
                };
                overlap(&pitch, |place| in_view(&homography, place, &pitch), shown)
            });
            let iou = Some(iou.unwrap_or(0.0));
            FrameErrors { counts: true, solved: camera.is_some(), iou, ..FrameErrors::default() }
        });
        tracing::info!(picture = %path.display(), ?guess, iou = ?frame.iou, "measured");
        // No points: right cannot be told apart from nearly right.
        Ok(Some(FrameErrors { right: None, ..frame }))
    })?;
    Ok(measured.figures())
}

/// The full-size pictures, `train_val_NNN_….jpg`, with the annotation of their number.
fn full_size(folder: &Path, annotations: &[Annotation]) -> Vec<(PathBuf, Annotation)> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    let of = |path: &PathBuf| {
        let stem = path.file_stem()?.to_str()?;
        let number: u32 = stem.strip_prefix("train_val_")?.get(..3)?.parse().ok()?;
        let name = format!("{number}.jpg");
        let annotation = annotations.iter().find(|annotation| annotation.name == name)?;
        Some((path.clone(), annotation.clone()))
    };
    paths.iter().filter_map(of).collect()
}

/// The picture at the size that its homography holds for, without the mask beside it.
fn stretched(picture: RgbImage) -> RgbImage {
    let (width, height) = picture.dimensions();
    if (width, height) == SIZE_PX {
        return picture;
    }
    let frame = if width == 2 * height { picture.view(0, 0, height, height).to_image() } else { picture };
    imageops::resize(&frame, SIZE_PX.0, SIZE_PX.1, imageops::FilterType::CatmullRom)
}

/// Whether a place of the pitch (world x, z in metres) is in the picture by its [`oriented`] homography.
fn in_view(homography: &DMat3, place: DVec2, pitch: &Pitch) -> bool {
    let yards = (place + DVec2::new(pitch.length_m, pitch.width_m) / 2.0) / YARD_M;
    let at = *homography * yards.extend(1.0);
    let pixel = at.truncate() / at.z;
    let size = DVec2::new(f64::from(SIZE_PX.0), f64::from(SIZE_PX.1));
    at.z > 0.0 && pixel.cmpge(DVec2::ZERO).all() && pixel.cmplt(size).all()
}

/// The homography with the sign, which is free, that makes the third coordinate positive before the camera: at the lower middle
/// of the picture, where pitch always is.
fn oriented(homography: DMat3) -> DMat3 {
    let below = DVec3::new(f64::from(SIZE_PX.0) / 2.0, f64::from(SIZE_PX.1) * 0.9, 1.0);
    let yards = homography.inverse() * below;
    homography * (homography * (yards / yards.z)).z.signum()
}

#[cfg(test)]
mod tests {
    use protocol::camera::Camera;

    use super::*;

    #[test]
    fn the_true_homography_of_a_camera_shows_what_the_camera_shows() {
        let size = PITCH_YARDS * YARD_M;
        let pitch = Pitch { length_m: size.x, width_m: size.y };
        let camera =
            Camera::looking_at(SIZE_PX, 1700.0, DVec3::new(2.0, 16.0, 62.0), DVec3::new(28.0, 0.0, -5.0));
        let project = DMat3::from_cols(
            DVec3::new(camera.focal_px, 0.0, 0.0),
            DVec3::new(0.0, camera.focal_px, 0.0),
            camera.centre_px().extend(1.0),
        ) * camera.rotation;
        // Columns of a homography from (x, z, 1) in metres, then from yards counted from the far left corner.
        let from_metres = DMat3::from_cols(project.x_axis, project.z_axis, project * -camera.position);
        let from_yards = DMat3::from_cols(
            DVec3::new(YARD_M, 0.0, 0.0),
            DVec3::new(0.0, YARD_M, 0.0),
            DVec3::new(-size.x / 2.0, -size.y / 2.0, 1.0),
        );
        for sign in [1.0, -1.0] {
            let homography = oriented(from_metres * from_yards * sign);
            let shown = |place: DVec2| {
                camera.project(DVec3::new(place.x, 0.0, place.y)).is_some_and(|pixel| camera.contains(pixel))
            };
            let same = overlap(&pitch, |place| in_view(&homography, place, &pitch), shown);
            assert!(same > 0.995, "{same}");
        }
    }

    #[test]
    fn squeezed_pictures_lose_their_mask_and_are_stretched() {
        let both =
            RgbImage::from_fn(
                600,
                300,
                |x, _| if x < 300 { image::Rgb([9, 120, 9]) } else { image::Rgb([255; 3]) },
            );
        let picture = stretched(both);
        assert_eq!(picture.dimensions(), SIZE_PX);
        assert!(picture.pixels().all(|pixel| pixel[1] < 130));
    }
}
