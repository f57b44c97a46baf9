//! How different the agents' visits of the latest rounds are.
//!
//! Measures of all visits so far hardly change after a while: differences in early exploration are
//! averaged away. These measures forget.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::diversity::Diversity;
use super::visitation::{self, StateBins, Visitation};
use super::visits_of_agents;
use seedbed_env::TaskSpec;
use seedbed_learn::team::Workers;

/// Number of latest rounds whose visits count.
pub const RECENT_ROUNDS: usize = 10;

/// The visits of the latest [`RECENT_ROUNDS`] rounds.
///
/// Takes two bytes per observation of each state, and the counts of [`Visitation`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecentVisits {
    /// `[K]`
    visitation: Vec<Visitation>,
    /// Agents and states of each round, the oldest round first.
    rounds: VecDeque<Vec<(u32, StateBins)>>,
}

impl RecentVisits {
    /// No visits of `agents` agents.
    #[must_use]
    pub fn new(spec: &TaskSpec, agents: usize) -> Self {
        Self {
            visitation: vec![Visitation::new(spec); agents],
            rounds: VecDeque::new(),
        }
    }

    /// Adds the states that agents visited in a round, and forgets those of the oldest round if there
    /// are more than [`RECENT_ROUNDS`].
    pub fn add_round(&mut self, visits: Vec<(u32, StateBins)>, workers: Workers<'_>) {
        let oldest = if self.rounds.len() < RECENT_ROUNDS {
            Vec::new()
        } else {
            self.rounds.pop_front().unwrap_or_default()
        };
        let new = visits_of_agents(&visits, self.visitation.len());
        let old = visits_of_agents(&oldest, self.visitation.len());
        let agents = self.visitation.iter_mut().zip(new).zip(old);
        workers.for_each(&mut agents.collect::<Vec<_>>(), |((agent, new), old)| {
            for (_, states) in *new {
                agent.add(states);
            }
            for (_, states) in *old {
                agent.remove(states);
            }
        });
        self.rounds.push_back(visits);
    }

    /// How different the agents' visits are.
    #[must_use]
    pub fn diversity(&self, workers: Workers<'_>) -> Diversity {
        let agents = self.visitation.iter().collect();
        let entropies = workers.map(agents, Visitation::entropy);
        visitation::diversity(&self.visitation, &entropies, workers)
    }
}

/// The latest visits of each agent, for visits that are read agent by agent.
#[derive(Clone, Debug, Default)]
pub struct LatestVisits {
    /// Rounds and states, the oldest first: `[K]`
    agents: Vec<VecDeque<(u32, StateBins)>>,
}

impl LatestVisits {
    /// Adds the states that an agent visited in a round, which is not before its previous one.
    pub fn add(&mut self, agent: usize, round: u32, states: StateBins) {
        if self.agents.len() <= agent {
            self.agents.resize(agent + 1, VecDeque::new());
        }
        let visits = &mut self.agents[agent];
        visits.push_back((round, states));
        while visits
            .front()
            .is_some_and(|(old, _)| !is_recent(*old, round))
        {
            visits.pop_front();
        }
    }

    /// How different the agents' visits in the latest [`RECENT_ROUNDS`] rounds are. `none` has no
    /// visits. If agents do not share their rounds, the latest rounds are those of each agent. `None` if
    /// no two agents with visits can be compared.
    #[must_use]
    pub fn diversity(&self, none: &Visitation, rounds_are_shared: bool) -> Option<Diversity> {
        let rounds = self.agents.iter().flatten().map(|(round, _)| *round);
        let last = rounds.max().unwrap_or(0);
        let mut visitation = vec![none.clone(); self.agents.len()];
        for (visitation, visits) in visitation.iter_mut().zip(&self.agents) {
            let recent = visits
                .iter()
                .filter(|(round, _)| !rounds_are_shared || is_recent(*round, last));
            recent.for_each(|(_, states)| visitation.add(states));
        }
        visitation::diversity_of_team(&visitation)
    }
}

/// Whether a round is one of the latest, if `last` is the last one.
fn is_recent(round: u32, last: u32) -> bool {
    u64::from(round) + RECENT_ROUNDS as u64 > u64::from(last)
}

#[cfg(test)]
mod tests {
    use super::super::tests::spec;
    use super::*;

    fn states(values: [f32; 2]) -> StateBins {
        StateBins::of(&spec(2).observations, &values)
    }

    /// Two agents visit one cell each, and exchange them after ten rounds: over all rounds they visit the
    /// same, in the latest ten rounds nothing in common. In between, after five further rounds, both
    /// have visited both cells equally often.
    #[test]
    fn old_rounds_are_forgotten() {
        let [left, right] = [states([0.0, 0.0]), states([19.0, 19.0])];
        let mut recent = RecentVisits::new(&spec(2), 2);
        let mut effective_agents = Vec::new();
        for round in 0..20 {
            let [one, other] = if round < 10 {
                [&left, &right]
            } else {
                [&right, &left]
            };
            recent.add_round(
                vec![(0, one.clone()), (1, other.clone())],
                Workers::CURRENT_THREAD,
            );
            effective_agents.push(recent.diversity(Workers::CURRENT_THREAD).effective_agents);
        }
        let expected = [(0, 2.0), (9, 2.0), (14, 1.0), (19, 2.0)];
        for (round, expected) in expected {
            assert!(
                (effective_agents[round] - expected).abs() < 1e-12,
                "round {round}"
            );
        }
    }

    /// As long as no round is forgotten, recent visits are all visits.
    #[test]
    fn the_first_rounds_are_all_visits() {
        let mut recent = RecentVisits::new(&spec(2), 2);
        let mut all = vec![Visitation::new(&spec(2)); 2];
        for round in 0..RECENT_ROUNDS {
            let visits =
                [0, 1].map(|agent| (agent, states([(round * agent as usize) as f32, 3.0])));
            for (agent, states) in &visits {
                all[*agent as usize].add(states);
            }
            recent.add_round(visits.to_vec(), Workers::CURRENT_THREAD);
        }
        assert_eq!(recent.visitation, all);
        recent.add_round(Vec::new(), Workers::CURRENT_THREAD);
        assert!(recent.visitation != all);
    }

    /// Read agent by agent, the recent visits are the same as read round by round.
    #[test]
    fn recent_visits_do_not_depend_on_the_order_of_reading() {
        let mut by_round = RecentVisits::new(&spec(2), 2);
        let mut by_agent = LatestVisits::default();
        let states_of =
            |agent: u32, round: u32| states([(agent * 3 + round % 7) as f32, (round / 4) as f32]);
        for round in 0..25 {
            by_round.add_round(
                vec![(0, states_of(0, round)), (1, states_of(1, round))],
                Workers::CURRENT_THREAD,
            );
        }
        for agent in 0..2 {
            for round in 0..25 {
                by_agent.add(agent as usize, round, states_of(agent, round));
            }
        }
        let found = by_agent
            .diversity(&Visitation::new(&spec(2)), true)
            .unwrap();
        assert!(found.effective_agents > 1.1 && found.effective_agents < 1.99);
        assert_eq!(
            found.effective_agents,
            by_round.diversity(Workers::CURRENT_THREAD).effective_agents
        );
    }

    /// Agent 1 has played fewer episodes: it has no recent visits if rounds are shared, otherwise its
    /// latest visits count.
    #[test]
    fn latest_visits_are_those_of_each_agent_if_rounds_are_not_shared() {
        let mut visits = LatestVisits::default();
        for (agent, rounds) in [(0, 30), (1, 12)] {
            for round in 0..rounds {
                visits.add(agent, round, states([10.0 * agent as f32; 2]));
            }
        }
        let effective_agents = |rounds_are_shared| {
            let none = Visitation::new(&spec(2));
            let found = visits.diversity(&none, rounds_are_shared);
            found.unwrap().effective_agents
        };
        assert_eq!(effective_agents(true), 1.0);
        assert!((effective_agents(false) - 2.0).abs() < 1e-12);
    }
}
