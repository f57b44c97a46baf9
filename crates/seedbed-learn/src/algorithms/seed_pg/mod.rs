//! Seed-PG: K policies learn from shared experience, each with its own fixed seed (thesis §3.4).
//!
//! Each agent k has its own policy `π_k` and value function `v_k`. Steps of a trajectory of agent i
//! are weighted by ρₜ = `π_k(aₜ|sₜ)` / `π_i(aₜ|sₜ)`, and its rewards are perturbed by the seeds of
//! agent k: rₜ₊₁ + `z_{k,t+1}`, where t is the step within the episode.
//!
//! [`config`] has the parameters. With own data and no seeds they also give REINFORCE, the simple
//! policy gradient (§1.5), Off-PAC (§3.3.1), and standard PPO. `estimates` calls the formulas
//! in [`rl`](crate::rl) that the parameters select.

pub mod config;
mod estimates;
mod samples;
#[cfg(test)]
mod tests;
mod totals;

use rand::seq::{SliceRandom, index};
use serde::{Deserialize, Serialize};

use self::config::{
    Clipping, Data, Minibatch, PolicyLoss, ReturnNormalisation, SeedPg, Sharing, Standardization,
    TimeLimit,
};
use self::estimates::{Scratch, Trajectory};
use self::samples::Samples;
use self::totals::Totals;
use crate::agent::bonus::BonusModel;
use crate::agent::network::{Descent, LearnedState, Network};
use crate::agent::policy::{self, Policy};
use crate::agent::scaling::Scaling;
use crate::agent::{ActScratch, Agent, AgentContext, Tensor, Update};
use crate::experience::{Episode, Experience, StepData};
use crate::math;
use crate::nn::{Mlp, PopArt, Standardizer};
use crate::rl::advantage;
use crate::rl::policy_loss::{self, Surrogate};
use crate::seed::{InitialParameters, RewardPerturbation};
use crate::team::EpisodeInfo;
use seedbed_env::input::numbers::{NonNegative, Positive};
use seedbed_env::random::{Purpose, Stream, stream};
use seedbed_env::{Status, TaskSpec};

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
    /// Whether updates return [advantages](StepData::advantages).
    record_advantages: bool,
    work: Workspace,
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
                ReturnNormalisation::PopArt { beta } => PopArt::new(beta.get()),
                ReturnNormalisation::Raw => PopArt::identity(),
            },
            bonus_model: BonusModel::new(&config.bonus, context),
            weight_of_others: None,
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

    /// Chooses the new episodes that this agent learns from: its own, and those that others share
    /// with it.
    fn choose_episodes(
        &self,
        new_episodes: impl Iterator<Item = EpisodeInfo>,
        random: &mut Stream,
    ) -> Vec<usize> {
        let config = &self.config;
        let (mut chosen, mut others) = (Vec::new(), Vec::new());
        for (index, episode) in new_episodes.enumerate() {
            if episode.length > 0 && episode.agent == self.agent {
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

    /// Intrinsic rewards and, if they are recorded, advantages of the agent's own steps, before it
    /// learns from them. Estimates draw no random numbers and change only what the next estimate
    /// overwrites, so learning continues with the same bits.
    fn own_step_data(&mut self, new_episodes: &[Episode]) -> Vec<StepData> {
        let mut step_data = Vec::new();
        if self.bonus_model.is_none() && !self.record_advantages {
            return step_data;
        }
        for position in 0..self.work.chosen_episodes.len() {
            let index = self.work.chosen_episodes[position];
            let episode = &new_episodes[index];
            if episode.agent != self.agent {
                continue;
            }
            let mut data = StepData::empty_for(episode);
            if let Some(bonuses) = self.work.bonuses.get(index) {
                data.intrinsic_rewards.clone_from(bonuses);
            }
            if self.record_advantages {
                self.estimate(episode, index);
                data.advantages.clone_from(&self.work.samples.advantages);
            }
            step_data.push(data);
        }
        step_data
    }

    /// Computes the importance ratios of the chosen episodes of others before the update.
    fn compute_earlier_ratios(&mut self, new_episodes: &[Episode]) {
        let mut earlier_ratios = std::mem::take(&mut self.work.earlier_ratios);
        earlier_ratios.iter_mut().for_each(Vec::clear);
        earlier_ratios.resize_with(new_episodes.len().max(earlier_ratios.len()), Vec::new);
        for position in 0..self.work.chosen_episodes.len() {
            let index = self.work.chosen_episodes[position];
            let episode = &new_episodes[index];
            if episode.agent != self.agent {
                self.load_actions(episode);
                self.compute_ratios();
                earlier_ratios[index].clone_from(&self.work.ratios);
            }
        }
        self.work.earlier_ratios = earlier_ratios;
    }

    /// Sets what distinguishes the steps of others from own steps.
    fn weight_samples(&mut self, is_own: bool, index: usize) {
        let Some(weight_of_others) = self.weight_of_others else {
            return;
        };
        let Workspace {
            samples,
            earlier_ratios,
            ..
        } = &mut self.work;
        let weight = if is_own { 1.0 } else { weight_of_others };
        let count = samples.len();
        samples
            .weights
            .iter_mut()
            .for_each(|other| *other *= weight);
        samples.loss_weights.clear();
        samples.loss_weights.resize(count, weight);
        samples.centers.clone_from(&earlier_ratios[index]);
        samples.centers.resize(count, 1.0);
    }

    /// Whether the value function and whether the policy learn from an episode.
    fn networks_that_learn_from(&self, episode: &Episode) -> [bool; 2] {
        let learns = |data| data == Data::Shared || episode.agent == self.agent;
        [
            learns(self.config.value_data),
            learns(self.config.policy_data),
        ]
    }

    /// One pass over the chosen episodes.
    fn learn_for_an_epoch(
        &mut self,
        new_episodes: &[Episode],
        descent: &Descent,
        random: &mut Stream,
        totals: &mut Totals,
    ) {
        match self.config.minibatch {
            Minibatch::Trajectory => {
                let mut order = std::mem::take(&mut self.work.chosen_episodes);
                order.shuffle(random);
                for &index in &order {
                    self.learn_from_trajectory(new_episodes, index, descent, totals);
                }
                self.work.chosen_episodes = order;
            }
            Minibatch::Steps(size) => {
                self.learn_from_steps(new_episodes, size.get() as usize, descent, random, totals);
            }
        }
    }

    /// Learns from one trajectory as one minibatch: each network takes at most one step.
    fn learn_from_trajectory(
        &mut self,
        new_episodes: &[Episode],
        index: usize,
        descent: &Descent,
        totals: &mut Totals,
    ) {
        let [value_learns, policy_learns] = self.networks_that_learn_from(&new_episodes[index]);
        self.load_trajectory(&new_episodes[index], index);
        if value_learns {
            let targets = std::mem::take(&mut self.work.samples.targets);
            self.normalize(&targets);
            self.work.samples.targets = targets;
        }
        if policy_learns {
            self.improve_policy(descent, totals);
        }
        if value_learns {
            self.improve_value(descent, totals);
        }
    }

    /// Learns from minibatches of `size` steps drawn from all chosen trajectories; each network
    /// takes one step per minibatch.
    fn learn_from_steps(
        &mut self,
        new_episodes: &[Episode],
        size: usize,
        descent: &Descent,
        random: &mut Stream,
        totals: &mut Totals,
    ) {
        self.collect_samples(new_episodes);
        let targets = std::mem::take(&mut self.work.all_value_samples.targets);
        self.normalize(&targets);
        self.work.all_value_samples.targets = targets;
        let mut rows = std::mem::take(&mut self.work.rows);
        shuffle_rows(&mut rows, self.work.all_policy_samples.len(), random);
        for rows in rows.chunks(size) {
            self.work
                .samples
                .gather(&self.work.all_policy_samples, rows);
            self.compute_ratios();
            self.improve_policy(descent, totals);
        }
        shuffle_rows(&mut rows, self.work.all_value_samples.len(), random);
        for rows in rows.chunks(size) {
            self.work.samples.gather(&self.work.all_value_samples, rows);
            self.estimate_values();
            self.improve_value(descent, totals);
        }
        self.work.rows = rows;
    }

    /// Updates the moments by which targets are normalized. Neither the value function changes nor
    /// the function that it is regularized towards.
    fn normalize(&mut self, targets: &[f32]) {
        let (weight, bias) = self.value.output_layer();
        self.normalizer.update(targets, weight, bias);
        if self.config.regularisation.get() > 0.0 {
            self.normalize_regularization();
        }
    }

    fn normalize_regularization(&mut self) {
        let (mean, deviation) = (self.normalizer.mean(), self.normalizer.deviation());
        self.value.normalize_regularization(mean, deviation);
    }

    /// Collects the samples of all chosen trajectories.
    fn collect_samples(&mut self, new_episodes: &[Episode]) {
        self.work.all_policy_samples.clear();
        self.work.all_value_samples.clear();
        for position in 0..self.work.chosen_episodes.len() {
            let index = self.work.chosen_episodes[position];
            let [value_learns, policy_learns] = self.networks_that_learn_from(&new_episodes[index]);
            self.load_trajectory(&new_episodes[index], index);
            let Workspace {
                samples,
                all_policy_samples,
                all_value_samples,
                ..
            } = &mut self.work;
            if value_learns {
                all_value_samples.append(samples);
            }
            if policy_learns {
                all_policy_samples.append(samples);
            }
        }
    }

    /// Turns a trajectory into samples to learn from.
    fn load_trajectory(&mut self, episode: &Episode, index: usize) {
        self.estimate(episode, index);
        self.weight_samples(episode.agent == self.agent, index);
        if self.config.standardise == Standardization::PerTrajectory {
            advantage::standardize(&mut self.work.samples.advantages);
        }
    }

    /// Turns a trajectory into samples, with targets and advantages under the present policy and
    /// value function.   `index`: position of the episode among the new episodes
    fn estimate(&mut self, episode: &Episode, index: usize) {
        self.load_actions(episode);
        self.perturb_rewards(episode, index);
        self.compute_ratios();
        self.estimate_values();

        let config = &self.config;
        let Workspace {
            samples,
            rewards,
            ratios,
            values,
            estimates,
            ..
        } = &mut self.work;
        let trajectory = Trajectory {
            rewards,
            ratios,
            values,
            discount: config.discount.get_f32(),
        };
        let Samples {
            targets,
            weights,
            advantages,
            ..
        } = samples;
        trajectory.compute_value_targets(*config.value_target, estimates, targets, weights);
        trajectory.compute_advantages(
            *config.advantage,
            *config.value_target,
            targets,
            estimates,
            advantages,
        );
    }

    /// Sets the states, the actions, and the log-probabilities of the policy that acted.
    fn load_actions(&mut self, episode: &Episode) {
        let samples = &mut self.work.samples;
        self.scaling.apply(episode.states(), &mut samples.states);
        samples.actions.clone_from(&episode.actions);
        samples.behavior_log_probs.clone_from(&episode.log_probs);
    }

    /// Sets the perturbed rewards rₜ₊₁ + `z_{k,t+1}`, plus bonuses. If the time limit bootstraps,
    /// adds γ v(`s_T`) to the last reward for the rewards that would have followed.
    fn perturb_rewards(&mut self, episode: &Episode, index: usize) {
        let Workspace {
            rewards,
            last_state,
            bonuses,
            ..
        } = &mut self.work;
        let time_limit = self.config.time_limit;
        let ends = episode.outcome == Status::Terminated || time_limit == TimeLimit::Ends;
        rewards.clone_from(&episode.rewards);
        let discount = self.config.discount.get_f32();
        self.perturbation.add_to(episode, discount, ends, rewards);
        if let Some(bonuses) = bonuses.get(index) {
            rewards
                .iter_mut()
                .zip(bonuses)
                .for_each(|(reward, bonus)| *reward += bonus);
        }
        if time_limit == TimeLimit::Bootstraps && episode.outcome == Status::Truncated {
            self.scaling.apply(episode.last_observation(), last_state);
            let normalized = self.value.forward(last_state)[0];
            let value = self.normalizer.mean() + self.normalizer.deviation() * normalized;
            rewards[episode.length() - 1] += discount * value;
        }
    }

    /// Computes the importance ratios ρₜ = `π_k(aₜ|sₜ)` / μ(aₜ|sₜ) of the present samples, where μ
    /// is the policy that acted.
    fn compute_ratios(&mut self) {
        let Workspace {
            samples,
            log_probs,
            ratios,
            ..
        } = &mut self.work;
        self.policy
            .evaluate(&samples.states, &samples.actions, log_probs);
        let width = self.policy.component_count();
        let rows = log_probs
            .chunks_exact(width)
            .zip(samples.behavior_log_probs.chunks_exact(width));
        ratios.clear();
        ratios.extend(rows.map(|(log_probs, behavior)| log_ratio(log_probs, behavior)));
        math::exp_in_place(ratios);
    }

    /// Computes v(sₜ) = σ Ŷₜ + μ of the present samples.
    fn estimate_values(&mut self) {
        let (deviation, mean) = (self.normalizer.deviation(), self.normalizer.mean());
        let normalized = self.value.forward(&self.work.samples.states);
        self.work.values.clear();
        self.work
            .values
            .extend(normalized.iter().map(|y| mean + deviation * y));
    }

    /// One gradient step of the policy on the present samples, whose [ratios](Self::compute_ratios)
    /// must have been computed.
    fn improve_policy(&mut self, descent: &Descent, totals: &mut Totals) {
        let work = &mut self.work;
        if self.config.standardise == Standardization::PerMinibatch {
            advantage::standardize(&mut work.samples.advantages);
        }
        let samples = &work.samples;
        let width = samples.component_count();
        let rows = work
            .log_probs
            .chunks_exact(width)
            .zip(samples.behavior_log_probs.chunks_exact(width));
        work.slopes.clear();
        for (row, ((log_probs, behavior), (&ratio, &advantage))) in rows
            .zip(work.ratios.iter().zip(&samples.advantages))
            .enumerate()
        {
            let weight = samples.loss_weights.get(row).copied().unwrap_or(1.0);
            for_each_surrogate(
                *self.config.policy_loss,
                (log_probs, behavior),
                (ratio, samples.centers.get(row).copied().unwrap_or(1.0)),
                advantage,
                |surrogate, components| {
                    let surrogate = surrogate.weighted(weight);
                    work.slopes
                        .extend(std::iter::repeat_n(surrogate.slope, components));
                    totals.add_surrogate(&surrogate, components);
                },
            );
        }
        totals.add_minibatch(&work.ratios, self.policy.mean_entropy());
        let entropy_bonus = self.config.entropy_bonus.get_f32();
        totals.count_gradient_step();
        self.policy.descend(
            &samples.states,
            &samples.actions,
            &work.slopes,
            entropy_bonus,
            descent,
        );
    }

    /// One gradient step on ½ mean wₜ (Ŷₜ − (Yₜ − μ)/σ)² of the present samples, whose
    /// [values](Self::estimate_values) must have been computed.
    fn improve_value(&mut self, descent: &Descent, totals: &mut Totals) {
        let Workspace {
            samples,
            values,
            value_gradient,
            ..
        } = &mut self.work;
        let (scale, share) = (
            1.0 / self.normalizer.deviation(),
            1.0 / samples.len() as f32,
        );
        value_gradient.clear();
        for ((value, target), weight) in values.iter().zip(&samples.targets).zip(&samples.weights) {
            let error = (value - target) * scale;
            totals.add_value_error(error);
            value_gradient.push(share * weight * error);
        }
        totals.count_gradient_step();
        self.value.descend(&samples.states, value_gradient, descent);
    }

    fn descent(&self, round: u32) -> Descent {
        Descent {
            regularization: self.config.regularisation.get_f32(),
            gradient_clip: self.config.gradient_clip.map(Positive::get_f32),
            step_size_factor: self.config.step_size_schedule.factor(round),
        }
    }
}

/// The policy network and the value network with the agent's initial parameters.
/// Shape of the value function's network.
fn value_shape(spec: &TaskSpec, hidden: &[usize]) -> Mlp {
    let mut sizes = vec![spec.observation_width()];
    sizes.extend(hidden);
    sizes.push(1);
    Mlp::new(&sizes)
}

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
        Network::new(policy_shape, initial.policy, config.policy_optimiser),
        Network::new(value_shape, initial.value, config.value_optimiser),
    )
}

/// Passes the surrogate loss of a whole action, or one loss per component, to `visit`, with the
/// number of components that the loss covers.   `log_probs`, `behavior`: log π and log μ of each
/// component; `ratio`, `center` (around which it is clipped), `advantage`: of the whole action
fn for_each_surrogate(
    loss: PolicyLoss,
    (log_probs, behavior): (&[f32], &[f32]),
    (ratio, center): (f32, f32),
    advantage: f32,
    mut visit: impl FnMut(Surrogate, usize),
) {
    let width = log_probs.len();
    match loss {
        PolicyLoss::Ppo { clip, clipping } => {
            let clip = clip.get_f32();
            if clipping == Clipping::Joint {
                visit(
                    policy_loss::ppo_around(center, ratio, advantage, clip),
                    width,
                );
                return;
            }
            for (log_prob, behavior) in log_probs.chunks_exact(1).zip(behavior.chunks_exact(1)) {
                let ratio = math::exp(log_ratio(log_prob, behavior));
                visit(policy_loss::ppo(ratio, advantage, clip), 1);
            }
        }
        PolicyLoss::SimplePg => {
            visit(
                policy_loss::simple(log_probs.iter().sum(), advantage),
                width,
            );
        }
        PolicyLoss::OffPac { ratio_cap } => {
            let cap = ratio_cap.map(Positive::get_f32);
            let log_prob = log_probs.iter().sum();
            visit(policy_loss::off_pac(log_prob, ratio, advantage, cap), width);
        }
    }
}

/// log π/μ of one action from log π and log μ of its components, clamped to ±20.
fn log_ratio(log_probs: &[f32], behavior: &[f32]) -> f32 {
    let differences = log_probs
        .iter()
        .zip(behavior)
        .map(|(log_pi, log_mu)| log_pi - log_mu);
    differences.sum::<f32>().clamp(-20.0, 20.0)
}

/// Sets `rows` to 0 … `count` − 1 in random order.
fn shuffle_rows(rows: &mut Vec<usize>, count: usize, random: &mut Stream) {
    rows.clear();
    rows.extend(0..count);
    rows.shuffle(random);
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
        random: &mut Stream,
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
        let mut random = self.update_stream(round);
        let (descent, mut totals) = (self.descent(round), Totals::default());
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
