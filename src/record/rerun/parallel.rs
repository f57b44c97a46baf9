//! Work on agents that the threads of a recorder share.

use rayon::prelude::*;

/// Number of states in a round, or of pixels in images, from which threads share the work. To pass
/// less to other threads would take as long as to do it.
const MIN_SHARED: usize = 1 << 11;

/// Applies `work` to every item; on the threads of the pool in which the recorder is called, if it is
/// called in one and the items have together `size` states or pixels that are worth it.
pub(super) fn for_each<T: Send>(items: &mut [T], size: usize, work: impl Fn(&mut T) + Send + Sync) {
    if shares(size) {
        items.par_iter_mut().for_each(work);
    } else {
        items.iter_mut().for_each(work);
    }
}

/// The results of `work` for all items, in their order; see [`for_each`].
pub(super) fn map<T: Sync, R: Send>(
    items: &[T],
    size: usize,
    work: impl Fn(&T) -> R + Send + Sync,
) -> Vec<R> {
    if shares(size) {
        items.par_iter().map(work).collect()
    } else {
        items.iter().map(work).collect()
    }
}

fn shares(size: usize) -> bool {
    size >= MIN_SHARED && rayon::current_thread_index().is_some()
}
