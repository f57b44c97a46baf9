//! Selects the recorded states of some agents and episodes: all selected states as a density, and
//! an evenly spaced sample of them to be drawn one by one.

use std::collections::BTreeMap;
use std::ops::Range;

use super::condition::Condition;
use crate::record::visitation::{Axes, Density, Unplaced, VisitedState};
use crate::record::{ReadError, RecordedEpisode, RecordedStates};
use seedbed_env::Status;

/// Agents and episodes that are drawn, or whose statistics are computed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EpisodeSelection {
    /// Agents; all agents if empty.
    pub agents: Vec<u32>,
    /// Range of each agent's episodes.
    pub episodes: Range<u32>,
}

impl EpisodeSelection {
    /// All episodes of all agents.
    #[must_use]
    pub fn all() -> Self {
        Self {
            agents: Vec::new(),
            episodes: 0..u32::MAX,
        }
    }

    /// Whether all episodes of all agents are selected.
    #[must_use]
    pub fn is_all(&self) -> bool {
        *self == Self::all()
    }

    /// Whether an episode of an agent is selected.
    #[must_use]
    pub fn includes(&self, agent: u32, episode: u32) -> bool {
        self.episodes.contains(&episode) && self.includes_agent(agent)
    }

    /// Whether an agent is selected.
    #[must_use]
    pub fn includes_agent(&self, agent: u32) -> bool {
        self.agents.is_empty() || self.agents.contains(&agent)
    }
}

/// Criteria by which states are selected.
#[derive(Clone, Debug, PartialEq)]
pub struct StateSelection {
    /// Agents and episodes whose states are selected.
    pub episodes: EpisodeSelection,
    /// Conditions that a state must all meet.
    pub conditions: Vec<Condition>,
    /// Maximum number of states per agent in the sample.
    pub sample_size: usize,
    /// All axes: those of the recording, or common ones of several recordings.
    pub all_axes: Axes,
    /// Indices of the axes to project on, from left to right.
    pub axes: Vec<usize>,
    /// Indices of the pairs of axes over which visits are counted.
    pub pairs: Vec<[usize; 2]>,
}

/// Number of cells along each side of the grid over a pair of axes.
pub const GRID_CELLS: usize = 40;

/// The selected states of one agent.
#[derive(Clone, Debug)]
pub struct SelectedStates {
    /// Number of the agent.
    pub agent: u32,
    /// Number of selected states.
    pub count: u64,
    /// Numbers of selected states that each selected axis cannot show at their place.
    pub unplaced: Vec<Unplaced>,
    /// Number of lines per pixel, over all selected states.
    pub density: Density,
    /// Number of states per cell of each pair's grid: `[pairs × GRID_CELLS × GRID_CELLS]`; rows are
    /// cells of the second axis, columns of the first. States that are NaN on either axis are in no cell.
    pub grids: Vec<u32>,
    /// Sample of the states, spread over time; all states if they are few enough.
    pub sample: Vec<SelectedState>,
}

/// One state, with its episode.
#[derive(Clone, Debug, PartialEq)]
pub struct SelectedState {
    /// Position on every axis, from 0 to 1, or NaN: `[all axes]`.
    pub axis_positions: Vec<f32>,
    /// Position on the selected axes, from 0 to 1, or NaN: `[selected axes]`.
    pub selected_axis_positions: Vec<f32>,
    /// Number of the agent's episode.
    pub episode: u32,
    /// Return of that episode.
    pub r#return: f64,
    /// How that episode ended.
    pub outcome: Status,
    /// Intrinsic reward of the action taken in this state.
    pub intrinsic_reward: f32,
}

impl StateSelection {
    fn includes(&self, episode: &RecordedEpisode) -> bool {
        self.episodes.includes(episode.agent, episode.episode)
    }

    /// Whether the state at a step of an included episode is selected.
    fn selects(&self, episode: &RecordedEpisode, step: usize) -> bool {
        self.conditions
            .iter()
            .all(|condition| condition.is_met(episode, step))
    }

    /// Number of selected states of an included episode.
    fn count(&self, episode: &RecordedEpisode) -> u64 {
        let selected = (0..=episode.length()).filter(|&step| self.selects(episode, step));
        selected.count() as u64
    }

    /// Reads the selected states of a recording, ordered by agent; calls `on_episode` for each
    /// selected episode. The file is read twice, because a sample can only be spread over all states
    /// when their number is known. Only the sample is held in memory.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn select(
        &self,
        recording: &RecordedStates,
        mut on_episode: impl FnMut(&RecordedEpisode),
    ) -> Result<Vec<SelectedStates>, ReadError> {
        let selected_axes = self.all_axes.subset(&self.axes);
        let mut selected: BTreeMap<u32, SelectedStates> = BTreeMap::new();
        self.for_each_selected_episode(recording, |episode| {
            let empty = || SelectedStates {
                agent: episode.agent,
                count: 0,
                unplaced: vec![Unplaced::default(); self.axes.len()],
                density: Density::new(&selected_axes),
                grids: vec![0; self.pairs.len() * GRID_CELLS * GRID_CELLS],
                sample: Vec::new(),
            };
            selected.entry(episode.agent).or_insert_with(empty).count += self.count(episode);
        })?;
        let mut states_before: BTreeMap<u32, u64> = BTreeMap::new();
        self.for_each_selected_episode(recording, |episode| {
            let Some(states) = selected.get_mut(&episode.agent) else {
                return;
            };
            on_episode(episode);
            let states_before = states_before.entry(episode.agent).or_default();
            states.add_episode(episode, &selected_axes, self, states_before);
        })?;
        Ok(selected.into_values().collect())
    }

    fn for_each_selected_episode(
        &self,
        recording: &RecordedStates,
        mut action: impl FnMut(&RecordedEpisode),
    ) -> Result<(), ReadError> {
        for episode in recording.episodes()? {
            let episode = episode?;
            if self.includes(&episode) {
                action(&episode);
            }
        }
        Ok(())
    }
}

impl SelectedStates {
    /// Adds the selected states of an episode. The agent had `states_before` selected states before
    /// it; this number is advanced.
    fn add_episode(
        &mut self,
        episode: &RecordedEpisode,
        selected_axes: &Axes,
        selection: &StateSelection,
        states_before: &mut u64,
    ) {
        let r#return = episode.total_reward();
        let (mut axis_positions, mut selected_axis_positions) = (Vec::new(), Vec::new());
        for (step, observation) in episode.states().enumerate() {
            if !selection.selects(episode, step) {
                continue;
            }
            let intrinsic_reward = episode.bonus(step);
            let state = VisitedState::without_action(step, observation, intrinsic_reward);
            selection.all_axes.project(&state, &mut axis_positions);
            selected_axes.count_unplaced(&state, &mut self.unplaced);
            selected_axis_positions.clear();
            selected_axis_positions.extend(selection.axes.iter().map(|&axis| axis_positions[axis]));
            self.density.add(&selected_axis_positions);
            self.count_pairs(&axis_positions, &selection.pairs);
            let index = *states_before;
            *states_before += 1;
            if is_sampled(index, self.count, selection.sample_size as u64) {
                self.sample.push(SelectedState {
                    axis_positions: axis_positions.clone(),
                    selected_axis_positions: selected_axis_positions.clone(),
                    episode: episode.episode,
                    r#return,
                    outcome: episode.outcome,
                    intrinsic_reward,
                });
            }
        }
    }

    fn count_pairs(&mut self, axis_positions: &[f32], pairs: &[[usize; 2]]) {
        let grids = self.grids.chunks_exact_mut(GRID_CELLS * GRID_CELLS);
        for (grid, pair) in grids.zip(pairs) {
            if let Some(cell) = cell_of_pair(axis_positions, *pair) {
                grid[cell] += 1;
            }
        }
    }
}

/// The cell of a state in the grid over a pair of axes, whose rows are cells of the second axis; `None` if it is NaN on one of them.
/// `axis_positions`: its position on every axis, from 0 to 1, or NaN
#[must_use]
pub fn cell_of_pair(axis_positions: &[f32], [first, second]: [usize; 2]) -> Option<usize> {
    let cell = |axis: usize| {
        let position = axis_positions[axis];
        let cell = ((position * GRID_CELLS as f32) as usize).min(GRID_CELLS - 1);
        (!position.is_nan()).then_some(cell)
    };
    Some(cell(second)? * GRID_CELLS + cell(first)?)
}

/// Whether the state `index` of `count` states belongs to a sample of `sample_size` states: one of each of as
/// many equal parts, at a random place that is always the same. Equal distances would meet the same steps of
/// all episodes of equal length.
#[must_use]
pub fn is_sampled(index: u64, count: u64, sample_size: u64) -> bool {
    if sample_size == 0 {
        return false;
    }
    if count <= sample_size {
        return true;
    }
    let part = index * sample_size / count;
    let [begin, end] = [part, part + 1].map(|part| (part * count).div_ceil(sample_size));
    index == begin + scrambled(part) % (end - begin)
}

/// The output of SplitMix64 (Steele, Lea & Flood 2014) for a state: numbers of which neighbors are unlike.
fn scrambled(state: u64) -> u64 {
    let mut bits = state.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sample_has_the_requested_size_and_no_wide_gaps() {
        assert!((0..10).all(|index| !is_sampled(index, 10, 0)));
        for (count, sample_size) in [(10, 3), (1000, 999), (7, 7), (5, 9), (123_457, 1000)] {
            let sampled: Vec<u64> = (0..count)
                .filter(|&index| is_sampled(index, count, sample_size))
                .collect();
            assert_eq!(sampled.len() as u64, sample_size.min(count));
            let gaps = sampled.windows(2).map(|pair| pair[1] - pair[0]);
            assert!(
                gaps.max() < Some(2 * count.div_ceil(sample_size)),
                "{count} {sample_size}"
            );
        }
    }

    /// 200 episodes of 301 states each: a sample of 1,000 has nearly all steps, where equal distances have five.
    #[test]
    fn episodes_of_equal_length_are_sampled_at_many_steps() {
        let sampled = (0..200 * 301).filter(|&index| is_sampled(index, 200 * 301, 1000));
        let steps: std::collections::BTreeSet<u64> = sampled.map(|index| index % 301).collect();
        assert!(steps.len() > 250, "{}", steps.len());
    }

    /// The first outputs of SplitMix64 with the seed 0, as its authors' program prints them.
    #[test]
    fn scrambled_numbers_are_those_of_split_mix() {
        let outputs = [0, 1, 2].map(scrambled);
        let expected = [
            0xe220_a839_7b1d_cdaf,
            0x6e78_9e6a_a1b9_65f4,
            0x06c4_5d18_8009_454f,
        ];
        assert_eq!(outputs, expected);
    }
}
