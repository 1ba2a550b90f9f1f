//! Distances between surfaces: points spread evenly over triangles, and the nearest triangle by a tree of boxes.

use glam::DVec3;
use protocol::chunk::Body;

/// A triangle, world metres.
pub(super) type Triangle = [DVec3; 3];

/// The body's triangles in the world.
pub(super) fn body_triangles(body: &Body) -> Vec<Triangle> {
    let point = |index: u32| {
        let position = body.mesh.positions_m.get(index as usize)?;
        Some((glam::Vec3::from(*position) + body.anchor_m).as_dvec3())
    };
    let all = body.mesh.triangles.iter();
    all.filter_map(|[a, b, c]| Some([point(*a)?, point(*b)?, point(*c)?])).collect()
}

/// `count` points spread evenly by area over the triangles, the same ones every time.
pub(super) fn spread(triangles: &[Triangle], count: usize) -> Vec<DVec3> {
    let mut total = 0.0;
    let sums: Vec<f64> = triangles
        .iter()
        .map(|[a, b, c]| {
            total += (*b - *a).cross(*c - *a).length() / 2.0;
            total
        })
        .collect();
    if !(total.is_finite() && total > 0.0) {
        return Vec::new();
    }
    // Equal steps along the summed area choose the triangle; the golden-ratio sequence chooses the place in it.
    const STEP: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2];
    (0..count)
        .filter_map(|i| {
            let at = (i as f64 + 0.5) / count as f64 * total;
            let [a, b, c] = *triangles.get(sums.partition_point(|&sum| sum < at))?;
            let (mut u, mut v) = ((i as f64 * STEP[0]).fract(), (i as f64 * STEP[1]).fract());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            Some(a + (b - a) * u + (c - a) * v)
        })
        .collect()
}

/// The point of a triangle nearest to `p` (Ericson, Real-Time Collision Detection, 5.1.5).
pub(super) fn nearest_on_triangle(p: DVec3, [a, b, c]: Triangle) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let scale = 1.0 / (va + vb + vc);
    a + ab * (vb * scale) + ac * (vc * scale)
}

/// A surface that answers how far a point is from it.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    triangles: Vec<Triangle>,
    nodes: Vec<Node>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// Triangles of a leaf, or none.
    leaf: Option<(u32, u32)>,
    /// Second child; the first follows its parent.
    second: u32,
}

/// Triangles per leaf.
const LEAF: usize = 4;

impl Surface {
    /// Builds the tree. Triangles that are not finite are left out; `None` when nothing is left.
    pub(super) fn new(triangles: &[Triangle]) -> Option<Self> {
        let finite = triangles.iter().filter(|t| t.iter().all(|p| p.is_finite()));
        let mut surface = Self { triangles: finite.copied().collect(), nodes: Vec::new() };
        if surface.triangles.is_empty() {
            return None;
        }
        surface.build(0, surface.triangles.len());
        Some(surface)
    }

    fn build(&mut self, start: usize, end: usize) -> u32 {
        let part = &mut self.triangles[start..end];
        let low = part.iter().flatten().fold(DVec3::INFINITY, |low, p| low.min(*p));
        let high = part.iter().flatten().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
        let index = self.nodes.len();
        let leaf = (end - start <= LEAF).then_some((start as u32, end as u32));
        if leaf.is_none() {
            let axis = (high - low).to_array();
            let axis = (0..3).max_by(|a, b| axis[*a].total_cmp(&axis[*b])).unwrap_or(0);
            let middle = |t: &Triangle| t[0][axis] + t[1][axis] + t[2][axis];
            part.select_nth_unstable_by((end - start) / 2, |a, b| middle(a).total_cmp(&middle(b)));
        }
        self.nodes.push(Node { low, high, leaf, second: 0 });
        if leaf.is_none() {
            let half = start + (end - start) / 2;
            self.build(start, half);
            let second = self.build(half, end);
            self.nodes[index].second = second;
        }
        index as u32
    }

    /// Distance of a point from the surface, metres.
    pub(super) fn distance(&self, p: DVec3) -> f64 {
        self.nearest(p).map_or(f64::INFINITY, |(near, _)| p.distance(near))
    }

    /// The point of the surface nearest to `p`, and the normal of its triangle; `None` for one that is not finite.
    pub(super) fn nearest(&self, p: DVec3) -> Option<(DVec3, DVec3)> {
        let (mut best, mut found) = (f64::INFINITY, None);
        let mut waiting = vec![(0.0, 0_u32)];
        while let Some((bound, index)) = waiting.pop() {
            if bound >= best {
                continue;
            }
            let node = &self.nodes[index as usize];
            if let Some((start, end)) = node.leaf {
                for triangle in &self.triangles[start as usize..end as usize] {
                    let near = nearest_on_triangle(p, *triangle);
                    let distance = p.distance_squared(near);
                    if distance < best {
                        (best, found) = (distance, Some((near, *triangle)));
                    }
                }
                continue;
            }
            let children = [index + 1, node.second].map(|child| {
                let Node { low, high, .. } = self.nodes[child as usize];
                (p.distance_squared(p.clamp(low, high)), child)
            });
            let [near, far] = if children[0].0 <= children[1].0 { [0, 1] } else { [1, 0] };
            waiting.extend([children[far], children[near]].into_iter().filter(|(bound, _)| *bound < best));
        }
        let (near, [a, b, c]) = found?;
        Some((near, (b - a).cross(c - a).normalize_or_zero()))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn point() -> impl Strategy<Value = DVec3> {
        [-3.0..3.0_f64, -3.0..3.0_f64, -3.0..3.0_f64].prop_map(DVec3::from)
    }

    proptest! {
        #[test]
        fn the_tree_finds_what_a_full_search_finds(
            triangles in prop::collection::vec([point(), point(), point()], 1..60),
            p in point(),
        ) {
            let full = triangles
                .iter()
                .map(|t| p.distance(nearest_on_triangle(p, *t)))
                .fold(f64::INFINITY, f64::min);
            let tree = Surface::new(&triangles).unwrap().distance(p);
            prop_assert!((tree - full).abs() < 1e-9);
        }

        #[test]
        fn no_sampled_point_of_a_triangle_is_nearer(triangle in [point(), point(), point()], p in point()) {
            let nearest = p.distance(nearest_on_triangle(p, triangle));
            for sample in spread(&[triangle], 200) {
                prop_assert!(nearest <= p.distance(sample) + 1e-9);
            }
        }
    }

    #[test]
    fn points_are_spread_by_area() {
        let small = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let large = [DVec3::Z, DVec3::Z + DVec3::X * 3.0, DVec3::Z + DVec3::Y * 3.0];
        let points = spread(&[small, large], 1_000);
        assert_eq!(points.len(), 1_000);
        assert_eq!(points.iter().filter(|p| p.z < 0.5).count(), 100);
        let middle = points.iter().filter(|p| p.z > 0.5).sum::<DVec3>() / 900.0;
        assert!((middle - DVec3::new(1.0, 1.0, 1.0)).length() < 0.02, "{middle}");
        assert!(spread(&[[DVec3::ZERO; 3]], 10).is_empty());
    }
}
