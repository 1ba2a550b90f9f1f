//! Values in image space that several stages share. Pixels of the clip: origin at the centre of the top-left pixel.

use glam::DVec2;
use image::RgbImage;
use serde::{Deserialize, Serialize};

/// The colour of a picture between its pixels, 0..255; its edges go on for ever, an empty one is black.
#[must_use]
pub fn bilinear(picture: &RgbImage, at: DVec2) -> [f32; 3] {
    let (last_x, last_y) =
        (i64::from(picture.width().saturating_sub(1)), i64::from(picture.height().saturating_sub(1)));
    let low = at.floor();
    let (fx, fy) = ((at.x - low.x) as f32, (at.y - low.y) as f32);
    let pixel = |x: i64, y: i64| {
        let pixel = picture.get_pixel_checked(x.clamp(0, last_x) as u32, y.clamp(0, last_y) as u32);
        pixel.map_or([0.0; 3], |pixel| pixel.0.map(f32::from))
    };
    let (x, y) = (low.x as i64, low.y as i64);
    let [right, below] = [x.saturating_add(1), y.saturating_add(1)];
    let (a, b, c, d) = (pixel(x, y), pixel(right, y), pixel(x, below), pixel(right, below));
    std::array::from_fn(|k| {
        let top = a[k] + (b[k] - a[k]) * fx;
        let bottom = c[k] + (d[k] - c[k]) * fx;
        top + (bottom - top) * fy
    })
}

/// An axis-aligned box in pixels of the clip; may reach outside the picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PixelBox {
    /// Left and top edge.
    pub min: DVec2,
    /// Right and bottom edge.
    pub max: DVec2,
}

impl PixelBox {
    /// Width and height in pixels.
    #[must_use]
    pub fn size(&self) -> DVec2 {
        (self.max - self.min).max(DVec2::ZERO)
    }

    /// The middle.
    #[must_use]
    pub fn centre(&self) -> DVec2 {
        (self.min + self.max) / 2.0
    }

    /// Whether a pixel lies inside.
    #[must_use]
    pub fn contains(&self, pixel: DVec2) -> bool {
        pixel.cmpge(self.min).all() && pixel.cmple(self.max).all()
    }

    /// Intersection over union with another box, 0..1.
    #[must_use]
    pub fn iou(&self, other: &Self) -> f64 {
        let overlap = Self { min: self.min.max(other.min), max: self.max.min(other.max) };
        let area = |b: &Self| b.size().x * b.size().y;
        let intersection = area(&overlap);
        let union = area(self) + area(other) - intersection;
        if union > 0.0 { intersection / union } else { 0.0 }
    }
}

/// A soft mask over a rectangle of whole pixels of the clip.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mask {
    /// Left column of the rectangle, may be negative.
    pub x0: i32,
    /// Top row of the rectangle, may be negative.
    pub y0: i32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Share of each pixel that belongs to the person, 0..255, row by row.
    pub coverage: Vec<u8>,
}

impl Mask {
    /// Coverage at a pixel of the clip; 0 outside the rectangle.
    #[must_use]
    pub fn at(&self, x: i32, y: i32) -> u8 {
        let (column, row) = (i64::from(x) - i64::from(self.x0), i64::from(y) - i64::from(self.y0));
        let inside =
            column >= 0 && row >= 0 && column < i64::from(self.width) && row < i64::from(self.height);
        if !inside {
            return 0;
        }
        let index = row as usize * self.width as usize + column as usize;
        self.coverage.get(index).copied().unwrap_or(0)
    }

    /// Pixels that belong to the person more than not.
    #[must_use]
    pub fn area_px(&self) -> usize {
        self.coverage.iter().filter(|&&c| c >= 128).count()
    }
}
