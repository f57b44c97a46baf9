//! Where each agent of a small team was, in the recording that other runs have as well.

use std::path::Path;

use super::scenario::TabularScenario;
use super::team::Step;
use crate::record::rerun::{Focus, RerunRecorder, RunInfo};
use crate::record::{
    BonusRange, EpisodeRow, RecordError, Recorder, RecordingSettings, RoundRecord,
};
use crate::scenario::overrides::Resolve;
use seedbed_env::tabular::Model;
use seedbed_env::{Action, Choice, Quantity, Spec, Status};
use seedbed_learn::experience::Episode;

/// Larger teams are not recorded.
pub const MAX_AGENTS: u32 = 64;

/// Takes in steps and writes whole rounds: one episode of each agent.
pub struct Film {
    recorder: Option<RerunRecorder>,
    model: Model,
    spec: Spec,
    /// Episodes under way, of each agent: `[K]`.
    running: Vec<Episode>,
    /// Episodes that ended, of rounds that did not.
    ended: Vec<Episode>,
    /// Whether an agent was in a state: `[K][states]`.
    been: Vec<Vec<bool>>,
    round: u32,
    steps: u64,
}

impl Film {
    /// A film at `path`, or none where there is no path or the team is too large.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn of(
        name: &str,
        scenario: &TabularScenario,
        path: Option<&Path>,
    ) -> Result<Self, RecordError> {
        let agents = scenario.agents.count.get();
        let model = scenario.task.model(scenario.seed);
        let spec = spec(scenario, &model);
        let about = RunInfo {
            name: &format!("{name}-seed-{}", scenario.seed),
            focus: Focus::Learning,
            spec: &spec,
            scene: None,
            agents,
            bonus: BonusRange::None,
            episodes: scenario.episodes.get(),
            run_seed: scenario.seed,
            scenario: &scenario.resolved(),
            properties: &[("seedbed_version", env!("CARGO_PKG_VERSION").to_owned())],
        };
        let settings = RecordingSettings {
            scene: None,
            ..RecordingSettings::default()
        };
        let path = path.filter(|_| agents <= MAX_AGENTS);
        let recorder = path
            .map(|path| RerunRecorder::create(path, &about, &settings))
            .transpose()?;
        let running = (0..agents)
            .map(|agent| started(&model, &spec, agent, 0))
            .collect();
        let been = vec![
            vec![false; model.states()];
            if recorder.is_some() {
                agents as usize
            } else {
                0
            }
        ];
        Ok(Self {
            recorder,
            model,
            spec,
            running,
            ended: Vec::new(),
            been,
            round: 0,
            steps: 0,
        })
    }

    /// Takes in one step.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn take_in(&mut self, step: &Step) -> Result<(), RecordError> {
        if self.recorder.is_none() {
            return Ok(());
        }
        let (running, been) = (
            &mut self.running[step.agent as usize],
            &mut self.been[step.agent as usize],
        );
        (been[step.from as usize], been[step.to as usize]) = (true, true);
        running
            .observations
            .extend_from_slice(self.model.coordinates_of(step.to));
        running.actions.push(step.action as f32);
        running.rewards.push(step.reward as f32);
        running.log_probs.push(0.0);
        if step.ended.is_some() {
            let next = started(&self.model, &self.spec, step.agent, step.episode + 1);
            let mut ended = std::mem::replace(running, next);
            let left = !self.model.pairs(step.to).is_empty();
            ended.outcome = if left {
                Status::Truncated
            } else {
                Status::Terminated
            };
            self.ended.push(ended);
            self.write_whole_rounds()?;
        }
        Ok(())
    }

    /// An agent may be rounds ahead of others.
    fn write_whole_rounds(&mut self) -> Result<(), RecordError> {
        while self
            .ended
            .iter()
            .filter(|episode| episode.round == self.round)
            .count()
            == self.running.len()
        {
            let (mut whole, rest): (Vec<Episode>, _) = std::mem::take(&mut self.ended)
                .into_iter()
                .partition(|episode| episode.round == self.round);
            self.ended = rest;
            whole.sort_by_key(|episode| episode.agent);
            self.write_round(&whole)?;
            self.round += 1;
        }
        Ok(())
    }

    fn write_round(&mut self, episodes: &[Episode]) -> Result<(), RecordError> {
        let rows: Vec<EpisodeRow> = episodes.iter().map(|episode| self.row(episode)).collect();
        let episodes: Vec<&Episode> = episodes.iter().collect();
        let record = RoundRecord {
            round: self.round,
            episodes: &episodes,
            episode_rows: &rows,
            round_rows: &[],
            step_data: &[],
            body_trajectories: &[],
        };
        self.recorder
            .as_mut()
            .map_or(Ok(()), |recorder| recorder.record_round(&record))
    }

    fn row(&mut self, episode: &Episode) -> EpisodeRow {
        self.steps += episode.length() as u64;
        let been = &self.been[episode.agent as usize];
        EpisodeRow {
            agent: episode.agent,
            episode: episode.episode,
            round: episode.round,
            env_steps: self.steps,
            r#return: episode.total_reward(),
            length: episode.length() as u32,
            outcome: episode.outcome,
            coverage: been.iter().filter(|been| **been).count() as f64 / been.len() as f64,
            // Visits are counted by state, in `visits.csv`.
            visitation_entropy: f64::NAN,
            team_overlap: f64::NAN,
            effective_agents: f64::NAN,
        }
    }

    /// Completes the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(&mut self) -> Result<(), RecordError> {
        self.recorder.as_mut().map_or(Ok(()), Recorder::finish)
    }
}

/// An agent's episode at the task's start.
fn started(model: &Model, spec: &Spec, agent: u32, episode: u32) -> Episode {
    let mut started = Episode::start(agent, episode, episode, spec);
    started
        .observations
        .extend_from_slice(model.coordinates_of(model.start));
    started
}

/// A finite task as the recording and the report describe it.
#[must_use]
pub fn spec(scenario: &TabularScenario, model: &Model) -> Spec {
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
    Spec {
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
    }
}
