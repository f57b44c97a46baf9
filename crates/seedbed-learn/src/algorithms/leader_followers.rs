//! Leader and followers: split and aggregate policy gradients (SAPG; Singla, Agarwal & Pathak, ICML
//! 2024).
//!
//! Agent 0 is the leader. The followers, all others, learn from their own episodes only, each with
//! another weight of its entropy, so that they explore. The leader learns from its own episodes, with
//! an entropy weight of 0, and from a sample of the followers' episodes, with importance ratios: its
//! loss is L(own) + λ L(followers), where the surrogate of PPO is clipped around the ratio that the
//! leader had before the update ([`ppo_around`](crate::rl::policy_loss::ppo_around)).
//!
//! Followers may be coupled to the leader: their losses get β times the mean of −log π(a|s) over the steps of
//! the leader's newest episodes, whose gradient is that of the divergence KL(leader ‖ follower) on the states
//! that the leader visits. Coupled policy optimization (Shitanda, Omura, Harada & Osa, ICLR 2026) keeps
//! followers near the leader by a divergence, too, and adds a reward by which agents are told from each
//! other: the bonus `Discriminator`.
//!
//! With `networks: Shared` all agents share one network and differ in some of its inputs, as in SAPG; by
//! default each has networks of its own. Differences from SAPG: values are learned towards V-trace targets, where SAPG has
//! three-step returns on own and one-step returns on other episodes. λ weights each sample of the
//! followers' episodes, which are drawn whole, where SAPG draws as many steps as the leader's own.
//!
//! The result of SAPG is its leader. Measures of a team here, such as `Solved`, are means over all
//! agents, the followers included; results per agent have the leader in the rows of agent 0.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::seed_pg::common_settings::{configuration, copy_settings, with_common_settings};
use super::seed_pg::config::{
    AdvantageEstimate, Clipping, Data, Minibatch, Networks, PolicyLoss, ReturnNormalization,
    SeedPg, Sharing, Standardization, TimeLimit, VTrace, ValueTarget,
};
use super::seed_pg::{Imitation, SeedPgAgent, build_team};
use super::{AlgorithmConfig, RandomActions};
use crate::agent::action_selection::ActionSelection;
use crate::agent::bonus::Bonus;
use crate::agent::network_info::NetworkInfo;
use crate::nn::AdamSettings;
use crate::scaling::ObservationScaling;
use crate::team::{Team, TeamContext};
use seedbed_env::TaskSpec;
use seedbed_input::numbers::{Count, Fraction, NonNegative, Positive, ranged_count, ranged_number};
use seedbed_input::{Located, ValidationError, short_located_list};

with_common_settings!(configuration! {
    /// Leader and followers (SAPG, Singla, Agarwal & Pathak 2024): agent 0, the leader, also learns from
    /// episodes of the followers, which learn from their own only. SAPG has `networks: Shared`. Measures of
    /// the team are means over the leader and all followers.
    pub struct LeaderFollowers {
        /// Weight λ of the followers' steps in the leader's losses.
        pub follower_weight: NonNegative,
        /// How many of the followers' episodes of a round the leader learns from.
        pub sharing: Sharing,
        /// Weight σ of the policy's entropy (nats) in the loss of the last follower. Agent k of K has the
        /// weight σ k / (K − 1): 0 for the leader.
        pub entropy_bonus: NonNegative,
        /// Weight β of −log π of the leader's newest actions in the losses of the followers, which keeps them
        /// near the leader (coupled policy optimization, Shitanda et al. 2026); needs `minibatch: Steps(…)`.
        pub coupling: Located<NonNegative>,
        /// Clipping range ε of the importance ratio.
        pub clip: NonNegative,
        /// Trace parameter λ of advantages (Retrace) and value targets (V-trace).
        pub lambda: Fraction,
    }
});

impl Default for LeaderFollowers {
    fn default() -> Self {
        let defaults = SeedPg::default();
        Self {
            follower_weight: ranged_number(1.0),
            sharing: Sharing::Sampled {
                trajectories: ranged_count(1),
            },
            entropy_bonus: ranged_number(0.005),
            coupling: ranged_number::<NonNegative>(0.0).into(),
            clip: ranged_number(0.2),
            lambda: ranged_number(0.95),
            discount: defaults.discount,
            time_limit: TimeLimit::Bootstraps,
            standardize: Standardization::PerMinibatch,
            returns: defaults.returns,
            observations: ObservationScaling::Range,
            actions: defaults.actions,
            networks: defaults.networks,
            hidden: defaults.hidden,
            epochs: ranged_count(4),
            minibatch: Minibatch::Steps(ranged_count(64)),
            gradient_clip: defaults.gradient_clip,
            initial_deviation: defaults.initial_deviation,
            policy_optimizer: defaults.policy_optimizer,
            value_optimizer: defaults.value_optimizer,
            bonus: defaults.bonus,
        }
    }
}

/// Number of the agent that leads.
const LEADER: u32 = 0;

impl AlgorithmConfig for LeaderFollowers {
    fn build(&self, context: &TeamContext<'_>) -> Box<dyn Team> {
        let agents = context.config.count.get();
        build_team(*self.networks, context, |agent| {
            let learner = SeedPgAgent::new(&self.learner(agent.agent, agents), agent);
            if agent.agent == LEADER {
                learner.with_weight_of_others(self.follower_weight.get_f32())
            } else if self.is_coupled() {
                learner.with_imitation(Imitation {
                    agent: LEADER,
                    weight: self.coupling.get_f32(),
                })
            } else {
                learner
            }
        })
    }

    fn check(&self) -> Result<(), ValidationError> {
        if *self.actions == ActionSelection::Greedy {
            return Err(self.actions.error(
                "greedy actions have no importance ratios; expected `Sampled` or `Tempered`",
            ));
        }
        if self.is_coupled() && self.minibatch == Minibatch::Trajectory {
            return Err(self.coupling.error(
                "coupled followers learn from own and the leader's steps together; expected \
                 `minibatch: Steps(…)`",
            ));
        }
        self.learner(LEADER, 1).check()
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

    fn network_info(&self, task: &TaskSpec, agents: usize) -> Option<NetworkInfo> {
        self.learner(LEADER, 1).network_info(task, agents)
    }

    fn estimates_advantages(&self) -> bool {
        true
    }

    fn memory(&self, task: &TaskSpec, agents: u32, steps: u64) -> u64 {
        self.learner(LEADER, 1).memory(task, agents, steps)
    }

    /// The leader learns from up to as many episodes as there are agents, each follower from one or, if it is
    /// coupled, two.
    fn cost_per_step(&self, agents: u32) -> f64 {
        let of_followers = f64::from(agents.saturating_sub(1));
        let shared = match self.sharing {
            Sharing::All => of_followers,
            Sharing::Sampled { trajectories } => of_followers.min(trajectories.get().into()),
        };
        let own = self.learner(LEADER + 1, 2).cost_per_step(agents);
        let imitated = if self.is_coupled() { of_followers } else { 0.0 };
        own + f64::from(self.epochs.get()) * (shared + imitated) / f64::from(agents)
    }
}

impl LeaderFollowers {
    fn is_coupled(&self) -> bool {
        self.coupling.get() > 0.0
    }

    /// The parameters of one of `agents` agents.
    fn learner(&self, agent: u32, agents: u32) -> SeedPg {
        let data = if agent == LEADER {
            Data::Shared
        } else {
            Data::Own
        };
        let lambda = self.lambda;
        let mut learner = SeedPg {
            value_data: data,
            policy_data: data,
            sharing: self.sharing,
            value_target: ValueTarget::VTrace(VTrace {
                lambda,
                ..VTrace::default()
            })
            .into(),
            advantage: AdvantageEstimate::Retrace { lambda }.into(),
            policy_loss: PolicyLoss::Ppo {
                clip: self.clip,
                clipping: Clipping::Joint,
            }
            .into(),
            entropy_bonus: entropy_weight(self.entropy_bonus, agent, agents),
            ..SeedPg::default()
        };
        with_common_settings!(copy_settings! { self to learner: });
        learner
    }
}

/// The weight of the entropy of agent k of K: σ k / (K − 1). SAPG prints σ k, which depends on the
/// number of agents.
fn entropy_weight(largest: NonNegative, agent: u32, agents: u32) -> NonNegative {
    let last = agents.saturating_sub(1).max(1);
    ranged_number(largest.get() * f64::from(agent) / f64::from(last))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::TeamConfig;
    use crate::algorithms::seed_pg::tests::{build_team, episode_with_rewards, learn_in_round};
    use crate::experience::Episode;
    use crate::seed::RewardSeeds;
    use crate::team::AgentUpdate;

    /// K = 5, σ = 0.4: weights 0, 0.1, 0.2, 0.3, 0.4. A single agent leads.
    #[test]
    fn entropy_weights_by_hand() {
        let weights = |agents: u32| -> Vec<f64> {
            let config = LeaderFollowers {
                entropy_bonus: ranged_number(0.4),
                ..LeaderFollowers::default()
            };
            let learners = (0..agents).map(|agent| config.learner(agent, agents));
            learners
                .map(|learner| learner.entropy_bonus.get())
                .collect()
        };
        let expected = [0.0, 0.1, 0.2, 0.3, 0.4];
        let computed = weights(5);
        assert!(
            computed.len() == 5
                && computed
                    .iter()
                    .zip(expected)
                    .all(|(a, b)| (a - b).abs() < 1e-12),
            "{computed:?}"
        );
        assert_eq!(weights(1), [0.0]);
    }

    /// The updates of three agents, whose episodes have rewards of these phases.
    fn learn(config: &LeaderFollowers, phases: [f32; 3]) -> Vec<(AgentUpdate, Vec<f32>)> {
        let team = TeamConfig {
            count: ranged_count(3),
            seeds: RewardSeeds::Normal {
                sigma: ranged_number(0.0),
            }
            .into(),
            ..TeamConfig::default()
        };
        let mut team = build_team(config, &team, None);
        let episodes: Vec<Episode> = (0..)
            .zip(phases)
            .map(|(k, phase)| episode_with_rewards(k, phase))
            .collect();
        let updates = learn_in_round(&mut *team, 0..3, (&episodes, &[6; 3]), 0);
        let tensors = team.tensors();
        let parameters = |agent: u32| {
            let own = tensors
                .iter()
                .filter(|tensor| tensor.name.starts_with(&format!("agent_{agent}.")));
            own.flat_map(|tensor| tensor.values.to_vec()).collect()
        };
        updates.into_iter().zip((0..3).map(parameters)).collect()
    }

    /// Which agents learn something else if the rewards of another agent's episode are others.
    fn agents_that_notice(config: &LeaderFollowers, changed: usize) -> [bool; 3] {
        let mut phases = [0.1, 0.2, 0.3];
        let before = learn(config, phases);
        phases[changed] = 2.0;
        let after = learn(config, phases);
        [0, 1, 2].map(|agent| before[agent].1 != after[agent].1)
    }

    /// The leader learns from the episodes of all, followers from their own only. With the weight 0,
    /// the leader learns from its own only.
    #[test]
    fn only_the_leader_learns_from_others() {
        for minibatch in [Minibatch::Trajectory, Minibatch::Steps(ranged_count(4))] {
            let config = |weight| LeaderFollowers {
                follower_weight: ranged_number(weight),
                sharing: Sharing::All,
                standardize: Standardization::Off,
                returns: ReturnNormalization::Raw,
                minibatch,
                ..LeaderFollowers::default()
            };
            let noticed =
                |weight| [0, 1, 2].map(|changed| agents_that_notice(&config(weight), changed));
            assert_eq!(
                noticed(1.0),
                [
                    [true, false, false],
                    [true, true, false],
                    [true, false, true]
                ]
            );
            assert_eq!(
                noticed(0.0),
                [
                    [true, false, false],
                    [false, true, false],
                    [false, false, true]
                ]
            );
        }
    }

    /// Coupled followers learn from the leader's episode, too: from its actions, not from its rewards.
    #[test]
    fn coupled_followers_imitate_the_leader() {
        let config = |coupling| LeaderFollowers {
            coupling: ranged_number::<NonNegative>(coupling).into(),
            follower_weight: ranged_number(0.0),
            standardize: Standardization::Off,
            returns: ReturnNormalization::Raw,
            minibatch: Minibatch::Steps(ranged_count(4)),
            ..LeaderFollowers::default()
        };
        let phases = [0.1, 0.2, 0.3];
        let [with, without] = [1.0, 0.0].map(|coupling| learn(&config(coupling), phases));
        let differs = [0, 1, 2].map(|agent: usize| with[agent].1 != without[agent].1);
        assert_eq!(differs, [false, true, true]);
        assert_eq!(
            [0, 1, 2].map(|changed| agents_that_notice(&config(1.0), changed)),
            [
                [true, false, false],
                [false, true, false],
                [false, false, true]
            ]
        );
        let trajectories = LeaderFollowers {
            minibatch: Minibatch::Trajectory,
            ..config(1.0)
        };
        assert!(config(1.0).check().is_ok() && trajectories.check().is_err());
    }

    /// With shared networks, all learn from what any agent learns from: a follower's entropy, its own reward,
    /// and the weight of the leader's other steps.
    #[test]
    fn shared_networks_minimize_the_losses_of_all() {
        let config = |entropy, weight| LeaderFollowers {
            networks: Networks::Shared.into(),
            entropy_bonus: ranged_number(entropy),
            follower_weight: ranged_number(weight),
            minibatch: Minibatch::Steps(ranged_count(100)),
            ..LeaderFollowers::default()
        };
        for changed in 0..3 {
            assert_eq!(agents_that_notice(&config(0.0, 1.0), changed), [true; 3]);
        }
        let tensors = |entropy, weight| learn(&config(entropy, weight), [0.1, 0.2, 0.3]);
        let differ = |other: Vec<(AgentUpdate, Vec<f32>)>| {
            let usual = tensors(0.0, 1.0);
            [0, 1, 2].map(|agent: usize| usual[agent].1 != other[agent].1)
        };
        assert_eq!(differ(tensors(0.5, 1.0)), [true; 3]);
        assert_eq!(differ(tensors(0.0, 0.0)), [true; 3]);
        assert_eq!(differ(tensors(0.0, 1.0)), [false; 3]);
    }

    /// A sample of one has the episode of one of the two followers.
    #[test]
    fn the_leader_samples_episodes_of_followers() {
        let config = LeaderFollowers {
            returns: ReturnNormalization::Raw,
            ..LeaderFollowers::default()
        };
        let noticed = [1, 2].map(|changed| agents_that_notice(&config, changed)[0]);
        assert!(noticed[0] != noticed[1], "{noticed:?}");
    }

    /// Only followers have an entropy bonus: the leader and the team of σ = 0 learn the same.
    #[test]
    fn entropy_bonuses_change_followers_only() {
        let config = |sigma| LeaderFollowers {
            entropy_bonus: ranged_number(sigma),
            ..LeaderFollowers::default()
        };
        let phases = [0.1, 0.2, 0.3];
        let [with, without] = [0.5, 0.0].map(|sigma| learn(&config(sigma), phases));
        let differs = [0, 1, 2].map(|agent: usize| with[agent].1 != without[agent].1);
        assert_eq!(differs, [false, true, true]);
    }
}
