//! Who visited a part of the state space first.

use serde::{Deserialize, Serialize};

use super::Division;
use super::visitation::{StateBins, Visitation};
use seedbed_env::TaskSpec;

/// The cells that the team has visited. Agents that visit a cell for the first time in the same round
/// share it equally, so that the shares of all agents add up to the coverage of the team.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VisitedCells {
    /// Whether any agent has visited a cell: `[cells]`
    visited: Vec<bool>,
    /// Number of visited cells.
    count: usize,
}

impl VisitedCells {
    /// No visits.
    #[must_use]
    pub fn new(spec: &TaskSpec) -> Self {
        Self {
            visited: vec![false; Visitation::new(spec).cell_count()],
            count: 0,
        }
    }

    /// Share of cells that any agent has visited, 0 to 1.
    #[must_use]
    pub fn coverage(&self) -> f64 {
        self.count as f64 / self.visited.len() as f64
    }

    /// Adds the states that the local agents visited in a round, `[local agents]`, and those of other
    /// ranks. Returns the share of cells that each local agent was the first to visit in this round:
    /// `[local agents]`
    pub fn add_round(&mut self, visits: &[Vec<StateBins>], division: Division<'_>) -> Vec<f64> {
        let new_cells = division
            .workers
            .map(visits.iter().collect(), |visits| self.new_cells_of(visits));
        let visitors = self.visitors_on_all_ranks(&new_cells, division);
        let cells = self.visited.len() as f64;
        let share = |cell: &usize| 1.0 / (cells * visitors[*cell] as f64);
        let new_coverage = new_cells.iter().map(|cells| {
            let mut sum = 0.0;
            for cell in cells {
                sum += share(cell);
            }
            sum
        });
        let new_coverage = new_coverage.collect();
        for (visited, visitors) in self.visited.iter_mut().zip(&visitors) {
            *visited |= *visitors > 0;
            self.count += usize::from(*visitors > 0);
        }
        new_coverage
    }

    /// The cells that an agent visited in a round and nobody before, in their order.
    fn new_cells_of(&self, visits: &[StateBins]) -> Vec<usize> {
        let mut new_cells = Vec::new();
        for states in visits {
            states.for_each_cell(|cell| {
                if !self.visited[cell] {
                    new_cells.push(cell);
                }
            });
        }
        new_cells.sort_unstable();
        new_cells.dedup();
        new_cells
    }

    /// Number of agents that visited each new cell; empty if there is none. `[cells]`
    fn visitors_on_all_ranks(&self, new_cells: &[Vec<usize>], division: Division<'_>) -> Vec<u64> {
        let local: usize = new_cells.iter().map(Vec::len).sum();
        let is_any_new = division.ranks.sum(vec![local as u64]) != [0];
        if !is_any_new {
            return Vec::new();
        }
        let mut visitors = vec![0; self.visited.len()];
        for cell in new_cells.iter().flatten() {
            visitors[*cell] += 1;
        }
        division.ranks.sum(visitors)
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

    /// Share of cells that each agent was the first to visit, as in [`VisitedCells::add_round`]: `[K]`
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

    fn visit(states: &[f32]) -> StateBins {
        StateBins::of(&spec(2).observations, states)
    }

    /// One grid of 400 cells. Round 0: both agents visit a cell (a half each), agent 1 another one,
    /// twice. Round 1: agent 0 visits a known and two new cells.
    #[test]
    fn first_visits_are_shared_within_a_round() {
        let mut cells = VisitedCells::new(&spec(2));
        let mut new_cells = |visits: [Vec<StateBins>; 2]| {
            let shares = cells.add_round(&visits, Division::NONE);
            let in_cells: Vec<f64> = shares.iter().map(|share| 400.0 * share).collect();
            (in_cells, 400.0 * cells.coverage())
        };
        let both = [
            vec![visit(&[0.0, 0.0])],
            vec![visit(&[0.0, 0.0, 5.0, 5.0, 5.0, 5.0])],
        ];
        assert_eq!(new_cells(both), (vec![0.5, 1.5], 2.0));
        let one = vec![visit(&[5.0, 5.0, 6.0, 6.0]), visit(&[7.0, 7.0])];
        assert_eq!(new_cells([one, Vec::new()]), (vec![2.0, 0.0], 4.0));
        let known = vec![visit(&[7.0, 7.0])];
        assert_eq!(new_cells([known, Vec::new()]), (vec![0.0, 0.0], 4.0));
    }

    /// Three agents in twelve rounds, read round by round and agent by agent.
    #[test]
    fn first_visits_do_not_depend_on_the_order_of_reading() {
        let mut by_round = VisitedCells::new(&spec(2));
        let mut by_agent = FirstRounds::default();
        let value = |agent: u32, round: u32| ((7 * agent + 3 * round * round) % 20) as f32;
        let states = |agent, round| {
            let (one, other) = (value(agent, round), value(agent / 2, round / 2));
            visit(&[one, other, other, one])
        };
        let mut expected = [0.0; 3];
        for round in 0..12 {
            let visits = [0, 1, 2].map(|agent| vec![states(agent, round)]);
            let new = by_round.add_round(&visits, Division::NONE);
            expected
                .iter_mut()
                .zip(new)
                .for_each(|(sum, new)| *sum += new);
        }
        for agent in 0..3 {
            for round in (0..12).rev() {
                by_agent.add(agent as usize, round, &states(agent, round), 400);
            }
        }
        assert!(expected.iter().all(|&coverage| coverage > 0.0));
        for (expected, found) in expected.iter().zip(by_agent.coverage()) {
            assert!((expected - found).abs() < 1e-12);
        }
    }
}
