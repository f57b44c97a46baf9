//! Environments of Gymnasium as tasks: `Gymnasium(id: "CartPole-v1")`.
//!
//! Python runs in worker processes, each of which has some copies of the environment: a crash or a
//! hanging step ends a worker, not the program. `file` has the settings, `task` what a checked file
//! becomes, `worker` the process, `messages` what is exchanged with it, `found` what is not in
//! the file and therefore asked from the environment once, and `environment` the copies. The worker's own program is
//! `worker.py`, which the Python package has as `seedbed.worker`.
//!
//! Each episode begins with `reset(seed=…)`, drawn from the stream of start states: if episodes
//! depend on nothing else, bits do not depend on the number of workers or on interruptions.

mod environment;
mod failure;
mod file;
mod found;
mod messages;
#[cfg(not(unix))]
mod no_worker;
mod notice;
mod pictures;
mod python;
mod task;
mod waiting;
#[cfg(unix)]
mod worker;
mod worker_error;

#[cfg(not(unix))]
use self::no_worker as worker;

pub use self::environment::check_start;
pub use self::failure::{EnvironmentFailure, catch_failure};
pub use self::file::{DiscreteObservations, GymnasiumFile, is_complete};
pub use self::found::{Found, FoundAction, FoundObservation};
pub use self::notice::set_notice;
pub use self::pictures::{PictureSource, PictureTaken};
pub use self::python::{named_python, python, set_python};
pub use self::task::{ADD_TIME_LIMIT, GymnasiumTask, parse};
pub use self::waiting::time_waited;

pub(crate) use self::environment::GymnasiumEnvironment;
pub(crate) use self::file::settings;
