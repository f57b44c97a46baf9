//! Asynchronous rollouts (thesis Fig. 5.2): an agent whose episode has ended learns at once from
//! what has reached it, while the others continue. Time is counted in steps of the environments, so
//! the schedule is the same on any machine.

use serde::{Deserialize, Serialize};

use super::rollout::{EpisodeSlots, Played};
use crate::record::SceneSettings;
use seedbed_env::Environment;
use seedbed_learn::team::Team;

/// A team in the middle of its episodes.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct AsyncRollout {
    clocks: Vec<AgentClock>,
    slots: EpisodeSlots,
}

/// How far one agent has come.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct AgentClock {
    /// Number of episodes begun.
    begun: u32,
    /// Number of steps for which it still learns and does not act.
    learning: u32,
    /// Number of the team's episodes that it has learned from.
    learned: u64,
}

/// When agents act and learn.
#[derive(Clone, Copy, Debug)]
pub(super) struct AsyncConfig<'a> {
    pub(super) run_seed: u64,
    /// Number of episodes that each agent plays in all.
    pub(super) episodes: u32,
    /// Number of steps of the others that an update takes.
    pub(super) learning: u32,
    pub(super) scene: Option<&'a SceneSettings>,
}

impl AsyncRollout {
    pub(super) fn new(run_seed: u64, agents: usize) -> Self {
        Self {
            clocks: vec![AgentClock::default(); agents],
            slots: EpisodeSlots::new(run_seed, agents, 0),
        }
    }

    /// Continues until at least one episode ends, and returns those that ended in that step, in
    /// agent order; none if every agent has played all of its episodes.
    pub(super) fn play(
        &mut self,
        environment: &mut dyn Environment,
        team: &mut dyn Team,
        config: &AsyncConfig<'_>,
    ) -> Played {
        let mut ended = Played::default();
        while ended.episodes.is_empty() && self.has_more(config) {
            self.begin_episodes(environment, config);
            if self.slots.any_playing() {
                self.slots.step(environment, team);
            }
            for clock in &mut self.clocks {
                clock.learning = clock.learning.saturating_sub(1);
            }
            for slot in &mut self.slots.slots {
                if let Some(episode) = slot.observe(environment) {
                    ended.episodes.push(episode);
                    ended.body_trajectories.extend(slot.body_trajectory.take());
                }
            }
        }
        ended
    }

    /// Marks that an agent learns now from the team's first `total` episodes; returns how many of
    /// them it has learned from before, and how often it has learned before.
    pub(super) fn begin_update(
        &mut self,
        agent: u32,
        total: u64,
        config: &AsyncConfig<'_>,
    ) -> (u64, u32) {
        let clock = &mut self.clocks[agent as usize];
        clock.learning = config.learning;
        let learned = std::mem::replace(&mut clock.learned, total);
        (learned, clock.begun - 1)
    }

    /// Number of the team's episodes that every agent has learned from.
    pub(super) fn learned_by_all(&self) -> u64 {
        let learned = self.clocks.iter().map(|clock| clock.learned);
        learned.min().unwrap_or(u64::MAX)
    }

    fn has_more(&self, config: &AsyncConfig<'_>) -> bool {
        let waiting = self
            .clocks
            .iter()
            .any(|clock| clock.begun < config.episodes);
        waiting || self.slots.any_playing()
    }

    fn begin_episodes(&mut self, environment: &mut dyn Environment, config: &AsyncConfig<'_>) {
        for (agent, clock) in (0..).zip(&mut self.clocks) {
            let is_free = !self.slots.slots[agent as usize].is_playing() && clock.learning == 0;
            if is_free && clock.begun < config.episodes {
                let slot = self.slots.renew(config.run_seed, agent, clock.begun);
                slot.start(environment, clock.begun, 0, config.scene);
                clock.begun += 1;
            }
        }
    }
}
