//! The runs in a directory, with the main results of each.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize, Serializer};

use crate::input_files;
use crate::record::state_files::StateFiles;
use crate::record::table;
use crate::run::facts::returns::{
    final_mean_of_learners, final_return, returns_of_agents, team_returns,
};
use crate::run::facts::{EpisodeRow, SolvedAt};
use crate::run::folder::checksums::Checksums;
use crate::run::folder::{RunFolder, read_verified_summary, run_folders};
use crate::scenario::Scenario;
use crate::text::file_stem;
use seedbed_env::caught_panic;

/// A run with its main results. What is not known is `None`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunOverview {
    /// Directory of the run.
    #[serde(serialize_with = "lossy_path")]
    pub path: PathBuf,
    /// Whether the run is finished.
    pub state: RunState,
    /// What is wrong with the files, if the state is [`RunState::Unreadable`].
    pub error: Option<String>,
    /// Results; all are `None` if the files cannot be read.
    #[serde(flatten)]
    pub results: Results,
    /// When the last result was written.
    #[serde(skip)]
    pub written: Option<SystemTime>,
    /// Time from the first to the last file of the run, in seconds. It includes interruptions.
    pub seconds: Option<f64>,
}

/// Writes a path as text, with � for what is not in UTF-8.
fn lossy_path<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

/// Whether a run is finished.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RunState {
    /// The run is finished.
    Finished,
    /// The run is in progress or was interrupted.
    Unfinished,
    /// There is a recording, but no tables.
    RecordingOnly,
    /// A file is damaged.
    Unreadable,
}

/// Main results of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Results {
    /// Name of the scenario.
    pub scenario: Option<String>,
    /// Name of the task or, of a tabular run, of the task family.
    #[serde(alias = "task")]
    pub environment: Option<String>,
    /// Run seed.
    pub seed: Option<u64>,
    /// Number of agents K; of a recorded run, of its learners.
    pub agents: Option<u64>,
    /// Number of recorded copies of the environment, if learners act in several.
    pub copies: Option<u64>,
    /// Number of episodes that every agent has finished.
    pub episodes_per_agent: Option<u64>,
    /// Number of environment steps of the whole team.
    pub env_steps: Option<u64>,
    /// Mean return over agents and over the last 25 episodes of each agent.
    pub final_return: Option<f64>,
    /// Threshold at which the task counts as solved.
    pub solved_at: Option<SolvedAt>,
    /// Number of episodes per agent until the task was solved.
    pub episodes_until_solved: Option<u64>,
    /// Share of the state space that the team visited, 0 to 1.
    pub team_coverage: Option<f64>,
    /// Effective number of agents, 1 to K.
    pub effective_agents: Option<f64>,
    /// Regret of a tabular run: sum over the episodes of an agent, mean over agents.
    pub regret_per_agent: Option<f64>,
}

/// All runs in `folder` and its subdirectories, sorted by path.
#[must_use]
pub fn find_runs(folder: &Path) -> Vec<RunOverview> {
    let paths = run_folders(folder);
    paths.into_iter().map(overview_or_error).collect()
}

/// The overview of a run. Whatever its files contain, the other runs are listed.
fn overview_or_error(path: PathBuf) -> RunOverview {
    caught_panic(|| RunOverview::of(path.clone())).unwrap_or_else(|error| RunOverview {
        path,
        state: RunState::Unreadable,
        error: Some(error),
        results: Results::default(),
        written: None,
        seconds: None,
    })
}

impl RunOverview {
    /// Overview of the run in a directory.
    #[must_use]
    pub fn of(path: PathBuf) -> Self {
        let folder = RunFolder::new(&path);
        let is_finished = folder.summary_file().is_file();
        let results = if is_finished {
            finished_results(&folder)
        } else {
            unfinished_results(&folder)
        };
        let state = match &results {
            Err(_) => RunState::Unreadable,
            Ok(_) if is_finished => RunState::Finished,
            Ok(_) if has_more_than_recording(&folder) => RunState::Unfinished,
            Ok(_) => RunState::RecordingOnly,
        };
        let written = last_result_time(&folder);
        Self {
            path,
            state,
            error: results.as_ref().err().cloned(),
            results: results.unwrap_or_default(),
            written,
            seconds: written.and_then(|written| duration_until(&folder, written)),
        }
    }

    /// Whether the task is solved; `None` if it has no threshold or the run is not finished.
    #[must_use]
    pub fn is_solved(&self) -> Option<bool> {
        let has_threshold = self.state == RunState::Finished && self.results.solved_at.is_some();
        has_threshold.then(|| self.results.episodes_until_solved.is_some())
    }
}

fn has_more_than_recording(folder: &RunFolder) -> bool {
    let [episodes, _] = folder.table_files();
    folder.scenario_file().is_file() || episodes.is_file() || folder.has_state_files()
}

fn finished_results(folder: &RunFolder) -> Result<Results, String> {
    if folder.has_state_files() {
        // Their summary is for other tools.
        return state_file_results(folder);
    }
    let results = read_verified_summary(folder).map_err(|error| error.to_string())?;
    Ok(results.unwrap_or_default())
}

/// Results of a run that has no summary yet, from its tables.
fn unfinished_results(folder: &RunFolder) -> Result<Results, String> {
    if folder.has_state_files() {
        return state_file_results(folder);
    }
    let parent = folder.path().parent().map(|path| file_stem(path, ""));
    let mut results = Results {
        // The scenario in folders of earlier versions has no name.
        scenario: parent.filter(|name| !name.is_empty()),
        ..Results::default()
    };
    let [episodes, _] = folder.table_files();
    if !has_more_than_recording(folder) {
        return Ok(results);
    }
    let checksums = Checksums::read(folder).map_err(|error| error.to_string())?;
    if folder.scenario_file().is_file() {
        add_scenario(&mut results, folder, &checksums)?;
    }
    let present = checksums.check_presence(&episodes);
    present.map_err(|error| error.to_string())?;
    if episodes.is_file() {
        let verified = checksums.verify(&episodes);
        verified.map_err(|error| error.to_string())?;
        let rows: Vec<EpisodeRow> = table::read(&episodes).map_err(|error| error.to_string())?;
        add_episodes(&mut results, &rows);
    }
    Ok(results)
}

fn add_scenario(
    results: &mut Results,
    folder: &RunFolder,
    checksums: &Checksums,
) -> Result<(), String> {
    let verified = checksums.verify_scenario();
    verified.map_err(|error| error.to_string())?;
    let scenario = input_files::read::<Scenario>(&folder.scenario_file());
    let scenario = scenario.map_err(|error| error.to_string())?.value;
    if !scenario.name.is_empty() {
        results.scenario = Some(scenario.name.value().clone());
    }
    results.environment = Some(scenario.environment.task_name().into_owned());
    results.seed = Some(scenario.seed);
    results.agents = Some(u64::from(scenario.agents.count.get()));
    Ok(())
}

/// Results of a run that another program records.
fn state_file_results(folder: &RunFolder) -> Result<Results, String> {
    let files = StateFiles::open_folder(folder.path()).map_err(|error| error.to_string())?;
    let mut results = Results {
        scenario: Some(file_stem(folder.path(), "")),
        environment: Some(files.environment().to_owned()),
        ..Results::default()
    };
    let (rows, learners) = (files.episode_rows(), files.learners());
    let returns = learners.returns(rows);
    results.agents = Some(returns.len() as u64);
    results.copies = learners.have_copies().then(|| learners.agents() as u64);
    results.episodes_per_agent = returns.iter().map(Vec::len).min().map(|count| count as u64);
    results.env_steps = Some(rows.last().map_or(0, |row| row.env_steps));
    results.final_return = final_mean_of_learners(&returns);
    Ok(results)
}

/// Adds the results in rows of episodes. Without a scenario, the agents are those up to the last with a
/// row.
fn add_episodes(results: &mut Results, rows: &[EpisodeRow]) {
    let last_agent = rows.iter().map(|row| u64::from(row.agent) + 1).max();
    results.agents = results.agents.or(last_agent);
    let agents = results.agents.unwrap_or(0) as usize;
    let returns = team_returns(rows, agents);
    results.episodes_per_agent = Some(returns.len() as u64);
    results.env_steps = Some(rows.last().map_or(0, |row| row.env_steps));
    let of_agents = returns_of_agents(rows, agents);
    let counts = of_agents.iter().map(Vec::len);
    results.final_return = final_return(counts, &returns, &of_agents);
    results.effective_agents = rows.last().map(|row| row.effective_agents);
}

/// When the summary was written or, without one, the table of episodes.
fn last_result_time(folder: &RunFolder) -> Option<SystemTime> {
    let [episodes, _] = folder.table_files();
    let modified = |path: &PathBuf| fs::metadata(path).ok()?.modified().ok();
    let results = [folder.summary_file(), episodes, folder.recording_file()];
    let result = results.iter().find_map(modified);
    result.or_else(|| {
        let state_files = folder.state_files();
        state_files.iter().filter_map(modified).max()
    })
}

/// Seconds since the scenario was written at the beginning of the run.
fn duration_until(folder: &RunFolder, end: SystemTime) -> Option<f64> {
    let [episodes, _] = folder.table_files();
    if !episodes.is_file() {
        return None; // a tabular run writes all its files at the end
    }
    let start = fs::metadata(folder.scenario_file()).ok()?.modified().ok()?;
    end.duration_since(start)
        .ok()
        .map(|time: Duration| time.as_secs_f64())
}
