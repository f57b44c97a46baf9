//! Runs: the training loop of concurrent episodes, shared experience, updates and records (thesis
//! Alg. 3), and the files of a run.
//!
//! [`execute`] is the loop. From bottom to top: [`facts`] are what is measured, [`recorder`] is what
//! records it, [`folder`] has the files of a run; [`measures`] computes coverage and returns, [`ranks`]
//! are the processes over which a run may be divided, [`training`] plays and learns; a [`Plan`] is a
//! scenario with its task, [`execution`] runs it. [`mod@evaluate`] and [`replay`] play trained policies,
//! [`preview`] random ones; [`policies`] writes them before the end of a run. Must not contain formulas of learning.

mod error;
pub mod evaluate;
pub mod execution;
pub mod facts;
pub mod folder;
pub mod measures;
pub mod memory;
mod plan;
pub mod policies;
pub mod preview;
pub mod ranks;
pub mod recorder;
pub mod replay;
pub mod training;
pub mod weights;

pub use self::error::RunError;
pub(crate) use self::execution::write_checksums_of_results;
pub use self::execution::{Observer, Options, Progress, RecorderFactories, RunOutcome, execute};
pub use self::plan::Plan;
pub use self::training::thread_count;
