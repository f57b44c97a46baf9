//! What learns: networks, formulas of reinforcement learning, agent seeds, shared experience,
//! agents and teams.
//!
//! [`Team`](team::Team) is what a training loop sees: K agents that act at once and learn from
//! shared experience. [`algorithms`] are the teams that a scenario can name. They are put together
//! from [`agent`] (policies, curiosity), [`nn`] (networks), [`rl`] (formulas), [`seed`] (what an
//! agent keeps for its whole life) and [`experience`] (episodes and the replay buffer).
//!
//! Nothing here opens a file, decides how many threads there are, reads a clock, or records.

pub mod agent;
pub mod algorithms;
pub mod experience;
pub mod nn;
pub mod rl;
pub mod seed;
pub mod team;
