//! The configuration of HyperAgent: one network for the team, with a fixed index for each agent.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::config::{CommonFields, Composition, Learning, ValueBased, has_common_fields};
use super::exploration::Exploration;
use super::index::{IndexDraw, IndexOwner, IndexSettings, TargetIndex};
use crate::agent::bonus::Bonus;
use seedbed_input::Located;
use seedbed_input::numbers::{Count, NonNegative, ranged_count, ranged_number};

/// HyperAgent (Li, Xu, Han & Luo 2024; epistemic neural networks: Osband et al. 2023) for a team: one
/// network of the values `Q(s, a; ξ) = o₀(s, a) + Σₘ ξₘ (oₘ(s, a) + β pₘ(s, a))`, and agent k acts
/// by its own index `ξ_k`, by default drawn once per run. `p` is a fixed random network. The loss is
/// `½ mean (r + σ zᵀξ + γ max Q′(s′, ·; ξ⁻) − Q(s, a; ξ))²` over transitions and random indices ξ,
/// where z is a fixed random vector of each transition. The cost of learning does not depend on the
/// number of agents. Differences to the paper: agents keep their indices (there: a new one in each
/// episode); ξ⁻ = ξ by default (there: independent); ξ has norm 1 and z norm √M (there, in theory:
/// ξ normal and z of norm 1, which gives the same σ zᵀξ on average); the mean of p over indices is
/// 0; no weight decay.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HyperAgent {
    /// Number of coordinates M of an index.
    pub dimension: Count<1000>,
    /// For whom an index is drawn.
    pub index: IndexOwner,
    /// When it is drawn.
    pub draw: IndexDraw,
    /// Number of indices per transition and gradient step. They need no further passes through
    /// networks.
    pub samples: Count<1000>,
    /// The index ξ⁻ with which the target network evaluates the state after an action.
    pub target_index: TargetIndex,
    /// Standard deviation σ of the perturbation σ zᵀξ of each reward.
    pub sigma: NonNegative,
    /// Scale β of the prior.
    pub prior_scale: NonNegative,
    /// How actions are chosen from values.
    pub exploration: Exploration,
    /// Whether the learning network chooses the action that the target network evaluates.
    pub double: bool,
    /// Parameters that all value-based learners have.
    pub learning: Learning,
    /// Exploration bonus (intrinsic reward) that is added to the rewards of the environment.
    pub bonus: Located<Bonus>,
}

impl Default for HyperAgent {
    fn default() -> Self {
        Self {
            dimension: ranged_count(4),
            index: IndexOwner::Agent,
            draw: IndexDraw::Once,
            samples: ranged_count(20),
            target_index: TargetIndex::Same,
            sigma: ranged_number(0.01),
            prior_scale: ranged_number(3.0),
            exploration: Exploration::Greedy,
            double: true,
            learning: Learning::default(),
            bonus: Bonus::None.into(),
        }
    }
}

has_common_fields!(HyperAgent);

impl ValueBased for HyperAgent {
    fn compose(&self, _: usize) -> Composition {
        Composition {
            index: Some(IndexSettings {
                dimension: self.dimension.get() as usize,
                samples: self.samples.get() as usize,
                sigma: self.sigma.get_f32(),
                target: self.target_index,
                owner: self.index,
                redraw: self.draw,
            }),
            prior_scale: self.prior_scale.get_f32(),
            ..Composition::of_fields(self)
        }
    }
}
