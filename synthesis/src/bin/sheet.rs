//! Contact sheets to look at: `sheet actions --out DIR` draws every gait and action in phases and from two sides,
//! `sheet kits --out DIR` people of several matches close up.

use std::{path::PathBuf, process::ExitCode};

use glam::{DVec3, Vec2, Vec3};
use image::{RgbImage, imageops};
use protocol::{camera::Camera, pitch::Pitch};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use synthesis::{
    SynthesisError,
    acts::Kind,
    body::BaseBody,
    cast::Cast,
    figure::Figure,
    motion::Motions,
    movement::{Habits, Movement},
    output::make_folder,
    play::Event,
    render::{Actor, Scene, Window},
    rig,
    sensor::Sensor,
    stadium::Stadium,
    trajectories::{Path2, Role, Trajectories},
    venue::Venue,
};

const USAGE: &str = "usage: sheet actions|kits --out DIR [--seed N] [--height PIXELS]

example: cargo run -p synthesis --bin sheet -- actions --out target/sheets";

const RATE_HZ: f32 = 25.0;

struct Options {
    what: String,
    out: PathBuf,
    seed: u64,
    height_px: u32,
}

fn options() -> Option<Options> {
    let mut arguments = std::env::args().skip(1);
    let mut options = Options { what: arguments.next()?, out: PathBuf::new(), seed: 1, height_px: 150 };
    while let Some(name) = arguments.next() {
        let value = arguments.next()?;
        match name.as_str() {
            "--out" => options.out = value.into(),
            "--seed" => options.seed = value.parse().ok()?,
            "--height" => options.height_px = value.parse().ok()?,
            _ => return None,
        }
    }
    let known = matches!(options.what.as_str(), "actions" | "kits");
    (known && !options.out.as_os_str().is_empty() && (16..2000).contains(&options.height_px))
        .then_some(options)
}

/// One person in the middle of a small picture, seen along `from` (radians about y from in front).
fn cell(
    stadium: &Stadium,
    actor: Actor<'_>,
    at: Vec3,
    from: f32,
    high: u32,
) -> Result<RgbImage, SynthesisError> {
    let size = (high * 3 / 2, high * 3 / 2);
    let away = 30.0;
    let eye = at.as_dvec3() + DVec3::new(f64::from(from.sin()) * away, 9.0, f64::from(from.cos()) * away);
    let distance = eye.distance(at.as_dvec3());
    let camera =
        Camera::looking_at(size, f64::from(high) * distance / 1.8, eye, at.as_dvec3() + DVec3::Y * 0.85);
    let scene = Scene { stadium, actors: vec![actor], solids: Vec::new(), nets: None };
    let window = Window { first: [0, 0], size: [size.0 as usize, size.1 as usize] };
    let light = scene.render(&camera, window, 3);
    Sensor::clean().expose(&light, &mut Pcg64Mcg::seed_from_u64(1))
}

fn acted(
    figure: &Figure,
    motions: &Motions,
    path: impl Fn(f32) -> Vec2,
    event: Option<Event>,
    role: Role,
) -> Result<Movement, SynthesisError> {
    let xz = (0..125).map(|k| path(k as f32 / RATE_HZ)).collect();
    let path = Path2 { role, team: Some(0), number: None, xz };
    let habits = Habits { mood: 0.7, phase: 0.1, size: 1.0 };
    let events: Vec<Event> = event.into_iter().collect();
    Movement::along(&path, &vec![Vec3::new(0.0, 0.11, 20.0); 125], RATE_HZ, motions, habits, &events, figure)
}

/// Every gait and action: one file each, phases from left to right, two directions below each other.
fn actions(options: &Options) -> Result<(), SynthesisError> {
    let paths = Trajectories::generated(options.seed, 2.0).resampled(0.0, 25.0, 3);
    let cast = Cast::new(&paths, RATE_HZ, &Pitch::default(), options.seed)?;
    let motions = Motions::shipped()?;
    BaseBody::load()?;
    let stadium = Venue::plain(3, Pitch::default(), [[0.9; 3], [0.1; 3]]).stadium;
    let gaits: [(&str, f32, f32); 8] = [
        ("stand", 0.0, 0.0),
        ("walk", 1.3, 0.0),
        ("jog", 3.2, 0.0),
        ("run", 5.0, 0.0),
        ("sprint", 8.0, 0.0),
        ("sideways", 1.6, 1.57),
        ("backwards", 1.6, std::f32::consts::PI),
        ("keeper", 0.8, 1.57),
    ];
    let draw =
        |name: &str, movement: &Movement, figure: &Figure, frames: &[usize]| -> Result<(), SynthesisError> {
            let wide = options.height_px * 3 / 2;
            let mut sheet = RgbImage::new(wide * frames.len() as u32, wide * 2);
            for (column, &frame) in frames.iter().enumerate() {
                let step = &movement.steps[frame.min(movement.steps.len() - 1)];
                let posed = rig::pose_at(figure, &step.pose, step.hips_m).placed(&step.placement);
                for (row, from) in [0.55f32, 1.75].into_iter().enumerate() {
                    let actor = Actor { figure, posed: posed.clone() };
                    let picture = cell(&stadium, actor, step.placement.anchor_m, from, options.height_px)?;
                    imageops::replace(
                        &mut sheet,
                        &picture,
                        (column as u32 * wide).into(),
                        (row as u32 * wide).into(),
                    );
                }
            }
            let file = options.out.join(format!("{name}.png"));
            sheet.save(&file).map_err(SynthesisError::Picture)?;
            println!("{}", file.display());
            Ok(())
        };
    for (name, speed, direction) in gaits {
        let way = Vec2::new(direction.sin(), direction.cos()) * speed;
        let (role, who) = if name == "keeper" { (Role::Goalkeeper, 0) } else { (Role::Player, 3) };
        let figure = &cast.members[who].figure;
        let movement = acted(figure, &motions, |t| way * t, None, role)?;
        draw(name, &movement, figure, &[50, 52, 54, 56, 58, 60, 62, 64, 66, 68])?;
    }
    for (kind, speed) in [
        (Kind::Pass, 2.0),
        (Kind::Shot, 4.0),
        (Kind::Header, 2.0),
        (Kind::ThrowIn, 0.0),
        (Kind::Tackle, 5.0),
        (Kind::Dive, 0.0),
        (Kind::Fall, 5.0),
    ] {
        let keeper = kind == Kind::Dive;
        let figure = &cast.members[if keeper { 0 } else { 5 }].figure;
        let lift_m = if kind == Kind::Header { 0.45 } else { 0.0 };
        let event = Event { kind, time_s: 2.0, facing: Some(0.0), mirrored: Some(false), lift_m };
        let path = |t: f32| {
            let slow = kind.goes_down() && t > 1.7;
            Vec2::new(0.0, speed * if slow { 1.7 + 0.5 * (1.0 - (-(t - 1.7) / 0.5).exp()) } else { t })
        };
        let role = if keeper { Role::Goalkeeper } else { Role::Player };
        let movement = acted(figure, &motions, path, Some(event), role)?;
        let frames: [usize; 10] = match kind {
            Kind::Tackle | Kind::Dive | Kind::Fall => [38, 42, 46, 50, 55, 62, 72, 82, 90, 98],
            Kind::ThrowIn => [26, 32, 38, 42, 46, 48, 50, 54, 60, 68],
            _ => [38, 41, 44, 46, 48, 50, 52, 54, 58, 64],
        };
        draw(&format!("{kind:?}").to_lowercase(), &movement, figure, &frames)?;
    }
    Ok(())
}

/// People of eight matches: two of each team, both goalkeepers and an official, from in front and behind.
fn kits(options: &Options) -> Result<(), SynthesisError> {
    let stadium = Venue::plain(3, Pitch::default(), [[0.9; 3], [0.1; 3]]).stadium;
    let wide = options.height_px * 3 / 2;
    for seed in options.seed..options.seed + 8 {
        let paths = Trajectories::generated(seed, 2.0).resampled(0.5, 25.0, 3);
        let cast = Cast::new(&paths, RATE_HZ, &Pitch::default(), seed)?;
        let mut sheet = RgbImage::new(wide * 8, wide * 2);
        for (column, who) in [3, 6, 9, 13, 16, 0, 11, 22].into_iter().enumerate() {
            let member = &cast.members[who];
            let step = &member.movement.steps[1];
            let posed = rig::pose_at(&member.figure, &step.pose, step.hips_m).placed(&step.placement);
            for row in 0..2u32 {
                let actor = Actor { figure: &member.figure, posed: posed.clone() };
                let from = step.placement.yaw + 0.4 + row as f32 * 2.9;
                let picture = cell(&stadium, actor, step.placement.anchor_m, from, options.height_px)?;
                imageops::replace(&mut sheet, &picture, (column as u32 * wide).into(), (row * wide).into());
            }
        }
        let file = options.out.join(format!("kits{seed}.png"));
        sheet.save(&file).map_err(SynthesisError::Picture)?;
        println!("{}", file.display());
    }
    Ok(())
}

fn main() -> ExitCode {
    let Some(options) = options() else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    match make_folder(&options.out)
        .and_then(|()| if options.what == "actions" { actions(&options) } else { kits(&options) })
    {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(1)
        }
    }
}
