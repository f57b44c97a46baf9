//! How an agent learns from the episodes of an update: samples, estimates and gradient steps.

use rand::seq::SliceRandom;

use super::config::{Clipping, Data, Minibatch, PolicyLoss, Standardization, TimeLimit};
use super::estimates::Trajectory;
use super::samples::Samples;
use super::totals::Totals;
use super::{SeedPgAgent, Workspace};
use crate::agent::network::Descent;
use crate::cancellation::cancellation_point;
use crate::experience::{Episode, StepData};
use crate::math;
use crate::rl::advantage;
use crate::rl::policy_loss::{self, Surrogate};
use seedbed_env::Status;
use seedbed_input::numbers::Positive;
use seedbed_random::Stream;

impl SeedPgAgent {
    /// Intrinsic rewards and, if they are recorded, advantages of the agent's own steps, before it
    /// learns from them. Estimates draw no random numbers and change only what the next estimate
    /// overwrites, so learning continues with the same bits.
    pub(super) fn own_step_data(&mut self, new_episodes: &[Episode]) -> Vec<StepData> {
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
    pub(super) fn compute_earlier_ratios(&mut self, new_episodes: &[Episode]) {
        let mut earlier_ratios = std::mem::take(&mut self.work.earlier_ratios);
        earlier_ratios.iter_mut().for_each(Vec::clear);
        earlier_ratios.resize_with(new_episodes.len().max(earlier_ratios.len()), Vec::new);
        for position in 0..self.work.chosen_episodes.len() {
            cancellation_point();
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

    /// Says which samples are imitated, if any agent is. Their advantages do not count.
    fn mark_imitated_samples(&mut self, agent: u32) {
        let Some(imitation) = self.imitation else {
            return;
        };
        let samples = &mut self.work.samples;
        let weight = if imitation.agent == agent {
            imitation.weight
        } else {
            0.0
        };
        let count = samples.len();
        samples.imitation.clear();
        samples.imitation.resize(count, weight);
    }

    /// Whether the value function and whether the policy learn from an episode.
    fn networks_that_learn_from(&self, episode: &Episode) -> [bool; 2] {
        let learns = |data| data == Data::Shared || episode.agent == self.agent;
        [
            learns(self.config.value_data),
            learns(self.config.policy_data) || self.imitates(episode.agent),
        ]
    }

    /// One pass over the chosen episodes.
    pub(super) fn learn_for_an_epoch(
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
        cancellation_point();
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
        self.learn_from_samples(size, descent, random, totals);
    }

    /// Learns from minibatches of `size` of the collected samples.
    pub(super) fn learn_from_samples(
        &mut self,
        size: usize,
        descent: &Descent,
        random: &mut Stream,
        totals: &mut Totals,
    ) {
        let targets = std::mem::take(&mut self.work.all_value_samples.targets);
        self.normalize(&targets);
        self.work.all_value_samples.targets = targets;
        let mut rows = std::mem::take(&mut self.work.rows);
        shuffle_rows(&mut rows, self.work.all_policy_samples.len(), random);
        for rows in rows.chunks(size) {
            cancellation_point();
            self.work
                .samples
                .gather(&self.work.all_policy_samples, rows);
            self.compute_ratios();
            self.improve_policy(descent, totals);
        }
        shuffle_rows(&mut rows, self.work.all_value_samples.len(), random);
        for rows in rows.chunks(size) {
            cancellation_point();
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
        if self.config.regularization.get() > 0.0 {
            self.normalize_regularization();
        }
    }

    pub(super) fn normalize_regularization(&mut self) {
        let (mean, deviation) = (self.normalizer.mean(), self.normalizer.deviation());
        self.value.normalize_regularization(mean, deviation);
    }

    /// Collects the samples of all chosen trajectories.
    pub(super) fn collect_samples(&mut self, new_episodes: &[Episode]) {
        self.work.all_policy_samples.clear();
        self.work.all_value_samples.clear();
        for position in 0..self.work.chosen_episodes.len() {
            cancellation_point();
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
    pub(super) fn load_trajectory(&mut self, episode: &Episode, index: usize) {
        self.estimate(episode, index);
        self.weight_samples(episode.agent == self.agent, index);
        self.mark_imitated_samples(episode.agent);
        if self.config.standardize == Standardization::PerTrajectory {
            advantage::standardize(&mut self.work.samples.advantages);
        }
    }

    /// Turns a trajectory into samples, with targets and advantages under the present policy and
    /// value function.   `index`: position of the episode among the new episodes
    pub(super) fn estimate(&mut self, episode: &Episode, index: usize) {
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
    pub(super) fn improve_policy(&mut self, descent: &Descent, totals: &mut Totals) {
        let work = &mut self.work;
        if self.config.standardize == Standardization::PerMinibatch {
            let Samples {
                advantages,
                imitation,
                ..
            } = &mut work.samples;
            advantage::standardize_rows(advantages, |row| weight_at(imitation, row, 0.0) == 0.0);
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
            let weight = weight_at(&samples.loss_weights, row, 1.0);
            let mut add = |surrogate: Surrogate, components| {
                let surrogate = surrogate.weighted(weight);
                work.slopes
                    .extend(std::iter::repeat_n(surrogate.slope, components));
                totals.add_surrogate(&surrogate, components);
            };
            let imitation = weight_at(&samples.imitation, row, 0.0);
            if imitation > 0.0 {
                let log_prob = log_probs.iter().sum();
                add(policy_loss::simple(log_prob, imitation), width);
            } else {
                let center = weight_at(&samples.centers, row, 1.0);
                let rows = (log_probs, behavior);
                for_each_surrogate(
                    *self.config.policy_loss,
                    rows,
                    (ratio, center),
                    advantage,
                    add,
                );
            }
        }
        totals.add_minibatch(&work.ratios, self.policy.mean_entropy());
        let entropy_bonus = self.config.entropy_bonus.get_f32();
        totals.count_gradient_step();
        self.policy.descend(
            &samples.states,
            &samples.actions,
            &work.slopes,
            |row| weight_at(&samples.entropy_weights, row, entropy_bonus),
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
}

/// The number of a row of a column that is empty if all rows have the number `otherwise`.
fn weight_at(column: &[f32], row: usize, otherwise: f32) -> f32 {
    column.get(row).copied().unwrap_or(otherwise)
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
