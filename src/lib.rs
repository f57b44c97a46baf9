//! A workbench for coordinated exploration in concurrent reinforcement learning.
//!
//! K agents act at once in K copies of one environment, share what they see, and explore
//! differently because each carries its own fixed random seed. Data flows one way:
//!
//! ```text
//! scenario.ron → Scenario → environments + team → rounds of concurrent episodes → shared buffer
//!   → each agent's update → measures + state visitation → recorder (run.rrd, tables) → report
//! ```
//!
//! and so do the modules' dependencies: [`cli`] → [`study`] → [`tabular`] → [`run`] → [`scenario`]
//! → [`record`] → [`learn`], [`figure`], [`stats`] → [`mod@env`]. `ARCHITECTURE.md` is the map.

pub mod cli;
pub mod plotting;
pub mod record;
pub mod run;
pub mod scenario;
pub mod study;
pub mod tabular;
pub mod text;

pub use {
    seedbed_env as env, seedbed_figure as figure, seedbed_learn as learn, seedbed_stats as stats,
};
