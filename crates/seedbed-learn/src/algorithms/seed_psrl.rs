//! Seed-PSRL: agents that plan in a model of the task that is drawn by their own seed.
//!
//! The team learns one Bayesian network of the dynamics, the rewards and the ends of episodes from
//! all its episodes. Agent k acts as if the weights `μ + c σ z_k` were true, where `z_k` is its fixed
//! seed: posterior sampling with seeds (Dimakopoulou & Van Roy 2018) in the model of the thesis's §4.
//! It searches for the best sequence of actions with the cross-entropy method, as in PETS (Chua et
//! al. 2018), but in one network instead of an ensemble with particles.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::AlgorithmConfig;
use crate::agent::action_selection::ActionSelection;
use crate::agent::bonus::SHARED_OWNER;
use crate::agent::dynamics::transitions::{ActionEncoding, Targets, TransitionEncoder};
use crate::agent::dynamics::{DynamicsModel, ModelShape, fill_normal};
use crate::agent::network_info::{PlannerInfo, setting_text};
use crate::agent::planning::Plan;
use crate::agent::planning::imagination::{Imagination, ModelUnits};
use crate::agent::planning::search::{Search, SearchSettings};
use crate::agent::{ActScratch, TeamConfig, UpdateReport};
use crate::experience::{Episode, EpisodeInfo};
use crate::nn::{AdamSettings, BayesianSettings, Tensor, network_tensors};
use crate::seed::SameInitial;
use crate::team::{
    ActionRequest, AgentUpdate, LearningRequest, SavedTeam, Team, TeamContext, Workers,
};
use seedbed_env::TaskSpec;
use seedbed_input::limits::short_list;
use seedbed_input::numbers::{
    Count, NonNegative, Positive, PositiveFraction, ranged_count, ranged_number,
};
use seedbed_input::{Located, ValidationError};
use seedbed_random::{Purpose, Stream, stream};

/// Seed-PSRL: posterior sampling with seeds (Dimakopoulou & Van Roy 2018) in a Bayesian network of the
/// task. The team learns one network, which predicts the change of each observation, the reward, and
/// whether the episode terminates. Agent k plans in the network with the weights `μ + c σ z_k`, where
/// `z_k` is standard normal and by default drawn once per run, and executes the sequence of actions
/// with the highest imagined return (cross-entropy method, Chua et al. 2018). Where the team has seen
/// few rewards, the σ of the weights is large, and each agent expects other rewards. The cost of
/// learning does not depend on the number of agents. Reward seeds (`agents.seeds`) are not used.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SeedPsrl {
    /// Whose draw of the weights an agent plans with.
    pub draw: ModelDraw,
    /// Factor c on the standard deviation of each weight.
    pub scale: NonNegative,
    /// Number of actions of a plan.
    pub horizon: Count<1000>,
    /// Number of steps for which each action of a plan is held.
    pub hold: Count<1000>,
    /// Number of actions of a plan that are executed before the next one is made, at most `horizon`.
    pub replan_every: Located<Count<1000>>,
    /// Number of sequences of actions that are imagined per iteration of a search.
    pub candidates: Count<100_000>,
    /// Number of iterations of a search.
    pub iterations: Count<1000>,
    /// Number of the best sequences that the next iteration draws around, at most `candidates`.
    pub elites: Located<Count<100_000>>,
    /// Standard deviation of continuous actions in the first iteration, in units of half their range.
    pub deviation: Positive,
    /// Discount of imagined rewards per step. Nothing is imagined beyond the last action of a plan.
    pub discount: PositiveFraction,
    /// Minimal number of the newest transitions that the model learns from.
    pub transitions: Count<100_000_000>,
    /// Number of gradient steps per round.
    pub minibatches: Count<100_000>,
    /// Number of transitions per gradient step.
    pub minibatch: Count<100_000>,
    /// Number of units of each hidden layer of the model.
    #[serde(deserialize_with = "short_list")]
    pub hidden: Vec<Count<4096>>,
    /// Further parameters of the model.
    pub network: BayesianSettings,
}

/// Whose draw `z` of the weights `μ + c σ z` an agent plans with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum ModelDraw {
    /// Each agent has its own `z_k`, drawn once per run.
    #[default]
    Own,
    /// All agents have the same z, drawn once per run: a control without diversity.
    Team,
    /// Each agent draws a new z for each episode, as in posterior sampling without seeds: a control
    /// that does not keep to a plan over episodes.
    Fresh,
    /// No draw: all agents plan with the mean weights, a control without exploration.
    Mean,
}

impl Default for SeedPsrl {
    fn default() -> Self {
        Self {
            draw: ModelDraw::Own,
            scale: ranged_number(1.0),
            horizon: ranged_count(15),
            hold: ranged_count(1),
            replan_every: ranged_count(1).into(),
            candidates: ranged_count(64),
            iterations: ranged_count(2),
            elites: ranged_count(8).into(),
            deviation: ranged_number(0.7),
            discount: ranged_number(0.99),
            transitions: ranged_count(1_000_000),
            minibatches: ranged_count(1000),
            minibatch: ranged_count(64),
            hidden: vec![ranged_count(32)],
            network: BayesianSettings {
                initial_deviation: ranged_number(0.05),
                likelihood_deviation: ranged_number(0.1),
                optimizer: AdamSettings {
                    step_size: ranged_number(3e-3),
                    ..AdamSettings::default()
                },
                ..BayesianSettings::default()
            },
        }
    }
}

impl AlgorithmConfig for SeedPsrl {
    fn build(&self, context: &TeamContext<'_>) -> Box<dyn Team> {
        Box::new(SeedPsrlTeam::new(self, context))
    }

    fn check(&self) -> Result<(), ValidationError> {
        let (horizon, candidates) = (self.horizon.get(), self.candidates.get());
        if self.replan_every.get() > horizon {
            let message = format!(
                "is larger than `horizon`, the number of actions of a plan, which is {horizon}; \
                 expected at most {horizon}"
            );
            return Err(self.replan_every.error(message));
        }
        if self.elites.get() > candidates {
            let message = format!(
                "`elites` is {}, but `candidates` is {candidates}; expected at most {candidates} \
                 elites",
                self.elites.get()
            );
            return Err(self.elites.error(message));
        }
        Ok(())
    }

    fn check_team(&self, team: &TeamConfig) -> Result<(), ValidationError> {
        if *team.same_initial != SameInitial::Off {
            return Err(team.same_initial.error(
                "`SeedPsrl` has no policy and no value function; expected `Off`, or \
                 `draw: Team` to give all agents the same model",
            ));
        }
        Ok(())
    }

    /// A greedy agent plans with the mean weights.
    fn set_action_selection(&mut self, selection: ActionSelection) {
        if selection == ActionSelection::Greedy {
            self.draw = ModelDraw::Mean;
        }
    }

    fn transitions_kept(&self) -> u64 {
        self.transitions.get().into()
    }

    fn planner_info(&self, task: &TaskSpec) -> Option<PlannerInfo> {
        let changes = task
            .observations
            .iter()
            .map(|o| format!("change of {}", o.name));
        let outcomes = ["reward", "end"].map(str::to_owned);
        Some(PlannerInfo {
            model: "team.dynamics",
            inputs: TransitionEncoder::input_names(task),
            outputs: changes.chain(outcomes).collect(),
            formula: FORMULA,
            settings: setting_text(self),
        })
    }

    fn memory(&self, task: &TaskSpec, agents: u32, _steps: u64) -> u64 {
        let (shape, search) = (self.shape(), self.search(task));
        let plan = u64::from(self.horizon.get()) * search.width() as u64;
        let per_agent = shape.weight_count(task) as u64 + plan;
        let buffers = 2 * u64::from(self.candidates.get()) * plan;
        let numbers = u64::from(agents).saturating_mul(per_agent) + buffers;
        shape
            .memory(task)
            .saturating_add(numbers.saturating_mul(size_of::<f32>() as u64))
    }

    fn cost_per_step(&self, agents: u32) -> f64 {
        // Both act and learn evaluate the network: a plan for every agent, a gradient for the team.
        let imagined = self.candidates.get() * self.iterations.get() * self.horizon.get();
        let planning = f64::from(imagined) / f64::from(self.replan_every.get());
        planning / 5.0 + 20.0 / f64::from(agents)
    }
}

/// How the model predicts, for readers of its tensors.
const FORMULA: &str = "inputs: a continuous action is first scaled to its range, clip((a - center) / \
    half_range, -1, 1); then x = clip((input - inputs.mean) / inputs.deviation, -10, 10). Network: \
    weights w = mean + scale * deviation * z, relu between the layers. Outputs o: a change is \
    changes.root_mean_square * clip(o, -10, 10); the reward is outcomes.unit[0] * clip(o, -10, 10); \
    the probability of an end is clip(outcomes.unit[1] * o, 0, 1).";

impl SeedPsrl {
    fn shape(&self) -> ModelShape<'_> {
        ModelShape {
            targets: Targets::ChangesAndOutcomes,
            hidden: &self.hidden,
            network: &self.network,
        }
    }

    fn search(&self, task: &TaskSpec) -> Search {
        let settings = SearchSettings {
            horizon: self.horizon.get() as usize,
            candidates: self.candidates.get() as usize,
            iterations: self.iterations.get() as usize,
            elites: self.elites.get() as usize,
            deviation: self.deviation.get_f32(),
        };
        Search::new(&ActionEncoding::of_task(task), settings)
    }
}

/// A team whose agents plan in draws of one model.
struct SeedPsrlTeam {
    config: SeedPsrl,
    run_seed: u64,
    encodings: Vec<ActionEncoding>,
    agent_count: usize,
    /// Number of the first of the local agents. The process of agent 0 trains the model.
    first_agent: usize,
    model: DynamicsModel,
    units: ModelUnits,
    search: Search,
    /// The local agents. An agent acts in one thread at a time, so that no lock is ever waited for.
    planners: Vec<Mutex<Planner>>,
}

/// What an agent plans with.
struct Planner {
    /// The weights of its model: `[P]`.
    weights: Vec<f32>,
    /// The stream of new draws in this round.
    fresh: Stream,
    plan: Plan,
}

impl SeedPsrlTeam {
    fn new(config: &SeedPsrl, context: &TeamContext<'_>) -> Self {
        let mut random = stream(context.run_seed, Purpose::ModelParameters, 0, 0);
        let model = DynamicsModel::new(&config.shape(), context.spec, &mut random);
        let local_agents = context.local_agents();
        let mut team = Self {
            run_seed: context.run_seed,
            encodings: ActionEncoding::of_task(context.spec),
            agent_count: context.config.count.get() as usize,
            first_agent: local_agents.start as usize,
            units: ModelUnits::of_model(&model),
            search: config.search(context.spec),
            model,
            planners: Vec::new(),
            config: config.clone(),
        };
        team.planners = local_agents
            .map(|agent| Mutex::new(team.planner(agent, 0)))
            .collect();
        team
    }

    /// An agent at the beginning of a round.
    fn planner(&self, agent: u32, round: u32) -> Planner {
        let mut planner = Planner {
            weights: Vec::new(),
            fresh: stream(self.run_seed, Purpose::FreshModelSeeds, agent, round),
            plan: Plan::default(),
        };
        self.draw_weights(&mut planner, &mut self.seed_stream(agent));
        planner
    }

    /// The stream of the seeds that an agent draws once per run.
    fn seed_stream(&self, agent: u32) -> Stream {
        let owner = match self.config.draw {
            ModelDraw::Team => 0,
            ModelDraw::Own | ModelDraw::Fresh | ModelDraw::Mean => agent,
        };
        stream(self.run_seed, Purpose::ModelSeeds, owner, 0)
    }

    /// Sets the weights of an agent to μ + c σ z, with z from `seeds`, or to μ.
    fn draw_weights(&self, planner: &mut Planner, seeds: &mut Stream) {
        let scale = match self.config.draw {
            ModelDraw::Mean => 0.0,
            ModelDraw::Own | ModelDraw::Team | ModelDraw::Fresh => self.config.scale.get_f32(),
        };
        let mut noise = Vec::new();
        fill_normal(&mut noise, self.model.weight_count(), seeds);
        for z in &mut noise {
            *z *= scale;
        }
        let posterior = self.model.network().posterior();
        posterior.draw(&noise, &mut planner.weights);
    }

    /// Forgets the last plan; with `Fresh`, draws new weights.
    fn begin_episode(&self, planner: &mut Planner) {
        planner.plan.clear();
        if self.config.draw == ModelDraw::Fresh {
            let mut fresh = planner.fresh.clone();
            self.draw_weights(planner, &mut fresh);
            planner.fresh = fresh;
        }
    }

    /// Chooses the next action of an agent.   `action: [action width]`
    fn choose(
        &self,
        planner: &mut Planner,
        observation: &[f32],
        random: &mut Stream,
        scratch: &mut ActScratch,
        action: &mut [f32],
    ) {
        let Planner { weights, plan, .. } = planner;
        let imagination = Imagination {
            likelihood: self.model.network().likelihood(),
            weights,
            units: &self.units,
            discount: self.config.discount.get_f32(),
            hold: self.config.hold.get() as usize,
        };
        let replan_every = self.config.replan_every.get() as usize;
        let mut inputs = plan.next_action(
            (&self.search, &imagination),
            (observation, replan_every),
            random,
            &mut scratch.planning,
        );
        for (component, encoding) in action.iter_mut().zip(&self.encodings) {
            let (own, rest) = inputs.split_at(encoding.width());
            *component = encoding.decode(own);
            inputs = rest;
        }
    }

    /// Numbers of the local agents.
    fn local_agents(&self) -> Range<u32> {
        let end = self.first_agent + self.planners.len();
        self.first_agent as u32..end as u32
    }

    fn trains(&self) -> bool {
        self.first_agent == 0
    }

    /// Trains the model; returns its error on the new episodes before that.
    fn train(&mut self, request: &LearningRequest<'_>, first_new: usize, update: u32) -> f32 {
        let mut random = stream(self.run_seed, Purpose::ModelTraining, 0, update);
        let all: Vec<&Episode> = request.episodes.iter().collect();
        let error = self.model.add_episodes(&all[first_new..]);
        let minibatch = self.config.minibatch.get() as usize;
        let minibatches = self.config.minibatches.get();
        self.model.train(&all, minibatches, minibatch, &mut random);
        self.units = ModelUnits::of_model(&self.model);
        error
    }

    fn restore_model(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.model.restore(bytes, "a model of the dynamics")?;
        self.units = ModelUnits::of_model(&self.model);
        Ok(())
    }
}

/// The agent's state, also if another thread panicked while it held the lock.
fn lock(planner: &Mutex<Planner>) -> MutexGuard<'_, Planner> {
    planner.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Team for SeedPsrlTeam {
    fn agent_count(&self) -> usize {
        self.agent_count
    }

    fn begin_round(&mut self, round: u32) {
        let planners = self.local_agents().map(|agent| self.planner(agent, round));
        self.planners = planners.map(Mutex::new).collect();
    }

    fn act(&self, request: &mut ActionRequest<'_>, scratch: &mut ActScratch) {
        let count = request.playing.len();
        let observation_width = request.observations.len() / count;
        let action_width = request.actions.len() / count;
        request.log_probs.fill(0.0);
        let group = &self.planners[request.first_agent - self.first_agent..][..count];
        for (agent, planner) in group.iter().enumerate() {
            if !request.playing[agent] {
                continue;
            }
            let planner = &mut *lock(planner);
            if request.steps[agent] == 0 {
                self.begin_episode(planner);
            }
            let observation = agent * observation_width..(agent + 1) * observation_width;
            let action = agent * action_width..(agent + 1) * action_width;
            self.choose(
                planner,
                &request.observations[observation],
                &mut request.random[agent].stream,
                scratch,
                &mut request.actions[action],
            );
        }
    }

    fn learn(&mut self, request: &LearningRequest<'_>, _: Workers<'_>) -> Vec<AgentUpdate> {
        let Some(first) = request.learners.first() else {
            return Vec::new();
        };
        let trains = self.trains();
        let error =
            trains.then(|| self.train(request, first.first_new_episode, first.earlier_updates));
        let is_finite = self.model.is_finite();
        let update = |agent| AgentUpdate {
            agent,
            update: UpdateReport {
                gradient_steps: Some(if agent == 0 {
                    self.config.minibatches.get()
                } else {
                    0
                }),
                prediction_error: error,
                ..UpdateReport::default()
            }
            .into(),
            is_finite,
        };
        let learners = request.learners.iter();
        learners.map(|learner| update(learner.agent)).collect()
    }

    fn choose_episodes(&self, _: &[EpisodeInfo], _: u32) -> Option<Vec<usize>> {
        (!self.trains()).then(Vec::new)
    }

    fn shared_model(&self) -> Option<Vec<u8>> {
        self.trains().then(|| self.model.save())
    }

    fn set_shared_model(&mut self, bytes: &[u8], _: Workers<'_>) -> Result<(), String> {
        self.restore_model(bytes)
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        if !self.trains() {
            return Vec::new();
        }
        let prefix = format!("{SHARED_OWNER}dynamics.");
        let tensors = self.model.tensors().into_iter();
        tensors.map(|tensor| tensor.prefixed(&prefix)).collect()
    }

    /// The seeds that agents draw once per run.
    fn initial_tensors(&self) -> Vec<Tensor<'_>> {
        let mut tensors = Vec::new();
        if matches!(self.config.draw, ModelDraw::Fresh | ModelDraw::Mean) {
            return tensors;
        }
        let mlp = self.model.network().likelihood().mlp();
        let mut seeds = Vec::new();
        for agent in self.local_agents() {
            let (count, prefix) = (
                self.model.weight_count(),
                format!("agent_{agent}.dynamics."),
            );
            fill_normal(&mut seeds, count, &mut self.seed_stream(agent));
            let own = network_tensors(mlp, &seeds, "seeds");
            tensors.extend(own.map(|tensor| tensor.prefixed(&prefix).into_owned()));
        }
        tensors
    }

    fn save(&self) -> SavedTeam {
        SavedTeam {
            parts: Vec::new(),
            shared: self.model.save(),
        }
    }

    fn restore(&mut self, saved: &SavedTeam) -> Result<(), String> {
        self.restore_model(&saved.shared)
    }
}

#[cfg(test)]
mod tests;
