//! A team at work in one finite task: agents act at times of their own, and each transition reaches
//! the belief of all at once.
//!
//! The next action is always that of the agent whose time comes first, so that each sees all that
//! happened before. A run is one sequence of actions and needs one thread; many runs need as many.

mod imagination;

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rand::RngExt;

use super::Algorithm;
use super::belief::Belief;
use super::plan::{Planner, Policy};
use super::scenario::TabularScenario;
use super::seed::Seed;
use super::shelf::Shelf;
use super::turn::{Turn, first_turns};
use seedbed_env::random::{Purpose, Stream, stream};
use seedbed_env::tabular::{Mdp, Model};

/// A team in one drawn task.
pub struct TabularTeam {
    scenario: TabularScenario,
    model: Model,
    truth: Mdp,
    optimal_value: f64,
    belief: Belief,
    planner: Planner,
    agents: Vec<Agent>,
    queue: BinaryHeap<Reverse<Turn>>,
    shelf: Shelf,
    /// What the agent at work takes for the truth.
    imagined: Mdp,
    /// Of outcomes, where the algorithm is optimistic.
    optimism: Vec<f64>,
    visits: Vec<Visits>,
    steps: u64,
}

/// One agent.
struct Agent {
    seed: Option<Seed>,
    /// Where its time between actions, and what becomes of these, are drawn from.
    clock: Stream,
    outcomes: Stream,
    plan: Plan,
    /// Room for a policy of its own.
    policy: Policy,
    /// The belief that the plan was made of.
    version: u64,
    /// The step from which on it was made.
    planned_from: u32,
    state: u32,
    step: u32,
    /// Actions in all episodes.
    actions: u32,
    episode: Episode,
    been: Vec<bool>,
}

/// What an agent follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Plan {
    /// Nothing yet.
    None,
    /// A plan on the shelf.
    Shared(usize),
    /// Its own policy.
    Own,
}

/// One action of one agent, and what came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Who acted.
    pub agent: u32,
    /// Which of the agent's episodes.
    pub episode: u32,
    /// The state before.
    pub from: u32,
    /// Which action of that state.
    pub action: u32,
    /// What it earned.
    pub reward: f64,
    /// The state after.
    pub to: u32,
    /// The episode, if it ended with that.
    pub ended: Option<Episode>,
}

/// An episode of one agent.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Episode {
    /// Who acted.
    pub agent: u32,
    /// The agent's own count, from 0.
    pub episode: u32,
    /// When the agent began; between two of its actions passes 1 on average.
    pub begun: f64,
    /// When it made its last step.
    pub ended: f64,
    /// Steps.
    pub length: u32,
    /// Sum of rewards.
    pub r#return: f64,
    /// What the best policy earns on average, less the mean rewards of what was done.
    pub regret: f64,
}

/// How often a state was visited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Visits {
    /// By the whole team.
    pub visits: u64,
    /// Agents that were there at least once.
    pub agents: u32,
}

impl TabularTeam {
    /// A team at its seeds, in the task that the scenario's seed draws.
    #[must_use]
    pub fn new(scenario: &TabularScenario) -> Self {
        let model = scenario.task.model(scenario.seed);
        let truth = scenario.task.draw(&model, scenario.seed);
        let mut planner = Planner::new(&model);
        let agents: Vec<Agent> = (0..scenario.agents.count.get())
            .map(|agent| Agent::new(scenario, &model, agent))
            .collect();
        let mut team = Self {
            optimal_value: planner.optimal_value(&model, &truth),
            belief: Belief::new(&model),
            queue: BinaryHeap::new(),
            agents,
            shelf: Shelf::new(&model),
            imagined: Mdp {
                values: vec![0.0; model.parameters.len()],
                probabilities: vec![1.0; model.outcomes().len()],
            },
            optimism: Vec::new(),
            visits: vec![Visits::default(); model.states()],
            steps: 0,
            scenario: scenario.clone(),
            model,
            truth,
            planner,
        };
        team.queue = first_turns(scenario)
            .into_iter()
            .map(|turn| Reverse(team.begin(turn, 0)))
            .collect();
        team
    }

    /// The next action, of whoever's turn it is. `None` when all have finished.
    pub fn advance(&mut self) -> Option<Step> {
        let Reverse(turn) = self.queue.pop()?;
        let pair = self.choose(turn.agent);
        let mut step = self.act(turn, pair);
        let agent = &mut self.agents[turn.agent as usize];
        let over = agent.step >= self.model.horizon || self.model.pairs(agent.state).is_empty();
        if !over {
            self.queue.push(Reverse(turn.next(&mut agent.clock)));
            return Some(step);
        }
        step.ended = Some(Episode {
            ended: turn.time,
            ..agent.episode
        });
        if step.episode + 1 < self.scenario.episodes.get() {
            let begun = self.begin(turn, step.episode + 1);
            self.queue.push(Reverse(begun));
        } else {
            agent.retire();
        }
        Some(step)
    }

    /// Starts an episode at the time of `turn`; the turn of its first action.
    fn begin(&mut self, turn: Turn, episode: u32) -> Turn {
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
        self.visit(turn.agent);
        next
    }

    fn visit(&mut self, agent: u32) {
        let agent = &mut self.agents[agent as usize];
        let visits = &mut self.visits[agent.state as usize];
        let first = !std::mem::replace(&mut agent.been[agent.state as usize], true);
        visits.visits += 1;
        visits.agents += u32::from(first);
    }

    /// Does what a pair does in the truth, and lets all know.
    fn act(&mut self, turn: Turn, pair: usize) -> Step {
        let agent = &mut self.agents[turn.agent as usize];
        let outcome = self.model.sample(&self.truth, pair, &mut agent.outcomes);
        let seen = self
            .model
            .observe(&self.truth, outcome, &mut agent.outcomes);
        let (from, to) = (agent.state, self.model.outcomes()[outcome].state);
        let reward = self.model.reward(outcome, seen);
        agent.take(
            to,
            reward,
            self.model.mean_reward(outcome, &self.truth.values),
        );
        let episode = agent.episode.episode;
        self.steps += 1;
        self.belief.take_in(&self.model, pair, outcome, seen);
        self.visit(turn.agent);
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

    /// What an agent does now: a pair of its state.
    fn choose(&mut self, agent: u32) -> usize {
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

    fn planned_action(&mut self, number: u32) -> usize {
        if !self.is_up_to_date(&self.agents[number as usize]) {
            self.make_plan(number);
        }
        let agent = &self.agents[number as usize];
        let policy = match agent.plan {
            Plan::Shared(slot) => self.shelf.plans[slot]
                .as_ref()
                .expect("a plan on the shelf was made"),
            Plan::Own | Plan::None => &agent.policy,
        };
        self.planner.action(policy, agent.step, agent.state)
    }

    /// Whether nothing has happened that would change an agent's plan.
    fn is_up_to_date(&self, agent: &Agent) -> bool {
        let planned = agent.plan != Plan::None && agent.planned_from <= agent.step;
        match self.scenario.algorithm {
            Algorithm::ThompsonResampling => false,
            Algorithm::SampleOnce => planned && agent.step > 0,
            _ => planned && agent.version == self.belief.version(),
        }
    }

    fn make_plan(&mut self, number: u32) {
        self.imagine(number);
        let slot = self.shelf.slot(&self.imagined);
        let agent = &mut self.agents[number as usize];
        (agent.version, agent.planned_from) = (self.belief.version(), agent.step);
        if let Some(slot) = slot {
            agent.plan = Plan::Shared(slot);
            let plan = &mut self.shelf.plans[slot];
            if plan.is_none() {
                let policy = plan.insert(self.planner.empty_policy());
                self.planner
                    .plan(&self.model, &self.imagined, &[], 0, policy);
            }
            return;
        }
        agent.plan = Plan::Own;
        agent.policy.resize(self.planner.policy_length(), 0);
        self.planner.plan(
            &self.model,
            &self.imagined,
            &self.optimism,
            agent.step,
            &mut agent.policy,
        );
    }

    /// What the best policy earns in an episode on average.
    #[must_use]
    pub fn optimal_value(&self) -> f64 {
        self.optimal_value
    }

    /// The task's tables.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Who was where how often: `[states]`.
    #[must_use]
    pub fn visits(&self) -> &[Visits] {
        &self.visits
    }

    /// States in which any agent was.
    #[must_use]
    pub fn states_visited(&self) -> usize {
        self.visits
            .iter()
            .filter(|visits| visits.agents > 0)
            .count()
    }

    /// Actions of the whole team.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }
}

impl Agent {
    fn new(scenario: &TabularScenario, model: &Model, agent: u32) -> Self {
        let named = |purpose| stream(scenario.seed, purpose, agent, 0);
        let seed = match scenario.algorithm {
            Algorithm::SeedSampling { .. } => Some(Seed::new(model, scenario.seed, agent)),
            Algorithm::SharedSeed { .. } => Some(Seed::new(model, scenario.seed, 0)),
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
            been: vec![false; model.states()],
        }
    }

    /// Goes on to a state, having earned `reward`, whose mean is `mean`.
    fn take(&mut self, to: u32, reward: f64, mean: f64) {
        self.episode.r#return += reward;
        self.episode.regret -= mean;
        self.episode.length += 1;
        self.state = to;
        self.step += 1;
        self.actions += 1;
    }

    /// Gives back what it will not need.
    fn retire(&mut self) {
        (self.seed, self.policy) = (None, Policy::new());
    }
}
