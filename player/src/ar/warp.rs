//! A scan seen from beside the place where it was taken: every pixel with depth is a small patch in the room.

use glam::{DVec2, DVec3};
use image::RgbaImage;

use super::{RoomCamera, RoomPicture, holes};

/// What the sensor did not see from where it stood, sRGB.
const UNSEEN: [u8; 4] = [46, 47, 50, 255];
/// Neighbours whose depths differ by more than this share belong to different things.
const MOST_JUMP: f32 = 0.02;

impl RoomPicture {
    /// The room of this picture from another camera. What was hidden from the first one stays dark and without depth.
    #[must_use]
    pub fn seen_from(&self, camera: RoomCamera) -> Self {
        let [width, height] = camera.size_px;
        let mut drawn = Self {
            colour: RgbaImage::from_pixel(width, height, image::Rgba(UNSEEN)),
            depth_m: vec![0.0; width as usize * height as usize],
            camera,
        };
        let (columns, rows) = self.colour.dimensions();
        for row in 0..rows.saturating_sub(1) {
            for column in 0..columns.saturating_sub(1) {
                self.warp_patch(column, row, &mut drawn);
            }
        }
        holes::fill(&mut drawn.depth_m, width as usize);
        drawn
    }

    /// The patch between a pixel and its neighbours to the right and below.
    fn warp_patch(&self, column: u32, row: u32, drawn: &mut Self) {
        let places = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(x, y)| (column + x, row + y));
        let depth = |(column, row): (u32, u32)| self.depth_m[(row * self.colour.width() + column) as usize];
        let depths = places.map(depth);
        let (least, most) = depths.iter().fold((f32::MAX, 0.0_f32), |(l, m), d| (l.min(*d), m.max(*d)));
        if !holes::is_measured(least) || most - least > MOST_JUMP * least {
            return;
        }
        let corner = |(column, row): (u32, u32)| {
            let (pixel, depth_m) = drawn.camera.project(self.point_m(column, row)?)?;
            let colour = self.colour.get_pixel(column, row).0.map(f64::from);
            Some((pixel, depth_m, DVec3::new(colour[0], colour[1], colour[2])))
        };
        let [Some(a), Some(b), Some(c), Some(d)] = places.map(corner) else { return };
        draw_triangle([a, b, c], drawn);
        draw_triangle([a, c, d], drawn);
    }
}

/// Fills a triangle of (pixel, depth, colour); the nearest wins. Patches are a few pixels large, so that colours and
/// depths may be mixed linearly in the picture.
fn draw_triangle(corners: [(DVec2, f64, DVec3); 3], drawn: &mut RoomPicture) {
    let [a, b, c] = corners.map(|(pixel, ..)| pixel);
    let twice_area = (b - a).perp_dot(c - a);
    if twice_area.abs() < 1e-9 {
        return;
    }
    let size = DVec2::new(f64::from(drawn.colour.width()), f64::from(drawn.colour.height()));
    let low = a.min(b).min(c).ceil().max(DVec2::ZERO);
    let high = a.max(b).max(c).floor().min(size - 1.0);
    if low.x > high.x || low.y > high.y {
        return;
    }
    for row in low.y as u32..=high.y as u32 {
        for column in low.x as u32..=high.x as u32 {
            let at = DVec2::new(f64::from(column), f64::from(row));
            let weights = [
                (b - at).perp_dot(c - at) / twice_area,
                (c - at).perp_dot(a - at) / twice_area,
                (a - at).perp_dot(b - at) / twice_area,
            ];
            // A hair outside, so that no seam stays open between two patches.
            if weights.iter().any(|weight| *weight < -1e-9) {
                continue;
            }
            let mixed = |value: fn(&(DVec2, f64, DVec3)) -> DVec3| {
                weights.iter().zip(&corners).map(|(weight, corner)| value(corner) * *weight).sum::<DVec3>()
            };
            let depth = mixed(|corner| DVec3::splat(corner.1)).x as f32;
            let colour =
                mixed(|corner| corner.2).to_array().map(|value| value.clamp(0.0, 255.0).round() as u8);
            let index = (row * drawn.colour.width() + column) as usize;
            if let Some(held) = drawn.depth_m.get_mut(index)
                && (!holes::is_measured(*held) || depth < *held)
            {
                *held = depth;
                drawn.colour.put_pixel(column, row, image::Rgba([colour[0], colour[1], colour[2], 255]));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ar::synthetic::SyntheticRoom;

    #[test]
    fn a_warped_picture_is_what_a_second_camera_would_see() {
        let room = SyntheticRoom { sensor: false, ..SyntheticRoom::default() };
        let first = room.cameras()[0];
        let beside =
            first.looking_at(first.position_m + DVec3::new(0.12, 0.05, 0.0), DVec3::Y * 0.74, DVec3::Y);
        let warped = room.picture(&first).seen_from(beside);
        let truth = room.picture(&beside);
        let (mut seen, mut wrong) = (0, 0);
        for (index, (a, b)) in warped.depth_m.iter().zip(&truth.depth_m).enumerate() {
            let (column, row) = (index as u32 % 640, index as u32 / 640);
            if warped.colour.get_pixel(column, row).0 == UNSEEN {
                continue;
            }
            seen += 1;
            wrong += usize::from((a - b).abs() > 0.01);
        }
        assert!(seen > 200_000, "{seen} pixels were seen");
        assert!(wrong < seen / 100, "{wrong} of {seen} are more than 1 cm off");
    }
}
