//! The visited states of a run in columns, in the order of episodes.

use std::collections::{BTreeMap, BTreeSet};

use crate::record::{ReadError, RecordedEpisode, RecordedStates};
use crate::review::selection::is_sampled;
use crate::run::facts::StateQuantity;
use seedbed_env::{Quantity, Status};

/// The visited states of a run, or a sample of them that is spread over time.
#[derive(Debug)]
pub(super) struct RunStates {
    /// One per quantity. Their values are in the order of [`episodes`](Self::episodes).
    pub columns: Vec<StateColumn>,
    /// All episodes, sorted by their number and then by agent.
    pub episodes: Vec<EpisodeInfo>,
    /// Number of states of the run, of which `columns` may have a sample.
    pub state_count: u64,
    /// All states of the filmed episodes: columns as in `columns`.
    pub filmed: Vec<FilmedStates>,
}

/// The values of one quantity.
#[derive(Debug)]
pub(super) struct StateColumn {
    /// Name, unit and range.
    pub quantity: Quantity,
    /// What the quantity is.
    pub source: StateQuantity,
    /// One value per state; NaN for the last state of an episode, if the quantity belongs to steps.
    pub values: Vec<f32>,
    /// Number of values that were recorded as NaN.
    pub nan: usize,
}

/// One episode.
#[derive(Clone, Debug)]
pub(super) struct EpisodeInfo {
    pub agent: u32,
    pub episode: u32,
    pub round: u32,
    /// Number of steps.
    pub length: u32,
    pub r#return: f64,
    /// How the episode ended, if it is known.
    pub outcome: Option<Status>,
    /// Number of its states in the columns.
    pub kept: u32,
}

/// All states of one filmed episode.
#[derive(Debug)]
pub(super) struct FilmedStates {
    pub agent: u32,
    pub episode: u32,
    /// Values row by row: `[states × columns]`.
    pub rows: Vec<f32>,
}

/// Number and agent of an episode, by which episodes are sorted.
type EpisodeKey = (u32, u32);

/// Reads a recording, twice. At most `max_states` states are kept; all states of the episodes
/// `filmed` are returned separately. Calls `on_episode` for each episode.
pub(super) fn read(
    recording: &RecordedStates,
    max_states: u64,
    filmed: &BTreeSet<EpisodeKey>,
    on_episode: &mut dyn FnMut(),
) -> Result<RunStates, ReadError> {
    let mut lengths: BTreeMap<EpisodeKey, u64> = BTreeMap::new();
    let mut has_advantages = false;
    for episode in recording.episodes()? {
        let episode = episode?;
        has_advantages |= !episode.advantages.is_empty();
        lengths.insert(
            (episode.episode, episode.agent),
            episode.length() as u64 + 1,
        );
    }
    let state_count = lengths.values().sum();
    let mut columns = empty_columns(recording, has_advantages);
    let mut first_state = 0;
    let starts: BTreeMap<EpisodeKey, u64> = lengths
        .iter()
        .map(|(key, states)| {
            let start = first_state;
            first_state += states;
            (*key, start)
        })
        .collect();
    let mut read: BTreeMap<EpisodeKey, (EpisodeInfo, Vec<f32>)> = BTreeMap::new();
    let mut filmed_states = Vec::new();
    let [mut nan, mut nan_of_filmed] = [vec![0; columns.len()], vec![0; columns.len()]];
    for episode in recording.episodes()? {
        let episode = episode?;
        let key = (episode.episode, episode.agent);
        let Some(start) = starts.get(&key) else {
            continue; // written after the first reading, by a run in progress
        };
        let is_kept = |step: usize| is_sampled(start + step as u64, state_count, max_states);
        let kept: Vec<usize> = (0..=episode.length())
            .filter(|&step| is_kept(step))
            .collect();
        let info = EpisodeInfo {
            agent: episode.agent,
            episode: episode.episode,
            round: episode.round,
            length: episode.length() as u32,
            r#return: episode.total_reward(),
            outcome: Some(episode.outcome),
            kept: kept.len() as u32,
        };
        let kept_rows = rows(&episode, &columns, kept.into_iter(), &mut nan);
        read.insert(key, (info, kept_rows));
        if filmed.contains(&key) {
            filmed_states.push(FilmedStates {
                agent: episode.agent,
                episode: episode.episode,
                rows: rows(&episode, &columns, 0..=episode.length(), &mut nan_of_filmed),
            });
        }
        on_episode();
    }
    filmed_states.sort_by_key(|states| (states.agent, states.episode));
    let mut episodes = Vec::with_capacity(read.len());
    for (info, rows) in read.into_values() {
        episodes.push(info);
        add_rows(&mut columns, &rows);
    }
    for (column, nan) in columns.iter_mut().zip(nan) {
        column.nan = nan;
    }
    Ok(RunStates {
        columns,
        episodes,
        state_count,
        filmed: filmed_states,
    })
}

fn add_rows(columns: &mut [StateColumn], rows: &[f32]) {
    for row in rows.chunks_exact(columns.len()) {
        for (column, value) in columns.iter_mut().zip(row) {
            column.values.push(*value);
        }
    }
}

fn empty_columns(recording: &RecordedStates, has_advantages: bool) -> Vec<StateColumn> {
    let column = |source: StateQuantity, quantity: Quantity| StateColumn {
        quantity,
        source,
        values: Vec::new(),
        nan: 0,
    };
    let of_task = recording.quantities_of_task();
    let mut columns: Vec<StateColumn> = of_task
        .map(|(source, quantity)| column(source, quantity.clone()))
        .collect();
    for source in StateQuantity::OF_ALL_TASKS {
        let is_recorded = match source {
            StateQuantity::IntrinsicReward => recording.bonus().exists(),
            StateQuantity::Advantage => has_advantages,
            // The page computes those of episodes from its table of episodes.
            StateQuantity::Episode | StateQuantity::Return => false,
            _ => true,
        };
        if is_recorded {
            // Its range follows from the values.
            columns.push(column(source, source.with_range([0.0, 0.0])));
        }
    }
    columns
}

/// Values of the states at `steps`, row by row: `[steps × columns]`. Adds the numbers of values that were
/// recorded as NaN to those of `nan`: `[columns]`.
fn rows(
    episode: &RecordedEpisode,
    columns: &[StateColumn],
    steps: impl Iterator<Item = usize>,
    nan: &mut [usize],
) -> Vec<f32> {
    let mut rows = Vec::new();
    for step in steps {
        for (column, nan) in columns.iter().zip(&mut *nan) {
            let value = episode.value(column.source, step).map(|value| value as f32);
            *nan += usize::from(value.is_some_and(f32::is_nan));
            rows.push(value.unwrap_or(f32::NAN));
        }
    }
    rows
}
