//! A team in training: environments, agents, shared buffer and measures, from one round to the next.

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::{Deserialize, Serialize};

use super::agreement;
use super::asynchronous::{Desk, Pace};
use super::exchange::{Exchange, OneProcess};
use super::lockstep::{self, Learning};
use super::measures::{Measures, RoundRows, Threshold};
use super::rollout::{self, Played, RoundPlan};
use crate::agent::q_learning::ValueTeam;
use crate::agent::{Agent, Membership, Tensor, UpdateReport};
use crate::env::description::Description;
use crate::env::{self, Environment, Spec};
use crate::experience::{Episode, Experience, SharedBuffer};
use crate::input::InputError;
use crate::record::Footage;
use crate::scenario::{Scenario, Schedule, Stop};

/// Everything of a run that learns or is learned from.
pub struct Trainer {
    scenario: Scenario,
    environment: Box<dyn Environment>,
    /// Those that each learn for themselves; empty where they act by shared models.
    agents: Vec<Box<dyn Agent>>,
    /// Those that act by shared models.
    sharers: Option<ValueTeam>,
    exchange: Box<dyn Exchange>,
    buffer: SharedBuffer,
    /// The team's episodes before the newest round.
    recorded: u64,
    /// Where asynchronous agents stand.
    desk: Option<Desk>,
    measures: Measures,
    round: u32,
    /// None on a single thread: a pool of one would only hand work to and fro, and let a waiting caller take up other work.
    pool: Option<ThreadPool>,
}

/// What came of a round.
#[derive(Debug)]
pub struct Round {
    /// What it adds to the tables.
    pub rows: RoundRows,
    /// The filmed episodes.
    pub footage: Vec<Footage>,
}

/// Who learned and what it was like, in order, and the filmed episodes.
type Advance = (Vec<(u32, UpdateReport)>, Vec<Footage>);

/// An agent about to learn from the team's episodes after the first `start`, for the (`round` + 1)-th time.
struct Learner {
    agent: u32,
    start: u64,
    round: u32,
}

/// What a trainer goes on from: see [`Trainer::save`]. `B`, `D` and `M` are borrowed where it is written.
#[derive(Serialize, Deserialize)]
struct Saved<B, D, M> {
    round: u32,
    environment: Vec<u8>,
    agents: Vec<Vec<u8>>,
    sharers: Option<Vec<u8>>,
    buffer: B,
    recorded: u64,
    desk: D,
    measures: M,
}

/// Numbers that ceased to be finite: nothing that follows would mean anything.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Diverged {
    /// In the simulation.
    #[error(
        "{what} of agent {agent} ceased to be finite in its episode {episode}; the task's numbers are too extreme"
    )]
    Simulation {
        /// Whose copy.
        agent: u32,
        /// The agent's own count.
        episode: u32,
        /// An observation's name, or the reward.
        what: String,
    },
    /// In learning.
    #[error(
        "the networks of agent {agent} ceased to be finite in round {round}; its step sizes or seeds are too large"
    )]
    Learning {
        /// Whose.
        agent: u32,
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
    pub fn new(
        scenario: &Scenario,
        description: &Description,
        threads: usize,
    ) -> Result<Self, InputError> {
        let count = scenario.agents.count.get();
        let environment = env::build(description, scenario.physics, count as usize)?;
        let spec = environment.spec();
        let (run_seed, team, notes_advantages) = (
            scenario.seed,
            &scenario.agents,
            scenario.recording.has_advantages(),
        );
        let member = |agent| Membership {
            run_seed,
            agent,
            team,
            spec,
            notes_advantages,
        };
        let agents = (0..count)
            .filter_map(|agent| scenario.algorithm.build(&member(agent)))
            .collect();
        let sharers = scenario
            .algorithm
            .build_shared(scenario.seed, &scenario.agents, spec);
        let several = || {
            ThreadPoolBuilder::new()
                .num_threads(threads)
                .thread_name(|index| format!("agents-{index}"))
                .build()
        };
        Ok(Self {
            measures: Measures::new(spec, count as usize),
            buffer: SharedBuffer::default(),
            recorded: 0,
            desk: None,
            scenario: scenario.clone(),
            environment,
            agents,
            sharers,
            exchange: Box::new(OneProcess),
            round: 0,
            pool: (threads != 1 && count > 1)
                .then(|| several().expect("the system starts threads")),
        })
    }

    /// Plays a round of concurrent episodes, shares them, lets every agent learn from them, and measures what came of it.
    ///
    /// An asynchronous round is over when as many episodes have ended as there are agents.
    ///
    /// # Errors
    /// An observation, a reward or a network's parameters are not finite.
    pub fn advance(&mut self) -> Result<Round, Diverged> {
        let learned = self.desk.as_ref().map_or(u64::MAX, Desk::learned_by_all);
        self.buffer.forget(
            learned.min(
                self.buffer
                    .before(self.scenario.algorithm.transitions_kept()),
            ),
        );
        self.recorded = self.buffer.total();
        let (mut reports, footage) = match self.scenario.schedule {
            Schedule::Synchronous { episodes } => {
                self.advance_together(episodes.get(), Learning::AfterRound)?
            }
            Schedule::Lockstep { learn_every } => {
                self.advance_together(1, Learning::Every(learn_every.get()))?
            }
            Schedule::Asynchronous { training } => self.advance_each(training.env_steps)?,
        };
        let agreement = self.agreement();
        for (_, report) in &mut reports {
            report.bonus_agreement = agreement.map(|agreement| agreement as f32);
        }
        let episodes = newest_episodes(&self.buffer, self.recorded);
        let rows = self
            .measures
            .take_in(self.environment.spec(), self.round, &episodes, &reports);
        self.round += 1;
        Ok(Round { rows, footage })
    }

    /// Every agent plays `episodes`, then all learn, or have learned meanwhile.
    fn advance_together(&mut self, episodes: u32, learning: Learning) -> Result<Advance, Diverged> {
        let plan = RoundPlan {
            run_seed: self.scenario.seed,
            round: self.round,
            episodes,
            camera: self.scenario.recording.scene.as_ref(),
        };
        let start = self.buffer.total();
        let Some(sharers) = &mut self.sharers else {
            let played = rollout::play(&mut *self.environment, &self.agents, &plan);
            self.share(played.episodes)?;
            let learners = (0..self.agents.len() as u32).map(|agent| Learner {
                agent,
                start,
                round: self.round,
            });
            let reports = self.learn(&learners.collect::<Vec<_>>())?;
            return Ok((reports, played.footage));
        };
        let played = lockstep::play(
            &mut *self.environment,
            sharers,
            &plan,
            learning,
            self.pool.as_ref(),
        );
        self.share(played.episodes)?;
        Ok((self.end_shared_round(start, learning)?, played.footage))
    }

    /// Those that act by shared models learn what can be learned from whole episodes only.
    fn end_shared_round(
        &mut self,
        start: u64,
        learning: Learning,
    ) -> Result<Vec<(u32, UpdateReport)>, Diverged> {
        let (buffer, round) = (&mut self.buffer, self.round);
        let Some(sharers) = &mut self.sharers else {
            return Ok(Vec::new());
        };
        let experience = Experience {
            fresh: buffer.since(start),
            kept: buffer.since(0),
            round,
        };
        let reports = lockstep::end_round(sharers, &experience, learning, self.pool.as_ref());
        if let Some(agent) = sharers.diverged() {
            return Err(Diverged::Learning { agent, round });
        }
        for &(agent, _) in &reports {
            let rewards = sharers.intrinsic_rewards(agent as usize);
            buffer.note(agent, start, rewards, |episode| {
                &mut episode.intrinsic_rewards
            });
        }
        Ok(reports)
    }

    /// Agents whose episodes end learn while the others play.
    fn advance_each(&mut self, learning: u32) -> Result<Advance, Diverged> {
        let scene = self.scenario.recording.scene.clone();
        let pace = Pace {
            run_seed: self.scenario.seed,
            episodes: self.scenario.most_episodes(),
            learning,
            camera: scene.as_ref(),
        };
        let mut desk = self
            .desk
            .take()
            .unwrap_or_else(|| Desk::new(self.scenario.seed, self.agents.len()));
        let (mut reports, mut footage) = (Vec::new(), Vec::new());
        let enough = self.recorded + self.agents.len() as u64;
        while self.buffer.total() < enough {
            let ended = desk.play(&mut *self.environment, &self.agents, &pace);
            if ended.episodes.is_empty() {
                break;
            }
            let agents: Vec<u32> = ended.episodes.iter().map(|episode| episode.agent).collect();
            self.share(ended.episodes)?;
            footage.extend(ended.footage);
            let learner = |agent| {
                let (start, round) = desk.learn(agent, self.buffer.total(), &pace);
                Learner {
                    agent,
                    start,
                    round,
                }
            };
            let learners: Vec<Learner> = agents.into_iter().map(learner).collect();
            reports.extend(self.learn(&learners)?);
        }
        self.desk = Some(desk);
        Ok((reports, footage))
    }

    /// Brings episodes that ended at one moment to all agents.
    fn share(&mut self, episodes: Vec<Episode>) -> Result<(), Diverged> {
        episodes
            .iter()
            .try_for_each(|episode| self.check_episode(episode))?;
        let mut episodes = self.exchange.gather(episodes);
        for episode in &mut episodes {
            episode.round = self.round;
        }
        self.buffer.push(episodes);
        Ok(())
    }

    /// Some agents learn, at once, each from what is fresh to it.   `learners` in agent order.
    fn learn(&mut self, learners: &[Learner]) -> Result<Vec<(u32, UpdateReport)>, Diverged> {
        let (buffer, round) = (&self.buffer, self.round);
        let mut learning = learners.iter().peekable();
        let mut pairs = Vec::with_capacity(learners.len());
        for (agent, number) in self.agents.iter_mut().zip(0..) {
            if let Some(learner) = learning.next_if(|learner| learner.agent == number) {
                pairs.push((agent, learner));
            }
        }
        let update = |(agent, learner): (&mut Box<dyn Agent>, &Learner)| {
            let report = agent.update(&Experience {
                fresh: buffer.since(learner.start),
                kept: buffer.since(0),
                round: learner.round,
            });
            (learner.agent, report, agent.is_finite())
        };
        let learned: Vec<(u32, UpdateReport, bool)> = match &self.pool {
            Some(pool) => pool.install(|| pairs.into_par_iter().map(update).collect()),
            None => pairs.into_iter().map(update).collect(),
        };
        if let Some(&(agent, ..)) = learned.iter().find(|(_, _, finite)| !finite) {
            return Err(Diverged::Learning { agent, round });
        }
        for learner in learners {
            let agent = &self.agents[learner.agent as usize];
            self.buffer.note(
                learner.agent,
                learner.start,
                agent.intrinsic_rewards(),
                |episode| &mut episode.intrinsic_rewards,
            );
            self.buffer.note(
                learner.agent,
                learner.start,
                agent.advantages(),
                |episode| &mut episode.advantages,
            );
        }
        Ok(learned
            .into_iter()
            .map(|(agent, report, _)| (agent, report))
            .collect())
    }

    /// Plays a round that nobody learns from and nothing measures. Episodes are in (agent, episode) order.
    pub fn play_without_learning(&mut self, plan: &RoundPlan<'_>) -> Played {
        let environment = &mut *self.environment;
        match &mut self.sharers {
            Some(sharers) => lockstep::play(environment, sharers, plan, Learning::Never, None),
            None => rollout::play(environment, &self.agents, plan),
        }
    }

    /// Whether agents would give the same steps of the round's first episode a bonus.
    fn agreement(&mut self) -> Option<f64> {
        self.scenario.algorithm.largest_intrinsic_reward()?;
        let (probe, round) = (self.buffer.since(self.recorded).first()?, self.round);
        let judgements: Vec<Vec<f32>> = match &mut self.sharers {
            Some(sharers) => sharers.judge(probe, round),
            None => self
                .agents
                .iter_mut()
                .map(|agent| agent.judge(probe, round))
                .collect(),
        };
        agreement::mean_rank_correlation(&judgements)
    }

    fn check_episode(&self, episode: &Episode) -> Result<(), Diverged> {
        let observations = &self.spec().observations;
        let lost = episode
            .observations
            .iter()
            .position(|value| !value.is_finite());
        let observed = lost.map(|index| {
            format!(
                "observation `{}`",
                observations[index % observations.len()].name
            )
        });
        let rewarded = || {
            (!episode.rewards.iter().all(|reward| reward.is_finite()))
                .then(|| "the reward".to_owned())
        };
        let Some(what) = observed.or_else(rewarded) else {
            return Ok(());
        };
        Err(Diverged::Simulation {
            agent: episode.agent,
            episode: episode.episode,
            what,
        })
    }

    /// Whether the scenario's end is reached.
    #[must_use]
    pub fn is_done(&self) -> bool {
        let ends_when_solved = matches!(self.scenario.stop, Stop::Solved { .. });
        self.measures.episodes_per_agent() >= self.scenario.most_episodes() as usize
            || (ends_when_solved && self.is_solved())
    }

    /// Whether the newest full window of episodes counts as solving the task.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.threshold()
            .is_some_and(|threshold| self.measures.reaches(threshold))
    }

    /// When the task counts as solved: as the scenario says, or else as the task does, over 25 episodes.
    #[must_use]
    pub fn threshold(&self) -> Option<Threshold> {
        match &self.scenario.stop {
            Stop::Solved {
                r#return, window, ..
            } => Some(Threshold {
                r#return: r#return.get(),
                window: window.get() as usize,
            }),
            Stop::Episodes(_) => self.spec().reward_threshold.map(|r#return| Threshold {
                r#return: f64::from(r#return),
                window: 25,
            }),
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

    /// K
    #[must_use]
    pub fn agent_count(&self) -> usize {
        self.environment.copies()
    }

    /// The parameters of all networks, named `agent_3.policy.layer_0.weight` and the like; models that agents share, `model_3.…`.
    #[must_use]
    pub fn tensors(&self) -> Vec<Tensor<'_>> {
        let own = self.agents.iter().enumerate().flat_map(|(agent, learner)| {
            learner.tensors().into_iter().map(move |tensor| {
                let name = format!("agent_{agent}.{}", tensor.name);
                Tensor { name, ..tensor }
            })
        });
        own.chain(self.sharers.iter().flat_map(ValueTeam::tensors))
            .collect()
    }

    /// The newest round's episodes, in (agent, episode) order.
    #[must_use]
    pub fn newest_episodes(&self) -> Vec<&Episode> {
        newest_episodes(&self.buffer, self.recorded)
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
            sharers: self.sharers.as_ref().map(ValueTeam::save),
            buffer: &self.buffer,
            recorded: self.recorded,
            desk: &self.desk,
            measures: &self.measures,
        };
        postcard::to_stdvec(&saved).expect("plain data always serialises")
    }

    /// Takes up what [`save`](Self::save) wrote; training goes on to the same bits.
    ///
    /// # Errors
    /// Says what is wrong where the bytes are of another run.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<SharedBuffer, Option<Desk>, Measures> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        if saved.agents.len() != self.agents.len() {
            return Err(format!(
                "{} agents stored for a team of {}",
                saved.agents.len(),
                self.agents.len()
            ));
        }
        self.environment.restore(&saved.environment)?;
        self.agents
            .iter_mut()
            .zip(&saved.agents)
            .try_for_each(|(agent, bytes)| agent.restore(bytes))?;
        match (&mut self.sharers, &saved.sharers) {
            (Some(sharers), Some(bytes)) => sharers.restore(bytes)?,
            (None, None) => {}
            _ => return Err("stored for another algorithm".to_owned()),
        }
        (self.buffer, self.recorded, self.desk) = (saved.buffer, saved.recorded, saved.desk);
        (self.measures, self.round) = (saved.measures, saved.round);
        Ok(())
    }
}

/// The episodes after the first `recorded`, in (agent, episode) order.
fn newest_episodes(buffer: &SharedBuffer, recorded: u64) -> Vec<&Episode> {
    let mut episodes: Vec<&Episode> = buffer.since(recorded).iter().collect();
    episodes.sort_by_key(|episode| (episode.agent, episode.episode));
    episodes
}
