//! The configurations of value-based learners: Q-learning, Seed TD with its kin, bootstrapped DQN; their defaults and meanings.

use serde::{Deserialize, Serialize};

use super::exploration::Exploration;
use crate::agent::Algorithm;
use crate::agent::curiosity::Bonus;
use crate::agent::policy::ActionSelection;
use crate::agent::scaling::ObservationScaling;
use crate::agent::seed_pg::config::TimeLimit;
use crate::input::numbers::{
    Count, Fraction, NonNegative, Positive, PositiveFraction, known, known_count,
};
use crate::input::{Complaint, Located};
use crate::nn::AdamSettings;

/// Q-learning on the team's replay (thesis §1.4.1; Mnih et al. 2015).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct QLearning {
    /// Who has a network.
    pub networks: Networks,
    /// How actions are chosen.
    pub exploration: Exploration,
    /// Whether the learning network chooses the action that the target network judges (van Hasselt, Guez & Silver 2016).
    pub double: bool,
    /// Everything that value-based learners have in common.
    pub learning: Learning,
    /// What is added to rewards.
    pub bonus: Located<Bonus>,
}

/// Seed TD, seed LSVI and seed ensembles (thesis §2.4; Dimakopoulou, Osband & Van Roy 2018): every transition of the team's replay
/// has a reward seed of the model's own, drawn from `agents.seeds`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SeedTd {
    /// How many models there are.
    pub models: Models,
    /// How a model is fitted.
    pub fit: Located<Fit>,
    /// λ, the pull back to the model's initial parameters θ̂.
    pub regularisation: NonNegative,
    /// β: Q is the learned network plus β times a fixed random one (Osband, Aslanides & Cassirer 2018).
    pub prior_scale: NonNegative,
    /// How actions are chosen.
    pub exploration: Exploration,
    /// Whether the learning network chooses the action that the target network judges.
    pub double: bool,
    /// Everything that value-based learners have in common.
    pub learning: Learning,
    /// What is added to rewards.
    pub bonus: Located<Bonus>,
}

/// Bootstrapped DQN with randomised prior functions (Osband et al. 2016, 2018): each agent follows, for a round, a model drawn from one
/// set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BootstrappedDqn {
    /// Models in the set.
    pub models: Count<1000>,
    /// β: Q is the learned network plus β times a fixed random one.
    pub prior_scale: NonNegative,
    /// How much of the transitions each model learns from, drawn once for each transition and model.
    pub mask: PositiveFraction,
    /// How actions are chosen.
    pub exploration: Exploration,
    /// Whether the learning network chooses the action that the target network judges.
    pub double: bool,
    /// Everything that value-based learners have in common.
    pub learning: Learning,
    /// What is added to rewards.
    pub bonus: Located<Bonus>,
}

/// Who has a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Networks {
    /// The team, one.
    Shared,
    /// Each agent, one of its own.
    Own,
}

/// How many models there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Models {
    /// One for each agent.
    Own,
    /// One for each agent up to `most`, then agent k follows model k mod `most`.
    Ensemble {
        /// The largest number of models.
        #[serde(default = "default_ensemble")]
        most: Count<10_000>,
    },
}

/// How a model is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Fit {
    /// From where it stands, towards targets of a network that follows it now and then.
    Td,
    /// Anew from θ̂ at the end of every round: regressions on the values of the one before, the first on rewards alone.
    Lsvi {
        /// Regressions, each of `learning.minibatches` gradient steps.
        iterations: Count<10_000>,
    },
}

/// What value-based learners have in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Learning {
    /// γ
    pub discount: Fraction,
    /// Whether the time limit counts as an end.
    pub time_limit: TimeLimit,
    /// How observations enter the networks.
    pub observations: ObservationScaling,
    /// Units of the hidden layers.
    pub hidden: Located<Vec<Count<4096>>>,
    /// Transitions of the team that are kept.
    pub replay: Count<100_000_000>,
    /// Transitions of one gradient step.
    pub minibatch: Located<Count<100_000>>,
    /// Gradient steps of each model whenever it learns.
    pub minibatches: Count<1_000_000>,
    /// Gradient steps between two copies of the learning network to the target network.
    pub target_every: Count<100_000_000>,
    /// A bound on the norm of the gradient.
    pub gradient_clip: Option<Positive>,
    /// Adam of the networks.
    pub optimiser: AdamSettings,
}

/// A value-based learner, put together from a configuration.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::agent) struct Composition {
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
pub(in crate::agent) enum Following {
    /// Always the same: k mod the number of models.
    Committed,
    /// One drawn for every round.
    Drawn,
}

/// What a value-based algorithm is put together from; none of another algorithm.
pub(in crate::agent) fn composition(algorithm: &Algorithm, agents: usize) -> Option<Composition> {
    match algorithm {
        Algorithm::QLearning(config) => Some(config.compose(agents)),
        Algorithm::SeedTd(config) => Some(config.compose(agents)),
        Algorithm::BootstrappedDqn(config) => Some(config.compose()),
        Algorithm::SeedPg(_) | Algorithm::Random => None,
    }
}

/// Says which parameters of a value-based learner contradict each other.
pub(in crate::agent) fn check(
    learning: &Learning,
    bonus: &Located<Bonus>,
) -> Result<(), Complaint> {
    if learning.hidden.is_empty() {
        return Err(learning
            .hidden
            .complain("names no layer; expected at least one, such as `hidden: [50, 50]`"));
    }
    if learning.minibatch.get() > learning.replay.get() {
        let message = format!(
            "is more than the {} transitions of `replay`, so that nothing would be learned",
            learning.replay.get()
        );
        return Err(learning.minibatch.complain(message));
    }
    if bonus.is_independent() {
        return Err(bonus.complain(
            "value models learn from the team's transitions; expected `model: Shared` or `Frozen`",
        ));
    }
    Ok(())
}

impl QLearning {
    pub(super) fn compose(&self, agents: usize) -> Composition {
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
}

impl SeedTd {
    pub(super) fn compose(&self, agents: usize) -> Composition {
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

    /// Says what learns only at the end of a round.
    pub(in crate::agent) fn check_lockstep(&self) -> Result<(), Complaint> {
        match *self.fit {
            Fit::Lsvi { .. } => Err(self
                .fit
                .complain("`Lsvi` fits a model anew at the end of a round; expected `schedule: Synchronous(…)`, or `fit: Td`")),
            Fit::Td => Ok(()),
        }
    }
}

impl BootstrappedDqn {
    pub(super) fn compose(&self) -> Composition {
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
    pub(in crate::agent) fn with_actions(self, actions: ActionSelection) -> Self {
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
