//! The kits of one match, drawn so that nobody can be taken for the other side: home, away, two goalkeepers, officials.
//! Colours are compared as CIELAB (D65), where distances are about what the eye sees.

use rand::{Rng, seq::IndexedRandom};

use crate::{
    outfit::{Kit, Pattern, Srgb, lab},
    trajectories::Role,
};

/// Least CIE76 difference between the shirts of two sides.
pub const CLASH: f32 = 38.0;
/// Least difference of a shirt from the grass.
const CAMOUFLAGE: f32 = 24.0;
/// Grass under floodlights, about.
const GRASS: Srgb = [0.33, 0.47, 0.18];

/// What everybody wears.
#[derive(Clone, Debug, PartialEq)]
pub struct Wardrobe {
    /// Home and away.
    pub teams: [Kit; 2],
    /// Their goalkeepers.
    pub keepers: [Kit; 2],
    /// Referee and assistants.
    pub officials: Kit,
}

impl Wardrobe {
    /// Draws the kits of a match.
    pub fn draw(rng: &mut impl Rng) -> Self {
        let home = apart(rng, "home", &[], Kit::believable);
        let away = apart(rng, "away", &[&home], Kit::believable);
        let first = apart(rng, "home-keeper", &[&home, &away], keeper);
        let second = apart(rng, "away-keeper", &[&home, &away], keeper);
        let officials = apart(rng, "officials", &[&home, &away, &first, &second], official);
        Self { teams: [home, away], keepers: [first, second], officials }
    }

    /// The kit of somebody.
    #[must_use]
    pub fn kit(&self, team: Option<u8>, role: Role) -> &Kit {
        match (team, role) {
            (Some(0), Role::Goalkeeper) => &self.keepers[0],
            (Some(_), Role::Goalkeeper) => &self.keepers[1],
            (Some(0), _) => &self.teams[0],
            (Some(_), _) => &self.teams[1],
            (None, _) => &self.officials,
        }
    }
}

/// The best of some draws: the first that stands out from `others` and the grass, else the one that does so most.
fn apart<R: Rng>(rng: &mut R, id: &str, others: &[&Kit], draw: fn(&mut R, String) -> Kit) -> Kit {
    let margin = |kit: &Kit| {
        let seen = seen_colour(kit);
        let nearest =
            others.iter().map(|other| difference(seen, seen_colour(other)) - CLASH).fold(f32::MAX, f32::min);
        nearest.min(difference(seen, GRASS) - CAMOUFLAGE)
    };
    let mut best = draw(rng, id.into());
    for _ in 0..60 {
        if margin(&best) >= 0.0 {
            break;
        }
        let other = draw(rng, id.into());
        if margin(&other) > margin(&best) {
            best = other;
        }
    }
    best
}

/// The colour that a shirt shows from afar.
#[must_use]
pub fn seen_colour(kit: &Kit) -> Srgb {
    let share = match kit.pattern {
        Pattern::Plain => 0.0,
        Pattern::Sleeves | Pattern::Sash(_) => 0.2,
        Pattern::Stripes(_) | Pattern::Hoops(_) | Pattern::Halves => 0.5,
    };
    [0, 1, 2].map(|k| kit.shirt[k] + (kit.second[k] - kit.shirt[k]) * share)
}

/// CIE76 difference of two sRGB colours.
#[must_use]
pub fn difference(a: Srgb, b: Srgb) -> f32 {
    lab(a).distance(lab(b))
}

fn one_colour(rng: &mut impl Rng, id: String, colours: &[Srgb], dark_shorts: f64) -> Kit {
    const BLACK: Srgb = [0.06, 0.06, 0.07];
    let shirt = *colours.choose(rng).unwrap_or(&BLACK);
    let lower = if rng.random_bool(dark_shorts) { BLACK } else { shirt };
    let bright = shirt.iter().sum::<f32>() > 1.5;
    let ink = if bright { BLACK } else { [0.95, 0.95, 0.95] };
    let trim = if rng.random_bool(0.5) { BLACK } else { shirt.map(|c| c * 0.7) };
    Kit {
        id,
        shirt,
        second: trim,
        pattern: Pattern::Plain,
        trim,
        shorts: lower,
        socks: lower,
        number: ink,
        sponsor: None,
    }
}

/// Goalkeepers wear one bright colour from neck to socks.
fn keeper<R: Rng>(rng: &mut R, id: String) -> Kit {
    const COLOURS: [Srgb; 9] = [
        [0.93, 0.84, 0.12],
        [0.95, 0.45, 0.08],
        [0.20, 0.80, 0.35],
        [0.90, 0.35, 0.60],
        [0.15, 0.70, 0.85],
        [0.55, 0.57, 0.60],
        [0.10, 0.10, 0.11],
        [0.75, 0.90, 0.15],
        [0.45, 0.20, 0.60],
    ];
    one_colour(rng, id, &COLOURS, 0.25)
}

/// Officials: one colour, black shorts and socks.
fn official<R: Rng>(rng: &mut R, id: String) -> Kit {
    const COLOURS: [Srgb; 6] = [
        [0.08, 0.08, 0.09],
        [0.93, 0.86, 0.20],
        [0.40, 0.70, 0.92],
        [0.85, 0.20, 0.25],
        [0.95, 0.55, 0.35],
        [0.30, 0.75, 0.60],
    ];
    one_colour(rng, id, &COLOURS, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn the_two_sides_never_clash_and_differ_between_seeds() {
        let draw = |seed| Wardrobe::draw(&mut Pcg64Mcg::seed_from_u64(seed));
        let mut shirts = std::collections::BTreeSet::new();
        for seed in 0..60 {
            let wardrobe = draw(seed);
            let [home, away] = [0, 1].map(|team| seen_colour(&wardrobe.teams[team]));
            assert!(difference(home, away) >= CLASH, "seed {seed}: {home:?} against {away:?}");
            for keeper in &wardrobe.keepers {
                let nearest =
                    difference(seen_colour(keeper), home).min(difference(seen_colour(keeper), away));
                assert!(nearest > 25.0, "seed {seed}: a goalkeeper looks like an outfield player");
            }
            shirts.insert(home.map(|c| (c * 255.0) as u8));
            assert_eq!(wardrobe, draw(seed));
        }
        assert!(shirts.len() > 25, "{} home shirts in 60 matches", shirts.len());
    }

    #[test]
    fn differences_of_colours_are_those_of_the_standard() {
        // White against black is 100 by definition; red against blue is 176 (CIE76 of the sRGB primaries).
        assert!((difference([1.0; 3], [0.0; 3]) - 100.0).abs() < 0.2);
        assert!((difference([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]) - 176.3).abs() < 1.0);
    }
}
