//! The folder of a run: its files, their checksums, and how they are read.
//!
//! [`RunFolder`] has the paths, [`checkpoint`] the contents of a checkpoint, [`checksums`] verifies all
//! files. Must not depend on training.

pub mod checkpoint;
pub mod checksums;
mod run_folder;
mod scenario_file;
mod search;
mod summary_file;

pub use self::run_folder::{Contents, RunFolder, is_state_file};
pub use self::scenario_file::{parse_scenario, read_scenario};
pub use self::search::{run_folder, run_folders};
pub(crate) use self::summary_file::read_verified as read_verified_summary;
