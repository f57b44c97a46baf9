//! Why a worker gives no answer.

use std::time::Duration;

use super::messages::PythonError;
use super::python::python;

/// Why a worker gives no answer.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum WorkerError {
    /// Python cannot be started.
    NoPython(String),
    /// An error of the environment or of Gymnasium.
    Python(PythonError),
    /// The process has ended, or sends what it should not.
    Ended(String),
    /// No answer in time.
    Timeout(Duration),
}

impl WorkerError {
    /// The copy that the error is about.
    pub(super) fn copy(&self) -> Option<usize> {
        match self {
            Self::Python(error) => error.copy,
            _ => None,
        }
    }

    /// What happened, with the end of Python's traceback.
    pub(super) fn message(&self) -> String {
        match self {
            Self::NoPython(message) | Self::Ended(message) => message.clone(),
            Self::Timeout(timeout) => format!(
                "no answer within {} s (`step_timeout`); the worker process was ended",
                timeout.as_secs_f64()
            ),
            Self::Python(PythonError {
                message, traceback, ..
            }) => match traceback.as_deref().map(str::trim_end) {
                Some(traceback) if !traceback.is_empty() => {
                    format!("{message}\n{}", indented(traceback))
                }
                _ => message.clone(),
            },
        }
    }

    /// What to do.
    pub(super) fn help(&self) -> Option<String> {
        match self {
            Self::NoPython(_) => Some(
                "name an interpreter that has Gymnasium with `--python` or SEEDBED_PYTHON"
                    .to_owned(),
            ),
            Self::Python(error) => error.help.as_ref().map(|help| {
                let python = python();
                format!(
                    "{help} (Python is {}; `--python` or SEEDBED_PYTHON names another)",
                    python.display()
                )
            }),
            Self::Timeout(_) | Self::Ended(_) => None,
        }
    }
}

/// The text with four spaces before each line.
pub(super) fn indented(text: &str) -> String {
    let lines = text.lines().map(|line| format!("    {line}"));
    lines.collect::<Vec<_>>().join("\n")
}
