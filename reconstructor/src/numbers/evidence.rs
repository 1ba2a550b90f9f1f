//! What looks at one back, or at two, say about the numbers on them.

use super::{Reading, TENS, UNITS};

/// Numbers run from 1 to this.
const NUMBERS: usize = 99;
/// How alike looks at one person err: they share kit, lettering and light. Many looks count as 1 / ALIKE, however many there are.
const ALIKE: f64 = 0.25;
/// Most players of a match wear one of the first 30 numbers.
const COMMON: usize = 30;
const COMMON_WEIGHT: f64 = 3.0;
/// No look rules a number out for good.
const PROBABILITY_MIN: f64 = 1e-4;
/// Numbers say no more than this for or against one person (logarithm): now and then a number is misread throughout.
const SAYS_MAX: f64 = 5.0;

/// A shirt number, and how sure it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShirtNumber {
    /// 1 to 99.
    pub number: u8,
    /// Probability that it is right, 0..1.
    pub confidence: f64,
}

/// The probability of every number from 1 on, after all looks at somebody; `None` without looks.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct NumberEvidence(Option<Vec<f64>>);

impl NumberEvidence {
    /// Of all looks at one person.
    pub(crate) fn of(looks: &[&Reading]) -> Self {
        if looks.is_empty() {
            return Self::default();
        }
        // Looks that show no number do not make the others count less.
        let legible: f64 = looks.iter().map(|look| f64::from(look.legible)).sum();
        let weight = 1.0 / (1.0 + ALIKE * (legible - 1.0).max(0.0));
        let evidence: Vec<f64> = (1..=NUMBERS)
            .map(|number| {
                let said: f64 = looks.iter().map(|look| likelihood(look, number).ln()).sum();
                common(number).ln() + weight * said
            })
            .collect();
        let most = evidence.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let all: f64 = evidence.iter().map(|value| (value - most).exp()).sum();
        Self(Some(evidence.into_iter().map(|value| (value - most).exp() / all).collect()))
    }

    /// The likeliest number.
    pub(crate) fn likeliest(&self) -> Option<ShirtNumber> {
        let best = self.0.iter().flatten().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        best.map(|(place, confidence)| ShirtNumber { number: place as u8 + 1, confidence })
    }

    /// How much likelier these are looks at one person than at two team-mates, as a logarithm; 0, or nearly, when either shows
    /// nothing.
    pub(crate) fn log_same(&self, other: &Self) -> f64 {
        let (Some(a), Some(b)) = (&self.0, &other.0) else { return 0.0 };
        let all: f64 = (1..=NUMBERS).map(common).sum();
        let (mut same, mut alike, mut chance) = (0.0, 0.0, 0.0);
        for (number, (a, b)) in (1..).zip(a.iter().zip(b)) {
            let share = common(number) / all;
            same += a * b / share;
            alike += a * b;
            chance += share * share;
        }
        // No two team-mates wear one number.
        let strangers = (1.0 - alike).max(PROBABILITY_MIN) / (1.0 - chance);
        (same.max(f64::MIN_POSITIVE) / strangers).ln().clamp(-SAYS_MAX, SAYS_MAX)
    }
}

/// How common a number is, against the rarest.
fn common(number: usize) -> f64 {
    if number <= COMMON { COMMON_WEIGHT } else { 1.0 }
}

/// How much likelier a look is with this number on the back than with any other. A look that may show no number says little.
fn likelihood(look: &Reading, number: usize) -> f64 {
    let of = |digits: &[f32], digit: usize| f64::from(digits.get(digit).copied().unwrap_or(0.0));
    let both = of(&look.tens, number / 10) * of(&look.units, number % 10) * (TENS * UNITS) as f64;
    let legible = f64::from(look.legible);
    (legible * both + 1.0 - legible).max(PROBABILITY_MIN)
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A look at a number of which the network is so sure, digit by digit.
    pub(in super::super) fn look(number: usize, sure: f32, legible: f32) -> Reading {
        let peak = |digit: usize| {
            let mut ten = [(1.0 - sure) / 9.0; 10];
            ten[digit] = sure;
            ten
        };
        Reading { tens: peak(number / 10), units: peak(number % 10), legible }
    }

    #[test]
    fn several_fair_looks_agree_on_a_number_and_one_is_not_enough() {
        let fair = look(17, 0.8, 0.9);
        let one = NumberEvidence::of(&[&fair]).likeliest().unwrap();
        let six = NumberEvidence::of(&[&fair; 6]).likeliest().unwrap();
        assert_eq!((one.number, six.number), (17, 17));
        assert!(one.confidence < 0.99 && six.confidence > 0.99, "{one:?} {six:?}");
        assert_eq!(NumberEvidence::of(&[]).likeliest(), None);
    }

    #[test]
    fn looks_that_contradict_each_other_or_show_nothing_give_no_number() {
        let (a, b) = (look(6, 0.9, 0.9), look(8, 0.9, 0.9));
        let torn = NumberEvidence::of(&[&a, &b, &a, &b]).likeliest().unwrap();
        assert!(torn.confidence < 0.6, "{torn:?}");
        let nothing = look(10, 1.0, 0.02);
        let seen = NumberEvidence::of(&[&nothing; 4]).likeliest().unwrap();
        assert!(seen.confidence < 0.99, "{seen:?}");
        // One wild look does not undo ten good ones.
        let good = look(23, 0.9, 0.95);
        let wild = look(7, 1.0, 1.0);
        let mixed = NumberEvidence::of(&[[&good; 10].as_slice(), &[&wild]].concat()).likeliest().unwrap();
        assert!(mixed.number == 23 && mixed.confidence > 0.99, "{mixed:?}");
    }

    #[test]
    fn one_number_joins_two_numbers_part_and_nothing_read_says_nothing() {
        let seen = |number: usize, looks: usize| NumberEvidence::of(&vec![&look(number, 0.9, 0.95); looks]);
        let nothing = NumberEvidence::of(&[&look(3, 0.9, 0.0); 5]);
        assert!(seen(17, 6).log_same(&seen(17, 6)) > 3.0);
        assert!(seen(17, 6).log_same(&seen(12, 6)) < -3.0);
        assert!(seen(17, 1).log_same(&seen(17, 1)) < seen(17, 6).log_same(&seen(17, 6)));
        // Not quite 0: whoever does not wear 17 wears something else.
        assert!(nothing.log_same(&seen(17, 6)).abs() < 0.006);
        assert_eq!(NumberEvidence::default().log_same(&seen(17, 6)), 0.0);
    }

    proptest! {
        #[test]
        fn what_two_say_of_each_other_is_bounded_and_the_same_either_way(
            looks in prop::collection::vec((1usize..100, 0.1f32..1.0, 0.0f32..1.0), 2..12),
        ) {
            let looks: Vec<Reading> = looks.into_iter().map(|(number, sure, legible)| look(number, sure, legible)).collect();
            let (a, b) = looks.split_at(looks.len() / 2);
            let of = |part: &[Reading]| NumberEvidence::of(&part.iter().collect::<Vec<_>>());
            let (a, b) = (of(a), of(b));
            prop_assert!((a.log_same(&b) - b.log_same(&a)).abs() < 1e-9 && a.log_same(&b).abs() <= SAYS_MAX);
        }
    }
}
