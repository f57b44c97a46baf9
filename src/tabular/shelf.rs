//! Plans that several agents use.

use super::plan::Policy;
use seedbed_env::tabular::{Mdp, Model, Prior};

/// A plan for each combination of signs: all that there are where nothing but few signs is unknown.
pub(super) struct Shelf {
    pub(super) plans: Vec<Option<Policy>>,
}

/// More unknown signs than these are not worth a shelf.
const MAX_SIGNS: usize = 8;

impl Shelf {
    pub(super) fn new(model: &Model) -> Self {
        let only_signs = model.parameters.iter().all(|prior| *prior == Prior::Sign);
        let certain = model.outcomes().len() == model.pair_count();
        let signs = model.parameters.len();
        let used = only_signs && certain && signs <= MAX_SIGNS;
        Self {
            plans: vec![None; if used { 1 << signs } else { 0 }],
        }
    }

    /// Where the plan for an MDP stands; none where a sign is neither −1 nor 1, as in the mean of a
    /// belief.
    pub(super) fn slot(&self, mdp: &Mdp) -> Option<usize> {
        let digit = |slot: usize, value: &f64| match *value {
            1.0 => Some(2 * slot + 1),
            -1.0 => Some(2 * slot),
            _ => None,
        };
        let slot = mdp.values.iter().try_fold(0, digit);
        slot.filter(|&slot| slot < self.plans.len())
    }
}
