//! What people are told while they wait for an environment.

use std::sync::OnceLock;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// Shows people a text.
static SHOW: OnceLock<fn(&str)> = OnceLock::new();

/// How long people wait without being told why.
const PATIENCE: Duration = Duration::from_secs(3);

/// Sets what shows people a text; without it, they are told nothing. Only the first call counts.
pub fn set_notice(show: fn(&str)) {
    let _ = SHOW.set(show);
}

/// The result of `work`. If it takes longer than some seconds, people are told `text`.
pub(super) fn with_notice<T>(text: String, work: impl FnOnce() -> T) -> T {
    let Some(show) = SHOW.get() else {
        return work();
    };
    let (done, is_done) = channel::<()>();
    let waiting = thread::spawn(move || {
        if is_done.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
            show(&text);
        }
    });
    let result = work();
    drop(done);
    // It shows a text at most.
    let _ = waiting.join();
    result
}
