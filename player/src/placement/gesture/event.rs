//! What goes into the placement and what comes out: gestures and news of the room, and what to show.

use glam::{DQuat, DVec3};

use crate::placement::{Surface, SurfaceId, TabletopPose, fit::Misfit};

/// Coordinates beyond this are a runtime's mistake, metres.
pub(super) const MOST_COORDINATE_M: f64 = 1e5;

/// A half line of the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts, metres.
    pub origin_m: DVec3,
    /// Any length but zero.
    pub direction: DVec3,
}

impl Ray {
    /// Whether it can be worked with; a runtime may report anything.
    pub(super) fn is_sound(&self) -> bool {
        let small = |v: DVec3| v.is_finite() && v.abs().max_element() < MOST_COORDINATE_M;
        small(self.origin_m) && small(self.direction) && self.direction.length_squared() > 1e-18
    }
}

/// A hand, a controller, or the mouse (which is a right hand).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pointer {
    /// The left one.
    Left,
    /// The right one.
    Right,
}

impl Pointer {
    /// The hand on the other side.
    pub(super) fn other(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// All surfaces that are known now; replaces the earlier ones.
    Surfaces(Vec<Surface>),
    /// The viewer's eye and the direction of sight.
    Viewer(Ray),
    /// A pointer points here.
    Point(Pointer, Ray),
    /// A pointer is gone (hand out of sight, mouse left the window); what it held it lets go.
    PointAway(Pointer),
    /// A pinch, trigger or button begins.
    Press(Pointer),
    /// It ends.
    Release(Pointer),
    /// Wheel or stick: turn by an angle in radians, counter-clockwise seen from above.
    Turn(f64),
    /// Wheel or stick: scale by a factor.
    Scale(f64),
    /// The room is followed again.
    TrackingFound,
    /// The room is not followed: what is shown may be anywhere.
    TrackingLost,
    /// The runtime corrected the pose of the anchor that [`Output::Anchor`] asked for.
    AnchorMoved {
        /// As in [`Output::Anchor`]; others are out of date and ignored.
        generation: u32,
        /// Where it is now, metres.
        position_m: DVec3,
        /// How it is turned now.
        orientation: DQuat,
    },
    /// The room frame itself moved (recentred): a point p has become `rotation` p + `translation_m`. Nothing moves
    /// for the viewer, so nothing is blended.
    RoomMoved {
        /// New from old.
        rotation: DQuat,
        /// New from old, metres.
        translation_m: DVec3,
    },
    /// Escape: undoes what is being dragged; otherwise lifts the match off again.
    Cancel,
}

/// Something that somebody outside may want to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Output {
    /// Another surface is highlighted, or none.
    Highlight(Option<SurfaceId>),
    /// The match stands, on a surface or in the air.
    Placed(Option<SurfaceId>),
    /// A match in the air came to stand on a surface.
    Landed(SurfaceId),
    /// Nothing can stand there.
    Refused(Misfit),
    /// Create an anchor with this pose and drop the one before; report it by [`Event::AnchorMoved`].
    Anchor {
        /// Counts up.
        generation: u32,
        /// Where.
        pose: TabletopPose,
    },
    /// The match was lifted off: drop the anchor.
    Lifted,
}

/// How the match is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// This is where it would stand.
    Preview,
    /// It stands or floats where it was put.
    Placed,
    /// It was put here, but the room is not followed now.
    Ghost,
}

/// The match as it is to be drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// Where.
    pub pose: TabletopPose,
    /// How.
    pub look: Look,
    /// 0..1; fades from one look to the next.
    pub opacity: f64,
    /// Whether there is a surface under it.
    pub floats: bool,
}

/// Everything that is to be shown of the placement.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shown {
    /// The one surface that is pointed at while a place is being chosen.
    pub highlighted: Option<SurfaceId>,
    /// The match.
    pub model: Option<Model>,
    /// Middles of the four handles at the corners of a match that stands, room metres.
    pub handles_m: Option<[DVec3; 4]>,
    /// Why the highlighted surface holds no match.
    pub misfit: Option<Misfit>,
}
