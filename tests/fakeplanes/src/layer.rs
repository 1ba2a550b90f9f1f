//! Which function answers to which name: the extension's here, two that are wrapped, all others below.

use std::{
    ffi::{CStr, c_char},
    mem::transmute,
    path::PathBuf,
    sync::RwLock,
};

use openxr_sys::{
    BaseOutStructure, FrameState, FrameWaitInfo, Instance, PlaneDetectionCapabilityFlagsEXT, Result, Session,
    SystemId, SystemPlaneDetectionPropertiesEXT, SystemProperties, pfn,
};

use crate::{planes, planted, room, spatial};

/// The layer or runtime below; made anew with every instance.
static BELOW: RwLock<Option<pfn::GetInstanceProcAddr>> = RwLock::new(None);
/// The instance whose functions are wrapped.
static INSTANCE: RwLock<Option<Instance>> = RwLock::new(None);

pub(crate) fn set_below(below: pfn::GetInstanceProcAddr) {
    if let Ok(mut slot) = BELOW.write() {
        *slot = Some(below);
    }
}

/// The instance whose functions are wrapped.
pub(crate) fn instance() -> Option<Instance> {
    INSTANCE.read().ok().and_then(|slot| *slot)
}

/// A function of the layer below.
///
/// # Safety
/// `instance` is live, or null for the functions that need none; `name` is a C string.
pub(crate) unsafe fn below(instance: Instance, name: *const c_char) -> (Result, Option<pfn::VoidFunction>) {
    let Some(get) = BELOW.read().ok().and_then(|slot| *slot) else {
        return (Result::ERROR_HANDLE_INVALID, None);
    };
    let mut function = None;
    // SAFETY: `get` is what the loader named; the caller guarantees `instance` and `name`.
    let result = unsafe { get(instance, name, &raw mut function) };
    (result, function)
}

/// # Safety
/// As the loader calls it: a live instance, a C string, and a place to write to.
pub(crate) unsafe extern "system" fn get_instance_proc_addr(
    instance: Instance,
    name: *const c_char,
    out: *mut Option<pfn::VoidFunction>,
) -> Result {
    // SAFETY: the loader passes a C string.
    let text = unsafe { CStr::from_ptr(name) };
    // SAFETY: a function pointer is turned into the untyped one that OpenXR hands out; its user turns it back.
    let ours: Option<pfn::VoidFunction> = unsafe {
        match text.to_bytes() {
            b"xrCreatePlaneDetectorEXT" => {
                Some(transmute::<pfn::CreatePlaneDetectorEXT, pfn::VoidFunction>(planes::create))
            }
            b"xrDestroyPlaneDetectorEXT" => {
                Some(transmute::<pfn::DestroyPlaneDetectorEXT, pfn::VoidFunction>(planes::destroy))
            }
            b"xrBeginPlaneDetectionEXT" => {
                Some(transmute::<pfn::BeginPlaneDetectionEXT, pfn::VoidFunction>(planes::begin))
            }
            b"xrGetPlaneDetectionStateEXT" => {
                Some(transmute::<pfn::GetPlaneDetectionStateEXT, pfn::VoidFunction>(planes::state))
            }
            b"xrGetPlaneDetectionsEXT" => {
                Some(transmute::<pfn::GetPlaneDetectionsEXT, pfn::VoidFunction>(planes::detections))
            }
            b"xrGetPlanePolygonBufferEXT" => {
                Some(transmute::<pfn::GetPlanePolygonBufferEXT, pfn::VoidFunction>(planes::outline))
            }
            b"xrGetSystemProperties" => {
                Some(transmute::<pfn::GetSystemProperties, pfn::VoidFunction>(system_properties))
            }
            b"xrCreateVulkanInstanceKHR" => {
                Some(transmute::<pfn::CreateVulkanInstanceKHR, pfn::VoidFunction>(planted::create_instance))
            }
            b"xrCreateVulkanDeviceKHR" => {
                Some(transmute::<pfn::CreateVulkanDeviceKHR, pfn::VoidFunction>(planted::create_device))
            }
            b"xrWaitFrame" => Some(transmute::<pfn::WaitFrame, pfn::VoidFunction>(wait_frame)),
            name => spatial::function(name).or_else(|| room::function(name)),
        }
    };
    if let (Ok(mut slot), Some(_)) = (INSTANCE.write(), ours) {
        *slot = Some(instance);
    }
    let (result, function) = match ours {
        Some(function) => (Result::SUCCESS, Some(function)),
        // SAFETY: passed on as it came.
        None => unsafe { below(instance, name) },
    };
    // SAFETY: the loader passes a place to write to.
    unsafe { out.write(function) };
    result
}

/// The runtime's properties, and that planes are detected.
unsafe extern "system" fn system_properties(
    instance: Instance,
    system: SystemId,
    properties: *mut SystemProperties,
) -> Result {
    // SAFETY: a live instance and a C string.
    let (result, function) = unsafe { below(instance, c"xrGetSystemProperties".as_ptr()) };
    let Some(function) = function else { return result };
    // SAFETY: that is the type of the function of this name; its arguments are passed on as they came.
    let result = unsafe {
        transmute::<pfn::VoidFunction, pfn::GetSystemProperties>(function)(instance, system, properties)
    };
    if result != Result::SUCCESS {
        return result;
    }
    // SAFETY: after success `properties` is valid and its chain consists of output structures.
    unsafe {
        let mut next = (*properties).next.cast::<BaseOutStructure>();
        while let Some(structure) = next.as_mut() {
            if structure.ty == SystemPlaneDetectionPropertiesEXT::TYPE {
                (*next.cast::<SystemPlaneDetectionPropertiesEXT>()).supported_features =
                    PlaneDetectionCapabilityFlagsEXT::PLANE_DETECTION;
            }
            next = structure.next;
        }
    }
    result
}

/// The runtime's wait, or a lost session when the test wants one.
unsafe extern "system" fn wait_frame(
    session: Session,
    info: *const FrameWaitInfo,
    state: *mut FrameState,
) -> Result {
    let wish = std::env::var_os("FAKEPLANES_LOSE_SESSION").map(PathBuf::from);
    if wish.is_some_and(|path| std::fs::remove_file(path).is_ok()) {
        return Result::ERROR_SESSION_LOST;
    }
    let Some(instance) = instance() else { return Result::ERROR_INSTANCE_LOST };
    // SAFETY: the instance of the session is live, and the name is a C string.
    let (result, function) = unsafe { below(instance, c"xrWaitFrame".as_ptr()) };
    let Some(function) = function else { return result };
    // SAFETY: that is the type of the function of this name; its arguments are passed on as they came.
    unsafe { transmute::<pfn::VoidFunction, pfn::WaitFrame>(function)(session, info, state) }
}
