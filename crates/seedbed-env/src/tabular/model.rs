//! The tables of a task: the actions of each state, their next states and rewards, and the prior
//! over unknown rewards and transitions.

use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use seedbed_random::Stream;

/// The known part of a task: its tables, and the prior over the unknown parameters.
///
/// A *pair* is a state with one of its actions, an *outcome* a pair with one of its possible next
/// states. States without actions are terminal.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// State in which episodes start.
    pub start: u32,
    /// Horizon H: maximum number of actions in an episode.
    pub horizon: u32,
    /// Coordinates by which states are observed and drawn.
    pub coordinates: Vec<Coordinate>,
    /// Coordinates of each state: `[states × coordinates]`.
    pub state_coordinates: Vec<f32>,
    /// Priors of the unknown parameters θ of the rewards, one per parameter.
    pub parameters: Vec<Prior>,
    /// Concentration α₀ of the symmetric Dirichlet prior over the outcomes of a pair that has
    /// several.
    pub outcome_weight: f64,
    /// Index of each state's first pair, then the number of pairs: `[states + 1]`.
    pub(super) first_pair: Vec<u32>,
    /// Index of each pair's first outcome, then the number of outcomes: `[pairs + 1]`.
    pub(super) first_outcome: Vec<u32>,
    pub(super) outcomes: Vec<Outcome>,
}

/// One coordinate of states.
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinate {
    /// Name, for example `row`.
    pub name: &'static str,
    /// Maximum; the minimum is 0.
    pub max: f32,
}

/// A possible next state of a pair, with its reward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Next state.
    pub state: u32,
    /// Reward of the transition.
    pub reward: Reward,
}

/// A mean reward: known part + factor · θ, where θ is an unknown parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reward {
    /// Known part.
    pub known: f64,
    /// Index of the unknown parameter and its factor, if there is an unknown part.
    pub unknown: Option<(u32, f64)>,
}

/// Prior of a parameter θ, and how it is observed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Prior {
    /// θ is −1 or 1 with equal probability, and observed exactly.
    Sign,
    /// θ ~ N(mean, deviation²), observed as θ + N(0, noise²).
    Normal {
        /// The mean.
        mean: f64,
        /// The standard deviation.
        deviation: f64,
        /// The standard deviation of one observation.
        noise: f64,
    },
    /// ln θ ~ N(mean, deviation²), observed as a number whose logarithm is N(ln θ − noise²/2,
    /// noise²), so that its mean is θ.
    LogNormal {
        /// The mean of the logarithm.
        mean: f64,
        /// Its standard deviation.
        deviation: f64,
        /// The standard deviation of the logarithm of one observation.
        noise: f64,
    },
}

/// Values of the unknown parameters of a [`Model`]: those of the true MDP, or of one that an agent
/// has sampled.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mdp {
    /// Value of each parameter θ: `[parameters]`.
    pub values: Vec<f64>,
    /// Probability of each outcome, given its pair: `[outcomes]`.
    pub probabilities: Vec<f64>,
}

impl Model {
    /// A model whose state s has the actions `actions[s]`, each a list of outcomes. It has no
    /// unknown parameters and no coordinates yet.
    #[must_use]
    pub fn new(start: u32, horizon: u32, actions: &[Vec<Vec<Outcome>>]) -> Self {
        let pairs = || actions.iter().flatten();
        Self {
            start,
            horizon,
            coordinates: Vec::new(),
            state_coordinates: Vec::new(),
            parameters: Vec::new(),
            outcome_weight: 1.0,
            first_pair: group_starts(actions.iter().map(Vec::len)),
            first_outcome: group_starts(pairs().map(Vec::len)),
            outcomes: pairs().flatten().copied().collect(),
        }
    }

    /// Number of states.
    #[must_use]
    pub fn state_count(&self) -> usize {
        self.first_pair.len() - 1
    }

    /// The outcomes of all pairs.
    #[must_use]
    pub fn outcomes(&self) -> &[Outcome] {
        &self.outcomes
    }

    /// Number of pairs.
    #[must_use]
    pub fn pair_count(&self) -> usize {
        self.first_outcome.len() - 1
    }

    /// The pairs of a state.
    #[must_use]
    pub fn pairs(&self, state: u32) -> std::ops::Range<usize> {
        self.first_pair[state as usize] as usize..self.first_pair[state as usize + 1] as usize
    }

    /// The outcomes of a pair.
    #[must_use]
    pub fn outcomes_of(&self, pair: usize) -> std::ops::Range<usize> {
        self.first_outcome[pair] as usize..self.first_outcome[pair + 1] as usize
    }

    /// Maximum number of actions in a state.
    #[must_use]
    pub fn max_actions(&self) -> usize {
        (0..self.state_count())
            .map(|state| self.pairs(state as u32).len())
            .max()
            .unwrap_or(0)
    }

    /// The coordinates of a state: `[coordinates]`.
    #[must_use]
    pub fn coordinates_of(&self, state: u32) -> &[f32] {
        let width = self.coordinates.len();
        &self.state_coordinates[state as usize * width..][..width]
    }

    /// Mean reward of an outcome, given the values of θ.
    #[must_use]
    pub fn mean_reward(&self, outcome: usize, values: &[f64]) -> f64 {
        let Reward { known, unknown } = self.outcomes[outcome].reward;
        known
            + unknown.map_or(0.0, |(parameter, factor)| {
                factor * values[parameter as usize]
            })
    }

    /// Draws θ from its prior, for a model with deterministic transitions.
    ///
    /// # Panics
    /// If a pair has several outcomes.
    #[must_use]
    pub fn draw_mdp(&self, random: &mut Stream) -> Mdp {
        assert_eq!(
            self.outcomes.len(),
            self.pair_count(),
            "one outcome per pair"
        );
        let normal = || StandardNormal.sample(random);
        let normals: Vec<f64> = std::iter::repeat_with(normal)
            .take(self.parameters.len())
            .collect();
        let values = self
            .parameters
            .iter()
            .zip(&normals)
            .map(|(prior, &normal)| prior.quantile(normal))
            .collect();
        Mdp {
            values,
            probabilities: vec![1.0; self.outcomes.len()],
        }
    }

    /// Samples an outcome of a pair in `true_mdp`.
    #[must_use]
    pub fn sample_outcome(&self, true_mdp: &Mdp, pair: usize, random: &mut Stream) -> usize {
        let outcomes = self.outcomes_of(pair);
        let last = outcomes.end - 1;
        if outcomes.len() == 1 {
            return last;
        }
        let mut remaining: f64 = random.random();
        let mut is_reached = |outcome: &usize| {
            remaining -= true_mdp.probabilities[*outcome];
            remaining < 0.0
        };
        (outcomes.start..last)
            .find(|outcome| is_reached(outcome))
            .unwrap_or(last)
    }

    /// Samples an observation of the outcome's parameter θ in `true_mdp`; 0 if it has none.
    #[must_use]
    pub fn observe(&self, true_mdp: &Mdp, outcome: usize, random: &mut Stream) -> f64 {
        let Some((parameter, _)) = self.outcomes[outcome].reward.unknown else {
            return 0.0;
        };
        self.parameters[parameter as usize].observe(true_mdp.values[parameter as usize], random)
    }

    /// Reward of an outcome: its known part plus its factor times the observed θ.
    #[must_use]
    pub fn reward(&self, outcome: usize, observed: f64) -> f64 {
        let Reward { known, unknown } = self.outcomes[outcome].reward;
        known + unknown.map_or(0.0, |(_, factor)| factor * observed)
    }
}

impl Reward {
    /// A known reward.
    #[must_use]
    pub fn known(known: f64) -> Self {
        Self {
            known,
            unknown: None,
        }
    }

    /// An unknown reward: θ of a parameter times `factor`.
    #[must_use]
    pub fn unknown(parameter: u32, factor: f64) -> Self {
        Self {
            known: 0.0,
            unknown: Some((parameter, factor)),
        }
    }
}

impl Prior {
    /// θ at the quantile of a standard normal number: if `normal` is drawn from N(0, 1), the result
    /// is distributed as the prior.
    #[must_use]
    pub fn quantile(self, normal: f64) -> f64 {
        match self {
            Self::Sign => normal.signum(),
            Self::Normal {
                mean, deviation, ..
            } => mean + deviation * normal,
            Self::LogNormal {
                mean, deviation, ..
            } => libm::exp(mean + deviation * normal),
        }
    }

    /// Samples an observation of θ = `value`.
    #[must_use]
    pub fn observe(self, value: f64, random: &mut Stream) -> f64 {
        let mut normal = || -> f64 { StandardNormal.sample(random) };
        match self {
            Self::Sign => value,
            Self::Normal { noise, .. } | Self::LogNormal { noise, .. } if noise == 0.0 => value,
            Self::Normal { noise, .. } => value + noise * normal(),
            Self::LogNormal { noise, .. } => {
                value * libm::exp(noise * normal() - 0.5 * noise * noise)
            }
        }
    }
}

/// The start index of each group in a sequence of groups of these lengths, then the end of the last
/// one.
fn group_starts(lengths: impl Iterator<Item = usize>) -> Vec<u32> {
    let mut end = 0;
    let ends = lengths.map(|length| {
        end += length as u32;
        end
    });
    std::iter::once(0).chain(ends).collect()
}
