//! How the texture of a mesh changes: the picture of each wave, in tiles of 8 × 8 pixels, by the cosine transform.
//!
//! A tile is a block of luma and one of each chroma, all at full size: players are small, and kits at half the resolution cost more than they save
//! (32 dB at best). Tiles that no triangle wears are not stored.

use std::sync::LazyLock;

use super::{
    entropy::{Reader, Recorder},
    motion,
};
use crate::chunk::ChunkError;

/// Width and height of a tile, pixels.
pub(super) const TILE_PX: usize = 8;
/// Values of a tile: a block of luma, one of each chroma.
pub(super) const TILE_VALUES: usize = 3 * BLOCK;
const BLOCK: usize = 64;
/// First contexts: of where a block ends, of its mean, and of its other values.
const END: u8 = motion::CONTEXTS;
const MEAN: u8 = END + 2 * 3 * 4;
const VALUE: u8 = MEAN + 2;
/// Values beyond this many steps are no picture.
const LARGEST: i32 = 1 << 16;

/// JPEG's zigzag order.
const ZIGZAG: [u8; BLOCK] = [
    0, 1, 8, 16, 9, 2, 3, 10, 17, 24, 32, 25, 18, 11, 4, 5, 12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13, 6, 7,
    14, 21, 28, 35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51, 58, 59, 52, 45, 38, 31, 39,
    46, 53, 60, 61, 54, 47, 55, 62, 63,
];

/// The orthonormal cosine basis: frequency by place.
static COSINES: LazyLock<[[f32; 8]; 8]> = LazyLock::new(|| {
    std::array::from_fn(|frequency| {
        std::array::from_fn(|place| {
            let scale = if frequency == 0 { 0.125f64 } else { 0.25 }.sqrt();
            let angle = (2 * place + 1) as f64 * frequency as f64 * std::f64::consts::PI / 16.0;
            (scale * angle.cos()) as f32
        })
    })
});

/// Places to frequencies.
pub(super) fn forward(block: &[f32; BLOCK]) -> [f32; BLOCK] {
    let cosines = &*COSINES;
    let mut rows = [0.0; BLOCK];
    for y in 0..8 {
        for u in 0..8 {
            rows[y * 8 + u] = (0..8).map(|x| cosines[u][x] * block[y * 8 + x]).sum();
        }
    }
    let mut out = [0.0; BLOCK];
    for v in 0..8 {
        for u in 0..8 {
            out[v * 8 + u] = (0..8).map(|y| cosines[v][y] * rows[y * 8 + u]).sum();
        }
    }
    out
}

/// Frequencies to places.
fn inverse(block: &[f32; BLOCK]) -> [f32; BLOCK] {
    let cosines = &*COSINES;
    let mut columns = [0.0; BLOCK];
    for v in 0..8 {
        let row: &[f32] = &block[v * 8..v * 8 + 8];
        if row.iter().all(|value| *value == 0.0) {
            continue;
        }
        for y in 0..8 {
            for u in 0..8 {
                columns[y * 8 + u] += cosines[v][y] * row[u];
            }
        }
    }
    let mut out = [0.0; BLOCK];
    for y in 0..8 {
        for u in 0..8 {
            let value = columns[y * 8 + u];
            for x in 0..8 {
                out[y * 8 + x] += cosines[u][x] * value;
            }
        }
    }
    out
}

/// Writes or reads the blocks of one wave.
pub(super) struct Blocks {
    wave: usize,
    /// Where the last block of luma ended, and of chroma.
    ends: [u32; 2],
    /// The mean of the last block of luma and of each chroma.
    means: [i32; 3],
}

impl Blocks {
    pub(super) fn of_wave(wave: usize) -> Self {
        Self { wave, ends: [0; 2], means: [0; 3] }
    }

    /// Luma or chroma of a tile's block, and the channel.
    fn kind(block: usize) -> (u8, usize) {
        (u8::from(block > 0), block)
    }

    fn end_context(&self, plane: u8) -> u8 {
        let wave = match self.wave {
            0 => 0,
            1..=2 => 1,
            _ => 2,
        };
        let before = match self.ends[usize::from(plane)] {
            0 => 0,
            1..=2 => 1,
            3..=8 => 2,
            _ => 3,
        };
        END + plane * 12 + wave * 4 + before
    }

    fn value_context(&self, plane: u8, place: usize, before: i32) -> u8 {
        if place == 0 && self.wave == 0 {
            return MEAN + plane;
        }
        let wave = u8::from(self.wave > 0);
        let band = match place {
            0 => 0,
            1..=2 => 1,
            3..=5 => 2,
            6..=14 => 3,
            _ => 4,
        };
        VALUE + plane * 30 + wave * 15 + band * 3 + before.unsigned_abs().min(2) as u8
    }

    /// Writes block `block` of a tile: steps, in rows of frequencies.
    pub(super) fn write(&mut self, recorder: &mut Recorder, block: usize, steps: &[i32; BLOCK]) {
        let (plane, channel) = Self::kind(block);
        let mut ordered = ZIGZAG.map(|place| steps[usize::from(place)]);
        if self.wave == 0 {
            let mean = ordered[0];
            ordered[0] -= std::mem::replace(&mut self.means[channel], mean);
        }
        let end = ordered.iter().rposition(|value| *value != 0).map_or(0, |last| last + 1);
        recorder.push(self.end_context(plane), end as u32);
        self.ends[usize::from(plane)] = end as u32;
        let mut before = 0;
        for (place, value) in ordered.into_iter().enumerate().take(end) {
            recorder.push_signed(self.value_context(plane, place, before), value);
            before = value;
        }
    }

    /// Reads what [`Blocks::write`] wrote; returns where it ended too.
    ///
    /// # Errors
    /// When the data is no block.
    pub(super) fn read(
        &mut self,
        reader: &mut Reader<'_>,
        block: usize,
    ) -> Result<([i32; BLOCK], usize), ChunkError> {
        let corrupt = ChunkError::Corrupt { what: "texture" };
        let (plane, channel) = Self::kind(block);
        let end = reader.number(self.end_context(plane))?;
        self.ends[usize::from(plane)] = end;
        let end = usize::try_from(end).ok().filter(|end| *end <= BLOCK).ok_or(corrupt.clone())?;
        let mut steps = [0; BLOCK];
        let mut before = 0;
        for (place, at) in ZIGZAG.iter().enumerate().take(end) {
            before = reader.signed(self.value_context(plane, place, before))?;
            if before.abs() > LARGEST {
                return Err(corrupt);
            }
            steps[usize::from(*at)] = before;
        }
        if self.wave == 0 {
            steps[0] += self.means[channel];
            self.means[channel] = steps[0];
            if steps[0].abs() > LARGEST {
                return Err(corrupt);
            }
        }
        Ok((steps, end))
    }
}

/// The picture of a block of `steps` of size `step`, added to nothing: zeros stay zeros.
pub(super) fn picture(steps: &[i32; BLOCK], end: usize, step: f32, out: &mut [f32]) {
    match end {
        // A flat block needs no transform.
        0 | 1 => out.fill(steps[0] as f32 * step / 8.0),
        _ => out.copy_from_slice(&inverse(&steps.map(|value| value as f32 * step))),
    }
}

/// A tile of a picture as values: luma, then both chromas, which are 0 in grey.
pub(super) fn tile(pixel: impl Fn(usize, usize) -> [u8; 3]) -> [f32; TILE_VALUES] {
    let mut values = [0.0; TILE_VALUES];
    for at in 0..BLOCK {
        let [r, g, b] = pixel(at % TILE_PX, at / TILE_PX).map(f32::from);
        let luma = 0.299 * r + 0.587 * g + 0.114 * b;
        values[at] = luma;
        values[BLOCK + at] = (b - luma) * 0.564;
        values[2 * BLOCK + at] = (r - luma) * 0.713;
    }
    values
}

/// Writes a tile's values as pixels of red, green, blue and 255 into `out`, whose rows have `row_bytes` bytes.
pub(super) fn paint(values: &[f32; TILE_VALUES], out: &mut [u8], row_bytes: usize) {
    let ([luma, blue, red], _) = values.as_chunks::<BLOCK>() else { return };
    for y in 0..TILE_PX {
        let Some(row) = out.get_mut(y * row_bytes..y * row_bytes + 4 * TILE_PX) else { return };
        for (x, pixel) in row.as_chunks_mut::<4>().0.iter_mut().enumerate() {
            let at = y * TILE_PX + x;
            let (luma, blue, red) = (luma[at] + 0.5, blue[at], red[at]);
            // The cast of a float rounds towards zero and stays in range.
            let colour = [luma + 1.403 * red, luma - 0.344 * blue - 0.714 * red, luma + 1.773 * blue];
            *pixel = [colour[0] as u8, colour[1] as u8, colour[2] as u8, 255];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_comes_back_and_keeps_lengths() {
        let block: [f32; BLOCK] = std::array::from_fn(|i| ((i * 37) % 101) as f32 - 50.0);
        let there = forward(&block);
        let energy = |values: &[f32]| values.iter().map(|value| value * value).sum::<f32>();
        assert!((energy(&there) / energy(&block) - 1.0).abs() < 1e-5);
        for (a, b) in inverse(&there).iter().zip(block) {
            assert!((a - b).abs() < 1e-3);
        }
        let mut flat = [0.0; BLOCK];
        let steps: [i32; BLOCK] = std::array::from_fn(|i| if i == 0 { 24 } else { 0 });
        picture(&steps, 1, 2.0, &mut flat);
        assert!(flat.iter().all(|value| (value - 6.0).abs() < 1e-6));
    }

    #[test]
    fn colours_come_back_from_a_tile() {
        let colour = |x: usize, y: usize| [(x * 30) as u8, (y * 25) as u8, 90];
        let mut out = vec![0; TILE_PX * TILE_PX * 4];
        paint(&tile(colour), &mut out, TILE_PX * 4);
        for (index, pixel) in out.as_chunks::<4>().0.iter().enumerate() {
            let expected = colour(index % TILE_PX, index / TILE_PX);
            for channel in 0..3 {
                assert!(pixel[channel].abs_diff(expected[channel]) <= 2, "{pixel:?} for {expected:?}");
            }
        }
    }
}
