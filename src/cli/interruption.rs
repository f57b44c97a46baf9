//! Requests to stop: Ctrl-C and, on Unix, the signals TERM, USR1 and HUP, which schedulers of clusters,
//! `mpirun` and closed terminals send.

use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Mutex, PoisonError};

use seedbed::storage::incomplete;

/// Whether the process was asked to stop while work listened.
static IS_REQUESTED: AtomicBool = AtomicBool::new(false);

/// Exit status of a command that Ctrl-C ends: 128 + number of the signal INT.
const CTRL_C: u8 = 130;

/// Exit status after the first request.
static EXIT_CODE: AtomicU8 = AtomicU8::new(CTRL_C);

/// What is printed when the next request comes; `None` if a request ends the process immediately.
static MESSAGE: Mutex<Option<&'static str>> = Mutex::new(None);

/// Work that stops by itself when it is asked to. The second request ends the process immediately,
/// as does any request when no work listens.
pub(super) struct StopRequests;

impl StopRequests {
    /// Like [`listen`](Self::listen), for a process of several that does not print.
    pub(super) fn listen_silently() -> Self {
        Self::listen("")
    }

    /// Listens for requests until this is dropped. The first request prints `message`.
    pub(super) fn listen(message: &'static str) -> Self {
        set_message((!IS_REQUESTED.load(Ordering::Relaxed)).then_some(message));
        Self
    }

    /// Becomes true with the first request.
    #[expect(
        clippy::unused_self,
        reason = "requests are noticed only while this exists"
    )]
    pub(super) fn flag(&self) -> &'static AtomicBool {
        &IS_REQUESTED
    }
}

impl Drop for StopRequests {
    fn drop(&mut self) {
        set_message(None);
    }
}

/// Asks running work to stop, as a first request does.
pub(super) fn request() {
    IS_REQUESTED.store(true, Ordering::Relaxed);
}

fn set_message(message: Option<&'static str>) {
    *MESSAGE.lock().unwrap_or_else(PoisonError::into_inner) = message;
}

/// Handles requests from now on: without work that listens, they end the process, and files that are not complete
/// are removed.
pub(super) fn handle() {
    if let Err(error) = handle_signals() {
        note!(
            "warning: cannot handle signals ({error}); Ctrl-C will end a run without a checkpoint"
        );
    }
}

/// Exit status of a command that was asked to stop: 128 + number of the first signal, as of a command
/// that the signal ends at once.
pub(super) fn exit_code() -> u8 {
    EXIT_CODE.load(Ordering::Relaxed)
}

fn on_request(exit_code: u8) {
    let message = MESSAGE
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .take();
    let Some(message) = message else {
        incomplete::remove_all_before_exit();
        std::process::exit(exit_code.into());
    };
    EXIT_CODE.store(exit_code, Ordering::Relaxed);
    IS_REQUESTED.store(true, Ordering::Relaxed);
    if !message.is_empty() {
        note!("\n{message}; press Ctrl-C again to stop immediately");
    }
}

/// Calls [`on_request`] for each signal, on a thread of its own. A file that becomes larger than the
/// system allows is an error of writing from now on, instead of the end of the process.
#[cfg(unix)]
fn handle_signals() -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1, SIGXFSZ};
    use std::sync::Arc;

    signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
    let handled = [SIGINT, SIGTERM, SIGUSR1, SIGHUP].into_iter();
    let handled = handled.filter(|signal| *signal != SIGHUP || !is_ignored(SIGHUP));
    let mut signals = signal_hook::iterator::Signals::new(handled)?;
    std::thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || {
            for signal in signals.forever() {
                on_request(128 + signal as u8);
            }
        })
        .map(drop)
}

/// Whether the process was started with a signal ignored, as `nohup` does with HUP. False if the
/// system does not say.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

#[cfg(not(unix))]
fn handle_signals() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| on_request(CTRL_C))
}
