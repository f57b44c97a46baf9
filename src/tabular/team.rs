//! A team in one tabular task: agents act at random times, and each transition updates the shared
//! belief immediately.
//!
//! The agent with the earliest time acts next, so that each agent knows everything that happened
//! before its action. A run is one sequence of actions, on one thread.

mod counts;
mod planning_mdp;

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rand::RngExt;

use self::counts::SharedCounts;
use super::Algorithm;
use super::belief::Belief;
use super::plan_cache::PlanCache;
use super::planner::{Optimism, Planner, Policy};
use super::scenario::TabularScenario;
use super::seed::AgentSeed;
use super::turn::{Turn, first_turns};
use seedbed_env::tabular::{Mdp, Model};
use seedbed_random::{Purpose, Stream, stream};

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
    /// Bonus of each state-action pair: `[pairs]`, or empty.
    bonuses: Vec<f64>,
    counts: SharedCounts,
    visits: Vec<StateVisits>,
    steps: u64,
}

/// One agent.
struct Agent {
    seed: Option<AgentSeed>,
    /// Random stream of the times between its actions.
    clock_stream: Stream,
    /// Random stream of the outcomes of its actions, and of its random actions.
    outcome_stream: Stream,
    policy_source: PolicySource,
    /// The policy to follow with [`PolicySource::Own`].
    policy: Policy,
    /// Version of the belief from which the policy was derived.
    belief_version: u64,
    /// First step of the episode that the policy covers.
    planned_from: u32,
    state: u32,
    /// Number of actions in this episode.
    step: u32,
    /// Number of actions in all episodes.
    actions: u32,
    episode: Episode,
    /// Whether the agent visited each state: `[states]`.
    visited: Vec<bool>,
}

/// Where the policy is that an agent follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PolicySource {
    /// The agent has no policy yet.
    None,
    /// The policy with this index in the plan cache.
    Cached(usize),
    /// The policy that the agent stores itself.
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
    pub ended_episode: Option<Episode>,
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
    /// Time of the last action, in the same unit.
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
pub struct StateVisits {
    /// Number of visits by the whole team.
    pub count: u64,
    /// Number of agents that visited the state at least once.
    pub agents: u32,
}

impl TabularTeam {
    /// A team before its first action, in the task that is drawn with the scenario's run seed.
    #[must_use]
    pub fn new(scenario: &TabularScenario) -> Self {
        let model = scenario.task.model(scenario.seed);
        let true_mdp = scenario.task.draw_mdp(&model, scenario.seed);
        let mut planner = Planner::new(&model);
        let agents: Vec<Agent> = (0..scenario.agents.count.get())
            .map(|agent| Agent::new(scenario, &model, agent))
            .collect();
        let agent_count = agents.len();
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
            bonuses: Vec::new(),
            counts: SharedCounts::new(agent_count, model.pair_count()),
            visits: vec![StateVisits::default(); model.state_count()],
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
            self.queue.push(Reverse(turn.next(&mut agent.clock_stream)));
            return Some(step);
        }
        self.counts.release(turn.agent);
        step.ended_episode = Some(Episode {
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
        let next = turn.next(&mut agent.clock_stream);
        self.count_visit(turn.agent);
        next
    }

    /// Counts a visit of the agent's state.
    fn count_visit(&mut self, agent: u32) {
        let agent = &mut self.agents[agent as usize];
        let visits = &mut self.visits[agent.state as usize];
        let is_first_visit = !std::mem::replace(&mut agent.visited[agent.state as usize], true);
        visits.count += 1;
        visits.agents += u32::from(is_first_visit);
    }

    /// Executes an action, given as a state-action pair, in the true MDP, and updates the belief.
    fn execute(&mut self, turn: Turn, pair: usize) -> Step {
        let agent = &mut self.agents[turn.agent as usize];
        let outcome_index =
            self.model
                .sample_outcome(&self.true_mdp, pair, &mut agent.outcome_stream);
        let observation =
            self.model
                .observe(&self.true_mdp, outcome_index, &mut agent.outcome_stream);
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
        self.counts.count(pair);
        let action = (pair - self.model.pairs(from).start) as u32;
        Step {
            agent: turn.agent,
            episode,
            from,
            action,
            reward,
            to,
            ended_episode: None,
        }
    }

    /// Chooses the next action of an agent, and returns the state-action pair.
    fn choose_pair(&mut self, agent: u32) -> usize {
        let pairs = self.model.pairs(self.agents[agent as usize].state);
        let epsilon = match self.scenario.algorithm {
            Algorithm::Random => 1.0,
            Algorithm::EpsilonGreedy { epsilon } => epsilon.get(),
            _ => 0.0,
        };
        let random = &mut self.agents[agent as usize].outcome_stream;
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
        let policy = match agent.policy_source {
            PolicySource::Cached(index) => self.plan_cache.policies[index]
                .as_ref()
                .expect("the agent's policy is in the cache"),
            PolicySource::Own | PolicySource::None => &agent.policy,
        };
        self.planner.action(policy, agent.step, agent.state)
    }

    /// Whether the agent can follow its policy without planning again.
    fn is_up_to_date(&self, agent: &Agent) -> bool {
        let has_plan =
            agent.policy_source != PolicySource::None && agent.planned_from <= agent.step;
        match self.scenario.algorithm {
            Algorithm::ThompsonResampling | Algorithm::CountBonus { .. } => false,
            Algorithm::SampleOnce => has_plan && agent.step > 0,
            _ => has_plan && agent.belief_version == self.belief.version(),
        }
    }

    /// Plans the remaining steps of an agent's episode.
    fn plan(&mut self, agent_index: u32) {
        self.derive_mdp(agent_index);
        self.derive_bonuses(agent_index);
        let cached = self.plan_cache.index(&self.mdp);
        let cached = cached.filter(|_| self.bonuses.is_empty());
        let agent = &mut self.agents[agent_index as usize];
        (agent.belief_version, agent.planned_from) = (self.belief.version(), agent.step);
        if let Some(index) = cached {
            agent.policy_source = PolicySource::Cached(index);
            let entry = &mut self.plan_cache.policies[index];
            if entry.is_none() {
                let policy = entry.insert(self.planner.empty_policy());
                self.planner
                    .plan(&self.model, &self.mdp, Optimism::default(), 0, policy);
            }
            return;
        }
        agent.policy_source = PolicySource::Own;
        agent.policy.resize(self.planner.policy_length(), 0);
        self.planner.plan(
            &self.model,
            &self.mdp,
            Optimism {
                outcomes: &self.optimism,
                bonuses: &self.bonuses,
            },
            agent.step,
            &mut agent.policy,
        );
        self.reserve(agent_index);
    }

    /// Sets `self.bonuses` for an agent, whose own reservation ends.
    fn derive_bonuses(&mut self, agent_index: u32) {
        if let Algorithm::CountBonus { weight, .. } = self.scenario.algorithm {
            self.counts.release(agent_index);
            self.counts.bonuses(weight.get(), &mut self.bonuses);
        }
    }

    /// Reserves what an agent expects to choose after its next action, if agents do so.
    fn reserve(&mut self, agent_index: u32) {
        let Algorithm::CountBonus { reservation, .. } = self.scenario.algorithm else {
            return;
        };
        if reservation {
            let agent = &self.agents[agent_index as usize];
            let now = (agent.step, agent.state);
            let choices = self
                .planner
                .expected_choices(&self.model, &self.mdp, &agent.policy, now);
            self.counts.reserve(agent_index, choices);
        }
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
    pub fn visits(&self) -> &[StateVisits] {
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
        let agent_stream = |purpose| stream(scenario.seed, purpose, agent, 0);
        let seed = match scenario.algorithm {
            Algorithm::SeedSampling { .. } => Some(AgentSeed::new(model, scenario.seed, agent)),
            Algorithm::SharedSeed { .. } => Some(AgentSeed::new(model, scenario.seed, 0)),
            _ => None,
        };
        Self {
            seed,
            clock_stream: agent_stream(Purpose::TabularClock),
            outcome_stream: agent_stream(Purpose::TabularOutcomes),
            policy_source: PolicySource::None,
            policy: Policy::new(),
            belief_version: 0,
            planned_from: 0,
            state: model.start,
            step: 0,
            actions: 0,
            episode: Episode::default(),
            visited: vec![false; model.state_count()],
        }
    }

    /// Moves to a state, and receives a reward whose mean is `mean_reward`.
    fn enter(&mut self, to: u32, reward: f64, mean_reward: f64) {
        self.episode.r#return += reward;
        self.episode.regret -= mean_reward;
        self.episode.length += 1;
        self.state = to;
        self.step += 1;
        self.actions += 1;
    }

    /// Frees the memory that is not needed after the last episode.
    fn free_memory(&mut self) {
        (self.seed, self.policy) = (None, Policy::new());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn team(algorithm: &str) -> TabularTeam {
        let text = format!(
            "TabularScenario(task: DeepSea(size: 5), agents: (count: 2), episodes: 2, algorithm: {algorithm})"
        );
        let scenario = seedbed_input::parse("test", text).unwrap_or_else(|error| panic!("{error}"));
        TabularTeam::new(&scenario.value)
    }

    /// Sum of n over all pairs, from bonuses 1/√(1 + n).
    fn counted(team: &TabularTeam) -> f64 {
        let mut bonuses = Vec::new();
        team.counts.bonuses(1.0, &mut bonuses);
        bonuses.iter().map(|bonus| bonus.powi(-2) - 1.0).sum()
    }

    /// Episodes have five steps: after its first action an agent has reserved four choices, whatever
    /// directions it expects. After the last episode nothing is reserved.
    #[test]
    fn agents_reserve_the_rest_of_their_episodes() {
        for (algorithm, expected) in [
            ("CountBonus(reservation: true)", 5.0),
            ("CountBonus()", 1.0),
            ("SeedSampling()", 1.0),
        ] {
            let mut team = team(algorithm);
            team.advance();
            assert!((counted(&team) - expected).abs() < 1e-9, "{algorithm}");
            while team.advance().is_some() {}
            assert_eq!(team.steps(), 2 * 2 * 5);
            assert!((counted(&team) - 20.0).abs() < 1e-9, "{algorithm}");
        }
    }
}
