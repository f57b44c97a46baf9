//! Policy losses of one step, each with its derivative with respect to log π(aₜ|sₜ). Advantages are
//! constants.

/// A loss and its derivative with respect to log π(a|s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surrogate {
    /// The loss.
    pub loss: f32,
    /// The derivative ∂loss/∂log π.
    pub slope: f32,
    /// Whether the derivative is 0 because the ratio is clipped.
    pub is_clipped: bool,
}

impl Surrogate {
    /// The loss times a constant weight.
    #[must_use]
    pub fn weighted(self, weight: f32) -> Self {
        Self {
            loss: weight * self.loss,
            slope: weight * self.slope,
            ..self
        }
    }
}

/// The simple policy gradient (thesis Eq. 7, 20): −log π(a|s) A.
#[must_use]
pub fn simple(log_prob: f32, advantage: f32) -> Surrogate {
    Surrogate {
        loss: -log_prob * advantage,
        slope: -advantage,
        is_clipped: false,
    }
}

/// The clipped surrogate of PPO (thesis Eq. 8, 16, 21, 23): −min(ρ A, clip(ρ, 1−ε, 1+ε) A).
///
/// ρ = π/μ, so ∂ρ/∂log π = ρ. The derivative is 0 if A > 0 and ρ > 1 + ε, or if A < 0 and ρ < 1 −
/// ε.
#[must_use]
pub fn ppo(ratio: f32, advantage: f32, clip: f32) -> Surrogate {
    ppo_around(1.0, ratio, advantage, clip)
}

/// The clipped surrogate for steps of other policies (SAPG, Singla et al. 2024, Eq. 5):
/// −min(ρ A, clip(ρ, c (1−ε), c (1+ε)) A).
///
/// ρ = π/μ, where μ is the policy that acted, and the center c > 0 is the ratio of the same step before
/// the update: clipping limits how far π moves in one update, however far it is from μ.
#[must_use]
pub fn ppo_around(center: f32, ratio: f32, advantage: f32, clip: f32) -> Surrogate {
    let unclipped_objective = ratio * advantage;
    let [low, high] = [center * (1.0 - clip), center * (1.0 + clip)];
    let clipped_objective = ratio.clamp(low, high) * advantage;
    let is_clipped = clipped_objective < unclipped_objective;
    Surrogate {
        loss: -unclipped_objective.min(clipped_objective),
        slope: if is_clipped {
            0.0
        } else {
            -unclipped_objective
        },
        is_clipped,
    }
}

/// Off-PAC (thesis Eq. 15, 22): −ρ log π(a|s) A, where ρ is a constant of at most `cap`.
#[must_use]
pub fn off_pac(log_prob: f32, ratio: f32, advantage: f32, cap: Option<f32>) -> Surrogate {
    let weight = ratio.min(cap.unwrap_or(f32::INFINITY));
    Surrogate {
        loss: -weight * log_prob * advantage,
        slope: -weight * advantage,
        is_clipped: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// ε = 0.2: (ρ, A) = (1.5, 2) is clipped to 1.2·2 and (0.5, −2) to 0.8·−2; (1.5, −2), (0.5, 2)
    /// and ρ = 1 are not clipped.
    #[test]
    fn ppo_by_hand() {
        let loss = |ratio, advantage| ppo(ratio, advantage, 0.2);
        assert_eq!(
            (loss(1.5, 2.0).slope, loss(1.5, 2.0).is_clipped),
            (0.0, true)
        );
        assert!((loss(1.5, 2.0).loss + 2.4).abs() < 1e-6);
        assert!((loss(0.5, -2.0).loss - 1.6).abs() < 1e-6);
        assert!(loss(0.5, -2.0).is_clipped);
        assert_eq!(
            loss(1.5, -2.0),
            Surrogate {
                loss: 3.0,
                slope: 3.0,
                is_clipped: false
            }
        );
        assert_eq!(
            loss(0.5, 2.0),
            Surrogate {
                loss: -1.0,
                slope: -1.0,
                is_clipped: false
            }
        );
        assert_eq!(
            loss(1.0, 2.0),
            Surrogate {
                loss: -2.0,
                slope: -2.0,
                is_clipped: false
            }
        );
    }

    /// c = 3, ε = 0.2: ratios between 2.4 and 3.6 are not clipped. (4, 2) is clipped to 3.6·2, (1, −2)
    /// to 2.4·−2; (3.5, 2), (4, −2) and (1, 2) are not clipped.
    #[test]
    fn ppo_around_another_ratio_by_hand() {
        let loss = |ratio, advantage| ppo_around(3.0, ratio, advantage, 0.2);
        for (ratio, advantage, expected, is_clipped) in [
            (4.0, 2.0, -7.2_f32, true),
            (1.0, -2.0, 4.8, true),
            (3.5, 2.0, -7.0, false),
            (4.0, -2.0, 8.0, false),
            (1.0, 2.0, -2.0, false),
        ] {
            let surrogate = loss(ratio, advantage);
            let slope = if is_clipped { 0.0 } else { expected };
            assert!((surrogate.loss - expected).abs() < 1e-5, "{surrogate:?}");
            assert_eq!((surrogate.slope, surrogate.is_clipped), (slope, is_clipped));
        }
    }

    /// ρ = 4, A = 2, log π = −0.5: derivative −8 and loss 4; with ρ capped at 1, −2 and 1.
    #[test]
    fn off_pac_by_hand() {
        assert_eq!(
            off_pac(-0.5, 4.0, 2.0, None),
            Surrogate {
                loss: 4.0,
                slope: -8.0,
                is_clipped: false
            }
        );
        assert_eq!(
            off_pac(-0.5, 4.0, 2.0, Some(1.0)),
            Surrogate {
                loss: 1.0,
                slope: -2.0,
                is_clipped: false
            }
        );
    }

    proptest! {
        /// ρ = exp(log π − log μ) with log μ = −0.7. Samples with ρ near 1 ± ε are skipped, because
        /// the loss of PPO is not differentiable there.
        #[test]
        fn slopes_agree_with_central_differences(log_prob in -3.0_f32..0.0, advantage in -4.0_f32..4.0, clip in 0.05_f32..0.9) {
            let ratio = |log_prob: f32| (log_prob + 0.7).exp();
            prop_assume!((ratio(log_prob) - 1.0 - clip).abs() > 0.02 && (ratio(log_prob) - 1.0 + clip).abs() > 0.02);
            let h = 1e-3;
            let numeric = |loss: &dyn Fn(f32) -> f32| (loss(log_prob + h) - loss(log_prob - h)) / (2.0 * h);
            let ppo_loss = ppo(ratio(log_prob), advantage, clip);
            prop_assert!((numeric(&|x| ppo(ratio(x), advantage, clip).loss) - ppo_loss.slope).abs() < 2e-2);
            let around = |x: f32, center| ppo_around(center, ratio(x), advantage, clip);
            let center = 1.5;
            let [low, high] = [center * (1.0 - clip), center * (1.0 + clip)];
            if (ratio(log_prob) - low).abs() > 0.02 && (ratio(log_prob) - high).abs() > 0.02 {
                let slope = around(log_prob, center).slope;
                prop_assert!((numeric(&|x| around(x, center).loss) - slope).abs() < 2e-2);
            }
            prop_assert!((numeric(&|x| simple(x, advantage).loss) - simple(log_prob, advantage).slope).abs() < 2e-2);
            let constant = ratio(log_prob);
            let slope = off_pac(log_prob, constant, advantage, None).slope;
            prop_assert!((numeric(&|x| off_pac(x, constant, advantage, None).loss) - slope).abs() < 5e-2);
        }
    }
}
