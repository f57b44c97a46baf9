//! What a model of the dynamics sees: standardized (s, a), and what it predicts: Δs in units of its
//! root mean square.

use rand::RngExt;
use serde::{Deserialize, Serialize};

use crate::experience::Episode;
use crate::nn::Standardizer;
use seedbed_env::random::Stream;
use seedbed_env::{Choice, Spec};

/// Turns steps of episodes into rows for a network.
pub(crate) struct Transitions {
    observed: usize,
    actions: Vec<Encoding>,
    moments: Moments,
    raw: Rows,
}

/// What learning changes.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Moments {
    /// Of (s, a).
    inputs: Standardizer,
    /// Of Δs.
    changes: Standardizer,
}

/// Rows for a network: `inputs: [N × in]`, `targets: [N × out]`.
#[derive(Default)]
pub(crate) struct Rows {
    pub(crate) inputs: Vec<f32>,
    pub(crate) targets: Vec<f32>,
}

/// How a component of an action enters.
enum Encoding {
    /// One number a choice.
    OneHot { choices: usize },
    /// Its range becomes −1 to 1; what is beyond is clamped, as the environment does.
    Scaled { center: f32, half_range: f32 },
}

impl Transitions {
    pub(crate) fn new(spec: &Spec) -> Self {
        let encoding = |action: &seedbed_env::Action| match &action.choice {
            Choice::Discrete(values) => Encoding::OneHot {
                choices: values.len(),
            },
            Choice::Continuous => {
                let [low, high] = action.quantity.range;
                Encoding::Scaled {
                    center: 0.5 * (low + high),
                    half_range: 0.5 * (high - low),
                }
            }
        };
        let actions: Vec<Encoding> = spec.actions.iter().map(encoding).collect();
        let observed = spec.observation_width();
        let width = observed + actions.iter().map(Encoding::width).sum::<usize>();
        let moments = Moments {
            inputs: Standardizer::new(width),
            changes: Standardizer::new(observed),
        };
        Self {
            observed,
            actions,
            moments,
            raw: Rows::default(),
        }
    }

    /// Numbers that enter the network, and that leave it.
    pub(crate) fn widths(spec: &Spec) -> [usize; 2] {
        let actions = spec.actions.iter().map(|action| match &action.choice {
            Choice::Discrete(values) => values.len(),
            Choice::Continuous => 1,
        });
        [
            spec.observation_width() + actions.sum::<usize>(),
            spec.observation_width(),
        ]
    }

    pub(crate) fn moments(&self) -> &Moments {
        &self.moments
    }

    pub(crate) fn restore(&mut self, moments: Moments) {
        self.moments = moments;
    }

    /// Every `stride`-th step of an episode.
    pub(crate) fn of_episode(&mut self, episode: &Episode, stride: usize, rows: &mut Rows) {
        self.raw.clear();
        (0..episode.length())
            .step_by(stride)
            .for_each(|step| self.push(episode, step));
        self.standardize(rows);
    }

    /// `count` steps drawn from all episodes, each step equally likely.
    pub(crate) fn sample(
        &mut self,
        episodes: &[&Episode],
        count: usize,
        random: &mut Stream,
        rows: &mut Rows,
    ) {
        self.raw.clear();
        let total: usize = episodes.iter().map(|episode| episode.length()).sum();
        let mut drawn: Vec<usize> = (0..count).map(|_| random.random_range(0..total)).collect();
        drawn.sort_unstable();
        let mut episodes = episodes.iter();
        let (mut episode, mut start) = (episodes.next(), 0);
        for place in drawn {
            while let Some(here) = episode.filter(|here| place >= start + here.length()) {
                start += here.length();
                episode = episodes.next();
            }
            if let Some(here) = episode {
                self.push(here, place - start);
            }
        }
        self.standardize(rows);
    }

    /// Takes an episode's steps into the moments.
    pub(crate) fn take_in(&mut self, episode: &Episode) {
        self.raw.clear();
        (0..episode.length()).for_each(|step| self.push(episode, step));
        self.moments.inputs.update(&self.raw.inputs);
        self.moments.changes.update(&self.raw.targets);
    }

    fn push(&mut self, episode: &Episode, step: usize) {
        let observed = self.observed;
        let [now, next] =
            [step, step + 1].map(|row| &episode.observations[row * observed..(row + 1) * observed]);
        self.raw.inputs.extend_from_slice(now);
        let actions = &episode.actions[step * self.actions.len()..(step + 1) * self.actions.len()];
        for (encoding, &action) in self.actions.iter().zip(actions) {
            encoding.push(action, &mut self.raw.inputs);
        }
        self.raw
            .targets
            .extend(next.iter().zip(now).map(|(next, now)| next - now));
    }

    fn standardize(&self, rows: &mut Rows) {
        self.moments
            .inputs
            .apply(&self.raw.inputs, &mut rows.inputs);
        self.moments
            .changes
            .apply_scale(&self.raw.targets, &mut rows.targets);
    }
}

impl Rows {
    fn clear(&mut self) {
        self.inputs.clear();
        self.targets.clear();
    }
}

impl Encoding {
    fn width(&self) -> usize {
        match self {
            Self::OneHot { choices } => *choices,
            Self::Scaled { .. } => 1,
        }
    }

    fn push(&self, action: f32, row: &mut Vec<f32>) {
        match *self {
            Self::OneHot { choices } => {
                row.extend((0..choices).map(|choice| f32::from(choice == action as usize)))
            }
            Self::Scaled { center, half_range } => {
                row.push(((action - center) / half_range).clamp(-1.0, 1.0))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::random::{Purpose, stream};
    use seedbed_env::{Action, Quantity, Status};

    fn spec() -> Spec {
        let quantity = |name: &str, range| Quantity {
            name: name.to_owned(),
            unit: String::new(),
            range,
        };
        Spec {
            observations: vec![quantity("x", [-1.0, 1.0])],
            actions: vec![
                Action {
                    quantity: quantity("kick", [0.0, 2.0]),
                    choice: Choice::Discrete(vec![0.0, 1.0, 2.0]),
                },
                Action {
                    quantity: quantity("push", [0.0, 4.0]),
                    choice: Choice::Continuous,
                },
            ],
            ..Spec::new("test", Vec::new(), Vec::new())
        }
    }

    /// x = 1, 2, 4 with actions (2, 3) and (0, 9).
    fn episode() -> Episode {
        Episode {
            observations: vec![1.0, 2.0, 4.0],
            actions: vec![2.0, 3.0, 0.0, 9.0],
            rewards: vec![0.0; 2],
            outcome: Status::Terminated,
            ..Episode::start(0, 0, 0, &spec())
        }
    }

    /// Before any moments: x, one of three kicks, the push from 0…4 to −1…1 and clamped; Δx = 1, 2.
    #[test]
    fn steps_become_rows() {
        assert_eq!(Transitions::widths(&spec()), [5, 1]);
        let (mut transitions, mut rows) = (Transitions::new(&spec()), Rows::default());
        transitions.of_episode(&episode(), 1, &mut rows);
        assert_eq!(
            rows.inputs,
            [1.0, 0.0, 0.0, 1.0, 0.5, 2.0, 1.0, 0.0, 0.0, 1.0]
        );
        assert_eq!(rows.targets, [1.0, 2.0]);
        transitions.of_episode(&episode(), 2, &mut rows);
        assert_eq!(rows.targets, [1.0]);
    }

    /// Δx = 1, 2 has a root mean square of √2.5.
    #[test]
    fn targets_are_in_units_of_their_root_mean_square() {
        let (mut transitions, mut rows) = (Transitions::new(&spec()), Rows::default());
        transitions.take_in(&episode());
        transitions.of_episode(&episode(), 1, &mut rows);
        assert!(
            (rows.targets[1] - 2.0 / 2.5_f32.sqrt()).abs() < 1e-5,
            "{:?}",
            rows.targets
        );
        assert!(
            (rows.inputs[0] + 1.0).abs() < 1e-4,
            "x = 1 is a deviation below its mean of 1.5: {:?}",
            rows.inputs
        );
    }

    /// Every step of two episodes is drawn about as often: 3,000 of 4 kinds, four standard errors
    /// of √(3000 · 3/16) = 24.
    #[test]
    fn steps_are_drawn_uniformly_and_never_across_an_end() {
        let (mut transitions, mut rows) = (Transitions::new(&spec()), Rows::default());
        let other = Episode {
            observations: vec![5.0, 8.0, 12.0],
            ..episode()
        };
        let mut random = stream(1, Purpose::Shuffle, 0, 0);
        transitions.sample(&[&episode(), &other], 3000, &mut random, &mut rows);
        for change in [1.0, 2.0, 3.0, 4.0] {
            let count = rows
                .targets
                .iter()
                .filter(|target| **target == change)
                .count();
            assert!(count.abs_diff(750) < 100, "{change}: {count}");
        }
        assert_eq!(rows.targets.len(), 3000);
    }
}
