//! Outlines cut into triangles, for drawing: ear clipping (Meisters 1975) after thinning what no picture shows.
//!
//! A runtime may report any outline. Crossing sides give some triangles, never a failure or an endless loop.

use glam::{DVec2, DVec3};

/// Corners kept of an outline. Ear clipping takes the cube of their number at worst.
const MOST_CORNERS: usize = 64;

/// The outline with at most 64 corners: those go first that change its area least (Visvalingam and Whyatt 1993).
pub(super) fn thinned(outline_m: &[DVec3]) -> Vec<DVec3> {
    let mut corners = outline_m.to_vec();
    while corners.len() > MOST_CORNERS {
        let count = corners.len();
        let area = |index: usize| {
            let (before, after) = (corners[(index + count - 1) % count], corners[(index + 1) % count]);
            (corners[index] - before).cross(after - before).length_squared()
        };
        let least = (0..count).map(|index| (index, area(index))).min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((index, _)) = least else { break };
        corners.remove(index);
    }
    corners
}

/// Triangles of a simple polygon, as indices of its corners; counter-clockwise whatever the sense of the polygon.
pub(super) fn triangles(polygon: &[DVec2]) -> Vec<[u32; 3]> {
    let twice_area: f64 =
        polygon.iter().zip(polygon.iter().cycle().skip(1)).map(|(a, b)| a.perp_dot(*b)).sum();
    let mut left: Vec<usize> = (0..polygon.len()).collect();
    if twice_area < 0.0 {
        left.reverse();
    }
    let mut found = Vec::with_capacity(polygon.len().saturating_sub(2));
    while left.len() > 2 {
        let count = left.len();
        let corners = |at: usize| [left[(at + count - 1) % count], left[at], left[(at + 1) % count]];
        let is_ear = |at: &usize| {
            let [a, b, c] = corners(*at);
            turn(polygon[a], polygon[b], polygon[c]) > 0.0
                && left.iter().filter(|index| ![a, b, c].contains(index)).all(|index| {
                    let point = polygon[*index];
                    [(a, b), (b, c), (c, a)]
                        .iter()
                        .any(|(from, to)| turn(polygon[*from], polygon[*to], point) < 0.0)
                })
        };
        // Without an ear (sides that cross or lie on each other) any corner goes, so that it ends.
        let at = (0..count).find(is_ear).unwrap_or(0);
        let ear = corners(at);
        if turn(polygon[ear[0]], polygon[ear[1]], polygon[ear[2]]) > 0.0 {
            found.push(ear.map(|index| index as u32));
        }
        left.remove(at);
    }
    found
}

/// Twice the area of a triangle; positive when its corners run counter-clockwise.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(polygon: &[DVec2], triangles: &[[u32; 3]]) -> f64 {
        triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|index| polygon[index as usize]);
                assert!(turn(a, b, c) > 0.0, "{corners:?}");
                turn(a, b, c) / 2.0
            })
            .sum()
    }

    #[test]
    fn an_l_is_covered_once_in_either_sense() {
        let mut l: Vec<DVec2> = [(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]
            .map(DVec2::from)
            .to_vec();
        for _ in 0..2 {
            let found = triangles(&l);
            assert_eq!(found.len(), 4);
            assert!((area(&l, &found) - 6.0).abs() < 1e-12);
            l.reverse();
        }
    }

    #[test]
    fn nonsense_ends() {
        let bow_tie = [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)].map(DVec2::from);
        assert!(triangles(&bow_tie).len() <= 2);
        assert!(triangles(&[DVec2::ONE; 9]).is_empty());
        assert!(triangles(&[DVec2::NAN; 5]).is_empty());
        assert!(triangles(&[]).is_empty());
    }

    #[test]
    fn a_fine_circle_keeps_its_area() {
        let circle: Vec<DVec3> = (0..1000)
            .map(|step| {
                let (sine, cosine) = (f64::from(step) * std::f64::consts::TAU / 1000.0).sin_cos();
                DVec3::new(cosine, 0.0, sine)
            })
            .collect();
        let thin = thinned(&circle);
        assert_eq!(thin.len(), MOST_CORNERS);
        let flat: Vec<DVec2> = thin.iter().map(|corner| DVec2::new(corner.x, corner.z)).collect();
        assert!((area(&flat, &triangles(&flat)) - std::f64::consts::PI).abs() < 0.02);
    }
}
