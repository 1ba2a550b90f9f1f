//! Ten thousand random sequences of gestures and news: whatever happens, the match stays upright, on its plane and
//! within its limits.

use glam::{DQuat, DVec3};
use proptest::{
    prelude::*,
    strategy::ValueTree,
    test_runner::{RngSeed, TestRunner},
};

use super::{
    tests::{EYE, UP, surface},
    *,
};
use crate::placement::{PITCH_SCALE_LIMITS, SurfaceKind, fit::MOST_LEAN};

/// What happens next.
#[derive(Clone, Debug)]
enum Move {
    /// This.
    Event(Event),
    /// A pointer is aimed at the match that is shown: shares of its half turf along x and z, 1.06 being the handles.
    Aim(Pointer, f64, f64),
    /// A pointer is aimed at the corner with this index, of all outlines, mixed with the middle of its surface.
    AimAtSurface(Pointer, usize, f64),
}

/// A move and the milliseconds that pass before it.
type Step = (Move, u16);

/// The event of a move in the present state; `None` when there is nothing to aim at.
fn resolved(placement: &Placement, next: Move) -> Option<Event> {
    let eye = placement.viewer.map_or(EYE, |viewer| viewer.origin_m);
    let aimed = |pointer, at: DVec3| Event::Point(pointer, Ray { origin_m: eye, direction: at - eye });
    match next {
        Move::Event(event) => Some(event),
        Move::Aim(pointer, x, z) => {
            let pose = placement.shown().model?.pose;
            let half = placement.wish.half_turf_m;
            Some(aimed(pointer, pose.to_room(DVec3::new(x * half[0], 0.0, z * half[1]))))
        }
        Move::AimAtSurface(pointer, index, share) => {
            let surfaces: Vec<_> = placement.surfaces().collect();
            let surface = surfaces.get(index % surfaces.len().max(1))?;
            let corners = &surface.outline_m;
            let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
            Some(aimed(pointer, middle.lerp(corners[index % corners.len()], share)))
        }
    }
}

fn points() -> impl Strategy<Value = DVec3> {
    (-1.5..1.5_f64, prop_oneof![Just(0.75), Just(0.0), -0.2..2.0_f64], -1.5..1.5_f64)
        .prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

fn wild() -> impl Strategy<Value = f64> {
    prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(0.0), Just(-1e300), Just(1e12), -10.0..10.0_f64]
}

fn rays() -> impl Strategy<Value = Ray> {
    let eye = (-0.5..0.5_f64, -0.4..0.4_f64, -0.5..0.5_f64).prop_map(|p| EYE + DVec3::from(p));
    let aimed = (eye, points()).prop_map(|(origin_m, at)| Ray { origin_m, direction: at - origin_m });
    let nonsense = (wild(), wild(), wild())
        .prop_map(|(a, b, c)| Ray { origin_m: DVec3::new(a, b, 0.0), direction: DVec3::new(c, a, b) });
    prop_oneof![12 => aimed, 1 => nonsense]
}

fn surfaces() -> impl Strategy<Value = Vec<Surface>> {
    let kinds = [SurfaceKind::Table, SurfaceKind::Seat, SurfaceKind::Floor, SurfaceKind::Wall];
    let one = (
        0..4_u32,
        prop::sample::select(kinds.to_vec()),
        points(),
        -0.25..0.25_f64,
        0.05..1.5_f64,
        0.05..1.0_f64,
    );
    let one = one.prop_map(|(id, kind, middle, lean, x, z)| {
        let normal =
            if kind == SurfaceKind::Wall { DVec3::Z } else { DVec3::new(lean, 1.0, lean / 2.0).normalize() };
        surface(SurfaceId(id), kind, middle, normal, [x, z])
    });
    prop::collection::vec(one, 0..4)
}

/// One step in six is news or nonsense; the others are what hands do.
fn moves() -> impl Strategy<Value = Move> {
    let pointer = || prop_oneof![2 => Just(Pointer::Right), 1 => Just(Pointer::Left)];
    let small = || (-0.1..0.1_f64, -0.05..0.05_f64, -0.1..0.1_f64).prop_map(DVec3::from);
    let anywhere = || prop_oneof![3 => -0.9..0.9_f64, 1 => -3.0..3.0_f64, 2 => Just(1.06), 1 => Just(-1.06)];
    let hands = prop_oneof![
        8 => (pointer(), anywhere(), anywhere()).prop_map(|(pointer, x, z)| Move::Aim(pointer, x, z)),
        4 => (pointer(), any::<usize>(), -0.9..1.2_f64)
            .prop_map(|(pointer, index, share)| Move::AimAtSurface(pointer, index, share)),
        2 => (pointer(), rays()).prop_map(|(pointer, ray)| Move::Event(Event::Point(pointer, ray))),
        7 => pointer().prop_map(|pointer| Move::Event(Event::Press(pointer))),
        3 => pointer().prop_map(|pointer| Move::Event(Event::Release(pointer))),
    ];
    let news = prop_oneof![
        1 => pointer().prop_map(Event::PointAway),
        3 => surfaces().prop_map(Event::Surfaces),
        2 => rays().prop_map(Event::Viewer),
        1 => prop_oneof![-7.0..7.0_f64, wild()].prop_map(Event::Turn),
        1 => prop_oneof![0.1..4.0_f64, wild()].prop_map(Event::Scale),
        1 => Just(Event::TrackingLost),
        3 => Just(Event::TrackingFound),
        1 => Just(Event::Cancel),
        1 => (0..4_u32, points(), 0.0..6.0_f64).prop_map(|(generation, position_m, angle)| Event::AnchorMoved {
            generation,
            position_m,
            orientation: DQuat::from_rotation_y(angle),
        }),
        1 => (0.0..6.0_f64, small()).prop_map(|(angle, translation_m)| Event::RoomMoved {
            rotation: DQuat::from_rotation_y(angle),
            translation_m,
        }),
    ];
    prop_oneof![5 => hands, 1 => news.prop_map(Move::Event)]
}

fn check_model(pose: &TabletopPose) {
    assert!(pose.position_m.is_finite() && pose.orientation.is_finite(), "not finite: {pose:?}");
    assert!(pose.orientation.is_normalized(), "not a turn: {pose:?}");
    let [least, most] = PITCH_SCALE_LIMITS;
    assert!(pose.scale >= least * (1.0 - 1e-9) && pose.scale <= most * (1.0 + 1e-9), "size: {pose:?}");
}

fn check(placement: &Placement) {
    let shown = placement.shown();
    if let Some(model) = &shown.model {
        check_model(&model.pose);
        assert!((0.0..=1.0).contains(&model.opacity));
    }
    if let Some(id) = shown.highlighted {
        let surface = placement.surfaces.get(&id).expect("only what is known is highlighted");
        assert!(crate::placement::fit::can_hold_a_match(surface.kind));
    }
    assert!(placement.outputs.len() <= MOST_OUTPUTS);
    let Phase::Standing { ground, blend, .. } = &placement.phase else { return };
    assert_eq!(shown.highlighted, None, "nothing is highlighted while the match stands");
    check_model(&blend.target);
    let foot = blend.target.foot_m();
    assert!(
        ground.plane().distance_m(foot).abs() < 1e-6,
        "off its plane by {}",
        ground.plane().distance_m(foot)
    );
    assert!(blend.target.up().distance(ground.plane().normal) < 1e-6, "not square to its plane");
    assert!(blend.target.up().angle_between(placement.options.up) <= MOST_LEAN + 1e-6, "not upright");
}

/// Plays a sequence; how many of its steps found the match standing, and how many in somebody's hand.
fn play(options: Options, first: Vec<Surface>, steps: Vec<Step>) -> [usize; 2] {
    let mut placement = Placement::new(Pitch::default(), options);
    let mut now = Duration::ZERO;
    let mut seen = [0; 2];
    placement.handle(Event::Surfaces(first), now);
    for (next, passed) in steps {
        let Some(event) = resolved(&placement, next) else { continue };
        let passed = Duration::from_millis(passed.into());
        now += passed;
        let before = match &placement.phase {
            Phase::Standing { grip, blend, .. } => Some((*grip, *blend)),
            Phase::Choosing { .. } => None,
        };
        let rigid = matches!(event, Event::RoomMoved { .. });
        let pointed = matches!(event, Event::Point(..));
        placement.handle(event, now);
        check(&placement);
        if let Phase::Standing { ground, grip, blend } = &placement.phase {
            seen[0] += 1;
            let held = matches!(grip, Grip::Drag { .. } | Grip::Handle { .. } | Grip::Both { .. });
            let moved = pointed && held && before.is_some_and(|(_, old)| old.target != blend.target);
            seen[1] += usize::from(moved);
            if let (true, Grip::Drag { .. } | Grip::Both { .. }, Some(surface)) =
                (moved, grip, ground.surface())
            {
                let off = hover::off_outline_m(surface, blend.target.foot_m());
                assert!(off < 1e-6, "dragged over the edge by {off} m");
            }
        }
        if let (
            Some((Grip::None, old)),
            Phase::Standing { grip: Grip::None | Grip::Pressed { .. }, blend, .. },
            false,
        ) = (before, &placement.phase, rigid)
        {
            let moved = blend.shown.position_m.distance(old.shown.position_m);
            let allowed = blend::MOST_SPEED_M * passed.as_secs_f64() + 1e-5;
            assert!(moved <= allowed, "it jumped by {moved} m in {passed:?}");
        }
    }
    placement.advance(now + Duration::from_secs(60));
    placement.advance(now + Duration::from_secs(61));
    check(&placement);
    if let Phase::Standing { blend, .. } = &placement.phase {
        assert_eq!(blend.shown, blend.target, "it never comes to rest");
    }
    seen
}

fn sequences() -> impl Strategy<Value = (Options, Vec<Surface>, Vec<Step>)> {
    let options = prop_oneof![Just(Options::headset(UP)), Just(Options::mouse(UP))];
    let table = surface(SurfaceId(0), SurfaceKind::Table, DVec3::Y * 0.75, UP, [0.8, 0.45]);
    let first = prop_oneof![2 => Just(vec![table]), 1 => surfaces()];
    (options, first, prop::collection::vec((moves(), 0..200_u16), 1..32))
}

/// The sequences are worth something: in many of them a match stands and is moved by hand.
#[test]
fn random_gestures_place_and_move_the_match() {
    let mut runner = TestRunner::deterministic();
    let mut total = [0; 2];
    for _ in 0..500 {
        let (options, first, steps) = sequences().new_tree(&mut runner).unwrap().current();
        let seen = play(options, first, steps);
        total = [0, 1].map(|index| total[index] + usize::from(seen[index] > 0));
    }
    println!("of 500 sequences {} place the match, {} move it by hand", total[0], total[1]);
    assert!(total[0] > 150 && total[1] > 50, "{total:?}");
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 10_000,
        rng_seed: RngSeed::Fixed(1812),
        failure_persistence: None,
        ..Default::default()
    })]

    #[test]
    fn no_sequence_of_gestures_breaks_the_placement((options, first, steps) in sequences()) {
        play(options, first, steps);
    }
}
