//! What an agent takes for the truth before it acts: seed sampling, and controls that each lack
//! something of it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::seed::RewardSeeds;
use seedbed_env::input::numbers::{Fraction, NonNegative, known};
use seedbed_learn::algorithms::catalogue::{Choice, choices};

/// How agents explore.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Algorithm {
    /// Each agent's own fixed seed makes an MDP of the latest belief: adaptive, committed, diverse.
    SeedSampling {
        /// How seeds turn beliefs about rewards into numbers.
        #[serde(default)]
        rewards: RewardSeeds,
    },
    /// Each agent draws an MDP from the latest belief before every action: without commitment.
    ThompsonResampling,
    /// All agents have the same seed: without diversity.
    SharedSeed {
        /// How the seed turns beliefs about rewards into numbers.
        #[serde(default)]
        rewards: RewardSeeds,
    },
    /// Each agent draws an MDP from the belief when its episode begins, and keeps it to the end
    /// (PSRL): without adaptivity.
    SampleOnce,
    /// All agents take the best MDP that is likely enough, before every action (concurrent UCRL):
    /// without diversity.
    Ucrl {
        /// How many standard deviations count as likely enough.
        #[serde(default = "default_width")]
        width: NonNegative,
    },
    /// All agents take the mean of the belief for the truth, but act at random now and then.
    EpsilonGreedy {
        /// How often an action is random.
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
    /// Every algorithm as it is written, with what it is for.
    #[must_use]
    pub fn catalogue() -> Vec<Choice> {
        choices::<Self>()
    }

    /// Its name in files.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::SeedSampling { .. } => "SeedSampling",
            Self::ThompsonResampling => "ThompsonResampling",
            Self::SharedSeed { .. } => "SharedSeed",
            Self::SampleOnce => "SampleOnce",
            Self::Ucrl { .. } => "Ucrl",
            Self::EpsilonGreedy { .. } => "EpsilonGreedy",
            Self::Random => "Random",
        }
    }
}

fn default_width() -> NonNegative {
    known(2.0)
}

fn default_epsilon() -> Fraction {
    known(0.1)
}
