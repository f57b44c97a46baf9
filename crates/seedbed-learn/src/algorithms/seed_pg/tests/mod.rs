//! Seed-PG on hand-made episodes of two observations and one binary action.

mod settings;
mod shared_networks;
mod sharing;
mod updates;

use std::ops::Range;

use super::config::*;
use super::*;
use crate::agent::TeamConfig;
use crate::algorithms::AlgorithmConfig;
use crate::scaling::ObservationScaling;
use crate::seed::RewardSeeds;
use crate::team::{AgentUpdate, Learner, LearningRequest, LearningTiming, Workers};
use seedbed_env::{Action, Choice, Quantity, Status, TaskSpec};
use seedbed_input::numbers::{ranged_count, ranged_number};

pub(in crate::algorithms) fn spec() -> TaskSpec {
    let quantity = |name: &str| Quantity {
        name: name.to_owned(),
        unit: String::new(),
        range: [-1.0, 1.0],
    };
    TaskSpec {
        observations: vec![quantity("x"), quantity("y")],
        actions: vec![Action {
            quantity: quantity("push"),
            choice: Choice::Discrete(vec![-1.0, 1.0]),
        }],
        time_limit: 8,
        ..TaskSpec::new("test", Vec::new(), Vec::new())
    }
}

fn agent(config: &SeedPg, number: u32, sigma: f64) -> SeedPgAgent {
    let seeds = RewardSeeds::Normal {
        sigma: ranged_number(sigma),
    };
    let team = TeamConfig {
        count: ranged_count(2),
        seeds: seeds.into(),
        ..TeamConfig::default()
    };
    SeedPgAgent::new(
        config,
        &AgentContext {
            run_seed: 1,
            agent: number,
            team: &team,
            spec: &spec(),
            record_advantages: false,
        },
    )
}

/// A team, or the part of it that acts in this process.
pub(in crate::algorithms) fn build_team(
    config: &dyn AlgorithmConfig,
    team: &TeamConfig,
    local_agents: Option<(u32, u32)>,
) -> Box<dyn Team> {
    config.build(&TeamContext {
        run_seed: 1,
        config: team,
        local_agents,
        spec: &spec(),
        timing: LearningTiming::AfterEpisodes,
        record_advantages: true,
    })
}

/// Agents learn from new episodes, of which some may have no steps here.   `lengths`: with all their steps
pub(in crate::algorithms) fn learn_in_round(
    team: &mut dyn Team,
    agents: Range<u32>,
    (episodes, lengths): (&[Episode], &[u32]),
    round: u32,
) -> Vec<AgentUpdate> {
    let learner = |agent| Learner {
        agent,
        first_new_episode: 0,
        earlier_updates: round,
    };
    let learners: Vec<Learner> = agents.map(learner).collect();
    let request = LearningRequest {
        episodes,
        lengths,
        learners: &learners,
    };
    team.learn(&request, Workers::CURRENT_THREAD)
}

fn episode(agent: u32) -> Episode {
    episode_with_rewards(agent, 0.3)
}

/// An episode of six steps, each with an action of probability ½ under the policy that acted. `phase`:
/// of the wave of its rewards
pub(in crate::algorithms) fn episode_with_rewards(agent: u32, phase: f32) -> Episode {
    let wave =
        |count: usize, phase: f32| (0..count).map(|i| (i as f32 * 0.9 + phase).sin()).collect();
    Episode {
        observations: wave(14, agent as f32),
        actions: vec![0.0, 1.0, 1.0, 0.0, 1.0, 0.0],
        rewards: wave(6, phase),
        log_probs: vec![0.5_f32.ln(); 6],
        outcome: Status::Terminated,
        ..Episode::start(agent, 0, 0, &spec())
    }
}

fn update(learner: &mut SeedPgAgent, agents: impl IntoIterator<Item = u32>, round: u32) -> Update {
    update_on(
        learner,
        &agents.into_iter().map(episode).collect::<Vec<_>>(),
        round,
    )
}

fn update_on(learner: &mut SeedPgAgent, episodes: &[Episode], round: u32) -> Update {
    let lengths: Vec<u32> = episodes
        .iter()
        .map(|episode| episode.length() as u32)
        .collect();
    learner.update(&Experience {
        new_episodes: episodes,
        new_lengths: &lengths,
        all_episodes: episodes,
        earlier_updates: round,
    })
}

fn parameters(agent: &SeedPgAgent) -> Vec<f32> {
    agent
        .tensors()
        .iter()
        .flat_map(|tensor| tensor.values.to_vec())
        .collect()
}

fn own_data() -> SeedPg {
    SeedPg {
        value_data: Data::Own,
        policy_data: Data::Own,
        ..SeedPg::default()
    }
}
