//! Statistics of one update, summed sample by sample.

use crate::agent::UpdateReport;
use crate::experience::Episode;
use crate::rl::policy_loss::Surrogate;

/// Sums over the samples of one update.
#[derive(Default)]
pub(super) struct Totals {
    /// Number of gradient steps of the value function and of the policy.
    gradient_steps: u32,
    value_steps: u64,
    value_loss: f64,
    policy_steps: u64,
    policy_loss: f64,
    /// Sum of |ρ − 1|.
    ratio_deviation: f64,
    largest_ratio: f32,
    entropy: f64,
    /// Number of components of actions.
    component_count: u64,
    /// Number of components whose ratio was clipped.
    clipped_count: u64,
    intrinsic_reward: Option<f32>,
    pub(super) prediction_error: Option<f32>,
}

impl Totals {
    /// Adds the error of one sample against its normalized target.
    pub(super) fn add_value_error(&mut self, error: f32) {
        self.value_steps += 1;
        self.value_loss += 0.5 * f64::from(error).powi(2);
    }

    /// Adds the surrogate loss of an action, or of some of its components.   `components`: number
    /// of components that the loss covers
    pub(super) fn add_surrogate(&mut self, surrogate: &Surrogate, components: usize) {
        self.policy_loss += f64::from(surrogate.loss);
        self.component_count += components as u64;
        self.clipped_count += if surrogate.is_clipped {
            components as u64
        } else {
            0
        };
    }

    /// Adds the ratios and the mean entropy of a minibatch.
    pub(super) fn add_minibatch(&mut self, ratios: &[f32], mean_entropy: f32) {
        self.policy_steps += ratios.len() as u64;
        self.ratio_deviation += ratios
            .iter()
            .map(|ratio| f64::from((ratio - 1.0).abs()))
            .sum::<f64>();
        self.largest_ratio = ratios
            .iter()
            .fold(self.largest_ratio, |largest, ratio| largest.max(*ratio));
        self.entropy += f64::from(mean_entropy) * ratios.len() as f64;
    }

    /// Counts a gradient step of the value function or of the policy.
    pub(super) fn count_gradient_step(&mut self) {
        self.gradient_steps += 1;
    }

    /// Sets the mean bonus of the agent's own steps and the bonus model's prediction error.
    /// `bonuses`: one list per new episode
    pub(super) fn set_bonuses(
        &mut self,
        agent: u32,
        new_episodes: &[Episode],
        bonuses: &[Vec<f32>],
        prediction_error: Option<f32>,
    ) {
        let own_bonuses = new_episodes
            .iter()
            .zip(bonuses)
            .filter(|(episode, _)| episode.agent == agent)
            .flat_map(|(_, bonuses)| bonuses);
        let (sum, count) = own_bonuses.fold((0.0, 0_u64), |(sum, count), &bonus| {
            (sum + f64::from(bonus), count + 1)
        });
        self.intrinsic_reward = mean(sum, count);
        self.prediction_error = prediction_error;
    }

    /// The means over all samples.
    pub(super) fn report(&self) -> UpdateReport {
        UpdateReport {
            gradient_steps: Some(self.gradient_steps),
            value_loss: mean(self.value_loss, self.value_steps),
            policy_loss: mean(self.policy_loss, self.policy_steps),
            ratio_deviation: mean(self.ratio_deviation, self.policy_steps).map(|mean| 1.0 + mean),
            largest_ratio: (self.policy_steps > 0).then_some(self.largest_ratio),
            clipped_fraction: mean(self.clipped_count as f64, self.component_count),
            entropy: mean(self.entropy, self.policy_steps),
            intrinsic_reward: self.intrinsic_reward,
            prediction_error: self.prediction_error,
            bonus_agreement: None,
        }
    }
}

/// The mean of `count` numbers; none if there are none.
fn mean(sum: f64, count: u64) -> Option<f32> {
    (count > 0).then(|| (sum / count as f64) as f32)
}
