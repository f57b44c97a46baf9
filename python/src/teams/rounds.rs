//! The rounds of a team whose environments are stepped elsewhere, what the team counts and saves, and what it
//! tells of its learning. Each step is an action of every playing agent, and then its result.

use std::fmt::Display;

use seedbed_env::Status;
use seedbed_learn::agent::UpdateReport;
use seedbed_learn::algorithms::ScheduleKind;
use seedbed_learn::experience::{Episode, SharedBuffer};
use seedbed_learn::nn::Tensor;
use seedbed_learn::rollout::{ActingAgents, AgentRound, GroupStep, Player};
use seedbed_learn::team::{AgentUpdate, LearningTeam, SavedTeam, Workers};
use serde::{Deserialize, Serialize};

use super::settings::TeamSettings;
use crate::tasks::Autoreset;

/// A team with the episodes that its agents are playing.
pub(super) struct TeamRounds {
    settings: TeamSettings,
    learning: LearningTeam,
    agents: Vec<PlayingAgent>,
    acting: ActingAgents,
    /// Number of the round, from 0.
    round: u32,
    /// Number of steps whose transitions the team has not got yet.
    unreported_steps: u32,
    /// Whether the agents have acted and the result of the step is not recorded yet.
    has_acted: bool,
    /// Whether a step of this round was recorded.
    has_steps: bool,
}

/// One agent of the team.
#[derive(Serialize, Deserialize)]
struct PlayingAgent {
    /// The episode that the agent is playing; `None` between two.
    playing: Option<Episode>,
    /// How the next episode begins.
    start: Start,
    round: AgentRound,
    /// Number of the agent's next episode.
    next_episode: u32,
}

/// How an agent's next episode begins.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Start {
    /// With the observation in which the agent acts next.
    WithAction,
    /// With the observation after the next step, which resets the environment.
    AfterReset,
    /// Not in this round.
    NextRound,
}

/// The result of a step, one row per agent.
pub(super) struct StepResult<'a> {
    /// `[K × observation width]`
    pub(super) observations: &'a [f32],
    /// Of episodes that ended and were followed by a reset in the same step: `[K × observation
    /// width]`.
    pub(super) final_observations: Option<&'a [f32]>,
    pub(super) rewards: &'a [f32],
    pub(super) terminated: &'a [bool],
    pub(super) truncated: &'a [bool],
}

/// Why a call cannot be carried out.
pub(super) enum Refusal {
    /// A number is wrong.
    Value(String),
    /// It is not the turn of this call.
    Order(String),
    /// A network has diverged.
    Diverged(String),
}

/// Named numbers of an update, one per agent.
pub(super) type Metrics = Vec<(&'static str, Vec<f64>)>;

/// What a file has of a team between two rounds.
#[derive(Serialize, Deserialize)]
struct SavedRounds<A, B> {
    round: u32,
    team: SavedTeam,
    buffer: B,
    agents: A,
    /// Number of the first transition in the replay buffer, and all of them.
    replay: Option<(u64, Vec<u8>)>,
}

impl Player for PlayingAgent {
    fn playing(&mut self) -> Option<&mut Episode> {
        self.playing.as_mut()
    }
}

impl TeamRounds {
    /// A team that has not played yet.
    pub(super) fn new(settings: TeamSettings) -> Self {
        let (count, seed) = (settings.agent_count(), settings.given.seed);
        let mut rounds = Self {
            learning: settings.build(),
            agents: (0..count).map(|_| PlayingAgent::new()).collect(),
            acting: ActingAgents::new(seed, 0..count as u32, 0),
            round: 0,
            unreported_steps: 0,
            has_acted: false,
            has_steps: false,
            settings,
        };
        rounds.begin_round();
        rounds
    }

    pub(super) fn settings(&self) -> &TeamSettings {
        &self.settings
    }

    /// Number of finished rounds.
    pub(super) fn round(&self) -> u32 {
        self.round
    }

    /// Whether each agent is playing an episode: `[K]`
    pub(super) fn playing(&self) -> Vec<bool> {
        let agents = self.agents.iter();
        agents.map(|agent| agent.playing.is_some()).collect()
    }

    /// Whether each agent has ended the episodes of the round.
    pub(super) fn is_ready(&self) -> bool {
        self.unready_agent().is_none() && !self.has_acted
    }

    pub(super) fn tensors(&self) -> Vec<Tensor<'_>> {
        self.learning.team().tensors()
    }

    fn unready_agent(&self) -> Option<usize> {
        let needed = self.settings.episodes_per_round();
        let mut agents = self.agents.iter();
        agents.position(|agent| agent.round.finished.len() < needed)
    }

    fn begin_round(&mut self) {
        self.learning.forget_old_episodes(u64::MAX);
        self.learning.team_mut().begin_round(self.round);
        self.acting
            .begin_round(self.settings.given.seed, 0, self.round);
        self.has_steps = false;
        for agent in &mut self.agents {
            if agent.start == Start::NextRound {
                agent.start = Start::WithAction;
            }
        }
    }

    /// Starts new episodes of some agents. Episodes that they were playing are truncated.
    /// `observations: [K × width]`, `is_selected: [K]`
    pub(super) fn start(
        &mut self,
        observations: &[f32],
        is_selected: &[bool],
    ) -> Result<(), Refusal> {
        self.check_turn(false)?;
        let chosen = || (0..self.agents.len()).filter(|&agent| is_selected[agent]);
        for agent in chosen() {
            check_row(observations, agent, self.width(), "observations")?;
            if self.agents[agent].start == Start::NextRound {
                return Err(order(format!(
                    "agent {agent} has ended its episodes of this round: call learn() before it \
                     starts another"
                )));
            }
        }
        for agent in chosen().collect::<Vec<_>>() {
            self.cut_off(agent);
            self.begin_episode(agent, observations);
        }
        Ok(())
    }

    /// Ends the episode that an agent is playing, before its end.
    fn cut_off(&mut self, agent: usize) {
        let agent = &mut self.agents[agent];
        if let Some(mut episode) = agent.playing.take()
            && episode.length() > 0
        {
            episode.outcome = Status::Truncated;
            agent.round.finished.push(episode);
        }
    }

    /// All playing agents choose their next actions: `[K × action width]`, one row per agent. Rows of
    /// other agents have no meaning.   `observations: [K × width]`
    pub(super) fn act(&mut self, observations: &[f32]) -> Result<&[f32], Refusal> {
        self.check_turn(false)?;
        self.check_observations(observations)?;
        for agent in 0..self.agents.len() {
            let PlayingAgent { playing, start, .. } = &self.agents[agent];
            if playing.is_none() && *start == Start::WithAction {
                self.begin_episode(agent, observations);
            }
        }
        self.has_acted = true;
        let step = GroupStep {
            first_agent: 0,
            action_width: self.settings.spec.action_width(),
            unreported_steps: self.unreported_steps,
            observations,
        };
        let team = self.learning.team();
        Ok(self.acting.act(team, &step, &mut self.agents))
    }

    /// Checks that agents act in finite observations, which are those that were recorded last.
    fn check_observations(&self, observations: &[f32]) -> Result<(), Refusal> {
        if self.is_over() {
            return Err(order(
                "all agents have ended their episodes of this round: call learn(), then reset the \
                 environments",
            ));
        }
        for (index, agent) in self.agents.iter().enumerate() {
            let row = row_of(observations, index, self.width());
            let last = agent.playing.as_ref().map(Episode::last_observation);
            let is_used = last.is_some() || agent.start == Start::WithAction;
            if !is_used || last == Some(row) {
                continue;
            }
            check_row(observations, index, self.width(), "observations")?;
            if last.is_some() {
                return Err(value(format!(
                    "observations[{index}] is not the observation that was recorded last; expected the \
                     observations that the latest step or reset returned, and start(…) after a reset \
                     in the middle of an episode"
                )));
            }
        }
        Ok(())
    }

    /// Adds the result of a step to the episodes. A team that learns during episodes may do so.
    pub(super) fn record(
        &mut self,
        result: &StepResult<'_>,
        workers: Workers<'_>,
    ) -> Result<(), Refusal> {
        self.check_turn(true)?;
        for agent in 0..self.agents.len() {
            self.check_result(agent, result)?;
        }
        let has_player = self.agents.iter().any(|agent| agent.playing.is_some());
        for agent in 0..self.agents.len() {
            self.record_agent(agent, result);
        }
        self.has_acted = false;
        self.has_steps |= has_player;
        let interval = self.learning.team().transition_interval();
        if let (Some(interval), true) = (interval, has_player) {
            self.unreported_steps += 1;
            if self.unreported_steps >= interval || self.is_over() {
                self.report_transitions(workers);
            }
        }
        Ok(())
    }

    /// Whether no agent plays until the next round.
    fn is_over(&self) -> bool {
        let mut agents = self.agents.iter();
        agents.all(|agent| agent.playing.is_none() && agent.start == Start::NextRound)
    }

    /// Checks the numbers of one agent that are used.
    fn check_result(&self, index: usize, result: &StepResult<'_>) -> Result<(), Refusal> {
        let agent = &self.agents[index];
        let Some(episode) = &agent.playing else {
            let is_used = agent.start == Start::AfterReset;
            return if is_used {
                check_row(result.observations, index, self.width(), "observations")
            } else {
                Ok(())
            };
        };
        let reward = result.rewards[index];
        if !reward.is_finite() {
            return Err(not_finite("rewards", &[index], reward));
        }
        self.check_observations_after(index, result)?;
        self.check_length(index, episode)
    }

    /// Checks the observation after a step, and that of a new episode.
    fn check_observations_after(
        &self,
        index: usize,
        result: &StepResult<'_>,
    ) -> Result<(), Refusal> {
        let width = self.width();
        if result.has_ended(index) && result.final_observations.is_none() && self.resets_at_once() {
            return Err(value(format!(
                "the episode of agent {index} has ended, but there is no final observation; expected \
                 infos[\"final_obs\"], or another autoreset_mode than \"SameStep\""
            )));
        }
        if let (true, Some(rows)) = (result.has_ended(index), result.final_observations) {
            check_row(rows, index, width, "final observations")?;
        }
        check_row(result.observations, index, width, "observations")
    }

    fn check_length(&self, index: usize, episode: &Episode) -> Result<(), Refusal> {
        let limit = self.settings.given.max_episode_steps;
        if episode.length() < limit as usize {
            return Ok(());
        }
        Err(value(format!(
            "the episode of agent {index} has more than max_episode_steps={limit} steps; expected a \
             larger max_episode_steps, or episodes that end"
        )))
    }

    /// Whether the step that ends an episode returns the first observation of the next one.
    fn resets_at_once(&self) -> bool {
        self.settings.autoreset == Autoreset::SameStep
    }

    fn record_agent(&mut self, index: usize, result: &StepResult<'_>) {
        let width = self.width();
        let agent = &mut self.agents[index];
        let Some(episode) = &mut agent.playing else {
            if agent.start == Start::AfterReset {
                self.begin_episode(index, result.observations);
            }
            return;
        };
        let observation = row_of(result.rows_after(index), index, width);
        episode.add_result(result.rewards[index], observation, result.status(index));
        if result.has_ended(index) {
            self.end_episode(index, result.observations);
        }
    }

    /// Ends the episode of an agent. With resets in the same step, the next begins.
    fn end_episode(&mut self, index: usize, observations: &[f32]) {
        let needed = self.settings.given.episodes;
        let agent = &mut self.agents[index];
        agent.round.finished.extend(agent.playing.take());
        let is_last = needed.is_some_and(|needed| agent.round.finished.len() >= needed as usize);
        agent.start = match self.settings.autoreset {
            _ if is_last => Start::NextRound,
            Autoreset::NextStep => Start::AfterReset,
            Autoreset::SameStep | Autoreset::Disabled => Start::WithAction,
        };
        if !is_last && self.resets_at_once() {
            self.begin_episode(index, observations);
        }
    }

    fn begin_episode(&mut self, index: usize, observations: &[f32]) {
        let row = row_of(observations, index, self.width());
        let agent = &mut self.agents[index];
        let spec = &self.settings.spec;
        let mut episode = Episode::start(index as u32, agent.next_episode, self.round, spec);
        episode.observations.extend_from_slice(row);
        agent.next_episode += 1;
        agent.start = Start::WithAction;
        agent.playing = Some(episode);
    }

    /// Passes the transitions that were played since the last call to the team, in the order of steps
    /// and agents.
    fn report_transitions(&mut self, workers: Workers<'_>) {
        let team = self.learning.team_mut();
        for _ in 0..std::mem::take(&mut self.unreported_steps) {
            for agent in &mut self.agents {
                agent.round.report_step(agent.playing.as_ref(), team);
            }
            team.end_step(workers);
        }
    }

    /// All agents learn from the episodes that have ended, and the next round begins.
    pub(super) fn learn(&mut self, workers: Workers<'_>) -> Result<Metrics, Refusal> {
        self.check_turn(false)?;
        self.check_ready()?;
        self.report_transitions(workers);
        let episodes = self.take_episodes();
        let returns = mean_returns(&episodes, self.agents.len());
        let learned_before = self.learning.episodes_added();
        let lengths = episodes.iter().map(|episode| episode.length() as u32);
        let lengths = lengths.collect();
        self.learning.add_episodes(episodes, lengths, self.round);
        let agents = 0..self.agents.len() as u32;
        let (learning, round) = (&mut self.learning, self.round);
        let updates = learning.learn_together(agents, learned_before, round, workers);
        self.check_updates(&updates)?;
        let compares = self.settings.algorithm.compares_bonuses();
        let agreement = compares.then(|| self.learning.bonus_agreement(round));
        self.round += 1;
        self.begin_round();
        Ok(metrics(&updates, returns, agreement.flatten()))
    }

    /// The episodes that have ended in this round, in (agent, episode) order.
    fn take_episodes(&mut self) -> Vec<Episode> {
        let rounds = self.agents.iter_mut().map(|agent| &mut agent.round);
        rounds.flat_map(AgentRound::end).collect()
    }

    fn check_ready(&self) -> Result<(), Refusal> {
        if let Some(agent) = self.unready_agent() {
            let ended = self.agents[agent].round.finished.len();
            let needed = self.settings.episodes_per_round();
            return Err(order(format!(
                "agent {agent} has ended {ended} episodes since the last learn(), expected at least \
                 {needed}: play on until `ready`"
            )));
        }
        let finished = self.agents.iter().map(|agent| agent.round.finished.len());
        let episodes = finished.max().unwrap_or(1) as u32;
        // A team that learns during episodes has no such limit.
        let kind = ScheduleKind::Synchronous { episodes };
        if self.settings.given.learn_every.is_none() && self.settings.check_schedule(kind).is_err()
        {
            let name = self.settings.algorithm.name();
            return Err(order(format!(
                "an agent has ended {episodes} episodes since the last learn(), but this `{name}` \
                 learns from one of each agent; give Team(episodes=1), so that agents wait for each \
                 other"
            )));
        }
        Ok(())
    }

    fn check_updates(&self, updates: &[AgentUpdate]) -> Result<(), Refusal> {
        let diverged = updates.iter().find(|update| !update.is_finite);
        diverged.map_or(Ok(()), |diverged| {
            Err(Refusal::Diverged(format!(
                "non-finite network parameters (agent {}, round {}): the algorithm's step sizes or the \
                 deviation of `agents.seeds` are too large",
                diverged.agent, self.round
            )))
        })
    }

    /// Checks whether it is the turn of `record`, or of all other calls.
    fn check_turn(&self, is_record: bool) -> Result<(), Refusal> {
        match (self.has_acted, is_record) {
            (true, false) => Err(order(
                "the agents have acted: call record(…) with the result of the step first",
            )),
            (false, true) => Err(order(
                "the agents have not acted: call act(…) before record(…)",
            )),
            _ => Ok(()),
        }
    }

    fn width(&self) -> usize {
        self.settings.spec.observation_width()
    }

    /// The state between two rounds.
    ///
    /// # Errors
    /// The round has begun.
    pub(super) fn save(&self) -> Result<Vec<u8>, Refusal> {
        if self.has_steps || self.has_acted {
            return Err(order(
                "a round is in progress: save a team before its first step, or after learn()",
            ));
        }
        let (team, buffer, _) = self.learning.save(u64::MAX);
        let saved = SavedRounds {
            round: self.round,
            team,
            buffer,
            agents: &self.agents,
            replay: self.learning.team().replay().map(|replay| {
                let mut bytes = Vec::new();
                replay.encode(replay.numbers(), &mut bytes);
                (replay.numbers().start, bytes)
            }),
        };
        let bytes = postcard::to_stdvec(&saved);
        Ok(bytes.expect("plain numbers in memory can always be written"))
    }

    /// Continues from what [`save`](Self::save) returned.
    ///
    /// # Errors
    /// What is wrong if the bytes are not of such a team.
    pub(super) fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: SavedRounds<Vec<PlayingAgent>, SharedBuffer> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        if saved.agents.len() != self.agents.len() {
            return Err("it has another number of agents".to_owned());
        }
        self.learning.restore(&saved.team, saved.buffer, 0)?;
        if let (Some(replay), Some((first, bytes))) =
            (self.learning.team_mut().replay_mut(), saved.replay)
        {
            replay.restore(first, &bytes)?;
        }
        (self.agents, self.round) = (saved.agents, saved.round);
        self.begin_round();
        Ok(())
    }
}

impl PlayingAgent {
    fn new() -> Self {
        Self {
            playing: None,
            start: Start::WithAction,
            round: AgentRound::default(),
            next_episode: 0,
        }
    }
}

impl<'a> StepResult<'a> {
    /// The rows that have the observation after the step of an agent.
    fn rows_after(&self, agent: usize) -> &'a [f32] {
        match self.final_observations {
            Some(rows) if self.has_ended(agent) => rows,
            _ => self.observations,
        }
    }

    fn has_ended(&self, agent: usize) -> bool {
        self.terminated[agent] || self.truncated[agent]
    }

    fn status(&self, agent: usize) -> Status {
        match (self.terminated[agent], self.truncated[agent]) {
            (true, _) => Status::Terminated,
            (false, true) => Status::Truncated,
            (false, false) => Status::Running,
        }
    }
}

fn row_of(rows: &[f32], index: usize, width: usize) -> &[f32] {
    &rows[index * width..(index + 1) * width]
}

/// Checks that a row is finite. `name`: that of the array
fn check_row(rows: &[f32], index: usize, width: usize, name: &str) -> Result<(), Refusal> {
    let row = row_of(rows, index, width);
    let place = row.iter().position(|number| !number.is_finite());
    place.map_or(Ok(()), |place| {
        Err(not_finite(name, &[index, place], row[place]))
    })
}

fn not_finite(name: &str, place: &[usize], number: f32) -> Refusal {
    let place: Vec<String> = place.iter().map(usize::to_string).collect();
    let number = number.to_string().to_lowercase();
    value(format!(
        "{name}[{}] is {number}, expected a finite number in single precision",
        place.join(", ")
    ))
}

fn value(message: impl Display) -> Refusal {
    Refusal::Value(message.to_string())
}

fn order(message: impl Display) -> Refusal {
    Refusal::Order(message.to_string())
}

/// Mean return of the episodes of each agent: `[K]`
fn mean_returns(episodes: &[Episode], agents: usize) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); agents];
    for episode in episodes {
        let (sum, count) = &mut sums[episode.agent as usize];
        *sum += episode.total_reward();
        *count += 1.0;
    }
    sums.into_iter().map(|(sum, count)| sum / count).collect()
}

/// The returns, and the columns of an update as `rounds.csv` names them; NaN where nothing was measured.
fn metrics(updates: &[AgentUpdate], returns: Vec<f64>, agreement: Option<f64>) -> Metrics {
    let reports: Vec<UpdateReport> = updates.iter().map(|each| each.update.report).collect();
    let column = |value: fn(&UpdateReport) -> Option<f64>| -> Vec<f64> {
        let values = reports.iter().map(value);
        values.map(|value| value.unwrap_or(f64::NAN)).collect()
    };
    vec![
        ("return", returns),
        (
            "gradient_steps",
            column(|r| r.gradient_steps.map(f64::from)),
        ),
        ("value_loss", column(|r| r.value_loss.map(f64::from))),
        ("policy_loss", column(|r| r.policy_loss.map(f64::from))),
        (
            "ratio_deviation",
            column(|r| r.ratio_deviation.map(f64::from)),
        ),
        ("largest_ratio", column(|r| r.largest_ratio.map(f64::from))),
        (
            "clipped_fraction",
            column(|r| r.clipped_fraction.map(f64::from)),
        ),
        ("entropy", column(|r| r.entropy.map(f64::from))),
        (
            "intrinsic_reward",
            column(|r| r.intrinsic_reward.map(f64::from)),
        ),
        (
            "prediction_error",
            column(|r| r.prediction_error.map(f64::from)),
        ),
        (
            "bonus_agreement",
            vec![agreement.unwrap_or(f64::NAN); reports.len()],
        ),
    ]
}
