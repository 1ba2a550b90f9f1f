//! The truth agrees with itself: pixels with surfaces, boxes with masks, joints with bodies, points with their projections.

use std::sync::OnceLock;

use image::GrayImage;

use super::*;
use crate::{
    dataset::plane_depth,
    fixture::FixtureOptions,
    operator::Platform,
    raster::{self, Raster},
    trajectories::Trajectories,
};

/// A fixture with one frame measured, shared by the tests.
fn measured() -> &'static (Fixture, FrameTruth, Maps) {
    static MEASURED: OnceLock<(Fixture, FrameTruth, Maps)> = OnceLock::new();
    MEASURED.get_or_init(|| {
        let options = FixtureOptions {
            seed: 5,
            frames: 3,
            rate_hz: 25.0,
            size_px: (640, 360),
            start_seconds: 0.5,
            // Near enough that lines and wrists are about a pixel wide.
            platform: Some(Platform { position_m: DVec3::new(0.0, 17.0, 62.0), player_px: Some(32.0) }),
            ..FixtureOptions::default()
        };
        let fixture = Fixture::new(&Trajectories::generated(5, 2.0), &options).unwrap();
        let (truth, maps) = measure(&fixture, &fixture.scene(2), 2, true);
        (fixture, truth, maps.unwrap())
    })
}

/// Depths along the optical axis at which the ray of a pixel meets a person's triangles (Möller and Trumbore 1997).
fn meetings(camera: &Camera, scene: &Scene<'_>, person: usize, pixel: DVec2) -> Vec<f64> {
    let ray = camera.ray(pixel);
    let actor = &scene.actors[person];
    let triangles = actor.figure.triangles.iter();
    triangles
        .filter_map(|triangle| {
            let [a, b, c] = triangle.map(|v| actor.posed.positions[v as usize].as_dvec3());
            let (ab, ac) = (b - a, c - a);
            let across = ray.direction.cross(ac);
            let determinant = ab.dot(across);
            if determinant.abs() < 1e-12 {
                return None;
            }
            let from_a = ray.origin - a;
            let u = from_a.dot(across) / determinant;
            let turned = from_a.cross(ab);
            let v = ray.direction.dot(turned) / determinant;
            let distance = ac.dot(turned) / determinant;
            let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0;
            inside.then(|| distance * ray.direction.dot(camera.forward()))
        })
        .collect()
}

#[test]
fn sheets_hold_the_first_and_last_surface_within_a_millimetre() {
    let (fixture, truth, maps) = measured();
    let scene = fixture.scene(2);
    let mut checked = 0;
    for person in truth.people.iter().filter(|person| person.in_view) {
        let sheet = person.sheet.unwrap();
        let anchor = DVec3::from(person.anchor_m);
        for place in (0..sheet.size[0] * sheet.size[1]).step_by(11) {
            let (x, y) = (place % sheet.size[0], place / sheet.size[0]);
            let value = |map: &image::ImageBuffer<image::Luma<u16>, Vec<u16>>| {
                map.get_pixel(sheet.at[0] + x, sheet.at[1] + y)[0]
            };
            let pixel = DVec2::new(f64::from(sheet.first_px[0] + x), f64::from(sheet.first_px[1] + y));
            let met = meetings(&truth.camera, &scene, person.id as usize, pixel);
            let Some(first) = met.iter().copied().reduce(f64::min) else {
                // A ray along an edge may be inside for the one and outside for the other.
                continue;
            };
            let last = met.iter().copied().fold(first, f64::max);
            if value(&maps.front) == 0 {
                continue;
            }
            let plane = plane_depth(&truth.camera, anchor, pixel);
            let depth = |value: u16| plane + (f64::from(value) - f64::from(OFFSET_ZERO)) * OFFSET_STEP_M;
            let apart = [depth(value(&maps.front)) - first, depth(value(&maps.back)) - last];
            assert!(apart.iter().all(|d| d.abs() < 0.001), "person {}: {apart:?} m at {pixel}", person.id);
            checked += 1;
        }
    }
    assert!(checked > 100, "{checked} pixels");
}

#[test]
fn masks_boxes_and_shares_agree() {
    let (_, truth, maps) = measured();
    let mut hidden = 0;
    for person in &truth.people {
        let own = |map: &GrayImage| {
            map.enumerate_pixels().filter(|(_, _, v)| u32::from(v[0]) == person.id + 1).count()
        };
        let seen = own(&maps.people);
        let sheet = person.sheet.unwrap();
        let whole = (0..sheet.size[0] * sheet.size[1])
            .filter(|place| {
                let (x, y) = (place % sheet.size[0], place / sheet.size[0]);
                maps.front.get_pixel(sheet.at[0] + x, sheet.at[1] + y)[0] > 0
            })
            .count();
        let share = seen as f64 / whole.max(1) as f64;
        assert!(
            (share.min(1.0) - person.visible_share).abs() < 0.002,
            "{share} and {}",
            person.visible_share
        );
        hidden += usize::from(person.visible_share < 0.9);
        if let Some([left, top, right, bottom]) = person.visible_box_px {
            let [l, t, r, b] = person.box_px;
            assert!(
                f64::from(left) >= l
                    && f64::from(top) >= t
                    && f64::from(right) <= r
                    && f64::from(bottom) <= b
            );
        } else {
            assert_eq!(seen, 0);
        }
    }
    println!("{hidden} of {} people are partly hidden", truth.people.len());
}

#[test]
fn boxes_are_tight_within_a_pixel() {
    /// Samples along the side of a pixel: a hand is thinner than a pixel.
    const FINE: usize = 8;
    let (fixture, truth, _) = measured();
    let scene = fixture.scene(2);
    for person in truth.people.iter().filter(|person| person.box_inside >= 1.0) {
        let [left, top, right, bottom] = person.box_px;
        let first = [left.floor() as i32 - 2, top.floor() as i32 - 2];
        let size = [(right - left).ceil() as usize + 5, (bottom - top).ceil() as usize + 5];
        let grid = Grid::over_pixels(first, size, FINE);
        let actor = &scene.actors[person.id as usize];
        let (mut raster, mut projected) = (Raster::new(grid), Vec::new());
        raster::project(&truth.camera, &grid, &actor.posed.positions, &mut projected);
        raster.draw(&projected, &actor.figure.triangles, 0);
        let (mut low, mut high) = (DVec2::MAX, DVec2::MIN);
        let samples = (0..grid.width * grid.height).map(|place| (place % grid.width, place / grid.width));
        for (i, j) in samples.filter(|&(i, j)| raster.at(i, j).is_some()) {
            let at = DVec2::from(grid.pixel(i, j));
            low = low.min(at);
            high = high.max(at);
        }
        let apart = [low.x - left, low.y - top, right - high.x, bottom - high.y];
        assert!(apart.iter().all(|side| (-0.02..1.0).contains(side)), "person {}: {apart:?} px", person.id);
    }
}

#[test]
fn reprojected_joints_fall_in_the_masks() {
    let (_, truth, maps) = measured();
    let (mut inside, mut all) = (0, 0);
    for person in truth.people.iter().filter(|person| person.box_inside >= 1.0) {
        let sheet = person.sheet.unwrap();
        for (joint, px) in person.joints_m.iter().zip(&person.joints_px) {
            let projected = truth.camera.project(DVec3::from(*joint)).unwrap();
            // The world is rounded to half a millimetre, pixels to a twentieth.
            assert!(projected.distance(DVec2::from(*px)) < 0.1);
        }
        // Nose, shoulders, elbows, wrists, hips, knees, ankles: the others are guessed beyond the body's surface.
        for joint in [0, 11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28] {
            let at =
                DVec2::from(person.joints_px[joint]).round() - DVec2::from(sheet.first_px.map(f64::from));
            let near = |dx: i32, dy: i32| {
                let (x, y) = (at.x as i32 + dx, at.y as i32 + dy);
                x >= 0
                    && y >= 0
                    && (x as u32) < sheet.size[0]
                    && (y as u32) < sheet.size[1]
                    && maps.front.get_pixel(sheet.at[0] + x as u32, sheet.at[1] + y as u32)[0] > 0
            };
            all += 1;
            // A wrist is about as wide as one pixel here: its neighbours count.
            inside += usize::from((-1..=1).any(|dx| (-1..=1).any(|dy| near(dx, dy))));
        }
    }
    assert!(all > 60, "{all} joints");
    assert_eq!(inside, all, "joints inside the bodies, of all");
}

#[test]
fn people_stand_on_the_pitch_under_their_hips() {
    let (_, truth, _) = measured();
    let in_view: Vec<_> = truth.people.iter().filter(|p| p.in_view).collect();
    assert!(in_view.len() >= 4, "{} people in view", in_view.len());
    for person in in_view {
        let anchor = DVec3::from(person.anchor_m);
        assert!(anchor.y.abs() < 1e-9);
        let hips = (DVec3::from(person.joints_m[23]) + DVec3::from(person.joints_m[24])) / 2.0;
        assert!((hips - anchor).with_y(0.0).length() < 0.01, "hips over the anchor");
        assert!((0.5..1.3).contains(&hips.y));
    }
}

#[test]
fn the_balls_pixel_is_its_place_projected() {
    let (fixture, truth, _) = measured();
    let ball = &truth.ball;
    let px = truth.camera.project(fixture.ball[2].as_dvec3()).unwrap();
    assert!(DVec2::from(ball.px.unwrap()).distance(px) < 0.01);
    let edge =
        fixture.ball[2].as_dvec3() + truth.camera.rotation.transpose() * DVec3::X * f64::from(BALL_RADIUS_M);
    let radius = truth.camera.project(edge).unwrap().distance(px);
    assert!((ball.radius_px - radius).abs() < 0.02, "{} and {radius} px", ball.radius_px);
    assert!((0.0..=1.0).contains(&ball.visible_share));
}

#[test]
fn pitch_points_are_their_places_projected_and_painted_where_the_map_says() {
    let (_, truth, maps) = measured();
    assert!(truth.pitch_points.len() >= 4, "{} points", truth.pitch_points.len());
    for point in &truth.pitch_points {
        let px = truth.camera.project(DVec3::from(point.world_m)).unwrap();
        assert!(px.distance(DVec2::from(point.px)) < 0.1, "{}", point.name);
        let on_the_ground = point.world_m[1] == 0.0;
        let at = px.round();
        let inside = at.x >= 0.0 && at.y >= 0.0 && at.x < 640.0 && at.y < 360.0;
        if on_the_ground && inside {
            let (x, y) = (at.x as u32, at.y as u32);
            let near = (x.saturating_sub(2)..=(x + 2).min(639))
                .any(|x| (y.saturating_sub(2)..=(y + 2).min(359)).any(|y| maps.lines.get_pixel(x, y)[0] > 0));
            assert!(near, "{} at {px}: no paint", point.name);
        }
    }
}

#[test]
fn maps_are_pictures_that_read_back() {
    let (_, _, maps) = measured();
    for (kind, bytes) in maps.files().unwrap() {
        let picture = image::load_from_memory(&bytes).unwrap();
        match kind {
            "front" => assert_eq!(picture.into_luma16(), maps.front),
            "back" => assert_eq!(picture.into_luma16(), maps.back),
            "people" => assert_eq!(picture.into_luma8(), maps.people),
            _ => assert_eq!(picture.into_luma8(), maps.lines),
        }
    }
}
