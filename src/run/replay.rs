//! Replays: episodes of a run's policies, which no longer learn, on record with the bodies of some
//! agents.

use std::path::Path;

use super::evaluate::{Evaluation, play, trained};
use super::folder::RunFolder;
use super::measures::Measures;
use super::trainer::Trainer;
use super::{Plan, RunError};
use crate::record::rerun::{Focus, RerunRecorder, RunInfo};
use crate::record::{
    BonusRange, EpisodeRow, Recorder, RecordingSettings, RoundRecord, SceneSettings,
};
use seedbed_env::input::InputError;
use seedbed_env::input::numbers::known_count;

/// What is replayed.
#[derive(Clone, Copy, Debug)]
pub struct Replay<'a> {
    /// How many episodes, and how actions are chosen.
    pub evaluation: Evaluation,
    /// Whose bodies are drawn, in every episode; none are those that the scenario draws, or agent
    /// 0.
    pub agents: Option<&'a [u32]>,
    /// The recording.
    pub path: &'a Path,
}

/// Plays the policies of the run in `folder` and records all agents' episodes. They are those that
/// [`evaluate`](super::evaluate::evaluate) plays with the same seed.   `finished` is told how many
/// episodes each agent has played
///
/// Returns one row an episode, in (agent, episode) order.
///
/// # Errors
/// The folder holds no run with a checkpoint, an agent is not of its team, or the recording could
/// not be written.
pub fn replay(
    folder: &RunFolder,
    replay: &Replay<'_>,
    finished: &mut dyn FnMut(u32),
) -> Result<(Plan, Vec<EpisodeRow>), RunError> {
    let (plan, mut trainer) = trained(folder, replay.evaluation.actions)?;
    let settings = settings(&plan, replay.agents)?;
    let mut recorder = recorder(&plan, &trainer, replay, &settings)?;
    let mut measures = Measures::new(trainer.spec(), trainer.agent_count());
    let mut rows = Vec::new();
    for number in 0..replay.evaluation.episodes {
        let played = play(
            &mut trainer,
            &replay.evaluation,
            number,
            settings.scene.as_ref(),
        );
        let episodes: Vec<_> = played.episodes.iter().collect();
        let measured = measures
            .take_in(trainer.spec(), number, &episodes, &[])
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

/// As the scenario has them, but every episode in full; nobody learns, and so nobody estimates
/// advantages.
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
    let mut filmed: Vec<u32> = match (agents, &settings.scene) {
        (Some(agents), _) => agents.to_vec(),
        (None, Some(scene)) => scene.agents.iter().map(|agent| **agent).collect(),
        (None, None) => vec![0],
    };
    filmed.sort_unstable();
    filmed.dedup();
    let agents: Vec<_> = filmed.into_iter().map(Into::into).collect();
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
    settings: &RecordingSettings,
) -> Result<RerunRecorder, RunError> {
    let about = RunInfo {
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
    Ok(RerunRecorder::create(replay.path, &about, settings)?)
}
