//! An OpenXR API layer that adds XR_EXT_plane_detection or XR_EXT_spatial_plane_tracking and XR_EXT_spatial_anchor to any
//! runtime: one table, one floor, one anchor, and on demand a lost session, a seen room, a user who recentres.
//!
//! The loader puts it between a program and the runtime (`manifest` in `tests/tests/headset/`). It answers the extension's
//! functions itself, says in the system's properties that planes are detected, hides the extension from the runtime below,
//! and passes everything else on. While the file named by `FAKEPLANES_LOSE_SESSION` exists, `xrWaitFrame` reports a lost
//! session once and removes the file. `FAKEPLANES_PLANT_VULKAN_ERROR` makes it misuse Vulkan once.

#![allow(unsafe_code)] // an API layer is nothing but foreign functions; each says what its caller guarantees

mod layer;
mod planes;
mod planted;
mod room;
mod snapshots;
mod spatial;

use std::{ffi::c_char, ptr};

use openxr_sys::{
    ApiLayerCreateInfo, CURRENT_LOADER_API_LAYER_VERSION, Instance, InstanceCreateInfo,
    NegotiateApiLayerRequest, NegotiateLoaderInfo, Result, Version,
};

/// What the loader calls first: says which functions make up the layer.
///
/// # Safety
/// As the OpenXR loader calls it: `request` points to a request that may be written.
#[unsafe(no_mangle)]
pub unsafe extern "system" fn xrNegotiateLoaderApiLayerInterface(
    _loader: *const NegotiateLoaderInfo,
    _name: *const c_char,
    request: *mut NegotiateApiLayerRequest,
) -> Result {
    // SAFETY: the loader passes a valid request or null.
    let Some(request) = (unsafe { request.as_mut() }) else { return Result::ERROR_INITIALIZATION_FAILED };
    request.layer_interface_version = CURRENT_LOADER_API_LAYER_VERSION as u32;
    request.layer_api_version = Version::new(1, 0, 0);
    request.get_instance_proc_addr = Some(layer::get_instance_proc_addr);
    request.create_api_layer_instance = Some(create_instance);
    Result::SUCCESS
}

/// Makes the instance below without the extension that the runtime does not know.
unsafe extern "system" fn create_instance(
    info: *const InstanceCreateInfo,
    layer_info: *const ApiLayerCreateInfo,
    instance: *mut Instance,
) -> Result {
    // SAFETY: the loader passes valid structures, and a chain with an entry for this layer.
    let (Some(info), Some(layer_info)) = (unsafe { info.as_ref() }, unsafe { layer_info.as_ref() }) else {
        return Result::ERROR_INITIALIZATION_FAILED;
    };
    // SAFETY: as above.
    let Some(next) = (unsafe { layer_info.next_info.as_ref() }) else {
        return Result::ERROR_INITIALIZATION_FAILED;
    };
    let (Some(below), Some(create)) = (next.next_get_instance_proc_addr, next.next_create_api_layer_instance)
    else {
        return Result::ERROR_INITIALIZATION_FAILED;
    };
    layer::set_below(below);
    let mut info = *info;
    let names = if info.enabled_extension_names.is_null() {
        &[]
    } else {
        // SAFETY: the loader has checked that the array has this length.
        unsafe {
            std::slice::from_raw_parts(info.enabled_extension_names, info.enabled_extension_count as usize)
        }
    };
    // SAFETY: every name is a C string.
    let known: Vec<*const c_char> =
        names.iter().copied().filter(|name| !unsafe { planes::is_extension(*name) }).collect();
    info.enabled_extension_count = known.len() as u32;
    info.enabled_extension_names = if known.is_empty() { ptr::null() } else { known.as_ptr() };
    let mut layer_info = *layer_info;
    layer_info.next_info = next.next;
    // SAFETY: both structures and `known` live until the call returns; `instance` is the loader's.
    unsafe { create(&raw const info, &raw const layer_info, instance) }
}
