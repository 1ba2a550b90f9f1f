//! Truth in pictures: who is in front at every pixel, and each person's first and last surface along every ray, hidden
//! or not, packed into two sheets per frame.

use std::io::Cursor;

use glam::{DVec2, DVec3};
use image::{GrayImage, ImageBuffer, ImageEncoder, Luma, codecs::png};
use protocol::camera::Camera;
use serde::Serialize;

use crate::{
    SynthesisError,
    dataset::plane_depth,
    raster::{self, Grid},
    render::Actor,
};

/// Value of the people map where nobody is in front; person `id` has the value `id + 1`.
pub const NOBODY: u8 = 0;
/// Metres between two values of a sheet.
pub const OFFSET_STEP_M: f64 = 0.0001;
/// Value of a sheet on the virtual plane; 0 is outside the person.
pub const OFFSET_ZERO: u16 = 32_768;

/// A rectangle of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tile {
    pub(super) first: [i32; 2],
    pub(super) size: [usize; 2],
}

impl Tile {
    /// The pixels inside the picture that a box from `low` to `high` touches.
    pub(super) fn inside_picture(low: DVec2, high: DVec2, size: [usize; 2]) -> Self {
        let last = DVec2::new(size[0] as f64 - 1.0, size[1] as f64 - 1.0);
        let first = low.floor().clamp(DVec2::ZERO, last);
        let end = high.ceil().clamp(first, last);
        let side = end - first + 1.0;
        Self { first: first.as_ivec2().to_array(), size: [side.x as usize, side.y as usize] }
    }
}

/// One person alone: depth along the optical axis of the first and the last surface at every pixel of a tile; 0 outside.
pub(super) struct PersonMaps {
    tile: Tile,
    front_m: Vec<f32>,
    back_m: Vec<f32>,
}

impl PersonMaps {
    pub(super) fn draw(camera: &Camera, actor: &Actor<'_>, tile: Tile) -> Self {
        let grid = Grid::over_pixels(tile.first, tile.size, 1);
        let triangles = actor.figure.triangles.as_slice();
        let [front_m, back_m] = raster::first_and_last(camera, grid, &actor.posed.positions, triangles);
        Self { tile, front_m, back_m }
    }

    /// Pixels of the person, hidden or not.
    pub(super) fn pixels(&self) -> usize {
        self.front_m.iter().filter(|&&depth| depth > 0.0).count()
    }
}

/// Where a person's depths lie in the sheets of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Sheet {
    /// First pixel in the sheet.
    pub at: [u32; 2],
    /// The pixel of the clip that it stands for.
    pub first_px: [u32; 2],
    /// Width and height.
    pub size: [u32; 2],
}

type Deep = ImageBuffer<Luma<u16>, Vec<u16>>;

/// The maps of one frame.
#[derive(Clone, Debug)]
pub struct Maps {
    /// [`NOBODY`], or the identity of the person in front plus one.
    pub people: GrayImage,
    /// 0, or the marking whose paint covers the pixel's middle, from 1; as if nobody stood there.
    pub lines: GrayImage,
    /// The first surface of each person: ([`OFFSET_ZERO`] + offset from the virtual plane / [`OFFSET_STEP_M`]), 0 outside.
    pub front: Deep,
    /// The last surface.
    pub back: Deep,
    shelf: Shelf,
}

/// Tiles side by side from the left, shelf under shelf.
#[derive(Clone, Copy, Debug, Default)]
struct Shelf {
    x: u32,
    y: u32,
    height: u32,
}

impl Maps {
    pub(super) fn new(size: [usize; 2], hits: &[Option<(usize, f32)>], lines: GrayImage) -> Self {
        let (width, height) = (size[0] as u32, size[1] as u32);
        let value = |x: u32, y: u32| {
            hits[y as usize * size[0] + x as usize].map_or(NOBODY, |(actor, _)| (actor + 1).min(255) as u8)
        };
        Self {
            people: GrayImage::from_fn(width, height, |x, y| Luma([value(x, y)])),
            lines,
            front: Deep::new(width, 1),
            back: Deep::new(width, 1),
            shelf: Shelf::default(),
        }
    }

    /// Puts a person into the sheets.
    pub(super) fn add(&mut self, camera: &Camera, anchor: DVec3, person: &PersonMaps) -> Sheet {
        let size = person.tile.size.map(|side| side as u32);
        if self.shelf.x + size[0] > self.front.width() {
            self.shelf = Shelf { x: 0, y: self.shelf.y + self.shelf.height, height: 0 };
        }
        let at = [self.shelf.x, self.shelf.y];
        self.shelf.x += size[0];
        self.shelf.height = self.shelf.height.max(size[1]);
        let needed = self.shelf.y + self.shelf.height;
        for sheet in [&mut self.front, &mut self.back] {
            if sheet.height() < needed {
                let mut larger = Deep::new(sheet.width(), needed);
                image::imageops::replace(&mut larger, sheet, 0, 0);
                *sheet = larger;
            }
        }
        for (sheet, depths) in [(&mut self.front, &person.front_m), (&mut self.back, &person.back_m)] {
            for (place, &depth) in depths.iter().enumerate().filter(|(_, depth)| **depth > 0.0) {
                let (x, y) = (place % person.tile.size[0], place / person.tile.size[0]);
                let [first_x, first_y] = person.tile.first.map(f64::from);
                let pixel = DVec2::new(first_x + x as f64, first_y + y as f64);
                let offset = f64::from(depth) - plane_depth(camera, anchor, pixel);
                let value = (f64::from(OFFSET_ZERO) + offset / OFFSET_STEP_M).round().clamp(1.0, 65_535.0);
                sheet.put_pixel(at[0] + x as u32, at[1] + y as u32, Luma([value as u16]));
            }
        }
        Sheet { at, first_px: person.tile.first.map(|first| first.max(0) as u32), size }
    }

    /// The four files of a frame: ending of the name and content.
    pub fn files(&self) -> Result<[(&'static str, Vec<u8>); 4], SynthesisError> {
        let deep = |sheet: &Deep| {
            let bytes: Vec<u8> = sheet.as_raw().iter().flat_map(|value| value.to_ne_bytes()).collect();
            encode(&bytes, sheet.dimensions(), image::ExtendedColorType::L16)
        };
        let flat = |map: &GrayImage| encode(map.as_raw(), map.dimensions(), image::ExtendedColorType::L8);
        Ok([
            ("people", flat(&self.people)?),
            ("lines", flat(&self.lines)?),
            ("front", deep(&self.front)?),
            ("back", deep(&self.back)?),
        ])
    }
}

fn encode(
    bytes: &[u8],
    (width, height): (u32, u32),
    kind: image::ExtendedColorType,
) -> Result<Vec<u8>, SynthesisError> {
    let mut file = Cursor::new(Vec::new());
    png::PngEncoder::new_with_quality(&mut file, png::CompressionType::Fast, png::FilterType::Adaptive)
        .write_image(bytes, width, height, kind)
        .map_err(SynthesisError::Picture)?;
    Ok(file.into_inner())
}
