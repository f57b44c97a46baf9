//! Tests of teams that plan, on a line: x changes by a tenth of the action.

use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::agent::ActionRandom;
use crate::agent::planning::imagination::ImaginationBuffers;
use crate::team::{Learner, LearningTiming};
use seedbed_env::{Action, Quantity, Status};

fn spec(action: Action) -> TaskSpec {
    let x = Quantity::new("x", "m", [-1.0, 1.0]);
    TaskSpec::new("line", vec![x], vec![action])
}

fn continuous() -> TaskSpec {
    spec(Action::continuous("push", "", [-1.0, 1.0]))
}

fn discrete() -> TaskSpec {
    spec(Action::discrete("push", "", &[-1.0, 1.0]))
}

fn config(draw: ModelDraw) -> SeedPsrl {
    SeedPsrl {
        draw,
        horizon: ranged_count(4),
        hidden: vec![ranged_count(8)],
        ..SeedPsrl::default()
    }
}

fn team_of(
    config: &SeedPsrl,
    spec: &TaskSpec,
    agents: u32,
    local_agents: Option<(u32, u32)>,
) -> SeedPsrlTeam {
    let team = TeamConfig {
        count: ranged_count(agents),
        ..TeamConfig::default()
    };
    let context = TeamContext {
        run_seed: 3,
        config: &team,
        local_agents,
        spec,
        timing: LearningTiming::AfterEpisodes,
        record_advantages: false,
    };
    SeedPsrlTeam::new(config, &context)
}

/// Lets all local agents act in states x; returns the actions.
fn act(team: &SeedPsrlTeam, states: &[f32], step: u32) -> Vec<f32> {
    let count = states.len();
    let agents = team.local_agents();
    let mut random: Vec<ActionRandom> = agents
        .map(|agent| stream(3, Purpose::Action, agent, step).into())
        .collect();
    let (mut actions, mut log_probs) = (vec![9.0; count], vec![9.0; count]);
    let mut request = ActionRequest {
        first_agent: team.first_agent,
        unreported_steps: 0,
        steps: &vec![step; count],
        observations: states,
        playing: &vec![true; count],
        random: &mut random,
        actions: &mut actions,
        log_probs: &mut log_probs,
    };
    team.act(&mut request, &mut ActScratch::default());
    assert!(log_probs.iter().all(|&log_prob| log_prob == 0.0));
    actions
}

fn weights(team: &SeedPsrlTeam) -> Vec<Vec<f32>> {
    let planners = team.planners.iter();
    planners
        .map(|planner| lock(planner).weights.clone())
        .collect()
}

/// An episode of random actions on the line; `reward` of x after the step and the action. Discrete
/// actions are indices: 0 to the left, 1 to the right.
fn episode(agent: u32, spec: &TaskSpec, reward: impl Fn(f32, f32) -> f32) -> Episode {
    let mut random = stream(7, Purpose::Preview, agent, 0);
    let mut episode = Episode::start(agent, 0, 0, spec);
    let is_continuous = spec.actions[0].choice == seedbed_env::Choice::Continuous;
    let mut x = random.random_range(-1.0..1.0);
    episode.observations.push(x);
    for _ in 0..40 {
        let push: f32 = random.random_range(-1.0..1.0);
        let push = if is_continuous { push } else { push.signum() };
        x += 0.1 * push;
        episode.observations.push(x);
        episode.rewards.push(reward(x, push));
        let index = f32::from(push > 0.0);
        episode
            .actions
            .push(if is_continuous { push } else { index });
    }
    episode.outcome = Status::Truncated;
    episode
}

fn learn(team: &mut SeedPsrlTeam, episodes: &[Episode], update: u32) -> Vec<AgentUpdate> {
    let learners: Vec<Learner> = team
        .local_agents()
        .map(|agent| Learner {
            agent,
            first_new_episode: 0,
            earlier_updates: update,
        })
        .collect();
    let lengths: Vec<u32> = episodes.iter().map(|e| e.length() as u32).collect();
    let request = LearningRequest {
        episodes,
        lengths: &lengths,
        learners: &learners,
    };
    let updates = team.learn(&request, Workers::CURRENT_THREAD);
    assert!(updates.iter().all(|update| update.is_finite));
    updates
}

fn trained(team: &mut SeedPsrlTeam, spec: &TaskSpec, reward: impl Fn(f32, f32) -> f32) {
    let episodes: Vec<Episode> = (0..8).map(|agent| episode(agent, spec, &reward)).collect();
    for update in 0..4 {
        learn(team, &episodes, update);
    }
}

/// z is drawn here again, in the order of the weights.
#[test]
fn own_weights_are_the_mean_plus_scaled_deviations_times_the_seeds() {
    let config = SeedPsrl {
        scale: ranged_number(0.5),
        ..config(ModelDraw::Own)
    };
    let mut team = team_of(&config, &continuous(), 2, None);
    trained(&mut team, &continuous(), |x, _| x);
    team.begin_round(1);
    let posterior = team.model.network().posterior();
    for (agent, weights) in weights(&team).iter().enumerate() {
        let mut seeds = stream(3, Purpose::ModelSeeds, agent as u32, 0);
        for (index, weight) in weights.iter().enumerate() {
            let z: f32 = StandardNormal.sample(&mut seeds);
            let expected = posterior.mean[index] + 0.5 * posterior.deviation[index] * z;
            assert!((weight - expected).abs() < 1e-6, "{agent} {index}");
        }
        assert_eq!(weights.len(), team.model.weight_count());
    }
}

/// The weights of two agents in the first and in the second step of an episode, in the next episode,
/// and in the next round.
fn weights_over_time(draw: ModelDraw) -> [Vec<Vec<f32>>; 4] {
    let mut team = team_of(&config(draw), &continuous(), 2, None);
    team.begin_round(0);
    let at = |team: &SeedPsrlTeam, step| {
        act(team, &[0.0, 0.0], step);
        weights(team)
    };
    let [first, second, next] = [0, 1, 0].map(|step| at(&team, step));
    team.begin_round(1);
    [first, second, next, at(&team, 0)]
}

#[test]
fn own_draws_differ_between_agents_and_are_kept() {
    let [first, second, next, round] = weights_over_time(ModelDraw::Own);
    assert_ne!(first[0], first[1]);
    assert!(first == second && first == next && first == round);
}

#[test]
fn the_draw_of_the_team_is_the_same_for_all_agents_and_is_kept() {
    let [first, second, next, round] = weights_over_time(ModelDraw::Team);
    assert_eq!(first[0], first[1]);
    assert!(first == second && first == next && first == round);
}

#[test]
fn fresh_draws_differ_between_agents_episodes_and_rounds() {
    let [first, second, next, round] = weights_over_time(ModelDraw::Fresh);
    assert_ne!(first[0], first[1]);
    assert_eq!(first, second);
    for later in [&next, &round] {
        assert!((0..2).all(|agent| first[agent] != later[agent]));
    }
    assert_ne!(next[0], round[0]);
}

#[test]
fn without_draws_agents_plan_with_the_mean() {
    let team = team_of(&config(ModelDraw::Mean), &continuous(), 2, None);
    let mean = &team.model.network().posterior().mean;
    assert!(weights(&team).iter().all(|weights| weights == mean));
    let mut own = config(ModelDraw::Own);
    own.set_action_selection(ActionSelection::Greedy);
    assert_eq!(own.draw, ModelDraw::Mean);
}

/// If x is rewarded, the best action is to the right everywhere; if −x, to the left.
#[test]
fn agents_plan_for_what_was_rewarded() {
    for (spec, right, left) in [(continuous(), 1.0, -1.0), (discrete(), 1.0, 0.0)] {
        for (sign, expected) in [(1.0, right), (-1.0, left)] {
            let mut team = team_of(&config(ModelDraw::Mean), &spec, 3, None);
            trained(&mut team, &spec, |x, _| sign * x);
            team.begin_round(1);
            for action in act(&team, &[-0.5, 0.0, 0.5], 0) {
                assert!((action - expected).abs() < 0.3, "{action} {expected}");
            }
        }
    }
}

/// Pushes of 0.4 are best. The search does not know that the reward is quadratic.
#[test]
fn a_plan_has_the_action_with_the_highest_reward() {
    let config = SeedPsrl {
        hidden: vec![ranged_count(32)],
        iterations: ranged_count(5),
        ..config(ModelDraw::Mean)
    };
    let mut team = team_of(&config, &continuous(), 1, None);
    trained(&mut team, &continuous(), |_, push| -(push - 0.4).powi(2));
    team.begin_round(1);
    let action = act(&team, &[0.0], 0)[0];
    assert!((action - 0.4).abs() < 0.2, "{action}");
}

/// A plan of 4 actions, each held for 2 steps, of which 3 are executed.
/// What is stored is enough to predict as agents imagine: the reward of one step from the tensors alone.
/// The model has no hidden layer, and its weights are the means.
#[test]
fn stored_tensors_predict_what_agents_imagine() {
    let config = SeedPsrl {
        hidden: Vec::new(),
        ..config(ModelDraw::Mean)
    };
    let spec = continuous();
    let mut team = team_of(&config, &spec, 1, None);
    trained(&mut team, &spec, |x, push| 50.0 * x + push);
    let tensors = team.tensors();
    let tensor = |name: &str| -> Vec<f64> {
        let name = format!("team.dynamics.{name}");
        let found = tensors.iter().find(|tensor| tensor.name == name);
        let found = found.unwrap_or_else(|| panic!("no {name}"));
        found.values.iter().copied().map(f64::from).collect()
    };
    let (x, push) = (0.3_f32, -0.5_f32);
    let [mean, deviation] = ["inputs.mean", "inputs.deviation"].map(tensor);
    let inputs: Vec<f64> = [x, push]
        .iter()
        .zip(mean.iter().zip(&deviation))
        .map(|(&input, (mean, deviation))| {
            ((f64::from(input) - mean) / deviation).clamp(-10.0, 10.0)
        })
        .collect();
    let [weight, bias] = ["mean.layer_0.weight", "mean.layer_0.bias"].map(tensor);
    // Outputs: the change of x, the reward, the end; weights are `[inputs, outputs]`.
    let output = |index: usize| {
        let weighted = inputs.iter().enumerate();
        weighted
            .map(|(input, x)| x * weight[3 * input + index])
            .sum::<f64>()
            + bias[index]
    };
    let expected = tensor("outcomes.unit")[0] * output(1).clamp(-10.0, 10.0);
    let mut returns = [0.0];
    let imagination = Imagination {
        likelihood: team.model.network().likelihood(),
        weights: &team.model.network().posterior().mean,
        units: &team.units,
        discount: 1.0,
        hold: 1,
    };
    imagination.compute_returns(
        &[x],
        &[push],
        &mut ImaginationBuffers::default(),
        &mut returns,
    );
    let imagined = f64::from(returns[0]);
    assert!(
        (imagined - expected).abs() < 1e-4 * expected.abs(),
        "{imagined}, expected {expected}"
    );
    let info = config.planner_info(&spec).unwrap();
    assert_eq!(info.inputs, ["x", "push"]);
    assert_eq!(info.outputs, ["change of x", "reward", "end"]);
}

#[test]
fn actions_are_held_and_plans_are_executed() {
    let config = SeedPsrl {
        hold: ranged_count(2),
        replan_every: ranged_count(3).into(),
        ..config(ModelDraw::Own)
    };
    let mut team = team_of(&config, &continuous(), 1, None);
    team.begin_round(0);
    let actions: Vec<f32> = (0..8).flat_map(|step| act(&team, &[0.1], step)).collect();
    for pair in actions.chunks(2) {
        assert_eq!(pair[0], pair[1], "{actions:?}");
    }
    assert!(actions[0] != actions[2] && actions[2] != actions[4]);
    // Without a new plan, the fourth action would be executed; with one, it is improved.
    team.begin_round(0);
    let again: Vec<f32> = (0..6).flat_map(|step| act(&team, &[-0.9], step)).collect();
    assert_ne!(actions[..6], again[..]);
}

/// The actions of a team after it has learned, and those of a team that continues from its state.
#[test]
fn a_restored_team_acts_and_learns_in_the_same_way() {
    let spec = continuous();
    let mut team = team_of(&config(ModelDraw::Own), &spec, 2, None);
    let rewarded = [episode(0, &spec, |x, _| x)];
    learn(&mut team, &rewarded, 0);
    let mut restored = team_of(&config(ModelDraw::Own), &spec, 2, None);
    restored.restore(&team.save()).unwrap();
    for round in 1..3 {
        team.begin_round(round);
        restored.begin_round(round);
        assert_eq!(act(&team, &[0.3, 0.3], 0), act(&restored, &[0.3, 0.3], 0));
        let reports = [&mut team, &mut restored].map(|team| learn(team, &rewarded, round));
        assert_eq!(reports[0], reports[1]);
    }
    assert_eq!(team.save(), restored.save());
    let mut other = team_of(&SeedPsrl::default(), &spec, 2, None);
    let error = other.restore(&team.save()).unwrap_err();
    assert!(
        error.contains("weights of a model of the dynamics; expected"),
        "{error}"
    );
    let mut bytes = team.save();
    bytes.shared.truncate(bytes.shared.len() - 1);
    assert!(restored.restore(&bytes).is_err());
}

/// The process of agents 0 and 1 trains; that of 2 and 3 copies the model.
#[test]
fn a_divided_team_acts_like_a_whole_one() {
    let spec = continuous();
    let config = config(ModelDraw::Own);
    let mut whole = team_of(&config, &spec, 4, None);
    let mut first = team_of(&config, &spec, 4, Some((0, 2)));
    let mut second = team_of(&config, &spec, 4, Some((2, 4)));
    let rewarded = [episode(0, &spec, |x, _| x)];
    for team in [&mut whole, &mut first, &mut second] {
        learn(team, &rewarded, 0);
    }
    assert_eq!(first.choose_episodes(&[], 0), None);
    assert_eq!(second.choose_episodes(&[], 0), Some(Vec::new()));
    assert_eq!(second.shared_model(), None);
    let model = first.shared_model().unwrap();
    second
        .set_shared_model(&model, Workers::CURRENT_THREAD)
        .unwrap();
    for team in [&mut whole, &mut first, &mut second] {
        team.begin_round(1);
    }
    let parts = [&first, &second].map(|team| act(team, &[0.1, 0.2], 0));
    assert_eq!(act(&whole, &[0.1, 0.2, 0.1, 0.2], 0), parts.concat());
    assert_eq!(second.save(), first.save());
    assert_eq!(whole.initial_tensors().len(), 4 * 4);
    assert_eq!(second.initial_tensors()[..], whole.initial_tensors()[8..]);
    assert_eq!(second.tensors(), Vec::new());
}
