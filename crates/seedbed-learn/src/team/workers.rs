//! Threads for parallel work.

use rayon::prelude::*;

use crate::cancellation::cancellable;

/// The threads that a team may use: the current thread only, or a pool. Results are in the order of
/// the items and must not depend on the number of threads.
#[derive(Clone, Copy, Debug, Default)]
pub struct Workers<'a> {
    pool: Option<&'a rayon::ThreadPool>,
}

impl<'a> Workers<'a> {
    /// The current thread only.
    pub const CURRENT_THREAD: Workers<'static> = Workers { pool: None };

    /// The threads of `pool`, or the current thread only if there is none.
    #[must_use]
    pub fn new(pool: Option<&'a rayon::ThreadPool>) -> Self {
        Self { pool }
    }

    /// Applies `work` to every item. Before each there is a
    /// [`cancellation_point`](crate::cancellation::cancellation_point).
    pub fn for_each<T: Send>(self, items: &mut [T], work: impl Fn(&mut T) + Send + Sync) {
        let work = cancellable(work);
        match self.pool {
            Some(pool) if items.len() > 1 => pool.install(|| items.par_iter_mut().for_each(work)),
            _ => items.iter_mut().for_each(work),
        }
    }

    /// The results of `work` for all items, in their order. Before each there is a
    /// [`cancellation_point`](crate::cancellation::cancellation_point).
    pub fn map<T: Send, R: Send>(
        self,
        items: Vec<T>,
        work: impl Fn(T) -> R + Send + Sync,
    ) -> Vec<R> {
        let work = cancellable(work);
        match self.pool {
            Some(pool) if items.len() > 1 => {
                pool.install(|| items.into_par_iter().map(work).collect())
            }
            _ => items.into_iter().map(work).collect(),
        }
    }
}
