//! Asynchronous rollouts (thesis Fig. 5.2): an agent whose episode has ended learns at once from
//! all finished episodes, while the others continue. Time is counted in environment steps, so that
//! the schedule is the same on every machine.

use serde::{Deserialize, Serialize};

use super::episode_slots::EpisodeSlots;
use super::rollout::PlayedEpisodes;
use crate::scenario::recording::SceneSettings;
use seedbed_env::Environment;
use seedbed_learn::cancellation::cancellation_point;
use seedbed_learn::team::Team;

/// The state of an asynchronous rollout between two calls of [`AsyncRollout::play`].
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct AsyncRollout {
    progress: Vec<AgentProgress>,
    slots: EpisodeSlots,
}

/// How far one agent is.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct AgentProgress {
    /// Number of episodes that the agent has started.
    started: u32,
    /// Number of environment steps until the current update of the agent is complete; the agent
    /// does not act during this time.
    steps_until_learned: u32,
    /// Number of the team's episodes that the agent has learned from.
    learned_episodes: u64,
}

/// When agents act and learn.
#[derive(Clone, Copy, Debug)]
pub(super) struct AsyncConfig<'a> {
    pub(super) run_seed: u64,
    /// Number of episodes per agent in the whole run.
    pub(super) episodes: u32,
    /// Number of environment steps of the other agents that one update takes.
    pub(super) steps_per_update: u32,
    pub(super) scene: Option<&'a SceneSettings>,
}

impl AsyncRollout {
    pub(super) fn new(run_seed: u64, agents: usize) -> Self {
        Self {
            progress: vec![AgentProgress::default(); agents],
            slots: EpisodeSlots::new(run_seed, 0..agents as u32, 0, 0),
        }
    }

    /// Entries of `info` in the episodes that are being played.
    pub(super) fn info(&self) -> Vec<&[f32]> {
        self.slots.info()
    }

    /// Sets what [`info`](Self::info) returned.
    pub(super) fn set_info(&mut self, info: Vec<Vec<f32>>) {
        self.slots.set_info(info);
    }

    /// Continues until a step in which at least one episode ends, and returns the episodes that
    /// ended in this step, in agent order; no episodes if every agent has played all of its
    /// episodes.
    pub(super) fn play(
        &mut self,
        environment: &mut dyn Environment,
        team: &dyn Team,
        config: &AsyncConfig<'_>,
    ) -> PlayedEpisodes {
        let mut ended = PlayedEpisodes::default();
        while ended.episodes.is_empty() && self.has_episodes_left(config) {
            cancellation_point();
            self.begin_episodes(environment, config);
            if self.slots.any_playing() {
                self.slots.step(environment, team, 0);
            }
            for agent_progress in &mut self.progress {
                agent_progress.steps_until_learned =
                    agent_progress.steps_until_learned.saturating_sub(1);
            }
            for slot in &mut self.slots.slots {
                if let Some(episode) = slot.observe(environment) {
                    ended.episodes.push(episode);
                    ended.details.extend(slot.details.take());
                    ended.warnings.extend(slot.warning.take());
                }
            }
        }
        ended
    }

    /// Registers that an agent now learns from the team's first `total` episodes. Returns the
    /// number of the team's episodes that it has learned from before, and the number of its earlier
    /// updates.
    pub(super) fn begin_update(
        &mut self,
        agent: u32,
        total: u64,
        config: &AsyncConfig<'_>,
    ) -> (u64, u32) {
        let agent_progress = &mut self.progress[agent as usize];
        agent_progress.steps_until_learned = config.steps_per_update;
        let learned_before = std::mem::replace(&mut agent_progress.learned_episodes, total);
        (learned_before, agent_progress.started - 1)
    }

    /// Agent and episode in a copy, for people.
    pub(super) fn place_of(&self, copy: usize) -> String {
        self.slots.place_of(copy)
    }

    /// Number of the team's episodes that every agent has learned from.
    pub(super) fn learned_by_all(&self) -> u64 {
        let learned = self
            .progress
            .iter()
            .map(|agent_progress| agent_progress.learned_episodes);
        learned.min().unwrap_or(u64::MAX)
    }

    fn has_episodes_left(&self, config: &AsyncConfig<'_>) -> bool {
        let any_to_start = self
            .progress
            .iter()
            .any(|agent_progress| agent_progress.started < config.episodes);
        any_to_start || self.slots.any_playing()
    }

    fn begin_episodes(&mut self, environment: &mut dyn Environment, config: &AsyncConfig<'_>) {
        let mut resets = false;
        for agent in 0..self.progress.len() {
            if self.is_free(agent, config) {
                let episode = self.progress[agent].started;
                let slot = self.slots.renew(config.run_seed, agent, episode);
                slot.begin_reset(environment);
                resets = true;
            }
        }
        if !resets {
            return;
        }
        environment.finish_resets();
        for agent in 0..self.progress.len() {
            if self.is_free(agent, config) {
                let started = &mut self.progress[agent].started;
                self.slots.slots[agent].start(environment, *started, 0, config.scene);
                *started += 1;
            }
        }
    }

    /// Whether an agent has learned from its latest episode, and has another one to play.
    fn is_free(&self, agent: usize, config: &AsyncConfig<'_>) -> bool {
        let progress = &self.progress[agent];
        !self.slots.slots[agent].is_playing()
            && progress.steps_until_learned == 0
            && progress.started < config.episodes
    }
}
