//! Value targets and advantages of one trajectory, by the formulas that the configuration chooses.

use super::config::{AdvantageEstimate, Baseline, Importance, RatioCount, VTrace, ValueTarget};
use crate::rl::returns::Truncation;
use crate::rl::{advantage, returns};
use seedbed_input::numbers::Positive;

/// One trajectory as the learning agent evaluates it: `[T]` each.
#[derive(Clone, Copy)]
pub(super) struct Trajectory<'a> {
    /// Perturbed rewards rₜ₊₁ + `z_{k,t+1}`; the last one includes the value of the last state if a
    /// time limit bootstraps.
    pub(super) rewards: &'a [f32],
    /// Importance ratios `π_k(aₜ|sₜ)` / μ(aₜ|sₜ).
    pub(super) ratios: &'a [f32],
    /// Values v(sₜ).
    pub(super) values: &'a [f32],
    /// Discount factor γ.
    pub(super) discount: f32,
}

/// Buffers for intermediate results.
#[derive(Default)]
pub(super) struct Scratch {
    /// Scratch buffer of [`returns::per_decision`].
    per_decision: Vec<f32>,
    returns: Vec<f32>,
    baseline: Vec<f32>,
}

/// Maximal product of ratios in per-decision returns that are computed for advantages only.
const DEFAULT_PRODUCT_CAP: Option<f32> = Some(1.0);

impl Trajectory<'_> {
    /// Computes targets of the value function, and weights of their errors: `[T]` both.
    pub(super) fn compute_value_targets(
        &self,
        choice: ValueTarget,
        scratch: &mut Scratch,
        targets: &mut Vec<f32>,
        weights: &mut Vec<f32>,
    ) {
        let Self {
            rewards,
            ratios,
            values,
            discount,
        } = *self;
        targets.resize(rewards.len(), 0.0);
        weights.clear();
        weights.resize(rewards.len(), 1.0);
        match choice {
            ValueTarget::MonteCarlo {
                importance,
                ratio_product_cap,
            } => {
                let cap = ratio_product_cap.map(Positive::get_f32);
                self.compute_returns(importance, cap, &mut scratch.per_decision, targets);
            }
            ValueTarget::Td {
                importance,
                ratio_cap,
            } => {
                returns::temporal_difference(rewards, values, discount, targets);
                if importance != Importance::Off {
                    let cap = ratio_cap.map_or(f32::INFINITY, Positive::get_f32);
                    weights.clear();
                    weights.extend(ratios.iter().map(|ratio| ratio.min(cap)));
                }
            }
            ValueTarget::Gae { lambda } => {
                returns::lambda(rewards, values, discount, lambda.get_f32(), targets);
            }
            ValueTarget::VTrace(v_trace) => self.compute_v_trace_targets(v_trace, targets),
        }
    }

    /// Computes advantages of the actions: `[T]`. `targets` are the targets of the value function.
    pub(super) fn compute_advantages(
        &self,
        choice: AdvantageEstimate,
        value_target: ValueTarget,
        targets: &[f32],
        scratch: &mut Scratch,
        advantages: &mut Vec<f32>,
    ) {
        let Self {
            rewards,
            ratios,
            values,
            discount,
        } = *self;
        advantages.resize(rewards.len(), 0.0);
        match choice {
            AdvantageEstimate::MonteCarlo {
                importance,
                baseline,
            } => {
                let targets_are_returns = matches!(value_target, ValueTarget::MonteCarlo { .. });
                let returns = targets_are_returns.then_some(targets);
                self.compute_monte_carlo_advantages(
                    importance, baseline, returns, scratch, advantages,
                );
            }
            AdvantageEstimate::NStep { segment } => {
                let steps = segment.get() as usize;
                advantage::n_step(rewards, values, discount, steps, advantages);
            }
            AdvantageEstimate::Gae { lambda } => {
                advantage::gae(rewards, values, discount, lambda.get_f32(), advantages);
            }
            AdvantageEstimate::Retrace { lambda } => {
                let lambda = lambda.get_f32();
                advantage::retrace(rewards, values, ratios, discount, lambda, advantages);
            }
            AdvantageEstimate::VTrace(v_trace) => {
                self.compute_v_trace_targets(v_trace, &mut scratch.returns);
                advantage::v_trace(rewards, &scratch.returns, values, discount, advantages);
            }
        }
    }

    /// Computes returns minus a baseline. `returns` are the targets of the value function; `None`
    /// to compute per-decision returns instead.
    fn compute_monte_carlo_advantages(
        &self,
        importance: RatioCount,
        baseline: Baseline,
        returns: Option<&[f32]>,
        scratch: &mut Scratch,
        advantages: &mut [f32],
    ) {
        let Scratch {
            per_decision,
            returns: per_decision_returns,
            baseline: baselines,
        } = scratch;
        let returns = returns.unwrap_or_else(|| {
            per_decision_returns.resize(self.rewards.len(), 0.0);
            self.compute_returns(
                Importance::PerDecision,
                DEFAULT_PRODUCT_CAP,
                per_decision,
                per_decision_returns,
            );
            per_decision_returns
        });
        self.compute_baselines(baseline, returns, baselines);
        match importance {
            RatioCount::Single => {
                let (rewards, discount) = (self.rewards, self.discount);
                advantage::monte_carlo_single(rewards, returns, baselines, discount, advantages);
            }
            RatioCount::Double => advantage::monte_carlo_double(returns, baselines, advantages),
        }
    }

    fn compute_v_trace_targets(&self, v_trace: VTrace, targets: &mut Vec<f32>) {
        targets.resize(self.rewards.len(), 0.0);
        returns::v_trace(
            self.rewards,
            self.values,
            self.ratios,
            self.discount,
            truncation(v_trace),
            targets,
        );
    }

    /// Computes weighted or unweighted discounted returns: `[T]`. `cap` is the maximal product of
    /// ratios.
    fn compute_returns(
        &self,
        importance: Importance,
        cap: Option<f32>,
        scratch: &mut Vec<f32>,
        returns: &mut [f32],
    ) {
        match importance {
            Importance::PerDecision => {
                returns::per_decision(
                    self.ratios,
                    self.rewards,
                    self.discount,
                    cap,
                    scratch,
                    returns,
                );
            }
            Importance::Ordinary => {
                returns::ordinary(self.ratios, self.rewards, self.discount, cap, returns);
            }
            Importance::Off => returns::discounted(self.rewards, self.discount, returns),
        }
    }

    /// Computes the baseline of each step: `[T]`.
    fn compute_baselines(&self, baseline: Baseline, returns: &[f32], baselines: &mut Vec<f32>) {
        baselines.clear();
        match baseline {
            Baseline::Value => baselines.extend_from_slice(self.values),
            Baseline::Mean => advantage::mean_baseline(returns, baselines),
            Baseline::Off => baselines.resize(returns.len(), 0.0),
        }
    }
}

fn truncation(v_trace: VTrace) -> Truncation {
    Truncation {
        ratio: v_trace.ratio_cap.get_f32(),
        trace: v_trace.trace_cap.get_f32(),
        lambda: v_trace.lambda.get_f32(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_input::numbers::ranged_number;

    /// γ = ½, r = 1, 2, 4, v = 2, 4, 6, ρ = 2, ½, 3, as in the tests of the formulas.
    const TRAJECTORY: Trajectory<'static> = Trajectory {
        rewards: &[1.0, 2.0, 4.0],
        ratios: &[2.0, 0.5, 3.0],
        values: &[2.0, 4.0, 6.0],
        discount: 0.5,
    };

    fn targets_and_weights(choice: ValueTarget) -> (Vec<f32>, Vec<f32>) {
        let (mut targets, mut weights) = (vec![], vec![]);
        TRAJECTORY.compute_value_targets(
            choice,
            &mut Scratch::default(),
            &mut targets,
            &mut weights,
        );
        (targets, weights)
    }

    fn advantages(choice: AdvantageEstimate, value_target: ValueTarget) -> Vec<f32> {
        let mut advantages = vec![];
        TRAJECTORY.compute_advantages(
            choice,
            value_target,
            &targets_and_weights(value_target).0,
            &mut Scratch::default(),
            &mut advantages,
        );
        advantages
    }

    fn monte_carlo(importance: Importance, cap: Option<f64>) -> ValueTarget {
        ValueTarget::MonteCarlo {
            importance,
            ratio_product_cap: cap.map(ranged_number),
        }
    }

    /// Eq. 12 uncapped: 6, 4, 12; products capped at 1: 3, 3, 4; Eq. 11: 3·3, 1.5·4, 3·4; Eq. 1:
    /// 3, 4, 4.
    #[test]
    fn value_targets_by_hand() {
        assert_eq!(
            targets_and_weights(monte_carlo(Importance::PerDecision, None)).0,
            [6.0, 4.0, 12.0]
        );
        assert_eq!(
            targets_and_weights(monte_carlo(Importance::PerDecision, Some(1.0))).0,
            [3.0, 3.0, 4.0]
        );
        assert_eq!(
            targets_and_weights(monte_carlo(Importance::Ordinary, None)).0,
            [9.0, 6.0, 12.0]
        );
        assert_eq!(
            targets_and_weights(monte_carlo(Importance::Off, None)),
            (vec![3.0, 4.0, 4.0], vec![1.0; 3])
        );
    }

    /// TD: r + ½v' = 3, 5, 4, with errors weighted by ρ, by min(1, ρ), or not.
    #[test]
    fn temporal_difference_errors_are_weighted() {
        let td_targets = |importance, cap: Option<f64>| {
            targets_and_weights(ValueTarget::Td {
                importance,
                ratio_cap: cap.map(ranged_number),
            })
        };
        assert_eq!(
            td_targets(Importance::PerDecision, None),
            (vec![3.0, 5.0, 4.0], vec![2.0, 0.5, 3.0])
        );
        assert_eq!(
            td_targets(Importance::PerDecision, Some(1.0)).1,
            [1.0, 0.5, 1.0]
        );
        assert_eq!(td_targets(Importance::Off, None).1, [1.0; 3]);
    }

    /// With G = 3, 4, 4, both `Single` (r + ½G' − b) and `Double` (G − b) are 3, 4, 4 minus the
    /// baseline b, which is v, the mean 11/3, or 0.
    #[test]
    fn monte_carlo_advantages_by_hand() {
        let unweighted = monte_carlo(Importance::Off, None);
        let advantages_of = |importance, baseline| {
            advantages(
                AdvantageEstimate::MonteCarlo {
                    importance,
                    baseline,
                },
                unweighted,
            )
        };
        assert_eq!(
            advantages_of(RatioCount::Single, Baseline::Value),
            [1.0, 0.0, -2.0]
        );
        assert_eq!(
            advantages_of(RatioCount::Double, Baseline::Off),
            [3.0, 4.0, 4.0]
        );
        let centered = advantages_of(RatioCount::Single, Baseline::Mean);
        assert!(
            centered
                .iter()
                .zip([-2.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0])
                .all(|(a, b)| (a - b).abs() < 1e-6)
        );
    }

    /// Without a Monte-Carlo value target, returns are per-decision returns with products of ratios
    /// capped at 1: 3, 3, 4. `Single` gives 1 + ½·3, 2 + ½·4, 4.
    #[test]
    fn monte_carlo_advantages_do_not_need_monte_carlo_targets() {
        let td = ValueTarget::Td {
            importance: Importance::PerDecision,
            ratio_cap: None,
        };
        let choice = AdvantageEstimate::MonteCarlo {
            importance: RatioCount::Single,
            baseline: Baseline::Off,
        };
        assert_eq!(advantages(choice, td), [2.5, 4.0, 4.0]);
    }

    /// V-trace with ρ̄ = c̄ = λ = 1: Δ₂ = −2, Δ₁ = ½·1 + ½·½·(−2) = 0, Δ₀ = 1 + 0, vs = 3, 4, 4; A
    /// = r + ½vs' − v = 1, 0, −2.
    #[test]
    fn v_trace_by_hand() {
        let v_trace = VTrace::default();
        assert_eq!(
            targets_and_weights(ValueTarget::VTrace(v_trace)).0,
            [3.0, 4.0, 4.0]
        );
        assert_eq!(
            advantages(
                AdvantageEstimate::VTrace(v_trace),
                monte_carlo(Importance::Off, None)
            ),
            [1.0, 0.0, -2.0]
        );
    }
}
