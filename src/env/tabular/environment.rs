//! A finite task as an [`Environment`]: agents that know nothing of tables act in copies of one truth.

use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};

use super::file::quantity;
use super::{Mdp, Model};
use crate::env::dynamics::{from_bytes, to_bytes};
use crate::env::{Environment, Force, Pose, Quantity, Scene, Spec, Status};
use crate::random::Stream;

/// What an agent sees of a state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Observation {
    /// One number a state that has actions: 1 for the one it is in, 0 for all others; all 0 where no action is left.
    #[default]
    OneHot,
    /// Where the state is, each coordinate from 0 to 1.
    Place,
}

/// One drawn task, and how it is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Finite {
    /// The tables.
    pub model: Model,
    /// What they leave open.
    pub truth: Mdp,
    /// What an agent sees.
    pub observation: Observation,
}

/// M copies of a finite task.
pub struct FiniteEnvironment {
    spec: Spec,
    finite: Finite,
    state: Copies,
    /// `[copies × observations]`
    observations: Vec<f32>,
}

/// Where the copies are.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Copies {
    states: Vec<u32>,
    rewards: Vec<f32>,
    statuses: Vec<Status>,
    /// Steps since the reset.
    steps: Vec<u32>,
    random: Vec<Option<Stream>>,
}

#[derive(Serialize, Deserialize)]
struct Saved {
    task: String,
    state: Copies,
}

impl Finite {
    /// What an agent sees, with ranges.
    #[must_use]
    pub fn quantities(&self) -> Vec<Quantity> {
        match self.observation {
            Observation::OneHot => self
                .acting_states()
                .map(|state| quantity(&self.state_name(state), [0.0, 1.0]))
                .collect(),
            Observation::Place => self
                .model
                .coordinates
                .iter()
                .map(|coordinate| quantity(coordinate.name, [0.0, 1.0]))
                .collect(),
        }
    }

    /// States in which there is something to choose.
    fn acting_states(&self) -> impl Iterator<Item = u32> {
        (0..self.model.states() as u32).filter(|&state| !self.model.pairs(state).is_empty())
    }

    /// Such as `row_3_column_1`.
    fn state_name(&self, state: u32) -> String {
        let coordinates = self.model.coordinates.iter().zip(self.model.place(state));
        coordinates
            .map(|(coordinate, value)| format!("{}_{value}", coordinate.name))
            .collect::<Vec<_>>()
            .join("_")
    }

    /// `seen: [observations]`
    fn observe(&self, state: u32, seen: &mut [f32]) {
        match self.observation {
            Observation::OneHot => {
                seen.iter_mut()
                    .zip(self.acting_states())
                    .for_each(|(seen, other)| *seen = f32::from(u8::from(other == state)));
            }
            Observation::Place => {
                let places = self.model.coordinates.iter().zip(self.model.place(state));
                seen.iter_mut()
                    .zip(places)
                    .for_each(|(seen, (coordinate, value))| *seen = value / coordinate.largest);
            }
        }
    }
}

impl FiniteEnvironment {
    /// `copies` copies, none of which has started.
    #[must_use]
    pub fn new(spec: &Spec, finite: &Finite, copies: usize) -> Self {
        Self {
            observations: vec![0.0; copies * spec.observation_width()],
            spec: spec.clone(),
            state: Copies {
                states: vec![finite.model.start; copies],
                rewards: vec![0.0; copies],
                statuses: vec![Status::Idle; copies],
                steps: vec![0; copies],
                random: vec![None; copies],
            },
            finite: finite.clone(),
        }
    }

    fn observe(&mut self, copy: usize) {
        let width = self.spec.observation_width();
        self.finite.observe(
            self.state.states[copy],
            &mut self.observations[copy * width..][..width],
        );
    }

    /// An action beyond the last of a state counts as its last.
    fn advance(&mut self, copy: usize, action: f32) {
        let (Finite { model, truth, .. }, state) = (&self.finite, &mut self.state);
        let random = state.random[copy]
            .as_mut()
            .expect("a running copy was reset");
        let pairs = model.pairs(state.states[copy]);
        let outcome = model.sample(
            truth,
            (pairs.start + action as usize).min(pairs.end - 1),
            random,
        );
        state.rewards[copy] = model.reward(outcome, model.observe(truth, outcome, random)) as f32;
        state.states[copy] = model.outcomes()[outcome].state;
        state.steps[copy] += 1;
        if model.pairs(state.states[copy]).is_empty() {
            state.statuses[copy] = Status::Terminated;
        } else if state.steps[copy] >= self.spec.time_limit {
            state.statuses[copy] = Status::Truncated;
        }
        self.observe(copy);
    }
}

impl Environment for FiniteEnvironment {
    fn spec(&self) -> &Spec {
        &self.spec
    }

    fn copies(&self) -> usize {
        self.state.states.len()
    }

    fn reset(&mut self, copy: usize, random: &mut Stream) {
        self.state.states[copy] = self.finite.model.start;
        self.state.rewards[copy] = 0.0;
        self.state.statuses[copy] = Status::Running;
        self.state.steps[copy] = 0;
        self.state.random[copy] = Some(Stream::from_seed(random.random()));
        self.observe(copy);
    }

    fn step(&mut self, actions: &[f32]) {
        assert_eq!(actions.len(), self.copies(), "one action a copy");
        for (copy, &action) in actions.iter().enumerate() {
            if self.state.statuses[copy] == Status::Running {
                self.advance(copy, action);
            }
        }
    }

    fn observations(&self) -> &[f32] {
        &self.observations
    }

    fn rewards(&self) -> &[f32] {
        &self.state.rewards
    }

    fn statuses(&self) -> &[Status] {
        &self.state.statuses
    }

    fn save(&self) -> Vec<u8> {
        to_bytes(&Saved {
            task: self.spec.name.clone(),
            state: self.state.clone(),
        })
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved =
            from_bytes(bytes).map_err(|error| format!("no saved environment: {error}"))?;
        if saved.task != self.spec.name {
            return Err(format!(
                "the state is of task `{}`, not of `{}`",
                saved.task, self.spec.name
            ));
        }
        if saved.state.states.len() != self.copies() {
            return Err("the state is of another number of copies".to_owned());
        }
        self.state = saved.state;
        for copy in (0..self.copies())
            .filter(|&copy| self.state.statuses[copy] != Status::Idle)
            .collect::<Vec<_>>()
        {
            self.observe(copy);
        }
        Ok(())
    }

    fn scene(&self) -> Option<&Scene> {
        None
    }

    fn poses(&self, _: usize, _: &mut [Pose]) {}

    fn forces(&self, _: usize, _: &[Pose], _: &mut Vec<Force>) {}
}
