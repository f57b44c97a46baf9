//! Picks the recorded states of some agents and episodes: all of them as a density, and evenly spread ones to be drawn one by one.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::env::Status;
use crate::record::rerun::read::{ReadError, RecordedEpisode, Recording};
use crate::record::visitation::{Axes, Density, Seen};

/// Which states are wanted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selection {
    /// Of these agents; of all, if there are none.
    pub agents: Vec<u32>,
    /// Of these of each agent's episodes.
    pub episodes: Range<u32>,
    /// As many of each agent are picked one by one.
    pub sample: usize,
    /// The axes to project on, by their places among all: from left to right.
    pub axes: Vec<usize>,
    /// Pairs of axes over which visits are counted, by their places among all.
    pub pairs: Vec<[usize; 2]>,
}

/// Cells along each side of the grid over a pair of axes.
pub const CELLS: usize = 40;

/// The wanted states of one agent.
#[derive(Clone, Debug)]
pub struct PickedStates {
    /// Whose.
    pub agent: u32,
    /// How many there are.
    pub count: u64,
    /// How many lines pass each pixel, of all of them.
    pub density: Density,
    /// How many of them are in each cell of the wanted pairs' grids: `[pairs × CELLS × CELLS]`, by the second, then by the first axis.
    pub grids: Vec<u32>,
    /// Some of them, evenly spread over time, or all where there are not more than wanted.
    pub sample: Vec<PickedState>,
}

/// One state, and what it belongs to.
#[derive(Clone, Debug, PartialEq)]
pub struct PickedState {
    /// Where it crosses all axes, from 0 to 1: `[all axes]`.
    pub fractions: Vec<f32>,
    /// Where it crosses the wanted ones: `[axes]`.
    pub crossed: Vec<f32>,
    /// The agent's episode.
    pub episode: u32,
    /// The return of that episode.
    pub r#return: f64,
    /// How that episode ended.
    pub outcome: Status,
    /// The bonus of what was done next.
    pub bonus: f32,
}

impl Selection {
    fn holds(&self, episode: &RecordedEpisode) -> bool {
        let wanted = self.agents.is_empty() || self.agents.contains(&episode.agent);
        wanted && self.episodes.contains(&episode.episode)
    }

    /// Reads the wanted states of a recording, in the order of agents. The file is read twice, to know how many there are before any is
    /// picked; memory holds the picked ones.   `seen` is told each wanted episode
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn pick(
        &self,
        recording: &Recording,
        mut seen: impl FnMut(&RecordedEpisode),
    ) -> Result<Vec<PickedStates>, ReadError> {
        let axes = recording.axes();
        let chosen = axes.chosen(&self.axes);
        let mut picked: BTreeMap<u32, PickedStates> = BTreeMap::new();
        self.for_each(recording, |episode| {
            let empty = || PickedStates {
                agent: episode.agent,
                count: 0,
                density: Density::new(&chosen),
                grids: vec![0; self.pairs.len() * CELLS * CELLS],
                sample: Vec::new(),
            };
            picked.entry(episode.agent).or_insert_with(empty).count += episode.length() as u64 + 1;
        })?;
        let mut passed: BTreeMap<u32, u64> = BTreeMap::new();
        self.for_each(recording, |episode| {
            let Some(states) = picked.get_mut(&episode.agent) else {
                return;
            };
            seen(episode);
            let passed = passed.entry(episode.agent).or_default();
            states.take_in(episode, &axes, self, *passed);
            *passed += episode.length() as u64 + 1;
        })?;
        Ok(picked.into_values().collect())
    }

    fn for_each(
        &self,
        recording: &Recording,
        mut take: impl FnMut(&RecordedEpisode),
    ) -> Result<(), ReadError> {
        for episode in recording.episodes()? {
            let episode = episode?;
            if self.holds(&episode) {
                take(&episode);
            }
        }
        Ok(())
    }
}

impl PickedStates {
    /// Takes in an episode before which `passed` states were.
    fn take_in(&mut self, episode: &RecordedEpisode, axes: &Axes, wanted: &Selection, passed: u64) {
        let r#return = episode.total_reward();
        let (mut fractions, mut crossed) = (Vec::new(), Vec::new());
        for (step, observation) in episode.states().enumerate() {
            let bonus = episode.bonus(step);
            axes.project(&Seen::state(step, observation, bonus), &mut fractions);
            crossed.clear();
            crossed.extend(wanted.axes.iter().map(|&axis| fractions[axis]));
            self.density.add(&crossed);
            self.count_pairs(&fractions, &wanted.pairs);
            if is_picked(passed + step as u64, self.count, wanted.sample as u64) {
                self.sample.push(PickedState {
                    fractions: fractions.clone(),
                    crossed: crossed.clone(),
                    episode: episode.episode,
                    r#return,
                    outcome: episode.outcome,
                    bonus,
                });
            }
        }
    }

    fn count_pairs(&mut self, fractions: &[f32], pairs: &[[usize; 2]]) {
        let cell = |axis: usize| ((fractions[axis] * CELLS as f32) as usize).min(CELLS - 1);
        for (grid, [first, second]) in self.grids.chunks_exact_mut(CELLS * CELLS).zip(pairs) {
            grid[cell(*second) * CELLS + cell(*first)] += 1;
        }
    }
}

/// Whether state `index` of `count` is among `sample` evenly spread ones.
#[must_use]
pub fn is_picked(index: u64, count: u64, sample: u64) -> bool {
    count <= sample || (index + 1) * sample / count > index * sample / count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_are_picked_as_wanted() {
        for (count, sample) in [(10, 3), (1000, 999), (7, 7), (5, 9), (123_457, 1000)] {
            let picked: Vec<u64> = (0..count)
                .filter(|&index| is_picked(index, count, sample))
                .collect();
            assert_eq!(picked.len() as u64, sample.min(count));
            let gaps = picked.windows(2).map(|pair| pair[1] - pair[0]);
            assert!(
                gaps.max() <= Some(count.div_ceil(sample)),
                "{count} {sample}"
            );
        }
    }
}
