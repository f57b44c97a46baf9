//! Published results: their tables follow from one row per run. `page_numbers.rs` compares pages with these tables.

use std::fs;
use std::path::{Path, PathBuf};

use super::util::{REPOSITORY, seedbed};

/// Folders with published results. Those of groups precede those of groups within groups, so that a reference with the
/// name of a study alone means the former: `thesis/results/x` and `gymnasium/thesis/results/x`.
pub(crate) fn published_folders() -> Vec<PathBuf> {
    let groups = subfolders(&Path::new(REPOSITORY).join("scenarios"));
    let inner = groups.iter().flat_map(|group| subfolders(group));
    let all = groups.iter().cloned().chain(inner);
    all.flat_map(|group| subfolders(&group.join("results")))
        .collect()
}

pub(crate) fn subfolders(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    let paths = entries.map(|entry| entry.unwrap().path());
    let mut folders: Vec<PathBuf> = paths.filter(|path| path.is_dir()).collect();
    folders.sort();
    folders
}

/// Each JSON file beside published results: not JSON, of wrong types, nested deeply, huge, a pipe, a folder.
#[cfg(unix)]
#[test]
fn hostile_files_beside_published_results_are_refused_by_name() {
    let published = Path::new(REPOSITORY).join("scenarios/thesis/results/fig_6_1");
    let deep = "[".repeat(100_000);
    let wrong_types = r#"{"versions": 3, "sha256": [1]}"#;
    for (file, what) in [
        ("builds.json", "expected the builds of published results: "),
        (
            "submission.json",
            "expected the description of a submission: ",
        ),
        ("study.json", ""),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().canonicalize().unwrap();
        for file in ["study.json", "builds.json", "results.csv.gz"] {
            fs::copy(published.join(file), folder.join(file)).unwrap();
        }
        let path = folder.join(file);
        let refusal = || {
            let output = seedbed(&["report", folder.to_str().unwrap()]);
            assert_eq!(output.status.code(), Some(2), "{file}: {output:?}");
            String::from_utf8(output.stderr).unwrap()
        };
        let begins = if file == "study.json" {
            format!("error: not the results of a study: {}: ", path.display())
        } else {
            format!("error: {}: ", path.display())
        };
        for text in ["hello", "", "7", deep.as_str(), wrong_types] {
            fs::write(&path, text).unwrap();
            let error = refusal();
            assert!(error.starts_with(&format!("{begins}{what}")), "{error}");
        }
        fs::File::create(&path).unwrap().set_len(1 << 32).unwrap();
        assert_eq!(
            refusal(),
            format!("{begins}expected at most 64 MiB, found more\n")
        );
        fs::remove_file(&path).unwrap();
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
        let message = "expected a regular file, found a pipe, a socket or a device";
        assert_eq!(refusal(), format!("{begins}{message}\n"));
        fs::remove_file(&path).unwrap();
        fs::create_dir(&path).unwrap();
        assert_eq!(
            refusal(),
            format!("{begins}expected a file, found a folder\n")
        );
    }
}

/// Size of a table of results, in bytes, from which it takes the tests too long to compute its tables: `tests/interop/published` does, with
/// the program as users have it.
const LARGE: u64 = 5_000_000;

#[test]
fn tables_of_published_results_follow_from_their_rows() {
    let size = |folder: &Path| fs::metadata(folder.join("results.csv.gz")).unwrap().len();
    let (large, others): (Vec<PathBuf>, Vec<PathBuf>) = published_folders()
        .into_iter()
        .partition(|folder| size(folder) > LARGE);
    assert!(large.len() <= 2 && others.len() > 20, "{large:?}");
    for folder in others {
        let copy = tempfile::tempdir().unwrap();
        for file in ["study.json", "builds.json", "results.csv.gz"] {
            fs::copy(folder.join(file), copy.path().join(file)).unwrap();
        }
        let output = seedbed(&["report", copy.path().to_str().unwrap()]);
        assert!(output.status.success(), "{}: {output:?}", folder.display());
        assert!(copy.path().join("tables.md").is_file());
        for file in ["claims.md", "claims.svg", "tables.md"] {
            let (computed, published) = (copy.path().join(file), folder.join(file));
            // A study without claims has no table and no figure of them.
            assert_eq!(computed.is_file(), published.is_file(), "{file}");
            if computed.is_file() {
                let computed = fs::read_to_string(computed).unwrap();
                expect_test::expect_file![published].assert_eq(&computed);
            }
        }
    }
}
