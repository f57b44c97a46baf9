//! Who visited a part of the state space first.

use serde::{Deserialize, Serialize};

use super::visitation::{StateBins, Visitation};
use seedbed_env::TaskSpec;
use seedbed_learn::team::Workers;

/// The cells that the team has visited, and the share of cells that each agent was the first to
/// visit. Agents that visit a cell for the first time in the same round share it equally, so that
/// the shares of all agents add up to the coverage of the team.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FirstVisits {
    /// Whether any agent has visited a cell: `[cells]`
    visited: Vec<bool>,
    /// `[K]`
    coverage: Vec<f64>,
}

impl FirstVisits {
    /// No visits of `agents` agents.
    #[must_use]
    pub fn new(spec: &TaskSpec, agents: usize) -> Self {
        Self {
            visited: vec![false; Visitation::new(spec).cell_count()],
            coverage: vec![0.0; agents],
        }
    }

    /// Share of cells that each agent was the first to visit so far: `[K]`
    #[must_use]
    pub fn coverage(&self) -> &[f64] {
        &self.coverage
    }

    /// Adds the states that agents visited in a round. Returns the share of cells that each agent was
    /// the first to visit in this round: `[K]`
    pub fn add_round(&mut self, visits: &[(u32, StateBins)], workers: Workers<'_>) -> Vec<f64> {
        let mut new_coverage = vec![0.0; self.coverage.len()];
        let cells = self.visited.len() as f64;
        for visitors in self
            .visitors_of_new_cells(visits, workers)
            .chunk_by(|one, next| one.0 == next.0)
        {
            let (cell, _) = visitors[0];
            self.visited[cell] = true;
            for (_, agent) in visitors {
                new_coverage[*agent as usize] += 1.0 / (cells * visitors.len() as f64);
            }
        }
        for (sum, new) in self.coverage.iter_mut().zip(&new_coverage) {
            *sum += new;
        }
        new_coverage
    }

    /// New cells with each agent that visited them in a round, cell by cell.
    fn visitors_of_new_cells(
        &self,
        visits: &[(u32, StateBins)],
        workers: Workers<'_>,
    ) -> Vec<(usize, u32)> {
        let new_cells = workers.map(visits.iter().collect(), |(agent, states)| {
            let mut new_cells = Vec::new();
            states.for_each_cell(|cell| {
                if !self.visited[cell] {
                    new_cells.push((cell, *agent));
                }
            });
            new_cells
        });
        let mut visitors = new_cells.concat();
        visitors.sort_unstable();
        visitors.dedup();
        visitors
    }
}

/// The round in which each agent visited each cell first, for visits that are read agent by agent.
#[derive(Clone, Debug, Default)]
pub struct FirstRounds {
    /// Number of the first round in which an agent visited a cell, `u32::MAX` if it has not:
    /// `[K][cells]`
    rounds: Vec<Vec<u32>>,
}

impl FirstRounds {
    /// Adds the states that an agent visited in a round. `cell_count` is the number of all cells.
    pub fn add(&mut self, agent: usize, round: u32, states: &StateBins, cell_count: usize) {
        if self.rounds.len() <= agent {
            self.rounds.resize(agent + 1, vec![u32::MAX; cell_count]);
        }
        let rounds = &mut self.rounds[agent];
        states.for_each_cell(|cell| rounds[cell] = rounds[cell].min(round));
    }

    /// Share of cells that each agent was the first to visit, as in [`FirstVisits::coverage`]: `[K]`
    #[must_use]
    pub fn coverage(&self) -> Vec<f64> {
        let mut coverage = vec![0.0; self.rounds.len()];
        let cells = self.rounds.first().map_or(0, Vec::len);
        for cell in 0..cells {
            let first = self.rounds.iter().map(|rounds| rounds[cell]).min();
            let is_first = |rounds: &&Vec<u32>| Some(rounds[cell]) == first;
            let visitors = self.rounds.iter().filter(is_first).count();
            if first == Some(u32::MAX) {
                continue;
            }
            for (coverage, rounds) in coverage.iter_mut().zip(&self.rounds) {
                if is_first(&rounds) {
                    *coverage += 1.0 / (cells * visitors) as f64;
                }
            }
        }
        coverage
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::spec;
    use super::*;

    fn visit(agent: u32, states: &[f32]) -> (u32, StateBins) {
        (agent, StateBins::of(&spec(2).observations, states))
    }

    /// One grid of 400 cells. Round 0: both agents visit a cell (a half each), agent 1 another one,
    /// twice. Round 1: agent 0 visits a known and two new cells.
    #[test]
    fn first_visits_are_shared_within_a_round() {
        let mut first = FirstVisits::new(&spec(2), 2);
        let cell = 1.0 / 400.0;
        let near = |values: &[f64], expected: [f64; 2]| {
            values
                .iter()
                .zip(expected)
                .all(|(value, expected)| (value - expected * cell).abs() < 1e-15)
        };
        let round = [
            visit(0, &[0.0, 0.0]),
            visit(1, &[0.0, 0.0, 5.0, 5.0, 5.0, 5.0]),
        ];
        assert!(near(
            &first.add_round(&round, Workers::CURRENT_THREAD),
            [0.5, 1.5]
        ));
        let round = [visit(0, &[5.0, 5.0, 6.0, 6.0]), visit(0, &[7.0, 7.0])];
        assert!(near(
            &first.add_round(&round, Workers::CURRENT_THREAD),
            [2.0, 0.0]
        ));
        assert!(near(first.coverage(), [2.5, 1.5]));
        assert!(near(
            &first.add_round(&round, Workers::CURRENT_THREAD),
            [0.0, 0.0]
        ));
    }

    /// Three agents in twelve rounds, read round by round and agent by agent.
    #[test]
    fn first_visits_do_not_depend_on_the_order_of_reading() {
        let mut by_round = FirstVisits::new(&spec(2), 3);
        let mut by_agent = FirstRounds::default();
        let value = |agent: u32, round: u32| ((7 * agent + 3 * round * round) % 20) as f32;
        for round in 0..12 {
            let visits = [0, 1, 2].map(|agent| {
                let (one, other) = (value(agent, round), value(agent / 2, round / 2));
                visit(agent, &[one, other, other, one])
            });
            by_round.add_round(&visits, Workers::CURRENT_THREAD);
        }
        for agent in 0..3 {
            for round in (0..12).rev() {
                let (one, other) = (value(agent, round), value(agent / 2, round / 2));
                let (_, states) = visit(agent, &[one, other, other, one]);
                by_agent.add(agent as usize, round, &states, 400);
            }
        }
        let [expected, found] = [by_round.coverage().to_vec(), by_agent.coverage()];
        assert!(expected.iter().all(|&coverage| coverage > 0.0));
        for (expected, found) in expected.iter().zip(found) {
            assert!((expected - found).abs() < 1e-12);
        }
    }
}
