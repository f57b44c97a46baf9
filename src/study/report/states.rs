//! The part of a report in which people select visited states: the page of
//! [`Explorer`](crate::explore::Explorer) in a frame, with the states of one cell per panel.

use std::collections::BTreeMap;

use maud::{Markup, html};

use crate::experiment::run_result::{RunResult, VisitedStates};
use crate::explore::{Explorer, SampledEpisode, StateSample};
use crate::study::evaluate::results::{CellResults, Results};

/// Maximum number of states of all cells, so that the report stays below some megabytes.
const MAX_STATES: usize = 100_000;

/// The frame, if the runs of any cell stored visited states.
pub(super) fn section(results: &Results) -> Option<Markup> {
    let mut samples: Vec<StateSample> = results.cells.iter().filter_map(sample_of).collect();
    if samples.is_empty() {
        return None;
    }
    let max_states = MAX_STATES / samples.len();
    for sample in &mut samples {
        thin(&mut sample.episodes, max_states, sample.observations.len());
    }
    let page = Explorer::of_samples(samples).page();
    Some(html! {
        h2 { "Selecting visited states" }
        p {
            "Drag along an axis to select states; the selection applies to all cells. Each panel shows a uniform sample of each of its \
             cell's runs, so that runs count about equally. Agents of the same number are shown together. "
        }
        iframe.states loading="lazy" title="Visited states of each cell" srcdoc=(page) {}
    })
}

/// States of all runs of a cell, from the longest window of episodes that was stored.
fn sample_of(cell: &CellResults) -> Option<StateSample> {
    let mut sample = StateSample {
        name: cell.description.name.clone(),
        observations: cell.observations(),
        agents: 0,
        visited: 0,
        episodes: Vec::new(),
    };
    for (_, run) in &cell.runs {
        let longest = run.states.iter().max_by_key(|states| states.episodes);
        let Some(states) = longest else { continue };
        sample.agents = sample.agents.max(run.returns.len());
        sample.visited += states.visited;
        sample
            .episodes
            .extend(episodes_of(run, states, sample.observations.len()));
    }
    (sample.visited > 0).then_some(sample)
}

fn episodes_of(run: &RunResult, states: &VisitedStates, width: usize) -> Vec<SampledEpisode> {
    let mut episodes: BTreeMap<(u32, u32), SampledEpisode> = BTreeMap::new();
    for (&(agent, episode), state) in states.visits.iter().zip(states.states.chunks_exact(width)) {
        let returns = run.returns.get(agent as usize);
        let r#return = returns.and_then(|returns| returns.get(episode as usize));
        let sampled = episodes.entry((agent, episode)).or_insert(SampledEpisode {
            agent,
            episode,
            r#return: r#return.map_or(f32::NAN, |&value| value as f32),
            states: Vec::new(),
        });
        sampled.states.extend_from_slice(state);
    }
    episodes.into_values().collect()
}

/// Keeps every n-th state, so that at most `max_states` are left.
fn thin(episodes: &mut Vec<SampledEpisode>, max_states: usize, width: usize) {
    let count: usize = episodes
        .iter()
        .map(|episode| episode.states.len() / width)
        .sum();
    let every = count.div_ceil(max_states.max(1)).max(1);
    let mut number = 0;
    for episode in &mut *episodes {
        let mut kept = Vec::with_capacity(episode.states.len() / every + width);
        for state in episode.states.chunks_exact(width) {
            if number % every == 0 {
                kept.extend_from_slice(state);
            }
            number += 1;
        }
        episode.states = kept;
    }
    episodes.retain(|episode| !episode.states.is_empty());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_thinned_evenly() {
        let episode = |states: &[f32]| SampledEpisode {
            agent: 0,
            episode: 0,
            r#return: 0.0,
            states: states.to_vec(),
        };
        let mut episodes = vec![
            episode(&[0.0, 0.5, 1.0, 1.5, 2.0, 2.5]),
            episode(&[3.0, 3.5]),
            episode(&[4.0, 4.5]),
        ];
        thin(&mut episodes, 5, 2);
        assert_eq!(episodes.len(), 3);
        thin(&mut episodes, 3, 2);
        let kept: Vec<&[f32]> = episodes
            .iter()
            .map(|episode| episode.states.as_slice())
            .collect();
        assert_eq!(kept, [vec![0.0, 0.5, 2.0, 2.5], vec![4.0, 4.5]]);
    }

    /// Two states of one episode and one state of an episode whose return is unknown.
    #[test]
    fn sampled_states_keep_their_episodes() {
        let run = RunResult {
            returns: vec![vec![1.0, 2.0]],
            ..RunResult::default()
        };
        let states = VisitedStates {
            episodes: 9,
            visited: 30,
            states: vec![0.1, 0.2, 0.3],
            visits: vec![(0, 1), (0, 8), (0, 1)],
        };
        let episodes = episodes_of(&run, &states, 1);
        assert_eq!((episodes.len(), episodes[0].r#return), (2, 2.0));
        assert_eq!(episodes[0].states, [0.1, 0.3]);
        assert!(episodes[1].r#return.is_nan());
    }
}
