//! Simple questions about polygons in the plane: what lies inside, what is nearest, which way they run.
//!
//! A polygon is its corners in order, not closed; "inside" is by the even-odd rule, so that neither the sense of rotation
//! nor a crossing of its own sides matters.

use glam::DVec2;

/// The sides of a polygon, from corner to corner.
pub(crate) fn sides(polygon: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    polygon.iter().copied().zip(polygon.iter().copied().cycle().skip(1))
}

/// Whether a point lies inside, by counting the sides that a ray towards +x crosses.
pub(crate) fn contains(polygon: &[DVec2], point: DVec2) -> bool {
    let mut inside = false;
    for (from, to) in sides(polygon) {
        if (from.y > point.y) != (to.y > point.y) {
            let at = from.x + (point.y - from.y) / (to.y - from.y) * (to.x - from.x);
            inside ^= point.x < at;
        }
    }
    inside
}

/// The point of the sides nearest to `point`; `None` for a polygon without corners.
pub(crate) fn nearest_on_sides(polygon: &[DVec2], point: DVec2) -> Option<DVec2> {
    let on_side = |(from, to): (DVec2, DVec2)| {
        let along = to - from;
        let share = (point - from).dot(along) / along.length_squared();
        from + along * if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
    };
    sides(polygon).map(on_side).min_by(|a, b| a.distance_squared(point).total_cmp(&b.distance_squared(point)))
}

/// The middle of the area; the mean of the corners when there is none.
pub(crate) fn centroid(polygon: &[DVec2]) -> DVec2 {
    let Some(&origin) = polygon.first() else { return DVec2::ZERO };
    let (mut sum, mut twice_area) = (DVec2::ZERO, 0.0);
    for (from, to) in sides(polygon) {
        let (from, to) = (from - origin, to - origin);
        let cross = from.perp_dot(to);
        sum += (from + to) * cross;
        twice_area += cross;
    }
    let middle = origin + sum / (3.0 * twice_area);
    if middle.is_finite() && twice_area.abs() > 1e-12 {
        return middle;
    }
    polygon.iter().sum::<DVec2>() / polygon.len() as f64
}

/// Unit direction of the longer side of the smallest rectangle around a polygon; one of its sides lies on a side of
/// the convex hull (Freeman and Shapira 1975). `None` without an extent.
pub(crate) fn longer_direction(polygon: &[DVec2]) -> Option<DVec2> {
    let hull = convex_hull(polygon);
    let mut best: Option<(f64, DVec2)> = None;
    for (from, to) in sides(&hull) {
        let Some(along) = (to - from).try_normalize() else { continue };
        let extent = |direction: DVec2| {
            let (low, high) = hull.iter().fold((f64::MAX, f64::MIN), |(low, high), corner| {
                let at = corner.dot(direction);
                (low.min(at), high.max(at))
            });
            high - low
        };
        let (length, width) = (extent(along), extent(along.perp()));
        let longer = if length >= width { along } else { along.perp() };
        if best.is_none_or(|(least, _)| length * width < least * (1.0 - 1e-9)) {
            best = Some((length * width, longer));
        }
    }
    best.map(|(_, direction)| direction)
}

/// Corners of the convex hull, by Andrew's monotone chain.
fn convex_hull(points: &[DVec2]) -> Vec<DVec2> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    let chain = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for point in points {
            while let [.., before, last] = chain[..]
                && (last - before).perp_dot(point - last) <= 0.0
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = chain(&mut sorted.iter().copied());
    hull.extend(chain(&mut sorted.iter().rev().copied()));
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    fn l_shape() -> Vec<DVec2> {
        [(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)].map(DVec2::from).to_vec()
    }

    #[test]
    fn an_l_has_its_inside_its_nearest_side_and_its_middle() {
        let polygon = l_shape();
        assert!(contains(&polygon, DVec2::new(0.5, 2.5)) && contains(&polygon, DVec2::new(3.5, 0.5)));
        assert!(!contains(&polygon, DVec2::new(2.0, 2.0)) && !contains(&polygon, DVec2::new(-1.0, 0.5)));
        let nearest = nearest_on_sides(&polygon, DVec2::new(2.0, 2.0)).unwrap();
        assert!((nearest.distance(DVec2::new(2.0, 2.0)) - 1.0).abs() < 1e-12);
        let middle = centroid(&polygon);
        assert!((middle - DVec2::new(9.0, 6.0) / 6.0).length() < 1e-9, "{middle}");
    }

    #[test]
    fn the_longer_direction_follows_a_turned_rectangle() {
        for angle in [0.0, 0.3, 1.2, 2.9] {
            let along = DVec2::from_angle(angle);
            let corner = |x: f64, y: f64| along * x + along.perp() * y;
            let polygon = [corner(-3.0, -1.0), corner(3.0, -1.0), corner(3.0, 1.0), corner(-3.0, 1.0)];
            let found = longer_direction(&polygon).unwrap();
            assert!(found.perp_dot(along).abs() < 1e-9, "{angle}: {found}");
        }
        assert_eq!(longer_direction(&[DVec2::ONE; 4]), None);
        assert_eq!(longer_direction(&[]), None);
    }
}
