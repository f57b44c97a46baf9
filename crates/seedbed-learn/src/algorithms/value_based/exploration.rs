//! Exploration: how an action is chosen from the values of all choices (thesis §1.4.2).

use rand::RngExt;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::agent::ActionRandom;
use crate::agent::action_random::draw_duration;
use crate::math;
use crate::rl::{categorical, q_learning};
use seedbed_input::numbers::{Count, Fraction, NonNegative, Positive, ranged_number};

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
    /// εz-greedy (Dabney et al. 2021): as `EpsilonGreedy`, but a random action is repeated for n steps with a
    /// probability in proportion to 1/n², at most to the end of the episode.
    EpsilonZGreedy {
        /// Initial ε.
        from: Fraction,
        /// Final ε.
        to: Fraction,
        /// Number of steps of each agent over which ε changes linearly.
        steps: Count<1_000_000_000>,
    },
    /// A fixed ε for each agent: agent k of K has `ε^(1 + α k/(K − 1))`, and an agent alone has ε
    /// (Horgan et al. 2018).
    EpsilonLadder {
        /// ε of the first agent, the largest one.
        #[serde(default = "default_ladder_epsilon")]
        epsilon: Fraction,
        /// α: the last agent has `ε^(1 + α)`.
        #[serde(default = "default_ladder_exponent")]
        exponent: NonNegative,
    },
    /// An action drawn with probabilities proportional to exp(Q/τ).
    Gibbs {
        /// Temperature τ, in units of Q.
        temperature: Positive,
    },
}

/// The agent that chooses, and when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Chooser {
    /// The agent's number, from 0.
    pub(super) agent: usize,
    /// Number of agents K.
    pub(super) agents: usize,
    /// Number of steps of each agent so far.
    pub(super) steps: u64,
}

fn default_ladder_epsilon() -> Fraction {
    ranged_number(0.4)
}

fn default_ladder_exponent() -> NonNegative {
    ranged_number(7.0)
}

impl Exploration {
    /// Replaces values by log-probabilities.   `values: [choices]`
    pub(super) fn log_probs(self, chooser: Chooser, values: &mut [f32]) {
        match self {
            Self::Gibbs { temperature } => q_learning::gibbs(values, temperature.get_f32()),
            Self::Greedy
            | Self::EpsilonGreedy { .. }
            | Self::EpsilonZGreedy { .. }
            | Self::EpsilonLadder { .. } => {
                q_learning::epsilon_greedy(values, self.epsilon(chooser));
            }
        }
    }

    /// Draws a choice; returns its index and its log-probability.   `values: [choices]`, overwritten
    pub(super) fn choose(
        self,
        chooser: Chooser,
        values: &mut [f32],
        random: &mut ActionRandom,
    ) -> (usize, f32) {
        if let Self::EpsilonZGreedy { .. } = self {
            return self.choose_or_repeat(chooser, values, random);
        }
        self.log_probs(chooser, values);
        let choice = categorical::choose(values, random.stream.random());
        (choice, values[choice])
    }

    /// As [`choose`](Self::choose). A repeated action has the log-probability 0.
    fn choose_or_repeat(
        self,
        chooser: Chooser,
        values: &mut [f32],
        random: &mut ActionRandom,
    ) -> (usize, f32) {
        if let Some(choice) = random.repeated_choice(0) {
            return (choice, 0.0);
        }
        let is_random = random.stream.random::<f32>() < self.epsilon(chooser);
        let choice = if is_random {
            let choice = random.stream.random_range(0..values.len());
            let duration = draw_duration(&mut random.stream);
            random.repeat(0, choice, duration - 1);
            choice
        } else {
            categorical::most_likely(values)
        };
        self.log_probs(chooser, values);
        (choice, values[choice])
    }

    /// ε; 0 without random actions.
    fn epsilon(self, chooser: Chooser) -> f32 {
        match self {
            Self::EpsilonGreedy { from, to, steps } | Self::EpsilonZGreedy { from, to, steps } => {
                let progress = (chooser.steps as f64 / f64::from(steps.get())).min(1.0);
                (from.get() + progress * (to.get() - from.get())) as f32
            }
            Self::EpsilonLadder { epsilon, .. } if epsilon.get() == 0.0 => 0.0,
            Self::EpsilonLadder { epsilon, exponent } => {
                let share = chooser.agent as f64 / (chooser.agents.max(2) - 1) as f64;
                let exponent = 1.0 + exponent.get() * share;
                math::exp((exponent * f64::from(math::ln(epsilon.get_f32()))) as f32)
            }
            Self::Greedy | Self::Gibbs { .. } => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_input::numbers::{ranged_count, ranged_number};
    use seedbed_random::{Purpose, stream};

    fn chooser(agent: usize, steps: u64) -> Chooser {
        Chooser {
            agent,
            agents: 3,
            steps,
        }
    }

    /// ε = 0.25 and α = 1: 0.25, 0.25^1.5 = 0.125 and 0.25² = 0.0625 for three agents; an agent
    /// alone has 0.25. ε = 0 stays 0.
    #[test]
    fn epsilon_falls_along_the_ladder() {
        let ladder = |epsilon| Exploration::EpsilonLadder {
            epsilon: ranged_number(epsilon),
            exponent: ranged_number(1.0),
        };
        let epsilons = [0, 1, 2].map(|agent| ladder(0.25).epsilon(chooser(agent, 7)));
        assert!(
            epsilons
                .iter()
                .zip([0.25, 0.125, 0.0625])
                .all(|(epsilon, expected)| (epsilon - expected).abs() < 1e-6),
            "{epsilons:?}"
        );
        let alone = Chooser {
            agents: 1,
            ..chooser(0, 7)
        };
        assert!((ladder(0.25).epsilon(alone) - 0.25).abs() < 1e-6);
        assert_eq!(ladder(0.0).epsilon(chooser(1, 7)), 0.0);
    }

    /// ε from 1 to 0.2 over 100 steps: 1, 0.6, 0.2, 0.2.
    #[test]
    fn epsilon_changes_linearly() {
        let exploration = Exploration::EpsilonGreedy {
            from: ranged_number(1.0),
            to: ranged_number(0.2),
            steps: ranged_count(100),
        };
        let epsilons = [0, 50, 100, 9999].map(|steps| exploration.epsilon(chooser(0, steps)));
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
            let mut random = ActionRandom::from(stream(1, Purpose::Action, 0, 0));
            let mut counts = [0.0; 3];
            for _ in 0..4000 {
                let values = &mut [0.0, 1.0, 2.0];
                let (choice, log_prob) = exploration.choose(chooser(0, 7), values, &mut random);
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

    /// With ε = 1 all actions are random. One of 4,000 is repeated no further with probability 6/π² = 0.608: four standard
    /// errors are 0.031.
    #[test]
    fn random_actions_of_epsilon_z_are_repeated() {
        let exploration = Exploration::EpsilonZGreedy {
            from: ranged_number(1.0),
            to: ranged_number(1.0),
            steps: ranged_count(1),
        };
        let mut random = ActionRandom::from(stream(1, Purpose::Action, 0, 0));
        let (mut repetitions, mut single) = (0, 0);
        let mut log_prob_before = 1.0;
        while repetitions < 4000 {
            let values = &mut [0.0, 1.0, 2.0];
            let (_, log_prob) = exploration.choose(chooser(0, 7), values, &mut random);
            let is_new = log_prob != 0.0;
            repetitions += u32::from(is_new);
            single += u32::from(is_new && log_prob_before < 0.0);
            log_prob_before = log_prob;
        }
        let share = f64::from(single) / 4000.0;
        assert!((share - 0.608).abs() < 0.031, "{share}");
    }

    /// With ε = 0 the best action is chosen.
    #[test]
    fn epsilon_z_is_greedy_otherwise() {
        let exploration = Exploration::EpsilonZGreedy {
            from: ranged_number(0.0),
            to: ranged_number(0.0),
            steps: ranged_count(1),
        };
        let mut random = ActionRandom::from(stream(1, Purpose::Action, 0, 0));
        let choice = exploration.choose(chooser(0, 7), &mut [0.0, 2.0, 1.0], &mut random);
        assert_eq!(choice, (1, 0.0));
    }
}
