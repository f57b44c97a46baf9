//! What the runs of a study say: their results, comparisons, verdicts on claims, costs, and whether they are those that were
//! registered.

pub mod agreement;
mod audit;
pub mod claims;
pub mod comparison;
pub mod completeness;
pub mod cost;
pub mod gate;
pub mod prediction;
pub mod published;
mod read;
pub mod results;
pub(in crate::study) mod rows;
pub mod rules;
pub mod scaling;
pub mod score;
mod ties;

pub(in crate::study) use rows::column;
