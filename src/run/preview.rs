//! Previews: records a few episodes of random actions, so that the author of a task sees how its
//! bodies move.

use super::error::RunError;
use super::execution::RoundRecorder;
use super::ranks::Ranks;
use super::training::EpisodeWarning;
use super::training::Trainer;
use crate::run::facts::EpisodeRow;
use crate::run::recorder::{BonusRange, Focus, RecorderFactory, RunInfo};
use crate::scenario::recording::{RecordingSettings, SceneSettings};
use crate::scenario::{Scenario, Schedule, Stop, TaskReference};
use seedbed_env::Physics;
use seedbed_env::TaskDescription;
use seedbed_input::numbers::{Count, ranged_count, ranged_number};
use seedbed_learn::agent::TeamConfig;
use seedbed_learn::algorithms::Algorithm;

/// Plays `episodes` episodes of a task with random actions, and records all of them including the
/// bodies, with the recorder that `recorder_factory` makes.
///
/// Returns one row per episode, and the first physics warning.
///
/// # Errors
/// The task cannot be built with this physics, or the file cannot be written.
pub fn record(
    description: &TaskDescription,
    physics: Physics,
    episodes: Count,
    run_seed: u64,
    recorder_factory: Box<dyn RecorderFactory>,
) -> Result<(Vec<EpisodeRow>, Option<EpisodeWarning>), RunError> {
    let scenario = preview_scenario(description, physics, episodes, run_seed);
    let mut trainer = Trainer::from_scenario(&scenario, description, 1)?;
    let scenario_text = scenario.resolved();
    let info = RunInfo {
        name: &format!("{}-preview", description.spec().name),
        focus: Focus::Motion,
        spec: trainer.spec(),
        scene: trainer.scene(),
        agents: 1,
        ranks: Ranks::SINGLE,
        bonus: BonusRange::None,
        max_episodes: episodes.get(),
        run_seed,
        scenario: &scenario_text,
        properties: &[],
    };
    let recorders = vec![recorder_factory.create(&info, &scenario.recording)?];
    let mut recorder = RoundRecorder::new(recorders, 1, 1);
    let mut rows = Vec::new();
    while !trainer.is_done() {
        let round = trainer.advance()?;
        rows.extend(round.rows.episodes.iter().cloned());
        recorder.record(trainer.rounds() - 1, &trainer.newest_episodes(), round)?;
    }
    recorder.finish()?;
    Ok((rows, trainer.physics_warning().cloned()))
}

/// A scenario with one random agent, whose bodies are drawn in every episode.
fn preview_scenario(
    description: &TaskDescription,
    physics: Physics,
    episodes: Count,
    run_seed: u64,
) -> Scenario {
    Scenario {
        name: String::new().into(),
        environment: TaskReference::Named(description.spec().name.clone()).into(),
        physics,
        agents: TeamConfig {
            count: ranged_count(1),
            ..TeamConfig::default()
        },
        algorithm: Algorithm::Random.into(),
        schedule: Schedule::default(),
        stop: Stop::Episodes(episodes),
        recording: RecordingSettings {
            density_every: ranged_count(1),
            scene: Some(SceneSettings {
                every: ranged_count(1),
                ..SceneSettings::default()
            }),
            ..Default::default()
        },
        checkpoint_every: episodes,
        checkpoint_share: ranged_number(1.0),
        seed: run_seed,
    }
}
