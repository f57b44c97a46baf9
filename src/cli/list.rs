//! `seedbed list`.

use std::path::{Path, PathBuf};

use super::check::{MAX_NAMED_OBSERVATIONS, describe_tabular, format_actions};
use super::{Listed, pluralize};
use crate::run::Plan;
use crate::scenario::{self, Scenario};
use crate::study::plan::StudyPlan;
use crate::tabular::Algorithm as TabularAlgorithm;
use seedbed_env::input::{self, FileKind, InputError};
use seedbed_learn::algorithms::Algorithm;
use seedbed_learn::algorithms::catalogue::Parameter;

pub(super) fn list(what: Option<Listed>) {
    let wanted = |kind| what.is_none() || what == Some(kind);
    if wanted(Listed::Environments) {
        environments();
    }
    if wanted(Listed::Scenarios) {
        scenarios();
    }
    if wanted(Listed::Algorithms) {
        algorithms();
    }
}

fn environments() {
    for_each_file("Environments", "envs", |path, _| {
        match seedbed_env::load(path) {
            Ok(description) => print_environment(description.spec()),
            Err(error) => say!("  {}\n      invalid: {error}", path.display()),
        }
    });
}

fn print_environment(spec: &seedbed_env::Spec) {
    say!("  {}\n      {}", spec.name, spec.description);
    let few = spec.observation_width() < MAX_NAMED_OBSERVATIONS;
    let shown = &spec.observations[..if few { spec.observation_width() } else { 3 }];
    let width = shown
        .iter()
        .map(|quantity| quantity.name.chars().count())
        .max()
        .unwrap_or(0);
    for seedbed_env::Quantity {
        name,
        unit,
        range: [low, high],
    } in shown
    {
        say!(
            "{}",
            format!("      observation  {name:<width$} {low} to {high} {unit}").trim_end()
        );
    }
    if !few {
        say!("      observation  … {} in total", spec.observation_width());
    }
    say!("      action       {}", format_actions(spec));
    say!(
        "      episode      at most {} of {} s",
        pluralize(spec.time_limit as usize, "step"),
        spec.control_step
    );
}

fn scenarios() {
    for_each_file("Scenarios", "scenarios", |path, width| {
        match describe(path) {
            Ok(words) => say!("  {:<width$} {words}", path.display()),
            Err(error) => say!("  {}\n      invalid: {error}", path.display()),
        }
    });
}

/// One-line description of a scenario or a study.
fn describe(path: &Path) -> Result<String, InputError> {
    match input::file_kind(&path.display().to_string(), &input::read_text(path)?)? {
        FileKind::Study => Ok(describe_study(&StudyPlan::load(path, false)?)),
        FileKind::TabularScenario => describe_tabular(path),
        FileKind::Scenario | FileKind::Environment | FileKind::TabularEnvironment => {
            Ok(describe_scenario(&Plan::load(path, &[])?))
        }
    }
}

fn describe_study(plan: &StudyPlan) -> String {
    let (cells, runs) = (
        pluralize(plan.cells.len(), "cell"),
        pluralize(plan.repeats() as usize, "run"),
    );
    format!("study: {}; {cells}, {runs} each", plan.study().title)
}

fn describe_scenario(plan: &Plan) -> String {
    let agents = pluralize(plan.scenario.agents.count.get() as usize, "agent");
    let episodes = pluralize(plan.scenario.max_episodes() as usize, "episode");
    format!(
        "{agents} in {}, at most {episodes} each",
        plan.description.spec().name
    )
}

/// Calls `print` for every file in the directories of this name, here and in parent directories,
/// which is where names are looked up. The second argument is the length of the longest path.
fn for_each_file(title: &str, folder: &str, print: impl Fn(&Path, usize)) {
    let here = std::env::current_dir().unwrap_or_default();
    let folders = input::folders_upwards(&here, folder);
    if folders.is_empty() {
        say!(
            "{title}: none; no directory `{folder}` in {} or its parent directories\n",
            here.display()
        );
    }
    for found in folders.iter().map(|found| scenario::relative_path(found)) {
        say!("{title} ({})", found.join("").display());
        let files = ron_files(&found);
        let longest = files
            .iter()
            .map(|path| path.display().to_string().chars().count())
            .max()
            .unwrap_or(0);
        for path in &files {
            print(path, longest);
        }
        say!("");
    }
}

fn algorithms() {
    say!("Algorithms (`algorithm:` in a scenario)");
    for info in Algorithm::catalogue() {
        say!("  {}\n      {}", info.name, info.purpose);
        for parameter in &info.parameters {
            print_parameter(parameter);
        }
    }
    say!("\nTabular algorithms (`algorithm:` in a tabular scenario)");
    for choice in TabularAlgorithm::catalogue() {
        say!("  {}", choice.form);
        print_wrapped(&choice.meaning, "      ");
    }
    say!("\nOther fields of a scenario");
    for parameter in &Scenario::catalogue() {
        print_parameter(parameter);
    }
}

fn print_parameter(parameter: &Parameter) {
    say!("      {} [default: {}]", parameter.name, parameter.default);
    let expected = match parameter.expected.as_str() {
        "" => String::new(),
        expected => format!(" ({expected})"),
    };
    print_wrapped(&format!("{}{expected}", parameter.meaning), "          ");
    for choice in &parameter.choices {
        print_wrapped(
            &format!("{}: {}", choice.form, choice.meaning),
            "            ",
        );
    }
}

/// Prints a sentence, each line after `indent`.
fn print_wrapped(sentence: &str, indent: &str) {
    for line in wrapped(sentence, WIDTH) {
        say!("{indent}{line}");
    }
}

/// Maximum width of a description, in characters.
const WIDTH: usize = 100;

/// Breaks a sentence between words into lines of at most `width` characters.
fn wrapped(sentence: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = vec![String::new()];
    for word in sentence.split(' ') {
        let line = lines.last_mut().expect("there is a line");
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > width {
            lines.push(word.to_owned());
        } else {
            line.push_str(if line.is_empty() { "" } else { " " });
            line.push_str(word);
        }
    }
    lines
}

/// All `.ron` files in a directory and its subdirectories, sorted.
fn ron_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path());
    let mut files: Vec<PathBuf> = entries
        .flat_map(|path| {
            if path.is_dir() {
                ron_files(&path)
            } else {
                vec![path]
            }
        })
        .filter(|path| path.extension().is_some_and(|extension| extension == "ron"))
        .collect();
    files.sort();
    files
}
