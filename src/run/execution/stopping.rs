//! Stopping work that an interruption finds in a long round.
//!
//! A round that ends by itself within [`GRACE`] is finished. A longer one is abandoned at its next
//! [`cancellation_point`](seedbed_learn::cancellation::cancellation_point), and the run goes back to
//! the round before. This depends on clocks; results do not depend on it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use seedbed_learn::cancellation::Cancellation;

/// Time that a round has to end after an interruption.
pub(crate) const GRACE: Duration = Duration::from_secs(1);

/// Time in which short rounds are repeated after an interruption, to go back to the last of them.
pub(crate) const MAX_REPETITION: Duration = Duration::from_secs(5);

/// Time between two looks at the flag of an interruption.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// A round that takes longer may last longer than [`GRACE`] the next time.
const SLOW_ROUND: Duration = Duration::from_millis(250);

/// Runs `work`, whose cancellation is due [`GRACE`] after `interrupted` is set.
pub(crate) fn with_grace<R>(interrupted: &AtomicBool, work: impl FnOnce(&Cancellation) -> R) -> R {
    let (cancellation, is_over) = (Cancellation::default(), AtomicBool::new(false));
    thread::scope(|scope| {
        let watcher = scope.spawn(|| watch(interrupted, &is_over, &cancellation));
        let _ended = Ended {
            is_over: &is_over,
            watcher: watcher.thread(),
        };
        work(&cancellation)
    })
}

/// Cancels the work if it lasts longer than [`GRACE`] after the interruption.
fn watch(interrupted: &AtomicBool, is_over: &AtomicBool, cancellation: &Cancellation) {
    let mut noticed: Option<Instant> = None;
    while !is_over.load(Ordering::Relaxed) {
        if interrupted.load(Ordering::Relaxed) {
            let noticed = noticed.get_or_insert_with(Instant::now);
            if noticed.elapsed() >= GRACE {
                cancellation.cancel();
                return;
            }
        }
        thread::park_timeout(LOOK_EVERY);
    }
}

/// Ends the watcher when the work has ended, or has panicked.
struct Ended<'a> {
    is_over: &'a AtomicBool,
    watcher: &'a thread::Thread,
}

impl Drop for Ended<'_> {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        self.watcher.unpark();
    }
}

/// Whether the next round may be long, as far as the latest one shows. The first one may.
pub(crate) struct RoundDurations {
    latest: Option<Duration>,
}

impl RoundDurations {
    /// Before the first round of this process.
    pub(crate) fn new() -> Self {
        Self { latest: None }
    }

    /// Whether the next round may have to be abandoned.
    pub(crate) fn may_be_long(&self) -> bool {
        self.latest.is_none_or(|latest| latest >= SLOW_ROUND)
    }

    /// Notes that a round that began at `start` has ended.
    pub(crate) fn ended(&mut self, start: Instant) {
        self.latest = Some(start.elapsed());
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicU32;

    use super::*;
    use seedbed_learn::cancellation::cancellation_point;
    use seedbed_learn::team::Workers;

    /// Work without an end stops on all threads, after the time in which it could have ended.
    #[test]
    fn endless_work_is_cancelled_after_the_grace() {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(2)
            .build()
            .unwrap();
        for workers in [Workers::CURRENT_THREAD, Workers::new(Some(&pool))] {
            let (interrupted, ended) = (AtomicBool::new(false), AtomicU32::new(0));
            let start = Instant::now();
            let result = with_grace(&interrupted, |cancellation| {
                cancellation.run(|| {
                    workers.for_each(&mut [0; 4], |_| {
                        interrupted.store(true, Ordering::Relaxed);
                        loop {
                            cancellation_point();
                        }
                    });
                    ended.fetch_add(1, Ordering::Relaxed);
                })
            });
            assert_eq!((result, ended.into_inner()), (None, 0));
            assert!(start.elapsed() >= GRACE);
        }
    }

    #[test]
    fn short_work_ends_by_itself_after_an_interruption() {
        let interrupted = AtomicBool::new(true);
        let work = || {
            cancellation_point();
            7
        };
        let result = with_grace(&interrupted, |cancellation| cancellation.run(work));
        assert_eq!(result, Some(7));
    }
}
