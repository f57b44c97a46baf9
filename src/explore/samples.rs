//! Samples of visited states that do not come from one recording, such as those of the cells of a
//! study.

use std::path::PathBuf;

use super::axes::common_axes;
use super::states::{EpisodeInfo, RunStates, StateColumn};
use super::{ExploredRun, Explorer};
use crate::run::facts::StateQuantity;
use seedbed_env::Quantity;

/// A sample of visited states, such as those of all runs of a cell.
#[derive(Clone, Debug)]
pub struct StateSample {
    /// Name in the page.
    pub name: String,
    /// Observations of which states consist.
    pub observations: Vec<Quantity>,
    /// Number of agents.
    pub agents: usize,
    /// Number of visited states, of which these are a sample.
    pub visited: u64,
    /// Episodes with sampled states.
    pub episodes: Vec<SampledEpisode>,
}

/// The sampled states of one episode.
#[derive(Clone, Debug)]
pub struct SampledEpisode {
    /// Number of the agent, from 0.
    pub agent: u32,
    /// Number of the agent's episode, from 0.
    pub episode: u32,
    /// Return of the episode.
    pub r#return: f32,
    /// `[sampled states × observations]`
    pub states: Vec<f32>,
}

impl Explorer {
    /// A page of samples, for a frame in another page: without links and commands.
    #[must_use]
    pub fn of_samples(samples: Vec<StateSample>) -> Self {
        let runs: Vec<ExploredRun> = samples.into_iter().map(ExploredRun::of_sample).collect();
        Self {
            axes: common_axes(&runs.iter().map(|run| &run.states).collect::<Vec<_>>()),
            runs,
            is_embedded: true,
        }
    }
}

impl ExploredRun {
    fn of_sample(sample: StateSample) -> Self {
        let width = sample.observations.len();
        let mut episodes = sample.episodes;
        episodes.sort_by_key(|episode| (episode.episode, episode.agent));
        let column = |(index, quantity): (usize, &Quantity)| {
            let states = episodes.iter().map(|episode| &episode.states);
            let values: Vec<f32> = states
                .flat_map(|states| states.iter().skip(index).step_by(width))
                .copied()
                .collect();
            StateColumn {
                quantity: quantity.clone(),
                source: StateQuantity::Observation(index),
                nan: values.iter().filter(|value| value.is_nan()).count(),
                values,
            }
        };
        let columns = sample.observations.iter().enumerate().map(column).collect();
        let info = |episode: &SampledEpisode| EpisodeInfo {
            agent: episode.agent,
            episode: episode.episode,
            round: episode.episode,
            length: 0,
            r#return: f64::from(episode.r#return),
            outcome: None,
            kept: (episode.states.len() / width) as u32,
        };
        Self {
            name: sample.name,
            path: PathBuf::new(),
            agent_count: sample.agents,
            states: RunStates {
                columns,
                episodes: episodes.iter().map(info).collect(),
                state_count: sample.visited,
                filmed: Vec::new(),
            },
            filmed: None,
            scenery: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two episodes of a task with two observations are sorted by their numbers.
    #[test]
    fn columns_are_in_the_order_of_episodes() {
        let quantity = |name: &str| Quantity {
            name: name.to_owned(),
            unit: String::new(),
            range: [0.0, 10.0],
        };
        let episode = |agent, episode, states: &[f32]| SampledEpisode {
            agent,
            episode,
            r#return: 1.5,
            states: states.to_vec(),
        };
        let explorer = Explorer::of_samples(vec![StateSample {
            name: "cell".to_owned(),
            observations: vec![quantity("x"), quantity("y")],
            agents: 3,
            visited: 100,
            episodes: vec![
                episode(0, 7, &[5.0, 6.0]),
                episode(2, 1, &[1.0, 2.0, 3.0, 4.0]),
            ],
        }]);
        let states = &explorer.runs[0].states;
        let values: Vec<&[f32]> = states
            .columns
            .iter()
            .map(|column| column.values.as_slice())
            .collect();
        assert_eq!(values, [[1.0, 3.0, 5.0], [2.0, 4.0, 6.0]]);
        let kept: Vec<(u32, u32)> = states
            .episodes
            .iter()
            .map(|episode| (episode.episode, episode.kept))
            .collect();
        assert_eq!(kept, [(1, 2), (7, 1)]);
        assert_eq!(explorer.state_counts(), [3, 100]);
    }
}
