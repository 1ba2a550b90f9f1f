//! Planes through XR_EXT_plane_detection: a detection is started about once a second and asked after every frame.

use std::{collections::BTreeMap, time::Duration};

use openxr::{Session, Space, Time, Vulkan};

use super::{RuntimePlanes, surfaces};
use crate::{
    placement::{PlaneSource, Surface, SurfaceId},
    xr::{
        XrError,
        ffi::planes::{DetectedPlane, PlaneDetector},
    },
};

/// Between two detections.
const EVERY: Duration = Duration::from_secs(1);

/// A running source.
pub(super) struct DetectedPlanes {
    detector: PlaneDetector<Vulkan>,
    space: Space,
    time: Time,
    begun_at: Option<Duration>,
    pending: bool,
    ids: BTreeMap<u64, SurfaceId>,
    known: Vec<Surface>,
}

impl DetectedPlanes {
    /// A source on a session; `None` when the headset detects no planes. `space` is the room's frame.
    pub(super) fn new(session: &Session<Vulkan>, space: Space) -> Result<Option<Self>, XrError> {
        Ok(PlaneDetector::new(session)?.map(|detector| Self {
            detector,
            space,
            time: Time::from_nanos(0),
            begun_at: None,
            pending: false,
            ids: BTreeMap::new(),
            known: Vec::new(),
        }))
    }

    fn ask(&mut self, now: Duration) -> Result<Option<Vec<DetectedPlane>>, XrError> {
        if self.pending {
            let found = self.detector.found(&self.space, self.time)?;
            self.pending = found.is_none();
            return Ok(found);
        }
        if self.begun_at.is_none_or(|begun| now.saturating_sub(begun) >= EVERY) {
            self.begun_at = Some(now);
            self.detector.begin(&self.space, self.time)?;
            self.pending = true;
        }
        Ok(None)
    }
}

impl RuntimePlanes for DetectedPlanes {
    fn set_time(&mut self, time: Time) {
        self.time = time;
    }
}

impl PlaneSource for DetectedPlanes {
    fn name(&self) -> &str {
        "XR_EXT_plane_detection"
    }

    fn poll(&mut self, now: Duration) -> Option<Vec<Surface>> {
        let planes = match self.ask(now) {
            Ok(planes) => planes?,
            Err(error) => {
                tracing::warn!("planes: {error}");
                self.pending = false;
                return None;
            }
        };
        let surfaces = surfaces(&planes, &mut self.ids);
        let changed = surfaces != self.known;
        self.known.clone_from(&surfaces);
        changed.then_some(surfaces)
    }
}
