//! A frame as the shot detector sees it: 64 × 36 values of brightness and two of colour.

use super::motion::Motion;
use crate::ingest::THUMBNAIL_SIZE;

/// Columns.
pub(super) const WIDTH: usize = THUMBNAIL_SIZE.0 as usize;
/// Rows.
pub(super) const HEIGHT: usize = THUMBNAIL_SIZE.1 as usize;
/// Brightness, blue and red difference.
pub(super) const CHANNELS: usize = 3;

/// One value per pixel, row by row.
pub(super) type Plane = Vec<f32>;

/// A small picture: brightness 0..255 and the two colour differences of ITU-R BT.601.
#[derive(Clone, Debug)]
pub(super) struct Thumbnail {
    pub(super) planes: [Plane; CHANNELS],
}

impl Thumbnail {
    /// From RGB, row by row; a pixel that is missing is black.
    pub(super) fn from_rgb(rgb: &[u8]) -> Self {
        let mut planes = [(); CHANNELS].map(|()| vec![0.0; WIDTH * HEIGHT]);
        let [luma, blue, red] = &mut planes;
        for (i, pixel) in rgb.as_chunks::<3>().0.iter().take(WIDTH * HEIGHT).enumerate() {
            let [r, g, b] = pixel.map(f32::from);
            let y = 0.299 * r + 0.587 * g + 0.114 * b;
            luma[i] = y;
            blue[i] = 0.564 * (b - y);
            red[i] = 0.713 * (r - y);
        }
        Self { planes }
    }

    /// Brightness.
    pub(super) fn luma(&self) -> &Plane {
        &self.planes[0]
    }

    /// Variance about the mean, summed over the channels.
    pub(super) fn contrast(&self) -> f32 {
        let variance = |plane: &Plane| {
            let n = plane.len().max(1) as f32;
            let mean = plane.iter().sum::<f32>() / n;
            plane.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / n
        };
        self.planes.iter().map(variance).sum()
    }

    /// This picture as the camera shows it after `motion`; `None` for pixels that were not in view before.
    pub(super) fn warped(&self, motion: &Motion) -> Warped {
        let mut inside = vec![false; WIDTH * HEIGHT];
        let mut planes = [(); CHANNELS].map(|()| vec![0.0; WIDTH * HEIGHT]);
        for y in 0..HEIGHT {
            for x in 0..WIDTH {
                let [u, v] = motion.source(x as f32, y as f32);
                let (x0, y0) = (u.floor(), v.floor());
                if x0 < 0.0 || y0 < 0.0 || x0 + 1.0 >= WIDTH as f32 || y0 + 1.0 >= HEIGHT as f32 {
                    continue;
                }
                let (fx, fy, at) = (u - x0, v - y0, y0 as usize * WIDTH + x0 as usize);
                inside[y * WIDTH + x] = true;
                for (plane, out) in self.planes.iter().zip(&mut planes) {
                    let top = plane[at] * (1.0 - fx) + plane[at + 1] * fx;
                    let bottom = plane[at + WIDTH] * (1.0 - fx) + plane[at + WIDTH + 1] * fx;
                    out[y * WIDTH + x] = top * (1.0 - fy) + bottom * fy;
                }
            }
        }
        Warped { planes, inside }
    }
}

/// A thumbnail moved by a camera motion.
pub(super) struct Warped {
    pub(super) planes: [Plane; CHANNELS],
    /// Which pixels are known.
    pub(super) inside: Vec<bool>,
}
