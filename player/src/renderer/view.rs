//! Where a picture is seen from, as the shaders read it: one view, or the two of a headset drawn in one pass.
//!
//! The shaders are written for one view. For two, [`for_two_views`] lets every entry point ask which eye it draws for.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};

use crate::camera::ViewCamera;

/// Views that one pass can draw.
pub(super) const MOST_VIEWS: usize = 2;

/// One view of the pitch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// World metres to clip space; depth is reversed, 0 at infinity.
    pub clip_from_world: Mat4,
    /// Centre of projection, world metres.
    pub eye_m: Vec3,
}

impl From<&ViewCamera> for View {
    fn from(camera: &ViewCamera) -> Self {
        Self { clip_from_world: camera.clip_from_world(), eye_m: camera.position_m.as_vec3() }
    }
}

/// `View` of `common.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct ViewUniform {
    clip_from_world: [[f32; 4]; 4],
    eye_m: [f32; 4],
}

impl From<&View> for ViewUniform {
    fn from(view: &View) -> Self {
        Self {
            clip_from_world: view.clip_from_world.to_cols_array_2d(),
            eye_m: view.eye_m.extend(1.0).into(),
        }
    }
}

/// The uniform of up to [`MOST_VIEWS`] views; missing ones repeat the last.
pub(super) fn uniform(views: &[View]) -> Option<[ViewUniform; MOST_VIEWS]> {
    let last = views.last()?;
    let mut uniform = [ViewUniform::from(last); MOST_VIEWS];
    for (slot, view) in uniform.iter_mut().zip(views) {
        *slot = view.into();
    }
    Some(uniform)
}

/// A shader for one view turned into one for two (multiview): `view` becomes the view of the eye being drawn.
///
/// WGSL has no way to leave a built-in input out, and `view_index` does not exist where multiview does not; so the text
/// is changed, as the shading language's own includes would do it.
pub(super) fn for_two_views(source: &str) -> String {
    const EYE: &str = "@builtin(view_index) eye_index: u32, ";
    source
        .replace("var<uniform> view: View;", "var<uniform> views: array<View, 2>;")
        .replace("view.clip_from_world", "views[eye_index].clip_from_world")
        .replace("view.eye_m", "views[eye_index].eye_m")
        .replace("fn vertex(", &format!("fn vertex({EYE}"))
        .replace("fn fragment(", &format!("fn fragment({EYE}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_views_are_told_apart_in_every_entry_point() {
        let mono = "@group(0) @binding(0) var<uniform> view: View;\n@vertex\nfn vertex(\n  @location(0) p: vec3<f32>) \
                    -> F { out.clip = view.clip_from_world * p; }\nfn fragment(in: F) { view.eye_m; }";
        let stereo = for_two_views(mono);
        assert_eq!(stereo.matches("@builtin(view_index)").count(), 2, "{stereo}");
        assert!(
            stereo.contains("views: array<View, 2>") && stereo.contains("views[eye_index].clip_from_world")
        );
        assert!(stereo.contains("views[eye_index].eye_m") && !stereo.contains(" view."), "{stereo}");
    }

    fn mean_difference(one: &image::RgbaImage, two: &image::RgbaImage) -> f64 {
        let differences = one.as_raw().iter().zip(two.as_raw()).map(|(a, b)| f64::from(a.abs_diff(*b)));
        differences.sum::<f64>() / one.as_raw().len() as f64
    }

    /// On a software adapter: the first layer of the stereo picture is the mono picture of its eye, but for the rounding of
    /// shaders that were compiled apart. The software adapter of Mesa 22.3 loses the second layer of such pictures and
    /// averages samples into the first only; 25.0 does neither, and there the headset's golden pictures hold both eyes.
    #[test]
    fn one_pass_for_two_views_draws_what_two_passes_draw() {
        use crate::{
            camera::{OrbitCamera, ViewCamera},
            offscreen::{Offscreen, read_layer},
            renderer::{Canvas, PictureFormat, Renderer, Surroundings},
            scene::Stage,
        };
        use wgpu::{Extent3d, Features, TextureDescriptor, TextureDimension, TextureUsages};

        let gpu = Offscreen::open_software().ok();
        let Some(gpu) = gpu.filter(|gpu| gpu.device.features().contains(Features::MULTIVIEW)) else {
            let required = std::env::var_os("HOLOPITCH_REQUIRE_TOOLS").is_some_and(|value| value == "1");
            assert!(!required, "no software adapter with multiview");
            return println!("skipped: no software adapter with multiview");
        };
        let stage = Stage::new(protocol::pitch::Pitch::default());
        let table = OrbitCamera::table(&protocol::pitch::Pitch::default(), 1.5).view(1.5);
        let beside = ViewCamera { position_m: table.position_m + glam::DVec3::X * 6.5, ..table };
        let picture = |views: u32, surroundings| {
            let format = PictureFormat { views, surroundings, samples: 1, ..PictureFormat::default() };
            let texture = gpu.device.create_texture(&TextureDescriptor {
                label: None,
                size: Extent3d { width: 192, height: 128, depth_or_array_layers: 2 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format: format.colour,
                usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            let renderer = Renderer::with_format(&gpu.device, &gpu.queue, &stage, format);
            let both = [View::from(&table), View::from(&beside)];
            for (layer, views) in (0..2).step_by(views as usize).zip(both.chunks(views as usize)) {
                let canvas = Canvas::of_layers(&gpu.device, &texture, layer, format, None);
                let mut encoder = gpu.device.create_command_encoder(&Default::default());
                renderer.draw_views(&gpu.queue, &mut encoder, &canvas, views);
                gpu.queue.submit([encoder.finish()]);
            }
            read_layer(&gpu.device, &gpu.queue, &texture, 0).unwrap()
        };
        for surroundings in [Surroundings::Backdrop, Surroundings::Dark, Surroundings::Transparent] {
            let (one_pass, two_passes) = (picture(2, surroundings), picture(1, surroundings));
            let apart = mean_difference(&one_pass, &two_passes);
            assert!(apart < 1.0, "{surroundings:?}: {apart} of 255");
            let corner = one_pass.get_pixel(0, 0).0;
            assert_eq!(corner[3] == 0, surroundings == Surroundings::Transparent, "{corner:?}");
        }
    }

    #[test]
    fn one_view_fills_both_places() {
        let view = View { clip_from_world: Mat4::IDENTITY, eye_m: Vec3::X };
        let [left, right] = uniform(&[view]).unwrap();
        assert_eq!((left.eye_m, right.eye_m), ([1.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]));
        assert!(uniform(&[]).is_none());
    }
}
