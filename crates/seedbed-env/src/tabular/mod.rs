//! Tabular tasks: finite Markov decision processes with a prior over what is unknown about them.
//!
//! A file names a [`TaskFamily`]. [`TaskFamily::model`] returns a [`Model`]: what all MDPs of the
//! family have in common and every agent knows. [`TaskFamily::draw_mdp`] draws one [`Mdp`] from the
//! prior. A [`TabularTask`] can be built as an [`Environment`](crate::Environment) for agents that
//! do not know the model. This module must not depend on beliefs or planning.

mod bipolar_chain;
mod deep_sea;
mod environment;
pub(crate) mod file;
mod maximum_reward_path;
mod model;
mod parallel_chains;

use serde::{Deserialize, Serialize};

pub use bipolar_chain::BipolarChain;
pub use deep_sea::DeepSea;
pub(crate) use environment::TabularEnvironment;
pub use environment::{StateEncoding, TabularTask};
pub use maximum_reward_path::MaximumRewardPath;
pub use model::{Coordinate, Mdp, Model, Outcome, Prior, Reward};
pub use parallel_chains::ParallelChains;

use seedbed_random::{Purpose, Stream, stream};

/// A family of tabular tasks, from which a run draws one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum TaskFamily {
    /// A chain with a reward at one end and a penalty at the other.
    BipolarChain(BipolarChain),
    /// Parallel chains with a reward at the end of each; the first action chooses the chain.
    ParallelChains(ParallelChains),
    /// Walks on a random graph with a reward for each edge.
    MaximumRewardPath(MaximumRewardPath),
    /// A grid in which only one of 2ᴺ action sequences reaches the reward.
    DeepSea(DeepSea),
}

impl TaskFamily {
    /// The known part of the family's tasks, for the run with this run seed.
    #[must_use]
    pub fn model(&self, run_seed: u64) -> Model {
        match self {
            Self::BipolarChain(chain) => chain.model(),
            Self::ParallelChains(chains) => chains.model(),
            Self::MaximumRewardPath(path) => path.model(&mut task_stream(run_seed, 0)),
            Self::DeepSea(sea) => sea.model(),
        }
    }

    /// The MDP of the run with this run seed, drawn from the prior.
    #[must_use]
    pub fn draw_mdp(&self, model: &Model, run_seed: u64) -> Mdp {
        let random = &mut task_stream(run_seed, 1);
        match self {
            Self::DeepSea(sea) => sea.draw_mdp(model, random),
            Self::BipolarChain(_) | Self::ParallelChains(_) | Self::MaximumRewardPath(_) => {
                model.draw_mdp(random)
            }
        }
    }

    /// Name of the family in files.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::BipolarChain(_) => "BipolarChain",
            Self::ParallelChains(_) => "ParallelChains",
            Self::MaximumRewardPath(_) => "MaximumRewardPath",
            Self::DeepSea(_) => "DeepSea",
        }
    }
}

fn task_stream(run_seed: u64, part: u32) -> Stream {
    stream(run_seed, Purpose::TabularTask, part, 0)
}
