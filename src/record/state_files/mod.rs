//! Files of visited states that other programs write: one file per agent, `states/agent_K.states`,
//! to which finished episodes are appended. The Python package `seedbed` writes them for any
//! Gymnasium environment. `docs/state_files.md` describes the format.
//!
//! All checksums are verified when the files are opened, so that a damaged file never yields a
//! number. An incomplete frame at the end of a file, as a process leaves it that is killed or in
//! progress, is a warning. Memory contains one episode per agent, and one row per episode.

mod completeness;
mod episodes;
mod frames;
mod header;
mod learners;
mod salvage;

pub use salvage::{SalvagedStates, salvage};

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

pub use self::completeness::NotedEpisodes;
use self::episodes::{AgentEpisodes, FinishedEpisode};
use self::header::{Header, HeaderAxis};
pub use self::learners::{EndedEpisode, Learners};
use super::visitation::Axes;
use super::{ReadError, RecordedEpisode};
use crate::run::facts::EpisodeRow;
use crate::run::folder::RunFolder;
use crate::run::recorder::BonusRange;
use seedbed_env::Quantity;
use seedbed_input::limits::MAX_SPARSE_AGENTS;

/// Files of visited states of all agents of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct StateFiles {
    /// In ascending order of agents.
    files: Vec<PathBuf>,
    learners: Learners,
    properties: BTreeMap<String, String>,
    observations: Vec<Quantity>,
    actions: Vec<Quantity>,
    time_limit: u32,
    step_seconds: Option<f64>,
    rows: Vec<EpisodeRow>,
    warnings: Vec<String>,
}

/// Smallest and largest finite value of each quantity.
struct Extents(Vec<[f32; 2]>);

/// The agent of a file.
struct Agent {
    number: u32,
    learner: Option<u32>,
    /// Number of steps of its environment up to the end of each episode.
    end_steps: Vec<u64>,
}

/// What all files have in common, collected one by one.
struct Collected {
    header: Header,
    agents: Vec<Agent>,
    rows: Vec<EpisodeRow>,
    warnings: Vec<String>,
    observations: Extents,
    actions: Extents,
    max_length: u32,
}

impl StateFiles {
    /// Opens all files in the folder of a run. Those of a finished run have the episodes that its
    /// summary says.
    ///
    /// # Errors
    /// A file cannot be read, is damaged, has lost its end, or its agent has other axes than another
    /// agent.
    pub fn open_folder(run_folder: &Path) -> Result<Self, ReadError> {
        // A recorder that continues removes the summary before it writes.
        let noted = NotedEpisodes::read(run_folder)?;
        let name = fs::canonicalize(run_folder).ok();
        let name = name.as_deref().unwrap_or(run_folder).file_name();
        let name = name.unwrap_or(run_folder.as_os_str()).to_string_lossy();
        let files = Self::open(&name, RunFolder::new(run_folder).state_files(), run_folder)?;
        if let Some(noted) = noted {
            noted.check(run_folder, &files.rows)?;
        }
        Ok(files)
    }

    /// Opens the file of one agent.
    ///
    /// # Errors
    /// As [`open_folder`](Self::open_folder).
    pub fn open_file(path: &Path) -> Result<Self, ReadError> {
        let name = path.file_stem().unwrap_or(path.as_os_str());
        Self::open(&name.to_string_lossy(), vec![path.to_owned()], path)
    }

    fn open(name: &str, paths: Vec<PathBuf>, named: &Path) -> Result<Self, ReadError> {
        let mut collected: Option<Collected> = None;
        let mut files = Vec::with_capacity(paths.len());
        for path in paths {
            let agent = match &mut collected {
                None => collected.insert(Collected::start(&path)?).header.agent,
                Some(collected) => collected.add(&path)?,
            };
            files.push((agent, path));
        }
        let Some(collected) = collected else {
            return Err(ReadError::Unreadable {
                path: named.to_owned(),
                reason: "it contains no file of visited states".to_owned(),
            });
        };
        files.sort();
        if named.is_dir() {
            check_numbers(&collected.agents, named)?;
        }
        let learners = learners_of(&collected.agents);
        let files = files.into_iter().map(|(_, path)| path).collect();
        Ok(collected.into_state_files(name, learners, files))
    }

    /// Properties of the run by name, as of a recording: `environment`, `agents`.
    #[must_use]
    pub fn properties(&self) -> &BTreeMap<String, String> {
        &self.properties
    }

    /// Name of the environment.
    #[must_use]
    pub fn environment(&self) -> &str {
        &self.properties["environment"]
    }

    /// Number of agents K: the largest number of an agent, plus 1.
    #[must_use]
    pub fn agent_count(&self) -> u32 {
        self.learners.agents() as u32
    }

    /// The learners that act in the agents' environments.
    #[must_use]
    pub fn learners(&self) -> &Learners {
        &self.learners
    }

    /// The learners of a run, of which only the beginnings of the files in its folder are read.
    ///
    /// # Errors
    /// A file cannot be read, or its header is damaged.
    pub fn learners_in(run_folder: &Path) -> Result<Learners, ReadError> {
        let mut agents = Vec::new();
        for path in RunFolder::new(run_folder).state_files() {
            agents.push(Agent::of(AgentEpisodes::open(&path)?.header()));
        }
        check_numbers(&agents, run_folder)?;
        Ok(learners_of(&agents))
    }

    /// The observations of a run, of which only the beginning of its first file is read; `None` if the range of one is
    /// that of the values in the files.
    ///
    /// # Errors
    /// The file cannot be read, or its header is damaged.
    pub fn declared_observations(run_folder: &Path) -> Result<Option<Vec<Quantity>>, ReadError> {
        let Some(path) = RunFolder::new(run_folder).state_files().into_iter().next() else {
            return Ok(None);
        };
        let first = AgentEpisodes::open(&path)?;
        let axes = first.header().observations.iter();
        Ok(axes.map(HeaderAxis::declared).collect())
    }

    /// The observations of an agent, in order.
    #[must_use]
    pub fn observations(&self) -> &[Quantity] {
        &self.observations
    }

    /// The components of an action, in order.
    #[must_use]
    pub fn actions(&self) -> &[Quantity] {
        &self.actions
    }

    /// Number of steps after which episodes are truncated or, if it is not known, length of the
    /// longest episode.
    #[must_use]
    pub fn time_limit(&self) -> u32 {
        self.time_limit
    }

    /// Time between two actions, s, if it is known.
    #[must_use]
    pub fn step_seconds(&self) -> Option<f64> {
        self.step_seconds
    }

    /// The axes of parallel coordinates: all observations.
    #[must_use]
    pub fn axes(&self) -> Axes {
        Axes::of_quantities(&self.observations, self.time_limit, BonusRange::None)
    }

    /// One row per finished episode, in (round, agent) order. The round of an episode is its number.
    /// Measures of visits are NaN.
    #[must_use]
    pub fn episode_rows(&self) -> &[EpisodeRow] {
        &self.rows
    }

    /// What is incomplete: the ends of files of processes that were killed or are in progress.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// All finished episodes, agent by agent, in ascending order.
    ///
    /// # Errors
    /// An item is an error if a file cannot be read or was damaged since it was opened.
    pub fn episodes(&self) -> impl Iterator<Item = Result<RecordedEpisode, ReadError>> + use<> {
        self.files.clone().into_iter().flat_map(|path| {
            let (episodes, error) = match AgentEpisodes::open(&path) {
                Ok(episodes) => (Some(episodes), None),
                Err(error) => (None, Some(Err(error))),
            };
            let finished = episodes.into_iter().flatten();
            finished
                .map(|finished| finished.map(|finished| finished.episode))
                .chain(error)
        })
    }

    /// The finished episodes of each agent: `[files]`.
    ///
    /// # Errors
    /// A file cannot be opened. Items are errors as in [`episodes`](Self::episodes).
    pub fn episodes_by_agent(
        &self,
    ) -> Result<Vec<impl Iterator<Item = Result<RecordedEpisode, ReadError>> + use<>>, ReadError>
    {
        let files = self.files.iter();
        files
            .map(|path| Ok(AgentEpisodes::open(path)?.map(|finished| Ok(finished?.episode))))
            .collect()
    }
}

impl Collected {
    fn start(path: &Path) -> Result<Self, ReadError> {
        let episodes = AgentEpisodes::open(path)?;
        let header = episodes.header().clone();
        let mut collected = Self {
            agents: vec![Agent::of(&header)],
            rows: Vec::new(),
            warnings: Vec::new(),
            observations: Extents::new(&header.observations),
            actions: Extents::new(&header.actions),
            max_length: 0,
            header,
        };
        collected.add_episodes(episodes)?;
        Ok(collected)
    }

    /// Adds a further file, and returns the number of its agent.
    fn add(&mut self, path: &Path) -> Result<u32, ReadError> {
        let episodes = AgentEpisodes::open(path)?;
        let header = episodes.header();
        let agent = Agent::of(header);
        let number = agent.number;
        let unreadable = |reason: String| ReadError::Unreadable {
            path: path.to_owned(),
            reason,
        };
        if self.agents.iter().any(|other| other.number == number) {
            return Err(unreadable(format!("another file has agent {number}, too")));
        }
        if let Some(difference) = self.header.difference(header) {
            return Err(unreadable(format!(
                "{difference} of agent {number} differ from those of agent {}; record them in separate folders",
                self.header.agent
            )));
        }
        self.agents.push(agent);
        self.add_episodes(episodes)?;
        Ok(number)
    }

    fn add_episodes(&mut self, mut episodes: AgentEpisodes) -> Result<(), ReadError> {
        for finished in &mut episodes {
            let finished = finished?;
            self.observations.add(&finished.episode.observations);
            self.actions.add(&finished.episode.actions);
            self.max_length = self.max_length.max(finished.episode.length() as u32);
            self.rows.push(row(&finished));
            if let Some(agent) = self.agents.last_mut() {
                agent.end_steps.push(finished.end_step);
            }
        }
        self.warnings.extend(episodes.warning());
        Ok(())
    }

    fn into_state_files(
        mut self,
        name: &str,
        learners: Learners,
        files: Vec<PathBuf>,
    ) -> StateFiles {
        self.rows.sort_by_key(|row| (row.round, row.agent));
        let mut env_steps = 0;
        for row in &mut self.rows {
            env_steps += u64::from(row.length);
            row.env_steps = env_steps;
        }
        let properties = [
            ("RecordingInfo:name", name.to_owned()),
            ("environment", self.header.environment.clone()),
            ("agents", learners.agents().to_string()),
        ];
        StateFiles {
            files,
            learners,
            properties: properties
                .map(|(name, value)| (name.to_owned(), value))
                .into(),
            observations: self.observations.quantities(&self.header.observations),
            actions: self.actions.quantities(&self.header.actions),
            time_limit: self.header.time_limit.unwrap_or(self.max_length).max(1),
            step_seconds: self.header.step_seconds,
            rows: self.rows,
            warnings: self.warnings,
        }
    }
}

impl Agent {
    fn of(header: &Header) -> Self {
        Self {
            number: header.agent,
            learner: header.learner,
            end_steps: Vec::new(),
        }
    }
}

/// Number of agents K: the largest number of an agent, plus 1.
fn count_of(agents: &[Agent]) -> u32 {
    agents
        .iter()
        .map(|agent| agent.number + 1)
        .max()
        .unwrap_or(0)
}

/// Checks that the numbers of agents in a folder have no large gaps.
fn check_numbers(agents: &[Agent], folder: &Path) -> Result<(), ReadError> {
    let (count, files) = (count_of(agents), agents.len() as u32);
    let limit = MAX_SPARSE_AGENTS.max(4 * files);
    if count <= limit {
        return Ok(());
    }
    Err(ReadError::Unreadable {
        path: folder.to_owned(),
        reason: format!(
            "it has agent {} and {files} agents in all, expected numbers below {limit}: agents are numbered from 0",
            count - 1
        ),
    })
}

/// The learner of each agent; agents without a file are learners of their own.
fn learners_of(agents: &[Agent]) -> Learners {
    let count = count_of(agents);
    let mut learners: Vec<u32> = (0..count).collect();
    let mut end_steps = vec![Vec::new(); count as usize];
    for agent in agents {
        let index = agent.number as usize;
        learners[index] = agent.learner.unwrap_or(agent.number);
        end_steps[index].clone_from(&agent.end_steps);
    }
    Learners::new(learners).with_end_steps(end_steps)
}

fn row(finished: &FinishedEpisode) -> EpisodeRow {
    let episode = &finished.episode;
    EpisodeRow {
        agent: episode.agent,
        episode: episode.episode,
        round: episode.round,
        env_steps: 0,
        r#return: finished.total_reward,
        length: episode.length() as u32,
        outcome: episode.outcome,
        coverage: f64::NAN,
        visitation_entropy: f64::NAN,
        team_overlap: f64::NAN,
        effective_agents: f64::NAN,
    }
}

impl Extents {
    fn new(axes: &[HeaderAxis]) -> Self {
        Self(vec![[f32::INFINITY, f32::NEG_INFINITY]; axes.len()])
    }

    /// Adds rows of one value per quantity.
    fn add(&mut self, rows: &[f32]) {
        for row in rows.chunks_exact(self.0.len()) {
            for ([low, high], value) in self.0.iter_mut().zip(row) {
                if value.is_finite() {
                    *low = low.min(*value);
                    *high = high.max(*value);
                }
            }
        }
    }

    /// The quantities on the axes. The extents take the place of ends that are not given.
    fn quantities(&self, axes: &[HeaderAxis]) -> Vec<Quantity> {
        let quantity = |(axis, [low, high]): (&HeaderAxis, &[f32; 2])| Quantity {
            name: axis.name.clone(),
            unit: axis.unit.clone(),
            range: not_empty([axis.low.unwrap_or(*low), axis.high.unwrap_or(*high)]),
        };
        axes.iter().zip(&self.0).map(quantity).collect()
    }
}

/// A range whose ends differ: around the only value, or from 0 to 1 if there is none.
fn not_empty([low, high]: [f32; 2]) -> [f32; 2] {
    let margin = |end: f32| (end.abs() * 1e-3).max(0.5);
    match (low.is_finite(), high.is_finite()) {
        _ if low < high && (high - low).is_finite() => [low, high],
        (true, false) => [low, low + 2.0 * margin(low)],
        (false, true) => [high - 2.0 * margin(high), high],
        (true, true) => [low - margin(low), low + margin(low)],
        (false, false) => [0.0, 1.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_never_empty() {
        assert_eq!(not_empty([-1.0, 2.0]), [-1.0, 2.0]);
        assert_eq!(not_empty([3.0, 3.0]), [2.5, 3.5]);
        assert_eq!(not_empty([f32::INFINITY, f32::NEG_INFINITY]), [0.0, 1.0]);
        assert_eq!(not_empty([2.0, f32::NEG_INFINITY]), [2.0, 3.0]);
        assert_eq!(not_empty([f32::INFINITY, 2.0]), [1.0, 2.0]);
        let [low, high] = not_empty([1e9, 1e9]);
        assert!(low < 1e9 && high > 1e9);
        // A given end above everything that was visited.
        let [low, high] = not_empty([5.0, 2.0]);
        assert!(low < high);
    }
}
