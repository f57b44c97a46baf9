//! Previews: records a few episodes with random actions, so that the author of a task sees it move.

use super::trainer::Trainer;
use super::{Recorders, RunError, play_round};
use crate::record::{
    BonusRange, EpisodeRow, Focus, RecorderFactory, RecordingSettings, RunInfo, SceneSettings,
};
use crate::scenario::{Scenario, Schedule, Stop};
use seedbed_env::Physics;
use seedbed_env::TaskDescription;
use seedbed_env::input::numbers::{Count, known_count};
use seedbed_learn::agent::TeamConfig;
use seedbed_learn::algorithms::Algorithm;

/// Plays `episodes` episodes of a task with random actions and records all of them, bodies
/// included, with what `recording` makes.
///
/// Returns one row per episode.
///
/// # Errors
/// The task cannot be built with this physics, or the file cannot be written.
pub fn record(
    description: &TaskDescription,
    physics: Physics,
    episodes: Count,
    seed: u64,
    recording: Box<dyn RecorderFactory>,
) -> Result<Vec<EpisodeRow>, RunError> {
    let scenario = scenario(description, physics, episodes, seed);
    let mut trainer = Trainer::from_scenario(&scenario, description, 1)?;
    let text = scenario.resolved();
    let info = RunInfo {
        name: &format!("{}-preview", description.spec().name),
        focus: Focus::Motion,
        spec: trainer.spec(),
        scene: trainer.environment().scene(),
        agents: 1,
        bonus: BonusRange::None,
        episodes: episodes.get(),
        run_seed: seed,
        scenario: &text,
        properties: &[],
    };
    let mut recorders: Recorders = vec![recording.create(&info, &scenario.recording)?];
    let mut all = Vec::new();
    while !trainer.is_done() {
        all.extend(play_round(&mut trainer, &mut recorders)?.episodes);
    }
    recorders
        .iter_mut()
        .try_for_each(|recorder| recorder.finish())?;
    Ok(all)
}

/// A scenario with one random agent, whose bodies are drawn in every episode.
fn scenario(
    description: &TaskDescription,
    physics: Physics,
    episodes: Count,
    seed: u64,
) -> Scenario {
    Scenario {
        environment: description.spec().name.clone().into(),
        physics,
        agents: TeamConfig {
            count: known_count(1),
            ..TeamConfig::default()
        },
        algorithm: Algorithm::Random.into(),
        schedule: Schedule::default(),
        stop: Stop::Episodes(episodes),
        recording: RecordingSettings {
            density_every: known_count(1),
            scene: Some(SceneSettings {
                every: known_count(1),
                ..SceneSettings::default()
            }),
            ..Default::default()
        },
        checkpoint_every: episodes,
        seed,
    }
}
