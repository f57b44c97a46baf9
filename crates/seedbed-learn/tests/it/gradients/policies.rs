//! Losses of policies. Their gradients through the network are tested beside `agent::policy`, which computes them.

use seedbed_learn::rl::policy_loss::{self, Surrogate};
use serde::Deserialize;

use super::{assert_close, check_cases, reference};

#[derive(Clone, Copy, Debug, Deserialize)]
enum Loss {
    Simple,
    Ppo { clip: f32 },
    OffPac { cap: Option<f32> },
}

impl Loss {
    fn surrogate(self, log_prob: f32, behavior: f32, advantage: f32) -> Surrogate {
        let ratio = (log_prob - behavior).exp();
        match self {
            Self::Simple => policy_loss::simple(log_prob, advantage),
            Self::Ppo { clip } => policy_loss::ppo(ratio, advantage, clip),
            Self::OffPac { cap } => policy_loss::off_pac(log_prob, ratio, advantage, cap),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PolicyLossCase {
    loss: Loss,
    log_prob: f32,
    behavior: f32,
    advantage: f32,
    value: f64,
    slope: f64,
}

#[test]
fn policy_losses_match_the_reference() {
    check_cases(&reference().policy_losses, 60, |case| {
        let &PolicyLossCase {
            loss,
            log_prob,
            behavior,
            advantage,
            ..
        } = case;
        let surrogate = loss.surrogate(log_prob, behavior, advantage);
        let name =
            |what| format!("{loss:?} at log π {log_prob}, log μ {behavior}, A {advantage}: {what}");
        assert_close(&name("loss"), &[surrogate.loss], &[case.value]);
        assert_close(&name("slope"), &[surrogate.slope], &[case.slope]);
        assert_eq!(
            surrogate.is_clipped,
            case.slope == 0.0,
            "{}",
            name("clipped")
        );
    });
}
