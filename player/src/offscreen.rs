//! Pictures without a window: finds a graphics adapter, draws, and reads the pixels back.

use image::RgbaImage;
use protocol::pitch::Pitch;
use thiserror::Error;
use wgpu::{
    Adapter, Backends, BufferDescriptor, BufferUsages, Device, DeviceDescriptor, DeviceType, Extent3d,
    Features, Instance, InstanceDescriptor, MapMode, Origin3d, PollType, Queue, RequestAdapterError,
    RequestAdapterOptions, TexelCopyBufferInfo, TexelCopyBufferLayout, TexelCopyTextureInfo, Texture,
    TextureAspect,
};

use crate::{
    ar::RoomPicture,
    camera::{EyeView, ViewCamera},
    renderer::{Canvas, Guessed, InRoom, OnTable, PictureFormat, RealTable, Renderer, Target},
    scene::{FrameScene, Stage},
};

/// Why there is no picture.
#[derive(Debug, Error)]
pub enum OffscreenError {
    /// No driver that can draw.
    #[error(
        "no graphics adapter found ({0}): install a Vulkan driver (on Debian without a GPU: mesa-vulkan-drivers)"
    )]
    NoAdapter(String),
    /// The adapter gave no device.
    #[error("the graphics adapter {adapter} refused to start: {reason}")]
    NoDevice {
        /// Its name.
        adapter: String,
        /// What it said.
        reason: String,
    },
    /// The picture is larger than the adapter can draw.
    #[error("{width_px} × {height_px} px is not a size this adapter can draw: use 1 to {most_px} px a side")]
    Size {
        /// Width asked for.
        width_px: u32,
        /// Height asked for.
        height_px: u32,
        /// The most.
        most_px: u32,
    },
    /// The pixels could not be read back.
    #[error("the graphics adapter lost the picture: {0}")]
    ReadBack(String),
}

/// A graphics device that is bound to no window.
pub struct Offscreen {
    /// The device.
    pub device: Device,
    /// Its queue.
    pub queue: Queue,
    /// The adapter's name.
    pub adapter: String,
}

impl Offscreen {
    /// Opens the machine's preferred adapter; a software one will do.
    pub fn open() -> Result<Self, OffscreenError> {
        pollster::block_on(async {
            // OpenGL only when there is nothing better: without a display its loader complains on standard error.
            let mut adapter = request_adapter(Backends::PRIMARY).await;
            if adapter.is_err() {
                adapter = request_adapter(Backends::SECONDARY).await;
            }
            Self::on(adapter.map_err(|error| OffscreenError::NoAdapter(error.to_string()))?).await
        })
    }

    /// Opens a software adapter (Mesa's lavapipe): its pictures are the same to the bit on every machine.
    pub fn open_software() -> Result<Self, OffscreenError> {
        pollster::block_on(async {
            let adapters = instance(Backends::VULKAN).enumerate_adapters(Backends::VULKAN).await;
            let software =
                adapters.into_iter().find(|adapter| adapter.get_info().device_type == DeviceType::Cpu);
            let missing = || OffscreenError::NoAdapter("no software Vulkan driver".to_owned());
            Self::on(software.ok_or_else(missing)?).await
        })
    }

    async fn on(adapter: Adapter) -> Result<Self, OffscreenError> {
        let name = adapter.get_info().name;
        let descriptor = DeviceDescriptor {
            label: Some("offscreen"),
            // Both views of a headset in one pass, where the adapter can.
            required_features: adapter.features() & (Features::MULTIVIEW | Features::MULTISAMPLE_ARRAY),
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (device, queue) = adapter
            .request_device(&descriptor)
            .await
            .map_err(|error| OffscreenError::NoDevice { adapter: name.clone(), reason: error.to_string() })?;
        Ok(Self { device, queue, adapter: name })
    }

    /// A target of the given size.
    pub fn target(&self, width_px: u32, height_px: u32) -> Result<Target, OffscreenError> {
        let most_px = self.device.limits().max_texture_dimension_2d;
        if !(1..=most_px).contains(&width_px) || !(1..=most_px).contains(&height_px) {
            return Err(OffscreenError::Size { width_px, height_px, most_px });
        }
        Ok(Target::new(&self.device, width_px, height_px))
    }

    /// One picture of a frame on its stage.
    pub fn picture(
        &self,
        stage: &Stage,
        frame: &FrameScene,
        camera: &ViewCamera,
        size_px: (u32, u32),
    ) -> Result<RgbaImage, OffscreenError> {
        self.picture_with(stage, frame, camera, Guessed::Solid, size_px)
    }

    /// The same, with what no camera saw drawn in another way.
    pub fn picture_with(
        &self,
        stage: &Stage,
        frame: &FrameScene,
        camera: &ViewCamera,
        guessed: Guessed,
        (width_px, height_px): (u32, u32),
    ) -> Result<RgbaImage, OffscreenError> {
        let target = self.target(width_px, height_px)?;
        let mut renderer = Renderer::new(&self.device, &self.queue, stage);
        renderer.show_guessed(guessed);
        renderer.upload(&self.device, &self.queue, frame);
        self.draw(&renderer, &target, camera)?;
        self.read_back(&target)
    }

    /// One picture of a frame on the table of a real room, in the size of the room's picture.
    pub fn picture_in_room(
        &self,
        pitch: Pitch,
        frame: &FrameScene,
        room: &RoomPicture,
        on_table: &OnTable,
    ) -> Result<RgbaImage, OffscreenError> {
        let (width_px, height_px) = room.colour.dimensions();
        let target = self.target(width_px, height_px)?;
        let mut table = RealTable::new(&self.device, &self.queue, pitch);
        table.upload(&self.device, &self.queue, frame);
        table.show_room(&self.device, &self.queue, room);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        table.draw(&self.device, &self.queue, &mut encoder, &target, Some(on_table));
        self.queue.submit([encoder.finish()]);
        self.finish()?;
        self.read_back(&target)
    }

    /// What one eye of a headset is given, in the format of `in_room` with one view: sRGB premultiplied by alpha in linear
    /// light, transparent where the room is seen.
    pub fn picture_for_eye(
        &self,
        in_room: &InRoom,
        format: PictureFormat,
        eye: &EyeView,
        (width_px, height_px): (u32, u32),
    ) -> Result<RgbaImage, OffscreenError> {
        let target = self.target(width_px, height_px)?;
        let canvas = Canvas::of_layers(&self.device, &target.texture, 0, format, None);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        in_room.draw(&self.queue, &mut encoder, &canvas, &[*eye]);
        self.queue.submit([encoder.finish()]);
        self.read_back(&target)
    }

    /// Draws into `target` and waits until it is done.
    pub fn draw(
        &self,
        renderer: &Renderer,
        target: &Target,
        camera: &ViewCamera,
    ) -> Result<(), OffscreenError> {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        renderer.draw(&self.queue, &mut encoder, target, camera);
        self.queue.submit([encoder.finish()]);
        self.finish()
    }

    /// Waits for everything submitted.
    pub fn finish(&self) -> Result<(), OffscreenError> {
        let polled = self.device.poll(PollType::wait_indefinitely());
        polled.map(|_| ()).map_err(|error| OffscreenError::ReadBack(error.to_string()))
    }

    /// The pixels of a target: sRGB.
    pub fn read_back(&self, target: &Target) -> Result<RgbaImage, OffscreenError> {
        read_layer(&self.device, &self.queue, &target.texture, 0)
    }
}

/// The pixels of one layer of a texture with four bytes per pixel, in the texture's own order of colours; waits for the GPU.
pub(crate) fn read_layer(
    device: &Device,
    queue: &Queue,
    texture: &Texture,
    layer: u32,
) -> Result<RgbaImage, OffscreenError> {
    let (width, height) = (texture.width(), texture.height());
    let row_bytes = width * 4;
    let padded_bytes = row_bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some("pixels"),
        size: u64::from(padded_bytes) * u64::from(height),
        usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    encoder.copy_texture_to_buffer(
        TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: Origin3d { x: 0, y: 0, z: layer },
            aspect: TextureAspect::All,
        },
        TexelCopyBufferInfo {
            buffer: &buffer,
            layout: TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded_bytes),
                rows_per_image: None,
            },
        },
        Extent3d { width, height, depth_or_array_layers: 1 },
    );
    queue.submit([encoder.finish()]);
    // A failed mapping shows as an error of get_mapped_range below.
    buffer.slice(..).map_async(MapMode::Read, |_| {});
    let read_back = |error: &dyn std::fmt::Display| OffscreenError::ReadBack(error.to_string());
    device.poll(PollType::wait_indefinitely()).map_err(|error| read_back(&error))?;
    let mapped = buffer.slice(..).get_mapped_range().map_err(|error| read_back(&error))?;
    let mut pixels = Vec::with_capacity(row_bytes as usize * height as usize);
    for row in mapped.chunks_exact(padded_bytes as usize) {
        pixels.extend_from_slice(&row[..row_bytes as usize]);
    }
    RgbaImage::from_raw(width, height, pixels)
        .ok_or_else(|| OffscreenError::ReadBack("the picture came back with a wrong size".to_owned()))
}

fn instance(backends: Backends) -> Instance {
    Instance::new(InstanceDescriptor {
        backends,
        ..InstanceDescriptor::new_without_display_handle_from_env()
    })
}

async fn request_adapter(backends: Backends) -> Result<Adapter, RequestAdapterError> {
    instance(backends).request_adapter(&RequestAdapterOptions::default()).await
}
