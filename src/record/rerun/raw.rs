//! `/raw/agent_K`: everything the agent saw and did, as columns that can be queried.
//!
//! An episode of T steps makes T + 1 rows. Row t is what the agent saw and did at t; the last row is what it saw at the end and
//! has an outcome instead of an action.

use std::sync::Arc;

use rerun::external::arrow::array::{Float32Array, StringArray};
use rerun::log::Chunk;
use rerun::{
    ArchetypeName, ComponentDescriptor, ComponentIdentifier, EntityPath, SerializedComponentColumn,
};

use super::rows::{Moment, Moments, unit_column};
use super::sink::Fault;
use crate::env::{Choice, Spec, Status};
use crate::experience::Episode;

/// Rows written as one piece: many enough that the piece's own head weighs little, few enough that columns compress well.
const ROWS_PER_CHUNK: usize = 2048;

/// The rows of one agent that are still to be written.
pub(super) struct RawTable {
    entity: EntityPath,
    columns: Arc<RawColumns>,
    rows: Rows,
}

/// The columns of a task, in the order of the table.
pub(super) struct RawColumns {
    observations: Vec<ComponentDescriptor>,
    actions: Vec<(ComponentDescriptor, Choice)>,
    reward: ComponentDescriptor,
    log_prob: ComponentDescriptor,
    /// Of curious agents.
    intrinsic_reward: Option<ComponentDescriptor>,
    /// Where an axis shows them.
    advantage: Option<ComponentDescriptor>,
    outcome: ComponentDescriptor,
}

#[derive(Default)]
struct Rows {
    moments: Moments,
    observations: Vec<Vec<f32>>,
    actions: Vec<Vec<f32>>,
    rewards: Vec<f32>,
    log_probs: Vec<f32>,
    intrinsic_rewards: Vec<f32>,
    advantages: Vec<f32>,
    outcomes: Vec<&'static str>,
    is_last: Vec<bool>,
}

impl RawColumns {
    /// Fails where two columns would have the same name.
    pub(super) fn of(spec: &Spec, curious: bool, advantages: bool) -> Result<Arc<Self>, Fault> {
        let observed = spec
            .observations
            .iter()
            .map(|quantity| quantity.name.as_str());
        let done = spec
            .actions
            .iter()
            .map(|action| action.quantity.name.as_str());
        let further = ["reward", "log_prob", "intrinsic_reward", "outcome"]
            .into_iter()
            .chain(advantages.then_some("advantage"));
        let mut names: Vec<&str> = observed.chain(done).chain(further).collect();
        names.sort_unstable();
        if let Some([name, _]) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(format!("two columns would be named `{name}`"));
        }
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
        let [reward, log_prob, outcome] = ["reward", "log_prob", "outcome"].map(column);
        let intrinsic_reward = curious.then(|| column("intrinsic_reward"));
        let advantage = advantages.then(|| column("advantage"));
        Ok(Arc::new(Self {
            observations,
            actions,
            reward,
            log_prob,
            intrinsic_reward,
            advantage,
            outcome,
        }))
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
    pub(super) fn new(agent: usize, columns: &Arc<RawColumns>) -> Self {
        Self {
            entity: format!("raw/agent_{agent}").into(),
            columns: Arc::clone(columns),
            rows: Rows::of(columns),
        }
    }

    /// Adds an episode whose first row is at `first`.
    pub(super) fn add(&mut self, episode: &Episode, first: Moment) {
        let steps = episode.length();
        let Rows {
            moments,
            observations,
            actions,
            rewards,
            log_probs,
            outcomes,
            is_last,
            ..
        } = &mut self.rows;
        moments.push_steps(first, steps + 1);
        spread(&episode.observations, observations);
        let acted = actions.first().map_or(0, Vec::len);
        spread(&episode.actions, actions);
        for (column, (_, choice)) in actions.iter_mut().zip(&self.columns.actions) {
            put_values(choice, &mut column[acted..]);
        }
        rewards.extend(&episode.rewards);
        log_probs.extend(episode.action_log_probs());
        outcomes.push(outcome(episode.outcome));
        is_last.resize(is_last.len() + steps, false);
        is_last.push(true);
        self.add_afterthoughts(episode);
    }

    /// What the agent made of its steps only afterwards.
    fn add_afterthoughts(&mut self, episode: &Episode) {
        let Rows {
            rewards,
            intrinsic_rewards,
            advantages,
            ..
        } = &mut self.rows;
        if self.columns.intrinsic_reward.is_some() {
            intrinsic_rewards.extend(&episode.intrinsic_rewards);
            intrinsic_rewards.resize(rewards.len(), 0.0);
        }
        if self.columns.advantage.is_some() {
            advantages.extend(&episode.advantages);
            advantages.resize(rewards.len(), 0.0);
        }
    }

    /// If there are enough for a piece, or any and all are wanted.
    pub(super) fn take(&mut self, all: bool) -> Option<Result<Chunk, Fault>> {
        let least = if all { 1 } else { ROWS_PER_CHUNK };
        if self.rows.moments.len() < least {
            return None;
        }
        let rows = std::mem::replace(&mut self.rows, Rows::of(&self.columns));
        Some(rows.into_chunk(&self.entity, &self.columns))
    }
}

impl Rows {
    fn of(columns: &RawColumns) -> Self {
        let observations = vec![Vec::new(); columns.observations.len()];
        Self {
            observations,
            actions: vec![Vec::new(); columns.actions.len()],
            ..Self::default()
        }
    }

    fn into_chunk(self, entity: &EntityPath, columns: &RawColumns) -> Result<Chunk, Fault> {
        let is_step: Vec<bool> = self.is_last.iter().map(|is_last| !is_last).collect();
        let observed = columns
            .observations
            .iter()
            .zip(self.observations)
            .map(|(name, values)| numbers(name, values, None));
        let named = columns
            .actions
            .iter()
            .map(|(name, _)| name)
            .chain([&columns.reward, &columns.log_prob]);
        let done = self
            .actions
            .into_iter()
            .chain([self.rewards, self.log_probs]);
        let afterwards = [
            (&columns.intrinsic_reward, self.intrinsic_rewards),
            (&columns.advantage, self.advantages),
        ];
        let afterwards = afterwards
            .into_iter()
            .filter_map(|(name, values)| Some((name.as_ref()?, values)));
        let done = named
            .zip(done)
            .chain(afterwards)
            .map(|(name, values)| numbers(name, values, Some(is_step.clone())));
        let outcome = unit_column(
            columns.outcome.clone(),
            Arc::new(StringArray::from(self.outcomes)),
            Some(self.is_last),
        );
        self.moments
            .into_chunk(entity, observed.chain(done).chain([outcome]))
    }
}

fn numbers(
    name: &ComponentDescriptor,
    values: Vec<f32>,
    present: Option<Vec<bool>>,
) -> SerializedComponentColumn {
    unit_column(name.clone(), Arc::new(Float32Array::from(values)), present)
}

/// Adds rows to columns.
fn spread(rows: &[f32], columns: &mut [Vec<f32>]) {
    let width = columns.len();
    for (index, column) in columns.iter_mut().enumerate() {
        column.extend(rows.iter().skip(index).step_by(width));
    }
}

/// Replaces the indices of discrete actions by their values.
fn put_values(choice: &Choice, actions: &mut [f32]) {
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
