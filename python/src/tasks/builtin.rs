//! Task files: those on the disk, and those of the repository, which are built in.
//!
//! The rules are those of the command `seedbed`: an argument is a path, or a name that is looked up
//! in the nearest folder `envs` upwards and then among the built-in files. These have paths such as
//! `builtin:envs/cartpole.ron`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use pyo3::exceptions::{PyFileNotFoundError, PyIsADirectoryError};
use pyo3::prelude::*;
use seedbed_env::input::{self, Disk, FileSource, InputError};

/// Path in the repository and text of each built-in file.
const BUILTIN_FILES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/builtin_tasks.rs"));

/// Beginning of the paths of built-in files.
const PREFIX: &str = "builtin:";

/// Folder of tasks.
const FOLDER: &str = "envs";

/// Error numbers of the operating system.
const NO_SUCH_FILE: i32 = 2;
const IS_A_DIRECTORY: i32 = 21;

/// The file system and the built-in files.
#[derive(Clone, Copy, Debug)]
pub(super) struct DiskAndBuiltin;

impl FileSource for DiskAndBuiltin {
    fn read(&self, path: &Path) -> Result<String, InputError> {
        match builtin_text(path) {
            Some(text) => Ok(text.to_owned()),
            None => Disk.read(path),
        }
    }

    fn is_file(&self, path: &Path) -> bool {
        builtin_text(path).is_some() || path.is_file()
    }

    fn names_in(&self, folder: &Path) -> Vec<String> {
        let Some(folder) = builtin_path(folder) else {
            return Disk.names_in(folder);
        };
        let files = BUILTIN_FILES.iter().map(|(path, _)| Path::new(path));
        files
            .filter(|file| file.parent() == Some(Path::new(&folder)))
            .filter_map(|file| Some(file.file_stem()?.to_str()?.to_owned()))
            .collect()
    }
}

/// Names of the built-in tasks that are meant for learning, sorted.
#[pyfunction]
pub(crate) fn builtin_tasks() -> Vec<&'static str> {
    let names = builtin_names();
    names.filter(|name| !name.contains('/')).collect()
}

/// Names of all built-in tasks: paths below the folder, without `.ron`.
fn builtin_names() -> impl Iterator<Item = &'static str> {
    BUILTIN_FILES.iter().filter_map(|(path, _)| {
        let name = path.strip_prefix(FOLDER)?.strip_prefix('/')?;
        name.strip_suffix(".ron")
    })
}

fn builtin_text(path: &Path) -> Option<&'static str> {
    let path = builtin_path(path)?;
    let found = BUILTIN_FILES.iter().find(|(known, _)| *known == path);
    found.map(|(_, text)| *text)
}

/// The path of a built-in file in the repository, without `..`; `None` for other paths.
fn builtin_path(path: &Path) -> Option<String> {
    let mut parts = Vec::new();
    for part in path.to_str()?.strip_prefix(PREFIX)?.split('/') {
        if part == ".." {
            parts.pop()?;
        } else {
            parts.push(part);
        }
    }
    Some(parts.join("/"))
}

/// The file that an argument names.
///
/// # Errors
/// There is no such file, or it cannot be opened: a Python exception of the kind `OSError`.
pub(super) fn find(argument: &Path) -> PyResult<PathBuf> {
    if DiskAndBuiltin.is_file(argument) {
        if builtin_text(argument).is_none() {
            // Python has an exception for each reason why a file cannot be opened.
            std::fs::File::open(argument)?;
        }
        return Ok(argument.to_owned());
    }
    let name = argument.to_string_lossy();
    // A folder may have the name of a task, such as that of a run.
    let found = find_by_name(&name);
    if found.is_none() && argument.is_dir() {
        let message = "expected a task file, found a folder";
        let argument = argument.as_os_str().to_owned();
        return Err(PyIsADirectoryError::new_err((
            IS_A_DIRECTORY,
            message,
            argument,
        )));
    }
    found.ok_or_else(|| not_found(&name, argument.as_os_str().to_owned()))
}

/// The file of a task with this name.
fn find_by_name(name: &str) -> Option<PathBuf> {
    let directory = std::env::current_dir().unwrap_or_default();
    if let Some(path) = input::find_upwards(&directory, FOLDER, &format!("{name}.ron")) {
        return Some(path.strip_prefix(&directory).unwrap_or(&path).to_owned());
    }
    let path = PathBuf::from(format!("{PREFIX}{FOLDER}/{name}.ron"));
    builtin_text(&path).map(|_| path)
}

fn not_found(name: &str, argument: OsString) -> PyErr {
    let directory = std::env::current_dir().unwrap_or_default();
    let folders = input::folders_upwards(&directory, FOLDER);
    let mut known: Vec<String> = folders
        .iter()
        .flat_map(|folder| Disk.names_in(folder))
        .collect();
    known.extend(builtin_names().map(str::to_owned));
    let message = match input::nearest_name(name, known.iter().map(String::as_str)) {
        Some(near) => format!("there is no such task file or task; did you mean `{near}`?"),
        None => "there is no such task file or task; `seedbed.tasks()` returns the built-in tasks"
            .to_owned(),
    };
    PyFileNotFoundError::new_err((NO_SUCH_FILE, message, argument))
}
