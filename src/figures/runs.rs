//! Runs with the states that a figure shows.

use super::FigureError;
use super::settings::{FigureSettings, Part};
use crate::record::visitation::Axes;
use crate::record::{RecordedStates, common_axes};
use crate::review::LoadedRun;
use crate::review::selection::{EpisodeSelection, SelectedStates};
use crate::run::Plan;
use crate::run::folder::read_scenario;

/// A run with the states to draw.
#[derive(Debug)]
pub(super) struct PlottedRun {
    /// Name of the run in the figure.
    pub(super) label: String,
    pub(super) loaded_run: LoadedRun,
    /// Axes on which the states of all runs are drawn; `None` if no part shows states.
    pub(super) axes: Option<Axes>,
    /// Selected states of each agent; empty if no part shows states.
    pub(super) states: Vec<SelectedStates>,
    /// Selected states of all agents, if only some agents are drawn and are compared with all.
    pub(super) team: Vec<SelectedStates>,
    /// Outlines of bodies that never move, m: `[lines]` of `[points]`; empty if no part shows states, or the task is not known.
    pub(super) walls: Vec<Vec<[f32; 2]>>,
}

/// Reads the states of opened runs. Calls `on_episode` for each episode that is read.
pub(super) fn read(
    settings: &FigureSettings,
    opened: Vec<LoadedRun>,
    on_episode: &mut dyn FnMut(),
) -> Result<Vec<PlottedRun>, FigureError> {
    let axes = settings
        .shows_states()
        .then(|| axes_of_all(&opened))
        .transpose()?;
    // Whether chosen agents are compared with all agents of their run.
    let needs_team =
        settings.shows(Part::Difference) && opened.len() == 1 && !settings.agents.is_empty();
    let mut runs = Vec::with_capacity(opened.len());
    for run in opened {
        let mut run = with_returns(run, on_episode)?;
        check_agents(settings, &run)?;
        let (mut states, mut team) = (Vec::new(), Vec::new());
        if let (Some(recording), Some(axes)) = (&mut run.recording, &axes) {
            let mut selection = settings.state_selection(recording, axes)?;
            states = selection.select(recording, |_| on_episode())?;
            if needs_team {
                selection.episodes.agents.clear();
                selection.sample_size = 0;
                team = selection.select(recording, |_| on_episode())?;
            }
        }
        let walls = if [Part::Scatter, Part::Density, Part::Difference]
            .iter()
            .any(|part| settings.shows(*part))
        {
            walls(&run).unwrap_or_default()
        } else {
            Vec::new()
        };
        runs.push(PlottedRun {
            walls,
            label: run.title(),
            loaded_run: run,
            axes: axes.clone(),
            states,
            team,
        });
    }
    label_by_path_if_equal(&mut runs);
    Ok(runs)
}

/// A note if returns in different tasks are drawn beside each other.
pub(super) fn note_on_tasks(settings: &FigureSettings, runs: &[PlottedRun]) -> Option<String> {
    let mut parts = [Part::Returns, Part::Curves].into_iter();
    if !parts.any(|part| settings.shows(part)) {
        return None;
    }
    let mut names: Vec<String> = runs.iter().filter_map(task_name).collect();
    names.sort_unstable();
    names.dedup();
    (names.len() > 1).then(|| {
        let names = names.join(", ");
        format!("the runs are in different tasks ({names}), whose returns do not compare")
    })
}

/// Name of the task; `None` if it is not known. The task itself is not read: that of Gymnasium would start Python.
fn task_name(run: &PlottedRun) -> Option<String> {
    let folder = run.loaded_run.folder.as_ref()?;
    let scenario = read_scenario(&folder.scenario_file()).ok()?.value;
    Some(scenario.environment.task_name().into_owned())
}

/// The outlines of bodies that never move; `None` if the task is not known.
fn walls(run: &LoadedRun) -> Option<Vec<Vec<[f32; 2]>>> {
    Some(Plan::of_run(run.folder.as_ref()?).ok()?.walls())
}

/// Without tables, the returns are taken from the recording.
fn with_returns(
    mut run: LoadedRun,
    on_episode: &mut dyn FnMut(),
) -> Result<LoadedRun, FigureError> {
    if run.folder.is_none() {
        run.compute_stats(&EpisodeSelection::all(), |_| on_episode())?;
    }
    Ok(run)
}

fn check_agents(settings: &FigureSettings, run: &LoadedRun) -> Result<(), FigureError> {
    let count = run.agent_count() as u32;
    let missing = settings.agents.iter().find(|agent| **agent >= count);
    missing.map_or(Ok(()), |&agent| {
        Err(FigureError::NoAgent {
            run: run.path.clone(),
            agent,
            last: count.saturating_sub(1),
        })
    })
}

/// Runs with the same name are labeled with their paths.
fn label_by_path_if_equal(runs: &mut [PlottedRun]) {
    let names: Vec<String> = runs.iter().map(|run| run.label.clone()).collect();
    for run in runs {
        if names.iter().filter(|name| **name == run.label).count() > 1 {
            run.label = run.loaded_run.path.display().to_string();
        }
    }
}

/// The axes on which the states of all runs are drawn.
fn axes_of_all(runs: &[LoadedRun]) -> Result<Axes, FigureError> {
    let mut recordings: Vec<(String, &RecordedStates)> = Vec::with_capacity(runs.len());
    for run in runs {
        let not_recorded = || FigureError::NotRecorded(run.path.clone());
        let recording = run.recording.as_ref().ok_or_else(not_recorded)?;
        recordings.push((run.path.display().to_string(), recording));
    }
    common_axes(&recordings).map_err(FigureError::OtherAxes)
}
