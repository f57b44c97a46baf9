//! Tabular algorithms: seed sampling, and controls that each lack one of the properties of seed
//! sampling.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::seed::RewardSeeds;
use seedbed_input::numbers::{Fraction, NonNegative, ranged_number};
use seedbed_learn::algorithms::catalog::{Choice, choices};

/// How the agents of a tabular scenario explore.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Algorithm {
    /// Each agent plans in the MDP that its own fixed agent seed samples from the latest belief:
    /// adaptive, committed, diverse.
    SeedSampling {
        /// How agent seeds sample rewards from the belief.
        #[serde(default)]
        rewards: RewardSeeds,
    },
    /// Each agent samples a new MDP from the latest belief before every action: without commitment.
    ThompsonResampling,
    /// All agents have the same agent seed: without diversity.
    SharedSeed {
        /// How the agent seed samples rewards from the belief.
        #[serde(default)]
        rewards: RewardSeeds,
    },
    /// Each agent samples an MDP from the belief before the first action of its episode, and keeps it
    /// until the episode ends (PSRL): without adaptivity.
    SampleOnce,
    /// All agents plan in the best MDP within a confidence interval, before every action
    /// (concurrent UCRL): without diversity.
    Ucrl {
        /// Half-width of the confidence interval, in standard deviations of the belief.
        #[serde(default = "default_width")]
        width: NonNegative,
    },
    /// Before every action, agents plan in the mean of the belief with a bonus for rarely chosen actions: β/√(1 + n(s, a))
    /// is added to each reward, where n counts the team's choices of action a in state s (MBIE-EB, Strehl & Littman 2008,
    /// with 1 + n for n and without a model of unknown pairs).
    CountBonus {
        /// Weight β of the bonus, in units of reward.
        #[serde(default = "default_weight")]
        weight: NonNegative,
        /// Whether n also has the choices that the other agents expect to make in the rest of their episodes, as they have
        /// last planned them: an agent that heads for a state counts as having been there, so that others go elsewhere.
        #[serde(default)]
        reservation: bool,
    },
    /// All agents plan in the mean of the belief, and sometimes choose a random action.
    EpsilonGreedy {
        /// Probability of a random action.
        #[serde(default = "default_epsilon")]
        epsilon: Fraction,
    },
    /// All actions are random.
    Random,
}

impl Default for Algorithm {
    fn default() -> Self {
        Self::SeedSampling {
            rewards: RewardSeeds::default(),
        }
    }
}

impl Algorithm {
    /// Every algorithm as it is written in scenarios, with its description.
    #[must_use]
    pub fn catalog() -> Vec<Choice> {
        choices::<Self>()
    }

    /// Name in scenarios and result files.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::SeedSampling { .. } => "SeedSampling",
            Self::ThompsonResampling => "ThompsonResampling",
            Self::SharedSeed { .. } => "SharedSeed",
            Self::SampleOnce => "SampleOnce",
            Self::Ucrl { .. } => "Ucrl",
            Self::CountBonus { .. } => "CountBonus",
            Self::EpsilonGreedy { .. } => "EpsilonGreedy",
            Self::Random => "Random",
        }
    }
}

fn default_width() -> NonNegative {
    ranged_number(2.0)
}

fn default_weight() -> NonNegative {
    ranged_number(1.0)
}

fn default_epsilon() -> Fraction {
    ranged_number(0.1)
}
