//! A tabular run: the loop of single actions, its recording and its result files.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use super::recording::{TabularRecorder, task_spec};
use super::results::{Results, Summary};
use super::scenario::TabularScenario;
use super::team::{Episode, TabularTeam};
use crate::run::execution::stopping;
use crate::run::facts::{EpisodeRow, FINAL_WINDOW};
use crate::run::measures::RoundRows;
use crate::run::recorder::RecorderFactory;
use crate::run::{Observer, Options, Progress, RunError};
use crate::text::file_stem;
use seedbed_env::{Status, TaskSpec};

/// A tabular scenario that can be run.
#[derive(Clone, Debug)]
pub struct TabularPlan {
    /// Name of the scenario: the stem of its file.
    pub name: String,
    /// The scenario.
    pub scenario: TabularScenario,
    /// The task, as recordings and reports describe it.
    pub spec: TaskSpec,
}

/// How a tabular run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// All agents have finished all episodes.
    Finished(Box<Summary>),
    /// The run was interrupted, and cannot be resumed.
    Interrupted {
        /// Number of episodes that the team has finished.
        episodes: usize,
    },
}

impl TabularPlan {
    /// The plan of a scenario that was read from `path`.
    #[must_use]
    pub fn new(path: &Path, scenario: TabularScenario) -> Self {
        Self {
            name: file_stem(path, "run"),
            // All tasks that a family draws have the same states and actions.
            spec: task_spec(&scenario, &scenario.task.model(0)),
            scenario,
        }
    }

    /// Number of episodes of the whole team.
    fn team_episodes(&self) -> usize {
        self.scenario.agents.count.get() as usize * self.scenario.episodes.get() as usize
    }
}

/// Runs a plan until all episodes are finished, or until `interrupted` is set, and writes all
/// results into the run directory. `recorder_factory` makes the recorder; `None` records nothing.
///
/// # Errors
/// If a file cannot be written, or if an interrupted run is to be resumed.
pub fn execute(
    plan: &TabularPlan,
    options: &Options,
    recorder_factory: Option<Box<dyn RecorderFactory>>,
    observer: &mut dyn Observer,
    interrupted: &AtomicBool,
) -> Result<Ending, RunError> {
    let folder = &options.folder;
    if options.resume {
        return Err(RunError::CannotResume(format!(
            "the run in {} cannot be resumed: tabular runs have no checkpoints",
            folder.path().display()
        )));
    }
    let mut recorder = TabularRecorder::new(&plan.name, &plan.scenario, recorder_factory)?;
    let mut episodes = Vec::new();
    let played = stopping::with_grace(interrupted, |cancellation| {
        cancellation.run(|| play(plan, &mut recorder, &mut episodes, observer, interrupted))
    });
    let Some(team) = played.transpose()?.flatten() else {
        return Ok(Ending::Interrupted {
            episodes: episodes.len(),
        });
    };
    recorder.finish()?;
    report_warning(&mut recorder, observer);
    let results = Results::of(&plan.name, &plan.scenario, &team, episodes);
    results.write(&plan.scenario, folder)?;
    Ok(Ending::Finished(Box::new(results.summary)))
}

/// Plays all episodes. `None` if interrupted.
fn play(
    plan: &TabularPlan,
    recorder: &mut TabularRecorder,
    episodes: &mut Vec<Episode>,
    observer: &mut dyn Observer,
    interrupted: &AtomicBool,
) -> Result<Option<TabularTeam>, RunError> {
    let mut team = TabularTeam::new(&plan.scenario);
    observer.begun(&progress(plan, &team, episodes));
    while let Some(step) = team.advance() {
        recorder.record_step(&step)?;
        if let Some(episode) = step.ended_episode {
            episodes.push(episode);
            report_warning(recorder, observer);
            let row = row_of(&episode, team.steps(), recorder.outcome_in(step.to));
            let rows = RoundRows {
                episodes: vec![row],
                updates: Vec::new(),
            };
            observer.round_finished(&progress(plan, &team, episodes), &rows);
        }
        if interrupted.load(Ordering::Relaxed) && episodes.len() < plan.team_episodes() {
            return Ok(None);
        }
    }
    Ok(Some(team))
}

fn report_warning(recorder: &mut TabularRecorder, observer: &mut dyn Observer) {
    if let Some(warning) = recorder.take_warning() {
        observer.warn(&warning);
    }
}

/// The row of an episode. Measures of visits are not computed during tabular runs.
fn row_of(episode: &Episode, env_steps: u64, outcome: Status) -> EpisodeRow {
    EpisodeRow {
        agent: episode.agent,
        episode: episode.episode,
        round: episode.episode,
        env_steps,
        r#return: episode.r#return,
        length: episode.length,
        outcome,
        coverage: f64::NAN,
        visitation_entropy: f64::NAN,
        team_overlap: f64::NAN,
        effective_agents: f64::NAN,
    }
}

/// Progress counts the episodes of the whole team, because agents finish episodes at different
/// times.
fn progress(plan: &TabularPlan, team: &TabularTeam, episodes: &[Episode]) -> Progress {
    let recent = &episodes[episodes.len().saturating_sub(FINAL_WINDOW)..];
    let sum: f64 = recent.iter().map(|episode| episode.r#return).sum();
    Progress {
        rounds: episodes.len() as u32,
        episodes: episodes.len(),
        max_episodes: plan.team_episodes(),
        max_env_steps: None,
        recent_return: sum / recent.len().max(1) as f64,
        env_steps: team.steps(),
    }
}
