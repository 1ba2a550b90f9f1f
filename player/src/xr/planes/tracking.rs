//! Planes through XR_EXT_spatial_plane_tracking: a discovery is started when the runtime recommends one, and every few seconds.

use std::{collections::BTreeMap, time::Duration};

use openxr::{Session, Space, SystemId, Time, Vulkan};

use super::{RuntimePlanes, surfaces};
use crate::{
    placement::{PlaneSource, Surface, SurfaceId},
    xr::{
        XrError,
        ffi::{planes::DetectedPlane, spatial_planes::PlaneTracker},
    },
};

/// Between two discoveries that nobody recommended.
const EVERY: Duration = Duration::from_secs(2);

/// A running source.
pub(super) struct TrackedPlanes {
    tracker: PlaneTracker<Vulkan>,
    space: Space,
    time: Time,
    begun_at: Option<Duration>,
    recommended: bool,
    pending: bool,
    ids: BTreeMap<u64, SurfaceId>,
    known: Vec<Surface>,
}

impl TrackedPlanes {
    /// A source on a session; `None` when the headset tracks no planes. `space` is the room's frame.
    pub(super) fn new(
        session: &Session<Vulkan>,
        system: SystemId,
        space: Space,
    ) -> Result<Option<Self>, XrError> {
        Ok(PlaneTracker::new(session, system)?.map(|tracker| Self {
            tracker,
            space,
            time: Time::from_nanos(0),
            begun_at: None,
            recommended: false,
            pending: false,
            ids: BTreeMap::new(),
            known: Vec::new(),
        }))
    }

    fn ask(&mut self, now: Duration) -> Result<Option<Vec<DetectedPlane>>, XrError> {
        if self.pending {
            let found = self.tracker.found(&self.space, self.time)?;
            self.pending = found.is_none();
            return Ok(found);
        }
        let is_time = self.begun_at.is_none_or(|begun| now.saturating_sub(begun) >= EVERY);
        // Not before the context is there.
        if (self.recommended || is_time) && self.tracker.begin()? {
            (self.begun_at, self.recommended, self.pending) = (Some(now), false, true);
        }
        Ok(None)
    }
}

impl RuntimePlanes for TrackedPlanes {
    fn set_time(&mut self, time: Time) {
        self.time = time;
    }

    fn look(&mut self) {
        self.recommended = true;
    }
}

impl PlaneSource for TrackedPlanes {
    fn name(&self) -> &str {
        "XR_EXT_spatial_plane_tracking"
    }

    fn poll(&mut self, now: Duration) -> Option<Vec<Surface>> {
        let planes = match self.ask(now) {
            Ok(planes) => planes?,
            Err(error) => {
                tracing::warn!("planes: {error}");
                // Not again in the next frame.
                (self.begun_at, self.recommended, self.pending) = (Some(now), false, false);
                return None;
            }
        };
        let surfaces = surfaces(&planes, &mut self.ids);
        let changed = surfaces != self.known;
        self.known.clone_from(&surfaces);
        changed.then_some(surfaces)
    }
}
