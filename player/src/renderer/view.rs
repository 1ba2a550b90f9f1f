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
    const EYE: &str = "@builtin(view_index) eye_index: i32, ";
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

    #[test]
    fn one_view_fills_both_places() {
        let view = View { clip_from_world: Mat4::IDENTITY, eye_m: Vec3::X };
        let [left, right] = uniform(&[view]).unwrap();
        assert_eq!((left.eye_m, right.eye_m), ([1.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]));
        assert!(uniform(&[]).is_none());
    }
}
