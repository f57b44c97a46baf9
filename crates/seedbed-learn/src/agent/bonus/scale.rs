//! The settings that all bonuses have: whose experience they learn from, and how gains are scaled.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::rl::information_gain;
use seedbed_input::numbers::{Count, Fraction, NonNegative, Positive, ranged_count, ranged_number};

/// Whose experience a bonus model learns from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum ModelSharing {
    /// The experience of the team: one model for all agents.
    #[default]
    Shared,
    /// The agent's own experience: one model per agent.
    Independent,
    /// No experience: the model keeps its initial parameters. A control for experiments.
    Frozen,
}

/// How a gain I is scaled to a bonus.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum BonusScale {
    /// η min(c, I / mean of the latest medians): gains decrease by orders of magnitude as a model
    /// learns, and have a heavy tail. There is no bonus in the first round, which has no median
    /// yet.
    Median {
        /// Weight η of the bonus.
        #[serde(default = "default_weight")]
        weight: NonNegative,
        /// Maximal gain c, in units of the median gain.
        #[serde(default = "default_cap")]
        cap: Positive,
        /// Number of latest updates over which the median gain is averaged.
        #[serde(default = "default_medians")]
        medians: Count<10_000>,
        /// Weight of agent 0 as a share of η. Those of the others are evenly spaced up to η of the last one: a
        /// ladder of weights, as in Badia et al. 2020. An agent alone has η.
        #[serde(default = "default_lowest")]
        lowest: Fraction,
    },
    /// η I, as printed in thesis Eq. 28.
    Raw {
        /// Weight η of the bonus.
        #[serde(default = "default_weight")]
        weight: NonNegative,
        /// Upper end of the axis of bonuses in figures.
        #[serde(default = "default_shown")]
        shown: Positive,
        /// Weight of agent 0 as a share of η. Those of the others are evenly spaced up to η of the last one: a
        /// ladder of weights, as in Badia et al. 2020. An agent alone has η.
        #[serde(default = "default_lowest")]
        lowest: Fraction,
    },
}

impl Default for BonusScale {
    fn default() -> Self {
        Self::Median {
            weight: default_weight(),
            cap: default_cap(),
            medians: default_medians(),
            lowest: default_lowest(),
        }
    }
}

impl BonusScale {
    /// The bonus of a gain. `median` is the mean of the latest medians, none before the first
    /// update.
    pub(super) fn bonus(self, gain: f32, median: Option<f32>) -> f32 {
        match self {
            Self::Median { weight, cap, .. } => {
                information_gain::bonus(gain, median, cap.get_f32(), weight.get_f32())
            }
            Self::Raw { weight, .. } => weight.get_f32() * gain,
        }
    }

    /// Factor on the weight of agent `agent` of `agents`: 1 without a ladder.
    pub(super) fn weight_share(self, agent: u32, agents: u32) -> f32 {
        let (Self::Median { lowest, .. } | Self::Raw { lowest, .. }) = self;
        let place = if agents > 1 {
            f64::from(agent) / f64::from(agents - 1)
        } else {
            1.0
        };
        (lowest.get() + (1.0 - lowest.get()) * place) as f32
    }

    /// The largest bonus that figures show: the largest that is possible, if there is one.
    pub(super) fn largest_shown(self) -> f32 {
        match self {
            Self::Median { weight, cap, .. } => weight.get_f32() * cap.get_f32(),
            Self::Raw { shown, .. } => shown.get_f32(),
        }
    }

    /// Whether bonuses depend on the latest medians.
    pub(super) fn uses_medians(self) -> bool {
        matches!(self, Self::Median { .. })
    }

    /// Number of latest updates over which the median gain is averaged.
    pub(super) fn medians(self) -> usize {
        match self {
            Self::Median { medians, .. } => medians.get() as usize,
            Self::Raw { .. } => 1,
        }
    }
}

fn default_weight() -> NonNegative {
    ranged_number(1e-3)
}

fn default_cap() -> Positive {
    ranged_number(10.0)
}

fn default_medians() -> Count<10_000> {
    ranged_count(10)
}

fn default_lowest() -> Fraction {
    ranged_number(1.0)
}

fn default_shown() -> Positive {
    ranged_number(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From a quarter of the weight up to all of it in four even steps; an agent alone has all of it.
    #[test]
    fn a_ladder_of_weights() {
        let scale = |lowest| BonusScale::Raw {
            weight: ranged_number(1.0),
            shown: ranged_number(1.0),
            lowest: ranged_number(lowest),
        };
        let shares = [0, 1, 2, 3].map(|agent| scale(0.25).weight_share(agent, 4));
        assert_eq!(shares, [0.25, 0.5, 0.75, 1.0]);
        assert_eq!(scale(0.25).weight_share(0, 1), 1.0);
        assert_eq!(scale(1.0).weight_share(0, 4), 1.0);
    }
}
