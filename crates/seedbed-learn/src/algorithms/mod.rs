//! The algorithms that a scenario can name.
//!
//! An algorithm is one file (or folder) with its configuration, which implements
//! [`AlgorithmConfig`], and one line in the list [below](Algorithm). Everything else derives from
//! these two: how scenarios are read and checked, how teams are built, what `seedbed list` shows.

pub mod catalog;
pub mod cross_entropy;
pub mod leader_followers;
pub mod random;
pub mod seed_pg;
pub mod seed_psrl;
pub mod seed_sac;
mod tensor_metadata;
pub mod value_based;

use serde::{Deserialize, Serialize};

use crate::agent::TeamConfig;
use crate::agent::action_selection::ActionSelection;
use crate::agent::bonus::Bonus;
use crate::agent::network_info::{NetworkInfo, PlannerInfo};
use crate::team::{Team, TeamContext};
use seedbed_env::TaskSpec;
use seedbed_input::numbers::Count;
use seedbed_input::{Located, ValidationError};

/// Which random actions agents take, by which the baselines of tasks of exploration are told apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RandomActions {
    /// Whether their noise is correlated over the steps of an episode.
    pub are_correlated: bool,
    /// Whether actions do not depend on what is seen, so that nothing is learned.
    pub are_open_loop: bool,
}

/// What the configuration of an algorithm provides. Its parameters are documented by the doc
/// comments of its fields.
pub trait AlgorithmConfig {
    /// Builds a team that has not learned yet. Called with a task that passed
    /// [`check_task`](Self::check_task).
    fn build(&self, context: &TeamContext<'_>) -> Box<dyn Team>;

    /// Checks that the values of different parameters fit together.
    ///
    /// # Errors
    /// Names the parameter, what is wrong, and what was expected.
    fn check(&self) -> Result<(), ValidationError> {
        Ok(())
    }

    /// Checks that teams can learn in this kind of schedule. By default only in synchronous rounds.
    ///
    /// # Errors
    /// Why they cannot, and what was expected.
    fn check_schedule(&self, schedule: ScheduleKind) -> Result<(), ScheduleError> {
        match schedule {
            ScheduleKind::Synchronous { .. } => Ok(()),
            ScheduleKind::Asynchronous | ScheduleKind::Lockstep => Err(ScheduleError::Algorithm(
                "learns when all agents have finished their episodes; expected \
                 `schedule: Synchronous(…)`",
            )),
        }
    }

    /// Checks that agents can have what a scenario says of the team.
    ///
    /// # Errors
    /// Names the parameter, what is wrong, and what was expected.
    fn check_team(&self, _team: &TeamConfig) -> Result<(), ValidationError> {
        Ok(())
    }

    /// Whether nothing but rewards can change the policy, so that agents learn nothing before the
    /// first reward.
    fn learns_from_rewards_only(&self) -> bool {
        false
    }

    /// Checks that agents can act in a task.
    ///
    /// # Errors
    /// What the task's actions are, and what was expected.
    fn check_task(&self, _task: &TaskSpec) -> Result<(), String> {
        Ok(())
    }

    /// Changes how actions are chosen, for example to evaluate greedy policies.
    fn set_action_selection(&mut self, _selection: ActionSelection) {}

    /// Which random actions the agents take.
    fn random_actions(&self) -> RandomActions {
        RandomActions::default()
    }

    /// The exploration bonus; none if the algorithm has no such parameter.
    fn bonus(&self) -> Option<&Bonus> {
        None
    }

    /// Maximal number of transitions in the replay buffer; none if the algorithm has no such parameter.
    fn replay(&self) -> Option<&Located<Count<100_000_000>>> {
        None
    }

    /// Number of the team's newest transitions that the shared buffer must keep after all agents
    /// have learned from them.
    fn transitions_kept(&self) -> u64 {
        self.bonus().map_or(0, Bonus::transitions_kept)
    }

    /// How the networks of a team of `agents` are evaluated, for readers of its
    /// [tensors](Team::tensors); none if it has no networks.
    fn network_info(&self, _task: &TaskSpec, _agents: usize) -> Option<NetworkInfo> {
        None
    }

    /// The model in which agents plan, for readers of its tensors; none if they do not plan.
    fn planner_info(&self, _task: &TaskSpec) -> Option<PlannerInfo> {
        None
    }

    /// Whether updates can return advantages.
    fn estimates_advantages(&self) -> bool {
        false
    }

    /// Approximate number of bytes that a team of `agents` needs for its networks, with all that a
    /// checkpoint copies of them, and for the experience that they learn from, of at most `steps` steps
    /// of the team. Used only to refuse runs that a machine cannot hold.
    fn memory(&self, _task: &TaskSpec, _agents: u32, _steps: u64) -> u64 {
        0
    }

    /// Approximate cost of learning per step of an agent, in units of the cost of acting. Used only
    /// to order the runs of a study and to estimate the remaining time.
    fn cost_per_step(&self, agents: u32) -> f64;
}

/// The kinds of schedules that a scenario can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScheduleKind {
    /// All agents learn when all have finished their episodes.
    Synchronous {
        /// Number of episodes of each agent in a round.
        episodes: u32,
    },
    /// Each agent learns when its own episode ends, while the others continue.
    Asynchronous,
    /// All agents learn every few steps, during their episodes.
    Lockstep,
}

/// Why an algorithm does not fit a schedule.
#[derive(Debug)]
pub enum ScheduleError {
    /// The algorithm cannot learn in this kind of schedule.
    Algorithm(&'static str),
    /// A parameter of the algorithm does not allow it.
    Parameter(ValidationError),
}

/// Defines the enum of all algorithms, with the only `match` over them.
macro_rules! algorithms {
    (
        configured { $($name:ident($config:ty),)* }
        without_parameters { $($plain:ident($plain_config:ty),)* }
    ) => {
        /// The algorithms, each with its configuration.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub enum Algorithm {
            $(#[doc = concat!("See [`", stringify!($config), "`].")] $name(Box<$config>),)*
            $(#[doc = concat!("See [`", stringify!($plain_config), "`].")] $plain,)*
        }

        impl Algorithm {
            /// The configuration.
            #[must_use]
            pub fn config(&self) -> &dyn AlgorithmConfig {
                match self {
                    $(Self::$name(config) => &**config,)*
                    $(Self::$plain => &<$plain_config>::DEFAULT,)*
                }
            }

            /// The name of the algorithm in scenarios.
            #[must_use]
            pub fn name(&self) -> &'static str {
                match self {
                    $(Self::$name(_) => stringify!($name),)*
                    $(Self::$plain => stringify!($plain),)*
                }
            }

            fn config_mut(&mut self) -> Option<&mut dyn AlgorithmConfig> {
                match self {
                    $(Self::$name(config) => Some(&mut **config),)*
                    $(Self::$plain => None,)*
                }
            }

            /// Every algorithm with its parameters and defaults.
            #[must_use]
            pub fn catalog() -> Vec<catalog::AlgorithmInfo> {
                vec![
                    $(catalog::AlgorithmInfo::of::<$config>(stringify!($name)),)*
                    $(catalog::AlgorithmInfo::of::<$plain_config>(stringify!($plain)),)*
                ]
            }
        }
    };
}

algorithms! {
    configured {
        SeedPg(seed_pg::config::SeedPg),
        LeaderFollowers(leader_followers::LeaderFollowers),
        QLearning(value_based::config::QLearning),
        SeedTd(value_based::config::SeedTd),
        BootstrappedDqn(value_based::config::BootstrappedDqn),
        HyperAgent(value_based::hyper_agent::HyperAgent),
        SeedSac(seed_sac::config::SeedSac),
        SeedPsrl(seed_psrl::SeedPsrl),
        CrossEntropy(cross_entropy::CrossEntropy),
        OpenLoopNoise(random::OpenLoopNoise),
    }
    without_parameters {
        Random(random::Random),
    }
}

impl Algorithm {
    /// The same algorithm with another selection of actions.
    #[must_use]
    pub fn with_actions(mut self, actions: ActionSelection) -> Self {
        if let Some(config) = self.config_mut() {
            config.set_action_selection(actions);
        }
        self
    }

    /// The largest bonus that figures show; none without a bonus.
    #[must_use]
    pub fn largest_intrinsic_reward(&self) -> Option<f32> {
        self.config().bonus()?.largest_bonus()
    }

    /// Number of the team's newest transitions that the shared buffer must keep after all agents
    /// have learned from them.
    #[must_use]
    pub fn transitions_kept(&self) -> u64 {
        self.config().transitions_kept()
    }

    /// Whether agents have intrinsic rewards that can differ, whose agreement is measured.
    #[must_use]
    pub fn compares_bonuses(&self) -> bool {
        let bonus = self.config().bonus();
        self.largest_intrinsic_reward().is_some()
            && !bonus.is_some_and(Bonus::is_same_for_all_agents)
    }
}
