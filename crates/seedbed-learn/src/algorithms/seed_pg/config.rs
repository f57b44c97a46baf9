//! The configuration of Seed-PG: what can be chosen, the defaults, and which choices contradict
//! each other.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::SeedPgAgent;
use crate::agent::curiosity::Bonus;
use crate::agent::policy::ActionSelection;
use crate::agent::scaling::ObservationScaling;
use crate::algorithms::{AlgorithmConfig, ScheduleError, ScheduleKind};
use crate::nn::AdamSettings;
use crate::team::{IndependentLearners, Team, TeamContext};
use seedbed_env::input::numbers::{
    Count, Fraction, NonNegative, Positive, PositiveFraction, known, known_count,
};
use seedbed_env::input::{Located, ValidationError};

/// The configuration of Seed-PG. The defaults are those of §5 of the thesis where it states them.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SeedPg {
    /// Whose trajectories the value function learns from.
    pub value_data: Data,
    /// Whose trajectories the policy learns from.
    pub policy_data: Data,
    /// How many of the other agents' trajectories an agent learns from.
    pub sharing: Sharing,
    /// Target of the value function.
    pub value_target: Located<ValueTarget>,
    /// Estimate of advantages.
    pub advantage: Located<AdvantageEstimate>,
    /// Whether advantages are standardized.
    pub standardise: Standardization,
    /// Loss of the policy.
    pub policy_loss: Located<PolicyLoss>,
    /// Weight of the policy's entropy, nats, in its loss.
    pub entropy_bonus: NonNegative,
    /// How targets of the value function are normalized.
    pub returns: ReturnNormalisation,
    /// Discount factor γ.
    pub discount: Fraction,
    /// Whether the time limit counts as the end of an episode.
    pub time_limit: TimeLimit,
    /// How observations enter the networks.
    pub observations: ObservationScaling,
    /// How actions are chosen.
    pub actions: Located<ActionSelection>,
    /// Numbers of units of the hidden layers, the same for both networks.
    pub hidden: Located<Vec<Count<4096>>>,
    /// Number of passes over the data of a round.
    pub epochs: Count<10_000>,
    /// What one gradient step is computed from.
    pub minibatch: Minibatch,
    /// Maximal norm of each network's gradient.
    pub gradient_clip: Option<Positive>,
    /// How both step sizes change from round to round.
    pub step_size_schedule: StepSizeSchedule,
    /// Weight λ of the pull of both networks back to their initial parameters θ̂ and φ̂.
    pub regularisation: NonNegative,
    /// Initial standard deviation of continuous actions, as a share of half their range.
    pub initial_deviation: Positive,
    /// Factor on the initial parameters of the policy's output layer.
    pub policy_scale: NonNegative,
    /// Factor on the initial parameters of the value function's output layer.
    pub value_scale: NonNegative,
    /// The policy's optimizer.
    pub policy_optimiser: AdamSettings,
    /// The value function's optimizer.
    pub value_optimiser: AdamSettings,
    /// Bonus that is added to rewards.
    pub bonus: Located<Bonus>,
}

/// Whose trajectories are learned from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Data {
    /// Those of the whole team.
    Shared,
    /// The agent's own.
    Own,
}

/// How many of the others' trajectories a round brings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Sharing {
    /// Every one: an agent's work grows with the team.
    All,
    /// A few drawn at random, again for each agent and round: an agent's work is the same in any
    /// team.
    Sampled {
        /// How many, besides the agent's own.
        trajectories: Count,
    },
}

/// What the value function is regressed on.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ValueTarget {
    /// The return of the trajectory (thesis Eq. 1), importance-sampled (Eq. 11, 12, 13, 17, 18).
    MonteCarlo {
        /// Which ratios weigh which rewards.
        #[serde(default)]
        importance: Importance,
        /// Cap of each product of ratios; `None` as the thesis prints it.
        #[serde(default = "default_cap")]
        ratio_product_cap: Option<Positive>,
    },
    /// rₜ₊₁ + γ v(sₜ₊₁) (thesis Eq. 2), the error weighed by ρₜ (Eq. 14, 19).
    Td {
        /// Whether ρₜ weighs the error.
        #[serde(default)]
        importance: Importance,
        /// Cap of the weight; `None` as the thesis prints it.
        #[serde(default = "default_cap")]
        ratio_cap: Option<Positive>,
    },
    /// The λ-return that belongs to generalized advantage estimation.
    Gae {
        /// Trace parameter λ.
        #[serde(default = "default_lambda")]
        lambda: Fraction,
    },
    /// V-trace (Espeholt et al. 2018).
    VTrace(VTrace),
}

/// The numbers of V-trace.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VTrace {
    /// Trace parameter λ.
    pub lambda: Fraction,
    /// Cap ρ̄ of importance ratios.
    pub ratio_cap: Positive,
    /// Cap c̄ of traces.
    pub trace_cap: Positive,
}

/// Which ratios weigh which rewards.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Importance {
    /// Those up to the reward (thesis Eq. 12, 18).
    #[default]
    PerDecision,
    /// Those of the whole rest of the trajectory (thesis Eq. 11).
    Ordinary,
    /// None: the trajectory counts as the agent's own (thesis Eq. 1, 2).
    Off,
}

/// How much better than expected an action was.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum AdvantageEstimate {
    /// A return minus a baseline. The return is that of a `MonteCarlo` value target, or else the
    /// per-decision return with each product of ratios bounded by 1.
    MonteCarlo {
        /// How often the ratio of the action itself counts.
        #[serde(default)]
        importance: RatioCount,
        /// What is subtracted (thesis §1.5.1).
        #[serde(default)]
        baseline: Baseline,
    },
    /// The sum of TD errors to the end of a segment (thesis Eq. 6).
    NStep {
        /// Number of steps Λ of a segment.
        segment: Count,
    },
    /// Generalized advantage estimation (Schulman et al. 2016).
    Gae {
        /// Trace parameter λ.
        #[serde(default = "default_lambda")]
        lambda: Fraction,
    },
    /// The same with traces cut by min(1, ρ) (Munos et al. 2016).
    Retrace {
        /// Trace parameter λ.
        #[serde(default = "default_lambda")]
        lambda: Fraction,
    },
    /// r + γ vs' − v with V-trace's targets vs (Espeholt et al. 2018).
    VTrace(VTrace),
}

/// How often the ratio of the action itself counts in the policy's loss.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum RatioCount {
    /// Once, in the loss: A = rₜ₊₁ + `z_{k,t+1}` + γ G̃ₜ₊₁ − v(sₜ).
    #[default]
    Single,
    /// In the loss and in the return, as printed: A = G̃ₜ − v(sₜ).
    Double,
}

/// What is subtracted from a return (thesis §1.5.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Baseline {
    /// v(sₜ).
    #[default]
    Value,
    /// The mean return over the trajectory.
    Mean,
    /// Nothing: REINFORCE in its plain form.
    Off,
}

/// Over what advantages are brought to mean 0 and deviation 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Standardization {
    /// They stay as they are.
    Off,
    /// Over each trajectory.
    PerTrajectory,
    /// Over each minibatch.
    PerMinibatch,
}

/// Loss of the policy.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum PolicyLoss {
    /// −min(ρA, clip(ρ, 1−ε, 1+ε) A) (thesis Eq. 8, 16, 21, 23).
    Ppo {
        /// Clipping range ε.
        #[serde(default = "default_clip")]
        clip: NonNegative,
        /// What is clipped where an action has several components.
        #[serde(default)]
        clipping: Clipping,
    },
    /// −log π A (thesis Eq. 7, 20). Sound on the agent's own newest episodes only.
    SimplePg,
    /// −ρ log π A, ρ held constant (thesis Eq. 15, 22).
    OffPac {
        /// Cap of ρ; `None` as the thesis prints it.
        #[serde(default)]
        ratio_cap: Option<Positive>,
    },
}

/// What is clipped where an action has several components.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Clipping {
    /// The ratio of the whole action.
    #[default]
    Joint,
    /// The ratio of each component, the losses being summed (Han & Sung 2019, the thesis's
    /// reference 16).
    DimensionWise,
}

/// How targets of the value function are normalized.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ReturnNormalisation {
    /// By running moments (thesis Alg. 1).
    PopArt {
        /// Step size β of the running moments per minibatch.
        #[serde(default = "default_beta")]
        beta: PositiveFraction,
    },
    /// They are not normalized.
    Raw,
}

/// Whether a time limit counts as an end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum TimeLimit {
    /// Yes: nothing follows the last step.
    Ends,
    /// No: the value of the last state stands for what would have followed.
    Bootstraps,
}

/// What one gradient step is computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Minibatch {
    /// One trajectory, whose ratios, returns and advantages are computed afresh.
    Trajectory,
    /// So many steps drawn from all trajectories; returns and advantages are computed once an
    /// epoch.
    Steps(Count),
}

/// How step sizes change.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum StepSizeSchedule {
    /// They stay the same.
    Constant,
    /// Linearly over the first rounds, then not any more.
    Linear {
        /// Number of rounds that the change takes.
        rounds: Count,
        /// Final step size, as a share of the first.
        to: NonNegative,
    },
}

impl AlgorithmConfig for SeedPg {
    fn build(&self, context: &TeamContext<'_>) -> Box<dyn Team> {
        IndependentLearners::build(context, |agent| SeedPgAgent::new(self, agent))
    }

    fn check(&self) -> Result<(), ValidationError> {
        self.check_policy_loss()?;
        self.check_value_target()?;
        self.check_advantage()?;
        self.check_actions()?;
        if self.hidden.is_empty() {
            return Err(self
                .hidden
                .error("names no layer; expected at least one, such as `hidden: [32, 32]`"));
        }
        Ok(())
    }

    fn check_schedule(&self, schedule: ScheduleKind) -> Result<(), ScheduleError> {
        match schedule {
            ScheduleKind::Lockstep => Err(ScheduleError::Algorithm(
                "learns from whole episodes, not in the middle of one; expected \
                 `schedule: Synchronous(…)` or `Asynchronous(…)`, or a value-based algorithm: \
                 `QLearning(…)`, `SeedTd(…)`, `BootstrappedDqn(…)`",
            )),
            ScheduleKind::Asynchronous if self.bonus.is_shared() => {
                Err(ScheduleError::Parameter(self.bonus.error(
                    "a shared model is the same for all agents only where all learn at the same \
                     time; expected `schedule: Synchronous(…)`, or `model: Independent`",
                )))
            }
            ScheduleKind::Asynchronous | ScheduleKind::Synchronous => Ok(()),
        }
    }

    fn select_actions(&mut self, selection: ActionSelection) {
        self.actions = selection.into();
    }

    fn bonus(&self) -> Option<&Bonus> {
        Some(&self.bonus)
    }

    fn estimates_advantages(&self) -> bool {
        true
    }

    fn cost_per_step(&self, agents: u32) -> f64 {
        let sources = match self.policy_data {
            Data::Shared => f64::from(agents),
            Data::Own => 1.0,
        };
        let curiosity = if self.bonus.largest().is_some() {
            20.0
        } else {
            0.0
        };
        f64::from(self.epochs.get()) * sources + curiosity
    }
}

impl SeedPg {
    fn check_policy_loss(&self) -> Result<(), ValidationError> {
        let newest_own = self.policy_data == Data::Own
            && self.epochs.get() == 1
            && self.minibatch == Minibatch::Trajectory;
        if *self.policy_loss == PolicyLoss::SimplePg && !newest_own {
            return Err(self.policy_loss.error(
                "`SimplePg` is sound only with `policy_data: Own`, `epochs: 1` and `minibatch: Trajectory`: it does not weigh samples by \
                 how likely the policy is to act so",
            ));
        }
        Ok(())
    }

    fn check_value_target(&self) -> Result<(), ValidationError> {
        let error = |message: &str| Err(self.value_target.error(message));
        match (*self.value_target, self.value_data) {
            (
                ValueTarget::MonteCarlo {
                    importance: Importance::Off,
                    ..
                }
                | ValueTarget::Td {
                    importance: Importance::Off,
                    ..
                },
                Data::Shared,
            ) => error(
                "`importance: Off` takes trajectories as the agent's own; expected `PerDecision`, or `value_data: Own`",
            ),
            (
                ValueTarget::Td {
                    importance: Importance::Ordinary,
                    ..
                },
                _,
            ) => error("one step has one ratio; expected `importance: PerDecision` or `Off`"),
            (ValueTarget::Gae { .. }, Data::Shared) => error(
                "`Gae` takes trajectories as the agent's own; expected `VTrace`, which is the same there, or `value_data: Own`",
            ),
            _ => Ok(()),
        }
    }

    fn check_advantage(&self) -> Result<(), ValidationError> {
        let error = |message: &str| Err(self.advantage.error(message));
        let unweighed = matches!(
            *self.value_target,
            ValueTarget::MonteCarlo {
                importance: Importance::Off,
                ..
            }
        );
        match (*self.advantage, self.policy_data) {
            (AdvantageEstimate::Gae { .. }, Data::Shared) => error(
                "`Gae` takes trajectories as the agent's own; expected `Retrace`, which is the same there, or `policy_data: Own`",
            ),
            (AdvantageEstimate::NStep { segment }, Data::Shared) if segment.get() > 1 => error(
                "`NStep` takes trajectories as the agent's own; expected `segment: 1`, `Retrace`, or `policy_data: Own`",
            ),
            (AdvantageEstimate::MonteCarlo { .. }, Data::Shared) if unweighed => error(
                "takes the value target's return, which is `importance: Off`; expected `PerDecision` there, or `policy_data: Own`",
            ),
            _ => Ok(()),
        }
    }

    fn check_actions(&self) -> Result<(), ValidationError> {
        let plain_target = matches!(
            *self.value_target,
            ValueTarget::MonteCarlo {
                importance: Importance::Off,
                ..
            } | ValueTarget::Td {
                importance: Importance::Off,
                ..
            } | ValueTarget::Gae { .. }
        );
        if *self.actions == ActionSelection::Greedy
            && !(plain_target && *self.policy_loss == PolicyLoss::SimplePg)
        {
            return Err(self.actions.error(
                "greedy actions have no likelihood to weigh samples by; expected `Sampled` or `Tempered`, or `policy_loss: SimplePg` with \
                 an unweighed `value_target`",
            ));
        }
        Ok(())
    }
}

impl Default for SeedPg {
    fn default() -> Self {
        Self {
            value_data: Data::Shared,
            policy_data: Data::Shared,
            sharing: Sharing::All,
            value_target: ValueTarget::MonteCarlo {
                importance: Importance::PerDecision,
                ratio_product_cap: default_cap(),
            }
            .into(),
            advantage: AdvantageEstimate::MonteCarlo {
                importance: RatioCount::Single,
                baseline: Baseline::Value,
            }
            .into(),
            standardise: Standardization::Off,
            policy_loss: PolicyLoss::Ppo {
                clip: default_clip(),
                clipping: Clipping::Joint,
            }
            .into(),
            entropy_bonus: known(0.0),
            returns: ReturnNormalisation::PopArt {
                beta: default_beta(),
            },
            discount: known(0.99),
            time_limit: TimeLimit::Ends,
            observations: ObservationScaling::Raw,
            actions: ActionSelection::Sampled.into(),
            hidden: vec![known_count(32); 2].into(),
            epochs: known_count(1),
            minibatch: Minibatch::Trajectory,
            gradient_clip: None,
            step_size_schedule: StepSizeSchedule::Constant,
            regularisation: known(0.0),
            initial_deviation: known(0.5),
            policy_scale: known(1.0),
            value_scale: known(1.0),
            policy_optimiser: AdamSettings::default(),
            value_optimiser: AdamSettings::default(),
            bonus: Bonus::None.into(),
        }
    }
}

impl Default for VTrace {
    fn default() -> Self {
        Self {
            lambda: known(1.0),
            ratio_cap: known(1.0),
            trace_cap: known(1.0),
        }
    }
}

impl StepSizeSchedule {
    /// The factor on step sizes in `round`.
    #[must_use]
    pub fn factor(self, round: u32) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Linear { rounds, to } => {
                let done = (f64::from(round) / f64::from(rounds.get())).min(1.0);
                1.0 + done * (to.get() - 1.0)
            }
        }
    }
}

#[expect(
    clippy::unnecessary_wraps,
    reason = "serde wants the default in the field's own type"
)]
fn default_cap() -> Option<Positive> {
    Some(known(1.0))
}

fn default_clip() -> NonNegative {
    known(0.2)
}

fn default_beta() -> PositiveFraction {
    known(0.1)
}

fn default_lambda() -> Fraction {
    known(0.95)
}
