//! Planning compared with closed forms and with exhaustive search.

use approx::assert_relative_eq;
use proptest::prelude::*;
use seedbed::tabular::planner::{Optimism, Planner};
use seedbed_env::tabular::{
    BipolarChain, DeepSea, MaximumRewardPath, Mdp, Model, Outcome, ParallelChains, Reward,
    TaskFamily,
};

fn parse_task(text: &str) -> TaskFamily {
    seedbed_input::parse("test", text.to_owned())
        .unwrap_or_else(|error| panic!("{error}"))
        .value
}

/// Optimal value of the task that is drawn with a run seed.
fn optimal_value(task: &TaskFamily, run_seed: u64) -> f64 {
    let model = task.model(run_seed);
    Planner::new(&model).optimal_value(&model, &task.draw_mdp(&model, run_seed))
}

/// From vertex 50 of 100, the left end is 50 steps away and the right end 49 steps. The step to the
/// better end is rewarded with 100, and each step before it costs 1, so the value is 100 − 49 or
/// 100 − 48.
#[test]
fn optimal_value_of_a_bipolar_chain() {
    let task = TaskFamily::BipolarChain(BipolarChain::default());
    let model = task.model(0);
    let value_for_parameter = |parameter: f64| {
        let mdp = Mdp {
            values: vec![parameter],
            probabilities: vec![1.0; model.outcomes().len()],
        };
        Planner::new(&model).optimal_value(&model, &mdp)
    };
    assert_eq!(
        (value_for_parameter(-1.0), value_for_parameter(1.0)),
        (51.0, 52.0)
    );
    let mut drawn_values: Vec<f64> = (0..20)
        .map(|run_seed| optimal_value(&task, run_seed))
        .collect();
    drawn_values.sort_by(f64::total_cmp);
    drawn_values.dedup();
    assert_eq!(drawn_values, [51.0, 52.0]);
}

/// The optimal value of parallel chains is the largest θ.
#[test]
fn optimal_value_of_parallel_chains() {
    let task = TaskFamily::ParallelChains(ParallelChains::default());
    for run_seed in 0..5 {
        let model = task.model(run_seed);
        let true_mdp = task.draw_mdp(&model, run_seed);
        let largest = true_mdp
            .values
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        assert_eq!(
            optimal_value(&task, run_seed),
            largest,
            "run seed {run_seed}"
        );
    }
}

/// N moves to the right cost 0.01 in total and earn 1. If moves slip with probability p, the reward
/// is only earned if none of the N moves slips.
#[test]
fn optimal_value_of_deep_sea() {
    for (size, run_seed) in [(2, 0), (10, 3), (50, 7)] {
        let task = parse_task(&format!("DeepSea(size: {size})"));
        assert_relative_eq!(optimal_value(&task, run_seed), 0.99, max_relative = 1e-12);
    }
    // N = 2, p = ½: moving right at the start has the value (1/2)(−0.005 + V), where V = (1/2)(1 −
    // 0.005) is the value of the right state of the last row. In the left state, moving right only
    // costs, so its value is 0.
    let slipping = parse_task("DeepSea(size: 2, slip: 0.5)");
    assert_relative_eq!(
        optimal_value(&slipping, 0),
        0.5 * (-0.005 + 0.5 * 0.995),
        max_relative = 1e-12
    );
    assert_eq!(TaskFamily::DeepSea(DeepSea::default()).name(), "DeepSea");
}

/// Optimal value of `state` with `steps` remaining steps, computed by trying all paths.
fn exhaustive_value(model: &Model, mdp: &Mdp, state: u32, steps: u32) -> f64 {
    let outcome_value = |outcome: usize| {
        model.mean_reward(outcome, &mdp.values)
            + exhaustive_value(model, mdp, model.outcomes()[outcome].state, steps - 1)
    };
    let pair_value = |pair: usize| {
        model
            .outcomes_of(pair)
            .map(|outcome| mdp.probabilities[outcome] * outcome_value(outcome))
            .sum::<f64>()
    };
    if steps == 0 || model.pairs(state).is_empty() {
        return 0.0;
    }
    model
        .pairs(state)
        .map(pair_value)
        .fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn paths_in_random_graphs_are_optimal() {
    assert_eq!(MaximumRewardPath::default().vertices.get(), 100);
    for run_seed in 0..5 {
        let task = parse_task("MaximumRewardPath(vertices: 8, steps: 5)");
        let model = task.model(run_seed);
        let true_mdp = task.draw_mdp(&model, run_seed);
        assert_relative_eq!(
            optimal_value(&task, run_seed),
            exhaustive_value(&model, &true_mdp, 0, 5),
            max_relative = 1e-12
        );
    }
}

/// Random models with three states, which have two actions with two outcomes each, and a terminal
/// state.
fn small_mdp() -> impl Strategy<Value = (Model, Mdp)> {
    let outcome = (0..4_u32, -2.0..2.0);
    let outcomes = prop::collection::vec(outcome, 12);
    (outcomes, prop::collection::vec(0.0..1.0, 6)).prop_map(|(outcomes, first_probabilities)| {
        let outcome = |&(state, reward): &(u32, f64)| Outcome {
            state,
            reward: Reward::known(reward),
        };
        let pairs: Vec<Vec<Outcome>> = outcomes
            .chunks(2)
            .map(|pair| pair.iter().map(outcome).collect())
            .collect();
        let actions: Vec<Vec<Vec<Outcome>>> =
            pairs.chunks(2).map(<[_]>::to_vec).chain([vec![]]).collect();
        let probabilities = first_probabilities
            .iter()
            .flat_map(|p| [*p, 1.0 - p])
            .collect();
        (
            Model::new(0, 4, &actions),
            Mdp {
                values: vec![],
                probabilities,
            },
        )
    })
}

proptest! {
    #[test]
    fn backward_induction_is_optimal((model, mdp) in small_mdp()) {
        let value = Planner::new(&model).optimal_value(&model, &mdp);
        prop_assert!((value - exhaustive_value(&model, &mdp, 0, 4)).abs() < 1e-9);
    }

    /// Optimism 0 does not change the value. With optimism 1, the best outcome is certain.
    #[test]
    fn optimism_never_lowers_a_value((model, mdp) in small_mdp(), optimism in 0.0..1.0) {
        let value_with = |optimism_of_outcomes: &[f64]| {
            let mut planner = Planner::new(&model);
            let mut policy = planner.empty_policy();
            let optimism = Optimism {
                outcomes: optimism_of_outcomes,
                bonuses: &[],
            };
            planner.plan(&model, &mdp, optimism, 0, &mut policy);
            planner.value(0)
        };
        let value_without_optimism = value_with(&[]);
        prop_assert!((value_with(&[0.0; 12]) - value_without_optimism).abs() < 1e-12);
        prop_assert!(value_with(&[optimism; 12]) >= value_without_optimism - 1e-12);
        prop_assert!(value_with(&[1.0; 12]) >= value_with(&[optimism; 12]) - 1e-12);
    }

    /// Bonuses of pairs are the same as larger rewards of their outcomes.
    #[test]
    fn bonuses_are_rewards_of_pairs(
        (model, mdp) in small_mdp(), bonuses in prop::collection::vec(0.0..1.0, 6),
    ) {
        let actions: Vec<Vec<Vec<Outcome>>> = (0..model.state_count() as u32)
            .map(|state| model.pairs(state).map(|pair| rewarded(&model, pair, bonuses[pair])).collect())
            .collect();
        let rewarded = Model::new(0, 4, &actions);
        let mut planner = Planner::new(&model);
        let mut policy = planner.empty_policy();
        let optimism = Optimism { outcomes: &[], bonuses: &bonuses };
        planner.plan(&model, &mdp, optimism, 0, &mut policy);
        let expected = Planner::new(&rewarded).optimal_value(&rewarded, &mdp);
        prop_assert!((planner.value(0) - expected).abs() < 1e-9);
    }

    /// The value of a policy is the mean reward of its first pair, plus those of the pairs that it is
    /// expected to choose later.
    #[test]
    fn expected_choices_have_the_value_of_the_policy((model, mdp) in small_mdp()) {
        let mut planner = Planner::new(&model);
        let mut policy = planner.empty_policy();
        planner.plan(&model, &mdp, Optimism::default(), 0, &mut policy);
        let reward = |pair| -> f64 {
            let outcomes = model.outcomes_of(pair);
            outcomes.map(|index| mdp.probabilities[index] * model.outcomes()[index].reward.known).sum()
        };
        let first = model.pairs(0).start + planner.action(&policy, 0, 0);
        let choices = planner.expected_choices(&model, &mdp, &policy, (0, 0));
        let later: f64 = choices.iter().map(|&(pair, share)| share * reward(pair)).sum();
        prop_assert!((planner.value(0) - reward(first) - later).abs() < 1e-9);
        let last = planner.expected_choices(&model, &mdp, &policy, (3, 0));
        prop_assert!(last.is_empty());
    }
}

/// The outcomes of a pair with `bonus` added to their rewards.
fn rewarded(model: &Model, pair: usize, bonus: f64) -> Vec<Outcome> {
    let outcomes = model.outcomes_of(pair).map(|index| model.outcomes()[index]);
    let add = |outcome: Outcome| Outcome {
        reward: Reward::known(outcome.reward.known + bonus),
        ..outcome
    };
    outcomes.map(add).collect()
}
