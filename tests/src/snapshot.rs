//! Pictures compared with the ones kept in `tests/goldens`.
//!
//! Near-exact on purpose: the software adapter repeats its pixels, and a loose bound would pass a picture whose
//! multisampling was lost. `cargo xtask goldens` (`HOLOPITCH_UPDATE_GOLDENS=1`) replaces them by what is drawn now.

use std::{
    fs,
    io::Cursor,
    path::{Path, PathBuf},
};

use image::{
    DynamicImage, ImageEncoder, RgbaImage,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};
use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageRgb8, FlipPool};

/// The largest picture that may be kept.
const MOST_BYTES: usize = 150_000;
/// The loosest bounds a test may ask for.
const LOOSEST_MEAN: f32 = 0.005;
const LOOSEST_BLOCK: f32 = 0.1;
/// Side of the blocks of which the worst one counts, pixels.
const BLOCK_PX: u32 = 16;

/// A picture that was drawn now, to be held against the one that is kept.
#[must_use = "a snapshot proves nothing until it is compared"]
pub struct Snapshot {
    name: &'static str,
    drawn: RgbaImage,
}

/// How different two pictures look (FLIP, 0 is the same, 1 black against white).
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    /// Over the whole picture.
    pub mean: f32,
    /// Of the 16 × 16 px block that differs most.
    pub worst_block: f32,
}

impl Snapshot {
    /// A snapshot to be compared with `goldens/NAME.png`.
    pub fn new(name: &'static str, drawn: RgbaImage) -> Self {
        Self { name, drawn }
    }

    /// Fails when the picture differs by more than `mean` on the whole or `worst_block` anywhere.
    ///
    /// # Panics
    /// When it does, when the kept picture is missing or too large, or when the bounds are looser than allowed.
    pub fn matches_within(self, mean: f32, worst_block: f32) {
        assert!(mean <= LOOSEST_MEAN && worst_block <= LOOSEST_BLOCK, "bounds too loose to prove anything");
        let kept_path = goldens().join(format!("{}.png", self.name));
        let encoded = encode(&self.drawn);
        assert!(encoded.len() <= MOST_BYTES, "{}: {} bytes are too many to keep", self.name, encoded.len());
        if std::env::var_os("HOLOPITCH_UPDATE_GOLDENS").is_some_and(|value| value == "1") {
            fs::write(&kept_path, encoded).unwrap_or_else(|error| panic!("{}: {error}", kept_path.display()));
            println!("updated {}", kept_path.display());
            return;
        }
        let kept = image::open(&kept_path).map(DynamicImage::into_rgba8);
        let kept = kept.unwrap_or_else(|error| {
            panic!("{}: {error}: `cargo xtask goldens` draws it", kept_path.display())
        });
        let difference = compare(&kept, &self.drawn);
        println!("{}: {difference:?}", self.name);
        if difference.mean > mean || difference.worst_block > worst_block {
            let failed = failures().join(format!("{}.png", self.name));
            fs::write(&failed, encoded).unwrap_or_else(|error| panic!("{}: {error}", failed.display()));
            panic!(
                "{} differs: {difference:?}, allowed {mean} and {worst_block}; drawn now: {}, kept: {}",
                self.name,
                failed.display(),
                kept_path.display()
            );
        }
    }
}

/// How different two pictures of the same size look.
///
/// # Panics
/// When the sizes differ.
#[must_use]
pub fn compare(kept: &RgbaImage, drawn: &RgbaImage) -> Difference {
    assert_eq!(kept.dimensions(), drawn.dimensions(), "the pictures have different sizes");
    let (width, height) = kept.dimensions();
    let flip_image = |picture: &RgbaImage| {
        let rgb = DynamicImage::ImageRgba8(picture.clone()).into_rgb8();
        FlipImageRgb8::with_data(width, height, &rgb)
    };
    let error = nv_flip::flip(flip_image(kept), flip_image(drawn), DEFAULT_PIXELS_PER_DEGREE);
    let mean = FlipPool::from_image(&error).mean();
    let values = error.to_vec();
    let mut worst_block = 0.0_f32;
    for top in (0..height).step_by(BLOCK_PX as usize) {
        for left in (0..width).step_by(BLOCK_PX as usize) {
            let rows = top..(top + BLOCK_PX).min(height);
            let columns = left..(left + BLOCK_PX).min(width);
            let count = (rows.len() * columns.len()) as f32;
            let sum: f32 = rows
                .flat_map(|row| columns.clone().map(move |column| (row * width + column) as usize))
                .map(|index| values[index])
                .sum();
            worst_block = worst_block.max(sum / count);
        }
    }
    Difference { mean, worst_block }
}

fn encode(picture: &RgbaImage) -> Vec<u8> {
    let rgb = DynamicImage::ImageRgba8(picture.clone()).into_rgb8();
    let mut bytes = Cursor::new(Vec::new());
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive)
        .write_image(&rgb, rgb.width(), rgb.height(), image::ExtendedColorType::Rgb8)
        .unwrap_or_else(|error| panic!("PNG: {error}"));
    bytes.into_inner()
}

fn goldens() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("goldens")
}

fn failures() -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/goldens");
    fs::create_dir_all(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    folder
}
