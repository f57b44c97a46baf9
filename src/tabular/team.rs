//! A team in one tabular task: agents act at random times, and each transition updates the shared
//! belief immediately.
//!
//! The next action is always that of the agent with the earliest time, so that each agent knows
//! everything that happened before. A run is one sequence of actions, on one thread.

mod sample_mdp;

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rand::RngExt;

use super::Algorithm;
use super::belief::Belief;
use super::plan_cache::PlanCache;
use super::planner::{Planner, Policy};
use super::scenario::TabularScenario;
use super::seed::AgentSeed;
use super::turn::{Turn, first_turns};
use seedbed_env::random::{Purpose, Stream, stream};
use seedbed_env::tabular::{Mdp, Model};

/// A team in a task that was drawn from the family of the scenario.
pub struct TabularTeam {
    scenario: TabularScenario,
    model: Model,
    /// The drawn task.
    true_mdp: Mdp,
    optimal_value: f64,
    belief: Belief,
    planner: Planner,
    agents: Vec<Agent>,
    queue: BinaryHeap<Reverse<Turn>>,
    plan_cache: PlanCache,
    /// The MDP in which the acting agent plans.
    mdp: Mdp,
    /// Optimism about each outcome, see [`Planner::plan`]: `[outcomes]`, or empty.
    optimism: Vec<f64>,
    visits: Vec<Visits>,
    steps: u64,
}

/// One agent.
struct Agent {
    seed: Option<AgentSeed>,
    /// Random stream of the times between its actions.
    clock: Stream,
    /// Random stream of the outcomes of its actions, and of its random actions.
    outcomes: Stream,
    plan: Plan,
    /// The policy of [`Plan::Own`].
    policy: Policy,
    /// Version of the belief that the plan is based on.
    version: u64,
    /// First step that the plan covers.
    planned_from: u32,
    state: u32,
    /// Number of actions in this episode.
    step: u32,
    /// Number of actions in all episodes.
    actions: u32,
    episode: Episode,
    /// Whether it visited each state: `[states]`.
    visited: Vec<bool>,
}

/// Which policy an agent follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Plan {
    /// None yet.
    None,
    /// The policy with this index in the plan cache.
    Cached(usize),
    /// A policy of its own.
    Own,
}

/// One action of one agent, with its result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Index of the agent.
    pub agent: u32,
    /// Index of the episode among the agent's episodes.
    pub episode: u32,
    /// State before the action.
    pub from: u32,
    /// Index of the action among the actions of that state.
    pub action: u32,
    /// Reward.
    pub reward: f64,
    /// State after the action.
    pub to: u32,
    /// The episode, if it ended with this step.
    pub ended: Option<Episode>,
}

/// An episode of one agent: a row of `regret.csv`.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Episode {
    /// Index of the agent.
    pub agent: u32,
    /// Index of the episode among the agent's episodes.
    pub episode: u32,
    /// Time at which the episode began, in units of the mean time between two actions of an agent.
    pub begun: f64,
    /// Time of its last action.
    pub ended: f64,
    /// Number of steps.
    pub length: u32,
    /// Sum of rewards.
    pub r#return: f64,
    /// Expected return of the optimal policy, minus the mean rewards of the transitions that
    /// happened.
    pub regret: f64,
}

/// Visits of one state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Visits {
    /// Number of visits by the whole team.
    pub visits: u64,
    /// Number of agents that visited it at least once.
    pub agents: u32,
}

impl TabularTeam {
    /// A team before its first action, in the task that is drawn with the scenario's run seed.
    #[must_use]
    pub fn new(scenario: &TabularScenario) -> Self {
        let model = scenario.task.model(scenario.seed);
        let true_mdp = scenario.task.draw(&model, scenario.seed);
        let mut planner = Planner::new(&model);
        let agents: Vec<Agent> = (0..scenario.agents.count.get())
            .map(|agent| Agent::new(scenario, &model, agent))
            .collect();
        let mut team = Self {
            optimal_value: planner.optimal_value(&model, &true_mdp),
            belief: Belief::new(&model),
            queue: BinaryHeap::new(),
            agents,
            plan_cache: PlanCache::new(&model),
            mdp: Mdp {
                values: vec![0.0; model.parameters.len()],
                probabilities: vec![1.0; model.outcomes().len()],
            },
            optimism: Vec::new(),
            visits: vec![Visits::default(); model.states()],
            steps: 0,
            scenario: scenario.clone(),
            model,
            true_mdp,
            planner,
        };
        team.queue = first_turns(scenario)
            .into_iter()
            .map(|turn| Reverse(team.begin_episode(turn, 0)))
            .collect();
        team
    }

    /// Executes the next action of the team. `None` if all agents have finished all episodes.
    pub fn advance(&mut self) -> Option<Step> {
        let Reverse(turn) = self.queue.pop()?;
        let pair = self.choose_pair(turn.agent);
        let mut step = self.execute(turn, pair);
        let agent = &mut self.agents[turn.agent as usize];
        let is_over = agent.step >= self.model.horizon || self.model.pairs(agent.state).is_empty();
        if !is_over {
            self.queue.push(Reverse(turn.next(&mut agent.clock)));
            return Some(step);
        }
        step.ended = Some(Episode {
            ended: turn.time,
            ..agent.episode
        });
        if step.episode + 1 < self.scenario.episodes.get() {
            let first_turn = self.begin_episode(turn, step.episode + 1);
            self.queue.push(Reverse(first_turn));
        } else {
            agent.free_memory();
        }
        Some(step)
    }

    /// Begins an episode at the time of `turn`, and returns the turn of its first action.
    fn begin_episode(&mut self, turn: Turn, episode: u32) -> Turn {
        let agent = &mut self.agents[turn.agent as usize];
        agent.state = self.model.start;
        agent.step = 0;
        agent.episode = Episode {
            agent: turn.agent,
            episode,
            begun: turn.time,
            regret: self.optimal_value,
            ..Episode::default()
        };
        let next = turn.next(&mut agent.clock);
        self.count_visit(turn.agent);
        next
    }

    /// Counts a visit of the agent's state.
    fn count_visit(&mut self, agent: u32) {
        let agent = &mut self.agents[agent as usize];
        let visits = &mut self.visits[agent.state as usize];
        let is_first = !std::mem::replace(&mut agent.visited[agent.state as usize], true);
        visits.visits += 1;
        visits.agents += u32::from(is_first);
    }

    /// Executes an action, a pair of the agent's state, in the true MDP, and updates the belief.
    fn execute(&mut self, turn: Turn, pair: usize) -> Step {
        let agent = &mut self.agents[turn.agent as usize];
        let outcome_index = self.model.sample(&self.true_mdp, pair, &mut agent.outcomes);
        let observation = self
            .model
            .observe(&self.true_mdp, outcome_index, &mut agent.outcomes);
        let (from, to) = (agent.state, self.model.outcomes()[outcome_index].state);
        let reward = self.model.reward(outcome_index, observation);
        agent.enter(
            to,
            reward,
            self.model.mean_reward(outcome_index, &self.true_mdp.values),
        );
        let episode = agent.episode.episode;
        self.steps += 1;
        self.belief
            .update(&self.model, pair, outcome_index, observation);
        self.count_visit(turn.agent);
        let action = (pair - self.model.pairs(from).start) as u32;
        Step {
            agent: turn.agent,
            episode,
            from,
            action,
            reward,
            to,
            ended: None,
        }
    }

    /// Chooses the next action of an agent: a pair of its state.
    fn choose_pair(&mut self, agent: u32) -> usize {
        let pairs = self.model.pairs(self.agents[agent as usize].state);
        let epsilon = match self.scenario.algorithm {
            Algorithm::Random => 1.0,
            Algorithm::EpsilonGreedy { epsilon } => epsilon.get(),
            _ => 0.0,
        };
        let random = &mut self.agents[agent as usize].outcomes;
        if epsilon > 0.0 && random.random::<f64>() < epsilon {
            return random.random_range(pairs);
        }
        pairs.start + self.planned_action(agent)
    }

    /// Index of the planned action among the actions of the agent's state.
    fn planned_action(&mut self, agent_index: u32) -> usize {
        if !self.is_up_to_date(&self.agents[agent_index as usize]) {
            self.plan(agent_index);
        }
        let agent = &self.agents[agent_index as usize];
        let policy = match agent.plan {
            Plan::Cached(index) => self.plan_cache.policies[index]
                .as_ref()
                .expect("the agent's policy is in the cache"),
            Plan::Own | Plan::None => &agent.policy,
        };
        self.planner.action(policy, agent.step, agent.state)
    }

    /// Whether an agent's plan is still the one that it would make now.
    fn is_up_to_date(&self, agent: &Agent) -> bool {
        let has_plan = agent.plan != Plan::None && agent.planned_from <= agent.step;
        match self.scenario.algorithm {
            Algorithm::ThompsonResampling => false,
            Algorithm::SampleOnce => has_plan && agent.step > 0,
            _ => has_plan && agent.version == self.belief.version(),
        }
    }

    /// Plans the remaining steps of an agent's episode.
    fn plan(&mut self, agent_index: u32) {
        self.sample_mdp(agent_index);
        let cached = self.plan_cache.index(&self.mdp);
        let agent = &mut self.agents[agent_index as usize];
        (agent.version, agent.planned_from) = (self.belief.version(), agent.step);
        if let Some(index) = cached {
            agent.plan = Plan::Cached(index);
            let entry = &mut self.plan_cache.policies[index];
            if entry.is_none() {
                let policy = entry.insert(self.planner.empty_policy());
                self.planner.plan(&self.model, &self.mdp, &[], 0, policy);
            }
            return;
        }
        agent.plan = Plan::Own;
        agent.policy.resize(self.planner.policy_length(), 0);
        self.planner.plan(
            &self.model,
            &self.mdp,
            &self.optimism,
            agent.step,
            &mut agent.policy,
        );
    }

    /// Expected return of an episode under the optimal policy.
    #[must_use]
    pub fn optimal_value(&self) -> f64 {
        self.optimal_value
    }

    /// States, actions and transitions of the task.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Visits of each state: `[states]`.
    #[must_use]
    pub fn visits(&self) -> &[Visits] {
        &self.visits
    }

    /// Number of states that the team visited.
    #[must_use]
    pub fn states_visited(&self) -> usize {
        self.visits
            .iter()
            .filter(|visits| visits.agents > 0)
            .count()
    }

    /// Number of actions of the whole team.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }
}

impl Agent {
    fn new(scenario: &TabularScenario, model: &Model, agent: u32) -> Self {
        let named = |purpose| stream(scenario.seed, purpose, agent, 0);
        let seed = match scenario.algorithm {
            Algorithm::SeedSampling { .. } => Some(AgentSeed::new(model, scenario.seed, agent)),
            Algorithm::SharedSeed { .. } => Some(AgentSeed::new(model, scenario.seed, 0)),
            _ => None,
        };
        Self {
            seed,
            clock: named(Purpose::TabularClock),
            outcomes: named(Purpose::TabularOutcomes),
            plan: Plan::None,
            policy: Policy::new(),
            version: 0,
            planned_from: 0,
            state: model.start,
            step: 0,
            actions: 0,
            episode: Episode::default(),
            visited: vec![false; model.states()],
        }
    }

    /// Moves to a state, with a reward whose mean is `mean`.
    fn enter(&mut self, to: u32, reward: f64, mean: f64) {
        self.episode.r#return += reward;
        self.episode.regret -= mean;
        self.episode.length += 1;
        self.state = to;
        self.step += 1;
        self.actions += 1;
    }

    /// Frees memory after the last episode.
    fn free_memory(&mut self) {
        (self.seed, self.policy) = (None, Policy::new());
    }
}
