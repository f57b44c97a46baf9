//! A tabular task as an [`Environment`], for agents that do not know its tables.

use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};

use super::{Mdp, Model, TaskFamily};
use crate::dynamics::{from_bytes, to_bytes};
use crate::{Environment, Quantity, Status, TaskSpec};
use seedbed_random::Stream;

/// How a state is observed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum StateEncoding {
    /// One number per state that has actions: 1 for the current state, 0 for all others. All are 0
    /// in a state without actions.
    #[default]
    OneHot,
    /// The coordinates of the state, each scaled to 0 to 1.
    Place,
}

/// One MDP of a family, and how its states are observed.
#[derive(Clone, Debug, PartialEq)]
pub struct TabularTask {
    /// File that the task was read from.
    pub origin: String,
    /// The task as an agent sees it.
    pub spec: TaskSpec,
    /// The known part of the family's MDPs.
    pub model: Model,
    /// The MDP that was drawn from the family.
    pub true_mdp: Mdp,
    /// The family from which each run draws an MDP of its own, see [`TabularTask::for_run`]; `None`
    /// if all runs have `true_mdp`.
    pub drawn_per_run: Option<TaskFamily>,
    /// How a state is observed.
    pub observation: StateEncoding,
}

/// M copies of a tabular task.
pub(crate) struct TabularEnvironment {
    task: TabularTask,
    copies: CopyStates,
    /// `[copies × observations]`
    observations: Vec<f32>,
}

/// The states of all copies.
#[derive(Clone, Debug)]
struct CopyStates {
    states: Vec<u32>,
    rewards: Vec<f32>,
    statuses: Vec<Status>,
    /// Steps since the reset.
    steps: Vec<u32>,
    random: Vec<Option<Stream>>,
}

/// The state of one copy, which a checkpoint stores.
#[derive(Serialize, Deserialize)]
struct SavedCopy {
    task: String,
    state: u32,
    reward: f32,
    status: Status,
    steps: u32,
    random: Option<Stream>,
}

impl StateEncoding {
    /// The observed quantities of a model's states.
    pub(super) fn quantities(self, model: &Model) -> Vec<Quantity> {
        match self {
            Self::OneHot => states_with_actions(model)
                .map(|state| Quantity::new(&state_name(model, state), "", [0.0, 1.0]))
                .collect(),
            Self::Place => {
                let coordinates = model.coordinates.iter();
                coordinates
                    .map(|coordinate| Quantity::new(coordinate.name, "", [0.0, 1.0]))
                    .collect()
            }
        }
    }

    /// Writes what is observed of a state: `[observations]`.
    fn write(self, model: &Model, state: u32, observed: &mut [f32]) {
        match self {
            Self::OneHot => {
                for (observed, other) in observed.iter_mut().zip(states_with_actions(model)) {
                    *observed = f32::from(u8::from(other == state));
                }
            }
            Self::Place => {
                let coordinates = model.coordinates.iter().zip(model.coordinates_of(state));
                for (observed, (coordinate, value)) in observed.iter_mut().zip(coordinates) {
                    *observed = value / coordinate.max;
                }
            }
        }
    }
}

fn states_with_actions(model: &Model) -> impl Iterator<Item = u32> {
    (0..model.state_count() as u32).filter(|&state| !model.pairs(state).is_empty())
}

/// Name of a state, for example `row_3_column_1`.
fn state_name(model: &Model, state: u32) -> String {
    let coordinates = model.coordinates.iter().zip(model.coordinates_of(state));
    coordinates
        .map(|(coordinate, value)| format!("{}_{value}", coordinate.name))
        .collect::<Vec<_>>()
        .join("_")
}

impl TabularEnvironment {
    /// `copies` copies, none of which has started.
    pub(crate) fn new(task: &TabularTask, copies: usize) -> Self {
        Self {
            observations: vec![0.0; copies * task.spec.observation_width()],
            copies: CopyStates {
                states: vec![task.model.start; copies],
                rewards: vec![0.0; copies],
                statuses: vec![Status::Idle; copies],
                steps: vec![0; copies],
                random: vec![None; copies],
            },
            task: task.clone(),
        }
    }

    fn observe(&mut self, copy: usize) {
        let width = self.task.spec.observation_width();
        self.task.observation.write(
            &self.task.model,
            self.copies.states[copy],
            &mut self.observations[copy * width..][..width],
        );
    }

    /// Advances one copy by one action. An index beyond the last action of the state counts as the
    /// last action.
    fn advance(&mut self, copy: usize, action: f32) {
        let (
            TabularTask {
                model, true_mdp, ..
            },
            copies,
        ) = (&self.task, &mut self.copies);
        let random = copies.random[copy]
            .as_mut()
            .expect("a running copy was reset");
        let pairs = model.pairs(copies.states[copy]);
        let pair = (pairs.start + action as usize).min(pairs.end - 1);
        let outcome = model.sample_outcome(true_mdp, pair, random);
        copies.rewards[copy] =
            model.reward(outcome, model.observe(true_mdp, outcome, random)) as f32;
        copies.states[copy] = model.outcomes()[outcome].state;
        copies.steps[copy] += 1;
        if model.pairs(copies.states[copy]).is_empty() {
            copies.statuses[copy] = Status::Terminated;
        } else if copies.steps[copy] >= self.task.spec.time_limit {
            copies.statuses[copy] = Status::Truncated;
        }
        self.observe(copy);
    }
}

impl Environment for TabularEnvironment {
    fn spec(&self) -> &TaskSpec {
        &self.task.spec
    }

    fn copies(&self) -> usize {
        self.copies.states.len()
    }

    fn reset(&mut self, copy: usize, random: &mut Stream) {
        self.copies.states[copy] = self.task.model.start;
        self.copies.rewards[copy] = 0.0;
        self.copies.statuses[copy] = Status::Running;
        self.copies.steps[copy] = 0;
        self.copies.random[copy] = Some(Stream::from_seed(random.random()));
        self.observe(copy);
    }

    fn step(&mut self, actions: &[f32]) {
        assert_eq!(actions.len(), self.copies(), "one action per copy");
        for (copy, &action) in actions.iter().enumerate() {
            if self.copies.statuses[copy] == Status::Running {
                self.advance(copy, action);
            }
        }
    }

    fn observations(&self) -> &[f32] {
        &self.observations
    }

    fn rewards(&self) -> &[f32] {
        &self.copies.rewards
    }

    fn statuses(&self) -> &[Status] {
        &self.copies.statuses
    }

    fn save(&self, copy: usize) -> Vec<u8> {
        to_bytes(&SavedCopy {
            task: self.task.spec.name.clone(),
            state: self.copies.states[copy],
            reward: self.copies.rewards[copy],
            status: self.copies.statuses[copy],
            steps: self.copies.steps[copy],
            random: self.copies.random[copy].clone(),
        })
    }

    fn restore(&mut self, copy: usize, bytes: &[u8]) -> Result<(), String> {
        let saved: SavedCopy = from_bytes(bytes)
            .map_err(|error| format!("not a saved state of an environment: {error}"))?;
        if saved.task != self.task.spec.name {
            return Err(format!(
                "the saved state is of task `{}`, expected `{}`",
                saved.task, self.task.spec.name
            ));
        }
        if saved.state as usize >= self.task.model.state_count() {
            return Err("the saved state is of a task with more states".to_owned());
        }
        self.copies.states[copy] = saved.state;
        self.copies.rewards[copy] = saved.reward;
        self.copies.statuses[copy] = saved.status;
        self.copies.steps[copy] = saved.steps;
        self.copies.random[copy] = saved.random;
        if saved.status != Status::Idle {
            self.observe(copy);
        }
        Ok(())
    }
}
