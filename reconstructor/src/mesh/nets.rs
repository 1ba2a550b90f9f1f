//! The closed surface round what is inside a volume: naive surface nets (Gibson 1998), one vertex in every cell that the surface
//! passes, in the mean of where it crosses the cell's edges.

use glam::DVec3;

use super::volume::Volume;

/// Triangles over places of a volume's grid.
#[derive(Clone, Debug, Default)]
pub(super) struct Net {
    /// Places on the grid; whole numbers are samples.
    pub(super) places: Vec<DVec3>,
    /// Counter-clockwise seen from outside.
    pub(super) triangles: Vec<[u32; 3]>,
}

const NO_VERTEX: u32 = u32::MAX;

/// The surface where the volume's values change from positive to not. It is closed when no sample on the volume's border is positive.
pub(super) fn around(volume: &Volume) -> Net {
    let [width, height, depth] = volume.size;
    let mut net = Net::default();
    if width < 2 || height < 2 || depth < 2 || volume.values.len() != width * height * depth {
        return net;
    }
    let step = [1, width, width * height];
    let mut vertices = vec![NO_VERTEX; volume.values.len()];
    let coordinates = |index: usize| [index % width, index / width % height, index / step[2]];
    for (index, vertex) in vertices.iter_mut().enumerate() {
        let at = coordinates(index);
        if at[0] + 1 < width
            && at[1] + 1 < height
            && at[2] + 1 < depth
            && let Some(inside) = crossing(&volume.values, index, step)
        {
            *vertex = net.places.len() as u32;
            net.places.push(DVec3::from(at.map(|c| c as f64)) + inside);
        }
    }
    for index in 0..volume.values.len() {
        let at = coordinates(index);
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let last = at[axis] + 1 == volume.size[axis];
            if last || at[u] == 0 || at[v] == 0 {
                continue;
            }
            let (here, next) = (volume.values[index] > 0.0, volume.values[index + step[axis]] > 0.0);
            if here == next {
                continue;
            }
            let mut ring = [index - step[u] - step[v], index - step[v], index, index - step[u]]
                .map(|cell| vertices.get(cell).copied().unwrap_or(NO_VERTEX));
            if ring.contains(&NO_VERTEX) {
                continue;
            }
            if next {
                ring.reverse();
            }
            let far = |a: usize, b: usize| {
                net.places[ring[a] as usize].distance_squared(net.places[ring[b] as usize])
            };
            let [a, b, c, d] = ring;
            // Along the shorter diagonal.
            if far(0, 2) <= far(1, 3) {
                net.triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                net.triangles.extend([[b, c, d], [b, d, a]]);
            }
        }
    }
    net
}

/// The mean place in a cell where the surface crosses its edges; `None` when it does not.
fn crossing(values: &[f32], index: usize, step: [usize; 3]) -> Option<DVec3> {
    let corner = |k: usize| index + (k & 1) * step[0] + (k >> 1 & 1) * step[1] + (k >> 2) * step[2];
    let corners: [f32; 8] = std::array::from_fn(|k| values.get(corner(k)).copied().unwrap_or(-1.0));
    let positive = corners.iter().filter(|value| **value > 0.0).count();
    if positive == 0 || positive == 8 {
        return None;
    }
    let place = |k: usize| DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64);
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for a in 0..8 {
        for axis in [1, 2, 4] {
            let b = a | axis;
            if b != a && (corners[a] > 0.0) != (corners[b] > 0.0) {
                let share = f64::from(corners[a]) / f64::from(corners[a] - corners[b]);
                sum += place(a).lerp(place(b), share.clamp(0.0, 1.0));
                count += 1.0;
            }
        }
    }
    Some(sum / count)
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    fn ball(radius: f64) -> Volume {
        let size = [20, 21, 22];
        let middle = DVec3::new(9.3, 10.1, 10.6);
        let values = (0..size.iter().product::<usize>()).map(|i| {
            let at = [i % 20, i / 20 % 21, i / 420].map(|c| c as f64);
            (radius - middle.distance(DVec3::from(at))) as f32
        });
        Volume::of_samples(size, values.collect())
    }

    #[test]
    fn a_ball_is_closed_round_and_faces_out() {
        let net = around(&ball(7.0));
        let middle = DVec3::new(9.3, 10.1, 10.6);
        let worst = net.places.iter().map(|p| (p.distance(middle) - 7.0).abs()).fold(0.0, f64::max);
        assert!(worst < 0.15, "{worst} cells off");
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for &[a, b, c] in &net.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *edges.entry((from, to)).or_default() += 1;
                *edges.entry((to, from)).or_default() -= 1;
            }
            let [a, b, c] = [a, b, c].map(|v| net.places[v as usize]);
            assert!((b - a).cross(c - a).dot(a - middle) > 0.0);
        }
        assert!(edges.values().all(|&count| count == 0), "every edge has its opposite");
    }

    #[test]
    fn nothing_and_damaged_volumes_have_no_surface() {
        assert!(around(&ball(-1.0)).triangles.is_empty());
        assert!(around(&Volume::of_samples([4, 4, 4], vec![1.0; 3])).triangles.is_empty());
    }
}
