//! A whole match ready to be filmed: stadium, two teams, officials, ball, camera, all from one seed.

use glam::{Quat, Vec3};
use protocol::{camera::Camera, pitch::Pitch};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::{
    SynthesisError,
    cast::Cast,
    operator::{Tripod, follow},
    overlay::ScoreBoard,
    paint::Lights,
    props,
    render::{Actor, Scene, Solid},
    rig,
    stadium::{Board, Stadium},
    trajectories::Trajectories,
};

pub use crate::cast::Member;

/// A match that can be rendered frame by frame, in any order.
pub struct Fixture {
    /// Everything that does not move.
    pub stadium: Stadium,
    /// Everybody; the index is the identity in the truth.
    pub members: Vec<Member>,
    /// The camera of each frame.
    pub cameras: Vec<Camera>,
    /// Middle of the ball in each frame.
    pub ball: Vec<Vec3>,
    /// The score graphic.
    pub score: ScoreBoard,
    goals: Solid,
}

/// What a match is made from.
#[derive(Clone, Copy, Debug)]
pub struct FixtureOptions {
    /// Looks of people and stadium.
    pub seed: u64,
    /// Frames to prepare.
    pub frames: usize,
    /// Frames per second.
    pub rate_hz: f64,
    /// Picture size.
    pub size_px: (u32, u32),
    /// Where in the recording the clip starts.
    pub start_seconds: f64,
    /// The camera's place and framing.
    pub tripod: Tripod,
}

fn boards() -> Vec<Board> {
    let board = |text: &str, ground, ink| Board { text: text.into(), ground, ink };
    vec![
        board("HOLOPITCH", [0.02, 0.42, 0.36], [0.95, 0.98, 0.97]),
        board("TABLETOP FC", [0.93, 0.93, 0.95], [0.10, 0.14, 0.35]),
        board("NORTH BANK TEA", [0.10, 0.22, 0.62], [0.96, 0.96, 0.98]),
        board("EXTRA TIME", [0.96, 0.78, 0.10], [0.12, 0.10, 0.10]),
        board("OPEN GOAL", [0.62, 0.08, 0.14], [0.97, 0.95, 0.92]),
    ]
}

impl Fixture {
    /// Prepares a match on recorded or generated paths.
    pub fn new(paths: &Trajectories, options: &FixtureOptions) -> Result<Self, SynthesisError> {
        if options.frames == 0 || options.frames > 100_000 || options.size_px.0.min(options.size_px.1) < 32 {
            return Err(SynthesisError::Options(
                "a clip needs 1..100000 frames of at least 32×32 pixels".into(),
            ));
        }
        let paths = paths.resampled(options.start_seconds, options.rate_hz, options.frames);
        let rng = &mut Pcg64Mcg::seed_from_u64(options.seed);
        let mut stadium = Stadium::new(Pitch::default(), boards(), Lights::floodlights(), rng.random());
        let rate = options.rate_hz as f32;
        let Cast { members, wardrobe } = Cast::new(&paths, rate, &stadium.pitch, options.seed)?;
        let colours = wardrobe.teams.each_ref().map(|kit| kit.shirt);
        stadium.crowd = vec![[0.90, 0.90, 0.92], colours[0], colours[1], [0.10, 0.11, 0.16]];
        let cameras = follow(&options.tripod, options.size_px, &paths.ball, &paths.people, rate);
        let score = ScoreBoard {
            teams: ["HAR".into(), "FOR".into()],
            colours,
            score: [1, 0],
            clock_seconds: 27 * 60 + 14,
        };
        let goals = props::goals(&stadium.pitch);
        Ok(Self { stadium, members, cameras, ball: paths.ball, score, goals })
    }

    /// Frames that were prepared.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.cameras.len()
    }

    /// Everything in front of the camera at a frame.
    #[must_use]
    pub fn scene(&self, frame: usize) -> Scene<'_> {
        let actors = self
            .members
            .iter()
            .map(|member| {
                let step = &member.movement.steps[frame];
                let posed = rig::pose_at(&member.figure, &step.pose, step.hips_m).placed(&step.placement);
                Actor { figure: &member.figure, posed }
            })
            .collect();
        // The ball rolls as far as it moves.
        let (mut turn, mut last) = (Quat::IDENTITY, self.ball[0]);
        for &at in &self.ball[..=frame] {
            let moved = at - last;
            let axis = Vec3::Y.cross(moved);
            if axis.length() > 1e-4 {
                turn = Quat::from_axis_angle(axis.normalize(), moved.length() / props::BALL_RADIUS_M) * turn;
            }
            last = at;
        }
        Scene {
            stadium: &self.stadium,
            actors,
            solids: vec![self.goals.clone(), props::ball(self.ball[frame], turn)],
        }
    }

    /// The anchor of a member at a frame, world metres.
    #[must_use]
    pub fn anchor_m(&self, member: usize, frame: usize) -> Vec3 {
        self.members[member].movement.steps[frame].placement.anchor_m
    }
}
