//! What a study is: its file, its cells and runs, and its registration. Nothing here makes runs or reads their results.

pub mod cell;
pub mod direction;
mod drafts;
pub mod figure;
pub mod file;
mod former_digests;
pub mod lock;
pub mod plan;
pub mod power;
mod registration;
pub mod run_source;

pub(in crate::study) use drafts::{CellDraft, located_text};
pub(in crate::study) use former_digests::{FormerDigests, claims_of_today};
