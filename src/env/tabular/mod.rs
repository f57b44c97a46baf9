//! Finite tasks: states, actions and a horizon in tables, and a prior of what a team does not know at the outset.
//!
//! A [`Task`] is what a file says; [`Task::model`] makes of it a [`Model`], what everybody knows, and [`Task::draw`] an [`Mdp`], the
//! truth, drawn from the prior. [`environment`] lets agents with networks act in it. Beliefs and planning may not enter.

mod bipolar_chain;
mod deep_sea;
pub mod environment;
pub mod file;
mod maximum_reward_path;
mod model;
mod parallel_chains;

use serde::{Deserialize, Serialize};

pub use bipolar_chain::BipolarChain;
pub use deep_sea::DeepSea;
pub use maximum_reward_path::MaximumRewardPath;
pub use model::{Coordinate, Mdp, Model, Outcome, Prior, Reward};
pub use parallel_chains::ParallelChains;

use crate::random::{Purpose, Stream, stream};

/// A family of finite tasks, one of which a run draws.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Task {
    /// A chain with treasure at one end and a trap at the other.
    BipolarChain(BipolarChain),
    /// Chains of which one has to be chosen, with a reward at the end of each.
    ParallelChains(ParallelChains),
    /// A walk along the edges of a random graph, each with its own reward.
    MaximumRewardPath(MaximumRewardPath),
    /// A grid in which only one of 2ᴺ action sequences finds the treasure.
    DeepSea(DeepSea),
}

impl Task {
    /// What everybody knows of the task of run `seed`.
    #[must_use]
    pub fn model(&self, seed: u64) -> Model {
        match self {
            Self::BipolarChain(chain) => chain.model(),
            Self::ParallelChains(chains) => chains.model(),
            Self::MaximumRewardPath(path) => path.model(&mut task_stream(seed, 0)),
            Self::DeepSea(sea) => sea.model(),
        }
    }

    /// The truth of run `seed`, drawn from the prior.
    #[must_use]
    pub fn draw(&self, model: &Model, seed: u64) -> Mdp {
        let random = &mut task_stream(seed, 1);
        match self {
            Self::DeepSea(sea) => sea.draw(model, random),
            Self::BipolarChain(_) | Self::ParallelChains(_) | Self::MaximumRewardPath(_) => {
                model.draw(random)
            }
        }
    }

    /// Its name in files.
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

fn task_stream(seed: u64, part: u32) -> Stream {
    stream(seed, Purpose::TabularTask, part, 0)
}
