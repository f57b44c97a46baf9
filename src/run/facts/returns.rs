//! Returns at the end of a run.

/// Number of episodes per agent over which the final return is averaged.
pub const FINAL_WINDOW: usize = 25;
