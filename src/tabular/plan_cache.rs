//! Optimal policies that several agents share.

use super::planner::Policy;
use seedbed_env::tabular::{Mdp, Model, Prior};

/// One policy for each combination of the unknown signs, in models in which nothing else is
/// unknown.
pub(super) struct PlanCache {
    /// Policies, indexed by the signs as binary digits; `None` until the policy is needed:
    /// `[2^signs]`, or empty if the cache is not used.
    pub(super) policies: Vec<Option<Policy>>,
}

/// Max number of unknown signs for which the cache is used.
const MAX_SIGNS: usize = 8;

impl PlanCache {
    /// An empty cache.
    pub(super) fn new(model: &Model) -> Self {
        let has_only_signs = model.parameters.iter().all(|prior| *prior == Prior::Sign);
        let is_deterministic = model.outcomes().len() == model.pair_count();
        let signs = model.parameters.len();
        let is_used = has_only_signs && is_deterministic && signs <= MAX_SIGNS;
        Self {
            policies: vec![None; if is_used { 1 << signs } else { 0 }],
        }
    }

    /// Index of the policy for an MDP. `None` if the cache is not used, or if a sign is neither −1
    /// nor 1, as in a posterior mean.
    pub(super) fn index(&self, mdp: &Mdp) -> Option<usize> {
        let mut index = 0;
        for value in &mdp.values {
            index = match *value {
                1.0 => 2 * index + 1,
                -1.0 => 2 * index,
                _ => return None,
            };
        }
        (index < self.policies.len()).then_some(index)
    }
}
