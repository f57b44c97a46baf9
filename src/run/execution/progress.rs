//! How a run is executed, and what is told of its course.

use serde::Serialize;

use crate::run::facts::Summary;
use crate::run::folder::RunFolder;
use crate::run::measures::RoundRows;
use crate::run::plan::Plan;
use crate::run::ranks::Ranks;
use crate::run::recorder::RecorderFactory;
use crate::run::training::Trainer;

/// How a plan is run. Options never change the results.
#[derive(Clone, Debug)]
pub struct Options {
    /// The directory of the results.
    pub folder: RunFolder,
    /// Whether to resume from the folder's checkpoint.
    pub resume: bool,
    /// Whether a run may be resumed with other versions of Python packages than it began with.
    pub other_versions: bool,
    /// Number of threads; 0 is the number of cores.
    pub threads: usize,
    /// Whether the file of the networks also has the agent seeds: reward seeds and initial
    /// parameters.
    pub save_initial: bool,
    /// The processes over which the run is divided.
    pub ranks: Ranks,
}

/// Factories of a run's recorders. To resume a run, pass the same factories in the same order.
pub type RecorderFactories = Vec<Box<dyn RecorderFactory>>;

/// Receives the progress of a run.
pub trait Observer {
    /// Called before the first round of this process. The progress of a resumed run is not zero.
    fn begun(&mut self, progress: &Progress);

    /// Called after each round with the rows that it adds to the tables; in tabular runs, which have no rounds,
    /// after each episode.
    fn round_finished(&mut self, progress: &Progress, rows: &RoundRows);

    /// Called with a message that the user should see. No data is lost.
    fn warn(&mut self, _warning: &str) {}
}

/// The progress of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Progress {
    /// Number of finished rounds; in tabular runs, of finished episodes.
    pub rounds: u32,
    /// Number of finished episodes: per agent in training, of the whole team in tabular runs.
    pub episodes: usize,
    /// Maximum number of episodes, counted in the same way.
    pub max_episodes: usize,
    /// Mean return over all agents and their latest episodes; 0 before the first episode ends.
    pub recent_return: f64,
    /// Number of environment steps of the whole team.
    pub env_steps: u64,
    /// Number of environment steps of the whole team after which the run ends, if it is set.
    pub max_env_steps: Option<u64>,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum RunOutcome {
    /// The scenario's `stop` was reached.
    Finished(Box<Summary>),
    /// The user interrupted the run, which can be resumed from its checkpoint.
    Interrupted {
        /// Number of finished rounds in the checkpoint; 0 if there may be none.
        rounds: u32,
    },
    /// The run ended; rank 0 knows how.
    Elsewhere,
}

impl Progress {
    /// The progress of a run so far.
    pub(crate) fn of(plan: &Plan, trainer: &Trainer) -> Self {
        let measures = trainer.measures();
        Self {
            rounds: trainer.rounds(),
            episodes: measures.episodes_per_agent(),
            max_episodes: plan.scenario.max_episodes() as usize,
            recent_return: measures.final_return().unwrap_or(0.0),
            env_steps: measures.env_steps(),
            max_env_steps: plan.scenario.stop.max_env_steps(),
        }
    }
}
