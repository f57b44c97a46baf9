//! Counts of chosen actions that the team shares, with those that agents expect to choose.

/// Choices of each state-action pair.
pub(super) struct SharedCounts {
    /// Number of choices so far: `[pairs]`.
    chosen: Vec<f64>,
    /// Expected number of choices in the rest of the present episodes: `[pairs]`.
    reserved: Vec<f64>,
    /// What each agent added to `reserved`, as pairs with their expected number of choices: `[K][…]`.
    of_agent: Vec<Vec<(usize, f64)>>,
}

impl SharedCounts {
    pub(super) fn new(agents: usize, pairs: usize) -> Self {
        Self {
            chosen: vec![0.0; pairs],
            reserved: vec![0.0; pairs],
            of_agent: vec![Vec::new(); agents],
        }
    }

    /// Counts an action.
    pub(super) fn count(&mut self, pair: usize) {
        self.chosen[pair] += 1.0;
    }

    /// Replaces what an agent has reserved.
    pub(super) fn reserve(&mut self, agent: u32, choices: Vec<(usize, f64)>) {
        self.release(agent);
        for &(pair, expected) in &choices {
            self.reserved[pair] += expected;
        }
        self.of_agent[agent as usize] = choices;
    }

    /// Removes what an agent has reserved.
    pub(super) fn release(&mut self, agent: u32) {
        for (pair, expected) in self.of_agent[agent as usize].drain(..) {
            self.reserved[pair] -= expected;
        }
    }

    /// Computes the bonus β/√(1 + n) of each pair, where n counts choices and what is reserved.
    /// `bonuses: [pairs]`, overwritten
    pub(super) fn bonuses(&self, weight: f64, bonuses: &mut Vec<f64>) {
        bonuses.clear();
        for (chosen, reserved) in self.chosen.iter().zip(&self.reserved) {
            // What was subtracted may differ from what was added by rounding.
            let count = chosen + reserved.max(0.0);
            bonuses.push(weight / (1.0 + count).sqrt());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// β = 2: 2/√1 without choices, 2/√4 after three, and 2/√(1 + 3) with three reserved ones. Three
    /// choices and five reserved ones give 2/√9, and what agents release or replace does not count.
    #[test]
    fn bonuses_by_hand() {
        let mut counts = SharedCounts::new(2, 3);
        (0..3).for_each(|_| counts.count(1));
        let bonuses = |counts: &SharedCounts| {
            let mut bonuses = vec![9.0];
            counts.bonuses(2.0, &mut bonuses);
            bonuses
        };
        assert_eq!(bonuses(&counts), [2.0, 1.0, 2.0]);
        counts.reserve(1, vec![(0, 3.0)]);
        assert_eq!(bonuses(&counts), [1.0, 1.0, 2.0]);
        counts.reserve(0, vec![(1, 5.0), (2, 1.5), (2, 1.5)]);
        assert_eq!(bonuses(&counts), [1.0, 2.0 / 3.0, 1.0]);
        counts.reserve(1, vec![(2, 5.0)]);
        assert_eq!(bonuses(&counts), [2.0, 2.0 / 3.0, 2.0 / 3.0]);
        counts.release(0);
        counts.release(1);
        assert_eq!(bonuses(&counts), [2.0, 1.0, 2.0]);
    }
}
