//! Returns of a team in the order of its episodes, and whether they reach a threshold.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::run::facts::returns::final_return;
use crate::run::facts::{EpisodeRow, FINAL_WINDOW};
use crate::scenario::{Rounding, Threshold};

/// The returns and the number of steps of a team so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct TeamReturns {
    /// Number of environment steps of the whole team.
    pub(super) env_steps: u64,
    /// Entry n is the mean over agents of the return of their episode n.
    means: Vec<f64>,
    /// For each agent, the returns of episodes that not all agents have finished: `[K]`
    unmatched: Vec<VecDeque<f64>>,
    /// For each agent, the returns of its last [`FINAL_WINDOW`] episodes: `[K]`
    last: Vec<VecDeque<f64>>,
}

impl TeamReturns {
    /// A team of `agents` agents before its first episode.
    pub(super) fn new(agents: usize) -> Self {
        Self {
            env_steps: 0,
            means: Vec::new(),
            unmatched: vec![VecDeque::new(); agents],
            last: vec![VecDeque::new(); agents],
        }
    }

    /// Adds the episodes of a round, and fills in the number of steps up to each of them.
    pub(super) fn add(&mut self, rows: &mut [EpisodeRow]) {
        for row in rows {
            self.env_steps += u64::from(row.length);
            row.env_steps = self.env_steps;
            let agent = row.agent as usize;
            self.unmatched[agent].push_back(row.r#return);
            let last = &mut self.last[agent];
            last.push_back(row.r#return);
            if last.len() > FINAL_WINDOW {
                last.pop_front();
            }
        }
        while self.unmatched.iter().all(|returns| !returns.is_empty()) {
            let returns = self.unmatched.iter_mut().filter_map(VecDeque::pop_front);
            let returns: Vec<f64> = returns.collect();
            self.means.push(mean(&returns));
        }
    }

    /// Number of episodes that every agent has finished.
    pub(super) fn episodes_per_agent(&self) -> usize {
        self.means.len()
    }

    /// See [`Measures::final_return`](super::Measures::final_return).
    pub(super) fn final_return(&self) -> Option<f64> {
        let counts = self.unmatched.iter();
        let counts = counts.map(|unmatched| self.means.len() + unmatched.len());
        let last = self.last.iter();
        let last = last.map(|returns| returns.iter().copied().collect::<Vec<f64>>());
        final_return(counts, &self.means, last)
    }

    /// See [`Measures::reaches`](super::Measures::reaches).
    pub(super) fn reach(&self, threshold: Threshold) -> bool {
        let start = self.means.len().checked_sub(threshold.window);
        start.is_some_and(|start| {
            threshold.is_reached_by(&self.means[start..], Rounding::SingleRewards)
        })
    }

    /// See [`Measures::episodes_until`](super::Measures::episodes_until).
    pub(super) fn episodes_until(&self, threshold: Threshold) -> Option<usize> {
        threshold.first_window(&self.means, Rounding::SingleRewards)
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
