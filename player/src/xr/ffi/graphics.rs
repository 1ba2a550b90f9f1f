//! The wgpu device on the Vulkan instance and device that an OpenXR runtime makes (XR_KHR_vulkan_enable2).
//!
//! The runtime creates both objects with the extensions it needs, on the GPU the headset hangs on; wgpu adds its own and
//! takes ownership. The OpenXR session keeps them alive until it is destroyed.

use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

use ash::vk::{self, Handle as _};
use openxr::{FrameStream, FrameWaiter, Instance, Session, SystemId, Vulkan};
use wgpu::{
    DeviceDescriptor, Extent3d, Features, InstanceFlags, Limits, MemoryBudgetThresholds, MemoryHints,
    Texture, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureUses,
    hal::{self, api::Vulkan as VulkanApi, vulkan},
};

use crate::xr::{XrError, error::graphics};

/// Features taken when the GPU has them: both eyes in one pass, also with several samples per pixel.
const WANTED: Features = Features::MULTIVIEW.union(Features::MULTISAMPLE_ARRAY);

/// A wgpu device that belongs to a headset's runtime.
pub(in crate::xr) struct Graphics {
    /// The device.
    pub(in crate::xr) device: wgpu::Device,
    /// Its queue; only the frame loop submits to it, as OpenXR demands.
    pub(in crate::xr) queue: wgpu::Queue,
    /// The GPU's name.
    pub(in crate::xr) adapter: String,
    /// Mistakes that wgpu found in what was asked of it.
    pub(in crate::xr) errors: Arc<AtomicU64>,
    features: Features,
    instance: wgpu::Instance,
    binding: openxr::vulkan::SessionCreateInfo,
}

type GetInstanceProcAddr = openxr::sys::platform::VkGetInstanceProcAddr;

impl Graphics {
    /// Makes the device that the runtime asks for.
    pub(in crate::xr) fn open(xr: &Instance, system: SystemId) -> Result<Self, XrError> {
        let needs = xr.graphics_requirements::<Vulkan>(system)?;
        let version = |v: openxr::Version| vk::make_api_version(0, v.major().into(), v.minor().into(), 0);
        let api_version =
            vk::API_VERSION_1_3.min(version(needs.max_api_version_supported)).max(vk::API_VERSION_1_1);
        if api_version < version(needs.min_api_version_supported) {
            return Err(XrError::Graphics(format!(
                "the runtime wants Vulkan {} or later",
                needs.min_api_version_supported
            )));
        }
        // SAFETY: the library of the standard name is the Vulkan loader, which conforms to the specification.
        let entry = unsafe { ash::Entry::load() }.map_err(graphics("no Vulkan loader"))?;
        let (raw_instance, extensions) = create_instance(xr, system, &entry, api_version)?;
        let instance_handle = raw_instance.handle().as_raw();
        // SAFETY: `instance_handle` is the live instance that this runtime has just made for this system.
        let physical = unsafe { xr.vulkan_graphics_device(system, instance_handle as _) }?;
        let physical = vk::PhysicalDevice::from_raw(physical as u64);

        // SAFETY: `physical` belongs to the live instance `raw_instance`.
        let families = unsafe { raw_instance.get_physical_device_queue_family_properties(physical) };
        let family = families
            .iter()
            .position(|family| family.queue_flags.contains(vk::QueueFlags::GRAPHICS))
            .and_then(|index| u32::try_from(index).ok())
            .ok_or_else(|| XrError::Graphics("the headset's GPU has no graphics queue".to_owned()))?;

        // SAFETY: `raw_instance` was made from `entry` with `api_version`, exactly `extensions` and the same flags, and
        // without a drop callback wgpu owns it from here on: nothing else destroys it.
        let hal_instance = unsafe {
            vulkan::Instance::from_raw(
                entry.clone(),
                raw_instance.clone(),
                api_version,
                0,
                None,
                extensions,
                InstanceFlags::empty(),
                MemoryBudgetThresholds::default(),
                false,
                None,
            )
        }
        .map_err(graphics("the Vulkan instance cannot be used"))?;
        let exposed = hal_instance
            .expose_adapter(physical)
            .ok_or_else(|| XrError::Graphics("the headset's GPU lacks what the renderer needs".to_owned()))?;
        let features = exposed.features & WANTED;
        let limits: Limits = exposed.capabilities.limits.clone();
        let adapter = exposed.info.name.clone();
        let raw_device = create_device(xr, system, &raw_instance, physical, &exposed, features, family)?;
        let binding = openxr::vulkan::SessionCreateInfo {
            instance: instance_handle as _,
            physical_device: physical.as_raw() as _,
            device: raw_device.handle().as_raw() as _,
            queue_family_index: family,
            queue_index: 0,
        };
        let extensions = exposed.adapter.required_device_extensions(features);
        // SAFETY: `raw_device` was made from this adapter with these extensions, features and this queue family; without
        // a drop callback wgpu owns it from here on.
        let open = unsafe {
            let hints = MemoryHints::Performance;
            exposed.adapter.device_from_raw(
                raw_device,
                None,
                &extensions,
                features,
                &limits,
                &hints,
                family,
                0,
            )
        }
        .map_err(graphics("the Vulkan device cannot be used"))?;
        // SAFETY: both come from `from_raw` above and nobody else holds them.
        let instance = unsafe { wgpu::Instance::from_hal::<VulkanApi>(hal_instance) };
        // SAFETY: `exposed` was made by this instance.
        let wgpu_adapter = unsafe { instance.create_adapter_from_hal::<VulkanApi>(exposed) };
        let descriptor = DeviceDescriptor {
            label: Some("headset"),
            required_features: features,
            required_limits: limits,
            ..Default::default()
        };
        // SAFETY: `open` was made by this adapter with the features and limits of the descriptor.
        let (device, queue) = unsafe { wgpu_adapter.create_device_from_hal::<VulkanApi>(open, &descriptor) }
            .map_err(graphics("the graphics device cannot be used"))?;
        let errors = Arc::new(AtomicU64::new(0));
        let counted = errors.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            counted.fetch_add(1, Ordering::Relaxed);
            tracing::error!("graphics: {error}");
        }));
        Ok(Self { device, queue, adapter, errors, features, instance, binding })
    }

    /// Views that one pass can draw with so many samples per pixel: 2 with multiview.
    pub(in crate::xr) fn views_per_pass(&self, samples: u32) -> u32 {
        let needed = if samples > 1 { WANTED } else { Features::MULTIVIEW };
        if self.features.contains(needed) { 2 } else { 1 }
    }

    /// The session that draws with this device; it keeps the device alive until it is destroyed.
    pub(in crate::xr) fn create_session(
        &self,
        xr: &Instance,
        system: SystemId,
    ) -> Result<(Session<Vulkan>, FrameWaiter, FrameStream<Vulkan>), XrError> {
        let keep_alive = Box::new((self.device.clone(), self.queue.clone(), self.instance.clone()));
        // SAFETY: the binding names live objects that this runtime made for this system, and `keep_alive` holds them
        // until the session is gone. Queue access is single-threaded: the frame loop's thread alone submits.
        Ok(unsafe { xr.create_session_with_guard::<Vulkan>(system, &self.binding, keep_alive) }?)
    }

    /// A swapchain's image as a texture of `layers` layers. It must be dropped before the swapchain.
    pub(in crate::xr) fn wrap_image(
        &self,
        image: u64,
        (width, height): (u32, u32),
        layers: u32,
        format: TextureFormat,
    ) -> Result<Texture, XrError> {
        let size = Extent3d { width, height, depth_or_array_layers: layers };
        let descriptor = hal::TextureDescriptor {
            label: Some("headset picture"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format,
            usage: TextureUses::COLOR_TARGET | TextureUses::COPY_SRC,
            memory_flags: hal::MemoryFlags::empty(),
            view_formats: vec![],
        };
        let lost = || XrError::Graphics("the headset's device is not a Vulkan device".to_owned());
        // SAFETY: the device is used only to describe the image, within this statement.
        let hal_device = unsafe { self.device.as_hal::<VulkanApi>() }.ok_or_else(lost)?;
        // SAFETY: `image` is an image of a live swapchain made with this size, format, layers and usage. The runtime owns
        // it and its memory: the callback does nothing, and the swapchain outlives the texture.
        let hal_texture = unsafe {
            let nothing: hal::DropCallback = Box::new(|| {});
            let external = vulkan::TextureMemory::External;
            hal_device.texture_from_raw(vk::Image::from_raw(image), &descriptor, Some(nothing), external)
        };
        drop(hal_device);
        let descriptor = TextureDescriptor {
            label: Some("headset picture"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format,
            usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC,
            view_formats: &[],
        };
        // SAFETY: made from this device to this description; an acquired swapchain image is in the layout of a colour
        // attachment, as XR_KHR_vulkan_enable2 says, and every frame leaves it in that layout.
        Ok(unsafe {
            self.device.create_texture_from_hal::<VulkanApi>(
                hal_texture,
                &descriptor,
                TextureUses::COLOR_TARGET,
            )
        })
    }
}

/// Vulkan's function look-up as OpenXR declares it.
fn look_up(entry: &ash::Entry) -> GetInstanceProcAddr {
    // SAFETY: both types are the C function vkGetInstanceProcAddr; they differ only in how the two crates name an
    // instance handle (a pointer in both) and the returned function.
    unsafe {
        std::mem::transmute::<vk::PFN_vkGetInstanceProcAddr, GetInstanceProcAddr>(
            entry.static_fn().get_instance_proc_addr,
        )
    }
}

type Extensions = Vec<&'static std::ffi::CStr>;

fn create_instance(
    xr: &Instance,
    system: SystemId,
    entry: &ash::Entry,
    api_version: u32,
) -> Result<(ash::Instance, Extensions), XrError> {
    let extensions = vulkan::Instance::desired_extensions(entry, api_version, InstanceFlags::empty())
        .map_err(graphics("Vulkan extensions cannot be listed"))?;
    let names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
    let application = vk::ApplicationInfo::default()
        .application_name(c"holopitch")
        .engine_name(c"holopitch")
        .api_version(api_version);
    let create =
        vk::InstanceCreateInfo::default().application_info(&application).enabled_extension_names(&names);
    // SAFETY: `create` and all that it points to live until the call returns.
    let made = unsafe { xr.create_vulkan_instance(system, look_up(entry), (&raw const create).cast()) }?;
    let handle = made.map_err(vk::Result::from_raw).map_err(graphics("no Vulkan instance"))?;
    // SAFETY: `handle` is the instance just made through `entry`.
    let instance = unsafe { ash::Instance::load(entry.static_fn(), vk::Instance::from_raw(handle as u64)) };
    Ok((instance, extensions))
}

fn create_device(
    xr: &Instance,
    system: SystemId,
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    exposed: &hal::ExposedAdapter<VulkanApi>,
    features: Features,
    family: u32,
) -> Result<ash::Device, XrError> {
    // SAFETY: see `create_instance`; the loader stays loaded, as the instance holds it.
    let entry = unsafe { ash::Entry::load() }.map_err(graphics("no Vulkan loader"))?;
    let extensions = exposed.adapter.required_device_extensions(features);
    let names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
    let mut enabled = exposed.adapter.physical_device_features(&extensions, features);
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
    let create = enabled.add_to_device_create(
        vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&names),
    );
    let made = {
        let (physical, create) = (physical.as_raw() as _, (&raw const create).cast());
        // SAFETY: `physical` is the device the runtime named; `create` and all that it points to live until the call
        // returns.
        unsafe { xr.create_vulkan_device(system, look_up(&entry), physical, create) }?
    };
    let handle = made.map_err(vk::Result::from_raw).map_err(graphics("no Vulkan device"))?;
    // SAFETY: `handle` is the device just made from `instance`.
    Ok(unsafe { ash::Device::load(instance.fp_v1_0(), vk::Device::from_raw(handle as u64)) })
}
