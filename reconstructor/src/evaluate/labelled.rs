//! Labelled pictures in the YOLO form: `images/NAME.jpg|png` beside `labels/NAME.txt`, one box a line (class, middle and
//! size as shares of the picture).

use std::path::{Path, PathBuf};

use glam::DVec2;
use image::{ImageReader, RgbImage, imageops};
use rayon::prelude::*;

use crate::geometry::PixelBox;

/// Sets of real pictures are often stretched to squares: a picture that is not 16:9 is brought to this size.
const STRETCHED_PX: (u32, u32) = (1920, 1080);
/// Class of the ball; every other class is a person.
const BALL: u32 = 0;
/// Overlap (intersection over union) at which a box counts as found.
const IOU_MIN: f64 = 0.5;
/// More boxes than any picture of a match has.
const BOXES_MAX: usize = 1000;

/// A picture with the boxes of its people and its ball.
#[derive(Clone, Debug)]
pub struct LabelledPicture {
    /// The picture, 16:9.
    pub picture: RgbImage,
    /// Boxes of the people on the pitch, pixels of `picture`.
    pub people: Vec<PixelBox>,
    /// Boxes of balls, pixels of `picture`.
    pub balls: Vec<PixelBox>,
}

impl LabelledPicture {
    /// Whether each box, the surest first, is of a labelled person: it takes the free label that it overlaps most, by
    /// [`IOU_MIN`] at least.
    pub(super) fn claims<'a>(&self, boxes: impl IntoIterator<Item = &'a PixelBox>) -> Vec<bool> {
        let mut free: Vec<&PixelBox> = self.people.iter().collect();
        let claim = |bounds: &PixelBox| {
            let overlaps = free.iter().map(|label| label.iou(bounds)).enumerate();
            let best = overlaps.filter(|(_, overlap)| *overlap >= IOU_MIN).max_by(|a, b| a.1.total_cmp(&b.1));
            best.map(|(index, _)| free.swap_remove(index)).is_some()
        };
        boxes.into_iter().map(claim).collect()
    }
}

/// A folder or file of labelled pictures could not be read.
#[derive(Debug, thiserror::Error)]
#[error("cannot read {}: {reason}", path.display())]
pub struct LabelError {
    /// Which.
    pub path: PathBuf,
    /// Why, and what to do.
    pub reason: String,
}

/// Reads every labelled picture of a folder (or of its subfolder `valid`), in the order of their names, and brings it to
/// `size_px`; when `None`, only those that are not 16:9 are brought to 1920×1080.
pub(super) fn read(folder: &Path, size_px: Option<(u32, u32)>) -> Result<Vec<LabelledPicture>, LabelError> {
    let inner = folder.join("valid");
    let folder = if inner.join("labels").is_dir() { inner } else { folder.to_owned() };
    let labels = folder.join("labels");
    let failed = |path: &Path, reason: String| LabelError { path: path.into(), reason };
    let entries = std::fs::read_dir(&labels).map_err(|error| {
        failed(&labels, format!("{error}; a set of labelled pictures has the folders images/ and labels/"))
    })?;
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "txt"));
    files.sort();
    if files.is_empty() {
        return Err(failed(&labels, "there are no labels (*.txt) in it".into()));
    }
    files
        .par_iter()
        .map(|label| {
            let text = std::fs::read_to_string(label).map_err(|error| failed(label, error.to_string()))?;
            let stem = folder.join("images").join(label.file_stem().unwrap_or_default());
            // Names of files may have further dots: the ending is put behind, not instead.
            let named = |ending: &str| {
                let mut name = stem.clone().into_os_string();
                name.push(ending);
                PathBuf::from(name)
            };
            let path = [".jpg", ".png"].map(named).into_iter().find(|path| path.is_file());
            let path = path.ok_or_else(|| failed(&stem, "there is no such .jpg or .png".into()))?;
            let reader = ImageReader::open(&path).map_err(|error| failed(&path, error.to_string()))?;
            let picture = reader.decode().map_err(|error| failed(&path, error.to_string()))?.into_rgb8();
            let (width, height) = picture.dimensions();
            let is_broadcast = 9 * u64::from(width) == 16 * u64::from(height);
            let size = size_px.unwrap_or(if is_broadcast { (width, height) } else { STRETCHED_PX });
            let picture = if (width, height) == size {
                picture
            } else {
                imageops::resize(&picture, size.0, size.1, imageops::FilterType::CatmullRom)
            };
            let (people, balls) = boxes(&text, size).map_err(|reason| failed(label, reason))?;
            Ok(LabelledPicture { picture, people, balls })
        })
        .collect()
}

/// The boxes of the people and of the balls of one label file, in a picture of `size_px`.
fn boxes(text: &str, size_px: (u32, u32)) -> Result<(Vec<PixelBox>, Vec<PixelBox>), String> {
    let size = DVec2::new(f64::from(size_px.0), f64::from(size_px.1));
    let (mut people, mut balls) = (Vec::new(), Vec::new());
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let wrong = || format!("line {}: expected `class x y width height`, found `{line}`", index + 1);
        let mut words = line.split_whitespace();
        let class: u32 = words.next().and_then(|word| word.parse().ok()).ok_or_else(wrong)?;
        let numbers: Vec<f64> = words.map_while(|word| word.parse().ok()).collect();
        let [x, y, width, height] = numbers[..] else { return Err(wrong()) };
        if people.len() + balls.len() == BOXES_MAX {
            return Err(format!("more than {BOXES_MAX} boxes"));
        }
        let (middle, half) = (DVec2::new(x, y) * size - 0.5, DVec2::new(width, height) * size / 2.0);
        if !(middle.is_finite() && half.is_finite() && half.min_element() > 0.0) {
            return Err(wrong());
        }
        let kind = if class == BALL { &mut balls } else { &mut people };
        kind.push(PixelBox { min: middle - half, max: middle + half });
    }
    Ok((people, balls))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_read_and_nonsense_is_named() {
        let (people, balls) = boxes("0 0.5 0.5 0.01 0.02\n2 0.5 0.25 0.1 0.2\n\n", (1280, 720)).unwrap();
        assert_eq!(people, vec![PixelBox { min: DVec2::new(575.5, 107.5), max: DVec2::new(703.5, 251.5) }]);
        assert_eq!(balls.len(), 1);
        for text in ["2 0.5 0.5 0.1", "x 1 1 1 1", "2 0.5 nan 0.1 0.1", "2 0.5 0.5 -0.1 0.1"] {
            assert!(boxes(text, (1280, 720)).unwrap_err().contains("line 1"), "{text}");
        }
    }

    #[test]
    fn a_folder_without_labels_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = read(folder.path(), None).unwrap_err().to_string();
        assert!(error.contains("labels"), "{error}");
        std::fs::create_dir(folder.path().join("labels")).unwrap();
        std::fs::write(folder.path().join("labels/a.b.txt"), "2 0.5 0.5 0.1 0.1").unwrap();
        let error = read(folder.path(), None).unwrap_err().to_string();
        assert!(error.contains("a.b"), "{error}");
    }
}
