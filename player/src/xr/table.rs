//! Where the match stands in the room of a headset: planes, hands and the head go into the placement, a pose comes out.
//!
//! Outlives sessions: after a loss the match stands where it stood, as far as the runtime's space is still the same.

use std::time::Duration;

use glam::{DQuat, DVec3};
use protocol::pitch::Pitch;

use super::{input::HandState, room};
use crate::placement::{
    Surface, SurfaceKind, TabletopPose,
    gesture::{Event, Options, Output, Placement, Pointer, Ray},
};

/// The placement with the memory of what the hands did.
pub(super) struct Table {
    placement: Placement,
    hands: [HandState; 2],
    /// Hands whose press began on something else: not ours until it ends.
    pressed_elsewhere: [bool; 2],
    surfaces: usize,
    /// Where a match nobody has placed is drawn.
    floating: TabletopPose,
}

impl Table {
    pub(super) fn new(pitch: Pitch) -> Self {
        Self {
            placement: Placement::new(pitch, Options::headset(room::UP)),
            hands: [HandState::default(); 2],
            pressed_elsewhere: [false; 2],
            surfaces: 0,
            floating: room::before_the_user(),
        }
    }

    /// News of the room. The first table is taken at once when `at_once`: a script has no hands.
    pub(super) fn know(&mut self, surfaces: Vec<Surface>, at_once: bool, now: Duration) {
        tracing::info!("the room has {} planes", surfaces.len());
        self.surfaces = surfaces.len();
        let table =
            surfaces.iter().find(|surface| surface.kind == SurfaceKind::Table).map(|surface| surface.id);
        self.placement.handle(Event::Surfaces(surfaces), now);
        if let (true, Some(table), None) = (at_once, table, self.placement.standing())
            && let Err(misfit) = self.placement.place_on(table, now)
        {
            tracing::warn!("{misfit}");
        }
    }

    /// Head and hands of a frame. A hand in `elsewhere` points at something else: it lets go unless it is dragging.
    pub(super) fn follow(
        &mut self,
        (head_m, head): (DVec3, DQuat),
        hands: [HandState; 2],
        elsewhere: [bool; 2],
        now: Duration,
    ) {
        self.placement.advance(now);
        self.placement.handle(Event::Viewer(Ray { origin_m: head_m, direction: head * DVec3::NEG_Z }), now);
        for (index, pointer) in [(0, Pointer::Left), (1, Pointer::Right)] {
            let (before, is) = (self.hands[index], hands[index]);
            let begins_elsewhere = elsewhere[index] && !before.select;
            let pressed_elsewhere = is.select && (self.pressed_elsewhere[index] || begins_elsewhere);
            self.pressed_elsewhere[index] = pressed_elsewhere;
            let away = pressed_elsewhere || begins_elsewhere;
            let state = if away { HandState::default() } else { is };
            match state.ray {
                Some((origin_m, direction)) => {
                    self.placement.handle(Event::Point(pointer, Ray { origin_m, direction }), now);
                }
                None if before.ray.is_some() => self.placement.handle(Event::PointAway(pointer), now),
                None => {}
            }
            match (before.select, state.select) {
                (false, true) => self.placement.handle(Event::Press(pointer), now),
                (true, false) => self.placement.handle(Event::Release(pointer), now),
                _ => {}
            }
            if state.squeeze && !before.squeeze {
                self.placement.handle(Event::Cancel, now);
            }
            self.hands[index] = state;
        }
        while let Some(output) = self.placement.poll_output() {
            match output {
                Output::Placed(surface) => tracing::info!("the match stands on {surface:?}"),
                Output::Landed(surface) => tracing::info!("the match came to stand on {surface:?}"),
                Output::Refused(misfit) => tracing::warn!("{misfit}"),
                Output::Highlight(_) | Output::Anchor { .. } | Output::Lifted => {}
            }
        }
    }

    /// The room is seen, or not.
    pub(super) fn tracked(&mut self, tracked: bool, now: Duration) {
        self.placement.handle(if tracked { Event::TrackingFound } else { Event::TrackingLost }, now);
    }

    /// The room frame has moved: where its new origin is in the old frame, and how it is turned there.
    pub(super) fn recentred(&mut self, place_m: DVec3, turn: DQuat, now: Duration) {
        let rotation = turn.inverse();
        self.placement.handle(Event::RoomMoved { rotation, translation_m: rotation * -place_m }, now);
    }

    /// Where the match is drawn.
    pub(super) fn pose(&self) -> TabletopPose {
        self.placement.shown().model.map_or(self.floating, |model| model.pose)
    }

    /// Planes known, and whether the match stands on one.
    pub(super) fn stands(&self) -> (usize, bool) {
        let on_a_plane = self.placement.standing().is_some_and(|(_, surface)| surface.is_some());
        (self.surfaces, on_a_plane)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::placement::{Plane, SurfaceId};

    fn table_at(place: DVec3) -> Surface {
        let corner = |x: f64, z: f64| place + DVec3::new(x, 0.0, z);
        Surface {
            id: SurfaceId(3),
            kind: SurfaceKind::Table,
            plane: Plane::through(place, DVec3::Y),
            outline_m: vec![corner(-0.6, 0.4), corner(0.6, 0.4), corner(0.6, -0.4), corner(-0.6, -0.4)],
            obstacles_m: Vec::new(),
            confidence: 1.0,
        }
    }

    #[test]
    fn a_trigger_puts_the_match_on_the_table_and_one_on_the_panel_does_not() {
        let place = DVec3::new(0.0, -0.5, -1.0);
        let head = (DVec3::ZERO, DQuat::from_rotation_x(-0.45));
        let ray = Some((DVec3::ZERO, place.normalize()));
        let hand = |select| [HandState::default(), HandState { ray, select, squeeze: false }];
        let mut table = Table::new(Pitch::default());
        let mut at = 0;
        let mut step = |table: &mut Table, hands, elsewhere| {
            at += 20;
            table.follow(head, hands, elsewhere, Duration::from_millis(at));
        };
        table.know(vec![table_at(place)], false, Duration::ZERO);
        step(&mut table, hand(false), [false; 2]);
        step(&mut table, hand(true), [false, true]);
        step(&mut table, hand(false), [false, true]);
        assert_eq!(table.stands(), (1, false));
        // Pressed on the panel, slid off it, let go.
        step(&mut table, hand(true), [false, true]);
        step(&mut table, hand(true), [false; 2]);
        step(&mut table, hand(false), [false; 2]);
        assert_eq!(table.stands(), (1, false));
        step(&mut table, hand(true), [false; 2]);
        step(&mut table, hand(false), [false; 2]);
        assert_eq!(table.stands(), (1, true));
        for _ in 0..200 {
            step(&mut table, [HandState::default(); 2], [false; 2]);
        }
        // The grass is a turf's thickness above the table.
        let grass_m = table.pose().position_m.y - place.y;
        assert!((0.0..0.02).contains(&grass_m), "{grass_m}");
        assert!(table.pose().up().distance(DVec3::Y) < 1e-9);
    }

    #[test]
    fn a_script_needs_no_hands() {
        let mut table = Table::new(Pitch::default());
        table.know(vec![table_at(DVec3::new(0.0, -0.5, -1.0))], true, Duration::ZERO);
        assert_eq!(table.stands(), (1, true));
    }
}
