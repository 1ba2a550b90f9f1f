//! Which representation is asked for, as seen from outside.

use std::{sync::Arc, time::Duration};

use crate::playback::{
    simulation::{Link, MadeUpMatch, Scenario},
    *,
};

fn s(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

#[test]
fn a_fixed_quality_stays_whatever_the_link_carries() {
    for rung in 0..3 {
        let mut scenario = Scenario::over("fixed", Link::steady(30_000_000, Duration::from_millis(40)));
        (scenario.config.quality, scenario.watched) = (Quality::Fixed(rung), s(30));
        let figures = scenario.run().unwrap().figures;
        assert_eq!((figures.shown_in[rung], figures.switches), (1.0, 0));
    }
    let config = PlaybackConfig { quality: Quality::Fixed(3), ..PlaybackConfig::default() };
    let none = Playback::<simulation::FakeContent>::new(&MadeUpMatch::default().manifest(), config);
    assert_eq!(none.unwrap_err(), PlaybackError::NoRepresentation { index: 3 });
}

#[test]
fn a_quality_that_the_user_chooses_counts_from_the_next_request_on() {
    let world = MadeUpMatch::default();
    let mut playback = Playback::new(&world.manifest(), PlaybackConfig::default()).unwrap();
    let first = playback.poll_request(s(1)).unwrap();
    assert_eq!(first.representation, 0, "nothing is known of the link");
    playback.set_quality(Quality::Fixed(2)).unwrap();
    assert!(playback.set_quality(Quality::Fixed(7)).is_err());
    assert_eq!(playback.quality(), Quality::Fixed(2));
    let transfer = Transfer { bytes: 250_000, started: s(1), finished: s(2) };
    assert_eq!(playback.on_chunk(s(2), first, Arc::new(world.content(0)), transfer), Delivery::Taken);
    assert_eq!(playback.poll_request(s(2)).unwrap().representation, 2);
    assert_eq!(playback.frame(s(2)).shown.unwrap().representation, 0);
}

#[test]
fn the_figures_tell_what_was_measured() {
    let world = MadeUpMatch::default();
    let mut playback = Playback::new(&world.manifest(), PlaybackConfig::default()).unwrap();
    assert_eq!(playback.stats(s(1)), Stats::default());
    let request = playback.poll_request(s(1)).unwrap();
    let transfer = Transfer { bytes: 250_000, started: s(1), finished: s(2) };
    playback.on_chunk(s(2), request, Arc::new(world.content(0)), transfer);
    let stats = playback.stats(s(2));
    assert_eq!((stats.first_frame_at, stats.bytes, stats.ahead), (Some(s(2)), 250_000, s(1)));
    assert!(stats.bits_per_second.is_some_and(|bits| bits.abs_diff(2_000_000) < 2), "{stats:?}");
    assert_eq!((stats.representation, stats.latency, stats.stalls), (Some(0), None, 0));
}

#[test]
fn twice_the_speed_is_played_in_a_quality_that_keeps_up() {
    let mut scenario = Scenario::over("fast", Link::steady(15_000_000, Duration::from_millis(40)));
    scenario.actions = vec![(s(5), simulation::Action::SetSpeed(Speed::percent(200)))];
    scenario.watched = s(100);
    let figures = scenario.run().unwrap().figures;
    assert_eq!(figures.stalls, 0);
    assert!(figures.shown_in[1] > 0.8, "{figures}");
}
