//! Episodes of others: which of them an agent chooses, and teams in several processes.

use std::collections::{BTreeMap, BTreeSet};

use super::*;
use crate::agent::bonus::{Bonus, ModelSharing, Rnd, TeamEntropy, Vime};

/// With two sampled trajectories, an agent learns from its own episode and from two of the others,
/// which differ from round to round.
#[test]
fn sampled_sharing_chooses_the_given_number_of_other_trajectories() {
    let config = SeedPg {
        sharing: Sharing::Sampled {
            trajectories: ranged_count(2),
        },
        ..SeedPg::default()
    };
    let mut learner = agent(&config, 3, 0.0);
    let new_episodes: Vec<Episode> = (0..8).map(episode).collect();
    let infos: Vec<EpisodeInfo> = new_episodes.iter().map(EpisodeInfo::from).collect();
    let mut chosen = |round| {
        update_on(&mut learner, &new_episodes, round);
        let chosen = learner.work.chosen_episodes.clone();
        let foretold = Agent::choose_episodes(&learner, &infos, round);
        let as_set = |indices: &[usize]| BTreeSet::from_iter(indices.to_vec());
        assert_eq!(foretold.as_deref().map(as_set), Some(as_set(&chosen)));
        chosen
    };
    let chosen_per_round: Vec<Vec<usize>> = (0..20)
        .map(&mut chosen)
        .map(|mut chosen: Vec<usize>| {
            chosen.sort_unstable();
            chosen
        })
        .collect();
    assert!(
        chosen_per_round
            .iter()
            .all(|chosen| chosen.len() == 3 && chosen.contains(&3) && chosen.is_sorted())
    );
    assert!(
        (0..8).all(|agent| {
            chosen_per_round
                .iter()
                .any(|chosen| chosen.contains(&agent))
        }),
        "{chosen_per_round:?}"
    );
}

/// A team of five agents, or a part of it.
fn team_in_process(config: &SeedPg, local_agents: Option<(u32, u32)>) -> Box<dyn Team> {
    let team = TeamConfig {
        count: ranged_count(5),
        ..TeamConfig::default()
    };
    build_team(config, &team, local_agents)
}

/// Lets agents learn twice from one episode each. Episodes of other agents that they did not choose
/// have no steps. `model`: what agent 0 has learned for the team, after each round
fn learn_in_process(
    team: &mut dyn Team,
    local_agents: std::ops::Range<u32>,
    models: &mut Vec<Option<Vec<u8>>>,
) -> Vec<AgentUpdate> {
    let workers = Workers::CURRENT_THREAD;
    let mut updates = Vec::new();
    for round in 0..2 {
        let mut episodes: Vec<Episode> = (0..5).map(episode).collect();
        let infos: Vec<EpisodeInfo> = episodes.iter().map(EpisodeInfo::from).collect();
        let lengths: Vec<u32> = infos.iter().map(|info| info.length).collect();
        if let Some(chosen) = team.choose_episodes(&infos, round) {
            for (index, episode) in episodes.iter_mut().enumerate() {
                if !chosen.contains(&index) {
                    *episode = Episode::start(index as u32, 0, 0, &spec());
                }
            }
        }
        let new = (&episodes[..], &lengths[..]);
        updates.extend(learn_in_round(team, local_agents.clone(), new, round));
        if local_agents.start == 0 {
            models.push(team.shared_model());
        } else if let Some(model) = &models[round as usize] {
            team.set_shared_model(model, workers).unwrap();
        }
    }
    updates
}

/// Agents 0 and 1 in one process, 2 to 4 in another, as in one process.
#[test]
fn processes_have_the_bits_of_a_team_in_one() {
    let sampled = Sharing::Sampled {
        trajectories: ranged_count(1),
    };
    let vime = |model| {
        Bonus::Vime(Vime {
            model,
            ..Vime::default()
        })
    };
    let entropy = |model| {
        Bonus::TeamEntropy(TeamEntropy {
            model,
            references: ranged_count(10),
            ..TeamEntropy::default()
        })
    };
    let own = SeedPg::default();
    let shared = SeedPg {
        networks: Networks::Shared.into(),
        minibatch: Minibatch::Steps(ranged_count(4)),
        ..SeedPg::default()
    };
    for (settings, sharing, bonus) in [
        (&shared, Sharing::All, Bonus::None),
        (&shared, sampled, vime(ModelSharing::Independent)),
        (&own, Sharing::All, Bonus::None),
        (&own, sampled, Bonus::None),
        (&own, sampled, vime(ModelSharing::Shared)),
        (&own, sampled, vime(ModelSharing::Independent)),
        (&own, sampled, vime(ModelSharing::Frozen)),
        (&own, sampled, Bonus::Rnd(Rnd::default())),
        (&own, sampled, entropy(ModelSharing::Shared)),
        (&own, sampled, entropy(ModelSharing::Independent)),
    ] {
        let config = SeedPg {
            sharing,
            bonus: bonus.clone().into(),
            ..settings.clone()
        };
        let [mut whole, mut first, mut second] =
            [None, Some((0, 2)), Some((2, 5))].map(|local| team_in_process(&config, local));
        let expected = learn_in_process(&mut *whole, 0..5, &mut Vec::new());
        let mut models = Vec::new();
        let updates = learn_in_process(&mut *first, 0..2, &mut models);
        let later_updates = learn_in_process(&mut *second, 2..5, &mut models);
        assert_eq!(models[0].is_some(), bonus.has_shared_model());
        let of_agents = |agents: std::ops::Range<u32>| {
            let updates = expected.iter().cloned();
            let mut updates: Vec<_> = updates
                .filter(|update| agents.contains(&update.agent))
                .collect();
            if agents.start > 0 && bonus.has_shared_model() {
                // The trainer of the whole run adds the error of agent 0.
                for update in &mut updates {
                    update.update.report.prediction_error = None;
                }
            }
            updates
        };
        assert_eq!(updates, of_agents(0..2));
        assert_eq!(later_updates, of_agents(2..5));
        let tensors = [first.tensors(), second.tensors()].concat();
        let as_map = |tensors: Vec<Tensor<'_>>| -> BTreeMap<String, Vec<f32>> {
            let tensors = tensors.into_iter();
            tensors
                .map(|tensor| (tensor.name, tensor.values.into_owned()))
                .collect()
        };
        assert_eq!(as_map(tensors), as_map(whole.tensors()));
    }
}
