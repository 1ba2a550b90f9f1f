//! Choosing a place: one surface is highlighted, and the match is previewed on it or, before any is known, in the air.

use super::{Output, Phase, Placement, Pointer, Preview, Ray, blend::Blend, float, hover, stand::Ground};
use crate::placement::{Surface, fit::fit};

/// The fit is made anew for a viewer who has moved by this much, metres.
const VIEWER_MOVED_M: f64 = 0.25;

impl Placement {
    /// Renews highlight and preview.
    pub(super) fn choose(&mut self) {
        let Phase::Choosing { highlighted: before, preview } = &self.phase else { return };
        if !self.followed {
            return;
        }
        let before = *before;
        let pointed_at = |ray: &Ray| hover::pointed_at(&self.surfaces, ray, before);
        let by_hand = |pointer: Pointer| self.rays[pointer as usize].as_ref().and_then(pointed_at);
        // Both hands may point all the time: the active one counts as long as it means a surface, else the other one.
        let (active, highlighted) = if self.rays == [None, None] {
            (self.active, self.viewer.filter(|_| self.options.gaze).as_ref().and_then(pointed_at))
        } else {
            let other = self.active.other();
            match (by_hand(self.active), by_hand(other)) {
                (None, Some(surface)) => (other, Some(surface)),
                (surface, _) => (self.active, surface),
            }
        };
        let preview = match highlighted.and_then(|id| self.surfaces.get(&id)) {
            Some(surface) => Some(self.preview_on(surface, preview.as_ref())),
            None => self.preview_in_the_air(preview.as_ref()),
        };
        self.active = active;
        self.phase = Phase::Choosing { highlighted, preview };
        if highlighted != before {
            self.say(Output::Highlight(highlighted));
        }
    }

    fn preview_on(&self, surface: &Surface, before: Option<&Preview>) -> Preview {
        let viewer_m = self.viewer.map(|viewer| viewer.origin_m);
        let before = before.filter(|before| before.ground.surface().is_some_and(|old| old.id == surface.id));
        if let Some(before) = before
            && before.ground.surface() == Some(surface)
            && match (before.viewer_m, viewer_m) {
                (Some(old), Some(new)) => old.distance(new) < VIEWER_MOVED_M,
                (old, new) => old.is_none() == new.is_none(),
            }
        {
            return before.clone();
        }
        let result = fit(surface, &self.wish()).map(|pose| match before {
            // The same surface seen better: the preview glides.
            Some(Preview { result: Ok(blend), .. }) => blend.towards(pose),
            _ => Blend::at(pose),
        });
        Preview { ground: Ground::Surface(Box::new(surface.clone())), result, viewer_m }
    }

    fn preview_in_the_air(&self, before: Option<&Preview>) -> Option<Preview> {
        let viewer = self.viewer.filter(|_| self.options.instant)?;
        let wish = &self.wish;
        let pose = float::comfortable(&viewer, self.options.up, wish.half_turf_m, wish.scale_limits)?;
        let blend = match before {
            Some(Preview { result: Ok(blend), ground: Ground::Air(_), .. }) => blend.towards(pose),
            _ => Blend::at(pose),
        };
        let ground = Ground::Air(float::level(&pose, self.options.up));
        Some(Preview { ground, result: Ok(blend), viewer_m: Some(viewer.origin_m) })
    }
}
