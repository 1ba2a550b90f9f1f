//! Whether two runs of sightings look like one person: kit colours and build, each as a mean over many pictures.

use crate::pose::{Lab, Looks};

/// Standard deviations of a garment's colour in one picture: lightness (shade, creases), a* and b*.
const ONE_PICTURE: [f64; 3] = [10.0, 6.0, 6.0];
/// The same between two runs of pictures, however long: light, distance and pose differ.
const BETWEEN_RUNS: [f64; 3] = [5.0, 2.5, 2.5];
/// Standard deviations of kit colours among people.
const AMONG_PEOPLE: [f64; 3] = [28.0, 25.0, 25.0];
/// Of strangers, this share wears the same kit.
const SAME_KIT: f64 = 0.5;
/// Pictures beyond this number say no more: their errors are alike.
const PICTURES_MAX: f64 = 12.0;
/// However different two runs look, it is no stronger evidence than this (logarithm): a tangle may have spoiled one of them.
const AGAINST_MAX: f64 = 14.0;
/// Standard deviation of a person's mean nose height between runs, and among people, metres. Runs bend, so it is weak.
const NOSE_M: f64 = 0.07;
const NOSE_AMONG_M: f64 = 0.1;
/// Fewer pictures do not tell the build.
const NOSE_PICTURES: usize = 10;

/// Mean looks of a run of sightings.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MeanLooks {
    /// Shirt, shorts, socks: mean and number of pictures.
    pub(crate) kit: [Option<(Lab, usize)>; 3],
    /// Upper quartile of the nose's height, metres.
    nose_m: Option<f64>,
}

impl MeanLooks {
    /// Channel medians: a few pictures of somebody else's shirt do not matter.
    pub(crate) fn of<'a>(looks: impl Iterator<Item = &'a Looks> + Clone) -> Self {
        let kit = [0, 1, 2].map(|garment| {
            let seen: Vec<Lab> = looks.clone().filter_map(|looks| *looks.kit.get(garment)?).collect();
            let channel = |of: fn(&Lab) -> f32| quantile(seen.iter().map(of).collect(), 0.5);
            Some((Lab { l: channel(|c| c.l)?, a: channel(|c| c.a)?, b: channel(|c| c.b)? }, seen.len()))
        });
        let noses: Vec<f32> = looks.filter_map(|looks| looks.nose_m).collect();
        let nose_m = (noses.len() >= NOSE_PICTURES).then(|| quantile(noses, 0.75)).flatten().map(f64::from);
        Self { kit, nose_m }
    }

    /// How much likelier these two are one person than two, as a logarithm; 0 when nothing is known.
    pub(crate) fn log_same(&self, other: &Self) -> f64 {
        let (mut same, mut strangers) = (0.0, 0.0);
        for (a, b) in self.kit.iter().zip(&other.kit) {
            let (Some((a, pictures_a)), Some((b, pictures_b))) = (a, b) else { continue };
            let few =
                1.0 / (*pictures_a as f64).min(PICTURES_MAX) + 1.0 / (*pictures_b as f64).min(PICTURES_MAX);
            let differences = [a.l - b.l, a.a - b.a, a.b - b.b].map(f64::from);
            for channel in 0..3 {
                let variance = BETWEEN_RUNS[channel].powi(2) + ONE_PICTURE[channel].powi(2) * few;
                let among = variance + 2.0 * AMONG_PEOPLE[channel].powi(2);
                let density = |v: f64| -0.5 * (differences[channel].powi(2) / v + v.ln());
                same += density(variance);
                strangers += density(among);
            }
        }
        // Garments differ together or not at all, so the share of the same kit is of the whole.
        let ratio = (same - strangers).clamp(-50.0, 50.0).exp();
        let mut evidence = (ratio / (SAME_KIT * ratio + 1.0 - SAME_KIT)).ln();
        if let (Some(a), Some(b)) = (self.nose_m, other.nose_m) {
            let density = |s: f64| -0.5 * ((a - b) / s).powi(2) - s.ln();
            let (same, strangers) = (density(NOSE_M), density(NOSE_M.hypot(NOSE_AMONG_M)));
            evidence += (same - strangers).clamp(-1.5, 0.7);
        }
        evidence.max(-AGAINST_MAX)
    }
}

fn quantile(mut values: Vec<f32>, share: f64) -> Option<f32> {
    values.sort_by(f32::total_cmp);
    let place = (share * values.len() as f64) as usize;
    values.get(place.min(values.len().saturating_sub(1))).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn looks(shirt: Lab) -> Looks {
        Looks { kit: [Some(shirt), None, None], nose_m: Some(1.6) }
    }

    #[test]
    fn the_same_kit_says_little_and_another_one_much() {
        let red = Lab { l: 45.0, a: 55.0, b: 35.0 };
        let blue = Lab { l: 35.0, a: 10.0, b: -45.0 };
        let run = |colour| MeanLooks::of(vec![looks(colour); 20].iter());
        let same = run(red).log_same(&run(red));
        assert!((0.3..2.0).contains(&same), "{same}");
        assert!(run(red).log_same(&run(blue)) < -6.0);
        // One picture of each proves less than many.
        let one = |colour| MeanLooks::of([looks(colour)].iter());
        let near = Lab { a: 42.0, ..red };
        assert!(one(red).log_same(&one(near)) > run(red).log_same(&run(near)));
        assert_eq!(MeanLooks::default().log_same(&run(red)), 0.0);
    }

    #[test]
    fn a_few_spoiled_pictures_do_not_change_a_run() {
        let (red, blue) = (Lab { l: 45.0, a: 55.0, b: 35.0 }, Lab { l: 35.0, a: 10.0, b: -45.0 });
        let mut pictures = vec![looks(red); 20];
        pictures.extend(vec![looks(blue); 5]);
        assert_eq!(MeanLooks::of(pictures.iter()).kit[0].unwrap().0, red);
    }
}
