//! Files that are built into a program, and the search for a name on the disk and among them.

use std::path::{Path, PathBuf};

use super::error::InputError;
use super::files::{Disk, FileSource, find_upwards, folders_upwards};

/// A file that is built in.
#[derive(Clone, Copy, Debug)]
pub struct BuiltinFile {
    /// Path in the repository, for example `envs/cartpole.ron`.
    pub path: &'static str,
    /// Text of the file.
    pub text: &'static str,
}

/// Beginning of the paths of built-in files.
const PREFIX: &str = "builtin:";

impl BuiltinFile {
    /// The path that messages show, for example `builtin:envs/cartpole.ron`.
    #[must_use]
    pub fn full_path(&self) -> PathBuf {
        PathBuf::from(format!("{PREFIX}{}", self.path))
    }
}

/// Whether a path is that of a built-in file or folder.
#[must_use]
pub fn is_builtin(path: &Path) -> bool {
    path.to_str().is_some_and(|path| path.starts_with(PREFIX))
}

/// The file system and the built-in files of a program.
#[derive(Clone, Copy, Debug)]
pub struct DiskAndBuiltin(pub &'static [BuiltinFile]);

impl DiskAndBuiltin {
    /// The built-in file at `path`, which begins with `builtin:`.
    #[must_use]
    pub fn builtin(self, path: &Path) -> Option<&'static BuiltinFile> {
        let path = path_in_repository(path)?;
        self.0.iter().find(|file| file.path == path)
    }

    /// The built-in files below the directory `folder`, with their names: the path below it, without
    /// `.ron`.
    pub fn builtin_in(
        self,
        folder: &str,
    ) -> impl Iterator<Item = (&'static str, &'static BuiltinFile)> {
        self.0.iter().filter_map(move |file| {
            let name = file.path.strip_prefix(folder)?.strip_prefix('/')?;
            Some((name.strip_suffix(".ron")?, file))
        })
    }

    /// Path of the file `name` in the nearest directory `folder` that has it, in or above each of
    /// `start_folders`, in this order; otherwise of the built-in file.
    #[must_use]
    pub fn find(self, name: &str, folder: &str, start_folders: &[PathBuf]) -> Option<PathBuf> {
        let file = format!("{name}.ron");
        let on_disk = start_folders
            .iter()
            .find_map(|start| find_upwards(start, folder, &file));
        on_disk.or_else(|| {
            let mut builtin = self.builtin_in(folder);
            let (_, file) = builtin.find(|(known, _)| *known == name)?;
            Some(file.full_path())
        })
    }

    /// All names that [`find`](Self::find) finds, sorted.
    #[must_use]
    pub fn known_names(self, folder: &str, start_folders: &[PathBuf]) -> Vec<String> {
        let folders = start_folders
            .iter()
            .flat_map(|start| folders_upwards(start, folder));
        let mut names: Vec<String> = folders.flat_map(|folder| Disk.names_in(&folder)).collect();
        names.extend(self.builtin_in(folder).map(|(name, _)| name.to_owned()));
        names.sort();
        names.dedup();
        names
    }
}

impl FileSource for DiskAndBuiltin {
    fn read(&self, path: &Path) -> Result<String, InputError> {
        match self.builtin(path) {
            Some(file) => Ok(file.text.to_owned()),
            None => Disk.read(path),
        }
    }

    fn is_file(&self, path: &Path) -> bool {
        self.builtin(path).is_some() || path.is_file()
    }

    fn names_in(&self, folder: &Path) -> Vec<String> {
        if !is_builtin(folder) {
            return Disk.names_in(folder);
        }
        let Some(folder) = path_in_repository(folder) else {
            return Vec::new();
        };
        let files = self.builtin_in(&folder);
        files
            .filter(|(name, _)| !name.contains('/'))
            .map(|(name, _)| name.to_owned())
            .collect()
    }
}

/// The path in the repository of a built-in file or folder, without `..`: `envs/parking.ron` for
/// `builtin:envs/mistakes/../parking.ron`. `None` for other paths, and for paths out of the repository.
fn path_in_repository(path: &Path) -> Option<String> {
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

#[cfg(test)]
mod tests {
    use super::*;

    const FILES: DiskAndBuiltin = DiskAndBuiltin(&[
        BuiltinFile {
            path: "envs/parking.ron",
            text: "parking",
        },
        BuiltinFile {
            path: "envs/mistakes/parking_naive.ron",
            text: "naive",
        },
        BuiltinFile {
            path: "environments.ron",
            text: "",
        },
    ]);

    #[test]
    fn paths_of_built_in_files_may_lead_through_parents() {
        let text = |path| FILES.builtin(Path::new(path)).map(|file| file.text);
        let through_parent = "builtin:envs/mistakes/../parking.ron";
        assert_eq!(text(through_parent), Some("parking"));
        assert!(text("builtin:../envs/parking.ron").is_none());
        assert!(text("envs/parking.ron").is_none());
    }

    #[test]
    fn built_in_files_have_names_below_their_folder() {
        let names = |folder: &str| FILES.names_in(Path::new(folder));
        assert_eq!(names("builtin:envs"), ["parking"]);
        assert_eq!(names("builtin:envs/mistakes"), ["parking_naive"]);
        assert_eq!(names("builtin:envs/mistakes/.."), ["parking"]);
        let found = FILES.find("mistakes/parking_naive", "envs", &[]);
        let path = "builtin:envs/mistakes/parking_naive.ron";
        assert_eq!(found, Some(PathBuf::from(path)));
        assert_eq!(FILES.find("none", "envs", &[]), None);
        assert_eq!(
            FILES.known_names("envs", &[]),
            ["mistakes/parking_naive", "parking"]
        );
    }
}
