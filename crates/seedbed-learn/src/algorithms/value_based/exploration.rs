//! Exploration: how an action is chosen from the values of all choices (thesis §1.4.2).

use rand::{Rng, RngExt};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::rl::{categorical, q_learning};
use seedbed_env::input::numbers::{Count, Fraction, Positive};

/// How an action is chosen from values.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Exploration {
    /// The action with the largest value; the first one of several with the same value.
    Greedy,
    /// With probability ε a uniformly random action, otherwise the one with the largest value.
    EpsilonGreedy {
        /// Initial ε.
        from: Fraction,
        /// Final ε.
        to: Fraction,
        /// Number of steps of each agent over which ε changes linearly.
        steps: Count<1_000_000_000>,
    },
    /// An action drawn with probabilities proportional to exp(Q/τ).
    Gibbs {
        /// Temperature τ, in units of Q.
        temperature: Positive,
    },
}

impl Exploration {
    /// Replaces values by log-probabilities.   `steps`: of each agent so far, `values: [choices]`
    pub(super) fn log_probs(self, steps: u64, values: &mut [f32]) {
        match self {
            Self::Greedy => q_learning::epsilon_greedy(values, 0.0),
            Self::EpsilonGreedy { .. } => q_learning::epsilon_greedy(values, self.epsilon(steps)),
            Self::Gibbs { temperature } => q_learning::gibbs(values, temperature.get_f32()),
        }
    }

    /// Draws a choice; returns its index and its log-probability.   `steps`: of each agent so far,
    /// `values: [choices]`, overwritten
    pub(super) fn choose(
        self,
        steps: u64,
        values: &mut [f32],
        random: &mut impl Rng,
    ) -> (usize, f32) {
        self.log_probs(steps, values);
        let choice = categorical::choose(values, random.random());
        (choice, values[choice])
    }

    /// ε after `steps_so_far` of each agent; 0 for other kinds of exploration.
    fn epsilon(self, steps_so_far: u64) -> f32 {
        let Self::EpsilonGreedy { from, to, steps } = self else {
            return 0.0;
        };
        let progress = (steps_so_far as f64 / f64::from(steps.get())).min(1.0);
        (from.get() + progress * (to.get() - from.get())) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::input::numbers::{ranged_count, ranged_number};
    use seedbed_env::random::{Purpose, stream};

    /// ε from 1 to 0.2 over 100 steps: 1, 0.6, 0.2, 0.2.
    #[test]
    fn epsilon_changes_linearly() {
        let exploration = Exploration::EpsilonGreedy {
            from: ranged_number(1.0),
            to: ranged_number(0.2),
            steps: ranged_count(100),
        };
        let epsilons = [0, 50, 100, 9999].map(|steps| exploration.epsilon(steps));
        assert!(
            epsilons
                .iter()
                .zip([1.0, 0.6, 0.2, 0.2])
                .all(|(epsilon, expected)| (epsilon - expected).abs() < 1e-6),
            "{epsilons:?}"
        );
    }

    /// Tolerances are four standard errors of 4,000 draws: 4 √(4000 p (1 − p)), at most 127.
    #[test]
    fn frequencies_of_choices_match_their_probabilities() {
        let epsilon_greedy = Exploration::EpsilonGreedy {
            from: ranged_number(0.3),
            to: ranged_number(0.3),
            steps: ranged_count(1),
        };
        let gibbs = Exploration::Gibbs {
            temperature: ranged_number(0.5),
        };
        for (exploration, expected) in [
            (Exploration::Greedy, [0.0, 0.0, 1.0]),
            (epsilon_greedy, [0.1, 0.1, 0.8]),
            (gibbs, [0.016, 0.117, 0.867]),
        ] {
            let (mut random, mut counts) = (stream(1, Purpose::Action, 0, 0), [0.0; 3]);
            for _ in 0..4000 {
                let (choice, log_prob) = exploration.choose(7, &mut [0.0, 1.0, 2.0], &mut random);
                assert!((f64::from(log_prob).exp() - expected[choice]).abs() < 1e-3);
                counts[choice] += 1.0;
            }
            let all_close = counts
                .iter()
                .zip(expected)
                .all(|(count, share)| (count - 4000.0 * share).abs() < 127.0);
            assert!(all_close, "{exploration:?}: {counts:?}");
        }
    }
}
