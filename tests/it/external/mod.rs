//! Studies of results that others made: files of other libraries and run directories.
//! `tests/external/README.md` says how the files were made.

mod comparisons;
mod files;
mod registered;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::util::{REPOSITORY, seedbed, stderr, stdout, study_arguments};

/// A directory with a study and the files that it names.
struct Fixture {
    folder: tempfile::TempDir,
}

impl Fixture {
    fn new(study: &str) -> Self {
        let fixture = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        fixture.write("mine.ron", study);
        fixture
    }

    /// A study with the files in `tests/external`.
    fn with_files_of_tools(study: &str) -> Self {
        let fixture = Self::new(study);
        let files = Path::new(REPOSITORY).join("tests/external");
        for folder in ["sb3", "sb3_team", "cleanrl", "csv"] {
            let copy = Command::new("cp")
                .arg("-r")
                .args([files.join(folder), fixture.path(folder)])
                .status();
            assert!(copy.unwrap().success());
        }
        fixture
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    fn append(&self, name: &str, text: &str) {
        let earlier = fs::read_to_string(self.path(name)).unwrap();
        self.write(name, &(earlier + text));
    }

    fn study(&self, arguments: &[&str]) -> Output {
        let (study, out) = (self.path("mine.ron"), self.path("out"));
        let paths = [&study, &out].map(|path| path.to_str().unwrap());
        seedbed(&study_arguments(paths[0], paths[1], arguments))
    }

    /// The study must succeed. Returns standard output and standard error.
    fn succeed(&self, arguments: &[&str]) -> String {
        let output = self.study(arguments);
        assert!(output.status.success(), "{output:?}");
        stdout(&output) + &stderr(&output)
    }

    /// The study must end with this exit status. Returns standard output and standard error.
    fn fail(&self, status: i32, arguments: &[&str]) -> String {
        let output = self.study(arguments);
        assert_eq!(output.status.code(), Some(status), "{output:?}");
        stdout(&output) + &stderr(&output)
    }

    fn output(&self, name: &str) -> String {
        fs::read_to_string(self.path("out").join(name)).unwrap()
    }

    /// Rows of `results.csv`, each by the names of the columns.
    fn rows(&self) -> Vec<BTreeMap<String, String>> {
        let text = self.output("results.csv");
        let reader = csv::Reader::from_reader(text.as_bytes());
        reader.into_deserialize().map(Result::unwrap).collect()
    }
}

fn values<'a>(row: &'a BTreeMap<String, String>, columns: &[&str]) -> Vec<&'a str> {
    columns.iter().map(|column| row[*column].as_str()).collect()
}
