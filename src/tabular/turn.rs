//! The order in which agents act: they begin and act at random times.

use std::cmp::Ordering;

use rand_distr::{Distribution, Exp1};

use super::scenario::{Starts, TabularScenario};
use seedbed_random::{Purpose, Stream, stream};

/// Time of an agent's next action. Turns are ordered by time, then by agent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn {
    /// Time, in units of the mean time between two actions of an agent.
    pub(super) time: f64,
    /// Index of the agent.
    pub(super) agent: u32,
}

impl Turn {
    /// The next turn of the same agent.
    pub(super) fn next(self, clock: &mut Stream) -> Self {
        let pause: f64 = Exp1.sample(clock);
        Self {
            time: self.time + pause,
            ..self
        }
    }
}

/// The turn at which each agent begins its first episode: `[K]`.
pub(super) fn first_turns(scenario: &TabularScenario) -> Vec<Turn> {
    let mut arrivals = stream(scenario.seed, Purpose::TabularArrivals, 0, 0);
    let (mut turns, mut time) = (Vec::new(), 0.0);
    for agent in 0..scenario.agents.count.get() {
        if let Starts::OneByOne { mean_gap } = scenario.agents.starts {
            let gap: f64 = Exp1.sample(&mut arrivals);
            time += mean_gap.get() * gap;
        }
        turns.push(Turn { time, agent });
    }
    turns
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
