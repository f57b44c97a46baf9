//! Many runs: what they come to together, and what may be said of it.
//!
//! [`mod@file`] is what a researcher writes, with its [`figure`]s, [`plan`] and [`course`] what it comes to, [`runner`] runs what is still missing, [`store`] keeps it,
//! [`comparison`] and [`claims`] say what it shows, and [`report`] puts that on a page. The unit is a whole team run; agents and episodes
//! of one run share their fate and are no repeats. Rules of training may not enter.

pub mod build;
pub mod claims;
pub mod comparison;
pub mod course;
pub mod figure;
pub mod file;
pub mod finite;
pub mod measure;
pub mod measured;
pub mod plan;
pub mod report;
pub mod results;
pub mod runner;
pub mod statistics;
pub mod store;
