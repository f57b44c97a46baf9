//! Teams that know their task's tables: model-based seed sampling and its controls (Dimakopoulou &
//! Van Roy 2018, "Coordinated Exploration in Concurrent Reinforcement Learning", arXiv 1802.01282;
//! thesis §2.3).
//!
//! All agents share one [`belief`], which takes in every transition the moment that it happens.
//! Before an agent acts, it makes of the belief one MDP, by its own fixed [`seed`] or as another
//! [`algorithm`] says, and follows the best policy of that MDP, found by backward induction
//! ([`plan`]). [`team`] is the loop. Networks may not enter.

pub mod algorithm;
pub mod belief;
pub mod plan;
pub mod recording;
pub mod results;
pub mod run;
pub mod scenario;
pub mod seed;
mod shelf;
pub mod team;
mod turn;

pub use algorithm::Algorithm;
pub use run::TabularPlan;
pub use scenario::TabularScenario;
