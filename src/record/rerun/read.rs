//! Reads a recording, episode by episode.
//!
//! Chunks are decoded and dropped one at a time. So memory contains only one chunk (about 2,000
//! rows) and the incomplete episode of each agent, however long the recording is.

use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use rerun::external::arrow::array::Array;
use rerun::external::re_log_encoding::rrd::{DecodeError, DecoderApp, DecoderIterator};
use rerun::log::{Chunk, LogMsg};
use rerun::{ComponentIdentifier, StoreKind, TimelineName};

use super::quantities::{self, Quantities};
use super::rows::{EPISODE, ROUND};
use crate::record::visitation::Axes;
use crate::record::{BonusRange, ReadError, RecordedEpisode};
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
                Ok(chunk) => self.add_chunk(&chunk),
                Err(error) => return Some(Err(error)),
            }
        }
        self.finished.pop_front().map(Ok)
    }
}

impl Episodes {
    fn add_chunk(&mut self, chunk: &Chunk) {
        let entity = chunk.entity_path().to_string();
        let Some(agent) = entity
            .strip_prefix("/raw/agent_")
            .and_then(|agent| agent.parse().ok())
        else {
            return;
        };
        let rows = self.columns.rows(chunk);
        let mut step = 0;
        for (row, outcome) in rows.outcomes.iter().enumerate() {
            let start = || empty_episode(agent, rows.episodes[row], rows.rounds[row]);
            let episode = self.unfinished.entry(agent).or_insert_with(start);
            episode
                .observations
                .extend(rows.observations.iter().map(|column| column[row]));
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
    }
}

fn empty_episode(agent: u32, episode: u32, round: u32) -> RecordedEpisode {
    let [
        observations,
        actions,
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
    /// `[actions]` of `[rows without an outcome]`; rewards, bonuses and advantages have these rows as well.
    actions: Vec<Vec<f32>>,
    rewards: Vec<f32>,
    intrinsic_rewards: Vec<f32>,
    advantages: Vec<f32>,
    /// The outcome of the rows that end an episode: `[rows]`
    outcomes: Vec<Option<Status>>,
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
            reward: column_name("reward"),
            intrinsic_reward: column_name("intrinsic_reward"),
            advantage: column_name("advantage"),
            outcome: column_name("outcome"),
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
    path: PathBuf,
    messages: DecoderIterator<LogMsg, BufReader<File>>,
    /// Whether an error occurred, after which nothing can be read.
    failed: bool,
}

impl Chunks {
    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        let file = File::open(path).map_err(|error| ReadError::Unreadable {
            path: path.to_owned(),
            reason: error.to_string(),
        })?;
        Ok(Self {
            path: path.to_owned(),
            messages: DecoderApp::decode_lazy(BufReader::new(file)),
            failed: false,
        })
    }

    fn fail(&mut self, reason: String) -> ReadError {
        self.failed = true;
        ReadError::Unreadable {
            path: self.path.clone(),
            reason,
        }
    }
}

impl Iterator for Chunks {
    type Item = Result<Chunk, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        while !self.failed {
            match self.messages.next()? {
                Ok(LogMsg::ArrowMsg(store, arrow)) if store.kind() == StoreKind::Recording => {
                    return Some(
                        Chunk::from_arrow_msg(&arrow).map_err(|error| self.fail(error.to_string())),
                    );
                }
                Ok(_) => {}
                Err(error) => return Some(Err(self.fail(decode_error_text(&error)))),
            }
        }
        None
    }
}

/// The decoder's message, without its prefix.
fn decode_error_text(error: &DecodeError) -> String {
    match error {
        DecodeError::Codec(error) => error.to_string(),
        DecodeError::Read(error) => error.to_string(),
    }
}
