//! The clock of this host: microseconds of `CLOCK_MONOTONIC`, sleeping until a moment on it, and not being
//! late. In: moments. Out: moments. It must not be used to date events for people: it starts at boot.

use std::num::NonZeroU64;

use rustix::process::setpriority_process;
use rustix::thread::{clock_nanosleep_absolute, set_current_timer_slack};
use rustix::time::{ClockId, Timespec, clock_gettime};

/// Niceness of the threads that pass messages on.
const PREFERRED_NICENESS: i32 = -10;

/// Microseconds since the boot of this host. All processes of a host read the same clock, and nothing
/// ever sets it back.
#[must_use]
pub fn now_us() -> i64 {
    let Timespec { tv_sec, tv_nsec } = clock_gettime(ClockId::Monotonic);
    tv_sec * 1_000_000 + tv_nsec / 1_000
}

/// Sleeps until `moment_us` on the clock of [`now_us`]; returns at once if it has passed. The sleep is
/// absolute, so a thread that is preempted between computing the moment and sleeping is not late.
pub fn sleep_until_us(moment_us: i64) {
    while now_us() < moment_us {
        let request = Timespec {
            tv_sec: moment_us.div_euclid(1_000_000),
            tv_nsec: moment_us.rem_euclid(1_000_000) * 1_000,
        };
        // A signal interrupts the sleep; the loop goes back to it.
        let _interrupted = clock_nanosleep_absolute(ClockId::Monotonic, &request);
    }
}

/// Asks the kernel to fire this thread's timers at their moment. By default it may delay them by 50 µs
/// to save wake-ups, a sixth of the whole skew that a wall may have.
pub fn use_precise_timers() {
    if let Err(error) = set_current_timer_slack(NonZeroU64::new(1)) {
        tracing::debug!(%error, "the kernel keeps its timer slack");
    }
}

/// Asks for the processor before ordinary threads, for threads that do little and must do it soon: the ones
/// that pass views and swaps on. Only root may have that; without it nothing changes.
pub fn go_before_others() {
    if let Err(error) = setpriority_process(None, PREFERRED_NICENESS) {
        tracing::debug!(%error, "this thread has the niceness of all others");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sleep_never_ends_early_and_the_past_does_not_sleep() {
        use_precise_timers();
        for duration_us in [0, 1, 300, 2_000] {
            let moment_us = now_us() + duration_us;
            sleep_until_us(moment_us);
            assert!(now_us() >= moment_us);
        }
        let before_us = now_us();
        sleep_until_us(before_us - 5_000_000);
        sleep_until_us(-1);
        assert!(now_us() - before_us < 1_000_000);
    }
}
