//! Processor time of the calling thread: what a frame costs, whatever else the machine does meanwhile.

use std::time::Duration;

/// Time that this thread has spent on a processor; where the system does not tell, wall time, which is more, with a warning.
#[must_use]
pub fn thread_cpu_time() -> Duration {
    #[cfg(unix)]
    {
        let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
        // SAFETY: `time` is valid for writing for the length of the call, and the clock exists on every Unix we build
        // for; on failure `time` keeps its zeros.
        let _ = unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &raw mut time) };
        let seconds = u64::try_from(time.tv_sec).unwrap_or_default();
        Duration::from_secs(seconds) + Duration::from_nanos(u64::try_from(time.tv_nsec).unwrap_or_default())
    }
    #[cfg(not(unix))]
    {
        static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
        let start = START.get_or_init(|| {
            tracing::warn!("this system does not tell a thread's processor time: wall time stands for it");
            std::time::Instant::now()
        });
        start.elapsed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_counts_and_sleep_does_not() {
        let before = thread_cpu_time();
        std::thread::sleep(Duration::from_millis(50));
        let slept = thread_cpu_time() - before;
        let mut sum = 0_u64;
        while thread_cpu_time() - before < slept + Duration::from_millis(5) {
            sum = std::hint::black_box(sum.wrapping_add(1));
        }
        assert!(sum > 0 && slept < Duration::from_millis(40), "asleep for {slept:?} of processor time");
    }
}
