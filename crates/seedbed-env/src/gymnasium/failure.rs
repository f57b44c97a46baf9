//! What ends a round because an environment cannot go on.
//!
//! Steps return no errors. An environment that cannot go on unwinds the stack with an
//! [`EnvironmentFailure`], as work that is cancelled does; [`catch_failure`] makes an error of it.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// Why an environment cannot go on: its worker died, raised an error or did not answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EnvironmentFailure {
    /// The copy; `None` if it is unknown which.
    pub copy: Option<usize>,
    /// Agent and episode, as far as they are known.
    pub place: String,
    /// What happened, with the last lines of Python's traceback.
    pub message: String,
}

impl fmt::Display for EnvironmentFailure {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.place.is_empty() {
            write!(formatter, "{}: ", self.place)?;
        }
        formatter.write_str(&self.message)
    }
}

impl std::error::Error for EnvironmentFailure {}

impl EnvironmentFailure {
    /// Unwinds the stack up to [`catch_failure`]. Not a panic: no message is printed.
    pub fn unwind(self) -> ! {
        resume_unwind(Box::new(self))
    }
}

/// The result of `work`, which steps environments. What `work` changed must not be used after an
/// error.
///
/// # Errors
/// An environment cannot go on.
pub fn catch_failure<T>(work: impl FnOnce() -> T) -> Result<T, EnvironmentFailure> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|payload| {
        let failure = payload.downcast::<EnvironmentFailure>();
        *failure.unwrap_or_else(|other| resume_unwind(other))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_becomes_an_error_and_panics_stay_panics() {
        let failure = EnvironmentFailure {
            copy: Some(2),
            place: "agent 2, episode 7".to_owned(),
            message: "ValueError: no".to_owned(),
        };
        let caught = catch_failure(|| failure.clone().unwind());
        assert_eq!(
            caught.unwrap_err().to_string(),
            "agent 2, episode 7: ValueError: no"
        );
        assert_eq!(catch_failure(|| 5), Ok(5));
        let other = catch_unwind(|| catch_failure(|| resume_unwind(Box::new(3))));
        let other: Result<Result<(), _>, _> = other;
        assert_eq!(other.unwrap_err().downcast_ref(), Some(&3));
    }
}
