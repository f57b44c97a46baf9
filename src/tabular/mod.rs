//! Tabular runs: teams that know which states, actions and transitions their task has, and explore
//! by model-based seed sampling or one of its controls (Dimakopoulou & Van Roy 2018, "Coordinated
//! Exploration in Concurrent Reinforcement Learning", arXiv 1802.01282; thesis §2.3).
//!
//! All agents share one [`belief`], which is updated with every transition as soon as it happens.
//! Before an agent acts, it derives one MDP from the belief, with its own fixed agent [`seed`] or
//! by another [`algorithm`]. It follows the optimal policy of this MDP, which the [`planner`]
//! finds. [`team`] is the loop of single actions; [`mod@run`] adds the recording and the result
//! files. Must not depend on networks.

pub mod algorithm;
pub mod belief;
mod plan_cache;
pub mod planner;
pub mod recording;
pub mod results;
pub mod run;
pub mod scenario;
pub mod seed;
pub mod team;
mod turn;

pub use algorithm::Algorithm;
pub use run::TabularPlan;
pub use scenario::TabularScenario;
