//! Property tests over generated files: what is accepted runs.
//!
//! [`task`] and [`scenario`] generate files that are valid by construction, with every keyword of
//! their languages and with extreme numbers. If a file is accepted, it must run: to its end, or to
//! the error that names the quantity which is not finite. Each generator is itself tested: most of
//! its files must be accepted, and every keyword must occur in an accepted file.

pub(crate) mod scenario;
pub(crate) mod task;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use rand::RngExt;
use seedbed::run::Plan;
use seedbed_env::{Physics, TaskDescription};
use seedbed_input::InputError;
use seedbed_random::{Purpose, Stream, stream};

use crate::util::{command, stderr};

/// Share of the generated files that must be accepted.
const MIN_ACCEPTED: f64 = 0.6;

fn random(number: u32) -> Stream {
    stream(0, Purpose::Preview, 0, number)
}

/// A number: usually of an ordinary size, sometimes at a limit of single precision.
fn number(random: &mut Stream) -> f64 {
    const EXTREME: [f64; 8] = [0.0, 1.2e-38, 1e-30, 1e-10, 1e7, 1e18, 1e30, 3.4e38];
    let size = if random.random_ratio(1, 25) {
        EXTREME[random.random_range(0..EXTREME.len())]
    } else {
        (0.1 * f64::from(random.random_range(1..40))).min(4.0)
    };
    if random.random() { size } else { -size }
}

/// A number above 0.
fn positive(random: &mut Stream) -> f64 {
    let size = number(random).abs();
    if size > 0.0 { size } else { 1.0 }
}

/// The words of a text: names, keywords and numbers.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_alphanumeric() && c != '_')
}

/// How many of the generated files were accepted, and with which words.
#[derive(Default)]
struct Coverage {
    generated: u32,
    accepted: u32,
    words: BTreeSet<String>,
    errors: Vec<String>,
}

impl Coverage {
    fn add<T>(&mut self, text: &str, result: Result<T, InputError>) -> Option<T> {
        self.generated += 1;
        match result {
            Ok(value) => {
                self.accepted += 1;
                self.words.extend(words(text).map(str::to_owned));
                Some(value)
            }
            Err(error) => {
                self.errors.push(error.to_string());
                None
            }
        }
    }

    fn check<'a>(&self, keywords: impl IntoIterator<Item = &'a str>) {
        let share = f64::from(self.accepted) / f64::from(self.generated);
        assert!(
            share >= MIN_ACCEPTED,
            "{} of {} files were accepted; the first errors: {:#?}",
            self.accepted,
            self.generated,
            &self.errors[..self.errors.len().min(20)]
        );
        let missing: Vec<&str> = keywords
            .into_iter()
            .filter(|keyword| !self.words.contains(*keyword))
            .collect();
        assert!(missing.is_empty(), "in no accepted file: {missing:?}");
    }
}

#[test]
fn accepted_tasks_can_be_played() {
    let mut coverage = Coverage::default();
    for index in 0..1500 {
        let text = task::generate(&mut random(index));
        let result = seedbed_env::parse("task", "task.ron", text.clone());
        let Some(task) = coverage.add(&text, result) else {
            continue;
        };
        assert_can_be_played(&text, &task);
    }
    coverage.check(task::KEYWORDS.iter().copied());
}

/// Panics show the text of the task.
fn assert_can_be_played(text: &str, task: &TaskDescription) {
    let played = std::panic::catch_unwind(|| {
        task::play(task, Physics::Rapier, 100);
        if task::has_analytic_model(task) {
            task::play(task, Physics::Analytic, 100);
        }
    });
    assert!(played.is_ok(), "this task cannot be played:\n{text}");
}

/// Random agents play in generated tasks: no number that is not finite gets into the results.
#[test]
fn runs_in_accepted_tasks_end_or_name_what_is_not_finite() {
    let folder = tempfile::tempdir().unwrap();
    let mut diverged = 0;
    for index in 0..120 {
        let text = task::generate(&mut random(index));
        if seedbed_env::parse("task", "task.ron", text.clone()).is_err() {
            continue;
        }
        fs::write(folder.path().join("task.ron"), &text).unwrap();
        let scenario = r#"Scenario(environment: "task.ron", algorithm: Random, agents: (count: 2), stop: Episodes(2))"#;
        diverged += u32::from(!run(folder.path(), scenario, &[], &text));
    }
    assert!(diverged > 0, "no number was extreme enough");
}

#[test]
fn accepted_scenarios_run() {
    let folder = tempfile::tempdir().unwrap();
    scenario::write_tasks(folder.path());
    let generator = scenario::Generator::new();
    let mut coverage = Coverage::default();
    let path = folder.path().join("scenario.ron");
    for index in 0..9000 {
        let (text, overrides) = generator.generate(&mut random(index));
        fs::write(&path, &text).unwrap();
        let all = format!("{text} {}", overrides.join(" "));
        let accepted = coverage.add(&all, Plan::load(&path, &overrides));
        if accepted.is_some() && index < 100 {
            run(folder.path(), &text, &overrides, "");
        }
    }
    coverage.check(generator.keywords().iter().map(String::as_str));
}

/// Runs a scenario that was accepted. Returns whether it ran to its end; otherwise its error must
/// name what is not finite.
fn run(folder: &Path, scenario: &str, overrides: &[String], task: &str) -> bool {
    fs::write(folder.join("scenario.ron"), scenario).unwrap();
    let mut command = command(&["run", "--overwrite", "--quiet", "--out"]);
    command
        .arg(folder.join("out"))
        .arg(folder.join("scenario.ron"));
    for assignment in overrides {
        command.args(["--set", assignment]);
    }
    let output = command.output().unwrap();
    let printed = stderr(&output);
    let shown = format!("{scenario}\n{overrides:?}\n{task}\n{printed}");
    match output.status.code() {
        Some(0) => {
            assert!(
                !has_non_finite_result(folder),
                "a result is not finite:\n{shown}"
            );
            true
        }
        Some(1) => {
            assert!(printed.contains("non-finite "), "{shown}");
            false
        }
        status => panic!("exit status {status:?}:\n{shown}"),
    }
}

fn has_non_finite_result(folder: &Path) -> bool {
    let table = fs::read_to_string(folder.join("out/episodes.csv")).unwrap();
    table
        .lines()
        .skip(1)
        .flat_map(|row| row.split(','))
        .any(|value| value.parse::<f64>().is_ok_and(|value| !value.is_finite()))
}
