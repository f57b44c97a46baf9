//! Several runs of one scenario whose agents act in the copies of one environment.
//!
//! A step of an environment with many copies takes less time per copy: Rapier and the analytic
//! models compute several copies at once. A single run of a small team cannot use that; the runs of
//! a study can. The bits of a copy do not depend on the other copies, and each run has its own
//! team, buffer and random streams, so that each result has the bits of a run alone.

use super::rollout::GroupRound;
use super::trainer::{Round, RoundFailure, Trainer, shares_rapier_world};
use crate::scenario::{Scenario, Schedule};
use seedbed_env::{Environment, Physics, TaskDescription, build};
use seedbed_input::InputError;
use seedbed_learn::cancellation::cancellation_point;

/// Number of copies from which on a step takes hardly less time per copy.
const SUFFICIENT_COPIES: usize = 32;

/// An environment with places for several runs.
pub struct SharedWorld {
    environment: Box<dyn Environment>,
    agents_per_run: usize,
    places: Vec<Option<RunInWorld>>,
    actions: Vec<f32>,
}

struct RunInWorld {
    trainer: Trainer,
    /// The round that is being played; `None` before the first round and between two rounds.
    round: Option<GroupRound<'static>>,
}

/// Number of runs of a scenario that are best played in one world; 1 if they gain nothing from it.
#[must_use]
pub fn runs_per_world(scenario: &Scenario, description: &TaskDescription) -> usize {
    let is_asynchronous = matches!(scenario.schedule, Schedule::Asynchronous { .. });
    let has_vectorized_steps =
        scenario.physics == Physics::Analytic || shares_rapier_world(description, scenario);
    if is_asynchronous || !has_vectorized_steps {
        return 1;
    }
    (SUFFICIENT_COPIES / scenario.agents.count.get() as usize).max(1)
}

impl SharedWorld {
    /// An environment for `places` runs of a scenario.
    ///
    /// # Errors
    /// The task cannot be built as the scenario asks.
    pub fn new(
        scenario: &Scenario,
        description: &TaskDescription,
        places: usize,
    ) -> Result<Self, InputError> {
        let agents_per_run = scenario.agents.count.get() as usize;
        let environment = build(description, scenario.physics, places * agents_per_run)?;
        let width = environment.spec().action_width();
        Ok(Self {
            actions: vec![0.0; places * agents_per_run * width],
            places: (0..places).map(|_| None).collect(),
            environment,
            agents_per_run,
        })
    }

    /// Number of places.
    #[must_use]
    pub fn places(&self) -> usize {
        self.places.len()
    }

    /// Whether another run can begin.
    #[must_use]
    pub fn has_free_place(&self) -> bool {
        self.places.iter().any(Option::is_none)
    }

    /// The trainer of a run of the scenario, which may differ from the others in its run seed.
    #[must_use]
    pub fn new_trainer(&self, scenario: &Scenario) -> Trainer {
        Trainer::in_shared_world(scenario, self.environment.spec())
    }

    /// Begins or continues the run of a [new](Self::new_trainer) or restored trainer, and returns its
    /// place.
    ///
    /// # Panics
    /// If there is no free place.
    pub fn begin(&mut self, trainer: Trainer) -> usize {
        let free_place = self.places.iter().position(Option::is_none);
        let place = free_place.expect("a place is free");
        let first_copy = place * self.agents_per_run;
        let copies = first_copy..first_copy + self.agents_per_run;
        self.environment.set_run(copies, trainer.run_seed());
        self.places[place] = Some(RunInWorld {
            trainer,
            round: None,
        });
        place
    }

    /// Plays until a round of a run has ended, and finishes this round. Returns the place of the run
    /// and the result of the round, or `None` if there is no run. A run whose round failed must be
    /// ended.
    pub fn advance(&mut self) -> Option<(usize, Result<Round, RoundFailure>)> {
        self.begin_rounds();
        while self.places.iter().flatten().next().is_some() {
            if let Some(finished) = self.finish_next_round() {
                return Some(finished);
            }
            self.step();
        }
        None
    }

    /// The trainer of a run.
    ///
    /// # Panics
    /// If no run is in this place.
    #[must_use]
    pub fn trainer(&self, place: usize) -> &Trainer {
        let run = self.places[place].as_ref();
        &run.expect("a run is in this place").trainer
    }

    /// Ends a run between two rounds, so that its place is free.
    pub fn end(&mut self, place: usize) {
        self.places[place] = None;
    }

    /// Begins a round of each run that is between two rounds.
    fn begin_rounds(&mut self) {
        for (place, run) in self.places.iter_mut().enumerate() {
            if let Some(RunInWorld { trainer, round }) = run
                && round.is_none()
            {
                let first_copy = place * self.agents_per_run;
                *round = Some(trainer.begin_round_in(&mut *self.environment, first_copy));
            }
        }
    }

    /// Finishes the first round that is over; `None` if there is none.
    fn finish_next_round(&mut self) -> Option<(usize, Result<Round, RoundFailure>)> {
        for (place, run) in self.places.iter_mut().enumerate() {
            if let Some(RunInWorld { trainer, round }) = run
                && let Some(finished) = round.take_if(|round| round.is_over())
            {
                return Some((place, trainer.finish_round(finished)));
            }
        }
        None
    }

    /// All agents of all runs act, and all copies advance by one step.
    fn step(&mut self) {
        cancellation_point();
        let width = self.environment.spec().action_width() * self.agents_per_run;
        let places = self
            .places
            .iter_mut()
            .zip(self.actions.chunks_exact_mut(width));
        for (run, actions) in places {
            if let Some(RunInWorld { trainer, round }) = run
                && let Some(round) = round
            {
                actions.copy_from_slice(round.act(&*self.environment, trainer.team()));
            }
        }
        self.environment.step(&self.actions);
        for run in self.places.iter_mut().flatten() {
            if let Some(round) = &mut run.round {
                run.trainer.observe_in(&mut *self.environment, round);
            }
        }
    }
}
