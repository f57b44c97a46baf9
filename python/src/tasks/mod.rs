//! Tasks for algorithms in Python: descriptions of tasks, and batches of copies of a task.

mod actions;
mod batch;
mod builtin;
mod description;
mod group;
mod options;
mod picture;
mod start;
mod state;
mod threads;

pub(crate) use batch::Batch;
pub(crate) use builtin::builtin_tasks;
pub(crate) use description::{Action, Quantity, Task, TaskError};
pub(crate) use options::{Autoreset, MAX_THREADS, checked_count, parse_autoreset};
pub(crate) use threads::Threads;
