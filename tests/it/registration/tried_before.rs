//! What a registration says of runs and locks from before, wherever their results are: the log of the project has them.

use std::fs;
use std::process::Output;

use super::{Fixture, assert_follows_one_lock, with_repeats};
use crate::util::{command, stderr, stdout};

impl Fixture {
    /// Runs a command in the folder of the study, with the log of the project to which it belongs.
    fn logged(&self, arguments: &[&str]) -> Output {
        let mut command = command(arguments);
        command.env_remove("SEEDBED_RUN_LOG");
        command.current_dir(self.path("")).output().unwrap()
    }

    fn logged_successfully(&self, arguments: &[&str]) -> String {
        let output = self.logged(arguments);
        assert!(output.status.success(), "{arguments:?}: {output:?}");
        stdout(&output)
    }

    /// Registers and confirms the study, and returns the notes of its report.
    fn notes(&self, study: &str) -> Vec<String> {
        self.logged_successfully(&["study", "register", study]);
        let printed = self.logged_successfully(&["study", "confirm", study]);
        let notes = printed
            .lines()
            .filter_map(|line| line.strip_prefix("note "));
        notes.map(|note| note.trim().to_owned()).collect()
    }
}

/// Runs elsewhere, of another study with other names, of `bench` and of `run`, all count, each once.
#[test]
fn runs_count_wherever_and_by_whatever_command_they_were_made() {
    let fixture = Fixture::new(&with_repeats(6));
    fs::copy(fixture.path("small.ron"), fixture.path("renamed.ron")).unwrap();
    fixture.logged_successfully(&["study", "run", "renamed.ron", "--out", "elsewhere"]);
    fs::remove_dir_all(fixture.path("elsewhere")).unwrap();
    let settings = [
        "--set",
        "agents.count=10",
        "--set",
        "episodes=40",
        "--set",
        "algorithm=SeedSampling()",
    ];
    let bench = ["bench", "deep_sea.ron", "--seeds", "2", "--first-seed", "7"];
    fixture.logged_successfully(&[&bench[..], &settings].concat());
    // With a seed that the study had, too.
    let run = ["run", "deep_sea.ron", "--seed", "1000", "--out", "run"];
    fixture.logged_successfully(&[&run[..], &settings].concat());
    let other = [
        "run",
        "deep_sea.ron",
        "--seed",
        "3",
        "--out",
        "other",
        "--set",
        "episodes=7",
    ];
    fixture.logged_successfully(&other);
    let registered = fixture.logged_successfully(&["study", "register", "small.ron"]);
    let expected =
        "tried      14 runs with the settings of its cells, 1 with other settings in its tasks";
    assert!(registered.contains(expected), "{registered}");
    assert_eq!(
        fixture.notes("small.ron"),
        [
            "When the study was registered, the project's log had 15 runs, of which 1 with other settings in tasks of this study.",
            "When the study was registered, 8 runs of cell `seeds` with other run seeds had been made.",
            "When the study was registered, 6 runs of cell `random` with other run seeds had been made.",
        ]
    );
}

/// A lock that was deleted, and the lock of the same cells under another name, are in the history of the next one.
#[test]
fn deleted_locks_and_renamed_studies_are_in_the_history() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.logged_successfully(&["study", "register", "small.ron"]);
    fs::remove_file(fixture.path("small.ron.lock")).unwrap();
    fixture.write_study(&with_repeats(6).replace("smallest: 5", "smallest: 1"));
    fs::rename(fixture.path("small.ron"), fixture.path("renamed.ron")).unwrap();
    let registered = fixture.logged_successfully(&["study", "register", "renamed.ron"]);
    assert_follows_one_lock(&registered);
}

/// A study that stays registered beside another one with some of its cells has withdrawn nothing.
#[test]
fn studies_that_stay_registered_are_named_and_not_in_the_history() {
    let fixture = Fixture::new(&with_repeats(6).replace("smallest: 5", "smallest: 3"));
    fixture.logged_successfully(&["study", "register", "small.ron"]);
    fixture.write_study(&with_repeats(6));
    let again = fixture.logged_successfully(&["study", "register", "small.ron"]);
    assert!(again.contains("history    1 lock"), "{again}");
    let study = fs::read_to_string(fixture.path("small.ron")).unwrap();
    let other = study.replace("smallest: 5", "smallest: 1");
    fs::write(fixture.path("other.ron"), other).unwrap();
    let registered = fixture.logged_successfully(&["study", "register", "other.ron"]);
    assert!(
        registered.contains("beside     small (") && !registered.contains("history"),
        "{registered}"
    );
    assert!(!registered.contains("withdrawn"), "{registered}");
    let notes = fixture.notes("other.ron");
    let expected = "Another study with some of these cells is registered: small, ";
    assert!(
        notes.iter().any(|note| note.starts_with(expected)),
        "{notes:?}"
    );
}

#[test]
fn a_log_that_cannot_be_written_is_named_and_stops_nothing() {
    let fixture = Fixture::new(&with_repeats(6));
    fs::write(fixture.path(".seedbed"), "a file").unwrap();
    let run = ["run", "deep_sea.ron", "--set", "episodes=2", "--out", "run"];
    let output = fixture.logged(&run);
    assert!(output.status.success(), "{output:?}");
    let warning = stderr(&output);
    assert!(
        warning.starts_with("warning: registrations in this project will not know of this: ")
            && warning.contains(".seedbed"),
        "{warning}"
    );
}

#[test]
fn without_a_log_nothing_is_said_of_it() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.succeed(&["register"]);
    let lock = fs::read_to_string(fixture.path("small.ron.lock")).unwrap();
    assert!(!lock.contains("run_log"), "{lock}");
    assert!(!fixture.path(".seedbed").exists());
}
