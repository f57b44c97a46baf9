//! Previews: a few episodes of random actions on record, so that the author of a task sees what it
//! is.

use std::path::Path;

use super::trainer::Trainer;
use super::{Recorders, RunError, play_round};
use crate::record::rerun::{Focus, RerunRecorder, RunInfo};
use crate::record::{BonusRange, EpisodeRow, RecordingSettings, SceneSettings};
use crate::scenario::{Scenario, Schedule, Stop};
use seedbed_env::Physics;
use seedbed_env::TaskDescription;
use seedbed_env::input::numbers::{Count, known_count};
use seedbed_learn::agent::TeamConfig;
use seedbed_learn::algorithms::Algorithm;

/// Plays `episodes` episodes of a task with random actions and records all of them, bodies
/// included, to `path`.
///
/// Returns one row an episode.
///
/// # Errors
/// The task cannot be built with this physics, or the file cannot be written.
pub fn record(
    description: &TaskDescription,
    physics: Physics,
    episodes: Count,
    seed: u64,
    path: &Path,
) -> Result<Vec<EpisodeRow>, RunError> {
    let scenario = scenario(description, physics, episodes, seed);
    let mut trainer = Trainer::from_scenario(&scenario, description, 1)?;
    let text = scenario.resolved();
    let about = RunInfo {
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
    let mut recorders: Recorders = vec![Box::new(RerunRecorder::create(
        path,
        &about,
        &scenario.recording,
    )?)];
    let mut all = Vec::new();
    while !trainer.is_done() {
        all.extend(play_round(&mut trainer, &mut recorders)?.episodes);
    }
    recorders
        .iter_mut()
        .try_for_each(|recorder| recorder.finish())?;
    Ok(all)
}

/// One random agent, every episode of which is filmed.
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
