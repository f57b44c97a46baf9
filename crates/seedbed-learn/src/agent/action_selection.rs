//! How actions are chosen from a policy's distribution.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::rl::correlated_noise::{CorrelatedNoise, Correlation};
use seedbed_env::TaskSpec;
use seedbed_input::numbers::Positive;

/// How an action is chosen from the policy's distribution.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ActionSelection {
    /// Sampled from the policy's distribution.
    Sampled,
    /// Sampled from the policy's distribution with noise that is correlated over the steps of an episode: `Pink` (Eberhard
    /// et al. 2023), `OrnsteinUhlenbeck(time: …)` with a correlation time in s (Lillicrap et al. 2016), or `Constant` for the
    /// episode. Importance ratios are those of single actions, as if they were independent. A choice is the one that the
    /// noise's quantile falls on.
    Correlated {
        /// How the noise is correlated.
        noise: ActionNoise,
    },
    /// Sampled from π^{1/τ} / Σ π^{1/τ}, which is 𝒩(μ, τσ²) for a Gaussian. Importance ratios are
    /// relative to this distribution.
    Tempered {
        /// Temperature τ: below 1 is greedier than the policy, above 1 is more random.
        temperature: Positive,
    },
    /// The most likely discrete action, or the mean of a continuous one.
    Greedy,
}

impl ActionSelection {
    /// Whether the noise is correlated over the steps of an episode.
    pub(crate) fn is_correlated(self) -> bool {
        matches!(self, Self::Correlated { noise } if noise != ActionNoise::White)
    }
}

/// How the noise of actions is correlated over the steps of an episode.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ActionNoise {
    /// No correlation: new numbers in each step.
    White,
    /// Pink noise (Eberhard et al. 2023): its power falls with the frequency f as 1/f.
    Pink,
    /// The process of Ornstein and Uhlenbeck (Lillicrap et al. 2016): the correlation falls as exp(−t/time).
    OrnsteinUhlenbeck {
        /// Correlation time, s.
        time: Positive,
    },
    /// One number for a whole episode.
    Constant,
}

impl ActionSelection {
    /// The correlated noise for the actions of a task, if there is any.
    pub(crate) fn noise(self, spec: &TaskSpec) -> Option<CorrelatedNoise> {
        match self {
            Self::Correlated { noise } => Some(noise.for_task(spec)),
            Self::Sampled | Self::Tempered { .. } | Self::Greedy => None,
        }
    }
}

impl fmt::Display for ActionNoise {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::White => formatter.write_str("white"),
            Self::Pink => formatter.write_str("pink"),
            Self::OrnsteinUhlenbeck { time } => {
                write!(formatter, "Ornstein-Uhlenbeck, {} s", time.get())
            }
            Self::Constant => formatter.write_str("one action per episode"),
        }
    }
}

impl ActionNoise {
    /// The noise for the actions of a task.
    #[must_use]
    pub fn for_task(self, spec: &TaskSpec) -> CorrelatedNoise {
        CorrelatedNoise::new(match self {
            Self::White => Correlation::White,
            Self::Pink => Correlation::Pink {
                steps: spec.time_limit,
            },
            Self::OrnsteinUhlenbeck { time } => Correlation::OrnsteinUhlenbeck {
                time: (time.get() / spec.control_step) as f32,
            },
            Self::Constant => Correlation::Constant,
        })
    }
}
