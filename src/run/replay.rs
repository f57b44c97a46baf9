//! Replays: records episodes of trained policies, which no longer learn, with the moving bodies of
//! chosen agents.

use super::evaluate::{Evaluation, load_trained, play_episode};
use super::folder::RunFolder;
use super::measures::Measures;
use super::trainer::Trainer;
use super::{Plan, RunError};
use crate::record::{
    BonusRange, EpisodeRow, Focus, Recorder, RecorderFactory, RecordingSettings, RoundRecord,
    RunInfo, SceneSettings,
};
use seedbed_env::input::InputError;
use seedbed_env::input::numbers::known_count;

/// What a replay shows.
#[derive(Clone, Copy, Debug)]
pub struct Replay<'a> {
    /// How many episodes, and how actions are chosen.
    pub evaluation: Evaluation,
    /// The agents whose bodies are drawn in every episode; `None` chooses those of the scenario, or
    /// agent 0.
    pub agents: Option<&'a [u32]>,
}

/// Plays the policies of the run in `folder` and records all agents' episodes with what `recording`
/// makes. They are the episodes that [`evaluate`](super::evaluate::evaluate) plays with the same
/// seed. `finished` is called with the number of episodes that each agent has played.
///
/// Returns one row per episode, in (agent, episode) order.
///
/// # Errors
/// The folder has no checkpoint, the team has no such agent, or the recording could not be written.
pub fn replay(
    folder: &RunFolder,
    replay: &Replay<'_>,
    recording: Box<dyn RecorderFactory>,
    finished: &mut dyn FnMut(u32),
) -> Result<(Plan, Vec<EpisodeRow>), RunError> {
    let (plan, mut trainer) = load_trained(folder, replay.evaluation.actions)?;
    let settings = settings(&plan, replay.agents)?;
    let mut recorder = recorder(&plan, &trainer, replay, recording, &settings)?;
    let mut measures = Measures::new(trainer.spec(), trainer.agent_count());
    let mut rows = Vec::new();
    for number in 0..replay.evaluation.episodes {
        let played = play_episode(
            &mut trainer,
            &replay.evaluation,
            number,
            settings.scene.as_ref(),
        );
        let episodes: Vec<_> = played.episodes.iter().collect();
        let measured = measures
            .add_round(trainer.spec(), number, &episodes, &[])
            .episodes;
        recorder.record_round(&RoundRecord {
            round: number,
            episodes: &episodes,
            episode_rows: &measured,
            round_rows: &[],
            step_data: &[],
            body_trajectories: &played.body_trajectories,
        })?;
        rows.extend(measured);
        finished(number + 1);
    }
    recorder.finish()?;
    rows.sort_by_key(|row| (row.agent, row.episode));
    Ok((plan, rows))
}

/// The scenario's settings, except that every episode is recorded in full. There are no advantages,
/// because no agent learns.
fn settings(plan: &Plan, agents: Option<&[u32]>) -> Result<RecordingSettings, InputError> {
    let count = plan.scenario.agents.count.get();
    if let Some(agent) = agents
        .unwrap_or_default()
        .iter()
        .find(|agent| **agent >= count)
    {
        let message = format!(
            "there is no agent {agent}; the team of `{}` has agents 0 to {}",
            plan.name,
            count - 1
        );
        return Err(InputError {
            origin: "--agents".to_owned(),
            position: None,
            field: String::new(),
            message,
            help: None,
        });
    }
    let mut settings = plan.scenario.recording.clone().without_advantages();
    let mut drawn_agents: Vec<u32> = match (agents, &settings.scene) {
        (Some(agents), _) => agents.to_vec(),
        (None, Some(scene)) => scene.agents.iter().map(|agent| **agent).collect(),
        (None, None) => vec![0],
    };
    drawn_agents.sort_unstable();
    drawn_agents.dedup();
    let agents: Vec<_> = drawn_agents.into_iter().map(Into::into).collect();
    settings.scene = Some(SceneSettings {
        agents: agents.into(),
        every: known_count(1),
    });
    settings.raw_every = known_count(1);
    Ok(settings)
}

fn recorder(
    plan: &Plan,
    trainer: &Trainer,
    replay: &Replay<'_>,
    recording: Box<dyn RecorderFactory>,
    settings: &RecordingSettings,
) -> Result<Box<dyn Recorder>, RunError> {
    let info = RunInfo {
        name: &format!("{}-seed-{}-replay", plan.name, plan.scenario.seed),
        focus: Focus::Motion,
        spec: trainer.spec(),
        scene: trainer.environment().scene(),
        agents: trainer.agent_count() as u32,
        bonus: BonusRange::None,
        episodes: replay.evaluation.episodes,
        run_seed: plan.scenario.seed,
        scenario: &plan.scenario.resolved(),
        properties: &[
            ("replay_after_round", trainer.rounds().to_string()),
            ("replay_seed", replay.evaluation.seed.to_string()),
        ],
    };
    Ok(recording.create(&info, settings)?)
}
