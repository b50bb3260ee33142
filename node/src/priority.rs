//! The right to the processor in the moment of presentation. In: nothing. Out: a thread that runs before all
//! ordinary ones for as long as it asks for it. Where the system does not allow that, nothing happens.
//!
//! A thread that sleeps until its moment still has to wait for a processor then. Beside other busy programs that
//! takes milliseconds, and it is most of the skew of a wall whose nodes draw on the processor. So the frame loop
//! becomes a real-time thread from "ready" to the presentation, while it does nearly nothing, and an ordinary
//! one for everything else: a real-time thread that draws would stop the machine.

use rustix::process::{getpriority_process, setpriority_process};
use thread_priority::unix::{
    NormalThreadSchedulePolicy, RealtimeThreadSchedulePolicy, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};
use thread_priority::{ThreadPriority, ThreadPriorityValue};

/// The crate's value for niceness 0.
const ORDINARY: u8 = 48;

/// Whether and how this thread may go first.
#[derive(Debug)]
pub(crate) struct Priority {
    allowed: bool,
    raised: bool,
    /// What the thread returns to: it may have been given another one than 0 on purpose.
    niceness: i32,
}

impl Priority {
    /// Finds out what the calling thread may do. Root may, and users with a limit for real-time priority.
    pub(crate) fn of_this_thread() -> Self {
        let niceness = getpriority_process(None).unwrap_or(0);
        let mut priority = Self {
            allowed: true,
            raised: false,
            niceness,
        };
        priority.raise();
        priority.lower();
        tracing::debug!(allowed = priority.allowed, "real-time presentation");
        priority
    }

    /// From now on this thread goes before all ordinary ones.
    pub(crate) fn raise(&mut self) {
        if self.allowed && !self.raised {
            self.raised = true;
            let first = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
            self.set(ThreadPriority::Min, first);
        }
    }

    /// From now on this thread is an ordinary one.
    pub(crate) fn lower(&mut self) {
        if self.raised {
            self.raised = false;
            let ordinary = ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Other);
            if let Ok(value) = ThreadPriorityValue::try_from(ORDINARY) {
                self.set(ThreadPriority::Crossplatform(value), ordinary);
            }
            if self.niceness != 0
                && let Err(error) = setpriority_process(None, self.niceness)
            {
                tracing::debug!(%error, "the thread's niceness cannot be given back");
            }
        }
    }

    fn set(&mut self, priority: ThreadPriority, policy: ThreadSchedulePolicy) {
        if let Err(error) = set_thread_priority_and_policy(thread_native_id(), priority, policy) {
            tracing::debug!(?error, "no real-time presentation");
            self.allowed = false;
        }
    }
}

impl Drop for Priority {
    fn drop(&mut self) {
        self.lower();
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::expect_used,
        reason = "a test that panics has failed"
    )]

    use thread_priority::unix::thread_schedule_policy;

    use super::*;

    #[test]
    fn the_thread_is_an_ordinary_one_again_afterwards() {
        let niceness = getpriority_process(None).unwrap();
        let ordinary = ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Other);
        let mut priority = Priority::of_this_thread();
        for _ in 0..3 {
            priority.raise();
            let raised = thread_schedule_policy().unwrap();
            assert_eq!(raised != ordinary, priority.allowed);
            priority.lower();
            assert_eq!(thread_schedule_policy().unwrap(), ordinary);
            assert_eq!(getpriority_process(None).unwrap(), niceness);
        }
    }
}
