//! Tests of the bonuses that a model learns from: those of drawn transitions.

use rand::RngExt;

use super::*;
use crate::agent::TeamConfig;
use crate::agent::bonus::{Bonus, BonusScale, TeamEntropy};
use crate::algorithms::value_based::config::{Learning, QLearning, ValueBased};
use crate::algorithms::value_based::tests::spec;
use crate::experience::Experience;
use crate::experience::replay::Origin;
use seedbed_env::Status;
use seedbed_input::numbers::{ranged_count, ranged_number};

/// log(1 + d), unweighted.
fn composition(neighbors: u32) -> Composition {
    let bonus = Bonus::TeamEntropy(TeamEntropy {
        neighbors: ranged_count(neighbors),
        scale: BonusScale::Raw {
            weight: ranged_number(1.0),
            shown: ranged_number(1.0),
            lowest: ranged_number(1.0),
        },
        ..TeamEntropy::default()
    });
    let config = QLearning {
        learning: Learning {
            minibatch: ranged_count(64).into(),
            ..Learning::default()
        },
        bonus: bonus.into(),
        ..QLearning::default()
    };
    config.compose(2)
}

/// An episode of 10 steps without rewards between states drawn from the range of the observations.
fn random_episode(agent: u32, number: u32) -> Episode {
    let mut random = stream(7, Purpose::Shuffle, agent, number);
    Episode {
        observations: (0..11 * 3)
            .map(|_| random.random_range(-1.0..1.0))
            .collect(),
        actions: vec![0.0; 10],
        rewards: vec![0.0; 10],
        outcome: Status::Truncated,
        ..Episode::start(agent, number, number, &spec())
    }
}

/// A model, and the replay buffer that it learns from.
struct Learner {
    composition: Composition,
    scaling: Scaling,
    model: ValueModel,
    replay: Replay,
    rounds: u32,
}

impl Learner {
    fn new(neighbors: u32, capacity: usize) -> Self {
        let (composition, team, spec) = (composition(neighbors), TeamConfig::default(), spec());
        let context = AgentContext {
            run_seed: 1,
            agent: 0,
            team: &team,
            spec: &spec,
            record_advantages: false,
        };
        Self {
            model: ValueModel::new(0, &composition, Mlp::new(&[3, 8, 2]), &context),
            scaling: Scaling::new(composition.learning.observations, &spec),
            replay: Replay::new(capacity, (&spec).into()),
            composition,
            rounds: 0,
        }
    }

    /// Plays a round; returns the recorded bonuses of each episode.
    fn play(&mut self, episodes: &[Episode]) -> Vec<Vec<f32>> {
        for episode in episodes {
            (0..episode.length()).for_each(|step| self.replay.push(episode, step));
        }
        let experience = Experience {
            new_episodes: episodes,
            new_lengths: &[],
            all_episodes: episodes,
            earlier_updates: self.rounds,
        };
        self.rounds += 1;
        let (own, mut bonuses) = ((0..episodes.len()).collect::<Vec<_>>(), Vec::new());
        let bonus_model = self.model.bonus_model.as_mut().unwrap();
        bonus_model.compute_own_bonuses(&experience, &own, &mut bonuses);
        bonus_model.learn(&experience);
        bonuses
    }

    /// The transitions of a minibatch, each with the bonus that the model learns from.
    fn draw(&mut self) -> Vec<(Origin, Vec<f32>, f32)> {
        let context = LearningContext {
            composition: &self.composition,
            replay: &self.replay,
            scaling: &self.scaling,
            agents: 2,
            choices: 2,
            steps: 0,
        };
        self.model.draw_minibatch(&context, true);
        self.model.add_bonuses();
        let minibatch = &self.model.work.minibatch;
        let states = minibatch.next_states.chunks_exact(3).map(<[f32]>::to_vec);
        let origins = minibatch.pairs.as_ref().unwrap().origins().iter().copied();
        let bonuses = minibatch.rewards.iter().copied();
        let rows = origins.zip(states).zip(bonuses);
        rows.map(|((origin, state), bonus)| (origin, state, bonus))
            .collect()
    }
}

/// log(1 + distance to the k-th nearest state that another step of `episodes` led to), by computing
/// and sorting all distances in double precision (RE3, Seo et al. 2021, Eq. 4). Display ranges are −1
/// to 1, so that states are not scaled.
fn brute_force(origin: Origin, state: &[f32], episodes: &[Episode], neighbors: usize) -> f64 {
    let mut distances = Vec::new();
    for episode in episodes {
        for step in (0..episode.length()).filter(|&step| episode.origin(step) != origin) {
            let other = &episode.observations[(step + 1) * 3..][..3];
            let differences = state.iter().zip(other).map(|(a, b)| f64::from(a - b));
            distances.push(differences.map(|d| d * d).sum::<f64>().sqrt());
        }
    }
    distances.sort_by(f64::total_cmp);
    distances[neighbors - 1].ln_1p()
}

/// The buffer has room for 30 of the 40 transitions of two rounds. Old transitions are compared with
/// all 20 states of the newest round, new ones with the other 19: no state is its own neighbor. A
/// new transition is learned from with its recorded bonus.
#[test]
fn drawn_transitions_are_not_their_own_neighbors() {
    for neighbors in [1, 3] {
        let mut learner = Learner::new(neighbors, 30);
        let round = |number| [0, 1].map(|agent| random_episode(agent, number));
        learner.play(&round(0));
        let (episodes, mut new_count) = (round(1), 0);
        let recorded = learner.play(&episodes);
        for (origin, state, bonus) in learner.draw() {
            let expected = brute_force(origin, &state, &episodes, neighbors as usize);
            assert!(
                (f64::from(bonus) - expected).abs() < 1e-6 && bonus > 0.0,
                "{origin:?}: {bonus}, expected {expected}"
            );
            if origin.episode == 1 {
                assert_eq!(bonus, recorded[origin.agent as usize][origin.step as usize]);
                new_count += 1;
            }
        }
        assert!((10..60).contains(&new_count), "{new_count} of 64 are new");
    }
}

/// Agent 1 visits the same states as agent 0: each state has a nearest neighbor at distance 0, which
/// is another step, and its second neighbor is elsewhere.
#[test]
fn equal_states_of_other_steps_are_neighbors() {
    let copy = Episode {
        agent: 1,
        ..random_episode(0, 0)
    };
    let episodes = [random_episode(0, 0), copy];
    for (neighbors, is_zero) in [(1, true), (2, false)] {
        let mut learner = Learner::new(neighbors, 100);
        learner.play(&episodes);
        let drawn = learner.draw();
        assert!(drawn.iter().all(|(.., bonus)| (*bonus == 0.0) == is_zero));
    }
}
