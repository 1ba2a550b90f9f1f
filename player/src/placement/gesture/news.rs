//! News of the room: surfaces found and refined, anchors and the frame itself corrected, tracking lost and found.

use glam::{DQuat, DVec3};

use super::{
    ANCHOR_AFTER, Grip, Output, Phase, Placement, Pointer, Preview, Ray,
    blend::Blend,
    event::MOST_COORDINATE_M,
    float, manipulate,
    stand::{self, Ground},
};
use crate::placement::{Surface, TabletopPose};

impl Placement {
    pub(super) fn know(&mut self, surfaces: Vec<Surface>) {
        let sound = |surface: &Surface| {
            surface.plane.normal.is_normalized()
                && surface.plane.offset_m.is_finite()
                && surface.outline_m.len() >= 3
                && surface
                    .outline_m
                    .iter()
                    .chain(surface.obstacles_m.iter().flatten())
                    .all(|corner| is_near(*corner))
        };
        self.surfaces = surfaces.into_iter().filter(sound).map(|surface| (surface.id, surface)).collect();
        let wish = self.wish();
        let mut landed = None;
        if let Phase::Standing { ground, grip, blend } = &mut self.phase {
            if let Some((_, renewed)) = ground.renewed(&self.surfaces, blend.target.foot_m(), self.options.up)
            {
                blend.target = renewed.settle(&blend.target);
                *ground = renewed;
                // What is in the hand goes on from here: the planes of the start and of now are not the same.
                regrip(grip, &self.rays, ground, &blend.target);
            } else if ground.surface().is_none()
                && *grip == Grip::None
                && let Some((id, pose)) =
                    stand::landing(&self.surfaces, &blend.target, self.viewer.as_ref(), &wish)
                && let Some(surface) = self.surfaces.get(&id)
            {
                *ground = Ground::Surface(Box::new(surface.clone()));
                blend.target = pose;
                landed = Some(id);
            }
        }
        if let Some(id) = landed {
            self.say(Output::Landed(id));
            self.anchor_due = Some(self.now + ANCHOR_AFTER);
        }
        self.choose();
    }

    pub(super) fn follow(&mut self, followed: bool) {
        self.followed = followed;
        match &mut self.phase {
            // It stays where the hand left it.
            Phase::Standing { grip, .. } => *grip = Grip::None,
            Phase::Choosing { highlighted, preview } if !followed => {
                *preview = None;
                if highlighted.take().is_some() {
                    self.say(Output::Highlight(None));
                }
            }
            Phase::Choosing { .. } => self.choose(),
        }
    }

    pub(super) fn anchor_moved(&mut self, generation: u32, position_m: DVec3, orientation: DQuat) {
        let sound = is_near(position_m) && orientation.is_finite() && orientation.length_squared() > 1e-12;
        if generation != self.generation || self.anchor_due.is_some() || !sound {
            return;
        }
        if let Phase::Standing { ground, grip: Grip::None, blend } = &mut self.phase {
            let moved =
                TabletopPose { position_m, orientation: orientation.normalize(), scale: blend.target.scale };
            if let Ground::Air(plane) = ground {
                *plane = float::level(&moved, self.options.up);
            }
            blend.target = ground.settle(&moved);
        }
    }

    pub(super) fn room_moved(&mut self, rotation: DQuat, translation_m: DVec3) {
        if !(rotation.is_finite() && is_near(translation_m) && rotation.length_squared() > 1e-12) {
            return;
        }
        let rotation = rotation.normalize();
        let ray = |ray: &mut Ray| {
            ray.origin_m = rotation * ray.origin_m + translation_m;
            ray.direction = rotation * ray.direction;
        };
        self.rays.iter_mut().flatten().chain(&mut self.viewer).for_each(ray);
        for surface in self.surfaces.values_mut() {
            stand::move_surface(surface, rotation, translation_m);
        }
        self.options.up = (rotation * self.options.up).normalize_or(self.options.up);
        self.wish.up = Some(self.options.up);
        let pose = |pose: TabletopPose| TabletopPose {
            position_m: rotation * pose.position_m + translation_m,
            orientation: (rotation * pose.orientation).normalize(),
            ..pose
        };
        let all = |ground: &mut Ground, blend: &mut Blend| {
            ground.moved(rotation, translation_m);
            blend.shown = pose(blend.shown);
            blend.target = pose(blend.target);
        };
        match &mut self.phase {
            Phase::Standing { ground, grip, blend } => {
                all(ground, blend);
                regrip(grip, &self.rays, ground, &blend.target);
            }
            Phase::Choosing { preview: Some(Preview { ground, result: Ok(blend), viewer_m }), .. } => {
                all(ground, blend);
                *viewer_m = viewer_m.map(|viewer| rotation * viewer + translation_m);
            }
            Phase::Choosing { .. } => {}
        }
    }
}

/// Whether a runtime can mean these metres.
fn is_near(point_m: DVec3) -> bool {
    point_m.is_finite() && point_m.abs().max_element() < MOST_COORDINATE_M
}

/// Starts a grip anew from where everything is now.
fn regrip(grip: &mut Grip, rays: &[Option<Ray>; 2], ground: &Ground, pose: &TabletopPose) {
    let at = |pointer: Pointer| manipulate::on_ground(ground, rays[pointer as usize].as_ref()?);
    *grip = match *grip {
        Grip::None => Grip::None,
        Grip::Pressed { pointer, ray, .. } => {
            at(pointer).map_or(Grip::None, |at_m| Grip::Pressed { pointer, ray, at_m, start: *pose })
        }
        Grip::Drag { pointer, .. } => {
            at(pointer).map_or(Grip::None, |at_m| Grip::Drag { pointer, at_m, start: *pose })
        }
        Grip::Handle { pointer, .. } => {
            at(pointer).map_or(Grip::None, |at_m| Grip::Handle { pointer, at_m, start: *pose })
        }
        Grip::Both { .. } => match (at(Pointer::Left), at(Pointer::Right)) {
            (Some(left), Some(right)) => Grip::Both { at_m: [left, right], start: *pose },
            _ => Grip::None,
        },
    };
}
