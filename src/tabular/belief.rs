//! What a team believes of a task after all that its agents have seen: conjugate posteriors, one a
//! parameter and one a pair.

use seedbed_env::tabular::{Model, Prior};

/// The posterior of all that is not known.
#[derive(Clone, Debug, PartialEq)]
pub struct Belief {
    posteriors: Vec<Posterior>,
    /// Observations of each parameter: `[parameters]`.
    sightings: Vec<u32>,
    /// Observations of each outcome: `[outcomes]`.
    counts: Vec<u32>,
    version: u64,
}

/// What is believed of a parameter θ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Posterior {
    /// −1 or 1, as likely as not.
    UnknownSign,
    /// θ was seen.
    Known(f64),
    /// θ, or ln θ where the prior is log-normal, is N(mean, variance).
    Gaussian {
        /// μ.
        mean: f64,
        /// σ².
        variance: f64,
    },
}

impl Belief {
    /// The prior.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            posteriors: model
                .parameters
                .iter()
                .map(|&prior| Posterior::of(prior))
                .collect(),
            sightings: vec![0; model.parameters.len()],
            counts: vec![0; model.outcomes().len()],
            version: 0,
        }
    }

    /// Takes in that a pair had this outcome, which showed `seen` of its parameter, if it has one.
    pub fn take_in(&mut self, model: &Model, pair: usize, outcome: usize, seen: f64) {
        if let Some((parameter, _)) = model.outcomes()[outcome].reward.unknown {
            let parameter = parameter as usize;
            let before = self.posteriors[parameter];
            self.posteriors[parameter] = before.after(model.parameters[parameter], seen);
            self.sightings[parameter] += 1;
            self.version += u64::from(before != self.posteriors[parameter]);
        }
        if model.outcomes_of(pair).len() > 1 {
            self.counts[outcome] += 1;
            self.version += 1;
        }
    }

    /// What is believed of a parameter.
    #[must_use]
    pub fn posterior(&self, parameter: usize) -> Posterior {
        self.posteriors[parameter]
    }

    /// How often a parameter was seen.
    #[must_use]
    pub fn sightings(&self, parameter: usize) -> u32 {
        self.sightings[parameter]
    }

    /// How often an outcome was seen.
    #[must_use]
    pub fn count(&self, outcome: usize) -> u32 {
        self.counts[outcome]
    }

    /// Grows whenever the belief changes.
    #[must_use]
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Mean and standard deviation of an outcome's probability: those of a Dirichlet's component, μ
    /// = α / Σα and σ² = μ (1 − μ) / (Σα + 1).
    #[must_use]
    pub fn likelihood(&self, model: &Model, pair: usize, outcome: usize) -> (f64, f64) {
        let outcomes = model.outcomes_of(pair);
        if outcomes.len() == 1 {
            return (1.0, 0.0);
        }
        let weight = |outcome: usize| model.outcome_weight + f64::from(self.counts[outcome]);
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

    /// After one more observation y of variance s²: 1/σ² ← 1/σ² + 1/s² and μ/σ² ← μ/σ² + y/s².
    fn after(self, prior: Prior, seen: f64) -> Self {
        let (y, noise) = match prior {
            Prior::Sign => return Self::Known(seen),
            Prior::Normal { noise, .. } | Prior::LogNormal { noise, .. } if noise == 0.0 => {
                return Self::Known(seen);
            }
            Prior::Normal { noise, .. } => (seen, noise * noise),
            Prior::LogNormal { noise, .. } => {
                (libm::log(seen) + 0.5 * noise * noise, noise * noise)
            }
        };
        let Self::Gaussian { mean, variance } = self else {
            return self;
        };
        let total = variance + noise;
        Self::Gaussian {
            mean: (noise * mean + variance * y) / total,
            variance: variance * noise / total,
        }
    }

    /// θ at the quantile where a standard normal number is `normal`: distributed as the posterior
    /// if that is.
    #[must_use]
    pub fn quantile(self, prior: Prior, normal: f64) -> f64 {
        match self {
            Self::UnknownSign => normal.signum(),
            Self::Known(value) => value,
            Self::Gaussian { mean, variance } => from_scale(prior, mean + variance.sqrt() * normal),
        }
    }

    /// The mean of θ.
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

/// θ of a number on the scale of its prior's Gaussian.
pub(super) fn from_scale(prior: Prior, number: f64) -> f64 {
    if matches!(prior, Prior::LogNormal { .. }) {
        libm::exp(number)
    } else {
        number
    }
}
