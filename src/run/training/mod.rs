//! Training: a team plays rounds of concurrent episodes and learns from them.
//!
//! A [`Trainer`] holds environments, team and shared buffer; `rollout` plays the episodes of a round,
//! `asynchronous` those without a common start and end; [`shared_world`] plays several runs in the
//! copies of one environment. Of a run that is divided over ranks, `trainer_on_ranks` and `team_on_ranks`
//! exchange what all need; `shared_episodes` and `remote_steps` are its parts. Must not
//! depend on files.

mod asynchronous;
mod episode_slots;
mod episode_warning;
mod remote_steps;
mod rollout;
mod shared_episodes;
pub mod shared_world;
mod summary;
mod team_on_ranks;
mod trainer;
mod trainer_on_ranks;

use rayon::{ThreadPool, ThreadPoolBuilder};

pub use self::episode_warning::EpisodeWarning;
pub use self::rollout::{PlayedEpisodes, RoundPlan};
pub use self::trainer::{NonFinite, Round, RoundFailure, Trainer, TrainingSettings};
pub use self::trainer_on_ranks::{FollowingRecorders, RecordingOrder, TrainerOnRanks};

/// A pool of this number of threads, which are named by their work; 0 is the number of cores.
///
/// # Panics
/// If the system starts no more threads.
pub(in crate::run) fn thread_pool(threads: usize, work: &'static str) -> ThreadPool {
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(move |index| format!("{work}-{index}"))
        .build()
        .expect("the system starts threads")
}

/// The number of threads that a setting stands for: 0 is the number of cores.
#[must_use]
pub fn thread_count(setting: usize) -> usize {
    match setting {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        threads => threads,
    }
}
