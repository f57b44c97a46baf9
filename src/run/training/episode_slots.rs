//! The episodes that a group of agents is playing, one slot per agent.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::episode_warning::EpisodeWarning;
use crate::run::facts::EpisodeDetails;
use crate::scenario::recording::SceneSettings;
use seedbed_env::{Environment, Pose, Status};
use seedbed_learn::experience::Episode;
use seedbed_learn::rollout::{ActingAgents, GroupStep, Player};
use seedbed_learn::team::Team;
use seedbed_random::{Purpose, Stream, stream};
use seedbed_scene::outline::terrain_lines;

/// The episodes that consecutive agents are playing, one slot per agent. The agents act in
/// consecutive copies of an environment.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct EpisodeSlots {
    pub(super) slots: Vec<EpisodeSlot>,
    agents: ActingAgents,
}

impl EpisodeSlots {
    /// Slots for some agents, which act in the copies from `first_copy` on, with the random streams
    /// of round number `round`.
    pub(super) fn new(run_seed: u64, agents: Range<u32>, first_copy: usize, round: u32) -> Self {
        Self {
            slots: agents
                .clone()
                .zip(first_copy..)
                .map(|(agent, copy)| EpisodeSlot::new(run_seed, agent, copy, round))
                .collect(),
            agents: ActingAgents::new(run_seed, agents, round),
        }
    }

    /// Gives an agent a new slot, with the streams of `round`. `index`: that of its present slot
    pub(super) fn renew(&mut self, run_seed: u64, index: usize, round: u32) -> &mut EpisodeSlot {
        let slot = &mut self.slots[index];
        let (agent, copy) = (slot.agent, slot.copy);
        self.agents.renew(index, run_seed, agent, round);
        *slot = EpisodeSlot::new(run_seed, agent, copy, round);
        slot
    }

    /// Entries of `info` in the episode of each slot so far: `[agents]`
    pub(super) fn info(&self) -> Vec<&[f32]> {
        let details = self.slots.iter().map(|slot| slot.details.as_ref());
        let info = details.map(|details| details.map_or(&[][..], |details| &details.info));
        info.collect()
    }

    /// Sets what [`info`](Self::info) returned.
    pub(super) fn set_info(&mut self, info: Vec<Vec<f32>>) {
        for (slot, info) in self.slots.iter_mut().zip(info) {
            if let Some(details) = &mut slot.details {
                details.info = info;
            }
        }
    }

    /// Agent and episode in a copy, for people.
    pub(super) fn place_of(&self, copy: usize) -> String {
        let slot = self.slots.iter().find(|slot| slot.copy == copy);
        let Some(slot) = slot else {
            return String::new();
        };
        match &slot.playing {
            Some(episode) => format!("agent {}, episode {}", slot.agent, episode.episode),
            None => format!("agent {}", slot.agent),
        }
    }

    pub(super) fn any_playing(&self) -> bool {
        self.slots.iter().any(EpisodeSlot::is_playing)
    }

    /// All playing agents act, and all copies advance by one step. The environment has no other
    /// copies than those of these agents. `unreported_steps`: see [`ActionRequest`].
    pub(super) fn step(
        &mut self,
        environment: &mut dyn Environment,
        team: &dyn Team,
        unreported_steps: u32,
    ) {
        let actions = self.act(environment, team, unreported_steps);
        environment.step(actions);
    }

    /// All playing agents choose their next actions: `[agents × action width]`, one row per agent.
    /// Rows of other agents have no meaning.
    pub(super) fn act(
        &mut self,
        environment: &dyn Environment,
        team: &dyn Team,
        unreported_steps: u32,
    ) -> &[f32] {
        let observation_width = environment.spec().observation_width();
        let EpisodeSlot { agent, copy, .. } = self.slots[0];
        let step = GroupStep {
            first_agent: agent,
            action_width: environment.spec().action_width(),
            unreported_steps,
            observations: &environment.observations()[copy * observation_width..]
                [..self.slots.len() * observation_width],
        };
        self.agents.act(team, &step, &mut self.slots)
    }
}

/// Details of an episode in a checkpoint: the fields in their order without entries of `info`, which earlier versions
/// did not have.
mod without_info {
    use super::EpisodeDetails;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[expect(
        clippy::ref_option,
        reason = "serde calls it with a reference to the field"
    )]
    pub(super) fn serialize<S: Serializer>(
        details: &Option<EpisodeDetails>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let fields = |of: &EpisodeDetails| {
            let forces = (of.forces.clone(), of.forces_per_row.clone());
            (
                of.agent,
                of.episode,
                of.poses.clone(),
                forces,
                of.terrain.clone(),
            )
        };
        details.as_ref().map(fields).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<EpisodeDetails>, D::Error> {
        let fields = Option::deserialize(deserializer)?;
        Ok(fields.map(
            |(agent, episode, poses, (forces, forces_per_row), terrain)| EpisodeDetails {
                agent,
                episode,
                poses,
                forces,
                forces_per_row,
                terrain,
                info: Vec::new(),
            },
        ))
    }
}

/// The episode that one agent is playing, if any.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct EpisodeSlot {
    agent: u32,
    /// Index of the agent's copy in its environment.
    copy: usize,
    resets: Stream,
    pub(super) playing: Option<Episode>,
    /// Bodies and entries of `info` during the episode that is playing or has just ended, if there are any
    /// to record. Checkpoints store entries of `info` [separately](EpisodeSlots::info).
    #[serde(with = "without_info")]
    pub(super) details: Option<EpisodeDetails>,
    /// The physics warning of the episode that has just ended.
    #[serde(skip)]
    pub(super) warning: Option<EpisodeWarning>,
}

impl Player for EpisodeSlot {
    fn playing(&mut self) -> Option<&mut Episode> {
        self.playing.as_mut()
    }
}

impl EpisodeSlot {
    /// A slot that draws start states from the random stream of (run seed, agent, `round`).
    fn new(run_seed: u64, agent: u32, copy: usize, round: u32) -> Self {
        Self {
            agent,
            copy,
            resets: stream(run_seed, Purpose::Reset, agent, round),
            playing: None,
            details: None,
            warning: None,
        }
    }

    pub(super) fn is_playing(&self) -> bool {
        self.playing.is_some()
    }

    /// Begins to reset the agent's copy of the environment.
    pub(super) fn begin_reset(&mut self, environment: &mut dyn Environment) {
        environment.begin_reset(self.copy, &mut self.resets);
    }

    /// Starts the agent's episode number `episode`, after the reset is finished.
    pub(super) fn start(
        &mut self,
        environment: &dyn Environment,
        episode: u32,
        round: u32,
        scene: Option<&SceneSettings>,
    ) {
        let mut started = Episode::start(self.agent, episode, round, environment.spec());
        let observation = self.observation(environment);
        started.observations.extend_from_slice(observation);
        self.playing = Some(started);
        let has_bodies = scene.is_some_and(|scene| scene.records(self.agent, episode));
        let has_details = has_bodies || !environment.spec().info.is_empty();
        self.details = has_details.then(|| EpisodeDetails {
            agent: self.agent,
            episode,
            terrain: terrain_lines(environment, self.copy),
            ..EpisodeDetails::default()
        });
        self.record_details(environment);
    }

    /// Adds the result of the latest step to the episode; returns the episode if it has ended.
    pub(super) fn observe(&mut self, environment: &dyn Environment) -> Option<Episode> {
        let mut episode = self.playing.take()?;
        let copy = self.copy;
        let (reward, status) = (environment.rewards()[copy], environment.statuses()[copy]);
        episode.add_result(reward, self.observation(environment), status);
        self.record_details(environment);
        if episode.outcome == Status::Running {
            self.playing = Some(episode);
            return None;
        }
        self.warning = environment
            .physics_warning(copy)
            .map(|warning| EpisodeWarning {
                agent: self.agent,
                episode: episode.episode,
                step: warning.step,
                message: warning.message,
            });
        Some(episode)
    }

    /// Observation of the agent's copy of the environment.
    fn observation<'a>(&self, environment: &'a dyn Environment) -> &'a [f32] {
        let width = environment.spec().observation_width();
        let copy = self.copy;
        &environment.observations()[copy * width..(copy + 1) * width]
    }

    fn record_details(&mut self, environment: &dyn Environment) {
        let width = environment.spec().info.len();
        if let Some(details) = &mut self.details {
            let info = &environment.info()[self.copy * width..][..width];
            details.info.extend_from_slice(info);
        }
        self.record_bodies(environment);
    }

    fn record_bodies(&mut self, environment: &dyn Environment) {
        let (Some(scene), Some(trajectory)) = (environment.scene(), &mut self.details) else {
            return;
        };
        let copy = self.copy;
        let first_pose = trajectory.poses.len();
        let body_count = scene.bodies.len();
        trajectory
            .poses
            .resize(first_pose + body_count, Pose::default());
        environment.poses(copy, &mut trajectory.poses[first_pose..]);
        let forces_before = trajectory.forces.len();
        environment.forces(
            copy,
            &trajectory.poses[first_pose..],
            &mut trajectory.forces,
        );
        let added_forces = trajectory.forces.len() - forces_before;
        trajectory.forces_per_row.push(added_forces);
    }
}
