//! Whose turn it is: agents begin and act at random times.

use std::cmp::Ordering;

use rand_distr::{Distribution, Exp1};

use super::scenario::{Starts, TabularScenario};
use seedbed_env::random::{Purpose, Stream, stream};

/// An agent's time to act. Of equal times, the lower agent's comes first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn {
    /// In units of the mean time between two actions of an agent.
    pub(super) time: f64,
    /// Whose.
    pub(super) agent: u32,
}

impl Turn {
    /// The same agent's next turn.
    pub(super) fn next(self, clock: &mut Stream) -> Self {
        let pause: f64 = Exp1.sample(clock);
        Self {
            time: self.time + pause,
            ..self
        }
    }
}

/// When each agent begins.
pub(super) fn first_turns(scenario: &TabularScenario) -> Vec<Turn> {
    let mut arrivals = stream(scenario.seed, Purpose::TabularArrivals, 0, 0);
    let mut time = 0.0;
    let mut turn = |agent| {
        if let Starts::OneByOne { mean_gap } = scenario.agents.starts {
            let gap: f64 = Exp1.sample(&mut arrivals);
            time += mean_gap.get() * gap;
        }
        Turn { time, agent }
    };
    (0..scenario.agents.count.get()).map(&mut turn).collect()
}

impl Eq for Turn {}

impl Ord for Turn {
    fn cmp(&self, other: &Self) -> Ordering {
        self.time
            .total_cmp(&other.time)
            .then(self.agent.cmp(&other.agent))
    }
}

impl PartialOrd for Turn {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
