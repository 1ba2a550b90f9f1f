//! What the runtime of the tests lacks: a room that is seen, and a user who recentres.
//!
//! `FAKEPLANES_BLEND_MODE` (`alpha` or `additive`) stands for what the headset offers; the runtime below gets `OPAQUE`. After
//! as many frames as `FAKEPLANES_RECENTRE_AFTER` says the LOCAL space moves half a metre to the right and turns, once: the
//! event says so, and all views are told in the new frame from then on.

use std::{
    mem::transmute,
    sync::{
        Mutex,
        atomic::{AtomicU64, Ordering},
    },
};

use openxr_sys::{
    EnvironmentBlendMode, EventDataBuffer, EventDataReferenceSpaceChangePending, FrameEndInfo, Handle as _,
    Instance, Posef, Quaternionf, ReferenceSpaceType, Result, Session, SystemId, TRUE, Time, Vector3f, View,
    ViewConfigurationType, ViewLocateInfo, ViewState, pfn,
};

use crate::{
    layer::{below, instance},
    snapshots, spatial,
};

/// Where LOCAL goes, in its old frame: half a metre to the right, turned by 0.4 radians about y.
const RECENTRED: Posef = Posef {
    orientation: Quaternionf { x: 0.0, y: 0.198_669_33, z: 0.0, w: 0.980_066_6 },
    position: Vector3f { x: 0.5, y: 0.0, z: 0.1 },
};

/// The session of the last frame.
static SESSION: AtomicU64 = AtomicU64::new(0);
static FRAMES: AtomicU64 = AtomicU64::new(0);
static ORIGIN: Mutex<Option<Posef>> = Mutex::new(None);

/// The functions that are wrapped.
pub(crate) fn function(name: &[u8]) -> Option<pfn::VoidFunction> {
    // SAFETY: a function pointer is turned into the untyped one that OpenXR hands out; its user turns it back.
    unsafe {
        match name {
            b"xrEnumerateEnvironmentBlendModes" => {
                Some(transmute::<pfn::EnumerateEnvironmentBlendModes, pfn::VoidFunction>(blend_modes))
            }
            b"xrEndFrame" => Some(transmute::<pfn::EndFrame, pfn::VoidFunction>(end_frame)),
            b"xrPollEvent" => Some(transmute::<pfn::PollEvent, pfn::VoidFunction>(poll_event)),
            b"xrLocateViews" => Some(transmute::<pfn::LocateViews, pfn::VoidFunction>(locate_views)),
            _ => None,
        }
    }
}

fn wanted_mode() -> Option<EnvironmentBlendMode> {
    match std::env::var("FAKEPLANES_BLEND_MODE").ok()?.as_str() {
        "alpha" => Some(EnvironmentBlendMode::ALPHA_BLEND),
        "additive" => Some(EnvironmentBlendMode::ADDITIVE),
        _ => None,
    }
}

unsafe extern "system" fn blend_modes(
    instance: Instance,
    system: SystemId,
    views: ViewConfigurationType,
    capacity: u32,
    count: *mut u32,
    modes: *mut EnvironmentBlendMode,
) -> Result {
    if let Some(mode) = wanted_mode() {
        // SAFETY: the specification demands a place for the count and a list with its true capacity.
        return unsafe { spatial::listed(&[mode], capacity, count, modes) };
    }
    // SAFETY: a live instance and a C string.
    let (result, function) = unsafe { below(instance, c"xrEnumerateEnvironmentBlendModes".as_ptr()) };
    let Some(function) = function else { return result };
    // SAFETY: that is the type of the function of this name; its arguments are passed on as they came.
    unsafe {
        transmute::<pfn::VoidFunction, pfn::EnumerateEnvironmentBlendModes>(function)(
            instance, system, views, capacity, count, modes,
        )
    }
}

unsafe extern "system" fn end_frame(session: Session, info: *const FrameEndInfo) -> Result {
    SESSION.store(session.into_raw(), Ordering::Relaxed);
    FRAMES.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the specification demands the structure.
    let mut info = unsafe { *info };
    if let Some(mode) = wanted_mode() {
        if info.environment_blend_mode != mode {
            return Result::ERROR_ENVIRONMENT_BLEND_MODE_UNSUPPORTED;
        }
        info.environment_blend_mode = EnvironmentBlendMode::OPAQUE;
    }
    let Some(instance) = instance() else { return Result::ERROR_INSTANCE_LOST };
    // SAFETY: a live instance and a C string.
    let (result, function) = unsafe { below(instance, c"xrEndFrame".as_ptr()) };
    let Some(function) = function else { return result };
    // SAFETY: that is the type of the function of this name; what `info` names lives until the call returns.
    unsafe { transmute::<pfn::VoidFunction, pfn::EndFrame>(function)(session, &raw const info) }
}

unsafe extern "system" fn poll_event(instance: Instance, buffer: *mut EventDataBuffer) -> Result {
    let after = std::env::var("FAKEPLANES_RECENTRE_AFTER").ok().and_then(|text| text.parse::<u64>().ok());
    let is_time = after.is_some_and(|after| FRAMES.load(Ordering::Relaxed) >= after);
    if is_time && ORIGIN.lock().is_ok_and(|origin| origin.is_none()) {
        let session = SESSION.load(Ordering::Relaxed);
        let event = EventDataReferenceSpaceChangePending {
            ty: EventDataReferenceSpaceChangePending::TYPE,
            next: std::ptr::null(),
            session: Session::from_raw(session),
            reference_space_type: ReferenceSpaceType::LOCAL,
            change_time: Time::from_nanos(1),
            pose_valid: TRUE,
            pose_in_previous_space: RECENTRED,
        };
        // SAFETY: a buffer of the specification's size holds every event.
        unsafe { buffer.cast::<EventDataReferenceSpaceChangePending>().write(event) };
        if let Ok(mut origin) = ORIGIN.lock() {
            *origin = Some(RECENTRED);
        }
        snapshots::frame_moved(RECENTRED);
        return Result::SUCCESS;
    }
    // SAFETY: a live instance and a C string.
    let (result, function) = unsafe { below(instance, c"xrPollEvent".as_ptr()) };
    let Some(function) = function else { return result };
    // SAFETY: that is the type of the function of this name; its arguments are passed on as they came.
    unsafe { transmute::<pfn::VoidFunction, pfn::PollEvent>(function)(instance, buffer) }
}

unsafe extern "system" fn locate_views(
    session: Session,
    info: *const ViewLocateInfo,
    state: *mut ViewState,
    capacity: u32,
    count: *mut u32,
    views: *mut View,
) -> Result {
    let Some(instance) = instance() else { return Result::ERROR_INSTANCE_LOST };
    // SAFETY: a live instance and a C string.
    let (result, function) = unsafe { below(instance, c"xrLocateViews".as_ptr()) };
    let Some(function) = function else { return result };
    // SAFETY: that is the type of the function of this name; its arguments are passed on as they came.
    let result = unsafe {
        transmute::<pfn::VoidFunction, pfn::LocateViews>(function)(
            session, info, state, capacity, count, views,
        )
    };
    let origin = ORIGIN.lock().ok().and_then(|origin| *origin);
    if let (Result::SUCCESS, Some(origin), true) = (result, origin, capacity > 0) {
        // SAFETY: after success the count is written and so many views are.
        for view in unsafe { std::slice::from_raw_parts_mut(views, *count as usize) } {
            view.pose = seen_from(origin, view.pose);
        }
    }
    result
}

/// A pose in a frame whose origin is at `origin`, which is turned about y only.
pub(crate) fn seen_from(origin: Posef, pose: Posef) -> Posef {
    let (p, o) = (pose.position, origin.position);
    let (x, y, z) = (p.x - o.x, p.y - o.y, p.z - o.z);
    let back = Quaternionf { y: -origin.orientation.y, ..origin.orientation };
    let (sine, cosine) = (2.0 * back.y * back.w, 1.0 - 2.0 * back.y * back.y);
    let q = pose.orientation;
    Posef {
        position: Vector3f { x: cosine * x + sine * z, y, z: cosine * z - sine * x },
        orientation: Quaternionf {
            x: back.w * q.x + back.y * q.z,
            y: back.w * q.y + back.y * q.w,
            z: back.w * q.z - back.y * q.x,
            w: back.w * q.w - back.y * q.y,
        },
    }
}
