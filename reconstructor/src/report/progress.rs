//! How far a stage of long work has come: a bar on a terminal, plain lines in a log.
//! A [`Progress`] is shared by reference between the threads of its stage.

use std::{
    io::IsTerminal,
    sync::{
        Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressStyle};

/// In a log, at most one line per stage in this time.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Progress of one stage. Dropping it clears the bar.
#[derive(Debug)]
pub struct Progress {
    stage: String,
    total: u64,
    done: AtomicU64,
    output: Output,
}

#[derive(Debug)]
enum Output {
    Bar(ProgressBar),
    Lines(Mutex<Instant>),
    Hidden,
}

impl Progress {
    /// Progress of `stage` over `total` steps (0: not known), shown on standard error: a bar when that is a terminal, else log lines.
    #[must_use]
    pub fn new(stage: &str, total: u64) -> Self {
        let output = if std::io::stderr().is_terminal() {
            let bar = ProgressBar::new(total);
            if let Ok(style) = ProgressStyle::with_template("{prefix:>12} {bar:40} {pos}/{len} {eta}") {
                bar.set_style(style);
            }
            bar.set_prefix(stage.to_owned());
            bar.enable_steady_tick(Duration::from_millis(500));
            Output::Bar(bar)
        } else {
            Output::Lines(Mutex::new(Instant::now()))
        };
        Self { stage: stage.to_owned(), total, done: AtomicU64::new(0), output }
    }

    /// Progress that nobody sees, for tests and for callers with their own display.
    #[must_use]
    pub fn hidden() -> Self {
        Self { stage: String::new(), total: 0, done: AtomicU64::new(0), output: Output::Hidden }
    }

    /// Says that `steps` more are done.
    pub fn advance(&self, steps: u64) {
        let done = self.done.fetch_add(steps, Ordering::Relaxed) + steps;
        match &self.output {
            Output::Bar(bar) => bar.inc(steps),
            Output::Lines(last) => {
                // A thread that finds the lock taken leaves the line to the holder.
                if let Ok(mut last) = last.try_lock()
                    && last.elapsed() >= LINE_EVERY
                {
                    *last = Instant::now();
                    match self.total {
                        0 => tracing::info!("{}: {done}", self.stage),
                        total => tracing::info!("{}: {done} of {total}", self.stage),
                    }
                }
            }
            Output::Hidden => {}
        }
    }

    /// Steps done so far.
    #[must_use]
    pub fn done(&self) -> u64 {
        self.done.load(Ordering::Relaxed)
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Output::Bar(bar) = &self.output {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_share_one_count() {
        let progress = Progress::hidden();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| (0..100).for_each(|_| progress.advance(2)));
            }
        });
        assert_eq!(progress.done(), 800);
    }
}
