//! A mistake in the use of Vulkan, made on purpose on the player's own device: whoever listens to the validation layer must
//! hear of it, before its silence is worth anything.

use std::{
    ffi::{CStr, c_char, c_void},
    mem::transmute,
    ptr,
    sync::atomic::{AtomicPtr, Ordering},
};

use openxr_sys::{
    Instance, Result, VulkanDeviceCreateInfoKHR, VulkanInstanceCreateInfoKHR, pfn,
    platform::{VkDevice, VkInstance, VkResult},
};

use crate::layer::below;

/// The Vulkan instance of the player.
static VULKAN: AtomicPtr<c_void> = AtomicPtr::new(ptr::null_mut());

/// `VkBufferCreateInfo`.
#[repr(C)]
struct BufferCreateInfo {
    kind: i32,
    next: *const c_void,
    flags: u32,
    size: u64,
    usage: u32,
    sharing_mode: i32,
    family_count: u32,
    families: *const u32,
}

type Look = unsafe extern "system" fn(*const c_void, *const c_char) -> Option<unsafe extern "system" fn()>;
type CreateBuffer =
    unsafe extern "system" fn(VkDevice, *const BufferCreateInfo, *const c_void, *mut u64) -> i32;

/// Remembers the instance that the runtime makes.
pub(crate) unsafe extern "system" fn create_instance(
    instance: Instance,
    info: *const VulkanInstanceCreateInfoKHR,
    vulkan: *mut VkInstance,
    vulkan_result: *mut VkResult,
) -> Result {
    // SAFETY: a live instance and a C string.
    let (result, function) = unsafe { below(instance, c"xrCreateVulkanInstanceKHR".as_ptr()) };
    let Some(function) = function else { return result };
    // SAFETY: that is the type of the function of this name; its arguments are passed on as they came.
    let result = unsafe {
        transmute::<pfn::VoidFunction, pfn::CreateVulkanInstanceKHR>(function)(
            instance,
            info,
            vulkan,
            vulkan_result,
        )
    };
    if result == Result::SUCCESS {
        // SAFETY: after success the instance has been written.
        VULKAN.store(unsafe { *vulkan }.cast_mut(), Ordering::Relaxed);
    }
    result
}

/// Makes the device and, when `FAKEPLANES_PLANT_VULKAN_ERROR` is set, a buffer of no bytes on it.
pub(crate) unsafe extern "system" fn create_device(
    instance: Instance,
    info: *const VulkanDeviceCreateInfoKHR,
    device: *mut VkDevice,
    vulkan_result: *mut VkResult,
) -> Result {
    // SAFETY: a live instance and a C string.
    let (result, function) = unsafe { below(instance, c"xrCreateVulkanDeviceKHR".as_ptr()) };
    let Some(function) = function else { return result };
    // SAFETY: that is the type of the function of this name; its arguments are passed on as they came.
    let result = unsafe {
        transmute::<pfn::VoidFunction, pfn::CreateVulkanDeviceKHR>(function)(
            instance,
            info,
            device,
            vulkan_result,
        )
    };
    if result == Result::SUCCESS && std::env::var_os("FAKEPLANES_PLANT_VULKAN_ERROR").is_some() {
        // SAFETY: after success both are valid.
        unsafe { plant(info, *device) };
    }
    result
}

/// VUID-VkBufferCreateInfo-size-00912: a size of zero.
unsafe fn plant(info: *const VulkanDeviceCreateInfoKHR, device: VkDevice) {
    let vulkan: *const c_void = VULKAN.load(Ordering::Relaxed);
    let look = |look: Look, of: *const c_void, name: &CStr| {
        // SAFETY: `look` is Vulkan's own function, `of` a live instance or device.
        unsafe { look(of, name.as_ptr()) }
    };
    // SAFETY: the caller guarantees `info`; both types name vkGetInstanceProcAddr.
    let Some(get) = (unsafe { (*info).pfn_get_instance_proc_addr }) else { return };
    let Some(of_device) = look(get, vulkan, c"vkGetDeviceProcAddr") else { return };
    // SAFETY: that is the type of vkGetDeviceProcAddr.
    let of_device = unsafe { transmute::<unsafe extern "system" fn(), Look>(of_device) };
    let Some(create) = look(of_device, device.cast(), c"vkCreateBuffer") else { return };
    const VERTEX_BUFFER: u32 = 0x80;
    const BUFFER_CREATE_INFO: i32 = 12;
    let nothing = BufferCreateInfo {
        kind: BUFFER_CREATE_INFO,
        next: ptr::null(),
        flags: 0,
        size: 0,
        usage: VERTEX_BUFFER,
        sharing_mode: 0,
        family_count: 0,
        families: ptr::null(),
    };
    let mut buffer = 0;
    // SAFETY: that is the type of vkCreateBuffer; the description and the place for the buffer live until it returns. The
    // size is the planted mistake: drivers answer it with an empty buffer or an error.
    let made = unsafe {
        transmute::<unsafe extern "system" fn(), CreateBuffer>(create)(
            device,
            &raw const nothing,
            ptr::null(),
            &raw mut buffer,
        )
    };
    eprintln!("fakeplanes: planted a buffer of no bytes (VkResult {made})");
}
