//! Replays: records episodes of trained policies without learning, with the moving bodies of chosen
//! agents.

use super::error::RunError;
use super::evaluate::{EvaluationSettings, load_to_play, play_episode};
use super::folder::RunFolder;
use super::measures::{Division, Measures};
use super::plan::Plan;
use super::ranks::Ranks;
use super::training::Trainer;
use crate::run::facts::EpisodeRow;
use crate::run::recorder::{BonusRange, Focus, Recorder, RecorderFactory, RoundRecord, RunInfo};
use crate::scenario::recording::{RecordingSettings, SceneSettings};
use seedbed_input::InputError;
use seedbed_input::numbers::ranged_count;
use seedbed_learn::team::Workers;

/// What a replay shows.
#[derive(Clone, Copy, Debug)]
pub struct ReplaySettings<'a> {
    /// Number of episodes, and how actions are chosen.
    pub evaluation: EvaluationSettings<'a>,
    /// The agents whose bodies are drawn in every episode; `None` chooses the agents whose bodies
    /// the scenario records, or else agent 0.
    pub drawn_agents: Option<&'a [u32]>,
}

/// Plays the policies of the run in `folder`, and records the episodes of all agents with the
/// recorder that `recorder_factory` makes. [`evaluate`](super::evaluate::evaluate) with
/// `settings.evaluation` plays the same episodes. `on_finished` is called with the number of
/// episodes that each agent has played.
///
/// Returns one row per episode, in (agent, episode) order.
///
/// # Errors
/// The folder has no checkpoint, the team has no such agent, or the recording could not be written.
pub fn replay(
    folder: &RunFolder,
    settings: &ReplaySettings<'_>,
    recorder_factory: Box<dyn RecorderFactory>,
    on_finished: &mut dyn FnMut(u32),
) -> Result<(Plan, Vec<EpisodeRow>), RunError> {
    let (plan, mut trainer) = load_to_play(folder, &settings.evaluation)?;
    let recording = recording_settings(&plan, settings.drawn_agents)?;
    let mut recorder = create_recorder(&plan, &trainer, settings, recorder_factory, &recording)?;
    let mut measures = Measures::new(trainer.spec(), trainer.agent_count());
    let mut rows = Vec::new();
    for number in 0..settings.evaluation.episodes {
        let played = play_episode(
            &mut trainer,
            &settings.evaluation,
            number,
            recording.scene.as_ref(),
        )?;
        let episodes: Vec<_> = played.episodes.iter().collect();
        let episode_rows = measures
            .add_round(trainer.spec(), number, &episodes, &[], Division::NONE)
            .episodes;
        recorder.record_round(&RoundRecord {
            round: number,
            episodes: &episodes,
            episode_rows: &episode_rows,
            round_rows: &[],
            step_data: &[],
            details: &played.details,
            workers: Workers::CURRENT_THREAD,
        })?;
        rows.extend(episode_rows);
        on_finished(number + 1);
    }
    recorder.finish()?;
    rows.sort_by_key(|row| (row.agent, row.episode));
    Ok((plan, rows))
}

/// The recording settings of the scenario, except that every episode is recorded in full.
/// Advantages are not recorded, because no agent learns.
fn recording_settings(
    plan: &Plan,
    drawn_agents: Option<&[u32]>,
) -> Result<RecordingSettings, InputError> {
    let agent_count = plan.scenario.agents.count.get();
    if let Some(agent) = drawn_agents
        .unwrap_or_default()
        .iter()
        .find(|agent| **agent >= agent_count)
    {
        let message = format!(
            "there is no agent {agent}; the team of `{}` has agents 0 to {}",
            plan.name,
            agent_count - 1
        );
        return Err(InputError::about("--agents", message));
    }
    let mut settings = plan.scenario.recording.clone().without_advantages();
    let mut drawn_agents: Vec<u32> = match (drawn_agents, &settings.scene) {
        (Some(agents), _) => agents.to_vec(),
        (None, Some(scene)) => scene.agents.iter().map(|agent| **agent).collect(),
        (None, None) => vec![0],
    };
    drawn_agents.sort_unstable();
    drawn_agents.dedup();
    let agents: Vec<_> = drawn_agents.into_iter().map(Into::into).collect();
    settings.scene = Some(SceneSettings {
        agents: agents.into(),
        every: ranged_count(1),
    });
    settings.raw_every = ranged_count(1);
    Ok(settings)
}

fn create_recorder(
    plan: &Plan,
    trainer: &Trainer,
    settings: &ReplaySettings<'_>,
    recorder_factory: Box<dyn RecorderFactory>,
    recording: &RecordingSettings,
) -> Result<Box<dyn Recorder>, RunError> {
    let info = RunInfo {
        name: &format!("{}-seed-{}-replay", plan.name, plan.scenario.seed),
        focus: Focus::Motion,
        spec: trainer.spec(),
        scene: trainer.scene(),
        agents: trainer.agent_count() as u32,
        ranks: Ranks::SINGLE,
        bonus: BonusRange::None,
        max_episodes: settings.evaluation.episodes,
        run_seed: plan.scenario.seed,
        scenario: &plan.stored_scenario(),
        properties: &[
            ("replay_after_round", trainer.rounds().to_string()),
            ("replay_seed", settings.evaluation.seed.to_string()),
        ],
    };
    Ok(recorder_factory.create(&info, recording)?)
}
