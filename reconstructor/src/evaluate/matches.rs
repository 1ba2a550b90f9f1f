//! A reconstructed stream against the true one (DESIGN §6, Match): who was found, how far from the true place, how far
//! from the true surface.
//!
//! Frames are matched by their index in the clip. In a frame, people are matched one to one by position on the pitch, as
//! many as possible within [`MATCH_RADIUS_M`] and then with the least total distance.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use protocol::chunk::{Body, ChunkFrame};
use serde::{Deserialize, Serialize};

use crate::surface::{Surface, body_triangles, spread};
use crate::{
    assignment::{Pair, most_gain},
    report::{median, quantile},
};

/// People farther apart than this on the pitch are not the same person, metres.
pub const MATCH_RADIUS_M: f64 = 1.5;

/// Points spread over each of the two surfaces of a matched person.
const POINTS: usize = 400;

/// The figures of a match.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MatchFigures {
    /// Frames of the true stream.
    pub frames: usize,
    /// Frames of the true stream that the reconstruction has too.
    pub frames_reconstructed: usize,
    /// People in view over all frames of the true stream.
    pub person_frames_true: usize,
    /// People of the reconstruction over those frames.
    pub person_frames_reconstructed: usize,
    /// Share of the true person-frames that have a mesh.
    pub coverage: f64,
    /// Share of the reconstruction's person-frames that match nobody.
    pub false_share: f64,
    /// Distance on the pitch between the two anchors of a matched person: median, metres.
    pub position_error_median_m: Option<f64>,
    /// The same, mean.
    pub position_error_mean_m: Option<f64>,
    /// The same, not exceeded by 90 %.
    pub position_error_p90_m: Option<f64>,
    /// From our mesh to the true surface, mean over points spread evenly over our mesh; median over person-frames, metres.
    pub surface_distance_median_m: Option<f64>,
    /// The same with our mesh moved onto the true place: what is left is shape, not place.
    pub surface_distance_placed_median_m: Option<f64>,
    /// From the true surface, all round, to our mesh, mean over points spread evenly over the true surface; median over
    /// person-frames, metres. The side that no camera saw counts.
    pub surface_gap_median_m: Option<f64>,
}

/// Compares streams given by their frames; both in order of time.
#[must_use]
pub fn compare(truth: &[ChunkFrame], ours: &[ChunkFrame]) -> MatchFigures {
    let ours_by_frame: BTreeMap<u32, &ChunkFrame> = ours.iter().map(|f| (f.clip_frame, f)).collect();
    let mut tally = Tally::default();
    for true_frame in truth {
        tally.frames += 1;
        tally.true_people += true_frame.bodies.len();
        let Some(our_frame) = ours_by_frame.get(&true_frame.clip_frame) else { continue };
        tally.frames_reconstructed += 1;
        tally.our_people += our_frame.bodies.len();
        for (true_index, our_index) in pairs(&true_frame.bodies, &our_frame.bodies) {
            tally.matched(&true_frame.bodies[true_index], &our_frame.bodies[our_index]);
        }
    }
    tally.figures()
}

#[derive(Default)]
struct Tally {
    frames: usize,
    frames_reconstructed: usize,
    true_people: usize,
    our_people: usize,
    positions_m: Vec<f64>,
    distances_m: Vec<f64>,
    placed_m: Vec<f64>,
    gaps_m: Vec<f64>,
}

impl Tally {
    fn matched(&mut self, true_body: &Body, our_body: &Body) {
        self.positions_m.push(on_pitch(true_body).distance(on_pitch(our_body)));
        let (true_triangles, our_triangles) = (body_triangles(true_body), body_triangles(our_body));
        let surfaces = (Surface::new(&true_triangles), Surface::new(&our_triangles));
        let (Some(true_surface), Some(our_surface)) = surfaces else { return };
        let our_points = spread(&our_triangles, POINTS);
        let shift = (true_body.anchor_m - our_body.anchor_m).as_dvec3();
        let placed: Vec<DVec3> = our_points.iter().map(|p| *p + shift).collect();
        self.distances_m.extend(mean_distance(&our_points, &true_surface));
        self.placed_m.extend(mean_distance(&placed, &true_surface));
        self.gaps_m.extend(mean_distance(&spread(&true_triangles, POINTS), &our_surface));
    }

    fn figures(&self) -> MatchFigures {
        let matched = self.positions_m.len();
        let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
        MatchFigures {
            frames: self.frames,
            frames_reconstructed: self.frames_reconstructed,
            person_frames_true: self.true_people,
            person_frames_reconstructed: self.our_people,
            coverage: share(matched, self.true_people),
            false_share: share(self.our_people - matched, self.our_people),
            position_error_median_m: median(&self.positions_m),
            position_error_mean_m: (matched > 0)
                .then(|| self.positions_m.iter().sum::<f64>() / matched as f64),
            position_error_p90_m: quantile(&self.positions_m, 0.9),
            surface_distance_median_m: median(&self.distances_m),
            surface_distance_placed_median_m: median(&self.placed_m),
            surface_gap_median_m: median(&self.gaps_m),
        }
    }
}

fn on_pitch(body: &Body) -> DVec2 {
    DVec2::new(f64::from(body.anchor_m.x), f64::from(body.anchor_m.z))
}

fn mean_distance(points: &[DVec3], surface: &Surface) -> Option<f64> {
    (!points.is_empty())
        .then(|| points.iter().map(|p| surface.distance(*p)).sum::<f64>() / points.len() as f64)
}

/// Index pairs (true, ours) of the same people.
pub(super) fn pairs(truth: &[Body], ours: &[Body]) -> Vec<(usize, usize)> {
    // One more pair weighs more than any saving of distance, so the number of pairs comes first.
    const PAIR: f64 = 1_000.0;
    let mut near = Vec::new();
    for (row, truth) in truth.iter().enumerate() {
        for (column, ours) in ours.iter().enumerate() {
            let distance_m = on_pitch(truth).distance(on_pitch(ours));
            if distance_m <= MATCH_RADIUS_M {
                near.push(Pair { row, column, gain: PAIR - distance_m });
            }
        }
    }
    let ours_of = most_gain(truth.len(), ours.len(), &near).into_iter().enumerate();
    ours_of.filter_map(|(row, column)| Some((row, column?))).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use glam::Vec3;
    use protocol::{chunk::FrameQuality, manifest::PersonId, mesh::Mesh, time::Ticks};

    use super::*;

    /// An upright box of 0.4 × 1.8 × 0.3 m that stands on `(x, z)`, closed all round.
    pub(in super::super) fn box_at(person: u32, x: f32, z: f32) -> Body {
        let corner = |i: u32| {
            let pick = |bit: u32, low: f32, high: f32| if i >> bit & 1 == 0 { low } else { high };
            [pick(0, -0.2, 0.2), pick(1, 0.0, 1.8), pick(2, -0.15, 0.15)]
        };
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3]];
        let mesh = Mesh {
            positions_m: (0..8).map(corner).collect(),
            uvs: vec![[0.0; 2]; 8],
            triangles: quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect(),
        };
        Body { person: PersonId(person), anchor_m: Vec3::new(x, 0.0, z), mesh, guessed_from_u: None }
    }

    pub(in super::super) fn frame(clip_frame: u32, bodies: Vec<Body>) -> ChunkFrame {
        ChunkFrame {
            clip_frame,
            start: Ticks(i64::from(clip_frame)),
            duration: Ticks(1),
            camera: None,
            quality: FrameQuality::default(),
            ball: None,
            atlas: None,
            bodies,
        }
    }

    #[test]
    fn a_stream_matches_itself() {
        let stream = vec![frame(0, vec![box_at(0, 1.0, 2.0), box_at(1, 9.0, 2.0)])];
        let figures = compare(&stream, &stream);
        assert_eq!((figures.coverage, figures.false_share), (1.0, 0.0));
        assert_eq!(figures.position_error_median_m, Some(0.0));
        assert!(figures.surface_distance_median_m.unwrap() < 1e-6);
        assert!(figures.surface_gap_median_m.unwrap() < 1e-6);
    }

    #[test]
    fn a_shifted_copy_has_the_error_of_the_shift() {
        let truth = vec![frame(0, vec![box_at(0, 0.0, 0.0)]), frame(1, vec![box_at(0, 1.0, 0.0)])];
        let ours = vec![frame(0, vec![box_at(7, 0.1, 0.0)]), frame(1, vec![box_at(7, 1.1, 0.0)])];
        let figures = compare(&truth, &ours);
        assert!((figures.position_error_median_m.unwrap() - 0.1).abs() < 1e-6);
        assert!(figures.surface_distance_placed_median_m.unwrap() < 1e-6);
        // The two faces across the shift are 0.1 m off; the four along it slide in themselves, but for the 0.1 m that
        // sticks out or stays inside near an edge.
        let distance = figures.surface_distance_median_m.unwrap();
        assert!((0.02..0.1).contains(&distance), "{distance}");
    }

    #[test]
    fn the_unseen_back_counts_for_the_gap_only() {
        let truth = vec![frame(0, vec![box_at(0, 0.0, 0.0)])];
        let mut front = box_at(0, 0.0, 0.0);
        front.mesh.triangles.truncate(2);
        let figures = compare(&truth, &[frame(0, vec![front])]);
        assert!(figures.surface_distance_median_m.unwrap() < 1e-6);
        let gap = figures.surface_gap_median_m.unwrap();
        assert!((0.1..0.3).contains(&gap), "{gap}");
    }

    #[test]
    fn people_are_matched_one_to_one_within_the_radius() {
        let truth = vec![frame(0, vec![box_at(0, 0.0, 0.0), box_at(1, 1.0, 0.0), box_at(2, 30.0, 0.0)])];
        // The first of ours is nearest to the second true person, but only so can both be matched.
        let ours = vec![frame(0, vec![box_at(5, 0.9, 0.0), box_at(6, 2.4, 0.0), box_at(7, 31.6, 0.0)])];
        let figures = compare(&truth, &ours);
        assert!((figures.coverage - 2.0 / 3.0).abs() < 1e-9);
        assert!((figures.false_share - 1.0 / 3.0).abs() < 1e-9);
        assert!((figures.position_error_mean_m.unwrap() - (0.9 + 1.4) / 2.0).abs() < 1e-6);
    }

    #[test]
    fn missing_frames_and_broken_meshes_cost_coverage_not_a_panic() {
        let truth = vec![frame(0, vec![box_at(0, 0.0, 0.0)]), frame(1, vec![box_at(0, 0.0, 0.0)])];
        let mut broken = box_at(0, 0.0, 0.0);
        broken.mesh.triangles = vec![[0, 1, 99]];
        let figures = compare(&truth, &[frame(1, vec![broken])]);
        assert_eq!((figures.frames, figures.frames_reconstructed), (2, 1));
        assert_eq!(figures.coverage, 0.5);
        assert_eq!(figures.surface_distance_median_m, None);
        assert_eq!(compare(&[], &[]).coverage, 0.0);
    }
}
