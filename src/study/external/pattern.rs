//! Patterns of paths, such as `runs/**/monitor.csv`.
//!
//! Each part of a pattern between slashes is compared with the names in one directory. `**` stands for
//! any directories; it does not follow links, so that a link to a directory above ends nowhere.

use std::io;
use std::path::{Path, PathBuf};

use glob::{MatchOptions, Pattern};

use seedbed_input::{Located, ValidationError};

/// Names that begin with a dot are matched by patterns that do.
const OPTIONS: MatchOptions = MatchOptions {
    case_sensitive: true,
    require_literal_separator: true,
    require_literal_leading_dot: true,
};

/// A part of a pattern.
enum Part {
    /// `**`
    AnyFolders,
    /// A name without wildcards.
    Name(String),
    /// A pattern of names.
    Names(Pattern),
}

/// Paths that a pattern matches, in alphabetical order. It is relative to `folder`. If it ends with a
/// slash, it matches directories only.
///
/// # Errors
/// If the pattern is none, if a directory cannot be read, or if a path is not in UTF-8, so that it could
/// not be named in results.
pub(super) fn matching_paths(
    folder: &Path,
    pattern: &Located<String>,
) -> Result<Vec<PathBuf>, ValidationError> {
    let parts = parts(pattern)
        .map_err(|error| pattern.error(format!("this is no pattern of paths: {}", error.msg)))?;
    let is_absolute = Path::new(pattern.value()).is_absolute();
    let start = if is_absolute { Path::new("/") } else { folder };
    let mut paths = Vec::new();
    expand(start, &parts, &mut paths).map_err(|error| pattern.error(error.to_string()))?;
    if pattern.value().ends_with('/') {
        paths.retain(|path| path.is_dir());
    }
    paths.sort();
    paths.dedup();
    let is_text = |path: &PathBuf| path.strip_prefix(folder).unwrap_or(path).to_str().is_some();
    match paths.iter().find(|path| !is_text(path)) {
        Some(path) => Err(pattern.error(format!(
            "the name of `{}` is not in UTF-8; expected another name, or a pattern that does not match it",
            path.display()
        ))),
        None => Ok(paths),
    }
}

fn parts(pattern: &str) -> Result<Vec<Part>, glob::PatternError> {
    // The whole pattern is checked as well: its errors have the right places.
    Pattern::new(pattern)?;
    let parts = pattern.split('/').filter(|part| !part.is_empty());
    let part = |part: &str| {
        Ok(match part {
            "**" => Part::AnyFolders,
            _ if part.contains(['*', '?', '[']) => Part::Names(Pattern::new(part)?),
            _ => Part::Name(part.to_owned()),
        })
    };
    parts.map(part).collect()
}

/// Adds all paths in `folder` that the parts match.
fn expand(folder: &Path, parts: &[Part], found: &mut Vec<PathBuf>) -> io::Result<()> {
    let Some((part, rest)) = parts.split_first() else {
        found.push(folder.to_owned());
        return Ok(());
    };
    match part {
        Part::Name(name) => expand_existing(&folder.join(name), rest, found),
        Part::Names(pattern) => {
            for path in entries(folder)? {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                if pattern.matches_with(&name, OPTIONS) {
                    expand_existing(&path, rest, found)?;
                }
            }
            Ok(())
        }
        Part::AnyFolders => expand_any_folders(folder, parts, found),
    }
}

/// Adds `path`, or what the rest of the parts matches in it.
fn expand_existing(path: &Path, rest: &[Part], found: &mut Vec<PathBuf>) -> io::Result<()> {
    let exists = if rest.is_empty() {
        path.symlink_metadata().is_ok()
    } else {
        path.is_dir()
    };
    if exists {
        expand(path, rest, found)?;
    }
    Ok(())
}

/// Adds what the parts behind `**` match in `folder` and in all directories below; without such parts,
/// these directories.
fn expand_any_folders(folder: &Path, parts: &[Part], found: &mut Vec<PathBuf>) -> io::Result<()> {
    let rest = &parts[1..];
    if !rest.is_empty() {
        expand(folder, rest, found)?;
    }
    for path in entries(folder)? {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let is_folder = path.symlink_metadata().is_ok_and(|found| found.is_dir());
        if is_folder && !name.starts_with('.') {
            if rest.is_empty() {
                found.push(path.clone());
            }
            expand_any_folders(&path, parts, found)?;
        }
    }
    Ok(())
}

/// Paths in a directory; none if it is no directory.
fn entries(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let is_current = folder.as_os_str().is_empty();
    let read = if is_current { Path::new(".") } else { folder };
    if !read.is_dir() {
        return Ok(Vec::new());
    }
    let cannot_read =
        |error: io::Error| io::Error::other(format!("cannot read {}: {error}", read.display()));
    let entries = std::fs::read_dir(read).map_err(cannot_read)?;
    let paths = entries.map(|entry| Ok(folder.join(entry?.file_name())));
    paths.collect::<io::Result<_>>().map_err(cannot_read)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// A folder with these files; names that end with a slash are directories.
    fn folder_with(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            if name.ends_with('/') {
                fs::create_dir_all(path).unwrap();
            } else {
                fs::write(path, "").unwrap();
            }
        }
        folder
    }

    fn matched(folder: &Path, pattern: &str) -> Vec<String> {
        let paths = matching_paths(folder, &pattern.to_owned().into()).unwrap();
        let relative = paths.iter().map(|path| path.strip_prefix(folder).unwrap());
        relative
            .map(|path| path.to_str().unwrap().to_owned())
            .collect()
    }

    /// What the crate `glob` finds.
    fn globbed(folder: &Path, pattern: &str) -> Vec<String> {
        let text = format!("{}/{pattern}", folder.display());
        let paths = glob::glob_with(&text, OPTIONS).unwrap().map(Result::unwrap);
        let relative = paths.map(|path| path.strip_prefix(folder).unwrap().to_owned());
        relative
            .map(|path| path.to_str().unwrap().to_owned())
            .collect()
    }

    #[test]
    fn paths_are_those_of_the_crate_glob() {
        let folder = folder_with(&[
            "a.csv",
            "b.csv",
            "c.txt",
            ".hidden.csv",
            "d/a.csv",
            "d/run1/m.csv",
            "d/run2/m.csv",
            "d/run2/deep/er/m.csv",
            "d/.git/m.csv",
            "d/empty/",
            "e[1]/m.csv",
            "ä/m.csv",
        ]);
        for pattern in [
            "*.csv",
            "?.csv",
            "[ab].csv",
            "[!a].csv",
            "*",
            "*/",
            "d",
            "d/",
            "d/*/m.csv",
            "**/m.csv",
            "d/**/m.csv",
            "d/**",
            "d/**/*",
            "d/**/*/",
            "**/**/m.csv",
            "d/run?/",
            "d/run1/m.csv/",
            "e[[]1]/*",
            "*/*.csv",
            "./d/../d/*.csv",
            "none/*",
            "a.csv/*",
            "ä/*",
            "d//run1/m.csv",
        ] {
            assert_eq!(
                matched(folder.path(), pattern),
                globbed(folder.path(), pattern),
                "{pattern}"
            );
        }
        // The crate does not look into directories whose names begin with a dot, even if the pattern names them.
        assert_eq!(matched(folder.path(), "**/.git/*"), ["d/.git/m.csv"]);
        for pattern in ["a**", "[a", "***"] {
            assert!(matching_paths(folder.path(), &pattern.to_owned().into()).is_err());
        }
    }

    #[test]
    fn names_with_a_dot_are_matched_by_patterns_with_a_dot() {
        let folder = folder_with(&["a.csv", ".b.csv", ".c/d.csv"]);
        assert_eq!(matched(folder.path(), ".*.csv"), [".b.csv"]);
        assert_eq!(matched(folder.path(), "**/*.csv"), ["a.csv"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_to_directories_above_end_nowhere() {
        use std::os::unix::fs::symlink;
        let folder = folder_with(&["d/run1/m.csv"]);
        for name in ["self", "other", "run1/above"] {
            symlink(folder.path().join("d"), folder.path().join("d").join(name)).unwrap();
        }
        assert_eq!(matched(folder.path(), "d/**/m.csv"), ["d/run1/m.csv"]);
        assert_eq!(matched(folder.path(), "d/*/run1/m.csv").len(), 2);
    }

    #[cfg(unix)]
    #[test]
    fn names_that_are_no_text_are_refused() {
        use std::os::unix::ffi::OsStrExt;
        let folder = folder_with(&["d/a.csv"]);
        let name = std::ffi::OsStr::from_bytes(b"\xff.csv");
        fs::write(folder.path().join("d").join(name), "").unwrap();
        let error = matching_paths(folder.path(), &"d/*.csv".to_owned().into()).unwrap_err();
        assert!(format!("{error:?}").contains("\u{fffd}.csv` is not in UTF-8"));
        assert_eq!(matched(folder.path(), "d/a*"), ["d/a.csv"]);
    }
}
