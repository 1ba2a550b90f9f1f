//! A spell of play that nobody played: two teams in formation that follow the ball, pass it, cross, head, shoot, tackle,
//! lose it over the touchline and throw it in. Everything random follows from the seed; the ball obeys [`crate::flight`].

use glam::{Vec2, Vec3};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::{
    flight::Flight,
    props::BALL_RADIUS_M,
    trajectories::{Path2, Role, Trajectories, smooth},
};

mod ball;
mod people;

use people::Person;

const RATE_HZ: f32 = 50.0;
const STEP_S: f32 = 1.0 / RATE_HZ;
/// Play runs for so long before it is recorded, seconds.
const WARM_UP_S: f32 = 8.0;
/// Half of the pitch, metres.
const HALF: Vec2 = Vec2::new(52.5, 34.0);

/// Places of a team that attacks towards +x, metres, as lines from the goalkeeper on: x of the line, then each z.
const FORMATIONS: [&[(f32, &[f32])]; 3] = [
    &[
        (-49.0, &[0.0]),
        (-28.0, &[-21.0, -7.0, 7.0, 21.0]),
        (-11.0, &[-22.0, -7.0, 8.0, 22.0]),
        (6.0, &[-6.0, 7.0]),
    ],
    &[
        (-49.0, &[0.0]),
        (-28.0, &[-22.0, -7.0, 7.0, 22.0]),
        (-12.0, &[-12.0, 0.0, 11.0]),
        (7.0, &[-21.0, 0.0, 21.0]),
    ],
    &[
        (-49.0, &[0.0]),
        (-31.0, &[-13.0, 0.0, 13.0]),
        (-13.0, &[-25.0, -9.0, 1.0, 10.0, 25.0]),
        (6.0, &[-7.0, 6.0]),
    ],
];

/// What becomes of the ball.
#[derive(Clone, Copy, Debug)]
enum Ball {
    /// At somebody's feet until then.
    Held { by: usize, until: f32 },
    /// On its way to somebody, due then; high balls are headed on.
    Sent { to: usize, due: f32, headed: bool },
    /// Shot at the goal of `side`; the goalkeeper tries to be at `reach` when it comes.
    Shot { side: f32, due: f32, reach: f32 },
    /// Out of play: brought back by `by`, played again then.
    Dead { at: Vec2, by: usize, again: f32, thrown: bool },
}

struct Game {
    people: Vec<Person>,
    ball: Flight,
    state: Ball,
    /// Somebody about to tackle the one with the ball, at that moment.
    tackler: Option<(usize, f32)>,
    time: f32,
    rng: Pcg64Mcg,
}

fn flat(p: Vec3) -> Vec2 {
    Vec2::new(p.x, p.z)
}

/// The direction in which a team attacks.
fn attack(team: u8) -> f32 {
    if team == 0 { 1.0 } else { -1.0 }
}

/// Shirt numbers of a team: mostly a 1 in goal, most others below 30.
fn squad(seed: u64, team: u8, players: usize) -> Vec<u8> {
    // A generator of its own, so that nothing else of the match depends on it.
    let mut rng = Pcg64Mcg::seed_from_u64(seed ^ 0x5AAD_0000 ^ u64::from(team));
    let mut numbers = vec![if rng.random_bool(0.7) { 1 } else { rng.random_range(12..=40) }];
    while numbers.len() < players {
        let highest = if rng.random_bool(0.75) { 30 } else { 99 };
        let number = rng.random_range(2..=highest);
        if !numbers.contains(&number) {
            numbers.push(number);
        }
    }
    numbers
}

impl Game {
    fn new(seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed ^ 0x6A3E);
        let mut people = Vec::new();
        for team in 0..2u8 {
            let formation = FORMATIONS[rng.random_range(0..FORMATIONS.len())];
            let numbers = squad(seed, team, formation.iter().map(|(_, line)| line.len()).sum());
            let places = formation.iter().flat_map(|(x, line)| line.iter().map(|z| Vec2::new(*x, *z)));
            for (index, place) in places.enumerate() {
                let keeper = index == 0;
                let home = place * attack(team)
                    + Vec2::new(rng.random_range(-2.0..2.0), rng.random_range(-2.0..2.0));
                let number = numbers.get(index).copied().unwrap_or(1);
                let follow = if keeper { Vec2::new(0.06, 0.08) } else { Vec2::new(0.60, 0.42) };
                let role = if keeper { Role::Goalkeeper } else { Role::Player };
                people.push(Person::new(role, Some((team, number)), home, follow, &mut rng));
            }
        }
        for (role, home, follow) in [
            (Role::Referee, Vec2::new(-7.0, 6.0), Vec2::new(0.62, 0.55)),
            (Role::Assistant, Vec2::new(14.0, -35.3), Vec2::new(0.6, 0.0)),
            (Role::Assistant, Vec2::new(-14.0, 35.3), Vec2::new(0.6, 0.0)),
        ] {
            people.push(Person::new(role, None, home, follow, &mut rng));
        }
        let by = rng.random_range(5..9);
        let at = people[by].at;
        Self {
            people,
            ball: Flight { at: Vec3::new(at.x, BALL_RADIUS_M, at.y), velocity: Vec3::ZERO },
            state: Ball::Held { by, until: 1.0 },
            tackler: None,
            time: 0.0,
            rng,
        }
    }

    fn team(&self, who: usize) -> u8 {
        self.people[who].team.unwrap_or(0)
    }

    /// The player nearest to a place who may be chosen.
    fn nearest(&self, place: Vec2, may: impl Fn(usize, &Person) -> bool) -> Option<usize> {
        let free = self.people.iter().enumerate().filter(|(who, p)| p.team.is_some() && may(*who, p));
        free.min_by(|a, b| a.1.at.distance(place).total_cmp(&b.1.at.distance(place))).map(|(who, _)| who)
    }

    fn standing(&self, who: usize) -> bool {
        self.people[who].down_until < self.time
    }

    fn advance(&mut self) {
        self.time += STEP_S;
        self.move_people();
        match self.state {
            Ball::Held { by, until } => self.hold(by, until),
            Ball::Sent { to, due, headed } => self.fly(to, due, headed),
            Ball::Shot { side, due, reach } => self.shoot_on(side, due, reach),
            Ball::Dead { at, by, again, thrown } => self.bring_back(at, by, again, thrown),
        }
    }

    /// Where somebody will be in a moment.
    fn ahead_of(&self, who: usize, seconds: f32) -> Vec2 {
        (self.people[who].at + self.people[who].velocity * seconds).clamp(-HALF + 1.0, HALF - 1.0)
    }
}

/// Paths of a made-up spell of play of `seconds`.
#[must_use]
pub fn generated(seed: u64, seconds: f64) -> Trajectories {
    let mut game = Game::new(seed);
    let warm_up = (WARM_UP_S * RATE_HZ) as usize;
    let samples = (seconds * f64::from(RATE_HZ)).ceil() as usize + 2;
    let mut ball = Vec::with_capacity(samples);
    for step in 0..warm_up + samples {
        game.advance();
        if step >= warm_up {
            ball.push(game.ball.at);
        }
    }
    let people = game
        .people
        .into_iter()
        .map(|person| Path2 {
            role: person.role,
            team: person.team,
            number: person.number,
            xz: smooth(&person.path[warm_up..], 5.0),
        })
        .collect();
    Trajectories { rate_hz: f64::from(RATE_HZ), people, ball }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{acts::Kind, play};
    use protocol::pitch::Pitch;

    #[test]
    fn a_minute_of_play_has_passes_shots_headers_throw_ins_and_people_of_flesh() {
        let mut seen = std::collections::BTreeMap::<Kind, usize>::new();
        for seed in 0..6 {
            let all = generated(seed, 60.0);
            assert_eq!(all.people.len(), 25);
            for person in &all.people {
                let fastest = person.xz.windows(2).map(|w| w[0].distance(w[1]) * RATE_HZ).fold(0.0, f32::max);
                assert!(fastest < 9.5, "seed {seed}: {:?} runs {fastest} m/s", person.role);
                assert!(
                    person.xz.iter().all(|p| p.x.abs() < 58.0 && p.y.abs() < 37.0),
                    "seed {seed}: off the pitch"
                );
            }
            let jump = all.ball.windows(2).map(|w| w[0].distance(w[1]) * RATE_HZ).fold(0.0, f32::max);
            assert!(jump < 40.0, "seed {seed}: the ball moves at {jump} m/s");
            assert!(all.ball.iter().all(|b| b.is_finite() && b.y > 0.05 && b.y < 25.0));
            let fewer = all.resampled(0.0, 25.0, 1500);
            for (_, event) in play::events(&fewer.people, &fewer.ball, 25.0, &Pitch::default()) {
                *seen.entry(event.kind).or_default() += 1;
            }
        }
        println!("six minutes of play: {seen:?}");
        for (kind, least) in [
            (Kind::Pass, 60),
            (Kind::Shot, 4),
            (Kind::Header, 3),
            (Kind::ThrowIn, 2),
            (Kind::Dive, 1),
            (Kind::Tackle, 1),
        ] {
            assert!(seen.get(&kind).is_some_and(|&count| count >= least), "{kind:?} in {seen:?}");
        }
    }

    #[test]
    fn teams_keep_their_shape_and_follow_the_ball() {
        let all = generated(3, 60.0);
        for k in (0..3000).step_by(250) {
            for team in 0..2u8 {
                let xs: Vec<f32> = all
                    .people
                    .iter()
                    .filter(|p| p.team == Some(team) && p.role == Role::Player)
                    .map(|p| p.xz[k].x)
                    .collect();
                let spread =
                    xs.iter().copied().fold(f32::MIN, f32::max) - xs.iter().copied().fold(f32::MAX, f32::min);
                // Broadcast tracking shows 25 to 50 m from the last line to the first.
                assert!((15.0..65.0).contains(&spread), "a team {spread} m long at {k}");
            }
        }
    }

    #[test]
    fn the_same_seed_plays_the_same_match() {
        let [a, b, c] = [5, 5, 6].map(|seed| generated(seed, 5.0));
        assert!(a.ball == b.ball && a.people[7].xz == b.people[7].xz && a.ball != c.ball);
    }
}
