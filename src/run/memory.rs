//! How much memory a run needs: a rough estimate, so that a run which no machine of this size can hold
//! is refused before it starts.

use super::plan::Plan;

/// Approximate number of bytes that the parts of a run need.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MemoryEstimate {
    /// Networks, optimizers, and replay buffers.
    pub learning: u64,
    /// Episodes of the latest rounds, and those that are kept.
    pub episodes: u64,
    /// Environments, measures, and everything else of each agent.
    pub agents: u64,
}

/// Bytes of an agent without networks and episodes: its copy of the environment, its counts of visited
/// states, and the recorder's data (measured: 270 kB without, 410 kB with a recording).
const BYTES_PER_AGENT: u64 = 400_000;

/// Bytes of a worker process of an environment of Gymnasium (measured: 37 MB for a cart-pole, 131 MB for 64 half
/// cheetahs).
const BYTES_PER_WORKER: u64 = 100_000_000;

/// Copies of the episodes of a round: the one that is played, the one that is recorded, and samples for
/// gradient steps.
const COPIES_OF_A_ROUND: u64 = 4;

impl MemoryEstimate {
    /// Sum of all parts.
    #[must_use]
    pub fn total(&self) -> u64 {
        let parts = [self.learning, self.episodes, self.agents];
        parts.into_iter().fold(0, u64::saturating_add)
    }
}

impl Plan {
    /// Approximate number of bytes that a run of this scenario needs.
    #[must_use]
    pub fn memory(&self) -> MemoryEstimate {
        let (scenario, spec) = (&self.scenario, self.description.spec());
        let agents = scenario.agents.count.get();
        // Episodes may be much shorter than a long time limit.
        let length = u64::from(spec.time_limit.min(10_000));
        let episodes = u64::from(scenario.stop.max_episodes());
        let product = |factors: &[u64]| factors.iter().copied().fold(1, u64::saturating_mul);
        let most_steps = product(&[agents.into(), episodes, length]);
        let steps = most_steps.min(scenario.stop.max_env_steps().unwrap_or(u64::MAX));
        let episodes_per_round = u64::from(scenario.schedule.episodes_per_round());
        let numbers_per_step = (spec.observation_width() + 2 * spec.action_width() + 1) as u64;
        let bytes_per_step = numbers_per_step * size_of::<f32>() as u64;
        let in_round = product(&[u64::from(agents), length, episodes_per_round]);
        let kept = scenario.algorithm.transitions_kept().min(steps);
        let round = product(&[in_round, COPIES_OF_A_ROUND, bytes_per_step]);
        let workers = self.description.worker_count(agents as usize, 1) as u64;
        let workers = product(&[workers, BYTES_PER_WORKER]);
        MemoryEstimate {
            learning: scenario.algorithm.config().memory(spec, agents, steps),
            episodes: round.saturating_add(product(&[kept, bytes_per_step])),
            agents: product(&[agents.into(), BYTES_PER_AGENT]).saturating_add(workers),
        }
    }
}
