//! The squared-distance map of section 4.1: for every pixel the nearest line pixel, exactly (Felzenszwalb and Huttenlocher).
//!
//! The nearest pixel's number is stored instead of its distance, so that the distance can be taken to the line's middle,
//! which is known better than to a whole pixel.

use glam::DVec2;

/// No line pixel within reach.
const NONE: u32 = u32::MAX;

/// For every pixel of a picture, the nearest of some marked points.
#[derive(Clone, Debug)]
pub(super) struct NearestMap {
    width: usize,
    height: usize,
    nearest: Vec<u32>,
}

impl NearestMap {
    /// Nearest of `points` (number and pixel they are in) for every pixel, up to about `reach_px` away.
    pub(super) fn new(
        width: usize,
        height: usize,
        points: impl Iterator<Item = (u32, usize, usize)>,
        reach_px: usize,
    ) -> Self {
        let mut nearest = vec![NONE; width * height];
        // Row of the point that `nearest` names, so that the passes need no look-up.
        let mut row_of = vec![i32::MIN; width * height];
        for (number, x, y) in points {
            if x < width && y < height {
                nearest[y * width + x] = number;
                row_of[y * width + x] = y as i32;
            }
        }
        let reach = reach_px as i32;
        // Down, then up: nearest of the own column.
        for y in 1..height {
            for x in 0..width {
                let (here, above) = (y * width + x, (y - 1) * width + x);
                if nearest[here] == NONE && nearest[above] != NONE && y as i32 - row_of[above] <= reach {
                    (nearest[here], row_of[here]) = (nearest[above], row_of[above]);
                }
            }
        }
        for y in (0..height.saturating_sub(1)).rev() {
            for x in 0..width {
                let (here, below) = (y * width + x, (y + 1) * width + x);
                if nearest[below] == NONE || (row_of[below] - y as i32).abs() > reach {
                    continue;
                }
                let closer = (row_of[below] - y as i32).abs()
                    < (row_of[here].saturating_sub(y as i32)).saturating_abs();
                if nearest[here] == NONE || closer {
                    (nearest[here], row_of[here]) = (nearest[below], row_of[below]);
                }
            }
        }
        // Along each row: lower envelope of the parabolas that the columns' distances stand on.
        let mut hull: Vec<(usize, f32, f32)> = Vec::with_capacity(width); // column, height, start of its reign
        let mut row = vec![NONE; width];
        for y in 0..height {
            hull.clear();
            let line = &mut nearest[y * width..(y + 1) * width];
            for (x, &number) in line.iter().enumerate() {
                if number == NONE {
                    continue;
                }
                let d = (row_of[y * width + x] - y as i32) as f32;
                let value = d * d + (x * x) as f32;
                let mut start = f32::NEG_INFINITY;
                while let Some(&(column, height, reign)) = hull.last() {
                    start = (value - height) / (2.0 * (x - column) as f32);
                    if start > reign {
                        break;
                    }
                    hull.pop();
                    start = f32::NEG_INFINITY;
                }
                hull.push((x, value, start));
            }
            let mut k = 0;
            for (x, out) in row.iter_mut().enumerate() {
                while k + 1 < hull.len() && hull[k + 1].2 < x as f32 {
                    k += 1;
                }
                *out = match hull.get(k) {
                    Some(&(column, ..)) if column.abs_diff(x) <= reach_px => line[column],
                    _ => NONE,
                };
            }
            line.copy_from_slice(&row);
        }
        Self { width, height, nearest }
    }

    /// Number of the point nearest to the pixel that `position` is in.
    pub(super) fn at(&self, position: DVec2) -> Option<usize> {
        let (x, y) = (position.x.round(), position.y.round());
        if !(x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64) {
            return None;
        }
        let number = *self.nearest.get(y as usize * self.width + x as usize)?;
        (number != NONE).then_some(number as usize)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn nearest_is_nearest(points in proptest::collection::vec((0..40_usize, 0..30_usize), 1..12)) {
            let map = NearestMap::new(
                40, 30, points.iter().enumerate().map(|(i, &(x, y))| (i as u32, x, y)), 100,
            );
            for y in 0..30 {
                for x in 0..40 {
                    let distance = |&(px, py): &(usize, usize)| px.abs_diff(x).pow(2) + py.abs_diff(y).pow(2);
                    let least = points.iter().map(distance).min().unwrap();
                    let found = map.at(DVec2::new(x as f64, y as f64)).unwrap();
                    prop_assert_eq!(distance(&points[found]), least);
                }
            }
        }
    }

    #[test]
    fn far_away_there_is_nothing() {
        let map = NearestMap::new(50, 20, [(0, 5, 5)].into_iter(), 10);
        assert_eq!(map.at(DVec2::new(14.0, 5.0)), Some(0));
        assert_eq!(map.at(DVec2::new(30.0, 5.0)), None);
        assert_eq!(map.at(DVec2::new(-3.0, 5.0)), None);
        assert_eq!(map.at(DVec2::new(f64::NAN, 5.0)), None);
    }
}
