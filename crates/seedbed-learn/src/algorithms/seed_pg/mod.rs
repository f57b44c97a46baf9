//! Seed-PG: K policies learn from shared experience, each with its own fixed seed (thesis §3.4).
//!
//! Each agent k has its own policy `π_k` and value function `v_k`. Steps of a trajectory of agent i
//! are weighted by ρₜ = `π_k(aₜ|sₜ)` / `π_i(aₜ|sₜ)`, and its rewards are perturbed by the seeds of
//! agent k: rₜ₊₁ + `z_{k,t+1}`, where t is the step within the episode.
//!
//! [`config`] has the parameters. With own data and no seeds they also give REINFORCE, the simple
//! policy gradient (§1.5), Off-PAC (§3.3.1), and standard PPO. `learning` has the steps of an
//! update, `estimates` calls the formulas in [`rl`](crate::rl) that the parameters select.

pub(in crate::algorithms) mod common_settings;
pub mod config;
mod estimates;
mod learning;
mod samples;
mod shared_networks;
#[cfg(test)]
pub(super) mod tests;
mod totals;

use rand::seq::index;
use serde::{Deserialize, Serialize};

use self::config::{Data, Networks, ReturnNormalization, SeedPg, Sharing};
use self::estimates::Scratch;
use self::samples::Samples;
use self::shared_networks::SharedNetworks;
use self::totals::Totals;
use crate::agent::bonus::BonusModel;
use crate::agent::network::{Descent, LearnedState, Network};
use crate::agent::policy::{self, Policy};
use crate::agent::{ActScratch, ActionRandom, Agent, AgentContext, Update};
use crate::experience::{Episode, EpisodeInfo, Experience, StepData};
use crate::nn::{Mlp, PopArt, Standardizer, Tensor};
use crate::scaling::Scaling;
use crate::seed::{InitialParameters, RewardPerturbation};
use crate::team::{IndependentLearners, Team, TeamContext};
use seedbed_env::TaskSpec;
use seedbed_input::numbers::{NonNegative, Positive};
use seedbed_random::{Purpose, Stream, stream};

/// The team of these agents, with the networks that a scenario chooses.
pub(in crate::algorithms) fn build_team(
    networks: Networks,
    context: &TeamContext<'_>,
    build: impl Fn(&AgentContext<'_>) -> SeedPgAgent,
) -> Box<dyn Team> {
    match networks {
        Networks::Own => IndependentLearners::build(context, build),
        Networks::Shared => Box::new(SharedNetworks::new(context, build)),
    }
}

/// One agent of Seed-PG.
pub struct SeedPgAgent {
    config: SeedPg,
    run_seed: u64,
    agent: u32,
    /// What this agent adds to rewards.
    perturbation: RewardPerturbation,
    scaling: Scaling,
    policy: Policy,
    value: Network,
    normalizer: PopArt,
    bonus_model: Option<BonusModel>,
    /// Weight of the steps of others in the losses, whose ratios are then clipped around those before
    /// the update; `None`: all steps are treated alike.
    weight_of_others: Option<f32>,
    /// Whose actions the policy imitates.
    imitation: Option<Imitation>,
    /// Whether updates return [advantages](StepData::advantages).
    record_advantages: bool,
    work: Workspace,
}

/// An agent whose actions others imitate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Imitation {
    /// The agent.
    pub(super) agent: u32,
    /// Weight of −log π of each of its steps, beside the losses of own steps.
    pub(super) weight: f32,
}

/// Buffers that are reused from one trajectory to the next.
#[derive(Default)]
struct Workspace {
    /// Indices of the new episodes to learn from.
    chosen_episodes: Vec<usize>,
    /// Bonuses of the steps of each new episode; empty without a bonus.
    bonuses: Vec<Vec<f32>>,
    /// Importance ratios of the steps of each new episode before the update; empty for own episodes,
    /// and unless others have a [weight](SeedPgAgent::weight_of_others).
    earlier_ratios: Vec<Vec<f32>>,
    /// Samples of the next gradient step.
    samples: Samples,
    /// All samples of the policy, from which minibatches of steps are drawn.
    all_policy_samples: Samples,
    /// All samples of the value function.
    all_value_samples: Samples,
    /// Order in which the samples of one of these two are drawn.
    rows: Vec<usize>,
    /// log π of each component of the actions of `samples`: `[N × C]`.
    log_probs: Vec<f32>,
    /// Importance ratios of the actions of `samples`: `[N]`.
    ratios: Vec<f32>,
    /// Perturbed rewards: `[T]`.
    rewards: Vec<f32>,
    /// Values of the states of `samples`: `[N]`.
    values: Vec<f32>,
    estimates: Scratch,
    /// Scaled observation after the last step.
    last_state: Vec<f32>,
    /// ∂loss/∂log π of each component of the actions of `samples`: `[N × C]`.
    slopes: Vec<f32>,
    value_gradient: Vec<f32>,
}

/// An update whose networks have not learned yet.
struct Begun {
    /// What minibatches are drawn from.
    random: Stream,
    totals: Totals,
    step_data: Vec<StepData>,
}

/// What a checkpoint holds of an agent. The rest derives from the scenario.
#[derive(Serialize, Deserialize)]
struct Saved<L, S> {
    policy: L,
    value: L,
    normalizer: PopArt,
    observations: Option<S>,
    bonus_model: Option<Vec<u8>>,
}

impl SeedPgAgent {
    /// An agent that has not learned yet.
    #[must_use]
    pub fn new(config: &SeedPg, context: &AgentContext<'_>) -> Self {
        let spec = context.spec;
        let hidden: Vec<usize> = config
            .hidden
            .iter()
            .map(|units| units.get() as usize)
            .collect();
        let (policy, value) = initial_networks(config, context, &hidden);
        let initial_deviation = config.initial_deviation.get_f32();
        Self {
            run_seed: context.run_seed,
            agent: context.agent,
            perturbation: context.team.seeds.perturbation(
                (context.run_seed, context.agent),
                spec,
                &hidden,
            ),
            scaling: Scaling::new(config.observations, spec),
            policy: Policy::new(spec, policy, *config.actions, initial_deviation),
            value,
            normalizer: match config.returns {
                ReturnNormalization::PopArt { beta } => PopArt::new(beta.get()),
                ReturnNormalization::Raw => PopArt::identity(),
            },
            bonus_model: BonusModel::new(&config.bonus, context),
            weight_of_others: None,
            imitation: None,
            record_advantages: context.record_advantages,
            config: config.clone(),
            work: Workspace::default(),
        }
    }

    /// The agent whose losses weight the steps of others, and whose ratios of these steps are clipped
    /// around those before the update, as those of the leader in [SAPG](super::leader_followers).
    pub(super) fn with_weight_of_others(mut self, weight: f32) -> Self {
        self.weight_of_others = Some(weight);
        self
    }

    /// The agent whose policy also imitates the actions of another agent. Needs minibatches of steps.
    pub(super) fn with_imitation(mut self, imitation: Imitation) -> Self {
        self.imitation = Some(imitation);
        self
    }

    /// Whether the policy imitates the actions of this agent.
    fn imitates(&self, agent: u32) -> bool {
        self.imitation
            .is_some_and(|imitation| imitation.agent == agent)
    }

    /// Chooses the episodes to learn from, computes their bonuses, and lets the bonus model learn.
    fn begin_update(&mut self, experience: &Experience<'_>) -> Begun {
        let new_episodes = experience.new_episodes;
        let mut random = self.update_stream(experience.earlier_updates);
        let mut totals = Totals::default();
        let infos = new_episodes.iter().zip(experience.new_lengths);
        let infos = infos.map(|(episode, &length)| EpisodeInfo {
            length,
            ..EpisodeInfo::from(episode)
        });
        self.work.chosen_episodes = self.choose_episodes(infos, &mut random);
        if let Some(bonus_model) = &mut self.bonus_model {
            bonus_model.compute_bonuses(
                experience,
                &self.work.chosen_episodes,
                &mut self.work.bonuses,
            );
            totals.set_bonuses(
                self.agent,
                new_episodes,
                &self.work.bonuses,
                bonus_model.learn(experience),
            );
        }
        let step_data = self.own_step_data(new_episodes);
        if self.weight_of_others.is_some() {
            self.compute_earlier_ratios(new_episodes);
        }
        Begun {
            random,
            totals,
            step_data,
        }
    }

    /// Chooses the new episodes that this agent learns from: its own, those that others share with it, and
    /// those that it imitates.
    fn choose_episodes(
        &self,
        new_episodes: impl Iterator<Item = EpisodeInfo>,
        random: &mut Stream,
    ) -> Vec<usize> {
        let config = &self.config;
        let (mut chosen, mut others) = (Vec::new(), Vec::new());
        for (index, episode) in new_episodes.enumerate() {
            let is_needed = episode.agent == self.agent || self.imitates(episode.agent);
            if episode.length > 0 && is_needed {
                chosen.push(index);
            } else if episode.length > 0 {
                others.push(index);
            }
        }
        match config.sharing {
            _ if !self.learns_from_others() => {}
            Sharing::All => chosen.extend(others),
            Sharing::Sampled { trajectories } => {
                let count = others.len().min(trajectories.get() as usize);
                let sample = index::sample(random, others.len(), count);
                chosen.extend(sample.into_iter().map(|position| others[position]));
            }
        }
        chosen.sort_unstable();
        chosen
    }

    fn learns_from_others(&self) -> bool {
        self.config.value_data == Data::Shared || self.config.policy_data == Data::Shared
    }

    /// The stream from which an update draws episodes and minibatches.
    fn update_stream(&self, earlier_updates: u32) -> Stream {
        stream(self.run_seed, Purpose::Shuffle, self.agent, earlier_updates)
    }

    fn descent(&self, round: u32) -> Descent {
        Descent {
            regularization: self.config.regularization.get_f32(),
            gradient_clip: self.config.gradient_clip.map(Positive::get_f32),
            step_size_factor: self.config.step_size_schedule.factor(round),
        }
    }
}

/// Shape of the value function's network.
fn value_shape(spec: &TaskSpec, hidden: &[usize]) -> Mlp {
    let mut sizes = vec![spec.observation_width()];
    sizes.extend(hidden);
    sizes.push(1);
    Mlp::new(&sizes)
}

/// The policy network and the value network with the agent's initial parameters.
fn initial_networks(
    config: &SeedPg,
    context: &AgentContext<'_>,
    hidden: &[usize],
) -> (Network, Network) {
    let (spec, team) = (context.spec, context.team);
    let policy_shape = policy::network_shape(spec, hidden);
    let value_shape = value_shape(spec, hidden);
    let mut initial = InitialParameters::draw(
        (context.run_seed, context.agent),
        team.initial,
        *team.same_initial,
        (&policy_shape, &value_shape),
    );
    let [policy_scale, value_scale] =
        [config.policy_scale, config.value_scale].map(NonNegative::get_f32);
    scale_output_layer(&policy_shape, &mut initial.policy, policy_scale);
    scale_output_layer(&value_shape, &mut initial.value, value_scale);
    (
        Network::new(policy_shape, initial.policy, config.policy_optimizer),
        Network::new(value_shape, initial.value, config.value_optimizer),
    )
}

/// Multiplies the weights and biases of a network's output layer.
fn scale_output_layer(shape: &Mlp, parameters: &mut [f32], scale: f32) {
    let (weight, bias) = shape.output_layer(parameters);
    weight
        .iter_mut()
        .chain(bias)
        .for_each(|parameter| *parameter *= scale);
}

impl Agent for SeedPgAgent {
    fn act(
        &self,
        observation: &[f32],
        random: &mut ActionRandom,
        scratch: &mut ActScratch,
        action: &mut [f32],
        log_prob: &mut [f32],
    ) {
        let mut state = std::mem::take(&mut scratch.state);
        self.scaling.apply(observation, &mut state);
        self.policy
            .sample(&state, random, scratch, action, log_prob);
        scratch.state = state;
    }

    fn update(&mut self, experience: &Experience<'_>) -> Update {
        let &Experience {
            new_episodes,
            earlier_updates: round,
            ..
        } = experience;
        let descent = self.descent(round);
        let Begun {
            mut random,
            mut totals,
            step_data,
        } = self.begin_update(experience);
        for _ in 0..self.config.epochs.get() {
            self.learn_for_an_epoch(new_episodes, &descent, &mut random, &mut totals);
        }
        for &index in &self.work.chosen_episodes {
            self.scaling.update(new_episodes[index].states());
        }
        Update {
            report: totals.report(),
            step_data,
        }
    }

    fn probe_bonuses(&mut self, episode: &Episode, round: u32) -> Vec<f32> {
        self.bonus_model
            .as_mut()
            .map_or_else(Vec::new, |bonus_model| {
                bonus_model.probe_bonuses(episode, round)
            })
    }

    fn choose_episodes(
        &self,
        new_episodes: &[EpisodeInfo],
        earlier_updates: u32,
    ) -> Option<Vec<usize>> {
        let needs_all = self.bonus_model.as_ref();
        let needs_all = needs_all.is_some_and(BonusModel::needs_all_episodes);
        let shares_all = self.learns_from_others() && self.config.sharing == Sharing::All;
        (!needs_all && !shares_all).then(|| {
            let mut random = self.update_stream(earlier_updates);
            self.choose_episodes(new_episodes.iter().copied(), &mut random)
        })
    }

    fn shared_bonus_model(&self) -> Option<&BonusModel> {
        self.bonus_model.as_ref().filter(|model| model.is_shared())
    }

    fn shared_bonus_model_mut(&mut self) -> Option<&mut BonusModel> {
        self.bonus_model.as_mut().filter(|model| model.is_shared())
    }

    fn is_finite(&self) -> bool {
        let is_bonus_model_finite = self.bonus_model.as_ref().is_none_or(BonusModel::is_finite);
        is_bonus_model_finite
            && self.policy.network().is_finite()
            && self.value.is_finite()
            && self.normalizer.is_finite()
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let moments = [
            ("mean", self.normalizer.mean()),
            ("deviation", self.normalizer.deviation()),
        ];
        let moments =
            moments.map(|(name, moment)| Tensor::list(&format!("value.{name}"), vec![moment]));
        let bonus_tensors = self.bonus_model.iter().flat_map(BonusModel::own_tensors);
        self.policy
            .tensors()
            .chain(self.value.tensors("value"))
            .chain(moments)
            .chain(self.scaling.tensors())
            .chain(bonus_tensors)
            .collect()
    }

    fn shared_tensors(&self) -> Vec<Tensor<'_>> {
        let bonus_models = self.bonus_model.iter();
        bonus_models.flat_map(BonusModel::shared_tensors).collect()
    }

    fn initial_tensors(&self) -> Vec<Tensor<'_>> {
        let reward_seeds = self.perturbation.tensors();
        reward_seeds
            .into_iter()
            .chain(self.policy.network().initial_tensors("initial.policy"))
            .chain(self.value.initial_tensors("initial.value"))
            .chain(self.bonus_model.iter().flat_map(BonusModel::seed_tensors))
            .collect()
    }

    fn save(&self) -> Vec<u8> {
        let (policy, value) = (
            self.policy.network().learned_state(),
            self.value.learned_state(),
        );
        let (observations, bonus_model) = (
            self.scaling.learned(),
            self.bonus_model.as_ref().map(BonusModel::save),
        );
        let saved = Saved {
            policy,
            value,
            normalizer: self.normalizer,
            observations,
            bonus_model,
        };
        postcard::to_stdvec(&saved).expect("plain numbers always serialize")
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<LearnedState, Standardizer> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        self.policy.network_mut().restore(saved.policy)?;
        self.value.restore(saved.value)?;
        self.scaling.restore(saved.observations)?;
        self.normalizer = saved.normalizer;
        self.normalize_regularization();
        match (&mut self.bonus_model, saved.bonus_model) {
            (Some(bonus_model), Some(bytes)) => bonus_model.restore(&bytes),
            (None, None) => Ok(()),
            _ => Err("the checkpoint is of a run with another `bonus`".to_owned()),
        }
    }
}
