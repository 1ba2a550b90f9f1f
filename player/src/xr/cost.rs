//! What the second eye costs: the same frame uploaded, recorded and submitted for one view and for two, in turn.
//!
//! Pictures are small here: their size is the GPU's work, and what is measured is the processor time of this thread.

use serde::Serialize;
use wgpu::{
    CommandEncoderDescriptor, Device, Extent3d, PollType, Queue, TextureDescriptor, TextureDimension,
    TextureUsages,
};

use super::{
    XrError,
    connection::Connection,
    ffi::clock::thread_cpu_time,
    figures::{Spread, milliseconds},
    run::Show,
};
use crate::{
    camera::EyeView,
    renderer::{Canvas, InRoom, PictureFormat, RoomScene},
    scene::{FrameScene, Stage},
};

const ROUNDS: usize = 60;
const SIDE_PX: u32 = 64;

/// Processor time of the frame loop's thread for one view and for both.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// One view: upload, record, submit.
    pub mono_cpu: Spread,
    /// Both views: upload, record, submit.
    pub stereo_cpu: Spread,
    /// Median of stereo over median of mono.
    pub stereo_over_mono: f64,
    /// The same without the upload, which happens once per frame of the match.
    pub stereo_over_mono_without_upload: f64,
}

/// Everything drawn in one way.
struct Way {
    in_room: InRoom,
    canvases: Vec<Canvas>,
    views: usize,
    with_upload: Vec<f64>,
    without_upload: Vec<f64>,
}

impl Way {
    fn new(connection: &Connection, show: &Show, stage: &Stage, format: PictureFormat, eyes: u32) -> Self {
        let (device, queue) = (&connection.graphics().device, &connection.graphics().queue);
        let picture = device.create_texture(&TextureDescriptor {
            label: Some("cost"),
            size: Extent3d { width: SIDE_PX, height: SIDE_PX, depth_or_array_layers: eyes },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format: format.colour,
            usage: TextureUsages::RENDER_ATTACHMENT,
            view_formats: &[],
        });
        let canvas = |layer| Canvas::of_layers(device, &picture, layer, format, None);
        let mut in_room = InRoom::new(device, queue, stage, format, connection.sight());
        in_room.know(device, queue, show.table.surfaces());
        Self {
            in_room,
            canvases: (0..eyes).step_by(format.views as usize).map(canvas).collect(),
            views: format.views as usize,
            with_upload: Vec::new(),
            without_upload: Vec::new(),
        }
    }

    fn measure(
        &mut self,
        device: &Device,
        queue: &Queue,
        frame: &FrameScene,
        scene: &RoomScene<'_>,
        eyes: &[EyeView; 2],
    ) {
        let begun = thread_cpu_time();
        self.in_room.upload(device, queue, frame);
        let uploaded = thread_cpu_time();
        self.in_room.prepare(device, queue, scene);
        for (canvas, eyes) in self.canvases.iter().zip(eyes.chunks(self.views)) {
            let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
            self.in_room.draw(queue, &mut encoder, canvas, eyes);
            queue.submit([encoder.finish()]);
        }
        let done = thread_cpu_time();
        self.with_upload.push(milliseconds(done - begun));
        self.without_upload.push(milliseconds(done - uploaded));
        // The GPU catches up outside of what is measured.
        let _ = device.poll(PollType::wait_indefinitely());
    }
}

/// Compares both ways with the frame on show; `None` without one.
pub(super) fn compare(connection: &Connection, show: &Show) -> Result<Option<Cost>, XrError> {
    let (Some(shown), Some(eyes)) = (show.player.shown(), connection.last_eyes()) else { return Ok(None) };
    let (device, queue) = (&connection.graphics().device, &connection.graphics().queue);
    let stereo_format = connection.format();
    let mono_format = PictureFormat { views: 1, ..stereo_format };
    let stage = connection.stage(show);
    let mut mono = Way::new(connection, show, &stage, mono_format, 1);
    let mut stereo = Way::new(connection, show, &stage, stereo_format, 2);
    let scene = show.table.scene(&show.follow);
    for _ in 0..ROUNDS {
        mono.measure(device, queue, &shown.scene, &scene, &eyes);
        stereo.measure(device, queue, &shown.scene, &scene, &eyes);
    }
    let of = |values: &[f64]| Spread::of(values.iter().copied());
    let (mono_cpu, stereo_cpu) = (of(&mono.with_upload), of(&stereo.with_upload));
    Ok(Some(Cost {
        mono_cpu,
        stereo_cpu,
        stereo_over_mono: stereo_cpu.p50_ms / mono_cpu.p50_ms,
        stereo_over_mono_without_upload: of(&stereo.without_upload).p50_ms / of(&mono.without_upload).p50_ms,
    }))
}
