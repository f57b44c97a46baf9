//! Threads on which the copies of a batch are stepped.

use std::process;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// A number of threads. Results must not depend on it.
pub(crate) struct Threads {
    count: usize,
    /// `None` for the current thread only.
    pool: Option<ThreadPool>,
    /// The process that has the threads of the pool.
    process: u32,
}

impl Threads {
    pub(crate) fn new(count: usize) -> PyResult<Self> {
        Ok(Self {
            count,
            pool: pool(count)?,
            process: process::id(),
        })
    }

    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Applies `work` to every item.
    pub(super) fn for_each<T: Send>(
        &mut self,
        items: &mut [T],
        work: impl Fn(&mut T) + Send + Sync,
    ) -> PyResult<()> {
        self.renew_after_fork()?;
        match &self.pool {
            Some(pool) if items.len() > 1 => pool.install(|| items.par_iter_mut().for_each(work)),
            _ => items.iter_mut().for_each(work),
        }
        Ok(())
    }

    /// The pool of the threads; none for the current thread only.
    pub(crate) fn pool(&mut self) -> PyResult<Option<&ThreadPool>> {
        self.renew_after_fork()?;
        Ok(self.pool.as_ref())
    }

    /// Makes new threads in a process that was forked: threads are not copied, so that work for those
    /// of the parent would never be done.
    fn renew_after_fork(&mut self) -> PyResult<()> {
        if self.pool.is_some() && self.process != process::id() {
            std::mem::forget(self.pool.take());
            self.pool = pool(self.count)?;
            self.process = process::id();
        }
        Ok(())
    }
}

fn pool(count: usize) -> PyResult<Option<ThreadPool>> {
    if count == 1 {
        return Ok(None);
    }
    let pool = ThreadPoolBuilder::new().num_threads(count).build();
    let pool = pool
        .map_err(|error| PyRuntimeError::new_err(format!("cannot start {count} threads: {error}")));
    pool.map(Some)
}
