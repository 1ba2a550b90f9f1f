//! Distances between surfaces: points spread evenly over triangles, and the nearest triangle by a tree of boxes.

use glam::DVec3;
use protocol::chunk::Body;

/// A triangle, world metres.
pub(crate) type Triangle = [DVec3; 3];

/// The body's triangles in the world.
pub(crate) fn body_triangles(body: &Body) -> Vec<Triangle> {
    let point = |index: u32| {
        let position = body.mesh.positions_m.get(index as usize)?;
        Some((glam::Vec3::from(*position) + body.anchor_m).as_dvec3())
    };
    let all = body.mesh.triangles.iter();
    all.filter_map(|[a, b, c]| Some([point(*a)?, point(*b)?, point(*c)?])).collect()
}

/// `count` points spread evenly by area over the triangles, the same ones every time.
pub(crate) fn spread(triangles: &[Triangle], count: usize) -> Vec<DVec3> {
    let places = spread_places(triangles, count).into_iter();
    places.filter_map(|place| Some(place.of(triangles.get(place.triangle)?))).collect()
}

/// A place on a mesh: the triangle and the weights of its corners, whose sum is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MeshPlace {
    /// Which triangle.
    pub(crate) triangle: usize,
    /// How much each corner counts.
    pub(crate) weights: [f64; 3],
}

impl MeshPlace {
    /// The place in the triangle `[a, b, c]`.
    fn of(&self, [a, b, c]: &Triangle) -> DVec3 {
        let [u, v, w] = self.weights;
        *a * u + *b * v + *c * w
    }
}

/// `count` places spread evenly by area over the triangles, the same ones every time.
pub(crate) fn spread_places(triangles: &[Triangle], count: usize) -> Vec<MeshPlace> {
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
        .map(|i| {
            let at = (i as f64 + 0.5) / count as f64 * total;
            let triangle = sums.partition_point(|&sum| sum < at).min(triangles.len() - 1);
            let (mut u, mut v) = ((i as f64 * STEP[0]).fract(), (i as f64 * STEP[1]).fract());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            MeshPlace { triangle, weights: [1.0 - u - v, u, v] }
        })
        .collect()
}

/// The point of a triangle nearest to `p` (Ericson, Real-Time Collision Detection, 5.1.5).
pub(crate) fn nearest_on_triangle(p: DVec3, [a, b, c]: Triangle) -> DVec3 {
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

/// Weights of the corners at a point of a triangle.
pub(crate) fn barycentric(point: DVec3, [a, b, c]: Triangle) -> [f64; 3] {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (d00, d01, d11) = (ab.dot(ab), ab.dot(ac), ac.dot(ac));
    let (d20, d21) = (ap.dot(ab), ap.dot(ac));
    let scale = d00 * d11 - d01 * d01;
    if scale.abs() < 1e-18 {
        return [1.0, 0.0, 0.0];
    }
    let v = (d11 * d20 - d01 * d21) / scale;
    let w = (d00 * d21 - d01 * d20) / scale;
    [1.0 - v - w, v, w]
}

/// A surface that answers how far a point is from it.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    triangles: Vec<Triangle>,
    /// Their unit normals; zero of one without area.
    normals: Vec<DVec3>,
    /// Their places in the list that the surface was made from.
    given: Vec<u32>,
    nodes: Vec<Node>,
}

/// The place of a surface nearest to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Nearest {
    /// Where.
    pub(crate) point: DVec3,
    /// The unit normal of its triangle; zero of one without area.
    pub(crate) normal: DVec3,
    /// Its triangle's place in the list that the surface was made from.
    pub(crate) triangle: usize,
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
    pub(crate) fn new(triangles: &[Triangle]) -> Option<Self> {
        let finite = triangles.iter().enumerate().filter(|(_, t)| t.iter().all(|p| p.is_finite()));
        let mut parts: Vec<(u32, Triangle)> = finite.map(|(given, t)| (given as u32, *t)).collect();
        if parts.is_empty() {
            return None;
        }
        let mut nodes = Vec::with_capacity(parts.len());
        build(&mut parts, 0, &mut nodes);
        let normals =
            parts.iter().map(|(_, [a, b, c])| (*b - *a).cross(*c - *a).normalize_or_zero()).collect();
        let (given, triangles) = parts.into_iter().unzip();
        Some(Self { triangles, normals, given, nodes })
    }
    /// Distance of a point from the surface, metres.
    pub(crate) fn distance(&self, p: DVec3) -> f64 {
        self.nearest(p).map_or(f64::INFINITY, |near| p.distance(near.point))
    }

    /// The place of the surface nearest to `p`; `None` for a point that is not finite.
    pub(crate) fn nearest(&self, p: DVec3) -> Option<Nearest> {
        self.search(p, f64::INFINITY, |_| true)
    }

    /// The nearest place within `reach_m` whose normal has a product of more than `cosine` with `normal`.
    pub(crate) fn nearest_facing(
        &self,
        p: DVec3,
        normal: DVec3,
        cosine: f64,
        reach_m: f64,
    ) -> Option<Nearest> {
        self.search(p, reach_m, |other| other.dot(normal) > cosine)
    }

    fn search(&self, p: DVec3, reach_m: f64, counts: impl Fn(DVec3) -> bool) -> Option<Nearest> {
        let (mut best, mut found) = (reach_m * reach_m, None);
        // Deeper than any tree of as many triangles as a body may have.
        let mut waiting = [(0.0, 0_u32); 64];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (bound, index) = waiting[count];
            if bound >= best {
                continue;
            }
            let node = &self.nodes[index as usize];
            if let Some((start, end)) = node.leaf {
                for index in start as usize..end as usize {
                    if !counts(self.normals[index]) {
                        continue;
                    }
                    let near = nearest_on_triangle(p, self.triangles[index]);
                    let distance = p.distance_squared(near);
                    if distance < best {
                        (best, found) = (distance, Some((near, index)));
                    }
                }
                continue;
            }
            let children = [index + 1, node.second].map(|child| {
                let Node { low, high, .. } = self.nodes[child as usize];
                (p.distance_squared(p.clamp(low, high)), child)
            });
            let [near, far] = if children[0].0 <= children[1].0 { [0, 1] } else { [1, 0] };
            for child in [children[far], children[near]] {
                if child.0 < best && count < waiting.len() {
                    waiting[count] = child;
                    count += 1;
                }
            }
        }
        let (point, index) = found?;
        Some(Nearest { point, normal: self.normals[index], triangle: self.given[index] as usize })
    }
}

/// Builds the tree over `parts`, which begin at `start`; halves have equal counts, so that its depth is a logarithm.
fn build(parts: &mut [(u32, Triangle)], start: usize, nodes: &mut Vec<Node>) -> u32 {
    let corners = || parts.iter().flat_map(|(_, triangle)| triangle);
    let low = corners().fold(DVec3::INFINITY, |low, p| low.min(*p));
    let high = corners().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
    let index = nodes.len();
    let leaf = (parts.len() <= LEAF).then_some((start as u32, (start + parts.len()) as u32));
    nodes.push(Node { low, high, leaf, second: 0 });
    if leaf.is_none() {
        let axis = (high - low).to_array();
        let axis = (0..3).max_by(|a, b| axis[*a].total_cmp(&axis[*b])).unwrap_or(0);
        let middle = |(_, t): &(u32, Triangle)| t[0][axis] + t[1][axis] + t[2][axis];
        let half = parts.len() / 2;
        parts.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)));
        let (first, second) = parts.split_at_mut(half);
        build(first, start, nodes);
        nodes[index].second = build(second, start + half, nodes);
    }
    index as u32
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
