//! A team's posterior over the unknown parts of its task, given all observations of its agents:
//! conjugate posteriors, one per parameter of the rewards and one per state-action pair.

use seedbed_env::tabular::{Model, Prior};

/// Posterior of a team over all unknown parts of a task.
#[derive(Clone, Debug, PartialEq)]
pub struct Belief {
    /// `[parameters]`
    posteriors: Vec<Posterior>,
    /// Number of observations of each parameter: `[parameters]`.
    parameter_counts: Vec<u32>,
    /// Number of observations of each outcome: `[outcomes]`.
    outcome_counts: Vec<u32>,
    version: u64,
}

/// Posterior of a parameter θ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Posterior {
    /// −1 or 1 with equal probability.
    UnknownSign,
    /// θ was observed exactly.
    Known(f64),
    /// θ, or ln θ if the prior is log-normal, is distributed as N(mean, variance).
    Gaussian {
        /// Mean μ.
        mean: f64,
        /// Variance σ².
        variance: f64,
    },
}

impl Belief {
    /// The prior of a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            posteriors: model
                .parameters
                .iter()
                .map(|&prior| Posterior::of(prior))
                .collect(),
            parameter_counts: vec![0; model.parameters.len()],
            outcome_counts: vec![0; model.outcomes().len()],
            version: 0,
        }
    }

    /// Updates the posteriors after a state-action pair had an outcome. If the reward of the
    /// outcome depends on an unknown parameter, `observation` is the observed value of this
    /// parameter.
    pub fn update(&mut self, model: &Model, pair: usize, outcome: usize, observation: f64) {
        if let Some((parameter, _)) = model.outcomes()[outcome].reward.unknown {
            let parameter = parameter as usize;
            let before = self.posteriors[parameter];
            self.posteriors[parameter] = before.updated(model.parameters[parameter], observation);
            self.parameter_counts[parameter] += 1;
            self.version += u64::from(before != self.posteriors[parameter]);
        }
        if model.outcomes_of(pair).len() > 1 {
            self.outcome_counts[outcome] += 1;
            self.version += 1;
        }
    }

    /// Posterior of a parameter.
    #[must_use]
    pub fn posterior(&self, parameter: usize) -> Posterior {
        self.posteriors[parameter]
    }

    /// Number of observations of a parameter.
    #[must_use]
    pub fn parameter_count(&self, parameter: usize) -> u32 {
        self.parameter_counts[parameter]
    }

    /// Number of observations of an outcome.
    #[must_use]
    pub fn outcome_count(&self, outcome: usize) -> u32 {
        self.outcome_counts[outcome]
    }

    /// A number that increases whenever the belief changes.
    #[must_use]
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Posterior mean and standard deviation of an outcome's probability: those of a component of a
    /// Dirichlet distribution, μ = α / Σα and σ² = μ (1 − μ) / (Σα + 1).
    #[must_use]
    pub fn outcome_probability(&self, model: &Model, pair: usize, outcome: usize) -> (f64, f64) {
        let outcomes = model.outcomes_of(pair);
        if outcomes.len() == 1 {
            return (1.0, 0.0);
        }
        let weight =
            |outcome: usize| model.outcome_weight + f64::from(self.outcome_counts[outcome]);
        let total: f64 = outcomes.map(weight).sum();
        let mean = weight(outcome) / total;
        (mean, (mean * (1.0 - mean) / (total + 1.0)).sqrt())
    }
}

impl Posterior {
    fn of(prior: Prior) -> Self {
        match prior {
            Prior::Sign => Self::UnknownSign,
            Prior::Normal {
                mean, deviation, ..
            }
            | Prior::LogNormal {
                mean, deviation, ..
            } => Self::Gaussian {
                mean,
                variance: deviation * deviation,
            },
        }
    }

    /// The posterior after one more observation y with variance s²: 1/σ² ← 1/σ² + 1/s² and
    /// μ/σ² ← μ/σ² + y/s².
    fn updated(self, prior: Prior, observation: f64) -> Self {
        let (y, noise_variance) = match prior {
            Prior::Sign => return Self::Known(observation),
            Prior::Normal { noise, .. } | Prior::LogNormal { noise, .. } if noise == 0.0 => {
                return Self::Known(observation);
            }
            Prior::Normal { noise, .. } => (observation, noise * noise),
            Prior::LogNormal { noise, .. } => {
                (libm::log(observation) + 0.5 * noise * noise, noise * noise)
            }
        };
        let Self::Gaussian { mean, variance } = self else {
            return self;
        };
        let variance_sum = variance + noise_variance;
        Self::Gaussian {
            mean: (noise_variance * mean + variance * y) / variance_sum,
            variance: variance * noise_variance / variance_sum,
        }
    }

    /// The quantile of θ that corresponds to the standard normal quantile `normal`. If `normal` is
    /// drawn from N(0, 1), the result is distributed as the posterior.
    #[must_use]
    pub fn quantile(self, prior: Prior, normal: f64) -> f64 {
        match self {
            Self::UnknownSign => normal.signum(),
            Self::Known(value) => value,
            Self::Gaussian { mean, variance } => {
                from_gaussian_scale(prior, mean + variance.sqrt() * normal)
            }
        }
    }

    /// Posterior mean of θ.
    #[must_use]
    pub fn mean(self, prior: Prior) -> f64 {
        match (self, prior) {
            (Self::UnknownSign, _) => 0.0,
            (Self::Known(value), _) => value,
            (Self::Gaussian { mean, variance }, Prior::LogNormal { .. }) => {
                libm::exp(mean + 0.5 * variance)
            }
            (Self::Gaussian { mean, .. }, _) => mean,
        }
    }
}

/// θ for a number on the scale on which its prior is Gaussian: the logarithmic scale if the prior
/// is log-normal.
pub(super) fn from_gaussian_scale(prior: Prior, number: f64) -> f64 {
    if matches!(prior, Prior::LogNormal { .. }) {
        libm::exp(number)
    } else {
        number
    }
}
