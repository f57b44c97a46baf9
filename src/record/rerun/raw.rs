//! `/raw/agent_K`: the observations, actions and rewards of an agent, as columns for queries.
//!
//! An episode of T steps has T + 1 rows. Row t has the observation and the action at step t; the
//! last row has the last observation, and an outcome instead of an action.

use std::sync::Arc;

use rerun::external::arrow::array::{Float32Array, StringArray};
use rerun::log::Chunk;
use rerun::{
    ArchetypeName, ComponentDescriptor, ComponentIdentifier, EntityPath, SerializedComponentColumn,
};

use super::error::RecordingError;
use super::rows::{Moment, Moments, unit_column};
use crate::run::facts::StateQuantity;
use seedbed_env::{Choice, Status, TaskSpec};
use seedbed_learn::experience::{Episode, StepData};

/// Columns of a state beside its quantities.
const LOG_PROB: &str = "log_prob";
pub(super) const OUTCOME: &str = "outcome";

/// The rows of one agent that are not written yet.
#[derive(Clone)]
pub(super) struct RawTable {
    entity: EntityPath,
    columns: Arc<RawColumns>,
    rows: Rows,
    rows_per_chunk: usize,
}

/// The columns of a task, in the order of the table.
pub(super) struct RawColumns {
    observations: Vec<ComponentDescriptor>,
    actions: Vec<(ComponentDescriptor, Choice)>,
    info: Vec<ComponentDescriptor>,
    reward: ComponentDescriptor,
    log_prob: ComponentDescriptor,
    /// `None` for agents without a bonus.
    intrinsic_reward: Option<ComponentDescriptor>,
    /// `None` unless an axis shows advantages.
    advantage: Option<ComponentDescriptor>,
    outcome: ComponentDescriptor,
}

#[derive(Clone, Default)]
struct Rows {
    moments: Moments,
    observations: Vec<Vec<f32>>,
    actions: Vec<Vec<f32>>,
    info: Vec<Vec<f32>>,
    rewards: Vec<f32>,
    log_probs: Vec<f32>,
    intrinsic_rewards: Vec<f32>,
    advantages: Vec<f32>,
    outcomes: Vec<&'static str>,
    is_last: Vec<bool>,
}

impl RawColumns {
    /// The columns of a task. Fails if two columns have the same name.
    pub(super) fn of(
        spec: &TaskSpec,
        has_bonus: bool,
        has_advantages: bool,
    ) -> Result<Arc<Self>, RecordingError> {
        check_column_names(spec, has_advantages)?;
        let observations = spec
            .observations
            .iter()
            .map(|quantity| column(&quantity.name))
            .collect();
        let actions = spec
            .actions
            .iter()
            .map(|action| (column(&action.quantity.name), action.choice.clone()))
            .collect();
        let info = spec.info.iter().map(|quantity| column(&quantity.name));
        let reward = column(StateQuantity::Reward.key());
        let [log_prob, outcome] = [LOG_PROB, OUTCOME].map(column);
        let intrinsic_reward = has_bonus.then(|| column(StateQuantity::IntrinsicReward.key()));
        let advantage = has_advantages.then(|| column(StateQuantity::Advantage.key()));
        Ok(Arc::new(Self {
            observations,
            actions,
            info: info.collect(),
            reward,
            log_prob,
            intrinsic_reward,
            advantage,
            outcome,
        }))
    }
}

fn check_column_names(spec: &TaskSpec, has_advantages: bool) -> Result<(), RecordingError> {
    let observations = spec
        .observations
        .iter()
        .map(|quantity| quantity.name.as_str());
    let actions = spec
        .actions
        .iter()
        .map(|action| action.quantity.name.as_str());
    let info = spec.info.iter().map(|quantity| quantity.name.as_str());
    let [reward, intrinsic_reward, advantage] = [
        StateQuantity::Reward,
        StateQuantity::IntrinsicReward,
        StateQuantity::Advantage,
    ]
    .map(StateQuantity::key);
    let others = [reward, LOG_PROB, intrinsic_reward, OUTCOME]
        .into_iter()
        .chain(has_advantages.then_some(advantage));
    let mut names: Vec<&str> = observations
        .chain(actions)
        .chain(info)
        .chain(others)
        .collect();
    names.sort_unstable();
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(RecordingError::DuplicateColumn(pair[0].to_owned())),
        None => Ok(()),
    }
}

fn column(name: &str) -> ComponentDescriptor {
    let archetype = ArchetypeName::from("State");
    let component = ComponentIdentifier::from_archetype_field(archetype, name);
    ComponentDescriptor {
        archetype: Some(archetype),
        component,
        component_type: None,
    }
}

impl RawTable {
    pub(super) fn new(agent: u32, columns: &Arc<RawColumns>, rows_per_chunk: usize) -> Self {
        Self {
            entity: format!("raw/agent_{agent}").into(),
            columns: Arc::clone(columns),
            rows: Rows::of(columns, 0),
            rows_per_chunk,
        }
    }

    /// Adds an episode whose first row is at `first`. `info: [(T+1) × info width]`
    pub(super) fn add(
        &mut self,
        episode: &Episode,
        info: &[f32],
        step_data: Option<&StepData>,
        first: Moment,
    ) {
        let steps = episode.length();
        let Rows {
            moments,
            observations,
            actions,
            info: info_columns,
            rewards,
            log_probs,
            outcomes,
            is_last,
            ..
        } = &mut self.rows;
        moments.push_steps(first, steps + 1);
        append_to_columns(&episode.observations, observations);
        append_to_columns(info, info_columns);
        let rows_before = actions.first().map_or(0, Vec::len);
        append_to_columns(&episode.actions, actions);
        for (column, (_, choice)) in actions.iter_mut().zip(&self.columns.actions) {
            replace_indices_by_values(choice, &mut column[rows_before..]);
        }
        rewards.extend(&episode.rewards);
        log_probs.extend(episode.action_log_probs());
        outcomes.push(outcome(episode.outcome));
        is_last.resize(is_last.len() + steps, false);
        is_last.push(true);
        self.add_step_data(step_data);
    }

    /// Adds the values that an update computed for the steps of the newest episode. Rows without
    /// such values get 0.
    fn add_step_data(&mut self, step_data: Option<&StepData>) {
        let Rows {
            rewards,
            intrinsic_rewards,
            advantages,
            ..
        } = &mut self.rows;
        if self.columns.intrinsic_reward.is_some() {
            intrinsic_rewards.extend(step_data.iter().flat_map(|data| &data.intrinsic_rewards));
            intrinsic_rewards.resize(rewards.len(), 0.0);
        }
        if self.columns.advantage.is_some() {
            advantages.extend(step_data.iter().flat_map(|data| &data.advantages));
            advantages.resize(rewards.len(), 0.0);
        }
    }

    /// Takes the rows as a chunk if there are enough for a chunk or, if `all` is set, if there are
    /// any.
    pub(super) fn take(&mut self, all: bool) -> Option<Result<Chunk, RecordingError>> {
        let min_rows = if all { 1 } else { self.rows_per_chunk };
        if self.rows.moments.len() < min_rows {
            return None;
        }
        // The next chunk has about as many rows.
        let next = Rows::of(&self.columns, self.rows.moments.len());
        let rows = std::mem::replace(&mut self.rows, next);
        Some(rows.into_chunk(&self.entity, &self.columns))
    }
}

impl Rows {
    /// No rows, with room for this number of rows.
    fn of(columns: &RawColumns, rows: usize) -> Self {
        let empty = |count| (0..count).map(|_| Vec::with_capacity(rows)).collect();
        Self {
            moments: Moments::with_capacity(rows),
            observations: empty(columns.observations.len()),
            actions: empty(columns.actions.len()),
            info: empty(columns.info.len()),
            rewards: Vec::with_capacity(rows),
            log_probs: Vec::with_capacity(rows),
            is_last: Vec::with_capacity(rows),
            ..Self::default()
        }
    }

    fn into_chunk(
        self,
        entity: &EntityPath,
        columns: &RawColumns,
    ) -> Result<Chunk, RecordingError> {
        let row_is_step: Vec<bool> = self.is_last.iter().map(|is_last| !is_last).collect();
        let state_descriptors = columns.observations.iter().chain(&columns.info);
        let state_columns = state_descriptors
            .zip(self.observations.into_iter().chain(self.info))
            .map(|(descriptor, values)| f32_column(descriptor, values, None));
        let step_descriptors = columns
            .actions
            .iter()
            .map(|(descriptor, _)| descriptor)
            .chain([&columns.reward, &columns.log_prob]);
        let step_values = self
            .actions
            .into_iter()
            .chain([self.rewards, self.log_probs]);
        let update_columns = [
            (&columns.intrinsic_reward, self.intrinsic_rewards),
            (&columns.advantage, self.advantages),
        ];
        let update_columns = update_columns
            .into_iter()
            .filter_map(|(descriptor, values)| Some((descriptor.as_ref()?, values)));
        let step_columns = step_descriptors
            .zip(step_values)
            .chain(update_columns)
            .map(|(descriptor, values)| f32_column(descriptor, values, Some(row_is_step.clone())));
        let outcome = unit_column(
            columns.outcome.clone(),
            Arc::new(StringArray::from(self.outcomes)),
            Some(self.is_last),
        );
        self.moments
            .into_chunk(entity, state_columns.chain(step_columns).chain([outcome]))
    }
}

fn f32_column(
    descriptor: &ComponentDescriptor,
    values: Vec<f32>,
    present: Option<Vec<bool>>,
) -> SerializedComponentColumn {
    unit_column(
        descriptor.clone(),
        Arc::new(Float32Array::from(values)),
        present,
    )
}

/// Appends row-major values to one vector per column.
fn append_to_columns(rows: &[f32], columns: &mut [Vec<f32>]) {
    let width = columns.len();
    for (index, column) in columns.iter_mut().enumerate() {
        column.extend(rows.iter().skip(index).step_by(width));
    }
}

/// Replaces indices of discrete actions by the values of the actions.
fn replace_indices_by_values(choice: &Choice, actions: &mut [f32]) {
    if let Choice::Discrete(values) = choice {
        for action in actions {
            *action = values[*action as usize];
        }
    }
}

fn outcome(status: Status) -> &'static str {
    match status {
        Status::Terminated => "terminated",
        Status::Truncated => "truncated",
        Status::Idle | Status::Running => "unfinished",
    }
}
