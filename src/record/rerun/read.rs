//! Reads a recording back: who saw and did what, episode by episode.
//!
//! Chunks are decoded one after the other and forgotten, so that memory holds one chunk (about 2,000 rows) and, for each agent, the
//! episode that is not complete yet, however long the recording is.

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
use crate::env::{Quantity, Status};
use crate::record::visitation::Axes;

/// A recording that was opened: what it is of.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    path: PathBuf,
    properties: BTreeMap<String, String>,
    quantities: Quantities,
}

/// One episode as it was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedEpisode {
    /// Who acted.
    pub agent: u32,
    /// The agent's own count, from 0.
    pub episode: u32,
    /// Counts from 0.
    pub round: u32,
    /// Row t is what was seen before action t; the last row is what was seen at the end. `[(T+1) × observation width]`
    pub observations: Vec<f32>,
    /// What was done: values, not indices. `[T × action width]`
    pub actions: Vec<f32>,
    /// `[T]`
    pub rewards: Vec<f32>,
    /// `[T]`; empty without curiosity.
    pub intrinsic_rewards: Vec<f32>,
    /// How it ended.
    pub outcome: Status,
}

/// A recording that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be opened or read, is damaged, or is of another version of Rerun.
    #[error("cannot read {path}: {reason}")]
    File {
        /// The file.
        path: PathBuf,
        /// What is the matter.
        reason: String,
    },
    /// Rerun can read it, but it was not written by this version of seedbed.
    #[error(
        "{path} holds no run that this version of seedbed can read: there is no `{missing}` in it"
    )]
    Other {
        /// The file.
        path: PathBuf,
        /// What a run would have.
        missing: String,
    },
}

impl Recording {
    /// Opens `run.rrd`, or the `run.rrd.part` of a run that goes on or was killed.
    ///
    /// # Errors
    /// The file cannot be read, or holds something else.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let mut properties = BTreeMap::new();
        for chunk in Chunks::open(path)? {
            let chunk = chunk?;
            match chunk.entity_path().to_string().as_str() {
                entity if entity.starts_with("/__properties") => {
                    note_properties(&chunk, &mut properties)
                }
                quantities::ENTITY => {
                    let quantities = quantities::read(&chunk).ok_or_else(|| missing(path))?;
                    return Ok(Self {
                        path: path.to_owned(),
                        properties,
                        quantities,
                    });
                }
                _ => {}
            }
        }
        Err(missing(path))
    }

    /// Facts about the run by name, such as `environment`, `agents`, `seed` and `algorithm`.
    #[must_use]
    pub fn properties(&self) -> &BTreeMap<String, String> {
        &self.properties
    }

    /// What an agent sees, in order.
    #[must_use]
    pub fn observations(&self) -> &[Quantity] {
        &self.quantities.observations
    }

    /// What an agent does, in order.
    #[must_use]
    pub fn actions(&self) -> &[Quantity] {
        &self.quantities.actions
    }

    /// The largest bonus that a step can have; none without curiosity.
    #[must_use]
    pub fn largest_bonus(&self) -> Option<f32> {
        self.quantities.largest_bonus
    }

    /// The axes of its parallel coordinates.
    #[must_use]
    pub fn axes(&self) -> Axes {
        Axes::of_quantities(
            &self.quantities.observations,
            self.quantities.time_limit,
            self.quantities.largest_bonus,
        )
    }

    /// Its episodes, those of an agent in their order. Episodes that are not complete in the file are left out.
    ///
    /// # Errors
    /// The file cannot be opened; the items are errors where it turns out to be damaged.
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

fn missing(path: &Path) -> ReadError {
    ReadError::Other {
        path: path.to_owned(),
        missing: quantities::ENTITY.to_owned(),
    }
}

fn note_properties(chunk: &Chunk, properties: &mut BTreeMap<String, String>) {
    for component in chunk.components_identifiers() {
        let value =
            quantities::words(chunk, component.as_str()).and_then(|words| words.into_iter().next());
        properties.extend(value.map(|value| (component.as_str().to_owned(), value)));
    }
}

/// The episodes of a recording, read as they are asked for.
pub struct Episodes {
    chunks: Chunks,
    columns: Columns,
    /// By agent.
    unfinished: BTreeMap<u32, RecordedEpisode>,
    finished: VecDeque<RecordedEpisode>,
}

impl Iterator for Episodes {
    type Item = Result<RecordedEpisode, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.finished.is_empty() {
            match self.chunks.next()? {
                Ok(chunk) => self.take_in(&chunk),
                Err(error) => return Some(Err(error)),
            }
        }
        self.finished.pop_front().map(Ok)
    }
}

impl Episodes {
    fn take_in(&mut self, chunk: &Chunk) {
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
            let start = || RecordedEpisode::start(agent, rows.episodes[row], rows.rounds[row]);
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
                step += 1;
            }
        }
    }
}

impl RecordedEpisode {
    fn start(agent: u32, episode: u32, round: u32) -> Self {
        let [observations, actions, rewards, intrinsic_rewards] =
            std::array::from_fn(|_| Vec::new());
        Self {
            agent,
            episode,
            round,
            observations,
            actions,
            rewards,
            intrinsic_rewards,
            outcome: Status::Running,
        }
    }

    /// T, the number of steps.
    #[must_use]
    pub fn length(&self) -> usize {
        self.rewards.len()
    }

    /// Sum of rewards, undiscounted.
    #[must_use]
    pub fn total_reward(&self) -> f64 {
        self.rewards.iter().map(|&reward| f64::from(reward)).sum()
    }

    /// What was seen, state by state, the last one included: `[T+1]` of `[observation width]`.
    pub fn states(&self) -> impl Iterator<Item = &[f32]> {
        self.observations
            .chunks_exact((self.observations.len() / (self.length() + 1)).max(1))
    }

    /// The bonus of what was done at step `step`; 0 at the last state, after which nothing follows, and without curiosity.
    #[must_use]
    pub fn bonus(&self, step: usize) -> f32 {
        self.intrinsic_rewards.get(step).copied().unwrap_or(0.0)
    }
}

/// Under which names the columns are found.
struct Columns {
    observations: Vec<ComponentIdentifier>,
    actions: Vec<ComponentIdentifier>,
    reward: ComponentIdentifier,
    intrinsic_reward: ComponentIdentifier,
    outcome: ComponentIdentifier,
}

/// The columns of one chunk.
struct Rows {
    episodes: Vec<u32>,
    rounds: Vec<u32>,
    /// `[observations]` of `[rows]`
    observations: Vec<Vec<f32>>,
    /// `[actions]` of `[rows without an outcome]`, as are those below.
    actions: Vec<Vec<f32>>,
    rewards: Vec<f32>,
    intrinsic_rewards: Vec<f32>,
    /// `[rows]`: of those rows that end an episode.
    outcomes: Vec<Option<Status>>,
}

impl Columns {
    fn of(quantities: &Quantities) -> Self {
        let named = |name: &str| ComponentIdentifier::from_archetype_field("State".into(), name);
        let all = |quantities: &[Quantity]| {
            quantities
                .iter()
                .map(|quantity| named(&quantity.name))
                .collect()
        };
        Self {
            observations: all(&quantities.observations),
            actions: all(&quantities.actions),
            reward: named("reward"),
            intrinsic_reward: named("intrinsic_reward"),
            outcome: named("outcome"),
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
            outcomes: self.outcomes(chunk),
        }
    }

    fn outcomes(&self, chunk: &Chunk) -> Vec<Option<Status>> {
        let mut words = quantities::words(chunk, self.outcome.as_str())
            .unwrap_or_default()
            .into_iter();
        let Some(list) = chunk.components().get_array(self.outcome) else {
            return Vec::new();
        };
        let ended = (0..list.len()).map(|row| list.is_valid(row) && list.value_length(row) > 0);
        ended
            .map(|ended| if ended { words.next() } else { None })
            .map(|word| word.map(|word| status(&word)))
            .collect()
    }
}

fn status(word: &str) -> Status {
    match word {
        "terminated" => Status::Terminated,
        "truncated" => Status::Truncated,
        _ => Status::Running,
    }
}

/// The chunks of a recording, without those of its layout.
struct Chunks {
    path: PathBuf,
    messages: DecoderIterator<LogMsg, BufReader<File>>,
    /// Nothing can be read after a fault.
    failed: bool,
}

impl Chunks {
    fn open(path: &Path) -> Result<Self, ReadError> {
        let file = File::open(path).map_err(|error| ReadError::File {
            path: path.to_owned(),
            reason: error.to_string(),
        })?;
        Ok(Self {
            path: path.to_owned(),
            messages: DecoderApp::decode_lazy(BufReader::new(file)),
            failed: false,
        })
    }

    fn fault(&mut self, reason: String) -> ReadError {
        self.failed = true;
        ReadError::File {
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
                        Chunk::from_arrow_msg(&arrow)
                            .map_err(|error| self.fault(error.to_string())),
                    );
                }
                Ok(_) => {}
                Err(error) => return Some(Err(self.fault(words(&error)))),
            }
        }
        None
    }
}

/// Without the decoder's own name for what failed.
fn words(error: &DecodeError) -> String {
    match error {
        DecodeError::Codec(error) => error.to_string(),
        DecodeError::Read(error) => error.to_string(),
    }
}
