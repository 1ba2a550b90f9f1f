//! Bodies made anew in every frame, as the stages before make them, followed with one mesh.

use std::f64::consts::{PI, TAU};

use image::Rgb;

use super::*;
use crate::surface::spread;

/// An upright bent tube with rounded ends, 1.8 m tall: `lean_m` is how far its top is from above its foot.
fn tube(rows: u32, columns: u32, lean_m: f64) -> Mesh {
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let (v, u) = (f64::from(row) / f64::from(rows), f64::from(column) / f64::from(columns));
            let (height, radius) = (1.8 * v, 0.2 * (v * PI).sin().max(0.0).sqrt());
            // The seam's two columns are at one place, to the bit.
            let turn = (u.fract() * TAU).sin_cos();
            let position = DVec3::new(lean_m * v * v + radius * turn.1, height, radius * turn.0);
            mesh.positions_m.push(position.as_vec3().to_array());
            mesh.uvs.push([0.1 + 0.8 * u as f32, 0.05 + 0.9 * (1.0 - v as f32)]);
            if row > 0 && column > 0 {
                let here = row * (columns + 1) + column;
                let below = here - columns - 1;
                mesh.triangles.push([below - 1, here, below]);
                mesh.triangles.push([below - 1, here - 1, here]);
            }
        }
    }
    mesh
}

/// Red above, green in the middle, blue below.
fn texture(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |_, y| match 3 * y / height {
        0 => Rgb([220, 20, 20]),
        1 => Rgb([20, 220, 20]),
        _ => Rgb([20, 20, 220]),
    })
}

/// Frames of a tube that leans more and more, cut into other triangles and dressed in another texture each time.
fn leaning(frames: usize, step_m: f64) -> Vec<(Mesh, RgbImage)> {
    (0..frames)
        .map(|frame| {
            let mesh = tube(16 + frame as u32 % 3, 14 + frame as u32 % 2, step_m * frame as f64);
            (mesh, texture(60 + 4 * (frame as u32 % 3), 90))
        })
        .collect()
}

fn bodies(frames: &[(Mesh, RgbImage)]) -> Vec<FrameBody<'_>> {
    let mut bodies = Vec::new();
    for (frame, (mesh, texture)) in frames.iter().enumerate() {
        let anchor_m = DVec3::new(frame as f64, 0.0, 0.0);
        bodies.push(FrameBody { frame: 2 * frame, anchor_m, mesh, texture, guessed_from_u: Some(0.5) });
    }
    bodies
}

fn triangles_of(positions: &[[f32; 3]], mesh: &Mesh) -> Vec<Triangle> {
    let point = |vertex: u32| glam::Vec3::from(positions[vertex as usize]).as_dvec3();
    mesh.triangles.iter().map(|corners| corners.map(point)).collect()
}

#[test]
fn one_mesh_follows_bodies_that_are_made_anew() {
    let frames = leaning(9, 0.08);
    let runs = follow(PersonId(7), &bodies(&frames));
    assert_eq!(runs.len(), 1);
    let run = &runs[0];
    assert_eq!(run.frames, (0..9).map(|frame| 2 * frame).collect::<Vec<_>>());
    assert_eq!(run.mesh, frames[4].0, "the mesh of the middle frame is at rest");
    assert_eq!((run.person, run.guessed_from_u), (PersonId(7), Some(0.5)));
    for (at, (given, _)) in frames.iter().enumerate() {
        let given = Surface::new(&triangles_of(&given.positions_m, given)).unwrap();
        let points = spread(&triangles_of(&run.positions_m[at], &run.mesh), 300);
        let squares: f64 = points.iter().map(|point| given.distance(*point).powi(2)).sum();
        let error_m = (squares / 300.0).sqrt();
        assert!(error_m < 0.008, "frame {at} is off by {error_m} m");
        assert_eq!(run.anchors_m[at].x, at as f32);
    }
}

#[test]
fn the_texture_of_every_frame_lies_on_the_one_mesh() {
    let frames = leaning(7, 0.05);
    let run = &follow(PersonId(0), &bodies(&frames))[0];
    for picture in &run.textures {
        assert_eq!((picture.width_px, picture.height_px), frames[3].1.dimensions());
        for (v, colour) in [(0.2, [220, 20, 20]), (0.5, [20, 220, 20]), (0.8, [20, 20, 220])] {
            for u in [0.2, 0.5, 0.8] {
                let (x, y) = (u * f64::from(picture.width_px), v * f64::from(picture.height_px));
                let at = (y as usize * picture.width_px as usize + x as usize) * 4;
                let found = &picture.rgba[at..at + 3];
                let near = found.iter().zip(colour).all(|(a, b): (&u8, u8)| a.abs_diff(b) < 12);
                assert!(near, "{found:?} at {u} {v} and not {colour:?}");
                assert_eq!(picture.rgba[at + 3], 255);
            }
        }
    }
}

#[test]
fn where_the_mesh_fits_no_more_another_takes_over() {
    let mut frames = leaning(5, 0.05);
    // The body is taken to be elsewhere all of a sudden, as when two people are exchanged.
    frames.extend((0..4).map(|_| {
        let mut mesh = tube(16, 14, 0.0);
        mesh.positions_m.iter_mut().for_each(|p| p[0] += 0.8);
        (mesh, texture(60, 90))
    }));
    let runs = follow(PersonId(0), &bodies(&frames));
    assert!(runs.len() >= 2, "one mesh for both");
    let mut all: Vec<usize> = runs.iter().flat_map(|run| run.frames.clone()).collect();
    all.sort_unstable();
    assert_eq!(all, (0..9).map(|frame| 2 * frame).collect::<Vec<_>>());
    assert!(
        runs.iter()
            .all(|run| run.frames.iter().all(|frame| *frame < 10)
                || run.frames.iter().all(|frame| *frame >= 10))
    );
}

#[test]
fn a_colour_seen_counts_more_than_one_guessed_and_flicker_is_calmed() {
    let picture = |colour: u8, counts: u8| PixelImage {
        width_px: 1,
        height_px: 1,
        rgba: vec![colour, colour, colour, counts],
    };
    let seen: Vec<PixelImage> = (0..9).map(|frame| picture(100 + 10 * (frame % 2), 255)).collect();
    let calm = resample::steady(&seen);
    let steps: Vec<u8> = calm.windows(2).map(|pair| pair[0].rgba[0].abs_diff(pair[1].rgba[0])).collect();
    assert!(steps.iter().all(|step| *step <= 3), "{steps:?}");
    let mixed: Vec<PixelImage> =
        (0..9).map(|frame| if frame == 4 { picture(200, 255) } else { picture(100, 40) }).collect();
    let middle = resample::steady(&mixed)[4].rgba[0];
    assert!(middle > 155, "what was seen became {middle}");
}

#[test]
fn a_body_with_broken_triangles_is_left_out() {
    let mut frames = leaning(3, 0.05);
    frames[1].0.triangles.push([0, 1, 999_999]);
    let runs = follow(PersonId(0), &bodies(&frames));
    assert!(runs.iter().all(|run| !run.frames.contains(&2)));
    assert!(follow(PersonId(0), &[]).is_empty());
}
