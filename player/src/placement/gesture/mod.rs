//! Placing the match by hand: look or point at a surface, see where the pitch would stand, select, and move it about.
//!
//! A state machine without I/O or clock: events go in with the time at which they happened, and [`Placement::shown`]
//! and [`Placement::poll_output`] say what to draw and do. Headset and mouse drive the same machine.

mod blend;
mod choosing;
mod event;
mod float;
mod hands;
mod hover;
mod manipulate;
mod news;
mod stand;

pub use event::{Event, Look, Model, Output, Pointer, Ray, Shown};

use std::{
    collections::{BTreeMap, VecDeque},
    time::Duration,
};

use glam::DVec3;
use protocol::pitch::Pitch;

use super::{
    Surface, SurfaceId, TabletopPose,
    fit::{Facing, Misfit, Wish, fit},
};
use blend::Blend;
use manipulate::Grip;
use stand::Ground;

/// Opacity of the three looks.
const PREVIEW_OPACITY: f64 = 0.65;
const GHOST_OPACITY: f64 = 0.35;
/// An anchor is asked for when the match has been left alone this long: a turning wheel must not make a hundred.
const ANCHOR_AFTER: Duration = Duration::from_millis(400);
/// Outputs kept for somebody who does not ask for them.
const MOST_OUTPUTS: usize = 64;
/// Wheel and stick: the least and most factor of one event.
const FACTOR_LIMITS: [f64; 2] = [0.2, 5.0];

/// What placing is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Against gravity, unit length.
    pub up: DVec3,
    /// Which way the pitch lies.
    pub facing: Facing,
    /// Without a pointer the viewer's look points.
    pub gaze: bool,
    /// The match may float in front of the viewer before a surface is known.
    pub instant: bool,
}

impl Options {
    /// For a headset: the gaze points, the match can float.
    #[must_use]
    pub fn headset(up: DVec3) -> Self {
        Self { up, facing: Facing::LongerSide, gaze: true, instant: true }
    }

    /// For a mouse over a picture.
    #[must_use]
    pub fn mouse(up: DVec3) -> Self {
        Self { up, facing: Facing::LongerSide, gaze: false, instant: false }
    }
}

#[derive(Clone, Debug)]
enum Phase {
    /// Looking for a place; the preview is drawn at `blend`.
    Choosing { highlighted: Option<SurfaceId>, preview: Option<Preview> },
    /// Put somewhere.
    Standing { ground: Ground, grip: Grip, blend: Blend },
}

/// Where the match would stand.
#[derive(Clone, Debug)]
struct Preview {
    /// On this surface as it is known; in the air without one.
    ground: Ground,
    result: Result<Blend, Misfit>,
    viewer_m: Option<DVec3>,
}

/// The state of placing.
#[derive(Clone, Debug)]
pub struct Placement {
    options: Options,
    wish: Wish,
    surfaces: BTreeMap<SurfaceId, Surface>,
    viewer: Option<Ray>,
    /// Left and right; and which one means the place while one is chosen.
    rays: [Option<Ray>; 2],
    active: Pointer,
    followed: bool,
    phase: Phase,
    generation: u32,
    anchor_due: Option<Duration>,
    outputs: VecDeque<Output>,
    now: Duration,
}

impl Placement {
    /// Nothing is known and nothing stands.
    #[must_use]
    pub fn new(pitch: Pitch, options: Options) -> Self {
        let wish = Wish { facing: options.facing, up: Some(options.up), ..Wish::of(pitch) };
        Self {
            options,
            wish,
            surfaces: BTreeMap::new(),
            viewer: None,
            rays: [None; 2],
            active: Pointer::Right,
            followed: true,
            phase: Phase::Choosing { highlighted: None, preview: None },
            generation: 0,
            anchor_due: None,
            outputs: VecDeque::new(),
            now: Duration::ZERO,
        }
    }

    /// Puts the match on a surface without a gesture, as large as it fits; a program that needs no hand uses this.
    ///
    /// # Errors
    /// Why it does not fit. A surface that is not known counts as one of unknown kind.
    pub fn place_on(&mut self, id: SurfaceId, now: Duration) -> Result<TabletopPose, Misfit> {
        self.advance(now);
        let unknown = Misfit::Kind(super::SurfaceKind::Other);
        let surface = self.surfaces.get(&id).ok_or(unknown)?;
        let pose = fit(surface, &self.wish())?;
        let ground = Ground::Surface(Box::new(surface.clone()));
        self.stand(ground, Blend::at(pose));
        Ok(pose)
    }

    /// Takes note of something that happened at `now`. Time that runs backwards stands still.
    pub fn handle(&mut self, event: Event, now: Duration) {
        self.advance(now);
        match event {
            Event::Surfaces(surfaces) => self.know(surfaces),
            Event::Viewer(ray) if ray.is_sound() => {
                self.viewer = Some(ray);
                self.choose();
            }
            Event::Point(pointer, ray) if ray.is_sound() => self.point(pointer, ray),
            Event::PointAway(pointer) => {
                self.rays[pointer as usize] = None;
                self.release(pointer);
                self.choose();
            }
            Event::Press(pointer) if self.followed => self.press(pointer),
            Event::Release(pointer) => self.release(pointer),
            Event::Turn(angle) if angle.is_finite() => self.adjust(angle, 1.0),
            Event::Scale(factor) if factor > 0.0 => {
                self.adjust(0.0, factor.clamp(FACTOR_LIMITS[0], FACTOR_LIMITS[1]));
            }
            Event::TrackingLost => self.follow(false),
            Event::TrackingFound => self.follow(true),
            Event::AnchorMoved { generation, position_m, orientation } => {
                self.anchor_moved(generation, position_m, orientation);
            }
            Event::RoomMoved { rotation, translation_m } => self.room_moved(rotation, translation_m),
            Event::Cancel => self.cancel(),
            // Not a number, or a press while the room is not followed.
            Event::Viewer(_) | Event::Point(..) | Event::Press(_) | Event::Turn(_) | Event::Scale(_) => {}
        }
    }

    /// Lets time pass.
    pub fn advance(&mut self, now: Duration) {
        let passed = now.saturating_sub(self.now);
        self.now = self.now.max(now);
        let (blend, opacity, held) = match &mut self.phase {
            Phase::Choosing { preview: Some(Preview { result: Ok(blend), .. }), .. } => {
                (blend, PREVIEW_OPACITY, false)
            }
            Phase::Choosing { .. } => return,
            Phase::Standing { blend, grip, .. } => {
                (blend, if self.followed { 1.0 } else { GHOST_OPACITY }, *grip != Grip::None)
            }
        };
        blend.fade_to(opacity);
        blend.advance(passed);
        if !held && self.anchor_due.is_some_and(|due| due <= self.now) {
            self.anchor_due = None;
            self.generation = self.generation.wrapping_add(1);
            let anchor = Output::Anchor { generation: self.generation, pose: blend.target };
            self.say(anchor);
        }
    }

    /// The next thing to do, in order; ask until there is none.
    pub fn poll_output(&mut self) -> Option<Output> {
        self.outputs.pop_front()
    }

    /// When [`Self::advance`] should be called again although nothing happens; `None` when all is still.
    #[must_use]
    pub fn wakes_at(&self) -> Option<Duration> {
        let moving = match &self.phase {
            Phase::Choosing { preview: Some(Preview { result: Ok(blend), .. }), .. }
            | Phase::Standing { blend, .. } => blend.is_moving(),
            Phase::Choosing { .. } => false,
        };
        if moving { Some(self.now) } else { self.anchor_due }
    }

    /// The time of the last event.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.now
    }

    /// What to draw.
    #[must_use]
    pub fn shown(&self) -> Shown {
        match &self.phase {
            Phase::Choosing { highlighted, preview } => {
                let model = preview.as_ref().and_then(|preview| {
                    let blend = preview.result.as_ref().ok()?;
                    let floats = preview.ground.surface().is_none();
                    Some(Model { pose: blend.shown, look: Look::Preview, opacity: blend.opacity(), floats })
                });
                let misfit = preview.as_ref().and_then(|preview| preview.result.as_ref().err().copied());
                Shown { highlighted: *highlighted, model, handles_m: None, misfit }
            }
            Phase::Standing { ground, blend, .. } => Shown {
                highlighted: None,
                model: Some(Model {
                    pose: blend.shown,
                    look: if self.followed { Look::Placed } else { Look::Ghost },
                    opacity: blend.opacity(),
                    floats: ground.surface().is_none(),
                }),
                handles_m: self.followed.then(|| manipulate::handles(&blend.shown, self.wish.half_turf_m)),
                misfit: None,
            },
        }
    }

    /// Where the match is to stand once it has stopped moving, and on what; `None` before it was placed.
    #[must_use]
    pub fn standing(&self) -> Option<(TabletopPose, Option<SurfaceId>)> {
        match &self.phase {
            Phase::Standing { ground, blend, .. } => {
                Some((blend.target, ground.surface().map(|surface| surface.id)))
            }
            Phase::Choosing { .. } => None,
        }
    }

    /// The surfaces that are known.
    pub fn surfaces(&self) -> impl Iterator<Item = &Surface> {
        self.surfaces.values()
    }

    fn wish(&self) -> Wish {
        Wish { viewer_m: self.viewer.map(|viewer| viewer.origin_m), ..self.wish }
    }

    fn say(&mut self, output: Output) {
        if self.outputs.len() == MOST_OUTPUTS {
            self.outputs.pop_front();
        }
        self.outputs.push_back(output);
    }

    fn stand(&mut self, ground: Ground, blend: Blend) {
        if let Phase::Choosing { highlighted: Some(_), .. } = self.phase {
            self.say(Output::Highlight(None));
        }
        self.say(Output::Placed(ground.surface().map(|surface| surface.id)));
        self.anchor_due = Some(self.now + ANCHOR_AFTER);
        self.phase = Phase::Standing { ground, grip: Grip::None, blend };
    }
}

#[cfg(test)]
mod random;
#[cfg(test)]
mod tests;
