//! A link that parallel transfers share evenly.

use std::time::Duration;

use crate::playback::backoff::SplitMix64;

/// What the link is like, over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Bits per second from these moments on, in order of time.
    pub bits_per_second: Vec<(Duration, u64)>,
    /// From a request to the first byte of its answer.
    pub round_trip: Duration,
    /// From when until when nothing moves; transfers under way go on afterwards.
    pub outages: Vec<(Duration, Duration)>,
    /// When and how requests fail.
    pub faults: Vec<Fault>,
    /// Seed of what is left to chance.
    pub seed: u64,
}

/// A time in which requests fail.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// From when on.
    pub from: Duration,
    /// Until when.
    pub until: Duration,
    /// Share of the requests that fail, 0..1.
    pub chance: f64,
    /// How.
    pub kind: FaultKind,
}

/// How a request fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// The server answers with an error.
    Error,
    /// Nothing ever comes.
    Silence,
    /// Everything comes, and it cannot be decoded.
    Corrupt,
}

impl Link {
    /// The same throughput all the time.
    #[must_use]
    pub fn steady(bits_per_second: u64, round_trip: Duration) -> Self {
        Self {
            bits_per_second: vec![(Duration::ZERO, bits_per_second)],
            round_trip,
            outages: Vec::new(),
            faults: Vec::new(),
            seed: 1,
        }
    }

    /// Bits per second at a moment.
    fn rate(&self, now: Duration) -> f64 {
        if self.outages.iter().any(|(from, until)| (*from..*until).contains(&now)) {
            return 0.0;
        }
        let step = self.bits_per_second.iter().rev().find(|(from, _)| *from <= now);
        step.map_or(0.0, |(_, bits)| *bits as f64)
    }

    /// When the rate changes next.
    fn next_change(&self, now: Duration) -> Option<Duration> {
        let steps = self.bits_per_second.iter().map(|(from, _)| *from);
        let outages = self.outages.iter().flat_map(|(from, until)| [*from, *until]);
        steps.chain(outages).filter(|at| *at > now).min()
    }
}

/// A transfer that is over.
#[derive(Clone, Copy, Debug)]
pub(super) struct Finished<T> {
    pub(super) what: T,
    pub(super) bytes: u64,
    pub(super) started: Duration,
    pub(super) finished: Duration,
    pub(super) fault: Option<FaultKind>,
}

/// A transfer under way.
#[derive(Clone, Copy, Debug)]
struct Flow<T> {
    what: T,
    bytes: u64,
    bits_left: f64,
    asked: Duration,
    /// When its first byte comes.
    begins: Duration,
    fault: Option<FaultKind>,
}

/// The link with what moves on it.
#[derive(Clone, Debug)]
pub(super) struct Network<T> {
    link: Link,
    now: Duration,
    flows: Vec<Flow<T>>,
    random: SplitMix64,
}

impl<T: Copy> Network<T> {
    pub(super) fn new(link: Link) -> Self {
        let random = SplitMix64::new(link.seed);
        Self { link, now: Duration::ZERO, flows: Vec::new(), random }
    }

    /// Asks for `bytes`; `set_up`: round trips before the request can be sent.
    pub(super) fn ask(&mut self, what: T, bytes: u64, set_up: u32) {
        let begins = self.now + self.link.round_trip * (set_up + 1);
        let faults = self.link.faults.iter().filter(|fault| (fault.from..fault.until).contains(&self.now));
        let random = &mut self.random;
        let fault = faults.filter(|fault| random.fraction() < fault.chance).map(|fault| fault.kind).next();
        self.flows.push(Flow { what, bytes, bits_left: bytes as f64 * 8.0, asked: self.now, begins, fault });
    }

    /// Stops what is not wanted any more and returns it.
    pub(super) fn stop(&mut self, unwanted: impl Fn(&T) -> bool) -> Vec<T> {
        let stopped = self.flows.iter().filter(|flow| unwanted(&flow.what)).map(|flow| flow.what).collect();
        self.flows.retain(|flow| !unwanted(&flow.what));
        stopped
    }

    /// When something changes on the link.
    pub(super) fn next_event(&self) -> Option<Duration> {
        let begins = self.flows.iter().map(|flow| flow.begins).filter(|at| *at > self.now).min();
        let moving: Vec<_> = self.flows.iter().filter(|flow| self.moves(flow)).collect();
        let least = moving.iter().map(|flow| flow.bits_left).fold(f64::INFINITY, f64::min);
        let rate = self.link.rate(self.now) / moving.len().max(1) as f64;
        let done = Duration::try_from_secs_f64(least / rate).ok();
        // Rounded up, or the last bit would never come.
        let done = done.map(|left| self.now + left + Duration::from_nanos(1));
        let change = self.link.next_change(self.now).filter(|_| !self.flows.is_empty());
        begins.into_iter().chain(done).chain(change).min()
    }

    /// Lets time pass up to `now`, which is not after [`Network::next_event`], and returns what is over.
    pub(super) fn advance(&mut self, now: Duration) -> Vec<Finished<T>> {
        let moving = self.flows.iter().filter(|flow| self.moves(flow)).count();
        let seconds = now.saturating_sub(self.now).as_secs_f64();
        let bits = self.link.rate(self.now) / moving.max(1) as f64 * seconds;
        let before = self.now;
        for flow in &mut self.flows {
            if flow.begins <= before && !fails_at_once(flow.fault) {
                flow.bits_left -= bits;
            }
        }
        self.now = self.now.max(now);
        let over = |flow: &Flow<T>| match flow.fault {
            Some(FaultKind::Error) => flow.begins <= now,
            Some(FaultKind::Silence) => false,
            _ => flow.begins <= now && flow.bits_left <= 1e-3,
        };
        let finished = self.flows.iter().filter(|flow| over(flow)).map(|flow| Finished {
            what: flow.what,
            bytes: flow.bytes,
            started: flow.asked,
            finished: now,
            fault: flow.fault,
        });
        let finished = finished.collect();
        self.flows.retain(|flow| !over(flow));
        finished
    }

    fn moves(&self, flow: &Flow<T>) -> bool {
        flow.begins <= self.now && !fails_at_once(flow.fault)
    }
}

/// Whether a request gets nothing of the link.
fn fails_at_once(fault: Option<FaultKind>) -> bool {
    matches!(fault, Some(FaultKind::Error | FaultKind::Silence))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    /// When what is over, in milliseconds.
    fn run(network: &mut Network<u32>) -> Vec<(u32, u64)> {
        let mut over = Vec::new();
        while let Some(next) = network.next_event() {
            let finished = network.advance(next);
            over.extend(
                finished.iter().map(|done| (done.what, done.finished.as_micros().div_ceil(1000) as u64)),
            );
        }
        over
    }

    #[test]
    fn transfers_share_the_link_and_outages_hold_them() {
        let mut network = Network::new(Link::steady(8_000_000, ms(100)));
        network.ask(1, 1_000_000, 0);
        network.ask(2, 500_000, 0);
        // Half each until the small one is done after 1 s; then the other has all.
        let over = run(&mut network);
        assert!(matches!(over[..], [(2, 1_100..=1_102), (1, 1_600..=1_602)]), "{over:?}");

        let mut link = Link::steady(8_000_000, ms(100));
        link.outages = vec![(ms(200), ms(5_200))];
        link.bits_per_second.push((ms(5_700), 80_000_000));
        let mut network = Network::new(link);
        network.ask(3, 1_000_000, 2);
        // Begins at 300 ms, waits until 5200, half of it by 5700, the rest ten times as fast.
        let over = run(&mut network);
        assert!(matches!(over[..], [(3, 5_750..=5_752)]), "{over:?}");
    }

    #[test]
    fn faults_are_errors_or_silence() {
        let mut link = Link::steady(8_000_000, ms(100));
        let fault = Fault { from: ms(0), until: ms(1), chance: 1.0, kind: FaultKind::Error };
        link.faults = vec![fault];
        let mut network = Network::new(link.clone());
        network.ask(1, 1_000_000, 0);
        assert_eq!(run(&mut network), [(1, 100)]);
        link.faults = vec![Fault { kind: FaultKind::Silence, ..fault }];
        let mut network = Network::new(link);
        network.ask(1, 1_000_000, 0);
        assert_eq!(run(&mut network), []);
        assert_eq!(network.stop(|what| *what == 1), [1]);
    }
}
