//! Many runs: what they come to together, and what may be said of it.
//!
//! The unit is a whole team run; agents and episodes of one run share their fate and are no repeats. Rules of training may not
//! enter.

pub mod statistics;
