//! A page in which people select visited states by brushes: one HTML file without network access.
//!
//! [`Explorer::read`] gathers the states of runs, [`Explorer::page`] writes them into the page as
//! compressed columns (`encode`). The page's own code is in `page/`: it counts the states of each
//! pair of bins of neighboring axes, and draws these pairs instead of single states, so that the time
//! of drawing does not grow with the number of states.

mod axes;
mod colors;
mod encode;
mod html;
mod samples;
mod scenes;
mod states;

use std::collections::BTreeSet;
use std::path::PathBuf;

use serde::Serialize;

use self::axes::AxisData;
use self::colors::Palette;
use self::encode::{encode_16, encode_32, level};
use self::scenes::{FilmData, Filmed, ShapeData, scenery};
use self::states::{FilmedStates, RunStates, StateColumn};
use crate::film::FilmError;
use crate::record::common_axes;
use crate::review::LoadedRun;
use seedbed_env::Status;

pub use self::samples::{SampledEpisode, StateSample};

/// Runs, or other samples of states, that are in one page.
#[derive(Debug)]
pub struct Explorer {
    axes: Vec<AxisData>,
    runs: Vec<ExploredRun>,
    /// Whether the page is in a frame of another page.
    is_embedded: bool,
}

/// One run.
#[derive(Debug)]
struct ExploredRun {
    /// Name in the page.
    name: String,
    /// Path in commands.
    path: PathBuf,
    agent_count: usize,
    states: RunStates,
    filmed: Option<Filmed>,
    /// The fixed bodies of the task.
    scenery: Vec<ShapeData>,
}

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum ExploreError {
    /// The run has no recording.
    #[error("{0} has no recording, whose states are shown")]
    NotRecorded(PathBuf),
    /// Two runs have states that cannot be compared.
    #[error("{0}")]
    OtherQuantities(String),
    /// The run or its scenes cannot be read.
    #[error(transparent)]
    Run(#[from] FilmError),
}

/// Maximum number of states of a run that are kept by default.
pub const DEFAULT_MAX_STATES: u64 = 200_000;

/// The page's data.
#[derive(Serialize)]
struct PageData<'a> {
    palette: Palette,
    is_embedded: bool,
    axes: &'a [AxisData],
    runs: Vec<RunData<'a>>,
}

#[derive(Serialize)]
struct RunData<'a> {
    name: &'a str,
    path: String,
    agents: usize,
    /// Number of states of the run.
    states: u64,
    /// Number of states in the page.
    kept: usize,
    /// Whether it is known how episodes ended.
    has_outcomes: bool,
    /// One per axis; `None` for axes of episodes and of other runs.
    columns: Vec<Option<ColumnData>>,
    episodes: EpisodeTable,
    film: Option<FilmData>,
    filmed: Vec<FilmedEpisode>,
    /// The fixed bodies of the task, in its coordinates.
    scenery: &'a [ShapeData],
}

#[derive(Serialize)]
struct ColumnData {
    levels: String,
    /// Numbers of values in the page that are below and above the range.
    outside: [usize; 2],
    /// Number of values in the page that are NaN.
    nan: usize,
}

/// Columns of one number per episode.
#[derive(Serialize)]
struct EpisodeTable {
    count: usize,
    agent: String,
    episode: String,
    round: String,
    length: String,
    /// Number of its states in the page.
    kept: String,
    /// Bits of single-precision numbers.
    r#return: String,
    /// 1 for terminated episodes, 0 for truncated ones.
    terminated: String,
}

/// All states of an episode whose bodies are in the page.
#[derive(Serialize)]
struct FilmedEpisode {
    agent: u32,
    episode: u32,
    states: usize,
    /// Levels, one text per axis.
    levels: Vec<Option<String>>,
}

impl Explorer {
    /// Reads the states of runs: at most `max_states` of each, evenly spaced in the order of
    /// episodes. `runs` are the paths as in commands, and the runs. Calls `on_episode` for each
    /// episode that is read.
    ///
    /// # Errors
    /// A run has no recording or other observations than another, or a file cannot be read.
    pub fn read(
        runs: &[(PathBuf, LoadedRun)],
        max_states: u64,
        on_episode: &mut dyn FnMut(),
    ) -> Result<Self, ExploreError> {
        let mut recordings = Vec::with_capacity(runs.len());
        for (path, run) in runs {
            let not_recorded = || ExploreError::NotRecorded(run.path.clone());
            let recording = run.recording.as_ref().ok_or_else(not_recorded)?;
            recordings.push((path.display().to_string(), recording));
        }
        common_axes(&recordings).map_err(ExploreError::OtherQuantities)?;
        let mut explored = Vec::with_capacity(runs.len());
        for ((path, run), (_, recording)) in runs.iter().zip(&recordings) {
            let filmed = Filmed::read(run)?;
            let episodes = filmed.iter().flat_map(|filmed| &filmed.episodes);
            let keys: BTreeSet<(u32, u32)> = episodes
                .map(|(agent, scene)| (scene.episode, *agent))
                .collect();
            let states =
                states::read(recording, max_states, &keys, on_episode).map_err(FilmError::from)?;
            let last_agent = states.episodes.iter().map(|episode| episode.agent).max();
            explored.push(ExploredRun {
                name: run.title(),
                path: path.clone(),
                agent_count: run
                    .agent_count()
                    .max(last_agent.map_or(0, |last| last as usize + 1)),
                states,
                filmed,
                scenery: scenery(run),
            });
        }
        name_by_path_if_equal(&mut explored);
        let axes = axes::common_axes(&explored.iter().map(|run| &run.states).collect::<Vec<_>>());
        Ok(Self {
            axes,
            runs: explored,
            is_embedded: false,
        })
    }

    /// Number of states in the page and of all states, of all runs.
    #[must_use]
    pub fn state_counts(&self) -> [u64; 2] {
        let sum = |count: &dyn Fn(&RunStates) -> u64| {
            self.runs.iter().map(|run| count(&run.states)).sum()
        };
        [
            sum(&|states| {
                states
                    .episodes
                    .iter()
                    .map(|episode| u64::from(episode.kept))
                    .sum()
            }),
            sum(&|states| states.state_count),
        ]
    }

    /// The page. The same runs give the same text.
    ///
    /// # Panics
    /// Never: numbers and texts can be serialized.
    #[must_use]
    pub fn page(&self) -> String {
        let data = PageData {
            palette: Palette::default(),
            is_embedded: self.is_embedded,
            axes: &self.axes,
            runs: self.runs.iter().map(|run| self.run_data(run)).collect(),
        };
        let names: Vec<&str> = self.runs.iter().map(|run| run.name.as_str()).collect();
        let data = serde_json::to_string(&data).expect("numbers and texts can be serialized");
        html::page(&names.join(" · "), &data)
    }

    fn run_data<'a>(&self, run: &'a ExploredRun) -> RunData<'a> {
        let states = &run.states;
        let filmed = run.filmed.as_ref().filter(|_| !states.filmed.is_empty());
        RunData {
            name: &run.name,
            path: run.path.display().to_string(),
            agents: run.agent_count,
            states: states.state_count,
            kept: states
                .columns
                .first()
                .map_or(0, |column| column.values.len()),
            has_outcomes: states
                .episodes
                .iter()
                .all(|episode| episode.outcome.is_some()),
            columns: self
                .axes
                .iter()
                .map(|axis| {
                    Some(column_data(
                        axis,
                        states.columns.get(axis.column_of(states)?)?,
                    ))
                })
                .collect(),
            episodes: EpisodeTable::of(states),
            film: filmed.map(Filmed::data),
            filmed: states
                .filmed
                .iter()
                .map(|episode| self.filmed_episode(states, episode))
                .collect(),
            scenery: &run.scenery,
        }
    }

    fn filmed_episode(&self, states: &RunStates, episode: &FilmedStates) -> FilmedEpisode {
        let columns = states.columns.len();
        let levels = |axis: &AxisData| {
            let column = axis.column_of(states)?;
            let values = episode.rows.iter().skip(column).step_by(columns);
            let levels: Vec<u16> = values.map(|&value| level(value, axis.range())).collect();
            Some(encode_16(&levels))
        };
        FilmedEpisode {
            agent: episode.agent,
            episode: episode.episode,
            states: episode.rows.len() / columns,
            levels: self.axes.iter().map(levels).collect(),
        }
    }
}

/// Runs of equal names are named by their paths.
fn name_by_path_if_equal(runs: &mut [ExploredRun]) {
    let names: Vec<String> = runs.iter().map(|run| run.name.clone()).collect();
    for run in runs {
        if names.iter().filter(|name| **name == run.name).count() > 1 {
            run.name = run.path.display().to_string();
        }
    }
}

fn column_data(axis: &AxisData, column: &StateColumn) -> ColumnData {
    let range @ [low, high] = axis.range();
    let values = || column.values.iter().map(|&value| f64::from(value));
    let levels: Vec<u16> = column
        .values
        .iter()
        .map(|&value| level(value, range))
        .collect();
    ColumnData {
        levels: encode_16(&levels),
        outside: [
            values().filter(|&value| value < low).count(),
            values().filter(|&value| value > high).count(),
        ],
        nan: column.nan,
    }
}

impl EpisodeTable {
    fn of(states: &RunStates) -> Self {
        let column = |value: &dyn Fn(&states::EpisodeInfo) -> u32| {
            encode_32(&states.episodes.iter().map(value).collect::<Vec<_>>())
        };
        Self {
            count: states.episodes.len(),
            agent: column(&|episode| episode.agent),
            episode: column(&|episode| episode.episode),
            round: column(&|episode| episode.round),
            length: column(&|episode| episode.length),
            kept: column(&|episode| episode.kept),
            r#return: column(&|episode| (episode.r#return as f32).to_bits()),
            terminated: column(&|episode| u32::from(episode.outcome == Some(Status::Terminated))),
        }
    }
}
