//! The ball's way cut into stretches of one law each: on the grass, in the air, in somebody's hands, or not explained.
//!
//! Every pair of cuts is a possible stretch; each is fitted under each law and with what its ends may rest on. Dynamic
//! programming then finds the chain of stretches with the least cost: misfit, a price per stretch (as in a minimal
//! description), and what each handover demands: a foot or head nearby, or a bounce that grass allows.

use nalgebra::{Matrix3, Vector3};

use super::{
    RADIUS_M,
    arc::Law,
    bodies::{self, Near, Part},
    cuts::Cut,
    fit::{self, Contact, End, Fit, OUTLIER_COST, Pin, Stretch},
    sight::Sight,
};
use crate::pose::Person;

/// Longest stretches, seconds.
const GRASS_S: f64 = 4.0;
const AIR_S: f64 = 4.5;
const HANDS_S: f64 = 6.0;
/// What a stretch of a kind costs.
const GRASS_COST: f64 = 4.0;
const AIR_COST: f64 = 6.5;
const HANDS_COST: f64 = 7.0;
const UNKNOWN_COST: f64 = 2.0;
/// What a sight costs that nothing explains; a little less than a wrong one.
const UNKNOWN_SIGHT_COST: f64 = 0.75 * OUTLIER_COST;
/// A steady push on the grass, m/s²: friction alone, and with a foot nearby.
const FREE_PUSH: f64 = 2.2;
const DRIBBLE_PUSH: f64 = 8.0;
/// A ball nearer to a foot than this is dribbled, metres.
const DRIBBLE_M: f64 = 1.1;
/// A person's plane is off by this, metres.
const BODY_SIGMA_M: f64 = 0.35;
/// A ball this near to a hand is held, metres (one standard deviation), and a hand this far away holds nothing.
const HELD_SIGMA_M: f64 = 0.16;
const HELD_REACH_M: f64 = 0.6;
/// Fewest sights that a hold is seen by.
const HELD_SIGHTS: usize = 5;
/// A ball's way changes beside nobody at this price; beside somebody at least at the other.
const OPEN_COST: f64 = 9.0;
const TOUCH_COST: f64 = 1.0;
/// A body that played the ball tells its distance if it is this near in the picture, metres.
const PINNED_M: f64 = 0.7;
/// Two ends that do not meet cost this at most.
const APART_COST: f64 = 18.0;
/// A bounce on grass: share of the upward and the forward speed that is kept, with standard deviations (FIFA's quality
/// tests: rebound of 0.6 to 1 m from 2 m, that is 0.55 to 0.71 of the speed).
const BOUNCE: [f64; 2] = [0.6, 0.13];
const GRIP: [f64; 2] = [0.78, 0.15];
const BOUNCE_COST: f64 = 2.0;
/// Speeds are met within this, m/s.
const SPEED_SIGMA: f64 = 0.8;
/// Chains kept at a cut, and how much worse than the best one they may be.
const KEPT: usize = 40;
const WORSE: f64 = 25.0;

/// What a stretch is.
#[derive(Clone, Debug)]
pub(super) enum Kind {
    /// A law of motion, fitted.
    Free { fit: Box<Fit>, pins: [Pin; 2], push_sigma: f64 },
    /// In somebody's hands: where, at each sight.
    Held(Vec<nalgebra::Vector3<f64>>),
    /// Nothing fits.
    Unknown,
}

/// A stretch between two cuts.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    pub(super) cuts: [usize; 2],
    pub(super) kind: Kind,
    pub(super) cost: f64,
    ends: Option<[End; 2]>,
}

/// The best chain of stretches from the first cut to the last.
pub(super) fn best(sights: &[Sight], cuts: &[Cut], people: &[Vec<Person>]) -> Vec<Segment> {
    let hands = hands(sights, people);
    let dribbled = dribbled(sights, people);
    let mut all: Vec<Segment> = Vec::new();
    // Places in `all` of the stretches that end at each cut, with the cost of the best chain up to there and who is before.
    let mut arriving: Vec<Vec<(usize, f64, Option<usize>)>> = vec![Vec::new(); cuts.len()];
    for from in 0..cuts.len().saturating_sub(1) {
        let leaving = stretches(from, sights, cuts, &hands, &dribbled);
        let mut before = std::mem::take(&mut arriving[from]);
        before.sort_by(|a, b| a.1.total_cmp(&b.1));
        let limit = before.first().map_or(0.0, |best| best.1) + WORSE;
        before.truncate(KEPT);
        before.retain(|entry| entry.1 <= limit);
        for segment in leaving {
            let to = segment.cuts[1];
            let chain = before
                .iter()
                .map(|&(index, cost, _)| (cost + handover(&all[index], &segment, &cuts[from]), Some(index)))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap_or((0.0, None));
            arriving[to].push((all.len(), chain.0 + segment.cost, chain.1));
            all.push(segment);
        }
        arriving[from] = before;
    }
    let mut chosen = Vec::new();
    let last = arriving.last().and_then(|ends| ends.iter().min_by(|a, b| a.1.total_cmp(&b.1)));
    let mut place = last.map(|entry| entry.0);
    let earlier = |index: usize| -> Option<usize> {
        let entries = arriving.get(all[index].cuts[1])?;
        entries.iter().find(|entry| entry.0 == index).and_then(|entry| entry.2)
    };
    while let Some(index) = place {
        place = earlier(index);
        chosen.push(all[index].clone());
    }
    chosen.reverse();
    chosen
}

/// The hand, or the body that it holds the ball to, nearest to each sight.
fn hands(sights: &[Sight], people: &[Vec<Person>]) -> Vec<Option<Near>> {
    let nearest = |sight: &Sight| {
        let people = people.get(sight.frame)?;
        let near = bodies::near(&sight.camera, people, sight.pixel, HELD_REACH_M);
        near.into_iter().find(|near| matches!(near.part, Part::Hand | Part::Trunk))
    };
    sights.iter().map(nearest).collect()
}

/// Whether a foot is near each sight.
fn dribbled(sights: &[Sight], people: &[Vec<Person>]) -> Vec<bool> {
    let near = |sight: &Sight| {
        let people = people.get(sight.frame).map_or(&[][..], Vec::as_slice);
        bodies::near(&sight.camera, people, sight.pixel, DRIBBLE_M).iter().any(|near| near.part == Part::Foot)
    };
    sights.iter().map(near).collect()
}

/// Every stretch that starts at a cut.
fn stretches(
    from: usize,
    sights: &[Sight],
    cuts: &[Cut],
    hands: &[Option<Near>],
    dribbled: &[bool],
) -> Vec<Segment> {
    let mut found = Vec::new();
    let mut warm: [Option<Fit>; 2] = [None, None];
    for to in from + 1..cuts.len() {
        let range = cuts[from].sight..cuts[to].sight;
        let seconds = cuts[to].seconds - cuts[from].seconds;
        if seconds > HANDS_S.max(AIR_S) {
            break;
        }
        let of = &sights[range.clone()];
        let unknown = UNKNOWN_COST + of.len() as f64 * UNKNOWN_SIGHT_COST;
        if to == from + 1 {
            found.push(Segment { cuts: [from, to], kind: Kind::Unknown, cost: unknown, ends: None });
        }
        let near = range.clone().filter(|&k| dribbled[k]).count();
        let push_sigma = if 2 * near > of.len() { DRIBBLE_PUSH } else { FREE_PUSH };
        let stretch = Stretch { sights: of, from_s: cuts[from].seconds, to_s: cuts[to].seconds, push_sigma };
        let mut try_with = |law: Law, pins: [Pin; 2], price: f64, warm: Option<&Fit>| {
            let fit = fit::fit(law, &stretch, pins, warm.map(|fit| &fit.parameters))?;
            let cost = fit.cost + price;
            if cost >= unknown + 2.0 || fit.explained < of.len().min(2) {
                return None;
            }
            let ends = fit.ends()?;
            let kept = fit.clone();
            let kind = Kind::Free { fit: Box::new(fit), pins, push_sigma };
            found.push(Segment { cuts: [from, to], kind, cost, ends: Some(ends) });
            Some(kept)
        };
        if seconds < GRASS_S && !of.is_empty() {
            warm[0] = try_with(Law::Grass, [Pin::Free; 2], GRASS_COST, warm[0].as_ref());
        }
        if seconds < AIR_S && of.len() >= 3 && seconds > 0.15 {
            let free = try_with(Law::Air, [Pin::Free; 2], AIR_COST, warm[1].as_ref());
            if free.is_some() {
                let [starts, ends] = [from, to].map(|cut| pins(&cuts[cut]));
                for start in &starts {
                    for end in &ends {
                        if [*start, *end] != [Pin::Free; 2] {
                            try_with(Law::Air, [*start, *end], AIR_COST, None);
                        }
                    }
                }
            }
            warm[1] = free;
        }
        found.extend(held([from, to], of, &hands[range]));
    }
    found
}

/// What an end in the air may rest on.
fn pins(cut: &Cut) -> Vec<Pin> {
    let mut pins = vec![Pin::Free, Pin::Ground];
    if let Some(near) = cut.near.iter().find(|near| near.apart_m < 0.8) {
        pins.push(Pin::At(Contact { point: near.point, sigma_m: BODY_SIGMA_M }));
    }
    pins
}

/// A ball that stays at a hand.
fn held(cuts: [usize; 2], sights: &[Sight], hands: &[Option<Near>]) -> Option<Segment> {
    if sights.len() < HELD_SIGHTS {
        return None;
    }
    let mut cost = HANDS_COST;
    let mut way: Vec<Vector3<f64>> = Vec::with_capacity(sights.len());
    for hand in hands {
        match hand {
            Some(near) => {
                cost += ((near.apart_m / HELD_SIGMA_M).powi(2) / 2.0).min(OUTLIER_COST);
                let point = super::arc::vector(near.point);
                // A neighbour's hand is no hand of the same person.
                if way.last().is_some_and(|last| (last - point).norm() > 1.2) {
                    return None;
                }
                way.push(point);
            }
            None => {
                cost += OUTLIER_COST;
                way.push(*way.last()?);
            }
        }
    }
    if cost > UNKNOWN_COST + sights.len() as f64 * UNKNOWN_SIGHT_COST {
        return None;
    }
    let end = |position: &Vector3<f64>| End {
        position: *position,
        velocity: Vector3::zeros(),
        position_covariance: Matrix3::identity() * BODY_SIGMA_M.powi(2),
        velocity_covariance: Matrix3::identity() * 16.0,
    };
    let ends = Some([end(way.first()?), end(way.last()?)]);
    Some(Segment { cuts, kind: Kind::Held(way), cost, ends })
}

/// What it costs that one stretch ends and the other begins at a cut.
fn handover(before: &Segment, after: &Segment, cut: &Cut) -> f64 {
    let (Some([_, left]), Some([right, _])) = (&before.ends, &after.ends) else {
        // Into or out of what is not known.
        return 3.0;
    };
    let change = right.velocity - left.velocity;
    let slack =
        Matrix3::identity() * 0.05_f64.powi(2) + change * change.transpose() * (cut.slack_s / 3.0).powi(2);
    let apart = squares(
        &(right.position - left.position),
        &(left.position_covariance + right.position_covariance + slack),
    );
    let touched = touch(left, right, cut).map_or(f64::INFINITY, |touch| touch.0);
    (apart / 2.0).min(APART_COST) + touched.min(natural(before, after, left, right)).min(OPEN_COST)
}

/// What the place rests on where one stretch hands over to the next: the body that played the ball, the grass it bounced off.
pub(super) fn meeting(before: &Segment, after: &Segment, cut: &Cut) -> Pin {
    let (Some([_, left]), Some([right, _])) = (&before.ends, &after.ends) else { return Pin::Free };
    let at = |point| Pin::At(Contact { point, sigma_m: BODY_SIGMA_M });
    match (&before.kind, &after.kind) {
        (Kind::Held(_), _) => return at(super::arc::point(&left.position)),
        (_, Kind::Held(_)) => return at(super::arc::point(&right.position)),
        _ => {}
    }
    let natural = natural(before, after, left, right).min(OPEN_COST);
    match touch(left, right, cut) {
        Some((price, near)) if price < natural && near.apart_m < PINNED_M => at(near.point),
        _ if natural < OPEN_COST => Pin::Ground,
        _ => Pin::Free,
    }
}

/// The price of a touch by the body that is most likely, and that body.
fn touch<'a>(left: &End, right: &End, cut: &'a Cut) -> Option<(f64, &'a Near)> {
    let middle = (left.position + right.position) / 2.0;
    let covariance = (left.position_covariance + right.position_covariance) / 4.0
        + Matrix3::identity() * (1.3 * BODY_SIGMA_M).powi(2);
    let price = |near: &Near| {
        let far = ((near.apart_m - 0.35) / 0.85).max(0.0);
        let point = super::arc::vector(near.point);
        TOUCH_COST + 8.0 * far + squares(&(middle - point), &covariance) / 2.0
    };
    cut.near.iter().map(|near| (price(near), near)).min_by(|a, b| a.0.total_cmp(&b.0))
}

/// The price of what the ball does by itself: it bounces, comes to roll, or rolls on.
fn natural(before: &Segment, after: &Segment, left: &End, right: &End) -> f64 {
    let law = |segment: &Segment| match &segment.kind {
        Kind::Free { fit, .. } => Some(fit.law),
        _ => None,
    };
    let (Some(first), Some(second)) = (law(before), law(after)) else { return f64::INFINITY };
    let spread = left.velocity_covariance + right.velocity_covariance;
    let along = |v: &Vector3<f64>| Vector3::new(v.x, 0.0, v.z);
    let sigma_along = ((spread[(0, 0)] + spread[(2, 2)]) / 2.0).sqrt() + SPEED_SIGMA;
    let sigma_up = spread[(1, 1)].sqrt() + SPEED_SIGMA;
    match (first, second) {
        (Law::Grass, Law::Grass) => {
            (along(&right.velocity) - along(&left.velocity)).norm_squared() / (2.0 * sigma_along.powi(2))
                + 1.0
        }
        // The grass does not throw balls into the air.
        (Law::Grass, Law::Air) => f64::INFINITY,
        (Law::Air, _) => {
            let height =
                (left.position.y - RADIUS_M) / (left.position_covariance[(1, 1)] + 0.15_f64.powi(2)).sqrt();
            let (v, w) = (along(&left.velocity), along(&right.velocity));
            let grip_sigma = sigma_along + GRIP[1] * v.norm();
            let forward = (w - v * GRIP[0]).norm() / grip_sigma;
            let up = if second == Law::Grass {
                // What is left of a bounce is too small to see.
                (left.velocity.y + 1.0).min(0.0) * 0.35 / sigma_up
            } else {
                let down = (-left.velocity.y).max(0.0);
                (right.velocity.y - BOUNCE[0] * down) / (sigma_up + BOUNCE[1] * down)
            };
            BOUNCE_COST + (height * height + forward * forward + up * up) / 2.0
        }
    }
}

fn squares(v: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
    covariance.try_inverse().map_or(f64::INFINITY, |inverse| v.dot(&(inverse * v)))
}
