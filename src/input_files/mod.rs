//! Files that users name: by their path, or by the name of a task or scenario.
//!
//! A name is looked up in the nearest directory `envs` or `scenarios` upwards, and then among the
//! files that are built into the program. These have paths such as `builtin:envs/cartpole.ron`.

mod builtin;
mod streams;

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use seedbed_env::TaskDescription;
use seedbed_env::gymnasium::GymnasiumTask;
use seedbed_input::{BuiltinFile, DiskAndBuiltin, Document, FileSource, InputError};
use serde::de::DeserializeOwned;

pub use builtin::BUILTIN_FILES;
pub use seedbed_input::is_builtin;

/// The file system and the built-in files, without streams.
const FILES: DiskAndBuiltin = DiskAndBuiltin(BUILTIN_FILES);

/// A directory in which files are looked up by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Directory {
    /// Tasks: `envs`.
    Environments,
    /// Scenarios and studies: `scenarios`.
    Scenarios,
}

impl Directory {
    /// Name of the directory.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Environments => "envs",
            Self::Scenarios => "scenarios",
        }
    }

    /// What the files are.
    fn noun(self) -> &'static str {
        match self {
            Self::Environments => "environment",
            Self::Scenarios => "scenario",
        }
    }

    /// The built-in files, with their names: the path below the directory, without `.ron`.
    pub fn builtin_files(self) -> impl Iterator<Item = (&'static str, &'static BuiltinFile)> {
        FILES.builtin_in(self.name())
    }
}

/// All that an argument may name: files on the disk, built-in files and streams.
#[derive(Clone, Copy, Debug)]
struct AllFiles;

impl FileSource for AllFiles {
    fn read(&self, path: &Path) -> Result<String, InputError> {
        if streams::is_stream(path) {
            return streams::read(path);
        }
        FILES.read(path)
    }

    fn folder_of(&self, path: &Path) -> PathBuf {
        folder_of(path)
    }

    fn is_file(&self, path: &Path) -> bool {
        FILES.is_file(path) || streams::is_stream(path)
    }

    fn names_in(&self, folder: &Path) -> Vec<String> {
        FILES.names_in(folder)
    }
}

/// Allows to read the input that a command-line argument names, if it is a pipe or a process
/// substitution. Other pipes are refused.
pub fn accept_stream(path: &Path) {
    streams::accept(path);
}

/// Whether the input that a command-line argument names can be read only once: the standard input
/// (`-`), a pipe, or a process substitution.
#[must_use]
pub fn is_stream(path: &Path) -> bool {
    path == Path::new("-") || streams::is_stream(path)
}

/// Reads the text of a file, which may be built in.
///
/// # Errors
/// The file cannot be read.
pub fn read_text(path: &Path) -> Result<String, InputError> {
    AllFiles.read(path)
}

/// Reads a RON file, which may be built in.
///
/// # Errors
/// The file cannot be read, or is not a `T`.
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<Document<T>, InputError> {
    seedbed_input::parse(&path.display().to_string(), read_text(path)?)
}

/// Reads and checks a task file, which may be built in. Also returns the text of a task file that
/// describes the same task and extends no other file.
///
/// # Errors
/// The file, or one that it extends, cannot be read, or something in it is wrong.
pub fn read_task(path: &Path) -> Result<(TaskDescription, String), InputError> {
    seedbed_env::load_from(&AllFiles, path)
}

/// Paths of the files that a task is read from: its own, and those that it extends.
///
/// # Errors
/// See [`read_task`].
pub fn files_of_task(path: &Path) -> Result<Vec<PathBuf>, InputError> {
    let source = ListedFiles::default();
    let (task, _) = seedbed_env::load_from(&source, path)?;
    let python_file = task.gymnasium().and_then(GymnasiumTask::python_file);
    let mut files = source.read.into_inner();
    files.extend(python_file);
    Ok(files)
}

/// Files that were read from the disk or are built in.
#[derive(Debug, Default)]
struct ListedFiles {
    read: RefCell<Vec<PathBuf>>,
}

impl FileSource for ListedFiles {
    fn read(&self, path: &Path) -> Result<String, InputError> {
        self.read.borrow_mut().push(path.to_owned());
        AllFiles.read(path)
    }

    fn folder_of(&self, path: &Path) -> PathBuf {
        AllFiles.folder_of(path)
    }

    fn is_file(&self, path: &Path) -> bool {
        AllFiles.is_file(path)
    }

    fn names_in(&self, folder: &Path) -> Vec<String> {
        AllFiles.names_in(folder)
    }
}

/// The file that a command-line argument names: a path, or a name in one of `directories`, which are tried in turn; `-` is
/// the standard input. A name with `.ron` is that of a file on the disk, and never of a built-in one: it would be another file
/// than the one that was meant.
///
/// # Errors
/// There is no such file, with the names that exist.
pub fn find_argument(path: &Path, directories: &[Directory]) -> Result<PathBuf, InputError> {
    if path == Path::new("-") {
        return Ok(streams::STANDARD_INPUT.into());
    }
    accept_stream(path);
    if AllFiles.is_file(path) {
        return Ok(path.to_owned());
    }
    let argument = path.to_string_lossy();
    let start_folders = [working_directory()];
    let name = argument.strip_suffix(".ron").unwrap_or(&argument);
    let may_be_builtin = name == argument;
    let found = directories.iter().find_map(|&directory| {
        let found = find(name, directory, &start_folders).ok();
        found.filter(|path| may_be_builtin || !is_builtin(path))
    });
    found.ok_or_else(|| not_found(&argument, directories, &start_folders))
}

/// Path of the file `name` in the nearest directory that has it, in or above each of
/// `start_folders`, in this order; otherwise of the built-in file.
///
/// # Errors
/// All known names, if there is no such file.
pub fn find(
    name: &str,
    directory: Directory,
    start_folders: &[PathBuf],
) -> Result<PathBuf, Vec<String>> {
    let found = FILES.find(name, directory.name(), start_folders);
    found
        .map(|path| relative_path(&path))
        .ok_or_else(|| FILES.known_names(directory.name(), start_folders))
}

/// The folder from which relative paths in the file at `path` begin: that of the file, or the working
/// directory for an input that is not in a folder, such as a pipe.
#[must_use]
pub fn folder_of(path: &Path) -> PathBuf {
    if streams::is_stream(path) {
        return PathBuf::new();
    }
    path.parent().unwrap_or(Path::new("")).to_owned()
}

/// The folders above which names are looked up that a file in `folder` contains: this folder, then
/// the working directory. None for built-in files, which name only built-in files.
#[must_use]
pub fn start_folders(folder: &Path) -> Vec<PathBuf> {
    if is_builtin(folder) {
        return Vec::new();
    }
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    vec![
        folder.canonicalize().unwrap_or_default(),
        working_directory(),
    ]
}

/// The path relative to the working directory, if the path is inside it; otherwise the path
/// unchanged.
#[must_use]
pub fn relative_path(path: &Path) -> PathBuf {
    path.strip_prefix(working_directory())
        .unwrap_or(path)
        .to_owned()
}

/// The working directory; an empty path if it no longer exists.
#[must_use]
pub fn working_directory() -> PathBuf {
    std::env::current_dir().unwrap_or_default()
}

fn not_found(argument: &str, directories: &[Directory], start_folders: &[PathBuf]) -> InputError {
    let is_path = seedbed_input::is_ron(Path::new(argument)) || argument.contains('/');
    let known: Vec<String> = directories
        .iter()
        .flat_map(|directory| FILES.known_names(directory.name(), start_folders))
        .collect();
    let near = seedbed_input::nearest_name(argument, known.iter().map(String::as_str));
    let nouns: Vec<&str> = directories.iter().map(|kind| kind.noun()).collect();
    let is_folder = Path::new(argument).is_dir();
    InputError {
        origin: argument.to_owned(),
        position: None,
        field: String::new(),
        message: if is_folder {
            "expected a file, found a directory".to_owned()
        } else if is_path {
            "no such file".to_owned()
        } else if let [noun] = nouns.as_slice() {
            format!("there is no such file or {noun}")
        } else {
            format!("there is no such file, {}", nouns.join(" or "))
        },
        help: Some(match near {
            Some(name) => format!("did you mean `{name}`?"),
            None => "`seedbed list` shows all names".to_owned(),
        }),
    }
}
