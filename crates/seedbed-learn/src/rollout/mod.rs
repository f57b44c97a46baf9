//! Rollouts: the episodes that agents are playing, step by step, whoever steps their environments.
//!
//! [`ActingAgents`] choose the actions of a group of agents and add them to the episodes;
//! [`AgentRound`] has the episodes of an agent's round, and passes their transitions to a team that
//! learns from them. Must not depend on environments.

mod acting;
mod agent_round;

pub use acting::{ActingAgents, GroupStep, Player};
pub use agent_round::AgentRound;
