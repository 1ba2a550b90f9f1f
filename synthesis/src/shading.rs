//! The colour of a sample on a person or a thing: interpolates the surface and lights it as its place on the pitch is lit.

use glam::Vec3;
use protocol::camera::Camera;

use crate::{
    paint::{self, Lights, SurfacePoint},
    raster::Raster,
    render::{Drawn, Scene},
};

/// Shades samples of one scene.
pub(crate) struct Shader<'a> {
    scene: &'a Scene<'a>,
    eye: Vec3,
    /// The light on each actor, then on each thing.
    lights: Vec<Lights>,
}

impl<'a> Shader<'a> {
    pub(crate) fn new(scene: &'a Scene<'a>, camera: &Camera) -> Self {
        let people = scene.actors.iter().map(|actor| actor.posed.hips);
        let things = scene.solids.iter().map(|solid| {
            // A thing is lit as its middle is; it is one thing or stands together.
            let count = solid.positions.len().max(1) as f32;
            solid.positions.iter().sum::<Vec3>() / count
        });
        let lights = people.chain(things).map(|place| scene.stadium.lights_at(place)).collect();
        Self { scene, eye: camera.position.as_vec3(), lights }
    }

    /// Light from the sample (i, j) on a triangle.
    pub(crate) fn shade(&self, drawn: &Drawn, triangle: u32, i: usize, j: usize) -> Vec3 {
        let Some(mesh) = drawn.mesh_of(triangle) else { return Vec3::ZERO };
        let index = (triangle - drawn.firsts[mesh]) as usize;
        let projected = &drawn.vertices[mesh];
        let lights = &self.lights[mesh];
        let weights_of = |corners: [u32; 3]| {
            let [Some(a), Some(b), Some(c)] = corners.map(|v| projected[v as usize]) else {
                return [1.0, 0.0, 0.0];
            };
            Raster::weights(a, b, c, i, j)
        };
        if let Some(actor) = self.scene.actors.get(mesh) {
            let corners = actor.figure.triangles[index];
            let weights = weights_of(corners);
            let mix =
                |values: [Vec3; 3]| values[0] * weights[0] + values[1] * weights[1] + values[2] * weights[2];
            let vertices = corners.map(|v| &actor.figure.vertices[v as usize]);
            let position = mix(corners.map(|v| actor.posed.positions[v as usize]));
            let point = SurfacePoint {
                rest: mix(vertices.map(|v| v.rest)),
                normal: mix(corners.map(|v| actor.posed.normals[v as usize])).normalize_or(Vec3::Y),
                hem_m: vertices.iter().zip(weights).map(|(v, weight)| v.hem_m * weight).sum(),
                material: actor.figure.materials[index],
            };
            let towards = (self.eye - position).normalize_or(Vec3::Z);
            paint::lit(actor.figure, &point, towards, lights, position.y).min(Vec3::splat(1.3))
        } else {
            let Some(solid) = self.scene.solids.get(mesh - self.scene.actors.len()) else {
                return Vec3::ZERO;
            };
            let corners = solid.triangles[index];
            let weights = weights_of(corners);
            let normals = corners.map(|v| solid.normals[v as usize]);
            let normal = normals[0] * weights[0] + normals[1] * weights[1] + normals[2] * weights[2];
            (solid.colours[index] * lights.on(normal.normalize_or(Vec3::Y), 1.0)).min(Vec3::splat(1.3))
        }
    }
}
