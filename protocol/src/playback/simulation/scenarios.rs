//! Evenings in front of the screen: which link, which match, what the user does.

use std::time::Duration;

use super::{Fault, FaultKind, Figures, Link, MadeUpMatch, TraceLine, Viewer};
use crate::{
    playback::{PlaybackConfig, PlaybackError, Speed},
    time::Ticks,
};

/// What the user does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Lets time run.
    Play,
    /// Stops time.
    Pause,
    /// Moves the play head.
    Seek(Ticks),
    /// Moves it to the newest of a live stream.
    GoLive,
    /// Changes how fast time runs.
    SetSpeed(Speed),
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// What it is called.
    pub name: &'static str,
    /// What is watched.
    pub world: MadeUpMatch,
    /// Over what.
    pub link: Link,
    /// How.
    pub config: PlaybackConfig,
    /// What the user does, in order of time since the address was opened.
    pub actions: Vec<(Duration, Action)>,
    /// How long it is watched, from the address on.
    pub watched: Duration,
}

/// What came of a scenario.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// How well it went.
    pub figures: Figures,
    /// What happened when; every line prints itself.
    pub trace: Vec<TraceLine>,
}

const fn s(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

const ROUND_TRIP: Duration = Duration::from_millis(40);

impl Scenario {
    /// Five minutes on demand over a link, with nothing special.
    #[must_use]
    pub fn over(name: &'static str, link: Link) -> Self {
        let (world, config) = (MadeUpMatch::default(), PlaybackConfig::default());
        Self { name, world, link, config, actions: Vec::new(), watched: s(300) }
    }

    /// What is measured.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let steady = |megabits: u64| Link::steady(megabits * 1_000_000, ROUND_TRIP);
        let outage = |link: Link| Link { outages: vec![(s(60), s(65))], ..link };
        let fault = |from, until, chance, kind| Link {
            faults: vec![Fault { from: s(from), until: s(until), chance, kind }],
            ..steady(20)
        };
        let swings = (0..30).map(|n| (s(n * 10), if n % 2 == 0 { 15_000_000 } else { 3_000_000 })).collect();
        let jumps = (0..12_u64).map(|n| {
            (
                Duration::from_millis(20_000 + n * 3_300),
                Action::Seek(Ticks(((n * 97 + 40) % 290 * 1_000) as i64)),
            )
        });
        let live = MadeUpMatch { chunks: 600, live_from: Some(120), ..MadeUpMatch::default() };
        vec![
            Self::over("20 Mbit/s", steady(20)),
            Self::over("6 Mbit/s", steady(6)),
            Self::over("2.6 Mbit/s", Link::steady(2_600_000, ROUND_TRIP)),
            Self::over("15 and 3 Mbit/s by turns", Link { bits_per_second: swings, ..steady(15) }),
            Self::over("outage of 5 s at 20 Mbit/s", outage(steady(20))),
            Self::over("outage of 5 s at 6 Mbit/s", outage(steady(6))),
            Self::over("server away for 5 s", fault(60, 65, 1.0, FaultKind::Error)),
            Self::over("every fifth request an error", fault(0, 300, 0.2, FaultKind::Error)),
            Self::over("every twentieth request lost", fault(0, 300, 0.05, FaultKind::Silence)),
            Self::over("every tenth chunk corrupt", fault(0, 300, 0.1, FaultKind::Corrupt)),
            Self { actions: jumps.collect(), watched: s(70), ..Self::over("seeks", steady(20)) },
            Self { world: live.clone(), ..Self::over("live, 20 Mbit/s", steady(20)) },
            Self { world: live.clone(), ..Self::over("live, 6 Mbit/s", steady(6)) },
            Self { world: live, ..Self::over("live, outage of 5 s", outage(steady(20))) },
        ]
    }

    /// Watches it.
    ///
    /// # Errors
    /// When there is nothing to play.
    pub fn run(&self) -> Result<Outcome, PlaybackError> {
        let mut viewer = Viewer::open(self.world.clone(), self.link.clone(), self.config)?;
        for (at, action) in &self.actions {
            viewer.watch(at.saturating_sub(viewer.now));
            viewer.act(*action);
        }
        viewer.watch(self.watched.saturating_sub(viewer.now));
        Ok(Outcome { figures: viewer.figures(self.name), trace: viewer.trace })
    }
}
