//! Teams of which all agents share one policy network and one value network, with a one-hot code of the agent
//! as further inputs.
//!
//! An agent's networks are the shared ones for its code. At the beginning of an epoch each agent collects
//! samples with them, as if they were its own; then the shared networks learn from the samples of all agents
//! together. Processes that divide a run repeat this learning, with the same bits.

use std::ops::Range;

use super::config::{Minibatch, SeedPg};
use super::totals::Totals;
use super::{Begun, SeedPgAgent};
use crate::agent::bonus::{Bonus, BonusModel, SHARED_OWNER};
use crate::agent::network::Network;
use crate::agent::policy::Policy;
use crate::agent::{ActScratch, Agent, AgentContext, Update, UpdateReport};
use crate::cancellation::cancellation_point;
use crate::experience::{Episode, Experience};
use crate::nn::{CodedNetwork, Tensor};
use crate::team::{
    ActionRequest, AgentUpdate, HasBonusModel, LearningRequest, SavedTeam, Team, TeamContext,
    Workers, act_one_by_one, copy_shared_bonus_model, tensors_of_agents,
};
use seedbed_random::Stream;

/// Agents that share their networks.
pub(super) struct SharedNetworks {
    /// All agents, whose networks are copies of the shared ones for their codes: `[K]`.
    agents: Vec<SeedPgAgent>,
    /// Numbers of the agents that act in this process.
    local: Range<usize>,
    /// The shared networks, and how they learn.
    learner: SeedPgAgent,
    policy: CodedNetwork,
    value: CodedNetwork,
}

impl SharedNetworks {
    /// A team that has not learned yet. The networks are those of agent 0, with the first-layer biases that
    /// each agent would have if its networks were its own.
    pub(super) fn new(
        context: &TeamContext<'_>,
        build: impl Fn(&AgentContext<'_>) -> SeedPgAgent,
    ) -> Self {
        let agents: Vec<SeedPgAgent> = (0..context.config.count.get())
            .map(|agent| {
                cancellation_point();
                build(&context.agent_context(agent))
            })
            .collect();
        let coded = |network: &Network| CodedNetwork::new(network.mlp().clone(), agents.len());
        let local = context.local_agents();
        let mut team = Self {
            policy: coded(agents[0].policy.network()),
            value: coded(&agents[0].value),
            local: local.start as usize..local.end as usize,
            learner: SeedPgAgent::new(&agents[0].config.without_bonus(), &context.agent_context(0)),
            agents,
        };
        team.join_networks(context);
        team
    }

    /// Joins the initial networks of the agents, and begins with the joined ones.
    fn join_networks(&mut self, context: &TeamContext<'_>) {
        let config = &self.learner.config;
        let parameters = |network: fn(&SeedPgAgent) -> &Network| -> Vec<&[f32]> {
            let agents = self.agents.iter();
            agents.map(|agent| network(agent).parameters()).collect()
        };
        let policy = self
            .policy
            .join(&parameters(|agent| agent.policy.network()));
        let value = self.value.join(&parameters(|agent| &agent.value));
        for (agent, code) in self.agents.iter_mut().zip(0..) {
            let select = |network: &CodedNetwork, joined: &[f32], optimizer| {
                let mut own = vec![0.0; network.plain().parameter_count()];
                network.select(joined, code, &mut own);
                Network::new(network.plain().clone(), own, optimizer)
            };
            *agent.policy.network_mut() = select(&self.policy, &policy, config.policy_optimizer);
            agent.value = select(&self.value, &value, config.value_optimizer);
        }
        let policy = Network::new(self.policy.mlp(), policy, config.policy_optimizer);
        let deviation = config.initial_deviation.get_f32();
        self.learner.policy = Policy::new(context.spec, policy, *config.actions, deviation);
        self.learner.value = Network::new(self.value.mlp(), value, config.value_optimizer);
    }

    /// Sets the networks of all agents to the shared ones.
    fn copy_networks(&mut self, workers: Workers<'_>) {
        let (learner, policy, value) = (&self.learner, &self.policy, &self.value);
        workers.for_each(&mut self.agents, |agent| {
            let code = agent.agent as usize;
            let own = agent.policy.network_mut().parameters_mut();
            policy.select(learner.policy.network().parameters(), code, own);
            value.select(
                learner.value.parameters(),
                code,
                agent.value.parameters_mut(),
            );
            agent.normalizer = learner.normalizer;
        });
    }

    /// One pass over the episodes that the agents have chosen.
    fn learn_for_an_epoch(
        &mut self,
        experience: &Experience<'_>,
        random: &mut Stream,
        totals: &mut Totals,
        workers: Workers<'_>,
    ) {
        let Minibatch::Steps(size) = self.learner.config.minibatch else {
            unreachable!("scenarios with shared networks and whole trajectories are refused")
        };
        workers.for_each(&mut self.agents, |agent| {
            agent.collect_samples(experience.new_episodes);
        });
        let work = &mut self.learner.work;
        work.all_policy_samples.clear();
        work.all_value_samples.clear();
        for agent in &mut self.agents {
            let code = agent.agent as usize;
            let entropy_weight = agent.config.entropy_bonus.get_f32();
            let own = &mut agent.work;
            own.all_policy_samples.fill_empty_columns(entropy_weight);
            own.all_value_samples.fill_empty_columns(entropy_weight);
            work.all_policy_samples
                .append_coded(&own.all_policy_samples, &self.policy, code);
            work.all_value_samples
                .append_coded(&own.all_value_samples, &self.value, code);
        }
        let descent = self.learner.descent(experience.earlier_updates);
        let size = size.get() as usize;
        self.learner
            .learn_from_samples(size, &descent, random, totals);
        self.copy_networks(workers);
    }

    /// The local agents.
    fn local_agents(&self) -> impl Iterator<Item = &SeedPgAgent> {
        self.agents[self.local.clone()].iter()
    }
}

impl SeedPg {
    fn without_bonus(&self) -> Self {
        Self {
            bonus: Bonus::None.into(),
            ..self.clone()
        }
    }
}

impl HasBonusModel for SeedPgAgent {
    fn bonus_model(&self) -> Option<&BonusModel> {
        self.bonus_model.as_ref()
    }

    fn bonus_model_mut(&mut self) -> Option<&mut BonusModel> {
        self.bonus_model.as_mut()
    }
}

/// The update of one agent: what is its own, and what was learned together, whose gradient steps count for
/// agent 0.
fn agent_update(agent: &SeedPgAgent, begun: Begun, together: &UpdateReport) -> AgentUpdate {
    let own = begun.totals.report();
    let is_first = agent.agent == 0;
    AgentUpdate {
        agent: agent.agent,
        update: Update {
            report: UpdateReport {
                intrinsic_reward: own.intrinsic_reward,
                prediction_error: own.prediction_error,
                gradient_steps: together
                    .gradient_steps
                    .map(|steps| if is_first { steps } else { 0 }),
                ..*together
            },
            step_data: begun.step_data,
        },
        is_finite: agent.is_finite(),
    }
}

impl Team for SharedNetworks {
    fn agent_count(&self) -> usize {
        self.agents.len()
    }

    fn act(&self, request: &mut ActionRequest<'_>, scratch: &mut ActScratch) {
        act_one_by_one(self.agents[request.first_agent..].iter(), request, scratch);
    }

    fn learn(&mut self, request: &LearningRequest<'_>, workers: Workers<'_>) -> Vec<AgentUpdate> {
        let Some(first) = request.learners.first() else {
            return Vec::new();
        };
        let experience = first.experience(request);
        let agents: Vec<&mut SeedPgAgent> = self.agents.iter_mut().collect();
        let mut begun = workers.map(agents, |agent| agent.begin_update(&experience));
        if copy_shared_bonus_model(&mut self.agents, workers) {
            let error = begun[0].totals.prediction_error;
            for begun in &mut begun {
                begun.totals.prediction_error = error;
            }
        }
        let mut totals = Totals::default();
        for _ in 0..self.learner.config.epochs.get() {
            self.learn_for_an_epoch(&experience, &mut begun[0].random, &mut totals, workers);
        }
        workers.for_each(&mut self.agents, |agent| {
            for episode in experience.new_episodes {
                agent.scaling.update(episode.states());
            }
        });
        let together = totals.report();
        let updates = self.agents.iter().zip(begun);
        updates
            .filter(|(agent, _)| self.local.contains(&(agent.agent as usize)))
            .map(|(agent, begun)| agent_update(agent, begun, &together))
            .collect()
    }

    fn probe_bonuses(&mut self, episode: &Episode, round: u32) -> Vec<Vec<f32>> {
        self.agents[self.local.clone()]
            .iter_mut()
            .map(|agent| agent.probe_bonuses(episode, round))
            .collect()
    }

    /// Those of each agent's copies of the networks, which have no code.
    fn tensors(&self) -> Vec<Tensor<'_>> {
        let mut tensors = tensors_of_agents(self.local_agents(), self.local.start, Agent::tensors);
        if self.local.start == 0 {
            let shared = self.agents[0].shared_tensors().into_iter();
            tensors.extend(shared.map(|tensor| tensor.prefixed(SHARED_OWNER)));
        }
        tensors
    }

    fn initial_tensors(&self) -> Vec<Tensor<'_>> {
        tensors_of_agents(
            self.local_agents(),
            self.local.start,
            Agent::initial_tensors,
        )
    }

    fn save(&self) -> SavedTeam {
        SavedTeam {
            parts: self.local_agents().map(Agent::save).collect(),
            shared: self.learner.save(),
        }
    }

    fn restore(&mut self, saved: &SavedTeam) -> Result<(), String> {
        if saved.parts.len() != self.agents.len() {
            return Err(format!(
                "the checkpoint has {} agents; expected {}",
                saved.parts.len(),
                self.agents.len()
            ));
        }
        self.learner.restore(&saved.shared)?;
        let mut agents = self.agents.iter_mut().zip(&saved.parts);
        agents.try_for_each(|(agent, bytes)| agent.restore(bytes))
    }
}
