//! A recorded room: the picture with its depth, and the cloud that the table is looked for in, in one room frame.

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec2};
use image::{ImageReader, Limits, RgbaImage};
use thiserror::Error;

use super::{ScanError, cloud_of, extension, pcd, read_bytes, read_depth, read_poses};
use crate::{
    ar::{RoomCamera, RoomPicture, RoomPictureError},
    placement::{Intrinsics, PointCloud},
};

/// Widest and tallest picture that is read, pixels.
const MOST_SIDE_PX: u32 = 8192;
/// Most views of a sequence.
const MOST_VIEWS: usize = 100_000;

/// Why a recorded room cannot be shown.
#[derive(Debug, Error)]
pub enum RoomError {
    /// The scan.
    #[error(transparent)]
    Scan(#[from] ScanError),
    /// The picture.
    #[error("{file}: no picture: {reason}: give a PNG or JPEG file")]
    Picture {
        /// The file.
        file: PathBuf,
        /// What the decoder says.
        reason: String,
    },
    /// The cloud has no colours.
    #[error("{file}: the cloud has no colours and rows: give --image with the picture of the same view")]
    NoColour {
        /// The file.
        file: PathBuf,
    },
    /// Picture and depth do not belong together.
    #[error("{file}: {reason}")]
    Mismatch {
        /// The picture or the scan.
        file: PathBuf,
        /// In what.
        reason: RoomPictureError,
    },
    /// A folder that is not a sequence.
    #[error(
        "{folder}: {problem}: a sequence has depth/NAME.png|.pgm, color/NAME.png|.jpg and pose.txt or trajectory.log"
    )]
    Sequence {
        /// The folder.
        folder: PathBuf,
        /// What is missing.
        problem: String,
    },
}

/// A room as one view of it was recorded.
#[derive(Clone, Debug)]
pub struct RecordedRoom {
    /// What the camera saw.
    pub picture: RoomPicture,
    /// What the finder is to look at, in the same frame.
    pub cloud: PointCloud,
}

impl RecordedRoom {
    /// A cloud in rows and columns; its colours are the picture unless `image` names another one of the same view.
    ///
    /// # Errors
    /// [`RoomError`] when a file cannot be read or the cloud has neither rows nor colours.
    pub fn from_cloud(path: &Path, image: Option<&Path>) -> Result<Self, RoomError> {
        let bytes = read_bytes(path)?;
        let cloud = cloud_of(path, &bytes)?;
        let no_colour = || RoomError::NoColour { file: path.into() };
        let (columns, rows) = cloud.layout().ok_or_else(no_colour)?;
        let colour = match image {
            Some(image) => read_picture(image)?,
            None => {
                let colours = (extension(path) == "pcd")
                    .then(|| pcd::colours(&bytes))
                    .transpose()
                    .map_err(|problem| problem.within(&path.display().to_string()))?;
                let mut colours = colours.flatten().ok_or_else(no_colour)?;
                colours.truncate(columns * rows);
                let bytes = colours.into_iter().flatten().collect();
                RgbaImage::from_raw(columns as u32, rows as u32, bytes).ok_or_else(no_colour)?
            }
        };
        let picture = RoomPicture::from_organised(colour, cloud.points_m())
            .map_err(|reason| RoomError::Mismatch { file: image.unwrap_or(path).into(), reason })?;
        Ok(Self { picture, cloud })
    }

    /// A depth picture (`metres_per_unit` each) with the colour picture of the same view, taken from `room_from_camera`.
    ///
    /// # Errors
    /// [`RoomError`] when a file cannot be read or their sizes differ.
    pub fn from_depth(
        depth: &Path,
        metres_per_unit: f64,
        image: &Path,
        intrinsics: &Intrinsics,
        room_from_camera: &DMat4,
    ) -> Result<Self, RoomError> {
        let measured = read_depth(depth, metres_per_unit)?;
        let camera = RoomCamera::at_origin(
            [measured.width as u32, measured.height as u32],
            DVec2::from(intrinsics.focal_px),
            DVec2::from(intrinsics.centre_px),
        );
        let cloud = PointCloud::from_depth(&measured, intrinsics).moved(room_from_camera);
        let picture =
            RoomPicture::new(read_picture(image)?, measured.depth_m, camera.moved(room_from_camera))
                .map_err(|reason| RoomError::Mismatch { file: image.into(), reason })?;
        Ok(Self { picture, cloud })
    }
}

/// One view of a sequence.
#[derive(Clone, Debug, PartialEq)]
pub struct SequenceView {
    /// The name of its files without their endings.
    pub name: String,
    /// Its depth picture.
    pub depth: PathBuf,
    /// Its colour picture.
    pub image: PathBuf,
    /// Where it was taken from.
    pub room_from_camera: DMat4,
}

/// The views of a posed RGB-D sequence: depth and colour pictures of the same names in order of their numbers, each
/// with a line of the poses.
///
/// # Errors
/// [`RoomError`] when something is missing or the counts differ.
pub fn read_sequence(folder: &Path) -> Result<Vec<SequenceView>, RoomError> {
    let broken = |problem: String| RoomError::Sequence { folder: folder.into(), problem };
    let poses = ["pose.txt", "poses.txt", "trajectory.log"].map(|name| folder.join(name));
    let poses = poses.iter().find(|path| path.is_file()).ok_or_else(|| broken("no poses".into()))?;
    let poses = read_poses(poses)?;
    let depths = listed(&folder.join("depth")).map_err(broken)?;
    let colours = ["color", "colour", "rgb"].map(|name| folder.join(name));
    let colours =
        colours.iter().find(|path| path.is_dir()).ok_or_else(|| broken("no folder color".into()))?;
    let colours = listed(colours).map_err(broken)?;
    if depths.len() != poses.len() || colours.len() != poses.len() {
        let (depths, colours, poses) = (depths.len(), colours.len(), poses.len());
        return Err(broken(format!("{depths} depth pictures, {colours} colour pictures, {poses} poses")));
    }
    let views = depths.into_iter().zip(colours).zip(poses).map(|((depth, image), room_from_camera)| {
        let name = depth.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        SequenceView { name, depth, image, room_from_camera }
    });
    Ok(views.collect())
}

/// Files of a folder: by number where the names are numbers, then by name.
fn listed(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = std::fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut files: Vec<PathBuf> =
        entries.filter_map(|entry| Some(entry.ok()?.path())).take(MOST_VIEWS).collect();
    files.retain(|path| path.is_file());
    let order = |path: &PathBuf| {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        (name.parse::<u64>().unwrap_or(u64::MAX), name)
    };
    files.sort_by_key(order);
    Ok(files)
}

fn read_picture(path: &Path) -> Result<RgbaImage, RoomError> {
    let broken = |reason: String| RoomError::Picture { file: path.into(), reason };
    let reader = ImageReader::open(path).map_err(|error| broken(error.to_string()))?;
    let mut reader = reader.with_guessed_format().map_err(|error| broken(error.to_string()))?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MOST_SIDE_PX);
    limits.max_image_height = Some(MOST_SIDE_PX);
    reader.limits(limits);
    reader.decode().map(image::DynamicImage::into_rgba8).map_err(|error| broken(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ar::synthetic::{SyntheticRoom, to_pcd};

    #[test]
    fn a_cloud_brings_its_own_picture() {
        let room = SyntheticRoom::default();
        let seen = room.picture(&room.cameras()[0].resized(160, 120));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.pcd");
        std::fs::write(&path, to_pcd(&seen)).unwrap();
        let read = RecordedRoom::from_cloud(&path, None).unwrap();
        assert!(read.picture.colour == seen.colour);
        assert!(read.picture.camera.focal_px.distance(seen.camera.focal_px) < 0.01);
        // Another picture must have the same size.
        let image = folder.path().join("image.png");
        seen.colour.save(&image).unwrap();
        assert!(RecordedRoom::from_cloud(&path, Some(&image)).is_ok());
        RgbaImage::new(10, 10).save(&image).unwrap();
        assert!(matches!(RecordedRoom::from_cloud(&path, Some(&image)), Err(RoomError::Mismatch { .. })));
        std::fs::write(&image, b"no picture").unwrap();
        assert!(matches!(RecordedRoom::from_cloud(&path, Some(&image)), Err(RoomError::Picture { .. })));
        // Cut short, or without colours.
        let bytes = to_pcd(&seen);
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(RecordedRoom::from_cloud(&path, None).is_err());
        let plain = String::from_utf8_lossy(&bytes[..170]).replace("rgba", "odd_");
        std::fs::write(&path, [plain.as_bytes(), &bytes[170..]].concat()).unwrap();
        assert!(RecordedRoom::from_cloud(&path, None).is_err());
    }

    #[test]
    fn a_sequence_is_read_in_the_order_of_its_numbers() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(read_sequence(folder.path()), Err(RoomError::Sequence { .. })));
        for sub in ["depth", "color"] {
            std::fs::create_dir(folder.path().join(sub)).unwrap();
            for name in ["10.png", "2.png"] {
                std::fs::write(folder.path().join(sub).join(name), b"").unwrap();
            }
        }
        std::fs::write(folder.path().join("pose.txt"), "0 0 0 0 0 0 1\n1 0 0 0 0 0 1\n").unwrap();
        let views = read_sequence(folder.path()).unwrap();
        assert_eq!(views.iter().map(|view| view.name.as_str()).collect::<Vec<_>>(), ["2", "10"]);
        assert_eq!(views[1].room_from_camera, DMat4::from_translation(glam::DVec3::X));
        std::fs::write(folder.path().join("pose.txt"), "0 0 0 0 0 0 1\n").unwrap();
        assert!(read_sequence(folder.path()).is_err());
    }
}
