//! The algorithms that a scenario can name.
//!
//! An algorithm is one file (or folder) with its configuration, which implements
//! [`AlgorithmConfig`], and one line in the list [below](Algorithm). Everything else derives from
//! these two: how scenarios are read and checked, how teams are built, what `seedbed list` shows.

pub mod catalogue;
pub mod cross_entropy;
pub mod random;
pub mod seed_pg;
pub mod value_based;

use serde::{Deserialize, Serialize};

use crate::agent::curiosity::Bonus;
use crate::agent::policy::ActionSelection;
use crate::team::{Team, TeamContext};
use seedbed_env::Spec;
use seedbed_env::input::ValidationError;

/// What the configuration of an algorithm provides. Its parameters are documented by the doc
/// comments of its fields.
pub trait AlgorithmConfig {
    /// Builds a team at its seeds. Called with a task that passed
    /// [`check_task`](Self::check_task).
    fn build(&self, context: &TeamContext<'_>) -> Box<dyn Team>;

    /// Checks what no single field can tell.
    ///
    /// # Errors
    /// Names the parameter, what is wrong, and what was expected.
    fn check(&self) -> Result<(), ValidationError> {
        Ok(())
    }

    /// Checks whether teams can learn when a schedule says. By default only in synchronous rounds.
    ///
    /// # Errors
    /// Why not, and what was expected.
    fn check_schedule(&self, schedule: ScheduleKind) -> Result<(), ScheduleError> {
        match schedule {
            ScheduleKind::Synchronous => Ok(()),
            ScheduleKind::Asynchronous | ScheduleKind::Lockstep => Err(ScheduleError::Algorithm(
                "learns when all agents have finished their episodes; expected \
                 `schedule: Synchronous(…)`",
            )),
        }
    }

    /// Checks whether agents can act in a task.
    ///
    /// # Errors
    /// What the task's actions are, and what was expected.
    fn check_task(&self, _task: &Spec) -> Result<(), String> {
        Ok(())
    }

    /// Changes how actions are chosen, for evaluation.
    fn select_actions(&mut self, _selection: ActionSelection) {}

    /// What is added to rewards, if the algorithm can add anything.
    fn bonus(&self) -> Option<&Bonus> {
        None
    }

    /// Whether updates report advantages.
    fn estimates_advantages(&self) -> bool {
        false
    }

    /// Rough work of learning per step of an agent, in units of the work of acting. Only the order
    /// of runs and the remaining time are estimated from it.
    fn cost_per_step(&self, agents: u32) -> f64;
}

/// The kinds of schedules that a scenario can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScheduleKind {
    /// All agents learn when all have finished their episodes.
    Synchronous,
    /// Each agent learns when its own episode has ended, while the others continue.
    Asynchronous,
    /// All agents learn every few steps, in the middle of their episodes.
    Lockstep,
}

/// Why an algorithm cannot learn when a schedule says.
#[derive(Debug)]
pub enum ScheduleError {
    /// The algorithm cannot at all.
    Algorithm(&'static str),
    /// One of its parameters prevents it.
    Parameter(ValidationError),
}

/// The enum of all algorithms, and the one match over them.
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

            fn config_mut(&mut self) -> Option<&mut dyn AlgorithmConfig> {
                match self {
                    $(Self::$name(config) => Some(&mut **config),)*
                    $(Self::$plain => None,)*
                }
            }

            /// Every algorithm with its parameters and defaults.
            #[must_use]
            pub fn catalogue() -> Vec<catalogue::AlgorithmInfo> {
                vec![
                    $(catalogue::AlgorithmInfo::of::<$config>(stringify!($name)),)*
                    $(catalogue::AlgorithmInfo::of::<$plain_config>(stringify!($plain)),)*
                ]
            }
        }
    };
}

algorithms! {
    configured {
        SeedPg(seed_pg::config::SeedPg),
        QLearning(value_based::config::QLearning),
        SeedTd(value_based::config::SeedTd),
        BootstrappedDqn(value_based::config::BootstrappedDqn),
        CrossEntropy(cross_entropy::CrossEntropy),
    }
    without_parameters {
        Random(random::Random),
    }
}

impl Algorithm {
    /// The same with actions chosen in another way.
    #[must_use]
    pub fn with_actions(mut self, actions: ActionSelection) -> Self {
        if let Some(config) = self.config_mut() {
            config.select_actions(actions);
        }
        self
    }

    /// The largest bonus that a step can have; none without curiosity.
    #[must_use]
    pub fn largest_intrinsic_reward(&self) -> Option<f32> {
        self.config().bonus()?.largest()
    }

    /// Transitions of the team that the shared buffer has to keep after all have learned from them.
    #[must_use]
    pub fn transitions_kept(&self) -> u64 {
        self.config().bonus().map_or(0, Bonus::transitions_kept)
    }
}
