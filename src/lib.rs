//! A workbench for coordinated exploration in concurrent reinforcement learning.
//!
//! K agents act at once in K copies of one environment, share their experience, and explore
//! differently because each agent has its own fixed agent seed. Data flows in one direction:
//!
//! ```text
//! scenario.ron → Scenario → environments + team → rounds of concurrent episodes → shared buffer
//!   → each agent's update → measures + state visitation → recorder (run.rrd, tables) → report
//! ```
//!
//! Each module may depend on the modules to its right: [`study`] → [`experiment`] → [`tabular`] → [`review`]
//! → [`record`] → [`run`] → [`scenario`] → [`storage`], [`learn`], [`figure`], [`stats`] → [`mod@env`]. `ARCHITECTURE.md`
//! describes all modules.

pub mod experiment;
pub mod explore;
pub mod export;
pub mod figures;
pub mod film;
pub mod input_files;
pub mod open_loop;
pub mod plotting;
pub mod provenance;
pub mod record;
pub mod review;
pub mod run;
pub mod run_log;
pub mod salvage;
pub mod scenario;
pub mod storage;
pub mod study;
pub mod tabular;
pub mod text;

pub use {
    seedbed_env as env, seedbed_figure as figure, seedbed_input as input, seedbed_learn as learn,
    seedbed_random as random, seedbed_scene as scene, seedbed_settings as settings,
    seedbed_stats as stats,
};
