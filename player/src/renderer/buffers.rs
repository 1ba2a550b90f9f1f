//! Vertices and indices on the GPU, kept and reused from frame to frame.

use std::ops::Range;

use bytemuck::Pod;
use wgpu::{Buffer, BufferDescriptor, BufferUsages, Device, IndexFormat, Queue, RenderPass};

/// A buffer that grows when more has to be held.
pub(super) struct Growing {
    buffer: Buffer,
    usage: BufferUsages,
}

impl Growing {
    pub(super) fn new(device: &Device, usage: BufferUsages) -> Self {
        Self { buffer: allocate(device, usage, 1 << 12), usage }
    }

    pub(super) fn write<T: Pod>(&mut self, device: &Device, queue: &Queue, content: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(content);
        if bytes.len() as u64 > self.buffer.size() {
            self.buffer = allocate(device, self.usage, (bytes.len() as u64).next_power_of_two());
        }
        if !bytes.is_empty() {
            // Every vertex and index here is a multiple of four bytes, as writing demands.
            queue.write_buffer(&self.buffer, 0, bytes);
        }
    }

    pub(super) fn buffer(&self) -> &Buffer {
        &self.buffer
    }
}

fn allocate(device: &Device, usage: BufferUsages, size: u64) -> Buffer {
    device.create_buffer(&BufferDescriptor {
        label: None,
        size,
        usage: usage | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// Indexed triangles on the GPU.
pub(super) struct Triangles {
    vertices: Growing,
    indices: Growing,
    count: u32,
}

impl Triangles {
    pub(super) fn new(device: &Device) -> Self {
        Self {
            vertices: Growing::new(device, BufferUsages::VERTEX),
            indices: Growing::new(device, BufferUsages::INDEX),
            count: 0,
        }
    }

    pub(super) fn write<T: Pod>(&mut self, device: &Device, queue: &Queue, vertices: &[T], indices: &[u32]) {
        self.vertices.write(device, queue, vertices);
        self.indices.write(device, queue, indices);
        self.count = indices.len() as u32;
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    pub(super) fn draw(&self, pass: &mut RenderPass<'_>) {
        self.draw_part(pass, 0..self.count);
    }

    /// The triangles of some of the indices.
    pub(super) fn draw_part(&self, pass: &mut RenderPass<'_>, part: Range<u32>) {
        let part = part.start..part.end.min(self.count);
        if !part.is_empty() {
            pass.set_vertex_buffer(0, self.vertices.buffer().slice(..));
            pass.set_index_buffer(self.indices.buffer().slice(..), IndexFormat::Uint32);
            pass.draw_indexed(part, 0, 0..1);
        }
    }
}
