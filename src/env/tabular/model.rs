//! Tables: which actions a state has, where they may lead, what that earns, and what of it is known.

use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use crate::random::Stream;

/// What everybody knows of a task: its tables, and the prior of what is not known.
///
/// A *pair* is a state with one of its actions, an *outcome* a pair with one of the states that it may lead to. States without
/// actions end an episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Where episodes start.
    pub start: u32,
    /// H: actions after which an episode ends at the latest.
    pub horizon: u32,
    /// What the places of states are called.
    pub coordinates: Vec<Coordinate>,
    /// Where each state is, for pictures and for observations: `[states × coordinates]`.
    pub places: Vec<f32>,
    /// What is not known about rewards: `[parameters]`.
    pub parameters: Vec<Prior>,
    /// Prior weight α₀ of each outcome of a pair that has several, if transitions are not known (Dirichlet).
    pub outcome_weight: f64,
    /// The first pair of each state, then the number of pairs: `[states + 1]`.
    pub(super) first_pair: Vec<u32>,
    /// The first outcome of each pair, then the number of outcomes: `[pairs + 1]`.
    pub(super) first_outcome: Vec<u32>,
    pub(super) outcomes: Vec<Outcome>,
}

/// One coordinate of the places of states.
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinate {
    /// Such as `row`.
    pub name: &'static str,
    /// The largest value; the least is 0.
    pub largest: f32,
}

/// Where a pair may lead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// The next state.
    pub state: u32,
    /// What it earns.
    pub reward: Reward,
}

/// A mean reward: known + factor · θ of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reward {
    /// The known part.
    pub known: f64,
    /// The index of what is not known, if something is, and its factor.
    pub unknown: Option<(u32, f64)>,
}

/// What is believed of a parameter θ at the outset, and how it shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Prior {
    /// θ is −1 or 1, as likely as not, and seen exactly.
    Sign,
    /// θ ~ N(mean, deviation²), seen as θ + N(0, noise²).
    Normal {
        /// The mean.
        mean: f64,
        /// The standard deviation.
        deviation: f64,
        /// The standard deviation of one observation.
        noise: f64,
    },
    /// ln θ ~ N(mean, deviation²), seen as a number whose logarithm is N(ln θ − noise²/2, noise²), so that its mean is θ.
    LogNormal {
        /// The mean of the logarithm.
        mean: f64,
        /// Its standard deviation.
        deviation: f64,
        /// The standard deviation of the logarithm of one observation.
        noise: f64,
    },
}

/// All that a [`Model`] leaves open: the truth, or what an agent takes for it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mdp {
    /// θ: `[parameters]`.
    pub values: Vec<f64>,
    /// How likely each outcome of its pair is: `[outcomes]`.
    pub probabilities: Vec<f64>,
}

impl Model {
    /// A task whose state s has `actions[s]`, each a list of outcomes. Nothing is unknown yet, and all states are in one place.
    #[must_use]
    pub fn new(start: u32, horizon: u32, actions: &[Vec<Vec<Outcome>>]) -> Self {
        let pairs = || actions.iter().flatten();
        Self {
            start,
            horizon,
            coordinates: Vec::new(),
            places: Vec::new(),
            parameters: Vec::new(),
            outcome_weight: 1.0,
            first_pair: starts(actions.iter().map(Vec::len)),
            first_outcome: starts(pairs().map(Vec::len)),
            outcomes: pairs().flatten().copied().collect(),
        }
    }

    /// Number of states.
    #[must_use]
    pub fn states(&self) -> usize {
        self.first_pair.len() - 1
    }

    /// The outcomes of all pairs.
    #[must_use]
    pub fn outcomes(&self) -> &[Outcome] {
        &self.outcomes
    }

    /// Number of pairs of all states.
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

    /// The most actions that a state has.
    #[must_use]
    pub fn most_actions(&self) -> usize {
        (0..self.states())
            .map(|state| self.pairs(state as u32).len())
            .max()
            .unwrap_or(0)
    }

    /// Where a state is: `[coordinates]`.
    #[must_use]
    pub fn place(&self, state: u32) -> &[f32] {
        let width = self.coordinates.len();
        &self.places[state as usize * width..][..width]
    }

    /// The mean reward of an outcome where θ is `values`.
    #[must_use]
    pub fn mean_reward(&self, outcome: usize, values: &[f64]) -> f64 {
        let Reward { known, unknown } = self.outcomes[outcome].reward;
        known
            + unknown.map_or(0.0, |(parameter, factor)| {
                factor * values[parameter as usize]
            })
    }

    /// An MDP from the prior of θ, whose transitions are all sure.
    ///
    /// # Panics
    /// If a pair has several outcomes.
    #[must_use]
    pub fn draw(&self, random: &mut Stream) -> Mdp {
        assert_eq!(self.outcomes.len(), self.pair_count(), "one outcome a pair");
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

    /// The outcome that `pair` has in `truth`.
    #[must_use]
    pub fn sample(&self, truth: &Mdp, pair: usize, random: &mut Stream) -> usize {
        let outcomes = self.outcomes_of(pair);
        let last = outcomes.end - 1;
        if outcomes.len() == 1 {
            return last;
        }
        let mut rest: f64 = random.random();
        let mut reached = |outcome: &usize| {
            rest -= truth.probabilities[*outcome];
            rest < 0.0
        };
        (outcomes.start..last)
            .find(|outcome| reached(outcome))
            .unwrap_or(last)
    }

    /// What an outcome shows of its parameter's θ in `truth`; 0 where there is nothing to see.
    #[must_use]
    pub fn observe(&self, truth: &Mdp, outcome: usize, random: &mut Stream) -> f64 {
        let Some((parameter, _)) = self.outcomes[outcome].reward.unknown else {
            return 0.0;
        };
        self.parameters[parameter as usize].observe(truth.values[parameter as usize], random)
    }

    /// The reward of an outcome that showed `seen` of its θ.
    #[must_use]
    pub fn reward(&self, outcome: usize, seen: f64) -> f64 {
        let Reward { known, unknown } = self.outcomes[outcome].reward;
        known + unknown.map_or(0.0, |(_, factor)| factor * seen)
    }
}

impl Reward {
    /// A reward that everybody knows.
    #[must_use]
    pub fn known(known: f64) -> Self {
        Self {
            known,
            unknown: None,
        }
    }

    /// θ of a parameter times `factor`.
    #[must_use]
    pub fn unknown(parameter: u32, factor: f64) -> Self {
        Self {
            known: 0.0,
            unknown: Some((parameter, factor)),
        }
    }
}

impl Prior {
    /// θ at the quantile where a standard normal number is `normal`: distributed as the prior if that is.
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

    /// One observation of θ = `value`.
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

/// Where each group begins in a row of groups of these lengths, and where the last ends.
fn starts(lengths: impl Iterator<Item = usize>) -> Vec<u32> {
    let mut end = 0;
    let ends = lengths.map(|length| {
        end += length as u32;
        end
    });
    std::iter::once(0).chain(ends).collect()
}
