//! Facts of a run: what is measured in each episode and round, and the results in a few numbers.
//! Training makes them, recorders and readers of finished runs read them.

pub mod metrics;
pub mod returns;
mod rows;
mod state_quantity;
mod summary;

pub use self::metrics::RoundRow;
pub use self::returns::FINAL_WINDOW;
pub use self::rows::{EpisodeDetails, EpisodeRow};
pub use self::state_quantity::StateQuantity;
pub use self::summary::{SolvedAt, Summary};
