//! Where the match stands in the room of a headset: planes, hands and the head go into the placement, a pose comes out.
//!
//! Outlives sessions: after a loss the match stands where it stood, as far as the runtime's space is still the same.

use std::time::Duration;

use glam::{DQuat, DVec3};
use protocol::pitch::Pitch;

use super::{
    follow::Follow,
    input::HandState,
    room::{self, Rigid},
};
use crate::{
    placement::{
        Surface, SurfaceKind, TabletopPose,
        gesture::{Event, Options, Output, Placement, Pointer, Ray},
    },
    renderer::{Marks, RoomScene, Standing},
};

/// The placement with the memory of what the hands did.
pub(super) struct Table {
    placement: Placement,
    hands: [HandState; 2],
    /// Hands whose press began on something else: not ours until it ends.
    pressed_elsewhere: [bool; 2],
    surfaces: usize,
    /// Counts changes of what is known of the room.
    revision: u32,
    /// Where the match was drawn last.
    drawn: TabletopPose,
    /// Opacity in the last two frames.
    opacities: [Option<f64>; 2],
    /// The anchor that the placement wants.
    anchor: Option<u32>,
}

impl Table {
    pub(super) fn new(pitch: Pitch) -> Self {
        Self {
            placement: Placement::new(pitch, Options::headset(room::UP)),
            hands: [HandState::default(); 2],
            pressed_elsewhere: [false; 2],
            surfaces: 0,
            revision: 1,
            drawn: room::before_the_user(),
            opacities: [None; 2],
            anchor: None,
        }
    }

    /// News of the room. The first table is taken at once when `at_once`: a script has no hands.
    pub(super) fn know(&mut self, surfaces: Vec<Surface>, at_once: bool, now: Duration) {
        tracing::info!("the room has {} planes", surfaces.len());
        self.surfaces = surfaces.len();
        self.revision = self.revision.wrapping_add(1);
        let table =
            surfaces.iter().find(|surface| surface.kind == SurfaceKind::Table).map(|surface| surface.id);
        self.placement.handle(Event::Surfaces(surfaces), now);
        if let (true, Some(table), None) = (at_once, table, self.placement.standing())
            && let Err(misfit) = self.placement.place_on(table, now)
        {
            tracing::warn!("{misfit}");
        }
    }

    /// Head and hands of a frame. A hand in `elsewhere` points at something else: it lets go unless it is dragging. A match that
    /// stands is drawn `slide_m` away from where it is placed, and pointed at there.
    pub(super) fn follow(
        &mut self,
        (head_m, head): (DVec3, DQuat),
        hands: [HandState; 2],
        elsewhere: [bool; 2],
        slide_m: DVec3,
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
                    let slide_m = if self.is_placed() { slide_m } else { DVec3::ZERO };
                    let ray = Ray { origin_m: origin_m - slide_m, direction };
                    self.placement.handle(Event::Point(pointer, ray), now);
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
                Output::Anchor { generation, .. } => self.anchor = Some(generation),
                Output::Lifted => self.anchor = None,
                Output::Highlight(_) => {}
            }
        }
        let model = self.placement.shown().model;
        self.opacities = [self.opacities[1], model.map(|model| model.opacity)];
        if let Some(model) = model {
            self.drawn = model.pose;
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
        self.revision = self.revision.wrapping_add(1);
    }

    /// The anchor that is wanted: its number, and where the match is to stand.
    pub(super) fn anchor(&self) -> Option<(u32, Rigid)> {
        let (pose, _) = self.placement.standing()?;
        Some((self.anchor?, (pose.position_m, pose.orientation)))
    }

    /// The runtime knows better where that anchor is.
    pub(super) fn anchor_moved(&mut self, generation: u32, (position_m, orientation): Rigid, now: Duration) {
        self.placement.handle(Event::AnchorMoved { generation, position_m, orientation }, now);
    }

    /// Where the match is drawn or was last, before the ball is followed.
    pub(super) fn pose(&self) -> TabletopPose {
        self.drawn
    }

    /// Whether somebody has put the match somewhere; otherwise a place is being chosen.
    pub(super) fn is_placed(&self) -> bool {
        self.placement.standing().is_some()
    }

    /// Whether the match has come to rest where it was placed, or the preview has faded in.
    pub(super) fn is_settled(&self) -> bool {
        if self.is_placed() {
            return self.placement.wakes_at().is_none_or(|at| at > self.placement.now());
        }
        self.opacities[0] == self.opacities[1]
    }

    /// Changes with everything that is known of the room's surfaces.
    pub(super) fn revision(&self) -> u32 {
        self.revision
    }

    /// What is known of the room's surfaces.
    pub(super) fn surfaces(&self) -> impl Iterator<Item = &Surface> {
        self.placement.surfaces()
    }

    /// Why the surface that is pointed at holds no match.
    pub(super) fn hint(&self) -> Option<String> {
        self.placement.shown().misfit.map(|misfit| misfit.to_string())
    }

    /// What is to be drawn: the match, slid by what follows the ball once it is placed, and the marks.
    pub(super) fn scene(&self, follow: &Follow) -> RoomScene<'_> {
        let shown = self.placement.shown();
        let surface = |id| self.placement.surfaces().find(|surface| surface.id == id);
        let placed = self.placement.standing();
        let slid = |pose: &TabletopPose| if placed.is_some() { follow.applied(pose) } else { *pose };
        let standing = shown.model.map(|model| {
            let under = placed.map_or(shown.highlighted, |(_, id)| id).filter(|_| !model.floats);
            Standing { pose: slid(&model.pose), opacity: model.opacity, on: under.and_then(surface) }
        });
        let highlighted = shown.highlighted.and_then(surface);
        let handles = shown.handles_m.zip(shown.model).map(|(places_m, model)| {
            let pose = slid(&model.pose);
            (places_m.map(|place| place + pose.position_m - model.pose.position_m), pose)
        });
        let marks = Marks {
            highlighted: highlighted.map(|surface| (surface.clone(), shown.misfit.is_none())),
            handles,
        };
        RoomScene { standing, marks }
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
            table.follow(head, hands, elsewhere, DVec3::ZERO, Duration::from_millis(at));
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

    /// Pointing highlights one surface and previews on it; placing shows handles; losing the room makes a ghost.
    #[test]
    fn what_is_drawn_follows_the_placement() {
        let place = DVec3::new(0.0, -0.5, -1.0);
        let head = (DVec3::ZERO, DQuat::from_rotation_x(-0.45));
        let ray = Some((DVec3::ZERO, place.normalize()));
        let mut table = Table::new(Pitch::default());
        let follow = Follow::default();
        let mut at = 0;
        let mut steps = |table: &mut Table, hand: HandState, count: u64| {
            for _ in 0..count {
                at += 20;
                let hands = [HandState::default(), hand];
                table.follow(head, hands, [false; 2], DVec3::ZERO, Duration::from_millis(at));
            }
        };
        let hand = |ray, select| HandState { ray, select, squeeze: false };
        steps(&mut table, hand(None, false), 50);
        let scene = table.scene(&follow);
        assert!(scene.marks == Marks::default() && scene.standing.is_some_and(|match_| match_.on.is_none()));
        let before = table.revision();
        table.know(vec![table_at(place)], false, Duration::from_millis(1000));
        assert_ne!(table.revision(), before);
        steps(&mut table, hand(ray, false), 100);
        let scene = table.scene(&follow);
        assert!(
            scene
                .marks
                .highlighted
                .as_ref()
                .is_some_and(|(surface, takes)| surface.id == SurfaceId(3) && *takes)
        );
        let preview = scene.standing.unwrap();
        assert!(
            preview.on.is_some() && (preview.opacity - 0.65).abs() < 1e-9 && scene.marks.handles.is_none()
        );
        assert!(table.is_settled());
        steps(&mut table, hand(ray, true), 2);
        assert!(!table.is_settled());
        steps(&mut table, hand(ray, false), 100);
        let scene = table.scene(&follow);
        assert!(scene.marks.highlighted.is_none() && scene.marks.handles.is_some());
        assert_eq!(scene.standing.map(|match_| match_.opacity), Some(1.0));
        assert!(table.is_settled());
        table.tracked(false, Duration::from_secs(6));
        steps(&mut table, HandState::default(), 100);
        let scene = table.scene(&follow);
        assert!(scene.marks.handles.is_none());
        assert!(scene.standing.is_some_and(|match_| (match_.opacity - 0.35).abs() < 1e-9));
    }

    /// Controllers point all the time, also the one that lies beside the user: the other one's preview stands.
    #[test]
    fn a_second_controller_that_points_at_nothing_disturbs_no_preview() {
        let place = DVec3::new(0.0, -0.5, -1.0);
        let head = (DVec3::ZERO, DQuat::from_rotation_x(-0.45));
        let hand = |ray| HandState { ray: Some((DVec3::ZERO, ray)), ..HandState::default() };
        let mut table = Table::new(Pitch::default());
        table.know(vec![table_at(place)], false, Duration::ZERO);
        for hands in [[DVec3::Y, place.normalize()], [place.normalize(), DVec3::Y]] {
            for step in 0..100 {
                let now = Duration::from_millis(20 * step);
                table.follow(head, hands.map(hand), [false; 2], DVec3::ZERO, now);
            }
            let scene = table.scene(&Follow::default());
            assert!(scene.standing.is_some_and(|match_| match_.on.is_some() && match_.opacity > 0.6));
        }
    }

    #[test]
    fn a_slid_match_is_pointed_at_where_it_is_drawn() {
        let place = DVec3::new(0.0, -0.5, -1.0);
        let slide_m = DVec3::new(0.3, 0.0, 0.0);
        let mut table = Table::new(Pitch::default());
        table.know(vec![table_at(place)], true, Duration::ZERO);
        let head = (DVec3::ZERO, DQuat::from_rotation_x(-0.45));
        let drag = |at_m: DVec3| HandState { ray: Some((DVec3::ZERO, at_m)), select: true, squeeze: false };
        let start = table.placement.standing().unwrap().0;
        // Beyond the right end of the placed turf, on the slid one.
        let take_m = start.position_m + slide_m * 0.98 + DVec3::X * (start.scale * 52.0);
        for (step, shift) in [0.0, -0.03, -0.06].into_iter().enumerate() {
            let mut hand = drag(take_m + DVec3::X * shift);
            for select in [step > 0, true] {
                hand.select = select;
                let now = Duration::from_millis(100 + 40 * step as u64 + u64::from(select));
                table.follow(head, [HandState::default(), hand], [false; 2], slide_m, now);
            }
        }
        let moved = table.placement.standing().unwrap().0.position_m - start.position_m;
        assert!((moved.x + 0.06).abs() < 0.01 && moved.z.abs() < 1e-6, "{moved}");
    }

    /// A corrected anchor moves the match by steps that the eye follows; a moved frame moves nothing for the viewer.
    #[test]
    fn corrections_glide_and_recentring_is_not_seen() {
        let place = DVec3::new(0.0, -0.5, -1.0);
        let mut table = Table::new(Pitch::default());
        table.know(vec![table_at(place)], true, Duration::ZERO);
        let mut head = (DVec3::ZERO, DQuat::from_rotation_x(-0.45));
        let mut at = 0;
        let mut step = |table: &mut Table, head| {
            at += 11;
            table.follow(head, [HandState::default(); 2], [false; 2], DVec3::ZERO, Duration::from_millis(at));
            Duration::from_millis(at)
        };
        for _ in 0..200 {
            step(&mut table, head);
        }
        let (generation, (was_m, turned)) = table.anchor().expect("an anchor is wanted");
        let now = step(&mut table, head);
        table.anchor_moved(generation, (was_m + DVec3::X * 0.05, turned), now);
        let mut before = table.pose().position_m;
        for _ in 0..200 {
            step(&mut table, head);
            let moved = table.pose().position_m.distance(before);
            assert!(moved < 0.5 * 0.011 + 1e-6, "{moved} m in one frame");
            before = table.pose().position_m;
        }
        assert!(before.distance(was_m + DVec3::X * 0.05) < 1e-6);
        let origin = (DVec3::new(0.4, 0.0, 0.3), DQuat::from_rotation_y(0.8));
        let seen = room::compose(room::inverse(head), (before, table.pose().orientation));
        let now = step(&mut table, head);
        table.recentred(origin.0, origin.1, now);
        head = room::compose(room::inverse(origin), head);
        step(&mut table, head);
        let pose = table.pose();
        let sees = room::compose(room::inverse(head), (pose.position_m, pose.orientation));
        assert!(sees.0.distance(seen.0) < 1e-9 && sees.1.angle_between(seen.1) < 1e-6, "{sees:?} {seen:?}");
    }

    #[test]
    fn a_script_needs_no_hands() {
        let mut table = Table::new(Pitch::default());
        table.know(vec![table_at(DVec3::new(0.0, -0.5, -1.0))], true, Duration::ZERO);
        assert_eq!(table.stands(), (1, true));
    }
}
