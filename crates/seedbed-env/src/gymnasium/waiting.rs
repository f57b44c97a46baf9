//! How long threads wait for workers.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Nanoseconds in which threads of this process waited for workers.
static WAITED: AtomicU64 = AtomicU64::new(0);

/// How long threads of this process have waited for environments of Gymnasium, all together.
#[must_use]
pub fn time_waited() -> Duration {
    Duration::from_nanos(WAITED.load(Ordering::Relaxed))
}

pub(super) fn add_time_waited(time: Duration) {
    WAITED.fetch_add(time.as_nanos() as u64, Ordering::Relaxed);
}
