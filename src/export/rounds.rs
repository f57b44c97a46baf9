//! The rounds of a run that another program recorded, with the measures of a run of seedbed.

use super::ExportError;
use crate::record::state_files::StateFiles;
use crate::record::{ReadError, RecordedEpisode};
use crate::run::measures::{Division, Measures, RoundRows};
use seedbed_env::{Action, Choice, Quantity, TaskSpec};
use seedbed_learn::agent::UpdateReport;
use seedbed_learn::experience::Episode;

/// Time between two actions if the files do not have it, s.
const DEFAULT_STEP_SECONDS: f64 = 0.02;

/// Calls `action` for each round with its number, its episodes and their rows: round n has the n-th
/// episode of each agent. Memory contains the episodes of one round.
pub(super) fn for_each(
    files: &StateFiles,
    spec: &TaskSpec,
    mut action: impl FnMut(u32, &[&Episode], RoundRows) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let mut agents = files.episodes_by_agent()?;
    let mut measures = Measures::new(spec, files.agent_count() as usize);
    for round in 0.. {
        let recorded = agents.iter_mut().filter_map(Iterator::next);
        let episodes: Vec<Episode> = recorded
            .map(|recorded| Ok(episode(recorded?, spec)))
            .collect::<Result<_, ReadError>>()?;
        if episodes.is_empty() {
            break;
        }
        let episodes: Vec<&Episode> = episodes.iter().collect();
        // What agents learned is not known, but rows have the measures of their visits.
        let agents = episodes.iter().map(|episode| episode.agent);
        let reports: Vec<(u32, UpdateReport)> = agents
            .map(|agent| (agent, UpdateReport::default()))
            .collect();
        let rows = measures.add_round(spec, round, &episodes, &reports, Division::NONE);
        action(round, &episodes, rows)?;
    }
    Ok(())
}

/// What is known of the task. Actions are values, not indices of values.
pub(super) fn task_spec(files: &StateFiles) -> TaskSpec {
    let action = |quantity: &Quantity| Action {
        quantity: quantity.clone(),
        choice: Choice::Continuous,
    };
    let actions = files.actions().iter().map(action).collect();
    let name = files.environment();
    TaskSpec {
        description: format!("{name}, recorded by another program."),
        control_step: files.step_seconds().unwrap_or(DEFAULT_STEP_SECONDS),
        time_limit: files.time_limit(),
        ..TaskSpec::new(name, files.observations().to_vec(), actions)
    }
}

/// The episode without log-probabilities, which are not known.
fn episode(recorded: RecordedEpisode, spec: &TaskSpec) -> Episode {
    Episode {
        agent: recorded.agent,
        episode: recorded.episode,
        round: recorded.round,
        log_probs: vec![f32::NAN; recorded.length() * spec.action_width()],
        observations: recorded.observations,
        actions: recorded.actions,
        rewards: recorded.rewards,
        outcome: recorded.outcome,
    }
}
