//! What hands do: point, press, release, turn the wheel, cancel.

use glam::DVec3;

use super::{ANCHOR_AFTER, Grip, Output, Phase, Placement, Pointer, Preview, Ray, manipulate, stand::Ground};
use crate::placement::TabletopPose;

impl Placement {
    pub(super) fn point(&mut self, pointer: Pointer, ray: Ray) {
        self.rays[pointer as usize] = Some(ray);
        if !self.followed {
            return;
        }
        let limits = self.wish.scale_limits;
        if let Phase::Standing { ground, grip, blend } = &mut self.phase {
            *grip = manipulate::after_move(*grip, pointer, &ray);
            if grip.holds(pointer)
                && let Some(pose) = manipulate::held(grip, self.rays, ground, limits)
            {
                blend.jump(pose);
            }
        } else {
            self.choose();
        }
    }

    pub(super) fn press(&mut self, pointer: Pointer) {
        let Some(ray) = self.rays[pointer as usize].or(self.viewer.filter(|_| self.options.gaze)) else {
            return;
        };
        if self.active != pointer && self.rays[pointer as usize].is_some() {
            // The hand that selects means where it points itself.
            self.active = pointer;
            self.choose();
        }
        match &mut self.phase {
            Phase::Choosing { preview, .. } => match preview.take() {
                Some(Preview { ground, result: Ok(blend), .. }) => self.stand(ground, blend),
                Some(Preview { ground, result: Err(misfit), viewer_m }) => {
                    *preview = Some(Preview { ground, result: Err(misfit), viewer_m });
                    self.say(Output::Refused(misfit));
                }
                None => {}
            },
            Phase::Standing { ground, grip, blend } => match *grip {
                Grip::None => {
                    // A match that is still gliding is taken where it is seen.
                    let seen = ground.settle(&blend.shown);
                    if let Some(new) = manipulate::grip(pointer, &ray, ground, &seen, self.wish.half_turf_m) {
                        *grip = new;
                    }
                }
                // The second hand joins.
                _ if !grip.holds(pointer) => {
                    take_with_both(grip, &self.rays, ground, &ground.settle(&blend.shown))
                }
                _ => {}
            },
        }
    }

    pub(super) fn release(&mut self, pointer: Pointer) {
        let Phase::Standing { ground, grip, blend } = &mut self.phase else { return };
        if !grip.holds(pointer) {
            return;
        }
        let moved = !matches!(*grip, Grip::Pressed { .. });
        *grip = match *grip {
            // The other hand goes on alone.
            Grip::Both { .. } => {
                let other = pointer.other();
                let at = self.rays[other as usize].and_then(|ray| manipulate::on_ground(ground, &ray));
                at.map_or(Grip::None, |at_m| Grip::Drag {
                    pointer: other,
                    at_m,
                    start: ground.settle(&blend.shown),
                })
            }
            _ => Grip::None,
        };
        if moved {
            self.anchor_due = Some(self.now + ANCHOR_AFTER);
        }
    }

    pub(super) fn adjust(&mut self, angle: f64, factor: f64) {
        let [least, most] = self.wish.scale_limits;
        if let Phase::Standing { grip: Grip::None, blend, ground } = &mut self.phase
            && self.followed
        {
            let turned = blend.target.turned(angle % std::f64::consts::TAU);
            let scale = (turned.scale * factor).clamp(least, most);
            let along = turned.orientation * DVec3::X;
            // About the point on the ground: scaled about the centre mark the turf would sink in.
            blend.target = TabletopPose::standing_on(turned.foot_m(), ground.plane().normal, along, scale);
            blend.target = ground.settle(&blend.target);
            self.anchor_due = Some(self.now + ANCHOR_AFTER);
        }
    }

    pub(super) fn cancel(&mut self) {
        let Phase::Standing { grip, blend, .. } = &mut self.phase else { return };
        if let Some(start) = std::mem::take(grip).start() {
            blend.target = start;
            return;
        }
        self.phase = Phase::Choosing { highlighted: None, preview: None };
        self.anchor_due = None;
        self.say(Output::Lifted);
        self.choose();
    }
}

/// Both hands from now on, when both point at the ground.
fn take_with_both(grip: &mut Grip, rays: &[Option<Ray>; 2], ground: &Ground, pose: &TabletopPose) {
    let at = |ray: &Option<Ray>| manipulate::on_ground(ground, ray.as_ref()?);
    if let (Some(left), Some(right)) = (at(&rays[0]), at(&rays[1])) {
        *grip = Grip::Both { at_m: [left, right], start: *pose };
    }
}
