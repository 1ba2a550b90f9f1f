//! Points without order: thinned to an even density, and the direction of the surface at each from its neighbours.

use std::collections::HashMap;

use glam::{DVec3, IVec3};

use super::moments::Moments;

/// Neighbours that a normal is fitted to.
const NEIGHBOURS: usize = 16;

/// One point for each cube of side `cube_m`: the mean of those in it, in the order in which cubes are first met.
pub(super) fn thinned(points: impl Iterator<Item = DVec3>, cube_m: f64) -> Vec<DVec3> {
    let mut places: HashMap<IVec3, usize> = HashMap::new();
    let mut sums: Vec<(DVec3, f64)> = Vec::new();
    for point in points {
        let place = *places.entry(cube(point, cube_m)).or_insert(sums.len());
        match sums.get_mut(place) {
            Some((sum, count)) => {
                *sum += point;
                *count += 1.0;
            }
            None => sums.push((point, 1.0)),
        }
    }
    sums.into_iter().map(|(sum, count)| sum / count).collect()
}

fn cube(point: DVec3, side_m: f64) -> IVec3 {
    // Far beyond any room all points share a cube; its neighbours must still be numbers.
    (point / side_m).floor().clamp(DVec3::splat(-1e9), DVec3::splat(1e9)).as_ivec3()
}

/// Points in cubes as wide as the search reaches, so that neighbours are in 27 of them.
pub(super) struct Neighbourhood<'a> {
    points: &'a [DVec3],
    cubes: HashMap<IVec3, Vec<usize>>,
    reach_m: f64,
}

impl<'a> Neighbourhood<'a> {
    pub(super) fn new(points: &'a [DVec3], reach_m: f64) -> Self {
        let mut cubes: HashMap<IVec3, Vec<usize>> = HashMap::new();
        for (index, point) in points.iter().enumerate() {
            cubes.entry(cube(*point, reach_m)).or_default().push(index);
        }
        Self { points, cubes, reach_m }
    }

    /// The normal at a point, towards `viewpoint`, from its nearest neighbours; `None` where there are too few or they
    /// lie on a line.
    pub(super) fn normal(&self, at: DVec3, viewpoint: DVec3) -> Option<DVec3> {
        let centre = cube(at, self.reach_m);
        let mut near: Vec<(f64, usize)> = Vec::new();
        for step in 0..27 {
            let place = centre + IVec3::new(step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1);
            for index in self.cubes.get(&place).into_iter().flatten() {
                let Some(point) = self.points.get(*index) else { continue };
                let distance = point.distance_squared(at);
                if distance < self.reach_m * self.reach_m {
                    near.push((distance, *index));
                }
            }
        }
        if near.len() < 6 {
            return None;
        }
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut moments = Moments::default();
        for point in near.iter().take(NEIGHBOURS).filter_map(|(_, index)| self.points.get(*index)) {
            moments.add(*point, 1.0);
        }
        moments.fit(viewpoint).map(|fit| fit.plane.normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_of_a_floor_point_to_the_sensor() {
        let floor = (0..400).map(|i| DVec3::new(f64::from(i % 20) * 0.02, 0.0, f64::from(i / 20) * 0.02));
        let points: Vec<DVec3> = floor.collect();
        let near = Neighbourhood::new(&points, 0.06);
        let normal = near.normal(points[210], DVec3::Y).unwrap();
        assert!(normal.distance(DVec3::Y) < 1e-9);
        assert!(near.normal(DVec3::ONE * 5.0, DVec3::Y).is_none());
        let thin = thinned(points.iter().copied(), 0.1);
        assert!(thin.len() <= 25 && thin.len() >= 16, "{}", thin.len());
    }
}
