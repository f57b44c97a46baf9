//! Evaluation: plays the trained policies of a run without learning, greedily or with sampled
//! actions.

use super::error::RunError;
use super::facts::Summary;
use super::folder::RunFolder;
use super::folder::checkpoint::Checkpoint;
use super::plan::Plan;
use super::training::Trainer;
use super::training::{PlayedEpisodes, RoundFailure, RoundPlan};
use crate::scenario::recording::SceneSettings;
use seedbed_learn::agent::action_selection::ActionSelection;
use seedbed_learn::experience::Episode;

/// How policies are evaluated.
#[derive(Clone, Copy, Debug)]
pub struct EvaluationSettings<'a> {
    /// Number of episodes per agent.
    pub episodes: u32,
    /// How actions are chosen; `None` chooses them as in training.
    pub action_selection: Option<ActionSelection>,
    /// Name or path of the task in which policies act, or `Gymnasium(…)`; `None`: that of the training.
    pub environment: Option<&'a str>,
    /// Run seed of the evaluation, for initial states and actions; independent of the run seed of
    /// the training.
    pub seed: u64,
}

/// Plays the policies of the newest checkpoint of the run in `folder`. Episodes are in (agent,
/// episode) order.
///
/// # Errors
/// The folder has no checkpoint, the checkpoint has another version, or policies cannot act in the other task.
pub fn evaluate(
    folder: &RunFolder,
    settings: &EvaluationSettings<'_>,
) -> Result<(Plan, Vec<Episode>), RunError> {
    let (plan, mut trainer) = load_to_play(folder, settings)?;
    let mut episodes: Vec<Episode> = Vec::new();
    for number in 0..settings.episodes {
        episodes.extend(play_episode(&mut trainer, settings, number, None)?.episodes);
    }
    episodes.sort_by_key(|episode| (episode.agent, episode.episode));
    Ok((plan, episodes))
}

/// Like [`load_trained`], with a plan and a trainer in the task of `settings`.
///
/// # Errors
/// Also, if the policies cannot act in it.
pub(crate) fn load_to_play(
    folder: &RunFolder,
    settings: &EvaluationSettings<'_>,
) -> Result<(Plan, Trainer), RunError> {
    let (trained_in, mut trainer) = load_trained(folder, settings.action_selection)?;
    let Some(environment) = settings.environment else {
        return Ok((trained_in, trainer));
    };
    let plan = trained_in.in_environment(folder, environment)?;
    trainer.move_to(&plan.description, &plan.scenario)?;
    Ok((plan, trainer))
}

/// The plan of the run in `folder`, and its trainer as in the newest checkpoint.
///
/// # Errors
/// The folder has no checkpoint, or the checkpoint has another version.
pub(crate) fn load_trained(
    folder: &RunFolder,
    action_selection: Option<ActionSelection>,
) -> Result<(Plan, Trainer), RunError> {
    let mut plan = Plan::of_run(folder)?;
    if let Some(summary) = Summary::read(folder)? {
        // The scenario in folders of earlier versions has no name.
        plan.name = summary.scenario;
    }
    if let Some(action_selection) = action_selection {
        plan.scenario.algorithm = plan
            .scenario
            .algorithm
            .value()
            .clone()
            .with_actions(action_selection)
            .into();
    }
    let mut trainer = Trainer::from_scenario(&plan.scenario, &plan.description, 1)?;
    let checkpoint = Checkpoint::read(folder.path());
    let restored = checkpoint.and_then(|read| read.restore_to_act(folder.path(), &mut trainer));
    restored.map_err(RunError::UnusableCheckpoint)?;
    Ok((plan, trainer))
}

/// Plays episode `number` of every agent. The random streams are those of a round number that
/// training never reaches.
///
/// # Errors
/// An environment cannot go on.
pub(crate) fn play_episode(
    trainer: &mut Trainer,
    settings: &EvaluationSettings<'_>,
    number: u32,
    scene: Option<&SceneSettings>,
) -> Result<PlayedEpisodes, RoundFailure> {
    let plan = RoundPlan {
        run_seed: settings.seed,
        round: u32::MAX - number,
        first_episode: number,
        episodes: 1,
        scene,
    };
    let mut played = trainer.play_without_learning(&plan)?;
    for episode in &mut played.episodes {
        episode.round = number;
    }
    Ok(played)
}
