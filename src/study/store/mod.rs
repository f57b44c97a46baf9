//! The folder of a study: one file per stored run, marks of runs that are executed, and a description of the study.

mod folder;
mod manifest;
pub mod merge;
pub mod result_file;
pub mod run_marks;

pub(in crate::study) use folder::FIGURES;
pub use folder::{RunState, StudyFolder};
pub use manifest::{Manifest, ReadResult};
pub use result_file::StoredRun;
