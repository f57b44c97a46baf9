//! The recording of a tabular run: the states that each agent of a small team visited.

use super::scenario::TabularScenario;
use super::team::Step;
use crate::run::facts::EpisodeRow;
use crate::run::ranks::Ranks;
use crate::run::recorder::{
    BonusRange, Focus, RecordError, Recorder, RecorderFactory, RoundRecord, RunInfo,
};
use crate::scenario::recording::RecordingSettings;
use crate::scenario::resolve::Resolve;
use seedbed_env::tabular::Model;
use seedbed_env::{Action, Choice, Quantity, Status, TaskSpec};
use seedbed_learn::experience::Episode;
use seedbed_learn::team::Workers;

/// Max number of agents of a team that is recorded.
pub const MAX_AGENTS: u32 = 64;

/// Records a tabular run round by round. Round n has the n-th episode of each agent.
pub struct TabularRecorder {
    recorder: Option<Box<dyn Recorder>>,
    model: Model,
    spec: TaskSpec,
    /// Current episode of each agent: `[K]`.
    current: Vec<Episode>,
    /// Finished episodes of rounds in which other agents have not finished their episode.
    finished: Vec<Episode>,
    /// Whether each agent visited each state: `[K][states]`; empty if nothing is recorded.
    visited: Vec<Vec<bool>>,
    /// Number of recorded rounds.
    round: u32,
    /// Number of recorded environment steps.
    env_steps: u64,
}

impl TabularRecorder {
    /// Starts recording with the recorder that `recorder_factory` makes. Records nothing without a
    /// factory, or if the team has more than `MAX_AGENTS` agents.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn new(
        name: &str,
        scenario: &TabularScenario,
        recorder_factory: Option<Box<dyn RecorderFactory>>,
    ) -> Result<Self, RecordError> {
        let agents = scenario.agents.count.get();
        let model = scenario.task.model(scenario.seed);
        let spec = task_spec(scenario, &model);
        let recorder = recorder_factory
            .filter(|_| agents <= MAX_AGENTS)
            .map(|factory| create_recorder(factory, name, scenario, &spec))
            .transpose()?;
        let recorded_agents = if recorder.is_some() { agents } else { 0 };
        let current = (0..recorded_agents)
            .map(|agent| start_episode(&model, &spec, agent, 0))
            .collect();
        let visited = vec![vec![false; model.state_count()]; recorded_agents as usize];
        Ok(Self {
            recorder,
            model,
            spec,
            current,
            finished: Vec::new(),
            visited,
            round: 0,
            env_steps: 0,
        })
    }

    /// Records a step of the team.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn record_step(&mut self, step: &Step) -> Result<(), RecordError> {
        if self.recorder.is_none() {
            return Ok(());
        }
        let agent = step.agent as usize;
        self.visited[agent][step.from as usize] = true;
        self.visited[agent][step.to as usize] = true;
        let episode = &mut self.current[agent];
        episode
            .observations
            .extend_from_slice(self.model.coordinates_of(step.to));
        episode.actions.push(step.action as f32);
        episode.rewards.push(step.reward as f32);
        episode.log_probs.push(0.0);
        if step.ended_episode.is_none() {
            return Ok(());
        }
        let next = start_episode(&self.model, &self.spec, step.agent, step.episode + 1);
        let mut finished = std::mem::replace(episode, next);
        finished.outcome = self.outcome_in(step.to);
        self.finished.push(finished);
        self.record_complete_rounds()
    }

    /// How an episode ended whose last state this is.
    #[must_use]
    pub fn outcome_in(&self, state: u32) -> Status {
        if self.model.pairs(state).is_empty() {
            Status::Terminated
        } else {
            Status::Truncated
        }
    }

    /// Records every round in which all agents have finished their episode. Some agents may be
    /// several rounds ahead of others.
    fn record_complete_rounds(&mut self) -> Result<(), RecordError> {
        loop {
            let round = self.round;
            let is_in_round = |episode: &Episode| episode.round == round;
            let count = self
                .finished
                .iter()
                .filter(|&episode| is_in_round(episode))
                .count();
            if count < self.current.len() {
                return Ok(());
            }
            let (mut complete, later): (Vec<Episode>, Vec<Episode>) =
                std::mem::take(&mut self.finished)
                    .into_iter()
                    .partition(is_in_round);
            self.finished = later;
            complete.sort_by_key(|episode| episode.agent);
            self.record_round(&complete)?;
            self.round += 1;
        }
    }

    fn record_round(&mut self, episodes: &[Episode]) -> Result<(), RecordError> {
        let rows: Vec<EpisodeRow> = episodes.iter().map(|episode| self.row(episode)).collect();
        let episodes: Vec<&Episode> = episodes.iter().collect();
        let record = RoundRecord {
            round: self.round,
            episodes: &episodes,
            episode_rows: &rows,
            round_rows: &[],
            step_data: &[],
            details: &[],
            workers: Workers::CURRENT_THREAD,
        };
        self.recorder
            .as_mut()
            .map_or(Ok(()), |recorder| recorder.record_round(&record))
    }

    fn row(&mut self, episode: &Episode) -> EpisodeRow {
        self.env_steps += episode.length() as u64;
        let visited = &self.visited[episode.agent as usize];
        let visited_states = visited.iter().filter(|is_visited| **is_visited).count();
        EpisodeRow {
            agent: episode.agent,
            episode: episode.episode,
            round: episode.round,
            env_steps: self.env_steps,
            r#return: episode.total_reward(),
            length: episode.length() as u32,
            outcome: episode.outcome,
            coverage: visited_states as f64 / visited.len() as f64,
            // These measures are not computed during tabular runs.
            visitation_entropy: f64::NAN,
            team_overlap: f64::NAN,
            effective_agents: f64::NAN,
        }
    }

    /// The recorder's warning, if there is one.
    pub fn take_warning(&mut self) -> Option<String> {
        self.recorder
            .as_mut()
            .and_then(|recorder| recorder.take_warning())
    }

    /// Completes the file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(&mut self) -> Result<(), RecordError> {
        self.recorder
            .as_mut()
            .map_or(Ok(()), |recorder| recorder.finish())
    }
}

fn create_recorder(
    factory: Box<dyn RecorderFactory>,
    name: &str,
    scenario: &TabularScenario,
    spec: &TaskSpec,
) -> Result<Box<dyn Recorder>, RecordError> {
    let info = RunInfo {
        name: &format!("{name}-seed-{}", scenario.seed),
        focus: Focus::Learning,
        spec,
        scene: None,
        agents: scenario.agents.count.get(),
        ranks: Ranks::SINGLE,
        bonus: BonusRange::None,
        max_episodes: scenario.episodes.get(),
        run_seed: scenario.seed,
        scenario: &scenario.resolved(),
        properties: &[("seedbed_version", env!("CARGO_PKG_VERSION").to_owned())],
    };
    let settings = RecordingSettings {
        scene: None,
        ..RecordingSettings::default()
    };
    factory.create(&info, &settings)
}

/// An episode that has only its start state.
fn start_episode(model: &Model, spec: &TaskSpec, agent: u32, episode: u32) -> Episode {
    let round = episode;
    let mut started = Episode::start(agent, episode, round, spec);
    started
        .observations
        .extend_from_slice(model.coordinates_of(model.start));
    started
}

/// The task of a tabular scenario, as recordings and reports describe it.
#[must_use]
pub fn task_spec(scenario: &TabularScenario, model: &Model) -> TaskSpec {
    let quantity = |name: &str, range| Quantity {
        name: name.to_owned(),
        unit: String::new(),
        range,
    };
    let actions: Vec<f32> = (0..model.max_actions())
        .map(|action| action as f32)
        .collect();
    let observations = model
        .coordinates
        .iter()
        .map(|coordinate| quantity(coordinate.name, [0.0, coordinate.max]));
    TaskSpec {
        name: scenario.task.name().to_owned(),
        description: String::new(),
        observations: observations.collect(),
        actions: vec![Action {
            quantity: quantity("action", [0.0, actions.len() as f32 - 1.0]),
            choice: Choice::Discrete(actions),
        }],
        control_step: 1.0,
        time_limit: model.horizon,
        reward_threshold: None,
        info: Vec::new(),
    }
}
