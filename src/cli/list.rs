//! `seedbed list`.

use std::path::{Path, PathBuf};

use super::check::{MAX_NAMED_OBSERVATIONS, describe_tabular, format_actions};
use super::{ListKind, pluralize};
use seedbed::run::Plan;
use seedbed::scenario::{self, Scenario};
use seedbed::study::plan::StudyPlan;
use seedbed::tabular::Algorithm as TabularAlgorithm;
use seedbed_env::input::{self, FileKind, InputError};
use seedbed_learn::algorithms::Algorithm;
use seedbed_learn::algorithms::catalogue::Parameter;

pub(super) fn list(only_kind: Option<ListKind>) {
    let is_listed = |kind: ListKind| only_kind.is_none_or(|only_kind| kind == only_kind);
    if is_listed(ListKind::Environments) {
        print_environments();
    }
    if is_listed(ListKind::Scenarios) {
        print_scenarios();
    }
    if is_listed(ListKind::Algorithms) {
        print_algorithms();
    }
}

fn print_environments() {
    print_files("Environments", "envs", |path, _| {
        match seedbed_env::load(path) {
            Ok(description) => print_environment(description.spec()),
            Err(error) => say!("  {}\n      invalid: {error}", path.display()),
        }
    });
}

fn print_environment(spec: &seedbed_env::TaskSpec) {
    say!("  {}\n      {}", spec.name, spec.description);
    let lists_all = spec.observation_width() < MAX_NAMED_OBSERVATIONS;
    let listed_observations = &spec.observations[..if lists_all {
        spec.observation_width()
    } else {
        3
    }];
    let name_width = listed_observations
        .iter()
        .map(|quantity| quantity.name.chars().count())
        .max()
        .unwrap_or(0);
    for seedbed_env::Quantity {
        name,
        unit,
        range: [low, high],
    } in listed_observations
    {
        say!(
            "{}",
            format!("      observation  {name:<name_width$} {low} to {high} {unit}").trim_end()
        );
    }
    if !lists_all {
        say!("      observation  … {} in total", spec.observation_width());
    }
    say!("      action       {}", format_actions(spec));
    say!(
        "      episode      at most {} of {} s",
        pluralize(spec.time_limit as usize, "step"),
        spec.control_step
    );
}

fn print_scenarios() {
    print_files("Scenarios", "scenarios", |path, width| {
        match describe(path) {
            Ok(description) => say!("  {:<width$} {description}", path.display()),
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

/// Calls `print_file` with every `.ron` file in the directories named `folder_name` in the working
/// directory and in its parent directories: the same directories in which names are looked up.
/// Prints `title` before the files of each directory. The second argument of `print_file` is the
/// length of the longest path, in characters.
fn print_files(title: &str, folder_name: &str, print_file: impl Fn(&Path, usize)) {
    let working_directory = std::env::current_dir().unwrap_or_default();
    let folders = input::folders_upwards(&working_directory, folder_name);
    if folders.is_empty() {
        say!(
            "{title}: none; no directory `{folder_name}` in {} or its parent directories\n",
            working_directory.display()
        );
    }
    for folder in folders.iter().map(|folder| scenario::relative_path(folder)) {
        say!("{title} ({})", folder.join("").display());
        let files = ron_files(&folder);
        let max_length = files
            .iter()
            .map(|path| path.display().to_string().chars().count())
            .max()
            .unwrap_or(0);
        for path in &files {
            print_file(path, max_length);
        }
        say!("");
    }
}

fn print_algorithms() {
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

/// Prints a sentence in lines of at most `MAX_LINE_WIDTH` characters, each after `indent`.
fn print_wrapped(sentence: &str, indent: &str) {
    for line in wrap(sentence, MAX_LINE_WIDTH) {
        say!("{indent}{line}");
    }
}

/// Maximum width of a line of a description without its indent, in characters.
const MAX_LINE_WIDTH: usize = 100;

/// Breaks a sentence between words into lines of at most `max_width` characters.
fn wrap(sentence: &str, max_width: usize) -> Vec<String> {
    let mut lines: Vec<String> = vec![String::new()];
    for word in sentence.split(' ') {
        let line = lines.last_mut().expect("there is at least one line");
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > max_width {
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
