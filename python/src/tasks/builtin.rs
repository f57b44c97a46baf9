//! Task files: those on the disk, and those of the repository, which are built in.
//!
//! The rules are those of the command `seedbed`: an argument is a path, or a name that is looked up
//! in the nearest folder `envs` upwards and then among the built-in files. These have paths such as
//! `builtin:envs/cartpole.ron`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use pyo3::exceptions::{PyFileNotFoundError, PyIsADirectoryError};
use pyo3::prelude::*;
use seedbed_input::{BuiltinFile, DiskAndBuiltin, FileSource, is_builtin};

/// Task files on the disk, and those of the repository.
pub(super) const FILES: DiskAndBuiltin =
    DiskAndBuiltin(include!(concat!(env!("OUT_DIR"), "/builtin_tasks.rs")));

/// Folder of tasks.
const FOLDER: &str = "envs";

/// Error numbers of the operating system.
const NO_SUCH_FILE: i32 = 2;
const IS_A_DIRECTORY: i32 = 21;

/// Names of the built-in tasks that are meant for learning, sorted.
#[pyfunction]
pub(crate) fn builtin_tasks() -> Vec<&'static str> {
    let names = FILES.builtin_in(FOLDER).map(|(name, _)| name);
    names.filter(|name| !name.contains('/')).collect()
}

/// The file that an argument names.
///
/// # Errors
/// There is no such file, or it cannot be opened: a Python exception of the kind `OSError`.
pub(super) fn find(argument: &Path) -> PyResult<PathBuf> {
    if FILES.is_file(argument) {
        if !is_builtin(argument) {
            // Python has an exception for each reason why a file cannot be opened.
            std::fs::File::open(argument)?;
        }
        return Ok(argument.to_owned());
    }
    // A folder may have the name of a task, such as that of a run.
    let directory = std::env::current_dir().unwrap_or_default();
    let name = argument.to_string_lossy();
    match FILES.find(&name, FOLDER, std::slice::from_ref(&directory)) {
        Some(path) => Ok(path.strip_prefix(&directory).unwrap_or(&path).to_owned()),
        None if argument.is_dir() => Err(PyIsADirectoryError::new_err((
            IS_A_DIRECTORY,
            "expected a task file, found a folder",
            argument.as_os_str().to_owned(),
        ))),
        None => Err(not_found(&name, argument.as_os_str().to_owned(), directory)),
    }
}

fn not_found(name: &str, argument: OsString, directory: PathBuf) -> PyErr {
    let known = FILES.known_names(FOLDER, &[directory]);
    let message = match seedbed_input::nearest_name(name, known.iter().map(String::as_str)) {
        Some(near) => format!("there is no such task file or task; did you mean `{near}`?"),
        None => "there is no such task file or task; `seedbed.tasks()` returns the built-in tasks"
            .to_owned(),
    };
    PyFileNotFoundError::new_err((NO_SUCH_FILE, message, argument))
}
