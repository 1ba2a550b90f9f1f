//! Our figures against TrackEval's.

use glam::DVec2;

use super::*;

/// Made-up tracks: six people who cross, with noise, drop-outs, swaps, new identities, false boxes and empty frames.
///
/// The figures below are those of PyPI's TrackEval 1.3.0 for the same tracks: this function written in Python
/// (`state = (state * 6364136223846793005 + 1442695040888963407) % 2**64`, `draw(n) = (state >> 33) % n`), identities numbered in
/// ascending order, `similarity_scores[t]` the matrix of intersections over unions, then `HOTA().eval_sequence(data)`,
/// `CLEAR().eval_sequence(data)` and `Identity().eval_sequence(data)`; HOTA, DetA, AssA and LocA are means over their arrays.
fn made_up(seed: u64) -> Vec<FrameBoxes> {
    let mut state = seed;
    let mut draw = |below: u64| -> i64 {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        i64::try_from((state >> 33) % below).unwrap()
    };
    let boxed = |id: i64, left: i64, top: i64, right: i64, bottom: i64| TrackedBox {
        id: u32::try_from(id).unwrap(),
        bounds: PixelBox {
            min: DVec2::new(left as f64, top as f64),
            max: DVec2::new(right as f64, bottom as f64),
        },
    };
    let mut ids: Vec<i64> = (0..6).collect();
    (0..60)
        .map(|frame| {
            if draw(10) == 0 {
                let (a, b) = (draw(6) as usize, draw(6) as usize);
                ids.swap(a, b);
            }
            if draw(25) == 0 {
                ids[draw(6) as usize] = 10 + frame;
            }
            let mut boxes = FrameBoxes::default();
            for person in 0..6 {
                let (x, y) = (100 + (person - 3) * (frame - 30) * 2, 50 + 9 * person);
                if draw(12) > 0 {
                    boxes.truth.push(boxed(person, x, y, x + 20, y + 45));
                }
                if draw(8) > 0 {
                    let (x, y) = (x + draw(13) - 6, y + draw(21) - 10);
                    boxes.ours.push(boxed(ids[person as usize], x, y, x + 20, y + 45));
                }
            }
            if draw(9) == 0 {
                boxes.ours.push(boxed(40 + draw(3), 20, 200, 45, 250));
            }
            match frame {
                20 => boxes.truth.clear(),
                40 => boxes.ours.clear(),
                _ => {}
            }
            boxes
        })
        .collect()
}

#[test]
fn the_figures_are_those_of_trackeval() {
    // hota, deta, assa, loca, idf1, mota, recall, precision, switches
    let expected = [
        (1, [0.346_615, 0.450_443, 0.267_038, 0.720_422, 0.483_18, 0.366_071, 0.678_571, 0.716_981], 15),
        (2, [0.345_659, 0.448_077, 0.267_09, 0.718_853, 0.432_268, 0.268_293, 0.658_537, 0.656_535], 15),
    ];
    for (seed, figures, switches) in expected {
        let (ours, _) = scores(&made_up(seed));
        let got =
            [ours.hota, ours.deta, ours.assa, ours.loca, ours.idf1, ours.mota, ours.recall, ours.precision];
        for (got, expected) in got.iter().zip(figures) {
            assert!((got - expected).abs() < 1e-6, "seed {seed}: {ours:?}");
        }
        assert_eq!(ours.id_switches, switches);
    }
}

#[test]
fn perfect_tracks_score_one_and_nothing_scores_nothing() {
    let perfect: Vec<FrameBoxes> =
        made_up(3).into_iter().map(|frame| FrameBoxes { ours: frame.truth.clone(), ..frame }).collect();
    let (scores_of_perfect, matches) = scores(&perfect);
    for figure in [scores_of_perfect.hota, scores_of_perfect.idf1, scores_of_perfect.mota] {
        assert!((figure - 1.0).abs() < 1e-12, "{scores_of_perfect:?}");
    }
    assert!(matches.keys().all(|(truth, ours)| truth == ours));
    let lost: Vec<FrameBoxes> =
        perfect.into_iter().map(|frame| FrameBoxes { ours: Vec::new(), ..frame }).collect();
    let (lost, matches) = scores(&lost);
    assert_eq!((lost.hota, lost.idf1, lost.recall, matches.len()), (0.0, 0.0, 0.0, 0));
    assert_eq!(scores(&[]).0.identities, [0, 0]);
}

#[test]
fn who_does_not_count_is_neither_right_nor_wrong() {
    let at = |id: u32, x: f64| TrackedBox {
        id,
        bounds: PixelBox { min: DVec2::new(x, 0.0), max: DVec2::new(x + 10.0, 20.0) },
    };
    let frame = FrameBoxes { truth: vec![at(1, 0.0)], ours: vec![at(7, 0.0), at(8, 100.0), at(9, 200.0)] };
    let left = frame.without(&[at(2, 101.0)]);
    assert_eq!(left.ours.iter().map(|b| b.id).collect::<Vec<_>>(), [7, 9]);
}
