//! The cross-entropy method over sequences of actions (Rubinstein 1999; for planning Chua et al.
//! 2018).
//!
//! Sequences are drawn from independent distributions of each action: a Gaussian for a continuous
//! component, clamped to its range, and a categorical distribution for a discrete one. They are
//! fitted to the elite, the sequences with the highest returns, and drawn from again. The result is
//! the best sequence that was evaluated, which takes part in every iteration, so that the return of
//! the plan never decreases.

use std::ops::Range;

use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use crate::agent::dynamics::transitions::ActionEncoding;
use crate::cancellation::cancellation_point;
use seedbed_random::Stream;

/// A search for the sequence of actions with the highest return.
#[derive(Clone, Debug)]
pub(crate) struct Search {
    components: Vec<Component>,
    /// Number of inputs that encode an action.
    width: usize,
    settings: SearchSettings,
}

/// The extent of a search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchSettings {
    /// Number of actions of a sequence.
    pub(crate) horizon: usize,
    /// Number of sequences per iteration.
    pub(crate) candidates: usize,
    pub(crate) iterations: usize,
    /// Number of sequences that the distribution is fitted to, at most `candidates`.
    pub(crate) elites: usize,
    /// Initial standard deviation of a continuous component, in units of half its range.
    pub(crate) deviation: f32,
}

/// The inputs that encode one component of an action.
#[derive(Clone, Debug)]
struct Component {
    inputs: Range<usize>,
    is_discrete: bool,
}

/// Buffers of a search, reused from search to search.
#[derive(Debug, Default)]
pub(crate) struct SearchBuffers {
    /// Mean of a continuous component, probability of each choice of a discrete one: `[horizon ×
    /// width]`.
    mean: Vec<f32>,
    /// Standard deviation of a continuous component: `[horizon × width]`.
    deviation: Vec<f32>,
    /// The sequences of an iteration: `[candidates × horizon × width]`.
    sequences: Vec<f32>,
    returns: Vec<f32>,
    /// Numbers of the sequences, from the highest return to the lowest.
    order: Vec<usize>,
}

impl Search {
    pub(crate) fn new(encodings: &[ActionEncoding], settings: SearchSettings) -> Self {
        assert!((1..=settings.candidates).contains(&settings.elites));
        let mut width = 0;
        let component = |encoding: &ActionEncoding| {
            let inputs = width..width + encoding.width();
            width = inputs.end;
            Component {
                inputs,
                is_discrete: matches!(encoding, ActionEncoding::OneHot { .. }),
            }
        };
        Self {
            components: encodings.iter().map(component).collect(),
            width,
            settings,
        }
    }

    /// Number of inputs that encode an action.
    pub(crate) fn width(&self) -> usize {
        self.width
    }

    /// Replaces a plan by the best sequence that the search finds, possibly the plan itself.
    /// `evaluate` writes the return of each sequence. `plan: [horizon × width]`, or empty if there is
    /// none
    pub(crate) fn improve(
        &self,
        plan: &mut Vec<f32>,
        random: &mut Stream,
        buffers: &mut SearchBuffers,
        mut evaluate: impl FnMut(&[f32], &mut [f32]),
    ) {
        self.start_from(plan, buffers);
        for _ in 0..self.settings.iterations {
            cancellation_point();
            self.draw(random, buffers);
            buffers.sequences[..plan.len()].copy_from_slice(plan);
            buffers.returns.resize(self.settings.candidates, 0.0);
            evaluate(&buffers.sequences, &mut buffers.returns);
            buffers.sort();
            let best = self.sequence_range(buffers.order[0]);
            plan.clear();
            plan.extend_from_slice(&buffers.sequences[best]);
            self.fit(buffers);
        }
    }

    /// The place of a sequence among all.
    fn sequence_range(&self, sequence: usize) -> Range<usize> {
        let length = self.settings.horizon * self.width;
        sequence * length..(sequence + 1) * length
    }

    /// Centers the distribution on a plan; without one, on the middle of the ranges. A choice of the
    /// plan has half of the probability, and all choices share the other half.
    fn start_from(&self, plan: &[f32], buffers: &mut SearchBuffers) {
        let length = self.settings.horizon * self.width;
        let SearchBuffers {
            mean, deviation, ..
        } = buffers;
        mean.clear();
        mean.extend_from_slice(plan);
        mean.resize(length, 0.0);
        deviation.clear();
        deviation.resize(length, self.settings.deviation);
        let share = if plan.is_empty() { 1.0 } else { 0.5 };
        for action in mean.chunks_exact_mut(self.width) {
            for component in self.components.iter().filter(|c| c.is_discrete) {
                let probabilities = &mut action[component.inputs.clone()];
                let choices = probabilities.len() as f32;
                for probability in probabilities {
                    *probability = (1.0 - share) * *probability + share / choices;
                }
            }
        }
    }

    /// Draws all sequences.
    fn draw(&self, random: &mut Stream, buffers: &mut SearchBuffers) {
        let SearchBuffers {
            mean,
            deviation,
            sequences,
            ..
        } = buffers;
        sequences.clear();
        for _ in 0..self.settings.candidates {
            let actions = mean.chunks_exact(self.width);
            for (mean, deviation) in actions.zip(deviation.chunks_exact(self.width)) {
                for component in &self.components {
                    let inputs = component.inputs.clone();
                    if component.is_discrete {
                        push_choice(&mean[inputs], random, sequences);
                    } else {
                        let noise: f32 = StandardNormal.sample(random);
                        let value = mean[inputs.start] + deviation[inputs.start] * noise;
                        sequences.push(value.clamp(-1.0, 1.0));
                    }
                }
            }
        }
    }

    /// Sets the distribution to the mean and the standard deviation of the elite. The mean of a
    /// choice, which is 1 if it is chosen and else 0, is its frequency.
    fn fit(&self, buffers: &mut SearchBuffers) {
        let SearchBuffers {
            mean,
            deviation,
            sequences,
            order,
            ..
        } = buffers;
        let elites = &order[..self.settings.elites];
        let share = 1.0 / elites.len() as f32;
        mean.fill(0.0);
        deviation.fill(0.0);
        for &sequence in elites {
            let values = &sequences[self.sequence_range(sequence)];
            for (mean, value) in mean.iter_mut().zip(values) {
                *mean += share * value;
            }
        }
        for &sequence in elites {
            let values = &sequences[self.sequence_range(sequence)];
            for ((deviation, value), mean) in deviation.iter_mut().zip(values).zip(&*mean) {
                *deviation += share * (value - mean) * (value - mean);
            }
        }
        for square in deviation {
            *square = square.sqrt();
        }
    }
}

impl SearchBuffers {
    /// Sorts the sequences by their returns; of equal ones, the one with the lower number comes
    /// first.
    fn sort(&mut self) {
        let Self { returns, order, .. } = self;
        order.clear();
        order.extend(0..returns.len());
        order.sort_unstable_by(|&a, &b| returns[b].total_cmp(&returns[a]).then(a.cmp(&b)));
    }
}

/// Appends 1 for a choice that is drawn with these probabilities, and 0 for all others.
fn push_choice(probabilities: &[f32], random: &mut Stream, inputs: &mut Vec<f32>) {
    let mut rest: f32 = random.random();
    let mut chosen = probabilities.len() - 1;
    for (choice, probability) in probabilities.iter().enumerate() {
        rest -= probability;
        if rest < 0.0 {
            chosen = choice;
            break;
        }
    }
    inputs.extend((0..probabilities.len()).map(|choice| f32::from(choice == chosen)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_random::{Purpose, stream};

    const SETTINGS: SearchSettings = SearchSettings {
        horizon: 3,
        candidates: 60,
        iterations: 6,
        elites: 6,
        deviation: 0.5,
    };

    fn search(encodings: &[ActionEncoding], settings: SearchSettings) -> Search {
        Search::new(encodings, settings)
    }

    fn continuous() -> ActionEncoding {
        ActionEncoding::Scaled {
            center: 0.0,
            half_range: 1.0,
        }
    }

    fn random() -> Stream {
        stream(1, Purpose::Action, 0, 0)
    }

    /// The return is minus the squared distance from (0.3, −0.7, 2): the best sequence within the
    /// range is (0.3, −0.7, 1).
    #[test]
    fn continuous_sequences_converge_to_the_optimum_within_the_range() {
        let search = search(&[continuous()], SETTINGS);
        let mut plan = Vec::new();
        let evaluate = |sequences: &[f32], returns: &mut [f32]| {
            for (sequence, value) in sequences.chunks_exact(3).zip(returns) {
                let errors = sequence.iter().zip([0.3, -0.7, 2.0]);
                *value = -errors
                    .map(|(x, goal): (_, f32)| (x - goal).powi(2))
                    .sum::<f32>();
            }
        };
        search.improve(
            &mut plan,
            &mut random(),
            &mut SearchBuffers::default(),
            evaluate,
        );
        for (found, expected) in plan.iter().zip([0.3, -0.7, 1.0]) {
            assert!((found - expected).abs() < 0.05, "{plan:?}");
        }
    }

    /// Three choices and a continuous component: the return is the number of actions with choice 2,
    /// minus the square of the other component's difference from −0.5.
    #[test]
    fn choices_converge_to_the_best_ones() {
        let encodings = [ActionEncoding::OneHot { choices: 3 }, continuous()];
        let search = search(&encodings, SETTINGS);
        let mut plan = Vec::new();
        let evaluate = |sequences: &[f32], returns: &mut [f32]| {
            for (sequence, value) in sequences.chunks_exact(12).zip(returns) {
                let actions = sequence.chunks_exact(4);
                *value = actions
                    .map(|action| action[2] - (action[3] + 0.5).powi(2))
                    .sum();
            }
        };
        search.improve(
            &mut plan,
            &mut random(),
            &mut SearchBuffers::default(),
            evaluate,
        );
        for action in plan.chunks_exact(4) {
            assert_eq!(action[..3], [0.0, 0.0, 1.0]);
            assert!((action[3] + 0.5).abs() < 0.1, "{plan:?}");
        }
    }

    /// A search that draws nothing better keeps the plan.
    #[test]
    fn the_plan_never_gets_worse() {
        let search = search(&[continuous()], SETTINGS);
        let mut plan = vec![0.25, -0.5, 0.125];
        let best = plan.clone();
        let evaluate = |sequences: &[f32], returns: &mut [f32]| {
            for (sequence, value) in sequences.chunks_exact(3).zip(returns) {
                *value = f32::from(sequence == best);
            }
        };
        search.improve(
            &mut plan,
            &mut random(),
            &mut SearchBuffers::default(),
            evaluate,
        );
        assert_eq!(plan, best);
    }

    /// The elite of the values 1, 3, 5, 7 with returns 0, 2, 9, 1 are 5 and 3: mean 4, deviation 1.
    #[test]
    fn the_distribution_is_fitted_to_the_elite() {
        let settings = SearchSettings {
            horizon: 1,
            candidates: 4,
            elites: 2,
            ..SETTINGS
        };
        let mut buffers = SearchBuffers {
            mean: vec![0.0],
            deviation: vec![0.0],
            sequences: vec![1.0, 3.0, 5.0, 7.0],
            returns: vec![0.0, 2.0, 9.0, 1.0],
            order: Vec::new(),
        };
        buffers.sort();
        assert_eq!(buffers.order, [2, 1, 3, 0]);
        search(&[continuous()], settings).fit(&mut buffers);
        assert_eq!((buffers.mean, buffers.deviation), (vec![4.0], vec![1.0]));
    }

    /// Half of the probability is on the choice of the plan: ½ + ½/4 and ½/4.
    #[test]
    fn a_search_starts_around_the_plan() {
        let encodings = [ActionEncoding::OneHot { choices: 4 }, continuous()];
        let settings = SearchSettings {
            horizon: 1,
            ..SETTINGS
        };
        let search = search(&encodings, settings);
        let mut buffers = SearchBuffers::default();
        search.start_from(&[0.0, 1.0, 0.0, 0.0, 0.75], &mut buffers);
        assert_eq!(buffers.mean, [0.125, 0.625, 0.125, 0.125, 0.75]);
        search.start_from(&[], &mut buffers);
        assert_eq!(buffers.mean, [0.25, 0.25, 0.25, 0.25, 0.0]);
        assert_eq!(buffers.deviation[4], 0.5);
    }
}
