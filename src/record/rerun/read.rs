//! Reads a recording, episode by episode.
//!
//! Chunks are decoded and dropped one at a time. So memory contains only one chunk (about 2,000
//! rows) and the incomplete episode of each agent, however long the recording is.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

use rerun::external::arrow::array::Array;
use rerun::log::{Chunk, LogMsg};
use rerun::{ComponentIdentifier, StoreKind, TimelineName};

use super::decode::Messages;
use super::quantities::{self, Quantities};
use super::raw::OUTCOME;
use super::rows::{EPISODE, ROUND};
use crate::record::visitation::Axes;
use crate::record::{ReadError, RecordedEpisode};
use crate::run::facts::StateQuantity;
use crate::run::recorder::BonusRange;
use seedbed_env::{Quantity, Status};

/// An open recording: its properties, quantities and episodes.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    pub(super) path: PathBuf,
    properties: BTreeMap<String, String>,
    quantities: Quantities,
}

impl Recording {
    /// Opens `run.rrd`, or the `run.rrd.part` of a run that is in progress or was killed.
    ///
    /// # Errors
    /// The file cannot be read, or is not a recording of seedbed.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let mut properties = BTreeMap::new();
        for chunk in Chunks::open(path)? {
            let chunk = chunk?;
            match chunk.entity_path().to_string().as_str() {
                entity if entity.starts_with("/__properties") => {
                    collect_properties(&chunk, &mut properties);
                }
                quantities::ENTITY => {
                    let quantities = quantities::read(&chunk).ok_or_else(|| not_a_run(path))?;
                    return Ok(Self {
                        path: path.to_owned(),
                        properties,
                        quantities,
                    });
                }
                _ => {}
            }
        }
        Err(not_a_run(path))
    }

    /// Properties of the run by name, such as `environment`, `agents`, `seed` and `algorithm`.
    #[must_use]
    pub fn properties(&self) -> &BTreeMap<String, String> {
        &self.properties
    }

    /// The observations of an agent, in order.
    #[must_use]
    pub fn observations(&self) -> &[Quantity] {
        &self.quantities.observations
    }

    /// The components of an action, in order.
    #[must_use]
    pub fn actions(&self) -> &[Quantity] {
        &self.quantities.actions
    }

    /// What is recorded beside the observations, in order. It has no ranges.
    #[must_use]
    pub fn info(&self) -> &[Quantity] {
        &self.quantities.info
    }

    /// Number of steps after which episodes are truncated.
    #[must_use]
    pub fn time_limit(&self) -> u32 {
        self.quantities.time_limit
    }

    /// Whether agents have a bonus, and its range.
    #[must_use]
    pub fn bonus(&self) -> BonusRange {
        self.quantities.bonus
    }

    /// The axes of parallel coordinates: all observations and the bonus.
    #[must_use]
    pub fn axes(&self) -> Axes {
        Axes::of_quantities(
            &self.quantities.observations,
            self.quantities.time_limit,
            self.quantities.bonus,
        )
    }

    /// All complete episodes in the file. The episodes of each agent are in ascending order.
    ///
    /// # Errors
    /// If the file cannot be opened. An item is an error if the file is damaged.
    pub fn episodes(&self) -> Result<Episodes, ReadError> {
        let columns = Columns::of(&self.quantities);
        Ok(Episodes {
            chunks: Chunks::open(&self.path)?,
            columns,
            unfinished: BTreeMap::new(),
            finished: VecDeque::new(),
        })
    }
}

fn not_a_run(path: &Path) -> ReadError {
    ReadError::NotARun {
        path: path.to_owned(),
        missing: quantities::ENTITY.to_owned(),
    }
}

fn collect_properties(chunk: &Chunk, properties: &mut BTreeMap<String, String>) {
    for component in chunk.components_identifiers() {
        let value = quantities::strings(chunk, component.as_str())
            .and_then(|texts| texts.into_iter().next());
        properties.extend(value.map(|value| (component.as_str().to_owned(), value)));
    }
}

/// The episodes of a recording, read on demand.
pub struct Episodes {
    chunks: Chunks,
    columns: Columns,
    /// The incomplete episode of each agent.
    unfinished: BTreeMap<u32, RecordedEpisode>,
    finished: VecDeque<RecordedEpisode>,
}

impl Iterator for Episodes {
    type Item = Result<RecordedEpisode, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.finished.is_empty() {
            match self.chunks.next()? {
                Ok(chunk) => {
                    if let Err(reason) = self.add_chunk(&chunk) {
                        return Some(Err(self.chunks.messages.damaged(reason)));
                    }
                }
                Err(error) => return Some(Err(error)),
            }
        }
        self.finished.pop_front().map(Ok)
    }
}

impl Episodes {
    /// Adds the rows of a chunk of `/raw`; ignores other chunks. Returns what is wrong in it.
    fn add_chunk(&mut self, chunk: &Chunk) -> Result<(), String> {
        let entity = chunk.entity_path().to_string();
        let Some(agent) = entity
            .strip_prefix("/raw/agent_")
            .and_then(|agent| agent.parse().ok())
        else {
            return Ok(());
        };
        let rows = self.columns.rows(chunk);
        if !rows.have_equal_lengths() {
            return Err(format!("{entity} has columns of different lengths"));
        }
        let mut step = 0;
        for (row, outcome) in rows.outcomes.iter().enumerate() {
            let start = || empty_episode(agent, rows.episodes[row], rows.rounds[row]);
            let episode = self.unfinished.entry(agent).or_insert_with(start);
            episode
                .observations
                .extend(rows.observations.iter().map(|column| column[row]));
            episode
                .info
                .extend(rows.info.iter().map(|column| column[row]));
            if let Some(outcome) = outcome {
                episode.outcome = *outcome;
                self.finished.extend(self.unfinished.remove(&agent));
            } else {
                episode
                    .actions
                    .extend(rows.actions.iter().map(|column| column[step]));
                episode.rewards.push(rows.rewards[step]);
                episode
                    .intrinsic_rewards
                    .extend(rows.intrinsic_rewards.get(step));
                episode.advantages.extend(rows.advantages.get(step));
                step += 1;
            }
        }
        Ok(())
    }
}

fn empty_episode(agent: u32, episode: u32, round: u32) -> RecordedEpisode {
    let [
        observations,
        actions,
        info,
        rewards,
        intrinsic_rewards,
        advantages,
    ] = std::array::from_fn(|_| Vec::new());
    RecordedEpisode {
        agent,
        episode,
        round,
        observations,
        actions,
        info,
        rewards,
        intrinsic_rewards,
        advantages,
        outcome: Status::Running,
    }
}

/// The names of the columns of `/raw`.
struct Columns {
    observations: Vec<ComponentIdentifier>,
    actions: Vec<ComponentIdentifier>,
    info: Vec<ComponentIdentifier>,
    reward: ComponentIdentifier,
    intrinsic_reward: ComponentIdentifier,
    advantage: ComponentIdentifier,
    outcome: ComponentIdentifier,
}

/// The contents of one chunk of `/raw`.
struct Rows {
    episodes: Vec<u32>,
    rounds: Vec<u32>,
    /// `[observations]` of `[rows]`
    observations: Vec<Vec<f32>>,
    /// `[info]` of `[rows]`
    info: Vec<Vec<f32>>,
    /// `[actions]` of `[rows without an outcome]`; rewards, bonuses and advantages have these rows as well.
    actions: Vec<Vec<f32>>,
    rewards: Vec<f32>,
    intrinsic_rewards: Vec<f32>,
    advantages: Vec<f32>,
    /// The outcome of the rows that end an episode: `[rows]`
    outcomes: Vec<Option<Status>>,
}

impl Rows {
    fn have_equal_lengths(&self) -> bool {
        let rows = self.outcomes.len();
        let steps = self.outcomes.iter().filter(|end| end.is_none()).count();
        [&self.episodes, &self.rounds].map(Vec::len) == [rows; 2]
            && self.observations.iter().all(|column| column.len() == rows)
            && self.info.iter().all(|column| column.len() == rows)
            && self.actions.iter().all(|column| column.len() == steps)
            && self.rewards.len() == steps
            // Not all agents have these.
            && [&self.intrinsic_rewards, &self.advantages]
                .iter()
                .all(|column| column.is_empty() || column.len() == steps)
    }
}

impl Columns {
    fn of(quantities: &Quantities) -> Self {
        let column_name =
            |name: &str| ComponentIdentifier::from_archetype_field("State".into(), name);
        let names_of = |quantities: &[Quantity]| {
            quantities
                .iter()
                .map(|quantity| column_name(&quantity.name))
                .collect()
        };
        Self {
            observations: names_of(&quantities.observations),
            actions: names_of(&quantities.actions),
            info: names_of(&quantities.info),
            reward: column_name(StateQuantity::Reward.key()),
            intrinsic_reward: column_name(StateQuantity::IntrinsicReward.key()),
            advantage: column_name(StateQuantity::Advantage.key()),
            outcome: column_name(OUTCOME),
        }
    }

    fn rows(&self, chunk: &Chunk) -> Rows {
        let numbers = |column: &ComponentIdentifier| {
            chunk
                .iter_slices::<f32>(*column)
                .flatten()
                .copied()
                .collect::<Vec<f32>>()
        };
        let times = |name: &'static str| {
            let column = chunk.timelines().get(&TimelineName::from(name));
            column.map_or(Vec::new(), |column| {
                column.times_raw().iter().map(|&time| time as u32).collect()
            })
        };
        Rows {
            episodes: times(EPISODE),
            rounds: times(ROUND),
            observations: self.observations.iter().map(numbers).collect(),
            info: self.info.iter().map(numbers).collect(),
            actions: self.actions.iter().map(numbers).collect(),
            rewards: numbers(&self.reward),
            intrinsic_rewards: numbers(&self.intrinsic_reward),
            advantages: numbers(&self.advantage),
            outcomes: self.outcomes(chunk),
        }
    }

    fn outcomes(&self, chunk: &Chunk) -> Vec<Option<Status>> {
        let mut outcomes = quantities::strings(chunk, self.outcome.as_str())
            .unwrap_or_default()
            .into_iter();
        let Some(list) = chunk.components().get_array(self.outcome) else {
            return Vec::new();
        };
        let has_outcome =
            (0..list.len()).map(|row| list.is_valid(row) && list.value_length(row) > 0);
        has_outcome
            .map(|has_outcome| if has_outcome { outcomes.next() } else { None })
            .map(|outcome| outcome.map(|outcome| status(&outcome)))
            .collect()
    }
}

fn status(outcome: &str) -> Status {
    match outcome {
        "terminated" => Status::Terminated,
        "truncated" => Status::Truncated,
        _ => Status::Running,
    }
}

/// The chunks of a recording, without the chunks of its blueprint.
pub(super) struct Chunks {
    messages: Messages,
}

impl Chunks {
    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        Ok(Self {
            messages: Messages::open(path)?,
        })
    }
}

impl Iterator for Chunks {
    type Item = Result<Chunk, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            match self.messages.next()? {
                Ok(LogMsg::ArrowMsg(store, rows)) if store.kind() == StoreKind::Recording => {
                    return Some(self.messages.chunk(&rows));
                }
                Ok(_) => {}
                Err(error) => return Some(Err(error)),
            }
        }
    }
}
