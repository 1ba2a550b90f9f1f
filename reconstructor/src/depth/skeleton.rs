//! The skeleton in the picture: which limb a pixel shows, and where on it.

use glam::DVec2;

use super::{
    View,
    paint::{LIMBS, with_middles},
};
use crate::pose::Joint;

/// A limb shorter than this in the picture has no direction, metres.
const SHORT_M: f64 = 0.08;

/// The limb of [`LIMBS`] from the middle of the shoulders to that of the hips.
const TRUNK_LIMB: usize = 5;

/// Of a body, seen from the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// Its first surface.
    Front,
    /// Its last.
    Back,
}

impl Side {
    /// What makes the limb of this side the least in depth.
    fn sign(self) -> f64 {
        if self == Self::Front { 1.0 } else { -1.0 }
    }
}

/// A place of the picture by the limb that is there.
pub(crate) struct Place {
    pub(crate) limb: usize,
    /// Share of the way along the limb.
    pub(crate) along: f64,
    /// From the limb's axis: along it and across, metres; right and down where the limb has no direction.
    pub(crate) beside_m: DVec2,
    /// How far behind the hips' upright plane the limb is there, metres.
    pub(crate) limb_m: f64,
}

/// A limb in the picture: pixels, and metres behind the upright plane through the hips.
pub(crate) struct Limb {
    from_px: DVec2,
    to_px: DVec2,
    from_m: f64,
    to_m: f64,
    pub(crate) radius_m: f64,
    /// Whether it reaches farther along the sight than across it.
    pub(crate) along_sight: bool,
    /// Direction in the picture, when it has one.
    direction: Option<DVec2>,
}

/// The limbs of somebody in one picture.
pub(crate) struct Skeleton {
    limbs: Vec<Limb>,
    pixels_per_metre: f64,
}

impl Skeleton {
    /// `None` unless all joints are finite.
    pub(crate) fn of(joints: &[Joint], view: View) -> Option<Self> {
        let joints = with_middles(joints)?;
        let View { pixels_per_metre, descent } = view;
        let hips_y_px = joints.last()?.pixel.y;
        let plane_m = |joint: &Joint| {
            f64::from(joint.depth_m) - (joint.pixel.y - hips_y_px) / pixels_per_metre * descent
        };
        let limbs = LIMBS.iter().map(|&(from, to, radius_m)| {
            let (from, to) = (joints.get(from)?, joints.get(to)?);
            let axis = to.pixel - from.pixel;
            let direction = (axis.length() > SHORT_M * pixels_per_metre).then(|| axis.normalize());
            let (from_m, to_m) = (plane_m(from), plane_m(to));
            let along_sight = f64::from(to.depth_m - from.depth_m).abs() > axis.length() / pixels_per_metre;
            let finite = from.pixel.is_finite() && to.pixel.is_finite() && (from_m + to_m).is_finite();
            let (from_px, to_px) = (from.pixel, to.pixel);
            finite.then_some(Limb { from_px, to_px, from_m, to_m, radius_m, along_sight, direction })
        });
        let limbs: Option<Vec<Limb>> = limbs.collect();
        let scale = pixels_per_metre.is_finite() && pixels_per_metre > 0.0;
        scale.then_some(Self { limbs: limbs?, pixels_per_metre })
    }

    /// Which limb is at a pixel, and where on it: of those that cover it the first or the last, else the closest beside it.
    pub(crate) fn place(&self, pixel: DVec2, side: Side) -> Option<Place> {
        let mut best: Option<((bool, f64), usize, f64)> = None;
        for (index, limb) in self.limbs.iter().enumerate() {
            let axis = limb.to_px - limb.from_px;
            let along = ((pixel - limb.from_px).dot(axis) / axis.length_squared().max(1e-9)).clamp(0.0, 1.0);
            let edge_m = (pixel - limb.at(along)).length() / self.pixels_per_metre - limb.radius_m;
            let key = if edge_m <= 0.0 { (false, side.sign() * limb.depth_m(along)) } else { (true, edge_m) };
            if best.is_none_or(|(known, ..)| key < known) {
                best = Some((key, index, along));
            }
        }
        let (_, index, along) = best?;
        let limb = self.limbs.get(index)?;
        let off_m = (pixel - limb.at(along)) / self.pixels_per_metre;
        let beside_m = limb.direction.map_or(off_m, |d| DVec2::new(off_m.dot(d), off_m.dot(d.perp())));
        Some(Place { limb: index, along, beside_m, limb_m: limb.depth_m(along) })
    }

    /// The limbs, in the order of [`LIMBS`].
    pub(crate) fn limbs(&self) -> &[Limb] {
        &self.limbs
    }

    /// A point of a limb's axis, pixels.
    pub(crate) fn at(&self, limb: usize, along: f64) -> Option<DVec2> {
        Some(self.limbs.get(limb)?.at(along))
    }

    /// A point between the middle of the shoulders and that of the hips, pixels.
    pub(crate) fn trunk_at(&self, along: f64) -> Option<DVec2> {
        self.at(TRUNK_LIMB, along)
    }

    /// Where the same place is seen here, and how far behind the plane its limb is.
    pub(crate) fn pixel(&self, place: &Place) -> Option<(DVec2, f64)> {
        let limb = self.limbs.get(place.limb)?;
        let DVec2 { x, y } = place.beside_m;
        let off_m = limb.direction.map_or(place.beside_m, |d| d * x + d.perp() * y);
        Some((limb.at(place.along) + off_m * self.pixels_per_metre, limb.depth_m(place.along)))
    }
}

impl Limb {
    /// A point of its axis, pixels.
    pub(crate) fn at(&self, along: f64) -> DVec2 {
        self.from_px.lerp(self.to_px, along)
    }

    /// How far behind the plane the point is, metres.
    pub(crate) fn depth_m(&self, along: f64) -> f64 {
        self.from_m + along * (self.to_m - self.from_m)
    }
}
