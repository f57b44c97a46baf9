//! The cross-entropy method over policies: a baseline without gradients.
//!
//! The team searches the parameters of one policy. In every round agent k plays with parameters
//! θ_k ~ 𝒩(μ, σ²) of its own, and μ and σ move to the mean and the standard deviation of the elite,
//! the agents with the highest mean returns (Rubinstein 1999; for policies Mannor, Rubinstein &
//! Gat 2003). Noise that decreases from round to round keeps σ from collapsing too early
//! (Szita & Lőrincz 2006). Agents share only their returns.

use rand_distr::{Distribution, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::AlgorithmConfig;
use crate::agent::action_selection::ActionSelection;
use crate::agent::network::Network;
use crate::agent::network_info::{ModelInfo, NetworkInfo, OutputTerm, ScalingInfo, setting_text};
use crate::agent::policy::{self, Policy};
use crate::agent::{ActScratch, UpdateReport};
use crate::experience::Episode;
use crate::nn::{Activation, AdamSettings, Mlp, Tensor, network_tensors};
use crate::scaling::{ObservationScaling, Scaling};
use crate::team::{
    ActionRequest, AgentUpdate, LearningRequest, SavedTeam, Team, TeamContext, Workers,
};
use seedbed_env::TaskSpec;
use seedbed_input::limits::short_list;
use seedbed_input::numbers::{
    Count, NonNegative, Positive, PositiveFraction, ranged_count, ranged_number, share_of_count,
};
use seedbed_random::{Purpose, stream};

/// The cross-entropy method over policies: each agent plays with parameters drawn from one
/// Gaussian, which is then fitted to the agents with the highest returns. No gradients.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CrossEntropy {
    /// Share of the agents that the Gaussian is fitted to: those with the highest returns.
    pub elite: PositiveFraction,
    /// Initial standard deviation σ of each parameter.
    pub initial_deviation: Positive,
    /// Standard deviation that is added to σ in the first round, and decreases linearly to 0.
    pub extra_deviation: NonNegative,
    /// Number of rounds until the added standard deviation is 0.
    pub extra_rounds: Count,
    /// Number of units of each hidden layer of the policy; an empty list makes a linear policy.
    #[serde(deserialize_with = "short_list")]
    pub hidden: Vec<Count<4096>>,
    /// How observations are scaled for the policy.
    pub observations: ObservationScaling,
    /// How actions are chosen from the policy's distribution.
    pub actions: ActionSelection,
}

impl Default for CrossEntropy {
    fn default() -> Self {
        Self {
            elite: ranged_number(0.25),
            initial_deviation: ranged_number(1.0),
            extra_deviation: ranged_number(0.5),
            extra_rounds: ranged_count(20),
            hidden: Vec::new(),
            observations: ObservationScaling::Range,
            actions: ActionSelection::Greedy,
        }
    }
}

/// Standard deviation of continuous actions if the policy's second output is 0, as a share of half
/// their range.
const RELATIVE_DEVIATION: f32 = 0.5;

impl AlgorithmConfig for CrossEntropy {
    fn build(&self, context: &TeamContext<'_>) -> Box<dyn Team> {
        Box::new(CrossEntropyTeam::new(self, context))
    }

    fn set_action_selection(&mut self, selection: ActionSelection) {
        self.actions = selection;
    }

    fn network_info(&self, task: &TaskSpec, _: usize) -> Option<NetworkInfo> {
        Some(NetworkInfo {
            models: Some(ModelInfo {
                count: 1,
                model_of_agent: "0: agents act with parameters drawn around those of model_0.policy, \
                                 with the standard deviations in model_0.deviation",
            }),
            outputs: vec![OutputTerm {
                network: "model_{model}.policy",
                factor: 1.0,
                skip_connection: false,
            }],
            activation: Activation::Tanh,
            heads: policy::heads(task, RELATIVE_DEVIATION),
            action_selection: setting_text(&self.actions),
            observation_scaling: ScalingInfo::new(self.observations, ""),
            value: None,
            bonus: None,
        })
    }

    fn memory(&self, task: &TaskSpec, agents: u32, _steps: u64) -> u64 {
        let hidden: Vec<usize> = self
            .hidden
            .iter()
            .map(|units| units.get() as usize)
            .collect();
        let network = Network::memory(&policy::network_shape(task, &hidden));
        u64::from(agents).saturating_mul(network)
    }

    fn cost_per_step(&self, _: u32) -> f64 {
        0.0
    }
}

/// A team whose agents search together for the parameters of one policy.
struct CrossEntropyTeam {
    config: CrossEntropy,
    run_seed: u64,
    spec: TaskSpec,
    network: Mlp,
    scaling: Scaling,
    /// Mean μ of each parameter: `[P]`.
    mean: Vec<f32>,
    /// Standard deviation σ of each parameter: `[P]`.
    deviation: Vec<f32>,
    /// Parameters of each agent in this round, local or not: `[K][P]`.
    population: Vec<Vec<f32>>,
    has_agent_0: bool,
    policies: Vec<Policy>,
}

/// What a checkpoint holds of a team. The rest derives from the scenario.
#[derive(Serialize, Deserialize)]
struct Saved {
    mean: Vec<f32>,
    deviation: Vec<f32>,
    observations: Option<crate::nn::Standardizer>,
}

impl CrossEntropyTeam {
    fn new(config: &CrossEntropy, context: &TeamContext<'_>) -> Self {
        let hidden: Vec<usize> = config
            .hidden
            .iter()
            .map(|units| units.get() as usize)
            .collect();
        let network = policy::network_shape(context.spec, &hidden);
        let parameters = network.parameter_count();
        Self {
            run_seed: context.run_seed,
            spec: context.spec.clone(),
            scaling: Scaling::new(config.observations, context.spec),
            mean: vec![0.0; parameters],
            deviation: vec![config.initial_deviation.get_f32(); parameters],
            population: vec![Vec::new(); context.config.count.get() as usize],
            has_agent_0: context.local_agents().start == 0,
            policies: Vec::new(),
            config: config.clone(),
            network,
        }
    }

    /// The standard deviation that is added to σ in a round.
    fn extra_deviation(&self, round: u32) -> f32 {
        let rounds = self.config.extra_rounds.get() as f32;
        let remaining_share = (1.0 - round as f32 / rounds).max(0.0);
        self.config.extra_deviation.get_f32() * remaining_share
    }

    /// Draws θ_k ~ 𝒩(μ, (σ + extra deviation)²) for each agent k, from the agent's own stream.
    fn draw_population(&mut self, round: u32) {
        let extra = self.extra_deviation(round);
        for (agent, parameters) in self.population.iter_mut().enumerate() {
            // Other algorithms draw their initial networks from round 0 of this purpose.
            let round = round.wrapping_add(1);
            let purpose = Purpose::InitialParameters;
            let mut random = stream(self.run_seed, purpose, agent as u32, round);
            parameters.clear();
            for (mean, deviation) in self.mean.iter().zip(&self.deviation) {
                let noise: f32 = StandardNormal.sample(&mut random);
                parameters.push(mean + (deviation + extra) * noise);
            }
        }
    }

    /// Builds the policy of each agent from its parameters.
    fn build_policies(&mut self) {
        self.policies.clear();
        for parameters in &self.population {
            let adam = AdamSettings::default();
            let network = Network::new(self.network.clone(), parameters.clone(), adam);
            let policy = Policy::new(&self.spec, network, self.config.actions, RELATIVE_DEVIATION);
            self.policies.push(policy);
        }
    }

    /// The agents with the highest mean returns; of agents with equal returns, the one with the
    /// lower number comes first.
    fn elite(&self, episodes: &[Episode]) -> Vec<usize> {
        let mut returns = vec![(0.0, 0); self.population.len()];
        for episode in episodes {
            let (sum, count) = &mut returns[episode.agent as usize];
            *sum += episode.total_reward();
            *count += 1;
        }
        let mean = |agent: usize| returns[agent].0 / f64::from(returns[agent].1.max(1));
        let mut agents: Vec<usize> = (0..self.population.len()).collect();
        agents.sort_by(|&a, &b| mean(b).total_cmp(&mean(a)));
        let count = share_of_count(self.config.elite.get(), agents.len());
        agents.truncate(count.max(1));
        agents
    }

    /// Moves μ and σ to the mean and the standard deviation of the elite's parameters.
    fn fit(&mut self, elite: &[usize]) {
        let count = elite.len() as f32;
        for index in 0..self.mean.len() {
            let values = || elite.iter().map(|&agent| self.population[agent][index]);
            let mean = values().sum::<f32>() / count;
            let variance = values().map(|value| (value - mean).powi(2)).sum::<f32>() / count;
            self.mean[index] = mean;
            self.deviation[index] = variance.sqrt();
        }
    }
}

impl Team for CrossEntropyTeam {
    fn agent_count(&self) -> usize {
        self.population.len()
    }

    fn begin_round(&mut self, round: u32) {
        self.draw_population(round);
        self.build_policies();
    }

    fn act(&self, request: &mut ActionRequest<'_>, scratch: &mut ActScratch) {
        let observation_width = self.spec.observation_width();
        let action_width = self.spec.action_width();
        let mut scaled = std::mem::take(&mut scratch.state);
        let group = &self.policies[request.first_agent..][..request.playing.len()];
        for (agent, policy) in group.iter().enumerate() {
            if !request.playing[agent] {
                continue;
            }
            let observation = agent * observation_width..(agent + 1) * observation_width;
            let action = agent * action_width..(agent + 1) * action_width;
            self.scaling
                .apply(&request.observations[observation], &mut scaled);
            policy.sample(
                &scaled,
                &mut request.random[agent],
                scratch,
                &mut request.actions[action.clone()],
                &mut request.log_probs[action],
            );
        }
        scratch.state = scaled;
    }

    fn learn(&mut self, request: &LearningRequest<'_>, _: Workers<'_>) -> Vec<AgentUpdate> {
        let Some(first) = request.learners.first() else {
            return Vec::new();
        };
        let new_episodes = &request.episodes[first.first_new_episode..];
        let elite = self.elite(new_episodes);
        self.fit(&elite);
        for episode in new_episodes {
            self.scaling.update(episode.states());
        }
        let parameters_are_finite = self
            .mean
            .iter()
            .chain(&self.deviation)
            .all(|x| x.is_finite());
        let update = |agent| AgentUpdate {
            agent,
            update: UpdateReport::default().into(),
            is_finite: parameters_are_finite,
        };
        let learners = request.learners.iter();
        learners.map(|learner| update(learner.agent)).collect()
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let mut tensors = Vec::new();
        if !self.has_agent_0 {
            return tensors;
        }
        for (name, numbers) in [
            ("model_0.policy", &self.mean),
            ("model_0.deviation", &self.deviation),
        ] {
            tensors.extend(network_tensors(&self.network, numbers, name));
        }
        tensors.extend(self.scaling.tensors());
        tensors
    }

    fn save(&self) -> SavedTeam {
        let saved = Saved {
            mean: self.mean.clone(),
            deviation: self.deviation.clone(),
            observations: self.scaling.learned().cloned(),
        };
        SavedTeam {
            parts: Vec::new(),
            shared: postcard::to_stdvec(&saved).expect("plain data always serializes"),
        }
    }

    fn restore(&mut self, saved: &SavedTeam) -> Result<(), String> {
        let saved: Saved =
            postcard::from_bytes(&saved.shared).map_err(|error| error.to_string())?;
        let count = self.mean.len();
        if saved.mean.len() != count || saved.deviation.len() != count {
            return Err(format!(
                "the checkpoint has {} parameters of a policy; expected {count}",
                saved.mean.len()
            ));
        }
        self.scaling.restore(saved.observations)?;
        (self.mean, self.deviation) = (saved.mean, saved.deviation);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::TeamConfig;
    use crate::team::{Learner, LearningTiming};
    use seedbed_env::{Action, Quantity};

    fn spec() -> TaskSpec {
        let quantity = |name: &str| Quantity {
            name: name.to_owned(),
            unit: String::new(),
            range: [-1.0, 1.0],
        };
        let push = Action {
            quantity: quantity("push"),
            choice: seedbed_env::Choice::Discrete(vec![-1.0, 1.0]),
        };
        TaskSpec::new("line", vec![quantity("x")], vec![push])
    }

    fn team(agents: u32, config: &CrossEntropy) -> CrossEntropyTeam {
        let team = TeamConfig {
            count: ranged_count(agents),
            ..TeamConfig::default()
        };
        CrossEntropyTeam::new(
            config,
            &TeamContext {
                run_seed: 3,
                config: &team,
                local_agents: None,
                spec: &spec(),
                timing: LearningTiming::AfterEpisodes,
                record_advantages: false,
            },
        )
    }

    /// An episode of one step with the reward `reward`.
    fn episode(agent: usize, reward: f32) -> Episode {
        Episode {
            observations: vec![0.0; 2],
            rewards: vec![reward],
            ..Episode::start(agent as u32, 0, 0, &spec())
        }
    }

    fn learn(team: &mut CrossEntropyTeam, episodes: &[Episode], round: u32) {
        let learners: Vec<Learner> = (0..team.agent_count() as u32)
            .map(|agent| Learner {
                agent,
                first_new_episode: 0,
                earlier_updates: round,
            })
            .collect();
        let lengths: Vec<u32> = episodes
            .iter()
            .map(|episode| episode.length() as u32)
            .collect();
        let request = LearningRequest {
            episodes,
            lengths: &lengths,
            learners: &learners,
        };
        let updates = team.learn(&request, Workers::CURRENT_THREAD);
        assert!(updates.iter().all(|update| update.is_finite));
    }

    /// The elite are two of four agents. With parameters 1, 2, 3, 6 and returns 0, 5, 9, 1 they are
    /// the second and the third: μ = 2.5, σ = √(½ (0.5² + 0.5²)) = 0.5.
    #[test]
    fn the_gaussian_moves_to_the_elite() {
        let config = CrossEntropy {
            elite: ranged_number(0.5),
            ..CrossEntropy::default()
        };
        let mut team = team(4, &config);
        for (parameters, value) in team.population.iter_mut().zip([1.0, 2.0, 3.0, 6.0]) {
            *parameters = vec![value; team.mean.len()];
        }
        let returns = [0.0, 5.0, 9.0, 1.0];
        let episodes: Vec<Episode> = (0..4).map(|agent| episode(agent, returns[agent])).collect();
        learn(&mut team, &episodes, 0);
        assert!(team.mean.iter().all(|&mean| mean == 2.5), "{:?}", team.mean);
        assert!(team.deviation.iter().all(|&deviation| deviation == 0.5));
    }

    /// ⌈0.28 · 25⌉ = 7, ⌈0.29 · 25⌉ = ⌈7.25⌉ = 8; at least one agent.
    #[test]
    fn the_elite_is_a_share_of_the_agents() {
        for (elite, agents, expected) in [(0.28, 25, 7), (0.29, 25, 8), (0.01, 3, 1), (1.0, 25, 25)]
        {
            let config = CrossEntropy {
                elite: ranged_number(elite),
                ..CrossEntropy::default()
            };
            let episodes: Vec<Episode> = (0..agents).map(|agent| episode(agent, 0.0)).collect();
            let elite = team(agents as u32, &config).elite(&episodes);
            assert_eq!(elite.len(), expected);
        }
    }

    /// The added deviation decreases linearly: ½, ¼ after half of the rounds, 0 at the end.
    #[test]
    fn extra_deviation_decreases_to_zero() {
        let team = team(2, &CrossEntropy::default());
        let extra = [0, 10, 20, 99].map(|round| team.extra_deviation(round));
        assert_eq!(extra, [0.5, 0.25, 0.0, 0.0]);
    }

    /// The return is minus the squared distance from a point, so the mean must converge to it.
    #[test]
    fn the_mean_converges_to_the_best_parameters() {
        let mut team = team(40, &CrossEntropy::default());
        let distance = |parameters: &[f32]| {
            let squares = parameters.iter().map(|value| (value - 2.0).powi(2));
            squares.sum::<f32>()
        };
        for round in 0..60 {
            team.begin_round(round);
            let episodes: Vec<Episode> = team
                .population
                .iter()
                .enumerate()
                .map(|(agent, parameters)| episode(agent, -distance(parameters)))
                .collect();
            learn(&mut team, &episodes, round);
        }
        assert!(distance(&team.mean) < 0.01, "{:?}", team.mean);
    }

    #[test]
    fn parameters_differ_between_agents_and_rounds() {
        let mut team = team(3, &CrossEntropy::default());
        team.begin_round(0);
        let first = team.population.clone();
        assert_ne!(first[0], first[1]);
        team.begin_round(1);
        assert_ne!(first[0], team.population[0]);
        team.begin_round(0);
        assert_eq!(first, team.population);
    }
}
