//! Damaged files: what is whole in them is kept, and reading what is no regular file ends.

use std::fs;
use std::path::Path;

use super::state_files::{small_file, write_file};
use super::util::{
    crash, run_command, run_refused, run_successful, seedbed, small_run, stderr, stdout,
};
use seedbed::record::state_files::StateFiles;

/// Writes zeros in place of 56 bytes in the middle of a file.
fn zero_the_middle(path: &Path) {
    let mut bytes = fs::read(path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle..middle + 56].fill(0);
    fs::write(path, bytes).unwrap();
}

fn salvage(from: &Path, to: &Path) -> String {
    run_successful(&[
        "salvage",
        from.to_str().unwrap(),
        "--out",
        to.to_str().unwrap(),
    ])
}

/// The file has three episodes. If a bit of the first is changed, the second is episode 0 of the new file.
#[test]
fn whole_episodes_of_visited_states_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let [from, to] = ["damaged", "whole"].map(|name| folder.path().join(name));
    let mut bytes = small_file(0);
    let intact = write_file(&folder.path().join("intact"), 0, &bytes);
    let intact: Vec<_> = StateFiles::open_file(&intact).unwrap().episodes().collect();
    let first = bytes.windows(4).position(|kind| kind == b"EPIS").unwrap();
    bytes[first + 16 + 30] ^= 1;
    let path = write_file(&from, 0, &bytes);
    let printed = salvage(&from, &to);
    assert!(
        printed.contains("2 whole episodes, numbered again from 0")
            && printed.contains("and 1 episode before the last whole one: 0")
            && printed.contains("salvaged   0 files whole, 1 in part, 0 lost"),
        "{printed}"
    );
    assert_eq!(fs::read(&path).unwrap(), bytes, "the source is not changed");
    let salvaged = StateFiles::open_folder(&to).unwrap();
    let episodes: Vec<_> = salvaged.episodes().map(Result::unwrap).collect();
    assert_eq!(episodes.len(), 2);
    let expected = intact[1].as_ref().unwrap();
    assert_eq!(episodes[0].episode, 0);
    assert_eq!(episodes[0].observations, expected.observations);
    run_successful(&["inspect", to.to_str().unwrap()]);
    // Nothing is replaced.
    let error = run_refused(&[
        "salvage",
        from.to_str().unwrap(),
        "--out",
        to.to_str().unwrap(),
    ]);
    assert!(error.contains("exists; expected a new file"), "{error}");
}

#[test]
fn whole_files_of_a_run_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let from = folder.path().join("run");
    assert!(small_run(&from, &[]).status.success());
    zero_the_middle(&from.join("rounds.csv"));
    let to = folder.path().join("whole");
    let printed = salvage(&from, &to);
    assert!(
        printed.contains("rounds.csv: its SHA-256 is not the listed one")
            && printed.contains(", 0 in part, 1 lost"),
        "{printed}"
    );
    let listed = run_successful(&["runs", to.to_str().unwrap()]);
    assert!(!listed.contains("unreadable"), "{listed}");
    assert!(!to.join("rounds.csv").exists());
}

/// A recording has no checksums of its parts: one that can be read is not whole all the same if its run says
/// that it had other bytes.
#[test]
fn a_changed_recording_is_not_certified() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    let recording = run.join("run.rrd");
    let intact = fs::read(&recording).unwrap();
    for part in 1..12 {
        let mut changed = intact.clone();
        changed[intact.len() * part / 12] ^= 0x80;
        fs::write(&recording, &changed).unwrap();
        let to = folder.path().join(format!("salvaged-{part}"));
        let printed = salvage(&run, &to);
        assert!(
            printed.contains("run.rrd: ") && !printed.contains("0 in part, 0 lost\n"),
            "{printed}"
        );
        assert!(!to.join("run.rrd").exists());
        if to.join("run.rrd.part").exists() {
            let inspected = seedbed(&["inspect", to.to_str().unwrap()]);
            let warning = "run.rrd.part is not in SHA256SUMS of its run: it cannot be verified";
            assert!(stderr(&inspected).contains(warning), "{inspected:?}");
        }
        let sums = fs::read_to_string(to.join("SHA256SUMS")).unwrap();
        assert!(
            !sums.contains("run.rrd") && sums.contains("episodes.csv"),
            "{sums}"
        );
    }
}

/// A damaged digit in the list does not make a file a damaged one, nor a whole one.
#[test]
fn a_damaged_list_of_checksums_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    let list = run.join("SHA256SUMS");
    let text = fs::read_to_string(&list).unwrap();
    let line = text
        .lines()
        .find(|line| line.ends_with("episodes.csv"))
        .unwrap();
    let digit = if line.starts_with('0') { "1" } else { "0" };
    fs::write(&list, text.replace(line, &format!("{digit}{}", &line[1..]))).unwrap();
    let to = folder.path().join("salvaged");
    let printed = salvage(&run, &to);
    assert!(
        printed.contains("SHA256SUMS: is damaged: its last line"),
        "{printed}"
    );
    assert!(
        printed.contains("unverified ") && printed.contains(" 0 lost, 1 not verified\n"),
        "{printed}"
    );
    let table = |folder: &Path| fs::read(folder.join("episodes.csv")).unwrap();
    assert_eq!(table(&to), table(&run));
    let sums = fs::read_to_string(to.join("SHA256SUMS")).unwrap();
    assert!(
        !sums.contains("episodes.csv") && sums.contains("rounds.csv"),
        "{sums}"
    );
}

/// The checkpoint has a checksum of its own, and says what the tables of an unfinished run begin with.
#[cfg(unix)]
#[test]
fn tables_that_a_damaged_checkpoint_describes_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    for (name, finished) in [("finished", true), ("unfinished", false)] {
        let run = folder.path().join(name);
        if finished {
            assert!(small_run(&run, &[]).status.success());
        } else {
            let settings = ["agents.count=2", "checkpoint_every=2", "checkpoint_share=1"];
            let settings = settings.map(|setting| ["--set", setting]).concat();
            crash(run_command(
                &run,
                &[&settings, &["--abort-after-rounds", "5"][..]].concat(),
            ));
        }
        let checkpoint = run.join("checkpoint/state.bin");
        let bytes = fs::read(&checkpoint).unwrap();
        fs::write(&checkpoint, &bytes[..100]).unwrap();
        let to = folder.path().join(format!("{name}-salvaged"));
        let printed = salvage(&run, &to);
        assert!(
            printed.contains("state.bin: is damaged: it has 100 bytes instead of"),
            "{printed}"
        );
        assert!(printed.contains(" 1 lost"), "{printed}");
        assert!(!to.join("checkpoint/state.bin").exists());
        for table in ["episodes.csv", "rounds.csv"] {
            assert_eq!(
                fs::read(to.join(table)).unwrap(),
                fs::read(run.join(table)).unwrap()
            );
            assert_eq!(
                printed.contains(&format!("unverified {}", run.join(table).display())),
                !finished
            );
        }
    }
}

/// A pipe has no end while a process could write to it, and `/dev/zero` has none.
#[cfg(unix)]
#[test]
fn pipes_and_devices_in_folders_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    let sums = run.join("SHA256SUMS");
    let message = "expected a regular file, found a pipe, a socket or a device";
    for device in [true, false] {
        fs::remove_file(&sums).unwrap();
        if device {
            std::os::unix::fs::symlink("/dev/zero", &sums).unwrap();
        } else {
            let made = std::process::Command::new("mkfifo").arg(&sums).status();
            assert!(made.unwrap().success());
        }
        let listed = seedbed(&["runs", folder.path().to_str().unwrap()]);
        assert!(listed.status.success(), "{listed:?}");
        assert!(stdout(&listed).contains("unreadable"), "{listed:?}");
        assert!(stderr(&listed).contains(message), "{listed:?}");
        let error = run_refused(&["inspect", run.to_str().unwrap()]);
        assert!(error.contains(message), "{error}");
    }
}
