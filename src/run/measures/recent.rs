//! How different the agents' visits of the latest rounds are.
//!
//! Measures of all visits so far hardly change after a while: differences in early exploration are
//! averaged away. These measures forget.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::diversity::Diversity;
use super::visitation::{self, StateBins, Visitation};
use seedbed_env::TaskSpec;

/// Number of latest rounds whose visits count.
pub const RECENT_ROUNDS: usize = 10;

/// The visits of one agent in the latest [`RECENT_ROUNDS`] rounds.
///
/// Takes two bytes per observation of each state, and the counts of [`Visitation`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecentVisits {
    visitation: Visitation,
    /// States of each round, the oldest round first.
    rounds: VecDeque<Vec<StateBins>>,
}

impl RecentVisits {
    /// No visits.
    #[must_use]
    pub fn new(spec: &TaskSpec) -> Self {
        Self {
            visitation: Visitation::new(spec),
            rounds: VecDeque::new(),
        }
    }

    /// Adds the states that the agent visited in a round, and forgets those of the oldest round if there
    /// are more than [`RECENT_ROUNDS`].
    pub fn add_round(&mut self, visits: Vec<StateBins>) {
        for states in &visits {
            self.visitation.add(states);
        }
        if self.rounds.len() == RECENT_ROUNDS {
            for states in self.rounds.pop_front().iter().flatten() {
                self.visitation.remove(states);
            }
        }
        self.rounds.push_back(visits);
    }

    /// Counts of the visited states.
    #[must_use]
    pub fn visitation(&self) -> &Visitation {
        &self.visitation
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

    fn effective_agents(agents: &[RecentVisits]) -> f64 {
        let visits: Vec<Visitation> = agents
            .iter()
            .map(|agent| agent.visitation.clone())
            .collect();
        let diversity = visitation::diversity_of_team(&visits);
        diversity.unwrap().effective_agents
    }

    /// Two agents visit one cell each, and exchange them after ten rounds: over all rounds they visit the
    /// same, in the latest ten rounds nothing in common. In between, after five further rounds, both
    /// have visited both cells equally often.
    #[test]
    fn old_rounds_are_forgotten() {
        let [left, right] = [states([0.0, 0.0]), states([19.0, 19.0])];
        let mut recent = vec![RecentVisits::new(&spec(2)); 2];
        let mut found = Vec::new();
        for round in 0..20 {
            let [one, other] = if round < 10 {
                [&left, &right]
            } else {
                [&right, &left]
            };
            recent[0].add_round(vec![one.clone()]);
            recent[1].add_round(vec![other.clone()]);
            found.push(effective_agents(&recent));
        }
        for (round, expected) in [(0, 2.0), (9, 2.0), (14, 1.0), (19, 2.0)] {
            assert!((found[round] - expected).abs() < 1e-12, "round {round}");
        }
    }

    /// As long as no round is forgotten, recent visits are all visits. A round without visits counts.
    #[test]
    fn the_first_rounds_are_all_visits() {
        let mut recent = RecentVisits::new(&spec(2));
        let mut all = Visitation::new(&spec(2));
        for round in 0..RECENT_ROUNDS {
            let visited = states([round as f32, 3.0]);
            all.add(&visited);
            recent.add_round(vec![visited]);
        }
        assert_eq!(recent.visitation, all);
        recent.add_round(Vec::new());
        assert!(recent.visitation != all);
    }

    /// Read agent by agent, the recent visits are the same as read round by round.
    #[test]
    fn recent_visits_do_not_depend_on_the_order_of_reading() {
        let mut by_round = vec![RecentVisits::new(&spec(2)); 2];
        let mut by_agent = LatestVisits::default();
        let states_of =
            |agent: u32, round: u32| states([(agent * 3 + round % 7) as f32, (round / 4) as f32]);
        for round in 0..25 {
            by_round[0].add_round(vec![states_of(0, round)]);
            by_round[1].add_round(vec![states_of(1, round)]);
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
        assert_eq!(found.effective_agents, effective_agents(&by_round));
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
