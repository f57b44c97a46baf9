//! Cancellation of computations that take long: of rounds in which thousands of agents learn, or a
//! single one plans.
//!
//! Code that plays and learns returns no errors. It calls [`cancellation_point`] in its loops, which unwinds
//! the stack up to [`Cancellation::run`] once the work is cancelled, and does nothing otherwise. No
//! result depends on it: of work that was cancelled, there is none.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

thread_local! {
    /// What cancels the work of this thread.
    static CURRENT: RefCell<Option<Cancellation>> = const { RefCell::new(None) };
}

/// Ends work on all of its threads when it is set.
#[derive(Clone, Debug, Default)]
pub struct Cancellation(Arc<AtomicBool>);

/// What unwinds the stack.
struct Cancelled;

impl Cancellation {
    /// Ends all work at its next [`cancellation_point`].
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Runs `work`. `None` if it was cancelled: then everything that it could change must be dropped.
    pub fn run<R>(&self, work: impl FnOnce() -> R) -> Option<R> {
        match catch_unwind(AssertUnwindSafe(|| self.enter(work))) {
            Ok(result) => Some(result),
            Err(panic) if panic.is::<Cancelled>() => None,
            Err(panic) => resume_unwind(panic),
        }
    }

    /// Runs a part of the work on any thread.
    fn enter<R>(&self, work: impl FnOnce() -> R) -> R {
        let _outer = Outer(CURRENT.replace(Some(self.clone())));
        work()
    }
}

/// What cancelled the work of this thread before, which is restored.
struct Outer(Option<Cancellation>);

impl Drop for Outer {
    fn drop(&mut self) {
        CURRENT.set(self.0.take());
    }
}

/// Ends the work of this thread if it is cancelled.
pub fn cancellation_point() {
    let is_cancelled = CURRENT.with_borrow(|current| {
        let current = current.as_ref();
        current.is_some_and(|cancellation| cancellation.0.load(Ordering::Relaxed))
    });
    if is_cancelled {
        // Not a panic: no message is printed.
        resume_unwind(Box::new(Cancelled));
    }
}

/// `work` for other threads, which begins with a cancellation point and is cancelled as the work of
/// this thread.
pub fn cancellable<T, R>(work: impl Fn(T) -> R + Send + Sync) -> impl Fn(T) -> R + Send + Sync {
    let current = CURRENT.with_borrow(Clone::clone);
    move |item| match &current {
        Some(cancellation) => cancellation.enter(|| {
            cancellation_point();
            work(item)
        }),
        None => work(item),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_ends_at_the_next_point() {
        let (cancellation, mut finished) = (Cancellation::default(), 0);
        let result = cancellation.run(|| {
            for _ in 0..4 {
                finished += 1;
                cancellation.cancel();
                cancellation_point();
            }
        });
        assert_eq!((result, finished), (None, 1));
        cancellation_point();
    }

    #[test]
    fn work_that_is_not_cancelled_has_its_result() {
        let cancellation = Cancellation::default();
        let sum = cancellation.run(|| {
            cancellation_point();
            vec![1, 2].into_iter().map(cancellable(|x| x + 1)).collect()
        });
        assert_eq!(sum, Some::<Vec<i32>>(vec![2, 3]));
    }

    /// Work within other work is cancelled by its own flag, and afterwards by that of the other.
    #[test]
    fn other_panics_and_outer_work_are_kept() {
        let outer = Cancellation::default();
        let inner = Cancellation::default();
        inner.cancel();
        let result = outer.run(|| {
            assert_eq!(inner.run(cancellation_point), None);
            cancellation_point();
            7
        });
        assert_eq!(result, Some(7));
        let panicked = catch_unwind(AssertUnwindSafe(|| {
            outer.run(|| resume_unwind(Box::new(5)))
        }));
        let panic: Result<Option<()>, _> = panicked;
        assert_eq!(panic.unwrap_err().downcast_ref(), Some(&5));
    }
}
