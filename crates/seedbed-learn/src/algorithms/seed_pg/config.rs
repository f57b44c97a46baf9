//! The configuration of Seed-PG: parameters, defaults, and checks that parameters fit together.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common_settings::{configuration, with_common_settings};
use super::{SeedPgAgent, build_team};
use crate::agent::action_selection::ActionSelection;
use crate::agent::bonus::Bonus;
use crate::agent::network::Network;
use crate::agent::network_info::{NetworkInfo, OutputTerm, ScalingInfo, setting_text};
use crate::agent::policy;
use crate::algorithms::{AlgorithmConfig, RandomActions, ScheduleError, ScheduleKind};
use crate::nn::{Activation, AdamSettings};
use crate::scaling::ObservationScaling;
use crate::team::{Team, TeamContext};
use seedbed_env::TaskSpec;
use seedbed_input::numbers::{
    Count, Fraction, NonNegative, Positive, PositiveFraction, ranged_count, ranged_number,
};
use seedbed_input::{Located, ValidationError, short_located_list};

with_common_settings!(configuration! {
    /// Seed-PG: policy gradients from shared trajectories, with one fixed seed per agent. Defaults are
    /// those of §5 of the thesis where it states them.
    pub struct SeedPg {
        /// Whose trajectories the value function learns from.
        pub value_data: Data,
        /// Whose trajectories the policy learns from.
        pub policy_data: Data,
        /// How many of the other agents' trajectories an agent learns from.
        pub sharing: Sharing,
        /// Target that the value function is trained towards.
        pub value_target: Located<ValueTarget>,
        /// How advantages are estimated.
        pub advantage: Located<AdvantageEstimate>,
        /// Loss function of the policy.
        pub policy_loss: Located<PolicyLoss>,
        /// Weight of the policy's entropy (nats) in its loss.
        pub entropy_bonus: NonNegative,
        /// How both step sizes change from round to round.
        pub step_size_schedule: StepSizeSchedule,
        /// Weight λ of the regularization of both networks towards their initial parameters θ̂ and φ̂.
        pub regularization: NonNegative,
        /// Factor on the initial parameters of the policy's output layer.
        pub policy_scale: NonNegative,
        /// Factor on the initial parameters of the value function's output layer.
        pub value_scale: NonNegative,
    }
});

/// Whose trajectories a network learns from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Data {
    /// The trajectories of the whole team.
    Shared,
    /// The agent's own trajectories.
    Own,
}

/// Whether each agent has networks of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Networks {
    /// A policy and a value function for each agent.
    Own,
    /// One policy and one value function for the team, with a one-hot code of the agent as further
    /// inputs: only the biases of the first layer are an agent's own. All agents' losses are
    /// minimized together, each from the episodes that this agent would learn from (as in SAPG);
    /// needs `minibatch: Steps(…)`.
    Shared,
}

/// How many of the other agents' trajectories an agent learns from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Sharing {
    /// All of them: the cost of an agent's update grows with the size of the team.
    All,
    /// A random sample, drawn again for each agent and round: the cost of an agent's update does
    /// not depend on the size of the team.
    Sampled {
        /// Number of trajectories in addition to the agent's own.
        trajectories: Count,
    },
}

/// Target that the value function is trained towards.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ValueTarget {
    /// The return of the trajectory (thesis Eq. 1), importance-sampled (Eq. 11, 12, 13, 17, 18).
    MonteCarlo {
        /// Which importance ratios weight each reward.
        #[serde(default)]
        importance: Importance,
        /// Maximal product of importance ratios; `None`: no maximum, as printed in the thesis.
        #[serde(default = "default_cap")]
        ratio_product_cap: Option<Positive>,
    },
    /// One-step temporal difference rₜ₊₁ + γ v(sₜ₊₁) (thesis Eq. 2), with errors weighted by ρₜ
    /// (Eq. 14, 19).
    Td {
        /// Whether ρₜ weights the error: `PerDecision` or `Off`.
        #[serde(default)]
        importance: Importance,
        /// Maximal weight; `None`: no maximum, as printed in the thesis.
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

/// Parameters of V-trace.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VTrace {
    /// Trace parameter λ.
    pub lambda: Fraction,
    /// Maximal importance ratio ρ̄.
    pub ratio_cap: Positive,
    /// Maximal trace coefficient c̄.
    pub trace_cap: Positive,
}

/// Which importance ratios weight each reward.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Importance {
    /// The ratios of all actions up to the reward (thesis Eq. 12, 18).
    #[default]
    PerDecision,
    /// The ratios of all actions to the end of the trajectory (thesis Eq. 11).
    Ordinary,
    /// None: every trajectory is treated as the agent's own (thesis Eq. 1, 2).
    Off,
}

/// Estimate of how much better than expected an action was.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum AdvantageEstimate {
    /// Return minus baseline. With `value_target: MonteCarlo` it is the return of the value target,
    /// otherwise the per-decision return with products of ratios of at most 1.
    MonteCarlo {
        /// Whether the importance ratio of the action itself is applied once or twice.
        #[serde(default)]
        importance: RatioCount,
        /// Baseline that is subtracted from the return (thesis §1.5.1).
        #[serde(default)]
        baseline: Baseline,
    },
    /// Sum of TD errors to the end of a segment (thesis Eq. 6).
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
    /// Generalized advantage estimation with traces cut by min(1, ρ) (Munos et al. 2016).
    Retrace {
        /// Trace parameter λ.
        #[serde(default = "default_lambda")]
        lambda: Fraction,
    },
    /// rₜ₊₁ + γ vsₜ₊₁ − v(sₜ) with the targets vs of V-trace (Espeholt et al. 2018).
    VTrace(VTrace),
}

/// Whether the importance ratio of the action itself is applied once or twice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum RatioCount {
    /// Once, in the loss: A = rₜ₊₁ + `z_{k,t+1}` + γ G̃ₜ₊₁ − v(sₜ).
    #[default]
    Single,
    /// Twice, in the loss and in the return, as printed in the thesis: A = G̃ₜ − v(sₜ).
    Double,
}

/// Baseline that is subtracted from a return (thesis §1.5.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Baseline {
    /// The value function v(sₜ).
    #[default]
    Value,
    /// The mean return over the trajectory.
    Mean,
    /// None: REINFORCE in its basic form.
    Off,
}

/// Samples over which advantages are standardized to mean 0 and standard deviation 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Standardization {
    /// No standardization.
    Off,
    /// Over each trajectory.
    PerTrajectory,
    /// Over each minibatch.
    PerMinibatch,
}

/// Loss function of the policy.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum PolicyLoss {
    /// Proximal policy optimization −min(ρA, clip(ρ, 1−ε, 1+ε) A) (thesis Eq. 8, 16, 21, 23).
    Ppo {
        /// Clipping range ε.
        #[serde(default = "default_clip")]
        clip: NonNegative,
        /// Which ratio is clipped if an action has several components.
        #[serde(default)]
        clipping: Clipping,
    },
    /// Simple policy gradient −log π A (thesis Eq. 7, 20). Correct only on the agent's own newest
    /// episodes.
    SimplePg,
    /// Off-policy actor-critic −ρ log π A with constant ρ (thesis Eq. 15, 22).
    OffPac {
        /// Maximal ρ; `None`: no maximum, as printed in the thesis.
        #[serde(default)]
        ratio_cap: Option<Positive>,
    },
}

/// Which ratio is clipped if an action has several components.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Clipping {
    /// The ratio of the whole action.
    #[default]
    Joint,
    /// The ratio of each component; losses are summed (Han & Sung 2019, reference 16 of the
    /// thesis).
    DimensionWise,
}

/// How targets of the value function are normalized.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ReturnNormalization {
    /// By running moments: Pop-Art (thesis Alg. 1).
    PopArt {
        /// Step size β of the running moments per minibatch.
        #[serde(default = "default_beta")]
        beta: PositiveFraction,
    },
    /// No normalization.
    Raw,
}

/// Whether a time limit counts as the end of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum TimeLimit {
    /// Yes: no rewards follow the last step.
    Ends,
    /// No: the value of the last state is added for the rewards that would have followed.
    Bootstraps,
}

/// Samples that one gradient step is computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Minibatch {
    /// One trajectory, whose ratios, returns and advantages are computed just before the step.
    Trajectory,
    /// This number of steps, drawn from all trajectories; returns and advantages are computed once
    /// per epoch.
    Steps(Count),
}

/// How step sizes change from round to round.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum StepSizeSchedule {
    /// Step sizes are constant.
    Constant,
    /// Step sizes change linearly over the first rounds and are constant afterwards.
    Linear {
        /// Number of rounds during which step sizes change.
        rounds: Count,
        /// Final step size, as a share of the initial one.
        to: NonNegative,
    },
}

impl AlgorithmConfig for SeedPg {
    fn build(&self, context: &TeamContext<'_>) -> Box<dyn Team> {
        build_team(*self.networks, context, |agent| {
            SeedPgAgent::new(self, agent)
        })
    }

    fn check(&self) -> Result<(), ValidationError> {
        self.check_policy_loss()?;
        self.check_value_target()?;
        self.check_advantage()?;
        self.check_actions()?;
        Bonus::check(&self.bonus)?;
        self.check_networks()?;
        if self.hidden.is_empty() {
            return Err(self
                .hidden
                .error("has no layer; expected at least one, such as `hidden: [32, 32]`"));
        }
        Ok(())
    }

    fn learns_from_rewards_only(&self) -> bool {
        self.value_scale.get() == 0.0 && *self.bonus == Bonus::None
    }

    fn check_schedule(&self, schedule: ScheduleKind) -> Result<(), ScheduleError> {
        match schedule {
            ScheduleKind::Lockstep => Err(ScheduleError::Algorithm(
                "learns from whole episodes, not in the middle of one; expected \
                 `schedule: Synchronous(…)` or `Asynchronous(…)`, or a value-based algorithm: \
                 `QLearning(…)`, `SeedTd(…)`, `BootstrappedDqn(…)`",
            )),
            ScheduleKind::Asynchronous if *self.networks == Networks::Shared => {
                Err(ScheduleError::Parameter(self.networks.error(
                    "shared networks require that all agents learn at the same time; expected \
                     `schedule: Synchronous(…)`, or `Own`",
                )))
            }
            ScheduleKind::Asynchronous if self.bonus.has_shared_model() => {
                Err(ScheduleError::Parameter(self.bonus.error(
                    "a shared model requires that all agents learn at the same time; expected \
                     `schedule: Synchronous(…)`, or `model: Independent`",
                )))
            }
            ScheduleKind::Synchronous { episodes } if episodes > 1 => {
                self.check_single_gradient_step()
            }
            ScheduleKind::Asynchronous | ScheduleKind::Synchronous { .. } => Ok(()),
        }
    }

    fn random_actions(&self) -> RandomActions {
        RandomActions {
            are_correlated: self.actions.is_correlated(),
            are_open_loop: false,
        }
    }

    fn set_action_selection(&mut self, selection: ActionSelection) {
        self.actions = selection.into();
    }

    fn bonus(&self) -> Option<&Bonus> {
        Some(&self.bonus)
    }

    fn network_info(&self, task: &TaskSpec, _: usize) -> Option<NetworkInfo> {
        Some(NetworkInfo {
            models: None,
            outputs: vec![OutputTerm {
                network: "agent_{agent}.policy",
                factor: 1.0,
                skip_connection: false,
            }],
            activation: Activation::Tanh,
            heads: policy::heads(task, self.initial_deviation.get_f32()),
            action_selection: setting_text(&*self.actions),
            observation_scaling: ScalingInfo::new(self.observations, "agent_{agent}."),
            value: Some(
                "v = mean + deviation * o, with agent_{agent}.value.mean, \
                 agent_{agent}.value.deviation, and the output o of agent_{agent}.value",
            ),
            bonus: self.bonus.info(task, "agent_{agent}."),
        })
    }

    fn estimates_advantages(&self) -> bool {
        true
    }

    fn memory(&self, task: &TaskSpec, agents: u32, _steps: u64) -> u64 {
        let hidden: Vec<usize> = self
            .hidden
            .iter()
            .map(|units| units.get() as usize)
            .collect();
        let policy = policy::network_shape(task, &hidden);
        let value = super::value_shape(task, &hidden);
        let networks = [policy, value].iter().map(Network::memory).sum::<u64>();
        u64::from(agents).saturating_mul(networks + self.bonus.memory(task))
    }

    fn cost_per_step(&self, agents: u32) -> f64 {
        let sources = match self.policy_data {
            Data::Shared => f64::from(agents),
            Data::Own => 1.0,
        };
        let cost_of_bonus = if self.bonus.largest_bonus().is_some() {
            20.0
        } else {
            0.0
        };
        f64::from(self.epochs.get()) * sources + cost_of_bonus
    }
}

impl SeedPg {
    fn check_networks(&self) -> Result<(), ValidationError> {
        if *self.networks == Networks::Shared && self.minibatch == Minibatch::Trajectory {
            return Err(self.networks.error(
                "shared networks learn from the steps of all agents together; expected \
                 `minibatch: Steps(…)`, or `networks: Own`",
            ));
        }
        Ok(())
    }

    fn check_policy_loss(&self) -> Result<(), ValidationError> {
        let is_on_policy = self.policy_data == Data::Own
            && self.epochs.get() == 1
            && self.minibatch == Minibatch::Trajectory;
        if *self.policy_loss == PolicyLoss::SimplePg && !is_on_policy {
            return Err(self.policy_loss.error(
                "`SimplePg` is correct only with `policy_data: Own`, `epochs: 1` and \
                 `minibatch: Trajectory`, because it has no importance ratios",
            ));
        }
        Ok(())
    }

    /// Checks that the policy is not changed while trajectories of the same round are still to be
    /// learned from, unless the loss has importance ratios.
    fn check_single_gradient_step(&self) -> Result<(), ScheduleError> {
        if *self.policy_loss == PolicyLoss::SimplePg {
            return Err(ScheduleError::Parameter(self.policy_loss.error(
                "`SimplePg` is correct only with one episode in a round, because it has no importance \
                 ratios, and the first trajectory changes the policy; expected \
                 `schedule: Synchronous(episodes: 1)`, or `Ppo(…)`",
            )));
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
                "`importance: Off` treats all trajectories as the agent's own; expected \
                 `PerDecision`, or `value_data: Own`",
            ),
            (
                ValueTarget::Td {
                    importance: Importance::Ordinary,
                    ..
                },
                _,
            ) => error(
                "a single step has a single ratio; expected `importance: PerDecision` or `Off`",
            ),
            (ValueTarget::Gae { .. }, Data::Shared) => error(
                "`Gae` treats all trajectories as the agent's own; expected `VTrace`, which gives the \
                 same targets on own trajectories, or `value_data: Own`",
            ),
            _ => Ok(()),
        }
    }

    fn check_advantage(&self) -> Result<(), ValidationError> {
        let error = |message: &str| Err(self.advantage.error(message));
        let is_unweighted = matches!(
            *self.value_target,
            ValueTarget::MonteCarlo {
                importance: Importance::Off,
                ..
            }
        );
        match (*self.advantage, self.policy_data) {
            (AdvantageEstimate::Gae { .. }, Data::Shared) => error(
                "`Gae` treats all trajectories as the agent's own; expected `Retrace`, which gives the \
                 same advantages on own trajectories, or `policy_data: Own`",
            ),
            (AdvantageEstimate::NStep { segment }, Data::Shared) if segment.get() > 1 => error(
                "`NStep` treats all trajectories as the agent's own; expected `segment: 1`, `Retrace`, \
                 or `policy_data: Own`",
            ),
            (AdvantageEstimate::MonteCarlo { .. }, Data::Shared) if is_unweighted => error(
                "uses the return of `value_target`, which has `importance: Off`; expected \
                 `PerDecision` there, or `policy_data: Own`",
            ),
            _ => Ok(()),
        }
    }

    fn check_actions(&self) -> Result<(), ValidationError> {
        let is_unweighted_target = matches!(
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
            && !(is_unweighted_target && *self.policy_loss == PolicyLoss::SimplePg)
        {
            return Err(self.actions.error(
                "greedy actions have no importance ratios; expected `Sampled` or `Tempered`, or \
                 `policy_loss: SimplePg` with a `value_target` without importance ratios",
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
            standardize: Standardization::Off,
            policy_loss: PolicyLoss::Ppo {
                clip: default_clip(),
                clipping: Clipping::Joint,
            }
            .into(),
            entropy_bonus: ranged_number(0.0),
            returns: ReturnNormalization::PopArt {
                beta: default_beta(),
            },
            discount: ranged_number(0.99),
            time_limit: TimeLimit::Ends,
            observations: ObservationScaling::Raw,
            actions: ActionSelection::Sampled.into(),
            networks: Networks::Own.into(),
            hidden: vec![ranged_count(32); 2].into(),
            epochs: ranged_count(1),
            minibatch: Minibatch::Trajectory,
            gradient_clip: None,
            step_size_schedule: StepSizeSchedule::Constant,
            regularization: ranged_number(0.0),
            initial_deviation: ranged_number(0.5),
            policy_scale: ranged_number(1.0),
            value_scale: ranged_number(1.0),
            policy_optimizer: AdamSettings::default(),
            value_optimizer: AdamSettings::default(),
            bonus: Bonus::None.into(),
        }
    }
}

impl Default for VTrace {
    fn default() -> Self {
        Self {
            lambda: ranged_number(1.0),
            ratio_cap: ranged_number(1.0),
            trace_cap: ranged_number(1.0),
        }
    }
}

impl StepSizeSchedule {
    /// Factor on step sizes in a round.
    #[must_use]
    pub fn factor(self, round: u32) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Linear { rounds, to } => {
                let progress = (f64::from(round) / f64::from(rounds.get())).min(1.0);
                1.0 + progress * (to.get() - 1.0)
            }
        }
    }
}

#[expect(
    clippy::unnecessary_wraps,
    reason = "serde requires a default of the field's type"
)]
fn default_cap() -> Option<Positive> {
    Some(ranged_number(1.0))
}

fn default_clip() -> NonNegative {
    ranged_number(0.2)
}

fn default_beta() -> PositiveFraction {
    ranged_number(0.1)
}

fn default_lambda() -> Fraction {
    ranged_number(0.95)
}
