//! `seedbed list`.

use std::path::{Path, PathBuf};

use super::check::{MOST_SHOWN, actions};
use super::{Listed, counted, tabular};
use crate::agent::Algorithm;
use crate::agent::catalogue::Parameter;
use crate::env;
use crate::input::{self, InputError, Kind};
use crate::run::Plan;
use crate::scenario::{self, Scenario};
use crate::study::plan::StudyPlan;

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
    for_each_file("Environments", "envs", |path, _| match env::load(path) {
        Ok(description) => print_environment(&description.spec),
        Err(error) => say!("  {}\n      cannot be used: {error}", path.display()),
    });
}

fn print_environment(spec: &env::Spec) {
    say!("  {}\n      {}", spec.name, spec.description);
    let few = spec.observation_width() < MOST_SHOWN;
    let shown = &spec.observations[..if few { spec.observation_width() } else { 3 }];
    let width = shown
        .iter()
        .map(|quantity| quantity.name.chars().count())
        .max()
        .unwrap_or(0);
    for env::Quantity {
        name,
        unit,
        range: [low, high],
    } in shown
    {
        say!(
            "{}",
            format!("      observes  {name:<width$} {low} to {high} {unit}").trim_end()
        );
    }
    if !few {
        say!("      observes  … {} in all", spec.observation_width());
    }
    say!("      acts      {}", actions(spec));
    say!(
        "      {} of {} s at most",
        counted(spec.time_limit as usize, "step"),
        spec.control_step
    );
}

fn scenarios() {
    for_each_file("Scenarios", "scenarios", |path, width| {
        match described(path) {
            Ok(words) => say!("  {:<width$} {words}", path.display()),
            Err(error) => say!("  {}\n      cannot be used: {error}", path.display()),
        }
    });
}

/// A scenario or a study in a few words.
fn described(path: &Path) -> Result<String, InputError> {
    match input::kind(&path.display().to_string(), &input::read_text(path)?)? {
        Kind::Study => Ok(study_in_words(&StudyPlan::load(path, false)?)),
        Kind::TabularScenario => tabular::described(path),
        Kind::Scenario | Kind::Environment | Kind::TabularEnvironment => {
            Ok(scenario_in_words(&Plan::load(path, &[])?))
        }
    }
}

fn study_in_words(plan: &StudyPlan) -> String {
    let (cells, runs) = (
        counted(plan.cells.len(), "cell"),
        counted(plan.repeats() as usize, "run"),
    );
    format!("study: {}; {cells} of {runs}", plan.study().title)
}

fn scenario_in_words(plan: &Plan) -> String {
    let agents = counted(plan.scenario.agents.count.get() as usize, "agent");
    let episodes = counted(plan.scenario.most_episodes() as usize, "episode");
    format!(
        "{agents} in {}, {episodes} each at most",
        plan.description.spec.name
    )
}

/// Goes through the folders of this name here and further up, where names are looked for. `print` is told how long the longest of a
/// folder's paths is.
fn for_each_file(title: &str, folder: &str, print: impl Fn(&Path, usize)) {
    let here = std::env::current_dir().unwrap_or_default();
    let folders = input::folders_upwards(&here, folder);
    if folders.is_empty() {
        say!(
            "{title}: none, for there is no folder `{folder}` in {} or further up\n",
            here.display()
        );
    }
    for found in folders.iter().map(|found| scenario::shortened(found)) {
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
    for catalogued in Algorithm::catalogue() {
        say!("  {}\n      {}", catalogued.name, catalogued.purpose);
        for parameter in &catalogued.parameters {
            print_parameter(parameter);
        }
    }
    say!("\nTabular algorithms (`algorithm:` in a tabular scenario)");
    for (name, purpose) in crate::tabular::Algorithm::CATALOGUE {
        let mut lines = wrapped(purpose, WIDTH).into_iter();
        say!("  {name:<22} {}", lines.next().unwrap_or_default());
        lines.for_each(|line| say!("  {:<22}   {line}", ""));
    }
    say!("\nTeam and time (beside `algorithm:` in a scenario)");
    for parameter in &Scenario::catalogue() {
        print_parameter(parameter);
    }
}

fn print_parameter(parameter: &Parameter) {
    let mut lines = wrapped(parameter.meaning, WIDTH).into_iter();
    say!(
        "      {:<18} {}",
        parameter.name,
        lines.next().unwrap_or_default()
    );
    for line in lines {
        say!("      {:<18}   {line}", "");
    }
    say!("      {:<18}   default {}", "", parameter.default);
}

/// Columns that a meaning may take.
const WIDTH: usize = 100;

/// A sentence in lines of at most `width` characters, broken between words.
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

/// All `.ron` files below a folder, sorted.
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
