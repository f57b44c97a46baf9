//! Runs of studies that are stopped and continue from their checkpoints, with the bits of runs that were
//! never stopped.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Output, Stdio};

use tempfile::TempDir;
use xxhash_rust::xxh64::xxh64;

use super::{run_study, stored_results, write_study};
use crate::util::{
    REPOSITORY, command, files_below, names_in, seedbed, send_signal, stderr, stdout,
    study_arguments, wait_until,
};

/// No checkpoint is written before an interruption, and each interruption writes one.
const AT_INTERRUPTIONS: [&str; 2] = ["--checkpoint-distance", "3600000"];

/// A checkpoint is written after about every round.
const EVERY_ROUND: [&str; 2] = ["--checkpoint-distance", "0"];

const ONE_JOB: [&str; 2] = ["--jobs", "1"];

/// A study of one cell with two agents.
fn text(scenario: &str, episodes: u32, repeats: u32) -> String {
    let scenario = Path::new(REPOSITORY).join("scenarios").join(scenario);
    format!(
        r#"Study(
            title: "Long",
            scenario: "{}",
            set: ["agents.count=2", "stop=Episodes({episodes})"],
            repeats: {repeats},
            measures: [FinalReturn(window: 5), Coverage],
            figures: [Visitation(episodes: [First(40), All])],
        )"#,
        scenario.display()
    )
}

/// A study and the directory of its results, which are compared with those of an undisturbed study.
struct Stopped {
    _folder: TempDir,
    study: String,
    out: PathBuf,
}

impl Stopped {
    fn new(text: &str) -> Self {
        let (folder, study, out) = write_study(text);
        Self {
            _folder: folder,
            study,
            out,
        }
    }

    fn start(&self, arguments: &[&[&str]]) -> Child {
        let common = ["study", &self.study, "--out", self.out.to_str().unwrap()];
        command(&[&common[..], &ONE_JOB, &arguments.concat()].concat())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    /// Starts a process, and stops it by a signal when a condition is true.
    fn stop(
        &self,
        signal: &str,
        arguments: &[&[&str]],
        condition: impl Fn(&Self) -> bool,
    ) -> Output {
        let mut child = self.start(arguments);
        wait_until("the run is far enough", || {
            assert_eq!(child.try_wait().unwrap(), None, "the run ended early");
            condition(self)
        });
        send_signal(signal, &child);
        child.wait_with_output().unwrap()
    }

    /// Executes what is missing, and returns what was printed to the standard error.
    fn finish(&self, arguments: &[&str]) -> String {
        let output = run_study(&self.study, &self.out, &[&ONE_JOB, arguments].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        stderr(&output)
    }

    fn marks(&self) -> usize {
        self.files("running").len()
    }

    fn files(&self, extension: &str) -> Vec<PathBuf> {
        let runs = self.out.join("runs");
        if runs.is_dir() {
            files_below(&runs, extension)
        } else {
            Vec::new()
        }
    }

    /// Numbers of episodes in the checkpoints of interrupted or running runs, by `list`.
    fn saved_episodes(&self) -> Vec<u32> {
        let output = run_study(&self.study, &self.out, &["list"]);
        assert!(output.status.success(), "{}", stderr(&output));
        let text = stdout(&output);
        let lines = text.lines().filter(|line| line.contains(" saved"));
        lines
            .map(|line| {
                let (_, details) = line.split_once("  (").unwrap();
                details
                    .split_once(" of at most ")
                    .unwrap()
                    .0
                    .parse()
                    .unwrap()
            })
            .collect()
    }

    /// The results are those of an undisturbed study, and nothing else is left.
    fn assert_same_as_whole(&self) {
        let whole = self.out.with_extension("whole");
        let output = run_study(&self.study, &whole, &ONE_JOB);
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(!stderr(&output).contains("resumed"), "{}", stderr(&output));
        let expected = stored_results(&whole);
        assert!(stored_results(&self.out) == expected, "results differ");
        let names: Vec<&String> = expected.keys().collect();
        assert_eq!(
            names_in(&self.out.join("runs")).iter().collect::<Vec<_>>(),
            names
        );
    }
}

/// How often a process said that it continued from this number of episodes.
fn resumed(errors: &str, episodes: u32) -> usize {
    let end = format!(".checkpoint: {episodes} of at most ");
    let is_resumed = |line: &&str| line.starts_with("resumed    ") && line.contains(&end);
    errors.lines().filter(is_resumed).count()
}

/// TERM comes when the run has lasted a second. No checkpoint was there before.
fn assert_continues_after_term(text: &str, max_episodes: u32) {
    let study = Stopped::new(text);
    let output = study.stop("TERM", &[&AT_INTERRUPTIONS], |study| {
        assert_eq!(study.files("checkpoint").len(), 0);
        study.marks() == 1
    });
    assert_eq!(output.status.code(), Some(143), "{}", stderr(&output));
    assert_eq!(study.files("checkpoint").len(), 1);
    let saved = study.saved_episodes();
    assert!((1..max_episodes).contains(&saved[0]), "{saved:?}");
    let list = stdout(&run_study(&study.study, &study.out, &["list"]));
    let expected = format!(
        "     0  interrupted  run seed 1000    all  ({} of at most {max_episodes} episodes saved; process ",
        saved[0]
    );
    assert!(list.starts_with(&expected), "{list}");
    let errors = study.finish(&[]);
    assert_eq!(resumed(&errors, saved[0]), 1, "{errors}");
    study.assert_same_as_whole();
}

#[test]
fn a_run_that_gets_term_continues() {
    assert_continues_after_term(&text("cartpole.ron", 2500, 1), 2500);
}

#[test]
fn a_run_with_a_replay_buffer_that_gets_term_continues() {
    assert_continues_after_term(&text("cartpole_q.ron", 350, 1), 350);
}

/// Agents whose episodes have no common start: the state of their environment is part of the checkpoint.
#[test]
fn an_asynchronous_run_that_is_killed_continues() {
    let text = text("cartpole.ron", 200, 1).replace(
        "set: [",
        "set: [\"schedule=Asynchronous(training: (env_steps: 7))\", ",
    );
    let study = Stopped::new(&text);
    study.stop("KILL", &[&EVERY_ROUND], is_saved_after(30));
    let saved = study.saved_episodes()[0];
    assert_eq!(resumed(&study.finish(&[]), saved), 1);
    study.assert_same_as_whole();
}

/// A run is stopped alone, continues together with two others in a shared world, is stopped there,
/// continues alone again, and the others together.
#[test]
fn runs_in_a_shared_world_continue() {
    let study = Stopped::new(&text("cartpole.ron", 1200, 3));
    // Early, so that this run lasts as long as the others afterwards.
    let arguments: [&[&str]; 2] = [&EVERY_ROUND, &["--index", "1"]];
    study.stop("TERM", &arguments, is_saved_after(50));
    let alone = study.saved_episodes()[0];
    // Of earlier processes only the checkpoint counts.
    for mark in study.files("running") {
        fs::remove_file(mark).unwrap();
    }
    // With one job, three runs are marked at once only if they share a world.
    let output = study.stop("TERM", &[&AT_INTERRUPTIONS], |study| study.marks() == 3);
    assert_eq!(resumed(&stderr(&output), alone), 1, "{}", stderr(&output));
    let together = study.saved_episodes();
    assert!(
        together.len() == 3 && together[1] > alone,
        "{alone}, {together:?}"
    );
    assert_eq!(resumed(&study.finish(&["--index", "1"]), together[1]), 1);
    assert_eq!(study.files("checkpoint").len(), 2);
    let errors = study.finish(&[]);
    for episodes in [together[0], together[2]] {
        assert!(resumed(&errors, episodes) >= 1, "{errors}");
    }
    study.assert_same_as_whole();
}

fn is_saved_after(episodes: u32) -> impl Fn(&Stopped) -> bool {
    move |study| {
        let is_far = |saved: &u32| *saved >= episodes;
        !study.files("checkpoint").is_empty() && study.saved_episodes().first().is_some_and(is_far)
    }
}

/// A killed process may leave a checkpoint that is not complete, which is removed at the end.
#[test]
fn a_killed_run_continues_from_its_latest_checkpoint() {
    let study = Stopped::new(&text("cartpole.ron", 500, 1));
    let output = study.stop("KILL", &[&EVERY_ROUND], is_saved_after(50));
    assert_eq!(output.status.code(), None);
    let checkpoint = study.files("checkpoint")[0].clone();
    let incomplete = PathBuf::from(format!("{}.abcdef.part", checkpoint.display()));
    fs::write(incomplete, "begun").unwrap();
    let saved = study.saved_episodes()[0];
    assert_eq!(resumed(&study.finish(&[]), saved), 1);
    study.assert_same_as_whole();
}

/// A checkpoint of `text`, and what it was found in.
fn checkpoint_of(text: &str) -> (Stopped, PathBuf, Vec<u8>) {
    let study = Stopped::new(text);
    study.stop("KILL", &[&EVERY_ROUND], is_saved_after(20));
    let path = study.files("checkpoint")[0].clone();
    let bytes = fs::read(&path).unwrap();
    (study, path, bytes)
}

/// Position of the first byte of the head after its length and its seal: of the build.
const BUILD: usize = 4 + 32;

/// Position of the version in the seal of the head, and of the hash.
const VERSION: usize = 4 + 12;
const HASH: usize = 4 + 24;

/// Makes the checksums right after a change, as a program that writes such a file would.
fn seal_again(mut bytes: Vec<u8>) -> Vec<u8> {
    let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
    let mut sealed = bytes[4 + 8..HASH].to_vec();
    sealed.extend(&bytes[BUILD..4 + length]);
    bytes[HASH..BUILD].copy_from_slice(&xxh64(&sealed, 0).to_le_bytes());
    bytes.truncate(bytes.len() - 8);
    let checksum = xxh64(&bytes, 0).to_le_bytes();
    bytes.extend(checksum);
    bytes
}

fn flipped(bytes: &[u8], position: usize) -> Vec<u8> {
    let mut changed = bytes.to_vec();
    changed[position] ^= 4;
    changed
}

/// A checkpoint that cannot be trusted costs a warning and time.
#[test]
fn damaged_and_foreign_checkpoints_are_not_used() {
    let (study, path, bytes) = checkpoint_of(&text("cartpole.ron", 100, 1));
    assert_eq!(seal_again(bytes.clone()), bytes);
    let (length, last) = (bytes.len(), bytes.len() - 1);
    let longer = [&bytes[..], b"x"].concat();
    for (contents, reason) in [
        (bytes[..length / 2].to_vec(), "is damaged: it has "),
        (bytes[..3].to_vec(), "is damaged: it has no beginning"),
        (longer, "is damaged: it has "),
        (
            flipped(&bytes, length / 2),
            "is damaged: its checksum does not match",
        ),
        (
            flipped(&bytes, last),
            "is damaged: its checksum does not match",
        ),
        (
            flipped(&bytes, BUILD),
            "is damaged: its checksum does not match",
        ),
        (flipped(&bytes, 5), "has another format"),
        (
            seal_again(flipped(&bytes, BUILD)),
            "was written by another build of seedbed",
        ),
        (
            seal_again(flipped(&bytes, VERSION)),
            "is of format 0; this seedbed reads format 4",
        ),
        // The first letter of the digest, after its length.
        (seal_again(flipped(&bytes, BUILD + 9)), "is of another run"),
    ] {
        fs::write(&path, contents).unwrap();
        let errors = study.finish(&[]);
        let expected = format!("warning: checkpoint {}: {reason}", path.display());
        assert!(errors.contains(&expected), "{reason}: {errors}");
        assert!(errors.contains("; its run starts again\n"), "{errors}");
        assert!(!errors.contains("resumed"), "{errors}");
        study.assert_same_as_whole();
        fs::remove_dir_all(study.out.join("runs")).unwrap();
        fs::create_dir(study.out.join("runs")).unwrap();
    }
    // The intact file is used, so that each refusal above is due to its change.
    fs::write(&path, &bytes).unwrap();
    assert!(study.finish(&[]).starts_with("resumed    "));
    study.assert_same_as_whole();
}

/// Other windows of episodes need samples that were not taken.
#[test]
fn a_checkpoint_with_samples_of_other_states_is_not_used() {
    let text = text("cartpole.ron", 100, 1);
    let (study, path, _) = checkpoint_of(&text);
    fs::write(&study.study, text.replace("First(40)", "First(10)")).unwrap();
    let errors = study.finish(&[]);
    let reason = "has samples of other visited states than the study needs now";
    let expected = format!("checkpoint {}: {reason}", path.display());
    assert!(errors.contains(&expected), "{errors}");
    study.assert_same_as_whole();
}

/// Replaces the first returns of agent 0 in a checkpoint, whose checksum is right again.
fn with_other_return(bytes: &[u8], returns: [f32; 3], first: f32) -> Vec<u8> {
    let pattern: Vec<u8> = returns.into_iter().flat_map(f32::to_le_bytes).collect();
    let found = |position: &usize| bytes[*position..].starts_with(&pattern);
    let positions: Vec<usize> = (0..bytes.len()).filter(found).collect();
    assert_eq!(positions.len(), 1, "the returns are stored once");
    let mut changed = bytes.to_vec();
    changed[positions[0]..positions[0] + 4].copy_from_slice(&first.to_le_bytes());
    seal_again(changed)
}

/// The first returns of agent 0 in the stored result.
fn first_returns(study: &Stopped) -> [f32; 3] {
    let plan =
        seedbed::study::design::plan::StudyPlan::load(Path::new(&study.study), false).unwrap();
    let folder = seedbed::study::store::StudyFolder::new(&study.out);
    let stored = folder.stored_run(&plan.runs()[0]).unwrap();
    let returns = &stored.outcome.unwrap().returns[0];
    [0, 1, 2].map(|episode| returns[episode] as f32)
}

/// A forged number in a checkpoint is in the result, so that the run did not start from its beginning.
/// `verify` starts from the beginning, and neither it nor other commands use or remove checkpoints.
#[test]
fn only_unfinished_runs_use_checkpoints() {
    let (study, path, bytes) = checkpoint_of(&text("cartpole.ron", 100, 1));
    study.finish(&[]);
    let returns = first_returns(&study);
    let forged = with_other_return(&bytes, returns, 1234.5);
    fs::write(&path, &forged).unwrap();
    let result = stored_results(&study.out);
    let out = study.out.to_str().unwrap();
    let merged = study.out.with_extension("merged");
    let merged_out = merged.to_str().unwrap();
    for arguments in [
        study_arguments(&study.study, out, &["verify"]),
        vec!["report", out],
        study_arguments(&study.study, out, &["list"]),
        study_arguments(&study.study, merged_out, &["merge", "--from", out]),
    ] {
        let output = seedbed(&arguments);
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(
            !stderr(&output).contains("checkpoint"),
            "{}",
            stderr(&output)
        );
        assert!(fs::read(&path).unwrap() == forged, "{arguments:?}");
    }
    assert!(stored_results(&study.out) == result && stored_results(&merged) == result);
    assert_eq!(
        names_in(&merged.join("runs")),
        result.keys().cloned().collect::<Vec<_>>()
    );
    // The next execution removes what is left of finished runs.
    study.finish(&["--shard", "0/1"]);
    assert!(!path.exists());
    fs::remove_file(path.with_extension("run")).unwrap();
    fs::write(&path, &forged).unwrap();
    study.finish(&[]);
    assert_eq!(first_returns(&study), [1234.5, returns[1], returns[2]]);
}

#[test]
fn processes_that_execute_the_same_run_do_not_disturb_each_other() {
    let study = Stopped::new(&text("cartpole.ron", 150, 1));
    let arguments: [&[&str]; 2] = [&EVERY_ROUND, &["--index", "0"]];
    let processes: Vec<Child> = (0..3).map(|_| study.start(&arguments)).collect();
    for process in processes {
        let output = process.wait_with_output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(!stderr(&output).contains("warning"), "{}", stderr(&output));
    }
    study.finish(&[]);
    study.assert_same_as_whole();
}
