//! A team in training: environments, agents, shared buffer and measures, from one round to the next.

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::{Deserialize, Serialize};

use super::exchange::{Exchange, OneProcess};
use super::measures::{Measures, RoundRows, Threshold};
use super::rollout::{self, Camera, Played, RoundPlan};
use crate::agent::{Agent, Membership, UpdateReport};
use crate::env::description::Description;
use crate::env::{self, Environment, Spec};
use crate::experience::{Episode, SharedBuffer};
use crate::input::InputError;
use crate::scenario::{Scenario, Schedule, Stop};

/// Everything of a run that learns or is learned from.
pub struct Trainer {
    scenario: Scenario,
    environment: Box<dyn Environment>,
    agents: Vec<Box<dyn Agent>>,
    exchange: Box<dyn Exchange>,
    buffer: SharedBuffer,
    measures: Measures,
    round: u32,
    pool: ThreadPool,
}

/// What a trainer goes on from: see [`Trainer::save`].
#[derive(Serialize, Deserialize)]
struct Saved {
    round: u32,
    environment: Vec<u8>,
    agents: Vec<Vec<u8>>,
    buffer: SharedBuffer,
    measures: Measures,
}

/// Numbers that ceased to be finite: nothing that follows would mean anything.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Diverged {
    /// In the simulation.
    #[error("{what} of agent {agent} ceased to be finite in its episode {episode}; the task's numbers are too extreme")]
    Simulation {
        /// Whose copy.
        agent: u32,
        /// The agent's own count.
        episode: u32,
        /// An observation's name, or the reward.
        what: String,
    },
    /// In learning.
    #[error("the networks of agent {agent} ceased to be finite in round {round}; its step sizes or seeds are too large")]
    Learning {
        /// Whose.
        agent: usize,
        /// Counts from 0.
        round: u32,
    },
}

impl Trainer {
    /// A team at its seeds. Updates run on `threads` threads, 0 being one a core; the bits do not depend on it.
    ///
    /// # Errors
    /// The task cannot be built as the scenario asks.
    ///
    /// # Panics
    /// If the system refuses to start threads.
    pub fn new(scenario: &Scenario, description: &Description, threads: usize) -> Result<Self, InputError> {
        let count = scenario.agents.count.get();
        let environment = env::build(description, scenario.physics, count as usize)?;
        let spec = environment.spec();
        let member = |agent| Membership { run_seed: scenario.seed, agent, team: &scenario.agents, spec };
        let agents = (0..count).map(|agent| scenario.algorithm.build(&member(agent))).collect();
        let pool = ThreadPoolBuilder::new().num_threads(threads).thread_name(|index| format!("agents-{index}")).build();
        Ok(Self {
            measures: Measures::new(spec, count as usize),
            buffer: SharedBuffer::new(scenario.algorithm.rounds_kept()),
            scenario: scenario.clone(),
            environment,
            agents,
            exchange: Box::new(OneProcess),
            round: 0,
            pool: pool.expect("the system starts threads"),
        })
    }

    /// Plays one round of concurrent episodes.
    ///
    /// # Errors
    /// An observation or reward is not finite.
    pub fn play(&mut self) -> Result<Played, Diverged> {
        let Schedule::Synchronous { episodes } = self.scenario.schedule;
        let scene = self.scenario.recording.scene.as_ref();
        let plan = RoundPlan {
            run_seed: self.scenario.seed,
            round: self.round,
            episodes: episodes.get(),
            camera: scene.map(|scene| Camera { agent: *scene.agent, every: scene.every.get() }),
        };
        let played = rollout::play(&mut *self.environment, &self.agents, &plan);
        played.episodes.iter().try_for_each(|episode| self.check_episode(episode))?;
        Ok(played)
    }

    /// Shares a round's episodes, lets every agent learn from them, and measures what came of it.
    ///
    /// # Errors
    /// A network's parameters are not finite.
    pub fn learn(&mut self, episodes: Vec<Episode>) -> Result<RoundRows, Diverged> {
        self.buffer.push_round(self.exchange.gather(episodes));
        let (buffer, round) = (&self.buffer, self.round);
        let update = |agent: &mut Box<dyn Agent>| agent.update(buffer, round);
        let reports: Vec<UpdateReport> = self.pool.install(|| self.agents.par_iter_mut().map(update).collect());
        if let Some(agent) = self.agents.iter().position(|agent| !is_finite(&**agent)) {
            return Err(Diverged::Learning { agent, round });
        }
        let rows = self.measures.take_in(self.environment.spec(), round, self.buffer.newest_round(), &reports);
        self.round += 1;
        Ok(rows)
    }

    fn check_episode(&self, episode: &Episode) -> Result<(), Diverged> {
        let observations = &self.spec().observations;
        let lost = episode.observations.iter().position(|value| !value.is_finite());
        let observed = lost.map(|index| format!("observation `{}`", observations[index % observations.len()].name));
        let rewarded = || (!episode.rewards.iter().all(|reward| reward.is_finite())).then(|| "the reward".to_owned());
        let Some(what) = observed.or_else(rewarded) else { return Ok(()) };
        Err(Diverged::Simulation { agent: episode.agent, episode: episode.episode, what })
    }

    /// Whether the scenario's end is reached.
    #[must_use]
    pub fn is_done(&self) -> bool {
        let ends_when_solved = matches!(self.scenario.stop, Stop::Solved { .. });
        self.measures.episodes_per_agent() >= self.scenario.most_episodes() as usize || (ends_when_solved && self.is_solved())
    }

    /// Whether the newest full window of episodes counts as solving the task.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.threshold().is_some_and(|threshold| self.measures.reaches(threshold))
    }

    /// When the task counts as solved: as the scenario says, or else as the task does, over 25 episodes.
    #[must_use]
    pub fn threshold(&self) -> Option<Threshold> {
        match &self.scenario.stop {
            Stop::Solved { r#return, window, .. } => Some(Threshold { r#return: r#return.get(), window: window.get() as usize }),
            Stop::Episodes(_) => {
                self.spec().reward_threshold.map(|r#return| Threshold { r#return: f64::from(r#return), window: 25 })
            }
        }
    }

    /// The task.
    #[must_use]
    pub fn spec(&self) -> &Spec {
        self.environment.spec()
    }

    /// The environments.
    #[must_use]
    pub fn environment(&self) -> &dyn Environment {
        &*self.environment
    }

    /// The team: `[K]`.
    #[must_use]
    pub fn agents(&self) -> &[Box<dyn Agent>] {
        &self.agents
    }

    /// The newest round's episodes.
    #[must_use]
    pub fn newest_episodes(&self) -> &[Episode] {
        self.buffer.newest_round()
    }

    /// What was measured so far.
    #[must_use]
    pub fn measures(&self) -> &Measures {
        &self.measures
    }

    /// Rounds finished.
    #[must_use]
    pub fn rounds(&self) -> u32 {
        self.round
    }

    /// Everything that the scenario does not tell, as bytes.
    ///
    /// # Panics
    /// Never: plain data always serialises.
    #[must_use]
    pub fn save(&self) -> Vec<u8> {
        let saved = Saved {
            round: self.round,
            environment: self.environment.save(),
            agents: self.agents.iter().map(|agent| agent.save()).collect(),
            buffer: self.buffer.clone(),
            measures: self.measures.clone(),
        };
        postcard::to_stdvec(&saved).expect("plain data always serialises")
    }

    /// Takes up what [`save`](Self::save) wrote; training goes on to the same bits.
    ///
    /// # Errors
    /// Says what is wrong where the bytes are of another run.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved = postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        if saved.agents.len() != self.agents.len() {
            return Err(format!("{} agents stored for a team of {}", saved.agents.len(), self.agents.len()));
        }
        self.environment.restore(&saved.environment)?;
        self.agents.iter_mut().zip(&saved.agents).try_for_each(|(agent, bytes)| agent.restore(bytes))?;
        (self.buffer, self.measures, self.round) = (saved.buffer, saved.measures, saved.round);
        Ok(())
    }
}

fn is_finite(agent: &dyn Agent) -> bool {
    agent.tensors().iter().all(|tensor| tensor.values.iter().all(|value| value.is_finite()))
}
