//! Values in image space that several stages share. Pixels of the clip: origin at the centre of the top-left pixel.

use glam::DVec2;
use serde::{Deserialize, Serialize};

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
