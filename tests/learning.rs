//! Teams learn, and a random team fails the same tests.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;

use seedbed::run::Plan;
use seedbed::run::trainer::Trainer;

/// A team without a recording.
fn team(scenario: &str, overrides: &[&str], threads: usize) -> Trainer {
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenarios")
        .join(scenario);
    let plan = Plan::load(&path, &overrides).unwrap_or_else(|error| panic!("{error}"));
    Trainer::new(&plan.scenario, &plan.description, threads).unwrap()
}

/// Trains without a recording and returns the episodes per agent until the team solved the task, over 25 episodes of each agent.
fn episodes_until_solved(scenario: &str, overrides: &[&str], at_most: usize) -> Option<usize> {
    let mut trainer = team(scenario, overrides, 2);
    while trainer.measures().episodes_per_agent() < at_most && !trainer.is_solved() {
        trainer.advance().unwrap();
    }
    trainer
        .is_solved()
        .then(|| trainer.measures().episodes_per_agent())
}

#[test]
fn four_agents_of_seed_pg_solve_the_cartpole() {
    let episodes = episodes_until_solved("cartpole.ron", &[], 200);
    assert!(
        episodes.is_some_and(|episodes| episodes <= 160),
        "{episodes:?}"
    );
}

#[test]
fn sixteen_agents_learn_faster() {
    let episodes = episodes_until_solved("cartpole_16.ron", &[], 120);
    assert!(
        episodes.is_some_and(|episodes| episodes <= 100),
        "{episodes:?}"
    );
}

#[test]
fn one_agent_of_simple_policy_gradient_solves_the_cartpole() {
    let episodes = episodes_until_solved("cartpole_1.ron", &[], 600);
    assert!(
        episodes.is_some_and(|episodes| episodes > 100),
        "{episodes:?}"
    );
}

#[test]
fn the_closed_form_cartpole_trains_as_well() {
    let episodes = episodes_until_solved("cartpole.ron", &["physics=Analytic"], 200);
    assert!(
        episodes.is_some_and(|episodes| episodes <= 160),
        "{episodes:?}"
    );
}

#[test]
fn a_gaussian_policy_solves_the_continuous_cartpole() {
    let episodes = episodes_until_solved("cartpole_continuous.ron", &[], 300);
    assert!(
        episodes.is_some_and(|episodes| episodes <= 280),
        "{episodes:?}"
    );
}

#[test]
fn eight_agents_swing_up_the_pendulum() {
    let episodes = episodes_until_solved("pendulum.ron", &[], 200);
    assert!(
        episodes.is_some_and(|episodes| episodes <= 150),
        "{episodes:?}"
    );
}

#[test]
fn q_learning_solves_the_cartpole() {
    let episodes = episodes_until_solved("cartpole_q.ron", &[], 200);
    assert!(
        episodes.is_some_and(|episodes| episodes <= 150),
        "{episodes:?}"
    );
    let double_off = episodes_until_solved(
        "cartpole_q.ron",
        &["algorithm.double=false", "algorithm.networks=Own"],
        250,
    );
    assert!(
        double_off.is_some_and(|episodes| episodes <= 250),
        "{double_off:?}"
    );
    assert_eq!(
        episodes_until_solved("cartpole_q.ron", &["algorithm=Random"], 200),
        None
    );
}

/// One of 2¹⁰ sequences of actions finds the treasure.
#[test]
fn bootstrapped_dqn_finds_what_dithering_does_not() {
    let episodes = episodes_until_solved("deep_sea_bootstrapped_dqn.ron", &[], 250);
    assert!(
        episodes.is_some_and(|episodes| episodes <= 200),
        "{episodes:?}"
    );
    let dithering = "algorithm=QLearning(exploration: EpsilonGreedy(from: 0.2, to: 0.05, steps: 1000), learning: (observations: Raw, \
                     minibatch: 32, target_every: 4))";
    assert_eq!(
        episodes_until_solved("deep_sea_bootstrapped_dqn.ron", &[dithering], 250),
        None
    );
}

#[test]
fn a_random_team_solves_nothing() {
    assert_eq!(
        episodes_until_solved("cartpole.ron", &["algorithm=Random"], 200),
        None
    );
    assert_eq!(
        episodes_until_solved("cartpole_continuous.ron", &["algorithm=Random"], 300),
        None
    );
    assert_eq!(
        episodes_until_solved("pendulum.ron", &["algorithm=Random"], 200),
        None
    );
}

/// Of four agents, those that reached the goal of the sparse mountain car within 40 episodes.
fn agents_at_the_goal(overrides: &[&str]) -> usize {
    let mut trainer = team("mountain_car_vime.ron", overrides, 2);
    let mut reached = [false; 4];
    for _ in 0..40 {
        for row in trainer.advance().unwrap().rows.episodes {
            reached[row.agent as usize] |= row.r#return > 0.0;
        }
    }
    reached.into_iter().filter(|reached| *reached).count()
}

#[test]
fn curious_agents_find_a_goal_that_others_do_not() {
    assert_eq!(agents_at_the_goal(&[]), 4);
    assert!(agents_at_the_goal(&["algorithm.bonus.Vime.seeds=Scale"]) >= 3);
    assert!(agents_at_the_goal(&["algorithm.bonus=None"]) <= 1);
    assert_eq!(agents_at_the_goal(&["algorithm=Random"]), 0);
}

/// After three rounds: how far agents agree on bonuses.
fn agreement_on_bonuses(scenario: &str, overrides: &[&str]) -> Option<f32> {
    let mut trainer = team(scenario, overrides, 1);
    (0..3)
        .map(|_| trainer.advance().unwrap().rows.updates[0].bonus_agreement)
        .last()
        .flatten()
}

/// It takes two that judge: no agreement is not an agreement of 0.
#[test]
fn agreement_is_known_where_two_judge() {
    let car = |overrides: &[&str]| agreement_on_bonuses("mountain_car_vime.ron", overrides);
    let (shared, seeded) = (
        car(&[]).unwrap(),
        car(&["algorithm.bonus.Vime.seeds=Scale"]).unwrap(),
    );
    assert!(shared > seeded && shared <= 1.0, "{shared} and {seeded}");
    assert_eq!(car(&["agents.count=1"]), None);
    assert_eq!(car(&["algorithm.bonus=None"]), None);
    let q = |more: &[&str]| {
        agreement_on_bonuses(
            "cartpole_q.ron",
            &[&["algorithm.bonus=Vime(seeds: Shift)"], more].concat(),
        )
    };
    assert_eq!(q(&[]), None, "one network and one curiosity for all");
    assert!(q(&["algorithm.networks=Own"]).is_some_and(|agreement| agreement < 1.0));
}

#[test]
fn agents_that_do_not_wait_for_each_other_learn() {
    let episodes = episodes_until_solved(
        "cartpole.ron",
        &["schedule=Asynchronous(training: (env_steps: 50))"],
        250,
    );
    assert!(
        episodes.is_some_and(|episodes| episodes <= 220),
        "{episodes:?}"
    );
}

/// Learning is due to the gradient steps: without them the same team solves nothing.
#[test]
fn without_gradient_steps_nothing_is_learned() {
    let frozen = [
        "algorithm.policy_optimiser.step_size=0",
        "algorithm.value_optimiser.step_size=0",
    ];
    assert_eq!(episodes_until_solved("cartpole.ron", &frozen, 200), None);
}
