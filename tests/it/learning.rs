//! Teams of learning agents solve tasks that teams of random agents do not solve.

use std::path::Path;

use seedbed::run::Plan;
use seedbed::run::training::Trainer;
use seedbed_env::TaskDescription;

use super::util::REPOSITORY;

/// A trainer for `scenarios/SCENARIO`, without a recording.
fn load_trainer(scenario_file: &str, overrides: &[&str], threads: usize) -> Trainer {
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    let path = Path::new(REPOSITORY).join("scenarios").join(scenario_file);
    let plan = Plan::load(&path, &overrides).unwrap_or_else(|error| panic!("{error}"));
    Trainer::from_scenario(&plan.scenario, &plan.description, threads).unwrap()
}

/// Number of episodes per agent until the team solves the task, or `None` if it does not solve the
/// task within `max_episodes`.
fn episodes_until_solved(
    scenario_file: &str,
    overrides: &[&str],
    max_episodes: usize,
) -> Option<usize> {
    let mut trainer = load_trainer(scenario_file, overrides, 2);
    while trainer.measures().episodes_per_agent() < max_episodes && !trainer.is_solved() {
        trainer.advance().unwrap();
    }
    trainer
        .is_solved()
        .then(|| trainer.measures().episodes_per_agent())
}

/// Whether at least `min_solved` of the runs with run seeds 0 to 2 solve the task within
/// `max_episodes` episodes per agent. A test of several run seeds still passes after a change that
/// alters single runs.
fn is_solved_in(
    min_solved: usize,
    scenario_file: &str,
    overrides: &[&str],
    max_episodes: usize,
) -> bool {
    let mut solved = 0;
    for run_seed in ["seed=0", "seed=1", "seed=2"] {
        let episodes = episodes_until_solved(
            scenario_file,
            &[overrides, &[run_seed]].concat(),
            max_episodes,
        );
        solved += usize::from(episodes.is_some());
        if solved == min_solved {
            return true;
        }
    }
    false
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
fn sixteen_agents_solve_the_cartpole_sooner_than_four() {
    let episodes_of_two_runs = |scenario_file: &str| -> usize {
        let episodes_of_run = |run_seed| {
            episodes_until_solved(scenario_file, &["physics=Analytic", run_seed], 300)
                .unwrap_or(300)
        };
        ["seed=0", "seed=1"].into_iter().map(episodes_of_run).sum()
    };
    let sixteen = episodes_of_two_runs("cartpole_16.ron");
    let four = episodes_of_two_runs("cartpole.ron");
    assert!(sixteen < four, "{sixteen} and {four} episodes");
}

#[test]
fn one_agent_of_simple_policy_gradient_solves_the_cartpole() {
    assert!(is_solved_in(2, "cartpole_1.ron", &[], 600));
}

#[test]
fn agents_solve_the_analytic_cartpole() {
    assert!(is_solved_in(2, "cartpole.ron", &["physics=Analytic"], 300));
}

#[test]
fn a_gaussian_policy_solves_the_continuous_cartpole() {
    assert!(is_solved_in(1, "cartpole_continuous.ron", &[], 400));
}

#[test]
fn eight_agents_swing_up_the_pendulum() {
    let episodes = episodes_until_solved("pendulum.ron", &[], 200);
    assert!(
        episodes.is_some_and(|episodes| episodes <= 150),
        "{episodes:?}"
    );
}

/// The team's return is the mean over the leader and fifteen followers.
#[test]
fn a_leader_and_its_followers_solve_the_cartpole() {
    assert!(is_solved_in(2, "cartpole_leader.ron", &[], 200));
    assert!(!is_solved_in(
        1,
        "cartpole_leader.ron",
        &["algorithm=Random"],
        50
    ));
}

/// Without the bonus, none of six teams solved the task in 60 episodes.
#[test]
fn team_entropy_lets_teams_solve_the_sparse_mountain_car() {
    let scenario_file = "mountain_car_team_entropy.ron";
    assert!(is_solved_in(2, scenario_file, &[], 40));
    assert!(!is_solved_in(1, scenario_file, &["algorithm=Random"], 40));
}

/// In their first episodes planners spin the pendulum, because they do not know the costs.
#[test]
fn planners_swing_up_the_pendulum_in_few_episodes_and_random_agents_do_not() {
    let stop = "stop=Solved(return: -600, window: 3, at_most: 20)";
    let planners = [
        "algorithm=SeedPsrl(hold: 2)",
        "agents=(count: 4, seeds: Normal(sigma: 0))",
        stop,
    ];
    assert!(is_solved_in(2, "pendulum.ron", &planners, 20));
    assert!(!is_solved_in(
        1,
        "pendulum.ron",
        &["algorithm=Random", stop],
        20
    ));
}

#[test]
fn q_learning_solves_the_cartpole() {
    assert!(is_solved_in(
        2,
        "cartpole_q.ron",
        &["physics=Analytic"],
        200
    ));
    let separate_networks = [
        "physics=Analytic",
        "algorithm.double=false",
        "algorithm.networks=Own",
    ];
    assert!(is_solved_in(1, "cartpole_q.ron", &separate_networks, 300));
}

/// Only 1 of the 2¹⁰ action sequences of deep sea reaches the rewarded state.
#[test]
fn bootstrapped_dqn_solves_deep_sea_and_epsilon_greedy_does_not() {
    let episodes = episodes_until_solved("deep_sea_bootstrapped_dqn.ron", &[], 250);
    assert!(
        episodes.is_some_and(|episodes| episodes <= 200),
        "{episodes:?}"
    );
    let epsilon_greedy = "algorithm=QLearning(exploration: EpsilonGreedy(from: 0.2, to: 0.05, steps: 1000), learning: (observations: Raw, \
                     minibatch: 32, target_every: 4))";
    assert_eq!(
        episodes_until_solved("deep_sea_bootstrapped_dqn.ron", &[epsilon_greedy], 250),
        None
    );
}

/// One network for ten agents, which differ by their indices. Over run seeds 910000 to 910019, all 20
/// teams solved it: in 53 to 174 episodes, with indices of each round in 59 to 182. Teams with one
/// index for all do not solve it. Ten agents with ε-greedy actions sometimes do, one does not.
#[test]
fn agents_with_indices_solve_deep_sea_and_epsilon_greedy_does_not() {
    let scenario = "deep_sea_hyperagent.ron";
    assert!(is_solved_in(2, scenario, &[], 200));
    let one_index = "algorithm.index=Team";
    assert!(!is_solved_in(1, scenario, &[one_index], 250));
    let (alone, of_each_round) = ("agents.count=1", "algorithm.draw=EveryRound");
    assert!(is_solved_in(2, scenario, &[alone, of_each_round], 300));
    let epsilon_greedy = "algorithm=QLearning(exploration: EpsilonGreedy(from: 0.2, to: 0.05, steps: 1000), \
                          learning: (observations: Raw, minibatch: 32, target_every: 4))";
    assert!(!is_solved_in(1, scenario, &[alone, epsilon_greedy], 300));
}

/// One agent with the usual settings of deep Q-learning.
#[test]
fn deep_q_learning_balances_the_pole() {
    assert!(is_solved_in(2, "dqn.ron", &[], 300));
    let without_learning = "algorithm.learning.optimizer.step_size=1e-9";
    assert!(!is_solved_in(1, "dqn.ron", &[without_learning], 300));
}

/// Soft actor-critic, from the transitions of four agents.
#[test]
fn soft_actor_critics_swing_up_the_pendulum_in_few_episodes() {
    assert!(is_solved_in(2, "pendulum_sac.ron", &[], 40));
    assert!(!is_solved_in(
        1,
        "pendulum_sac.ron",
        &["algorithm=Random"],
        60
    ));
}

/// The numbers of episodes are at least those of the tests above.
#[test]
fn random_teams_solve_no_task() {
    for (scenario_file, max_episodes) in [
        ("cartpole.ron", 350),
        ("cartpole_1.ron", 600),
        ("cartpole_continuous.ron", 400),
        ("cartpole_q.ron", 300),
        ("pendulum.ron", 200),
    ] {
        let episodes = episodes_until_solved(scenario_file, &["algorithm=Random"], max_episodes);
        assert_eq!(episodes, None, "{scenario_file}");
    }
}

/// Number of agents, out of four, that reach the goal of sparse mountain car within 40 episodes.
fn count_agents_that_reach_the_goal(overrides: &[&str]) -> usize {
    let mut trainer = load_trainer("mountain_car_vime.ron", overrides, 2);
    let mut reached = [false; 4];
    for _ in 0..40 {
        for row in trainer.advance().unwrap().rows.episodes {
            reached[row.agent as usize] |= row.r#return > 0.0;
        }
    }
    reached.into_iter().filter(|reached| *reached).count()
}

/// With run seeds 0 to 5, all 4 agents with a bonus reach the goal, at most 1 agent without a bonus
/// does, and no random agent does.
#[test]
fn agents_with_a_bonus_reach_the_goal_more_often() {
    assert!(count_agents_that_reach_the_goal(&[]) >= 3);
    assert!(count_agents_that_reach_the_goal(&["algorithm.bonus.Vime.seeds=Scale"]) >= 3);
    assert!(count_agents_that_reach_the_goal(&["algorithm.bonus=None"]) <= 2);
    assert!(count_agents_that_reach_the_goal(&["algorithm=Random"]) <= 1);
}

/// The metric `bonus_agreement` of the third round.
fn bonus_agreement_after_three_rounds(scenario_file: &str, overrides: &[&str]) -> Option<f32> {
    let mut trainer = load_trainer(scenario_file, overrides, 1);
    (0..3)
        .map(|_| trainer.advance().unwrap().rows.updates[0].bonus_agreement)
        .last()
        .flatten()
}

/// With fewer than two dynamics models the agreement is `None`, not 0.
#[test]
fn bonus_agreement_needs_two_dynamics_models() {
    let mountain_car =
        |overrides: &[&str]| bonus_agreement_after_three_rounds("mountain_car_vime.ron", overrides);
    let (same_seeds, seeded) = (
        mountain_car(&[]).unwrap(),
        mountain_car(&["algorithm.bonus.Vime.seeds=Scale"]).unwrap(),
    );
    assert!(
        same_seeds > seeded && same_seeds <= 1.0,
        "{same_seeds} and {seeded}"
    );
    assert_eq!(mountain_car(&["agents.count=1"]), None);
    assert_eq!(mountain_car(&["algorithm.bonus=None"]), None);
    for bonus in ["Rnd", "TeamEntropy"] {
        let of_model = |model| {
            let bonus = format!("algorithm.bonus={bonus}(model: {model})");
            mountain_car(&[&bonus])
        };
        assert_eq!(of_model("Shared"), None, "{bonus}: the same for all agents");
        assert!(of_model("Independent").is_some_and(|agreement| agreement < 1.0));
    }
    let q_learning = |extra_overrides: &[&str]| {
        bonus_agreement_after_three_rounds(
            "cartpole_q.ron",
            &[&["algorithm.bonus=Vime(seeds: Shift)"], extra_overrides].concat(),
        )
    };
    assert_eq!(
        q_learning(&[]),
        None,
        "all agents share one network and one dynamics model"
    );
    assert!(q_learning(&["algorithm.networks=Own"]).is_some_and(|agreement| agreement < 1.0));
}

#[test]
fn asynchronous_agents_solve_the_cartpole() {
    let asynchronous = [
        "physics=Analytic",
        "schedule=Asynchronous(training: (env_steps: 50))",
    ];
    assert!(is_solved_in(2, "cartpole.ron", &asynchronous, 350));
}

/// Without gradient steps, the team that solves the cart-pole above does not solve it.
#[test]
fn teams_with_zero_step_sizes_solve_nothing() {
    let zero_step_sizes = [
        "algorithm.policy_optimizer.step_size=0",
        "algorithm.value_optimizer.step_size=0",
    ];
    assert_eq!(
        episodes_until_solved("cartpole.ron", &zero_step_sizes, 200),
        None
    );
}

/// With `drawn_per_run`, all agents and episodes of a run have the goal of the run seed, in all groups
/// of copies.
#[test]
fn all_agents_of_a_run_have_the_goal_of_its_run_seed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shown.ron");
    let text = r#"Environment(
        extends: "ENVS/corridors_drawn.ron",
        time_limit: 5,
        observations: [(name: "x", range: (-6.0, 6.0)), (name: "goal", range: (0.0, 7.0))],
    )"#;
    let envs = Path::new(REPOSITORY).join("envs");
    std::fs::write(&path, text.replace("ENVS", envs.to_str().unwrap())).unwrap();
    for run_seed in 0..6 {
        let environment = format!("environment={path:?}");
        let seed = format!("seed={run_seed}");
        let overrides = [environment, seed, "agents.count=5".to_owned()];
        let scenario = Path::new(REPOSITORY).join("scenarios/corridors_drawn.ron");
        let plan = Plan::load(&scenario, &overrides).unwrap_or_else(|error| panic!("{error}"));
        let task = plan.description.for_run(run_seed);
        let goal = task.body_task().unwrap().run_constants[0].value;
        let mut trainer = Trainer::from_scenario(&plan.scenario, &plan.description, 2).unwrap();
        let mut seen = 0;
        for _ in 0..2 {
            trainer.advance().unwrap();
            for episode in trainer.newest_episodes() {
                let goals = episode.observations.iter().skip(1).step_by(2);
                goals.for_each(|&shown| assert_eq!(shown, goal, "run seed {run_seed}"));
                seen += episode.observations.len() / 2;
            }
        }
        assert_eq!(
            seen,
            2 * 5 * 6,
            "two episodes of five agents, six states each"
        );
    }
}

/// With `drawn_per_run`, all agents and episodes of a run have the permutation of actions of the run
/// seed. A move to the right has a reward that is not 0: its cost, and the treasure. Cell s has
/// probabilities of left and right for both actions, `[4 s]` to `[4 s + 3]`.
#[test]
fn all_agents_of_a_run_have_the_permutation_of_its_run_seed() {
    for run_seed in [3, 4] {
        let overrides = ["environment=\"deep_sea_permuted\"", "stop=Episodes(9)"];
        let overrides = overrides.map(str::to_owned).into_iter();
        let overrides: Vec<String> = overrides.chain([format!("seed={run_seed}")]).collect();
        let path = Path::new(REPOSITORY).join("scenarios/deep_sea_egreedy.ron");
        let plan = Plan::load(&path, &overrides).unwrap_or_else(|error| panic!("{error}"));
        let task = plan.description.for_run(run_seed);
        let TaskDescription::Tabular(task) = task.as_ref() else {
            panic!("deep sea is tabular");
        };
        let mut trainer = Trainer::from_scenario(&plan.scenario, &plan.description, 1).unwrap();
        let width = task.spec.observation_width();
        let mut steps = 0;
        for _ in 0..3 {
            trainer.advance().unwrap();
            for episode in trainer.newest_episodes() {
                for (t, reward) in episode.rewards.iter().enumerate() {
                    let observation = &episode.observations[t * width..][..width];
                    let cell = observation.iter().position(|&it| it == 1.0).unwrap();
                    let action = episode.actions[t] as usize;
                    let moves_right = task.true_mdp.probabilities[4 * cell + 2 * action + 1] == 1.0;
                    assert_eq!(
                        *reward != 0.0,
                        moves_right,
                        "run seed {run_seed}, cell {cell}"
                    );
                    steps += 1;
                }
            }
        }
        assert_eq!(
            steps,
            3 * 10 * 10,
            "three episodes of ten agents, ten steps each"
        );
    }
}
