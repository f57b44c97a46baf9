//! Recordings: the files of a run that show its course, for viewers and for other tools.
//!
//! [`recording`] writes `run.rrd`; in builds with the feature `rerun` it is the module `rerun`, and
//! only that module imports the Rerun SDK. [`table`] writes `episodes.csv` and `rounds.csv`, whose
//! columns are the [`metrics`](crate::run::facts::metrics). [`state_files`] reads visited states that
//! other programs recorded; [`RecordedStates`] are those or a recording. [`visitation`] computes what
//! images of visited states show. Recorders read the facts of a run; they must not depend on training.

mod common_axes;
mod live_error;
mod recorded_episode;
mod recorded_states;
#[cfg(not(feature = "rerun"))]
pub mod recording;
#[cfg(feature = "rerun")]
pub mod rerun;
pub mod state_files;
pub mod table;
pub mod visitation;

/// The module that writes and reads recordings. In builds without the feature `rerun`, another
/// module has the same interface, and its calls return errors.
#[cfg(feature = "rerun")]
pub use self::rerun as recording;
pub use common_axes::common_axes;
pub(crate) use common_axes::{difference as difference_of_quantities, other_range, widen};
pub use live_error::LiveError;
pub use recorded_episode::{ReadError, RecordedEpisode, RecordedScene};
pub use recorded_states::RecordedStates;

/// Error message of builds without the feature `rerun` when a recording is requested.
pub(crate) const UNAVAILABLE: &str = "this build of seedbed cannot write, show or read recordings: build it with the feature `rerun`, which is on by default";
