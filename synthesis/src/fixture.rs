//! A whole match ready to be filmed: stadium, two teams, officials, ball, camera, all from one seed.

use std::borrow::Cow;

use glam::{Quat, Vec2, Vec3};
use protocol::{camera::Camera, pitch::Pitch};

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::{
    SynthesisError,
    bystanders::{self, Bystander},
    cast::Cast,
    chain::Chain,
    furniture,
    nets::NetLook,
    operator::{Platform, Play, Tripod},
    overlay::ScoreBoard,
    props,
    render::{Actor, Focus, Scene, Solid},
    rig,
    shots::{Frame, ShotKind, Shots},
    stadium::Stadium,
    trajectories::Trajectories,
    venue::{self, Setting, Venue},
};

pub use crate::cast::Member;

/// A match that can be rendered frame by frame, in any order.
pub struct Fixture {
    /// Everything that does not move.
    pub stadium: Stadium,
    /// Everybody; the index is the identity in the truth.
    pub members: Vec<Member>,
    /// The camera of each frame; of the picture that dominates when two are mixed.
    pub cameras: Vec<Camera>,
    /// Which shots each frame shows.
    pub film: Vec<Frame>,
    /// Shutter, lens, sensor and encoder.
    pub chain: Chain,
    /// People beside the pitch who take no part.
    pub bystanders: Vec<Bystander>,
    /// Middle of the ball in each frame.
    pub ball: Vec<Vec3>,
    /// The score graphic.
    pub score: ScoreBoard,
    ball_turns: Vec<Quat>,
    net: NetLook,
    things: Vec<Solid>,
}

/// What a match is made from.
#[derive(Clone, Debug)]
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
    /// How freely place and camera are chosen.
    pub setting: Setting,
    /// The pitch that the paths were recorded on; without, the place brings its own and the paths are stretched to it.
    pub pitch: Option<Pitch>,
    /// Which cameras are on air when.
    pub shots: Shots,
    /// Where the main camera stands, instead of a place drawn from the seed.
    pub platform: Option<Platform>,
}

impl Default for FixtureOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            frames: 125,
            rate_hz: 25.0,
            size_px: (1280, 720),
            start_seconds: 0.0,
            setting: Setting::default(),
            pitch: None,
            shots: Shots::default(),
            platform: None,
        }
    }
}

/// Three letters of made-up teams.
const TEAMS: [&str; 14] =
    ["HAR", "FOR", "NOR", "MIL", "BAY", "OAK", "RIV", "SUN", "KIN", "PAL", "TOW", "LOW", "ELM", "VAL"];

impl Fixture {
    /// Prepares a match on recorded or generated paths.
    pub fn new(paths: &Trajectories, options: &FixtureOptions) -> Result<Self, SynthesisError> {
        if options.frames == 0 || options.frames > 100_000 || options.size_px.0.min(options.size_px.1) < 32 {
            return Err(SynthesisError::Options(
                "a clip needs 1..100000 frames of at least 32×32 pixels".into(),
            ));
        }
        let mut paths = paths.resampled(options.start_seconds, options.rate_hz, options.frames);
        let rate = options.rate_hz as f32;
        let pitch = match (options.pitch, options.setting) {
            (Some(pitch), _) => pitch,
            (None, Setting::Drawn) => venue::pitch_of(options.seed),
            (None, Setting::Plain) => Pitch::default(),
        };
        if options.pitch.is_none() {
            // Made-up paths fill the usual pitch: they are stretched to this one.
            let usual = Pitch::default();
            let stretch = [pitch.length_m / usual.length_m, pitch.width_m / usual.width_m];
            let [x, z] = stretch.map(|factor| factor as f32);
            paths.people.iter_mut().flat_map(|p| &mut p.xz).for_each(|p| *p *= Vec2::new(x, z));
            paths.ball.iter_mut().for_each(|b| *b *= Vec3::new(x, 1.0, z));
        }
        let Cast { members, wardrobe, ball } = Cast::new(&paths, rate, &pitch, options.seed)?;
        paths.ball = ball;
        let colours = wardrobe.teams.each_ref().map(|kit| kit.shirt);
        let Venue { stadium, mut tripod, net, style } = match options.setting {
            Setting::Plain => Venue::plain(options.seed, pitch, colours),
            Setting::Drawn => Venue::drawn(options.seed, pitch, colours),
        };
        if let Some(platform) = &options.platform {
            tripod = platform.tripod(tripod, options.size_px)?;
        }
        let play = Play {
            people: &paths.people,
            ball: &paths.ball,
            pitch: &pitch,
            rate_hz: rate,
            size_px: options.size_px,
        };
        let film = film(&play, &tripod, &options.shots);
        let rng = &mut Pcg64Mcg::seed_from_u64(options.seed ^ 0xF1_6E);
        let mut things = props::goals(&pitch, &net);
        let mut bystanders = Vec::new();
        let mut score = ScoreBoard {
            teams: [TEAMS[0].into(), TEAMS[1].into()],
            colours,
            score: [1, 0],
            clock_seconds: 27 * 60 + 14,
            style,
        };
        if options.setting == Setting::Drawn {
            let home = rng.random_range(0..TEAMS.len());
            let away = (home + rng.random_range(1..TEAMS.len())) % TEAMS.len();
            score.teams = [home, away].map(|team| TEAMS[team].to_owned());
            score.score = [0; 2].map(|_| rng.random_range(0..4));
            score.clock_seconds = rng.random_range(60..5400);
            let dug_outs = furniture::dug_outs(rng, &stadium);
            bystanders = bystanders::beside(rng, &stadium, &dug_outs, colours)?;
            things.extend(dug_outs.into_iter().map(|dug_out| dug_out.solid));
        }
        let chain = Chain::new(options.setting, options.seed, &stadium, options.size_px);
        let cameras = film.iter().map(|frame| frame.main.camera).collect();
        Ok(Self {
            stadium,
            members,
            cameras,
            film,
            chain,
            bystanders,
            ball_turns: turns(&paths.ball),
            ball: paths.ball,
            score,
            net,
            things,
        })
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
        let mut solids: Vec<Cow<'_, Solid>> = self.things.iter().map(Cow::Borrowed).collect();
        solids.extend(self.bystanders.iter().map(|person| Cow::Borrowed(&person.solid)));
        solids.push(Cow::Owned(props::ball(self.ball[frame], self.ball_turns[frame])));
        Scene { stadium: &self.stadium, actors, solids, nets: Some(self.net) }
    }

    /// The anchor of a member at a frame, world metres.
    #[must_use]
    pub fn anchor_m(&self, member: usize, frame: usize) -> Vec3 {
        self.members[member].movement.steps[frame].placement.anchor_m
    }
}

/// How the ball has turned at each place of its path: it rolls as far as it moves.
fn turns(ball: &[Vec3]) -> Vec<Quat> {
    let (mut turn, mut last) = (Quat::IDENTITY, ball.first().copied().unwrap_or_default());
    ball.iter()
        .map(|&at| {
            let moved = at - last;
            let axis = Vec3::Y.cross(moved);
            if axis.length() > 1e-4 {
                turn = Quat::from_axis_angle(axis.normalize(), moved.length() / props::BALL_RADIUS_M) * turn;
            }
            last = at;
            turn
        })
        .collect()
}

/// Films the play with the cameras of all shots.
fn film(play: &Play<'_>, tripod: &Tripod, shots: &Shots) -> Vec<Frame> {
    let takes: Vec<Vec<(Camera, Option<Focus>)>> = shots
        .0
        .iter()
        .enumerate()
        .map(|(index, shot)| {
            let first = shots.first_frame(index).min(play.ball.len().saturating_sub(1));
            let sharp = |cameras: Vec<Camera>| cameras.into_iter().map(|camera| (camera, None)).collect();
            match shot.kind {
                ShotKind::Main => sharp(play.main_camera(tripod)),
                ShotKind::HighBehind => {
                    // Behind the goal that the play is nearer to.
                    let end = if play.ball.get(first).is_some_and(|ball| ball.x < 0.0) { -1.0 } else { 1.0 };
                    sharp(play.high_behind(tripod, end))
                }
                ShotKind::CloseUp => play
                    .close_up(tripod, first)
                    .into_iter()
                    .map(|(camera, focus)| (camera, Some(focus)))
                    .collect(),
            }
        })
        .collect();
    shots.film(play.ball.len(), |shot, frame| takes[shot][frame])
}
