//! Panics of libraries, caught without a message on the terminal.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// Whether a panic of this thread is caught and becomes an error.
    static IS_CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// The result of `call`, or the message of its panic, which is not printed. What `call` changed must
/// not be used after a panic.
///
/// # Errors
/// The message of the panic.
pub fn caught_panic<T>(call: impl FnOnce() -> T) -> Result<T, String> {
    print_no_caught_panics();
    let was_caught = IS_CAUGHT.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(call));
    IS_CAUGHT.set(was_caught);
    result.map_err(|payload| {
        let text = payload.downcast_ref::<&str>().map(ToString::to_string);
        let text = text.or_else(|| payload.downcast_ref::<String>().cloned());
        text.unwrap_or_else(|| "invalid contents".to_owned())
    })
}

/// Once: makes the panic hook of the process ignore the panics that are caught here.
fn print_no_caught_panics() {
    static INSTALLED: Once = Once::new();
    INSTALLED.call_once(|| {
        let print = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            if !IS_CAUGHT.get() {
                print(panic);
            }
        }));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_its_message() {
        assert_eq!(caught_panic(|| 3), Ok(3));
        let message = caught_panic(|| Vec::<u8>::new()[1]);
        assert!(message.unwrap_err().contains("out of bounds"));
        assert!(!IS_CAUGHT.get());
    }
}
