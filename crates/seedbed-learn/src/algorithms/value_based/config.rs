//! The configurations of value-based learners: Q-learning, Seed TD with its kin, bootstrapped DQN;
//! their defaults and meanings.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::exploration::Exploration;
use super::{ValueTeam, one_choice};
use crate::agent::curiosity::Bonus;
use crate::agent::policy::ActionSelection;
use crate::agent::scaling::ObservationScaling;
use crate::algorithms::seed_pg::config::TimeLimit;
use crate::algorithms::{AlgorithmConfig, ScheduleError, ScheduleKind};
use crate::nn::AdamSettings;
use crate::team::{Team, TeamContext};
use seedbed_env::Spec;
use seedbed_env::input::numbers::{
    Count, Fraction, NonNegative, Positive, PositiveFraction, known, known_count,
};
use seedbed_env::input::{Located, ValidationError};

/// Q-learning on the team's replay (thesis §1.4.1; Mnih et al. 2015).
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct QLearning {
    /// Whether the team shares one network or each agent has its own.
    pub networks: Networks,
    /// How actions are chosen.
    pub exploration: Exploration,
    /// Whether the learning network chooses the action that the target network evaluates (van
    /// Hasselt, Guez & Silver 2016).
    pub double: bool,
    /// What all value-based learners have in common.
    pub learning: Learning,
    /// Bonus that is added to rewards.
    pub bonus: Located<Bonus>,
}

/// Seed TD, seed LSVI and seed ensembles (thesis §2.4; Dimakopoulou, Osband & Van Roy 2018): every
/// transition of the team's replay has a reward seed of the model's own, drawn from `agents.seeds`.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SeedTd {
    /// Number of models.
    pub models: Models,
    /// How a model is fitted.
    pub fit: Located<Fit>,
    /// Weight λ of the pull back to the model's initial parameters θ̂.
    pub regularisation: NonNegative,
    /// Scale β of the prior: Q is the learned network plus β times a fixed random one (Osband,
    /// Aslanides & Cassirer 2018).
    pub prior_scale: NonNegative,
    /// How actions are chosen.
    pub exploration: Exploration,
    /// Whether the learning network chooses the action that the target network evaluates.
    pub double: bool,
    /// What all value-based learners have in common.
    pub learning: Learning,
    /// Bonus that is added to rewards.
    pub bonus: Located<Bonus>,
}

/// Bootstrapped DQN with randomized prior functions (Osband et al. 2016, 2018): each agent follows,
/// for a round, a model drawn from one set.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BootstrappedDqn {
    /// Number of models in the set.
    pub models: Count<1000>,
    /// Scale β of the prior: Q is the learned network plus β times a fixed random one.
    pub prior_scale: NonNegative,
    /// Share of the transitions that each model learns from, drawn once per transition and model.
    pub mask: PositiveFraction,
    /// How actions are chosen.
    pub exploration: Exploration,
    /// Whether the learning network chooses the action that the target network evaluates.
    pub double: bool,
    /// What all value-based learners have in common.
    pub learning: Learning,
    /// Bonus that is added to rewards.
    pub bonus: Located<Bonus>,
}

/// Whether the team shares one network or each agent has its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Networks {
    /// One network for the team.
    Shared,
    /// One network per agent.
    Own,
}

/// Number of models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Models {
    /// One per agent.
    Own,
    /// One per agent, but at most `most`; then agent k follows model k mod `most`.
    Ensemble {
        /// Maximal number of models.
        #[serde(default = "default_ensemble")]
        most: Count<10_000>,
    },
}

/// How a model is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Fit {
    /// By gradient steps towards the targets of a target network.
    Td,
    /// Again from θ̂ at the end of every round: regressions, each on the values of the one before,
    /// the first on rewards alone.
    Lsvi {
        /// Number of regressions, each of `learning.minibatches` gradient steps.
        iterations: Count<10_000>,
    },
}

/// What value-based learners have in common.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Learning {
    /// Discount factor γ.
    pub discount: Fraction,
    /// Whether the time limit counts as the end of an episode.
    pub time_limit: TimeLimit,
    /// How observations enter the networks.
    pub observations: ObservationScaling,
    /// Numbers of units of the hidden layers.
    pub hidden: Located<Vec<Count<4096>>>,
    /// Maximal number of the team's transitions in the replay buffer.
    pub replay: Count<100_000_000>,
    /// Number of transitions per gradient step.
    pub minibatch: Located<Count<100_000>>,
    /// Number of gradient steps of each model each time it learns.
    pub minibatches: Count<1_000_000>,
    /// Number of gradient steps after which the learning network is copied to the target network.
    pub target_every: Count<100_000_000>,
    /// Maximal norm of the gradient.
    pub gradient_clip: Option<Positive>,
    /// Optimizer of the networks.
    pub optimiser: AdamSettings,
}

/// A value-based learner, put together from a configuration.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Composition {
    pub(super) models: usize,
    pub(super) following: Following,
    /// Whether rewards have seeds.
    pub(super) seeded: bool,
    pub(super) mask: f32,
    pub(super) prior_scale: f32,
    pub(super) regularisation: f32,
    pub(super) fit: Fit,
    pub(super) double: bool,
    pub(super) exploration: Exploration,
    pub(super) learning: Learning,
    pub(super) bonus: Bonus,
}

/// Which model an agent follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Following {
    /// Always the same: k mod the number of models.
    Committed,
    /// One drawn for every round.
    Drawn,
}

/// The configuration of a value-based learner.
pub(super) trait ValueBased {
    /// What the learner is put together from, for a team of `agents`.
    fn compose(&self, agents: usize) -> Composition;

    /// What it has in common with the others.
    fn common(&self) -> (&Learning, &Located<Bonus>);

    /// How actions are chosen.
    fn exploration_mut(&mut self) -> &mut Exploration;

    /// Checks whether models can learn in the middle of a round.
    fn check_lockstep(&self) -> Result<(), ValidationError> {
        Ok(())
    }
}

impl<T: ValueBased> AlgorithmConfig for T {
    fn build(&self, context: &TeamContext<'_>) -> Box<dyn Team> {
        let agents = context.config.count.get() as usize;
        Box::new(ValueTeam::new(self.compose(agents), context))
    }

    fn check(&self) -> Result<(), ValidationError> {
        let (learning, bonus) = self.common();
        check(learning, bonus)
    }

    fn check_schedule(&self, schedule: ScheduleKind) -> Result<(), ScheduleError> {
        match schedule {
            ScheduleKind::Synchronous => Ok(()),
            ScheduleKind::Lockstep => self.check_lockstep().map_err(ScheduleError::Parameter),
            ScheduleKind::Asynchronous => Err(ScheduleError::Algorithm(
                "value-based learners learn all at once; expected `schedule: Lockstep(…)` or \
                 `Synchronous(…)`, or `algorithm: SeedPg(…)`",
            )),
        }
    }

    fn check_task(&self, task: &Spec) -> Result<(), String> {
        let found = |what| {
            format!(
                "value-based learners choose among values of discrete actions, but {what}; \
                 expected `SeedPg`, or a task with one discrete action"
            )
        };
        one_choice(task).map(|_| ()).map_err(found)
    }

    fn select_actions(&mut self, selection: ActionSelection) {
        let exploration = self.exploration_mut();
        *exploration = exploration.with_actions(selection);
    }

    fn bonus(&self) -> Option<&Bonus> {
        Some(self.common().1)
    }

    fn cost_per_step(&self, _: u32) -> f64 {
        30.0
    }
}

/// Says which parameters of a value-based learner contradict each other.
fn check(learning: &Learning, bonus: &Located<Bonus>) -> Result<(), ValidationError> {
    if learning.hidden.is_empty() {
        return Err(learning
            .hidden
            .error("names no layer; expected at least one, such as `hidden: [50, 50]`"));
    }
    if learning.minibatch.get() > learning.replay.get() {
        let message = format!(
            "is more than the {} transitions of `replay`, so that nothing would be learned",
            learning.replay.get()
        );
        return Err(learning.minibatch.error(message));
    }
    if bonus.is_independent() {
        return Err(bonus.error(
            "value models learn from the team's transitions; expected `model: Shared` or `Frozen`",
        ));
    }
    Ok(())
}

impl ValueBased for QLearning {
    fn compose(&self, agents: usize) -> Composition {
        Composition {
            models: if self.networks == Networks::Shared {
                1
            } else {
                agents
            },
            exploration: self.exploration,
            double: self.double,
            ..Composition::plain(&self.learning, &self.bonus)
        }
    }

    fn common(&self) -> (&Learning, &Located<Bonus>) {
        (&self.learning, &self.bonus)
    }

    fn exploration_mut(&mut self) -> &mut Exploration {
        &mut self.exploration
    }
}

impl ValueBased for SeedTd {
    fn compose(&self, agents: usize) -> Composition {
        let most = match self.models {
            Models::Own => agents,
            Models::Ensemble { most } => most.get() as usize,
        };
        Composition {
            models: most.min(agents),
            seeded: true,
            prior_scale: self.prior_scale.get_f32(),
            regularisation: self.regularisation.get_f32(),
            fit: *self.fit,
            exploration: self.exploration,
            double: self.double,
            ..Composition::plain(&self.learning, &self.bonus)
        }
    }

    fn common(&self) -> (&Learning, &Located<Bonus>) {
        (&self.learning, &self.bonus)
    }

    fn exploration_mut(&mut self) -> &mut Exploration {
        &mut self.exploration
    }

    fn check_lockstep(&self) -> Result<(), ValidationError> {
        match *self.fit {
            Fit::Lsvi { .. } => Err(self
                .fit
                .error("`Lsvi` fits a model anew at the end of a round; expected `schedule: Synchronous(…)`, or `fit: Td`")),
            Fit::Td => Ok(()),
        }
    }
}

impl ValueBased for BootstrappedDqn {
    fn compose(&self, _: usize) -> Composition {
        Composition {
            models: self.models.get() as usize,
            following: Following::Drawn,
            mask: self.mask.get_f32(),
            prior_scale: self.prior_scale.get_f32(),
            exploration: self.exploration,
            double: self.double,
            ..Composition::plain(&self.learning, &self.bonus)
        }
    }

    fn common(&self) -> (&Learning, &Located<Bonus>) {
        (&self.learning, &self.bonus)
    }

    fn exploration_mut(&mut self) -> &mut Exploration {
        &mut self.exploration
    }
}

impl Composition {
    fn plain(learning: &Learning, bonus: &Bonus) -> Self {
        Self {
            models: 1,
            following: Following::Committed,
            seeded: false,
            mask: 1.0,
            prior_scale: 0.0,
            regularisation: 0.0,
            fit: Fit::Td,
            double: false,
            exploration: Exploration::Greedy,
            learning: learning.clone(),
            bonus: bonus.clone(),
        }
    }
}

impl Exploration {
    /// The same policy with actions chosen in another way.
    #[must_use]
    pub(super) fn with_actions(self, actions: ActionSelection) -> Self {
        match actions {
            ActionSelection::Sampled => self,
            ActionSelection::Tempered { temperature } => Self::Gibbs { temperature },
            ActionSelection::Greedy => Self::Greedy,
        }
    }
}

impl Default for QLearning {
    fn default() -> Self {
        Self {
            networks: Networks::Shared,
            exploration: Exploration::EpsilonGreedy {
                from: known(1.0),
                to: known(0.05),
                steps: known_count(10_000),
            },
            double: true,
            learning: Learning::default(),
            bonus: Bonus::None.into(),
        }
    }
}

impl Default for SeedTd {
    fn default() -> Self {
        Self {
            models: Models::Ensemble {
                most: default_ensemble(),
            },
            fit: Fit::Td.into(),
            regularisation: known(0.0),
            prior_scale: known(3.0),
            exploration: Exploration::Greedy,
            double: false,
            learning: Learning::default(),
            bonus: Bonus::None.into(),
        }
    }
}

impl Default for BootstrappedDqn {
    fn default() -> Self {
        Self {
            models: known_count(10),
            prior_scale: known(3.0),
            mask: known(0.5),
            exploration: Exploration::Greedy,
            double: true,
            learning: Learning::default(),
            bonus: Bonus::None.into(),
        }
    }
}

impl Default for Learning {
    fn default() -> Self {
        Self {
            discount: known(0.99),
            time_limit: TimeLimit::Bootstraps,
            observations: ObservationScaling::Range,
            hidden: vec![known_count(50); 2].into(),
            replay: known_count(1_000_000),
            minibatch: known_count(16).into(),
            minibatches: known_count(1),
            target_every: known_count(100),
            gradient_clip: None,
            optimiser: AdamSettings::default(),
        }
    }
}

fn default_ensemble() -> Count<10_000> {
    known_count(30)
}
