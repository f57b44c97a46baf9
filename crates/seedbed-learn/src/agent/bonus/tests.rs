//! Tests of bonuses: what they reward, and what they learn.

use super::*;
use crate::agent::TeamConfig;
use crate::experience::Experience;
use seedbed_env::{Action, Choice, Quantity, Status, TaskSpec};
use seedbed_input::numbers::{ranged_count, ranged_number};
use seedbed_random::{Purpose, stream};

fn spec() -> TaskSpec {
    let quantity = |name: &str| Quantity {
        name: name.to_owned(),
        unit: String::new(),
        range: [-1.0, 1.0],
    };
    TaskSpec {
        observations: vec![quantity("x"), quantity("v")],
        actions: vec![Action {
            quantity: quantity("push"),
            choice: Choice::Continuous,
        }],
        ..TaskSpec::new("test", Vec::new(), Vec::new())
    }
}

fn bonus_model(bonus: &Bonus, agent: u32) -> BonusModel {
    let (team, spec) = (TeamConfig::default(), spec());
    let context = AgentContext {
        run_seed: 1,
        agent,
        team: &team,
        spec: &spec,
        record_advantages: false,
    };
    BonusModel::new(bonus, &context).unwrap()
}

fn vime(model: ModelSharing, seeds: ModelSeeds) -> Bonus {
    Bonus::Vime(Vime {
        model,
        seeds,
        ..Vime::default()
    })
}

/// A body pushed back and forth: x' = x + 0.1 v, v' = 0.9 v + a, where a is a sine whose
/// frequency depends on the agent.
fn episode(agent: u32) -> Episode {
    let mut episode = Episode {
        outcome: Status::Truncated,
        ..Episode::start(agent, 0, 0, &spec())
    };
    let (mut x, mut v) = (0.0_f32, 0.0_f32);
    episode.observations.extend([x, v]);
    for step in 0..50 {
        let a = (step as f32 * (0.3 + 0.1 * agent as f32)).sin();
        (x, v) = (x + 0.1 * v, 0.9 * v + a);
        episode.observations.extend([x, v]);
        episode.actions.push(a);
        episode.rewards.push(0.0);
    }
    episode
}

/// Learns from the same episodes in every round; returns the prediction error of each round.
fn learn(bonus_model: &mut BonusModel, episodes: &[Episode], rounds: u32) -> Vec<f32> {
    (0..rounds)
        .filter_map(|round| {
            bonus_model.learn(&Experience {
                new_episodes: episodes,
                new_lengths: &[],
                all_episodes: episodes,
                earlier_updates: round,
            })
        })
        .collect()
}

fn gains(bonus_model: &mut BonusModel, noise: u32) -> Vec<f32> {
    let mut gains = vec![];
    bonus_model.compute_gains(
        &episode(0),
        1,
        &mut stream(9, Purpose::BonusNoise, 0, noise),
        &mut gains,
    );
    gains
}

/// Only agent 0 trains a shared model; then a copy of another agent computes the same gains. An
/// independent model learns from the agent's own episodes.
#[test]
fn one_agent_trains_a_shared_model() {
    let episodes = [episode(0), episode(1)];
    for bonus in [
        vime(ModelSharing::Shared, ModelSeeds::Off),
        Bonus::Rnd(Rnd::default()),
    ] {
        let [mut trained, mut copy] = [0, 1].map(|agent| bonus_model(&bonus, agent));
        let untrained_gains = gains(&mut copy, 0);
        assert_eq!(gains(&mut trained, 0), untrained_gains);
        assert_eq!(learn(&mut trained, &episodes, 2).len(), 2);
        assert!(learn(&mut copy, &episodes, 2).is_empty());
        assert_eq!(gains(&mut copy, 0), untrained_gains);
        copy.copy_learned(&trained);
        assert_eq!(gains(&mut copy, 0), gains(&mut trained, 0));
        assert_ne!(gains(&mut copy, 0), untrained_gains);
    }
    let independent = vime(ModelSharing::Independent, ModelSeeds::Off);
    assert_eq!(
        learn(&mut bonus_model(&independent, 1), &episodes, 2).len(),
        2
    );
}

/// With the same random numbers, agents compute different bonuses if they have seeds of the
/// model. With `FixedSample`, bonuses do not depend on the random numbers.
#[test]
fn seeds_make_bonuses_differ_between_agents() {
    for seeds in [
        ModelSeeds::Off,
        ModelSeeds::Scale,
        ModelSeeds::Shift,
        ModelSeeds::FixedSample,
    ] {
        let [mut one, mut other] =
            [0, 1].map(|agent| bonus_model(&vime(ModelSharing::Shared, seeds), agent));
        assert_eq!(
            gains(&mut one, 0) == gains(&mut other, 0),
            seeds == ModelSeeds::Off,
            "{seeds:?}"
        );
        assert_eq!(
            gains(&mut one, 0) == gains(&mut one, 1),
            seeds == ModelSeeds::FixedSample,
            "{seeds:?}"
        );
    }
}

#[test]
fn prediction_errors_fall_unless_the_model_is_frozen() {
    let episodes = [episode(0), episode(1)];
    for (bonus, errors_fall) in [
        (vime(ModelSharing::Shared, ModelSeeds::Off), true),
        (vime(ModelSharing::Frozen, ModelSeeds::Off), false),
        (
            Bonus::Vime(Vime {
                buffer: ModelBuffer::Cleared,
                ..Vime::default()
            }),
            true,
        ),
        (Bonus::Rnd(Rnd::default()), true),
        (
            Bonus::Rnd(Rnd {
                model: ModelSharing::Frozen,
                ..Rnd::default()
            }),
            false,
        ),
    ] {
        let errors = learn(&mut bonus_model(&bonus, 0), &episodes, 20);
        // The first error is measured before targets are scaled by running moments.
        assert_eq!(
            errors[19] < 0.5 * errors[1],
            errors_fall,
            "{bonus:?}: {errors:?}"
        );
    }
}

/// Bonuses are 0 until there is a first median; then the median bonus is about η.
#[test]
fn bonuses_are_scaled_by_earlier_medians() {
    let mut model = bonus_model(&vime(ModelSharing::Shared, ModelSeeds::Off), 0);
    let episodes = [episode(0), episode(1)];
    let mut bonuses = vec![];
    let experience = |round| Experience {
        new_episodes: &episodes,
        new_lengths: &[],
        all_episodes: &episodes,
        earlier_updates: round,
    };
    model.compute_bonuses(&experience(0), &[0, 1], &mut bonuses);
    assert!(
        bonuses
            .iter()
            .all(|bonuses| bonuses.len() == 50 && bonuses.iter().all(|&bonus| bonus == 0.0))
    );
    model.compute_bonuses(&experience(1), &[0], &mut bonuses);
    let mut sorted = bonuses[0].clone();
    sorted.sort_by(f32::total_cmp);
    assert!((2e-4..5e-3).contains(&sorted[25]), "{}", sorted[25]);
    assert!(sorted[49] <= 10.0 * 1e-3 && bonuses[1].is_empty());
}

#[test]
fn a_restored_bonus_model_continues_with_the_same_bits() {
    let episodes = [episode(0), episode(1)];
    for bonus in [
        vime(ModelSharing::Shared, ModelSeeds::Shift),
        Bonus::Rnd(Rnd::default()),
        Bonus::TeamEntropy(TeamEntropy::default()),
        Bonus::Regions(Regions::default()),
        Bonus::Discriminator(Discriminator::default()),
    ] {
        let [mut original, mut restored] = [0, 0].map(|agent| bonus_model(&bonus, agent));
        original.compute_bonuses(
            &Experience {
                new_episodes: &episodes,
                new_lengths: &[],
                all_episodes: &episodes,
                earlier_updates: 0,
            },
            &[0],
            &mut vec![],
        );
        learn(&mut original, &episodes, 2);
        restored.restore(&original.save()).unwrap();
        assert_eq!(restored.save(), original.save());
        assert_eq!(
            learn(&mut restored, &episodes, 3),
            learn(&mut original, &episodes, 3)
        );
        assert_eq!(gains(&mut restored, 0), gains(&mut original, 0));
        assert!(restored.restore(&[7]).is_err());
    }
}

/// An episode of two observations that leads to the states (x, 0) for each of `xs`.
fn line(agent: u32, episode: u32, xs: &[f32]) -> Episode {
    let states = xs.iter().flat_map(|&x| [x, 0.0]);
    Episode {
        observations: [0.0, 0.0].into_iter().chain(states).collect(),
        actions: vec![0.0; xs.len()],
        rewards: vec![0.0; xs.len()],
        outcome: Status::Truncated,
        ..Episode::start(agent, episode, 0, &spec())
    }
}

/// Unweighted bonuses of the steps of each new episode, as agent `agent` computes them in update
/// number `earlier_updates`.
fn entropy_bonuses(
    config: &TeamEntropy,
    agent: u32,
    earlier_updates: u32,
    episodes: &[Episode],
) -> Vec<Vec<f32>> {
    let raw = BonusScale::Raw {
        weight: ranged_number(1.0),
        shown: ranged_number(1.0),
        lowest: ranged_number(1.0),
    };
    let config = TeamEntropy {
        scale: raw,
        ..config.clone()
    };
    let mut bonuses = Vec::new();
    let experience = Experience {
        new_episodes: episodes,
        new_lengths: &[],
        all_episodes: episodes,
        earlier_updates,
    };
    let chosen: Vec<usize> = (0..episodes.len()).collect();
    bonus_model(&Bonus::TeamEntropy(config), agent).compute_bonuses(
        &experience,
        &chosen,
        &mut bonuses,
    );
    bonuses
}

/// Agent 0 visits x = 0.1 and 0.4, agent 1 x = 0.2 (ranges are scaled to -1 to 1 already). Distances
/// to the nearest other state of the team are 0.1, 0.2 and 0.1, to the second 0.3, 0.3 and 0.2; of
/// agent 0 alone 0.3 and 0.3. The state of agent 1 is 0.1 from those of agent 0, and agent 1 has no
/// other state of its own. Start states (x = 0) count for nothing.
#[test]
fn entropy_bonuses_by_hand() {
    let episodes = [line(0, 5, &[0.1, 0.4]), line(1, 5, &[0.2])];
    let bonuses = |model, neighbors, agent| {
        let config = TeamEntropy {
            model,
            neighbors: ranged_count(neighbors),
            ..TeamEntropy::default()
        };
        entropy_bonuses(&config, agent, 0, &episodes).concat()
    };
    for (model, neighbors, agent, distances) in [
        (ModelSharing::Shared, 1, 0, [0.1_f64, 0.2, 0.1]),
        (ModelSharing::Shared, 1, 1, [0.1, 0.2, 0.1]),
        (ModelSharing::Shared, 2, 0, [0.3, 0.3, 0.2]),
        (ModelSharing::Independent, 1, 0, [0.3, 0.3, 0.1]),
        (ModelSharing::Independent, 1, 1, [0.1, 0.2, 0.0]),
    ] {
        let expected = distances.map(|distance| (1.0 + distance).ln());
        let computed = bonuses(model, neighbors, agent);
        let is_close = |(a, b): (&f32, &f64)| (f64::from(*a) - b).abs() < 1e-6;
        assert!(
            computed.len() == 3 && computed.iter().zip(&expected).all(is_close),
            "{model:?} {neighbors} {agent}: {computed:?}, expected {expected:?}"
        );
    }
}

/// A display range of 4 makes distances half as long; what is far beyond it is clipped.
#[test]
fn distances_are_scaled_to_display_ranges() {
    let mut wide = spec();
    wide.observations[0].range = [-2.0, 2.0];
    let team = TeamConfig::default();
    let context = AgentContext {
        run_seed: 1,
        agent: 0,
        team: &team,
        spec: &wide,
        record_advantages: false,
    };
    let mut model = TeamEntropy::default().build(0, &context);
    let (references, far) = (line(0, 0, &[0.0]), line(1, 0, &[1.0, 1e38]));
    let mut random = stream(1, Purpose::ReferenceStates, 0, 0);
    model.begin_round(&[&references], &mut random);
    let steps = Steps {
        episode: &far,
        stride: 1,
        origin: &|step| far.origin(step),
    };
    let mut gains = vec![];
    model.compute_gains(&steps, &mut random, &mut gains);
    assert!(
        (f64::from(gains[0]) - 1.5_f64.ln()).abs() < 1e-6,
        "{gains:?}"
    );
    assert!(
        (f64::from(gains[1]) - 11.0_f64.ln()).abs() < 1e-6,
        "{gains:?}"
    );
}

/// With one reference among many states at different places, its step is the only one whose nearest
/// neighbor is none (a bonus of 0). All agents of a team draw the same one, and another one in
/// another update.
#[test]
fn a_team_draws_the_same_references() {
    let xs = |offset: f32| -> Vec<f32> { (0..40).map(|x| offset + 0.01 * x as f32).collect() };
    let episodes = [line(0, 0, &xs(-0.5)), line(1, 0, &xs(0.2))];
    let config = TeamEntropy {
        neighbors: ranged_count(1),
        references: ranged_count(1),
        ..TeamEntropy::default()
    };
    let drawn = |agent, update| {
        let bonuses = entropy_bonuses(&config, agent, update, &episodes).concat();
        let zeros = bonuses
            .iter()
            .enumerate()
            .filter(|(_, bonus)| **bonus == 0.0);
        let zeros: Vec<usize> = zeros.map(|(index, _)| index).collect();
        assert_eq!((bonuses.len(), zeros.len()), (80, 1), "{bonuses:?}");
        zeros[0]
    };
    let of_updates = [0, 1, 2, 3].map(|update| drawn(0, update));
    assert_eq!(of_updates, [0, 1, 2, 3].map(|update| drawn(7, update)));
    assert!(of_updates.iter().any(|other| *other != of_updates[0]));
}

/// Of the states 0, 0.5 and 0.05, the third is in the region of the first. The second region belongs to agent 1. After
/// the team's first round, agent 0 gets 1/√3 in its region, 0 or half of 1/√2 in the other one, and 1 near its own, where
/// nobody has been; its own model without a team counts all regions as its own.
#[test]
fn regions_of_other_agents_are_worth_less() {
    let visited = [line(0, 0, &[0.0, 0.5, 0.05])];
    let [third, half] = [3.0_f32, 2.0].map(|count| count.sqrt().recip());
    for (model, others, agent, expected) in [
        (ModelSharing::Shared, 0.0, 0, [third, 0.0, 1.0]),
        (ModelSharing::Shared, 0.0, 1, [0.0, half, 0.0]),
        (ModelSharing::Shared, 0.5, 0, [third, 0.5 * half, 1.0]),
        (ModelSharing::Shared, 1.0, 1, [third, half, 1.0]),
        (ModelSharing::Independent, 0.0, 0, [third, half, 1.0]),
        (ModelSharing::Independent, 0.0, 1, [1.0, 1.0, 1.0]),
    ] {
        let config = Regions {
            model,
            others: ranged_number(others),
            ..Regions::default()
        };
        let bonus = Bonus::Regions(config);
        let [mut trained, mut asked] = [0, agent].map(|agent| bonus_model(&bonus, agent));
        learn(&mut trained, &visited, 1);
        if model == ModelSharing::Shared {
            asked.copy_learned(&trained);
        } else {
            learn(&mut asked, &visited, 1);
        }
        let mut gains = Vec::new();
        let next = line(agent, 1, &[0.0, 0.45, -0.2]);
        asked.compute_gains(
            &next,
            1,
            &mut stream(0, Purpose::BonusNoise, 0, 0),
            &mut gains,
        );
        assert_eq!(gains, expected, "{model:?} {others} {agent}");
    }
}

/// Agent 0 visits x < 0, agent 1 x > 0, agents 2 and 3 nothing: after learning, each of the two is nearly sure in its own half,
/// log 1 − log(1/4), and has a negative gain in the other one. Before, gains are about 0.
#[test]
fn a_discriminator_tells_agents_by_their_states() {
    let xs = |sign: f32| -> Vec<f32> { (1..40).map(|x| sign * 0.025 * x as f32).collect() };
    let visited = [line(0, 0, &xs(-1.0)), line(1, 0, &xs(1.0))];
    let config = Discriminator {
        minibatches: ranged_count(400),
        ..Discriminator::default()
    };
    let mut model = bonus_model(&Bonus::Discriminator(config), 0);
    let gains_at = |model: &mut BonusModel| {
        let mut gains = Vec::new();
        let random = &mut stream(0, Purpose::BonusNoise, 0, 0);
        model.compute_gains(&line(0, 1, &[-0.6, 0.6]), 1, random, &mut gains);
        gains
    };
    assert!(gains_at(&mut model).iter().all(|gain| gain.abs() < 0.7));
    learn(&mut model, &visited, 1);
    let gains = gains_at(&mut model);
    assert!((gains[0] - 4.0_f32.ln()).abs() < 0.1, "{gains:?}");
    assert!(gains[1] < -2.0, "{gains:?}");
}

/// With `lowest: 0`, agent 0 of four has no bonus, agent 1 a third of what the last one has.
#[test]
fn agents_have_different_weights_on_a_ladder() {
    let scale = BonusScale::Raw {
        weight: ranged_number(1.0),
        shown: ranged_number(1.0),
        lowest: ranged_number(0.0),
    };
    let bonus = Bonus::TeamEntropy(TeamEntropy {
        scale,
        ..TeamEntropy::default()
    });
    let episodes = [line(0, 0, &[0.1, 0.4]), line(1, 0, &[0.2])];
    let bonuses = [0, 1, 3].map(|agent| {
        let experience = Experience {
            new_episodes: &episodes,
            new_lengths: &[],
            all_episodes: &episodes,
            earlier_updates: 0,
        };
        let mut bonuses = Vec::new();
        bonus_model(&bonus, agent).compute_bonuses(&experience, &[0], &mut bonuses);
        bonuses[0].clone()
    });
    let [none, third, all] = bonuses;
    assert_eq!(none, [0.0, 0.0]);
    for (third, all) in third.iter().zip(&all) {
        assert!(
            *all > 0.0 && (3.0 * third - all).abs() < 1e-6,
            "{third} {all}"
        );
    }
}
