//! Evaluation: what a run's policies reach when they no longer learn, with actions chosen as one likes.

use std::path::{Path, PathBuf};

use super::checkpoint::{self, Checkpoint, CheckpointError};
use super::folder::RunFolder;
use super::rollout::RoundPlan;
use super::trainer::Trainer;
use super::{Plan, RunError};
use crate::agent::policy::ActionSelection;
use crate::experience::Episode;

/// Streams of an evaluation bear a round that no training reaches.
const ROUND: u32 = u32::MAX;

/// What is evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Evaluation {
    /// Episodes of each agent.
    pub episodes: u32,
    /// How actions are chosen; none is as in training.
    pub actions: Option<ActionSelection>,
    /// Seed of the starts and the actions.
    pub seed: u64,
}

/// The folder of the run that `path` names: the folder itself, or a file in it such as `run.rrd`.
#[must_use]
pub fn run_folder(path: &Path) -> RunFolder {
    let folder = if path.is_file() { path.parent().unwrap_or(path) } else { path };
    RunFolder::new(folder)
}

/// Plays the policies of the run in `folder` as its newest checkpoint has them. Episodes are in (agent, episode) order.
///
/// # Errors
/// The folder holds no run with a checkpoint, or one of another version.
pub fn evaluate(folder: &RunFolder, evaluation: &Evaluation) -> Result<(Plan, Vec<Episode>), RunError> {
    let mut plan = Plan::load(&folder.scenario(), &[])?;
    if let Some(actions) = evaluation.actions {
        plan.scenario.algorithm = plan.scenario.algorithm.value().clone().with_actions(actions).into();
    }
    let mut trainer = Trainer::new(&plan.scenario, &plan.description, 1)?;
    let checkpoint = Checkpoint::read(folder.path())?;
    let path: PathBuf = checkpoint::file(folder.path());
    trainer.restore(&checkpoint.trainer).map_err(|reason| CheckpointError { path, reason })?;
    let round = RoundPlan { run_seed: evaluation.seed, round: ROUND, episodes: evaluation.episodes, camera: None };
    let episodes = trainer.play_without_learning(&round);
    Ok((plan, episodes))
}
