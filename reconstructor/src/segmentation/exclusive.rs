//! A pixel belongs to one person only: who gets what several people claim.

use glam::DVec2;

use super::PlayerMask;
use crate::{
    geometry::{Mask, PixelBox},
    pose::{Person, bones, cut, squared_distance_px},
};

/// Gives every pixel that several masks of one frame hold to the one that covers most of it, of equals to the one whose skeleton is
/// nearer. `people` is everybody found in the frame.
pub fn exclusive(masks: &mut [PlayerMask], people: &[Person]) {
    for second in 1..masks.len() {
        let (before, rest) = masks.split_at_mut(second);
        let Some(b) = rest.first_mut() else { continue };
        for a in before {
            if !touch(&a.mask, &b.mask) {
                continue;
            }
            let claim = |found: &PlayerMask| people.get(found.sighting.person_index).map(Claim::of);
            let claims = (claim(a), claim(b));
            let strength = |claim: &Option<Claim>, pixel: DVec2| {
                claim.as_ref().map_or(0.0, |claim| claim.strength(pixel, u8::MAX))
            };
            let mut lost = (false, false);
            let width = a.mask.width.max(1) as usize;
            for i in 0..a.mask.coverage.len() {
                let (x, y) = (a.mask.x0 + (i % width) as i32, a.mask.y0 + (i / width) as i32);
                let Some(of_a) = a.mask.coverage.get_mut(i).filter(|c| **c > 0) else { continue };
                let Some(of_b) = place(&mut b.mask, x, y).filter(|c| **c > 0) else { continue };
                let pixel = DVec2::new(f64::from(x), f64::from(y));
                let a_wins = match (*of_a).cmp(of_b) {
                    std::cmp::Ordering::Greater => true,
                    std::cmp::Ordering::Less => false,
                    std::cmp::Ordering::Equal => strength(&claims.0, pixel) >= strength(&claims.1, pixel),
                };
                if a_wins {
                    *of_b = 0;
                    lost.1 = true;
                } else {
                    *of_a = 0;
                    lost.0 = true;
                }
            }
            if lost.0 {
                a.mask = cut(&a.mask);
            }
            if lost.1 {
                b.mask = cut(&b.mask);
            }
        }
    }
}

fn place(mask: &mut Mask, x: i32, y: i32) -> Option<&mut u8> {
    let (column, row) = (i64::from(x) - i64::from(mask.x0), i64::from(y) - i64::from(mask.y0));
    let inside = column >= 0 && row >= 0 && column < i64::from(mask.width) && row < i64::from(mask.height);
    inside
        .then(|| row as usize * mask.width as usize + column as usize)
        .and_then(|i| mask.coverage.get_mut(i))
}

/// The person's mask without the pixels that one of the others claims more strongly.
pub(super) fn own_pixels<'a>(person: &Person, others: impl Iterator<Item = &'a Person>) -> Mask {
    let own = &person.mask;
    let width = own.width.max(1) as usize;
    let person_claim = Claim::of(person);
    let mut mask = own.clone();
    let mut lost = false;
    for other in others.filter(|other| touch(own, &other.mask)) {
        let other_claim = Claim::of(other);
        for (i, &coverage) in own.coverage.iter().enumerate() {
            let (x, y) = (own.x0 + (i % width) as i32, own.y0 + (i / width) as i32);
            let rival = other.mask.at(x, y);
            if coverage == 0 || rival == 0 {
                continue;
            }
            let pixel = DVec2::new(f64::from(x), f64::from(y));
            if other_claim.strength(pixel, rival) > person_claim.strength(pixel, coverage)
                && let Some(place) = mask.coverage.get_mut(i)
            {
                *place = 0;
                lost = true;
            }
        }
    }
    if lost { cut(&mask) } else { mask }
}

fn touch(a: &Mask, b: &Mask) -> bool {
    let span = |start: i32, length: u32| (i64::from(start), i64::from(start) + i64::from(length));
    let overlap = |p: (i64, i64), q: (i64, i64)| p.0 < q.1 && q.0 < p.1;
    overlap(span(a.x0, a.width), span(b.x0, b.width)) && overlap(span(a.y0, a.height), span(b.y0, b.height))
}

/// Whether two boxes share anything.
pub(super) fn boxes_touch(a: &PixelBox, b: &PixelBox) -> bool {
    a.min.cmple(b.max).all() && b.min.cmple(a.max).all()
}

/// Half the thickness of a limb of a person, pixels: a limb is about an eighth of the body's height across.
pub(super) fn limb_px(person: &Person) -> f64 {
    let px = person.bounds.size().max_element() / 16.0;
    if px.is_finite() { px.max(1.0) } else { 1.0 }
}

/// What a person's skeleton says about a pixel.
pub(super) struct Claim {
    bones: Vec<(DVec2, DVec2)>,
    limb_px: f64,
}

impl Claim {
    pub(super) fn of(person: &Person) -> Self {
        Self { bones: bones(&person.joints), limb_px: limb_px(person) }
    }

    /// Coverage, weighted down with the distance from the skeleton.
    pub(super) fn strength(&self, pixel: DVec2, coverage: u8) -> f64 {
        f64::from(coverage) / (1.0 + self.squared_distance_px(pixel) / self.limb_px.powi(2))
    }

    /// To the nearest bone, pixels²; infinite without bones.
    pub(super) fn squared_distance_px(&self, pixel: DVec2) -> f64 {
        self.bones.iter().map(|&bone| squared_distance_px(pixel, bone)).fold(f64::INFINITY, f64::min)
    }

    /// 1 on a bone, falling off as a Gaussian of a limb's thickness.
    pub(super) fn near(&self, pixel: DVec2) -> f64 {
        (-self.squared_distance_px(pixel) / self.limb_px.powi(2)).exp()
    }
}
