//! Which formula estimates what: value targets and advantages of one trajectory, as the
//! configuration chooses them.

use super::config::{AdvantageEstimate, Baseline, Importance, RatioCount, VTrace, ValueTarget};
use crate::rl::returns::Truncation;
use crate::rl::{advantage, returns};
use seedbed_env::input::numbers::Positive;

/// One trajectory as an agent sees it: `[T]` each.
#[derive(Clone, Copy)]
pub(super) struct Trajectory<'a> {
    /// rₜ₊₁ + `z_{k,t+1}`, the last one with what would follow a time limit.
    pub(super) rewards: &'a [f32],
    /// `π_k(aₜ|sₜ)` / μ(aₜ|sₜ)
    pub(super) ratios: &'a [f32],
    /// v(sₜ)
    pub(super) values: &'a [f32],
    /// γ
    pub(super) discount: f32,
}

/// Columns that estimates need on the way.
#[derive(Default)]
pub(super) struct Scratch {
    products: Vec<f32>,
    returns: Vec<f32>,
    baseline: Vec<f32>,
}

/// A product of ratios is bounded by this where no value target says otherwise.
const DEFAULT_CAP: Option<f32> = Some(1.0);

impl Trajectory<'_> {
    /// What the value function is regressed on, and how much each step counts: `[T]` both.
    pub(super) fn value_targets(
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
                self.returns(importance, cap, &mut scratch.products, targets);
            }
            ValueTarget::Td {
                importance,
                ratio_cap,
            } => {
                returns::temporal_difference(rewards, values, discount, targets);
                if importance != Importance::Off {
                    let cap = ratio_cap.map_or(f32::INFINITY, Positive::get_f32);
                    weights
                        .iter_mut()
                        .zip(ratios)
                        .for_each(|(weight, ratio)| *weight = ratio.min(cap));
                }
            }
            ValueTarget::Gae { lambda } => {
                returns::lambda(rewards, values, discount, lambda.get_f32(), targets)
            }
            ValueTarget::VTrace(v_trace) => returns::v_trace(
                rewards,
                values,
                ratios,
                discount,
                truncation(v_trace),
                targets,
            ),
        }
    }

    /// How much better than expected each action was: `[T]`. `targets` are those of the value
    /// function.
    pub(super) fn advantages(
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
                let Scratch {
                    products,
                    returns,
                    baseline: column,
                } = scratch;
                let of_trajectory = if let ValueTarget::MonteCarlo { .. } = value_target {
                    targets
                } else {
                    returns.resize(rewards.len(), 0.0);
                    self.returns(Importance::PerDecision, DEFAULT_CAP, products, returns);
                    returns
                };
                self.baseline(baseline, of_trajectory, column);
                match importance {
                    RatioCount::Single => advantage::monte_carlo_single(
                        rewards,
                        of_trajectory,
                        column,
                        discount,
                        advantages,
                    ),
                    RatioCount::Double => {
                        advantage::monte_carlo_double(of_trajectory, column, advantages)
                    }
                }
            }
            AdvantageEstimate::NStep { segment } => {
                advantage::n_step(
                    rewards,
                    values,
                    discount,
                    segment.get() as usize,
                    advantages,
                );
            }
            AdvantageEstimate::Gae { lambda } => {
                advantage::gae(rewards, values, discount, lambda.get_f32(), advantages)
            }
            AdvantageEstimate::Retrace { lambda } => {
                advantage::retrace(
                    rewards,
                    values,
                    ratios,
                    discount,
                    lambda.get_f32(),
                    advantages,
                );
            }
            AdvantageEstimate::VTrace(v_trace) => {
                scratch.returns.resize(rewards.len(), 0.0);
                returns::v_trace(
                    rewards,
                    values,
                    ratios,
                    discount,
                    truncation(v_trace),
                    &mut scratch.returns,
                );
                advantage::v_trace(rewards, &scratch.returns, values, discount, advantages);
            }
        }
    }

    fn returns(
        &self,
        importance: Importance,
        cap: Option<f32>,
        products: &mut Vec<f32>,
        returns: &mut [f32],
    ) {
        match importance {
            Importance::PerDecision => {
                returns::per_decision(
                    self.ratios,
                    self.rewards,
                    self.discount,
                    cap,
                    products,
                    returns,
                );
            }
            Importance::Ordinary => {
                returns::ordinary(self.ratios, self.rewards, self.discount, cap, returns)
            }
            Importance::Off => returns::discounted(self.rewards, self.discount, returns),
        }
    }

    fn baseline(&self, baseline: Baseline, returns: &[f32], column: &mut Vec<f32>) {
        column.clear();
        match baseline {
            Baseline::Value => column.extend_from_slice(self.values),
            Baseline::Mean => advantage::mean_baseline(returns, column),
            Baseline::Off => column.resize(returns.len(), 0.0),
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
    use seedbed_env::input::numbers::known;

    /// γ = ½, r = 1, 2, 4, v = 2, 4, 6, ρ = 2, ½, 3, as in the tests of the formulas.
    const TRAJECTORY: Trajectory<'static> = Trajectory {
        rewards: &[1.0, 2.0, 4.0],
        ratios: &[2.0, 0.5, 3.0],
        values: &[2.0, 4.0, 6.0],
        discount: 0.5,
    };

    fn targets(choice: ValueTarget) -> (Vec<f32>, Vec<f32>) {
        let (mut targets, mut weights) = (vec![], vec![]);
        TRAJECTORY.value_targets(choice, &mut Scratch::default(), &mut targets, &mut weights);
        (targets, weights)
    }

    fn advantages(choice: AdvantageEstimate, value_target: ValueTarget) -> Vec<f32> {
        let mut advantages = vec![];
        TRAJECTORY.advantages(
            choice,
            value_target,
            &targets(value_target).0,
            &mut Scratch::default(),
            &mut advantages,
        );
        advantages
    }

    fn monte_carlo(importance: Importance, cap: Option<f64>) -> ValueTarget {
        ValueTarget::MonteCarlo {
            importance,
            ratio_product_cap: cap.map(known),
        }
    }

    /// Eq. 12 uncapped: 6, 4, 12; products bounded by 1: 3, 3, 4; Eq. 11: 3·3, 1.5·4, 3·4; Eq. 1:
    /// 3, 4, 4.
    #[test]
    fn value_targets_by_hand() {
        assert_eq!(
            targets(monte_carlo(Importance::PerDecision, None)).0,
            [6.0, 4.0, 12.0]
        );
        assert_eq!(
            targets(monte_carlo(Importance::PerDecision, Some(1.0))).0,
            [3.0, 3.0, 4.0]
        );
        assert_eq!(
            targets(monte_carlo(Importance::Ordinary, None)).0,
            [9.0, 6.0, 12.0]
        );
        assert_eq!(
            targets(monte_carlo(Importance::Off, None)),
            (vec![3.0, 4.0, 4.0], vec![1.0; 3])
        );
    }

    /// TD: r + ½v' = 3, 5, 4, the error weighed by ρ, by min(1, ρ), or not.
    #[test]
    fn temporal_difference_errors_are_weighed() {
        let weighed = |importance, cap: Option<f64>| {
            targets(ValueTarget::Td {
                importance,
                ratio_cap: cap.map(known),
            })
        };
        assert_eq!(
            weighed(Importance::PerDecision, None),
            (vec![3.0, 5.0, 4.0], vec![2.0, 0.5, 3.0])
        );
        assert_eq!(
            weighed(Importance::PerDecision, Some(1.0)).1,
            [1.0, 0.5, 1.0]
        );
        assert_eq!(weighed(Importance::Off, None).1, [1.0; 3]);
    }

    /// With G = 3, 4, 4: Single is r + ½G' − b = 3, 4, 4 − b as well, Double the same here; b = v,
    /// the mean 11/3, or 0.
    #[test]
    fn monte_carlo_advantages_by_hand() {
        let plain = monte_carlo(Importance::Off, None);
        let of = |importance, baseline| {
            advantages(
                AdvantageEstimate::MonteCarlo {
                    importance,
                    baseline,
                },
                plain,
            )
        };
        assert_eq!(of(RatioCount::Single, Baseline::Value), [1.0, 0.0, -2.0]);
        assert_eq!(of(RatioCount::Double, Baseline::Off), [3.0, 4.0, 4.0]);
        let centred = of(RatioCount::Single, Baseline::Mean);
        assert!(
            centred
                .iter()
                .zip([-2.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0])
                .all(|(a, b)| (a - b).abs() < 1e-6)
        );
    }

    /// Without a Monte-Carlo target the return is the capped per-decision one, 3, 3, 4: Single
    /// gives 1 + ½·3, 2 + ½·4, 4.
    #[test]
    fn a_monte_carlo_advantage_has_its_own_return() {
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
        assert_eq!(targets(ValueTarget::VTrace(v_trace)).0, [3.0, 4.0, 4.0]);
        assert_eq!(
            advantages(
                AdvantageEstimate::VTrace(v_trace),
                monte_carlo(Importance::Off, None)
            ),
            [1.0, 0.0, -2.0]
        );
    }
}
