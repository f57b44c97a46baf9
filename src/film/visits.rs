//! How often agents were in each cell of a map, up to each episode that a film shows.

use super::evenly_spaced;
use crate::record::RecordedEpisode;
use crate::record::visitation::{Axes, VisitedState};
use crate::review::selection::{GRID_CELLS, cell_of_pair};

/// Numbers of visited states up to some episodes.
#[derive(Debug)]
pub(super) struct Visits {
    /// The episodes, in ascending order.
    episodes: Vec<u32>,
    /// Number of groups of agents that are counted apart.
    groups: usize,
    /// Number of states, after [`sum_up`](Self::sum_up) up to each episode: `[episodes × groups]`.
    states: Vec<u64>,
    /// The same in each cell of the map of two axes: `[episodes × groups × cells]`; empty with other numbers of axes.
    cells: Vec<u32>,
    axes: Axes,
}

/// Number of cells of a map.
const CELLS: usize = GRID_CELLS * GRID_CELLS;

/// Maximum number of episodes at which a map changes, so that maps need little memory in films of any length.
const MAX_EPISODES: usize = 400;

impl Visits {
    /// No visits yet. `episodes`: the newest episode of each frame, in ascending order
    pub(super) fn new(mut episodes: Vec<u32>, groups: usize, axes: &Axes) -> Self {
        episodes.dedup();
        let episodes = evenly_spaced(episodes, MAX_EPISODES);
        let counters = episodes.len() * groups;
        let cells = if axes.all().len() == 2 { CELLS } else { 0 };
        Self {
            episodes,
            groups,
            states: vec![0; counters],
            cells: vec![0; counters * cells],
            axes: axes.clone(),
        }
    }

    /// Counts the states of an episode, unless it is after all that the film shows.
    pub(super) fn add(&mut self, episode: &RecordedEpisode) {
        let position = self.episodes.partition_point(|&end| end < episode.episode);
        if position == self.episodes.len() {
            return;
        }
        // Each agent is a group of its own, or all are the group 0.
        let group = episode.agent as usize % self.groups;
        let counter = position * self.groups + group;
        self.states[counter] += episode.length() as u64 + 1;
        if self.cells.is_empty() {
            return;
        }
        let cells = &mut self.cells[counter * CELLS..(counter + 1) * CELLS];
        let mut positions = Vec::new();
        for (step, observation) in episode.states().enumerate() {
            let state = VisitedState::without_action(step, observation, episode.bonus(step));
            self.axes.project(&state, &mut positions);
            if let Some(cell) = cell_of_pair(&positions, [0, 1]) {
                cells[cell] += 1;
            }
        }
    }

    /// Adds to the visits of each episode those of all earlier ones.
    pub(super) fn sum_up(mut self) -> Self {
        for counter in self.groups..self.states.len() {
            self.states[counter] += self.states[counter - self.groups];
        }
        let before = self.cells.len() / self.episodes.len().max(1);
        for cell in before..self.cells.len() {
            self.cells[cell] += self.cells[cell - before];
        }
        self
    }

    /// Number of groups of agents.
    pub(super) fn groups(&self) -> usize {
        self.groups
    }

    /// Position of the newest episode that is not after `episode`; of the first one if all are.
    pub(super) fn position(&self, episode: u32) -> usize {
        let not_after = self.episodes.partition_point(|&end| end <= episode);
        not_after.saturating_sub(1)
    }

    /// The episode at this position.
    pub(super) fn episode(&self, position: usize) -> u32 {
        self.episodes.get(position).copied().unwrap_or_default()
    }

    /// Number of states of a group.
    pub(super) fn states(&self, position: usize, group: usize) -> u64 {
        let counter = position * self.groups + group;
        self.states.get(counter).copied().unwrap_or_default()
    }

    /// Numbers of states of a group in the cells of the map.
    pub(super) fn map(&self, position: usize, group: usize) -> &[u32] {
        let first = (position * self.groups + group) * CELLS;
        self.cells.get(first..first + CELLS).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::recorder::BonusRange;
    use seedbed_env::{Quantity, Status};

    fn axes() -> Axes {
        let quantity = |name: &str| Quantity {
            name: name.to_owned(),
            unit: "m".to_owned(),
            range: [0.0, GRID_CELLS as f32],
        };
        Axes::of_quantities(&[quantity("x"), quantity("y")], 10, BonusRange::None)
    }

    /// An episode that visits the lower left corner of each of these cells (column, row).
    fn episode(agent: u32, number: u32, cells: &[[f32; 2]]) -> RecordedEpisode {
        let steps = cells.len() - 1;
        RecordedEpisode {
            agent,
            episode: number,
            round: number,
            observations: cells.concat(),
            actions: vec![0.0; steps],
            info: Vec::new(),
            rewards: vec![0.0; steps],
            intrinsic_rewards: Vec::new(),
            advantages: Vec::new(),
            outcome: Status::Truncated,
        }
    }

    /// Frames up to the episodes 1, 1 and 4; episodes 0 and 3 of two agents, and episode 5, which no frame shows.
    #[test]
    fn visits_up_to_an_episode_are_those_of_all_earlier_ones() {
        let mut visits = Visits::new(vec![1, 1, 4], 2, &axes());
        visits.add(&episode(0, 0, &[[1.5, 0.5], [1.5, 0.5]]));
        visits.add(&episode(1, 3, &[[0.5, 2.5], [0.5, 0.5], [f32::NAN, 0.5]]));
        visits.add(&episode(0, 3, &[[1.5, 0.5]]));
        visits.add(&episode(0, 5, &[[7.5, 7.5]]));
        let visits = visits.sum_up();
        let shown = [0, 1, 3, 4, 9].map(|episode| visits.episode(visits.position(episode)));
        assert_eq!(shown, [1, 1, 1, 4, 4]);
        let states = |episode, agent| visits.states(visits.position(episode), agent);
        assert_eq!([states(1, 0), states(1, 1)], [2, 0]);
        assert_eq!([states(4, 0), states(4, 1)], [3, 3]);
        let visited = |episode, agent| {
            let map = visits.map(visits.position(episode), agent);
            let counts = (0..).zip(map).filter(|(_, count)| **count > 0);
            counts
                .map(|(cell, count)| (cell, *count))
                .collect::<Vec<(usize, u32)>>()
        };
        assert_eq!(visited(1, 0), [(1, 2)]);
        assert_eq!(visited(4, 0), [(1, 3)]);
        assert_eq!(visited(4, 1), [(0, 1), (2 * GRID_CELLS, 1)]);
        assert!(visited(1, 1).is_empty());
    }
}
