//! Run directories of seedbed, or of others with an `episodes.csv` such as seedbed's, as results of a
//! study.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;

use serde::Deserialize;

use super::data_file::{DataFile, Rows, file_error, incomplete_line_warning};
use super::read_run::ReadRun;
use super::run_data::{self, AgentEpisodes, Limits};
use super::source::SolvedAt;
use super::{Problem, Settings};
use crate::experiment;
use crate::experiment::measure::Curve;
use crate::experiment::run_result::{Milestone, RunResult};
use crate::record::state_files::{EndedEpisode, Learners, NotedEpisodes, StateFiles};
use crate::record::table;
use crate::run::facts;
use crate::run::facts::RoundRow;
use crate::run::folder::RunFolder;
use crate::run::folder::checksums::Checksums;
use crate::scenario::Rounding;
use seedbed_env::Quantity;
use seedbed_input::InputError;
use seedbed_input::limits::MAX_AGENTS_OF_OTHERS;
use seedbed_input::numbers::FiniteNumber;
use seedbed_stats::aggregate::mean;

/// A row of `episodes.csv`, as far as studies need it.
struct Episode {
    agent: u32,
    /// Number of the agent's episode, from 0.
    number: u32,
    round: u32,
    env_steps: u64,
    r#return: f64,
    /// Number of steps; 0 if it is unknown.
    length: u64,
    /// Number of steps of the agent's environment up to the end of the episode, if it is known.
    end_step: Option<u64>,
}

/// Reads the run in the directory `path`.
pub(super) fn read(folder: &Path, path: &Path, settings: Settings) -> Result<ReadRun, Problem> {
    let run_folder = RunFolder::new(path);
    let [episodes_path, rounds_path] = run_folder.table_files();
    let checksums = Checksums::read(&run_folder).map_err(InputError::from)?;
    for path in [&episodes_path, &rounds_path, &run_folder.summary_file()] {
        let presence = checksums.check_presence(path);
        presence.map_err(InputError::from)?;
    }
    if !episodes_path.is_file() {
        return Err(file_error(
            path,
            "expected `episodes.csv` in this directory, found none",
        )
        .into());
    }
    let verify = |path: &Path| checksums.verify(path).map_err(InputError::from);
    verify(&episodes_path)?;
    let file = DataFile::read(folder, &episodes_path)?;
    let mut warnings: Vec<String> = checksums.warning().map(str::to_owned).into_iter().collect();
    if file.complete_lines().1 {
        warnings.push(incomplete_line_warning(&file));
    }
    let episodes = read_episodes(&file)?;
    let mut files = vec![file.hash];
    let mut rounds: Vec<RoundRow> = Vec::new();
    let has_rounds = rounds_path.is_file();
    if has_rounds {
        verify(&rounds_path)?;
        files.push(DataFile::read(folder, &rounds_path)?.hash);
        rounds = read_rounds(&rounds_path)?;
    }
    let (mut threshold, mut learners) = (settings.solved, None);
    let summary_path = run_folder.summary_file();
    if summary_path.is_file() {
        verify(&summary_path)?;
        let file = DataFile::read(folder, &summary_path)?;
        let summary: SummaryOfOthers =
            serde_json::from_slice(&file.bytes).map_err(|error| file.error(error.to_string()))?;
        threshold = threshold.or(threshold_of(&file, &summary)?);
        learners = learners_of(&file, summary, &episodes)?;
        if learners.is_some() {
            check_complete(&file, &episodes)?;
        }
        files.push(file.hash);
    } else {
        if run_folder.has_state_files() {
            let found = StateFiles::learners_in(path);
            learners = Some(found.map_err(|error| file_error(path, error.to_string()))?);
        }
        warnings.push(format!(
            "{}: has no `summary.json`: the run may be unfinished",
            super::data_file::name_of(folder, path)
        ));
    }
    let rounding = if run_folder.scenario_file().is_file() {
        Rounding::SingleRewards
    } else {
        Rounding::Double
    };
    let replay = Replay::new(&episodes, threshold, rounding);
    let learners = learners.filter(Learners::have_copies);
    let result = match &learners {
        Some(learners) => result_of_learners(learners, &episodes, threshold, settings.limits),
        None => replay.result(&episodes, &rounds, settings.limits),
    };
    let mut run = ReadRun::new(folder, path, files, result).with_warnings(warnings);
    run.observations = observations_of(&run_folder)?;
    if learners.is_some() || has_rounds {
        run.without_rounds = learners.map(|_| OF_COPIES);
    }
    Ok(run)
}

/// The observations with the ranges on which visits are counted, if they are known.
fn observations_of(folder: &RunFolder) -> Result<Option<Vec<Quantity>>, InputError> {
    let scenario = folder.scenario_file();
    if scenario.is_file() {
        let loaded = experiment::load(&scenario, &[]).ok();
        return Ok(loaded.map(|loaded| loaded.experiment.spec().observations.clone()));
    }
    let declared = StateFiles::declared_observations(folder.path());
    declared.map_err(|error| file_error(folder.path(), error.to_string()))
}

/// Why a run whose learners act in several copies of the environment has no curves of rounds.
const OF_COPIES: &str =
    "its learners act in several copies of the environment, whose visits are not counted together";

/// The learners that the summary names, if it does: one for each agent.
fn learners_of(
    file: &DataFile,
    summary: SummaryOfOthers,
    episodes: &[Episode],
) -> Result<Option<Learners>, InputError> {
    let learners = summary.learners.map(Learners::new);
    let last_agent = episodes.iter().map(|episode| episode.agent).max();
    match &learners {
        Some(learners) if Some(learners.agents() as u32) <= last_agent => {
            let message = "expected `learners` with the learner of each agent in `episodes.csv`";
            Err(file.error(message))
        }
        _ => Ok(learners),
    }
}

/// Compares the episodes of a recording with its summary.
fn check_complete(summary: &DataFile, episodes: &[Episode]) -> Result<(), InputError> {
    let noted: NotedEpisodes =
        serde_json::from_slice(&summary.bytes).map_err(|error| summary.error(error.to_string()))?;
    let found = episodes.iter().map(|row| (row.agent, row.length));
    let difference = noted.difference(found);
    difference.map_or(Ok(()), |difference| {
        Err(summary.error(format!("episodes.csv: {difference}")))
    })
}

fn read_rounds(path: &Path) -> Result<Vec<RoundRow>, InputError> {
    table::read(path).map_err(|error| file_error(path, error.reason))
}

fn read_episodes(file: &DataFile) -> Result<Vec<Episode>, InputError> {
    let mut rows = Rows::new(file, file.complete_lines().0, 0)?;
    let [agent, episode, round, env_steps, r#return] = [
        rows.column("agent")?,
        rows.column("episode")?,
        rows.column("round")?,
        rows.column("env_steps")?,
        rows.column("return")?,
    ];
    let (length, end_step) = (rows.find("length")?, rows.find("end_step")?);
    let mut episodes: Vec<Episode> = Vec::new();
    let mut next_episodes: Vec<u64> = Vec::new();
    while rows.advance()? {
        let found_agent = rows.count(agent)?;
        if found_agent >= MAX_AGENTS_OF_OTHERS {
            return Err(rows.error(
                agent,
                format!("expected an agent below {MAX_AGENTS_OF_OTHERS}, found {found_agent}"),
            ));
        }
        let index = found_agent as usize;
        next_episodes.resize(next_episodes.len().max(index + 1), 0);
        let (found, next) = (rows.count(episode)?, &mut next_episodes[index]);
        if found != *next {
            return Err(rows.error(
                episode,
                format!("expected episode {next} of agent {index}, found {found}: no episode may be missing"),
            ));
        }
        *next += 1;
        let new = Episode {
            agent: found_agent as u32,
            number: found as u32,
            round: rows.count(round)?.min(u32::MAX.into()) as u32,
            env_steps: rows.count(env_steps)?,
            r#return: rows.number(r#return)?,
            length: length.map_or(Ok(0), |length| rows.count(length))?,
            end_step: end_step.map(|column| rows.count(column)).transpose()?,
        };
        if let Some(earlier) = episodes.last() {
            let is_earlier = |now: u64, before: u64| now < before;
            let column = if is_earlier(new.round.into(), earlier.round.into()) {
                Some(round)
            } else {
                is_earlier(new.env_steps, earlier.env_steps).then_some(env_steps)
            };
            if let Some(column) = column {
                return Err(rows.error(
                    column,
                    "expected a value of at least that of the row before".to_owned(),
                ));
            }
        }
        episodes.push(new);
    }
    if episodes.is_empty() {
        return Err(file.error("expected at least one finished episode, found none"));
    }
    Ok(episodes)
}

/// What studies need of `summary.json`.
#[derive(Deserialize)]
struct SummaryOfOthers {
    #[serde(default)]
    solved_at: Option<facts::SolvedAt>,
    /// The learner of each agent.
    #[serde(default)]
    learners: Option<Vec<u32>>,
}

/// The result of a run in which learners act in several copies of the environment, which step
/// together. Each learner counts as one agent.
fn result_of_learners(
    learners: &Learners,
    episodes: &[Episode],
    threshold: Option<SolvedAt>,
    limits: Limits,
) -> RunResult {
    let mut agents: Vec<AgentEpisodes> = Vec::new();
    let ended = episodes.iter().map(|episode| EndedEpisode {
        agent: episode.agent,
        length: episode.length,
        r#return: episode.r#return,
        end_step: episode.end_step,
    });
    for episodes in learners.episodes(ended) {
        let mut agent = AgentEpisodes::default();
        let copies = learners.agents() as u64;
        for (steps, episode) in episodes {
            agent.returns.push(episode.r#return);
            agent.env_steps.push(steps.saturating_mul(copies));
            agent.longest = agent.longest.max(episode.length.saturating_mul(copies));
        }
        agents.push(agent);
    }
    run_data::result(agents, threshold, limits, Rounding::Double)
}

/// The threshold that the run had, from `summary.json`. Tabular runs have none.
fn threshold_of(
    file: &DataFile,
    summary: &SummaryOfOthers,
) -> Result<Option<SolvedAt>, InputError> {
    let Some(solved_at) = summary.solved_at else {
        return Ok(None);
    };
    let r#return = FiniteNumber::try_from(solved_at.r#return).map_err(|error| file.error(error))?;
    let window = (solved_at.window as u64)
        .try_into()
        .map_err(|error: String| file.error(error))?;
    Ok(Some(SolvedAt { r#return, window }))
}

/// Adds rounds in their order, as a study does with those of a run of its own.
struct Replay {
    result: RunResult,
    team_returns: Vec<f64>,
    threshold: Option<SolvedAt>,
}

impl Replay {
    fn new(episodes: &[Episode], threshold: Option<SolvedAt>, rounding: Rounding) -> Self {
        let agents = episodes
            .iter()
            .map(|row| row.agent as usize + 1)
            .max()
            .unwrap_or(0);
        Self {
            result: RunResult {
                returns: vec![Vec::new(); agents],
                rounding,
                threshold: threshold.map(|solved| (solved.r#return.get(), solved.window.get())),
                curves: vec![Vec::new(); Curve::WITH_ROUND_VALUES.len()],
                ..RunResult::default()
            },
            team_returns: Vec::new(),
            threshold,
        }
    }

    fn result(mut self, episodes: &[Episode], rounds: &[RoundRow], limits: Limits) -> RunResult {
        let is_within = |row: &&Episode| {
            limits.max_episodes.is_none_or(|max| row.number < max)
                && limits.max_steps.is_none_or(|max| row.env_steps <= max)
        };
        let mut by_round: BTreeMap<u32, (Vec<&Episode>, Vec<RoundRow>)> = BTreeMap::new();
        for row in episodes.iter().filter(is_within) {
            by_round.entry(row.round).or_default().0.push(row);
        }
        let last_round = by_round.keys().last().copied().unwrap_or(0);
        for row in rounds.iter().filter(|row| row.round <= last_round) {
            by_round.entry(row.round).or_default().1.push(row.clone());
        }
        let mut unmatched: Vec<VecDeque<f64>> = vec![VecDeque::new(); self.result.returns.len()];
        for (episodes, updates) in by_round.values() {
            for row in episodes {
                match self.result.rounding {
                    // As in a study that runs the scenario itself.
                    Rounding::SingleRewards => {
                        self.result.add_return(row.agent as usize, row.r#return);
                    }
                    _ => self.result.returns[row.agent as usize].push(row.r#return),
                }
                unmatched[row.agent as usize].push_back(row.r#return);
                self.result.env_steps = row.env_steps;
            }
            let mut ends = std::mem::take(&mut self.result.episode_ends);
            self.result.end_episodes(&mut ends);
            self.result.episode_ends = ends;
            while unmatched.iter().all(|returns| !returns.is_empty()) {
                let returns: Vec<f64> = unmatched
                    .iter_mut()
                    .filter_map(VecDeque::pop_front)
                    .collect();
                self.team_returns.push(mean(&returns));
            }
            self.end_round(updates);
        }
        self.result
    }

    fn end_round(&mut self, updates: &[RoundRow]) {
        let now = Milestone {
            episodes: self.team_returns.len() as u32,
            env_steps: self.result.env_steps,
        };
        if self.result.solved.is_none() && self.is_solved() {
            self.result.solved = Some(now);
        }
        if updates.is_empty() {
            return;
        }
        self.result.episodes.push(now.episodes);
        for (values, curve) in self.result.curves.iter_mut().zip(Curve::WITH_ROUND_VALUES) {
            let value = curve.metric().team_value_of_round(updates);
            values.push(value.map_or(f32::NAN, |value| value as f32));
        }
    }

    /// Whether the newest full window reaches the threshold.
    fn is_solved(&self) -> bool {
        self.threshold.is_some_and(|threshold| {
            let threshold = threshold.threshold();
            let start = self.team_returns.len().checked_sub(threshold.window);
            start.is_some_and(|start| {
                threshold.is_reached_by(&self.team_returns[start..], self.result.rounding)
            })
        })
    }
}
