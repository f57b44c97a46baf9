//! `seedbed list`.

use std::path::{Path, PathBuf};

use super::check::{
    MAX_NAMED_OBSERVATIONS, describe_own_runs, describe_runs, describe_tabular, describe_tuning,
    format_actions,
};
use super::{CliError, ListKind, algorithms_page, pluralize};
use seedbed::input_files::{self, Directory};
use seedbed::run::Plan;
use seedbed::scenario::Scenario;
use seedbed::study::design::file::Study;
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::tuning::file::Tuning;
use seedbed::tabular::Algorithm as TabularAlgorithm;
use seedbed_env::TaskDescription;
use seedbed_input::{FileKind, InputError};
use seedbed_learn::algorithms::Algorithm;
use seedbed_learn::algorithms::catalog::Parameter;

/// Prints the text of the environment or scenario with this name.
pub(super) fn show(name: &Path, only_kind: Option<ListKind>) -> Result<(), CliError> {
    let directories: &[Directory] = match only_kind {
        Some(ListKind::Environments) => &[Directory::Environments],
        Some(ListKind::Scenarios) => &[Directory::Scenarios],
        Some(ListKind::Algorithms) => {
            let message = "--show prints environments and scenarios; for an algorithm, use `seedbed \
                           list algorithms`";
            return Err(CliError::Usage(message.to_owned()));
        }
        None => &[Directory::Environments, Directory::Scenarios],
    };
    let path = input_files::find_argument(name, directories)?;
    say!("// {}", path.display());
    say!("{}", input_files::read_text(&path)?.trim_end());
    if only_kind.is_none()
        && input_files::find_argument(name, &[Directory::Scenarios])
            .is_ok_and(|other| other != path)
    {
        note!(
            "note: for the scenario, use `seedbed list scenarios --show {}`",
            name.display()
        );
    }
    Ok(())
}

/// Prints what there is of a kind whose name contains `part`.
pub(super) fn list(only_kind: Option<ListKind>, part: &str) -> Result<(), CliError> {
    let count = match only_kind {
        None => {
            print_overview();
            return Ok(());
        }
        Some(ListKind::Environments) => print_environments(part),
        Some(ListKind::Scenarios) => print_scenarios(part),
        Some(ListKind::Algorithms) => print_algorithms(part),
    };
    if count == 0 {
        let message = format!("no name contains `{part}`; without it, all are listed");
        return Err(CliError::Usage(message));
    }
    Ok(())
}

/// Prints one line per environment, scenario and algorithm.
fn print_overview() {
    print_files(
        "Environments",
        Directory::Environments,
        "",
        |path, name, width| match read_task(path) {
            Ok(None) => print_line(name, width, UNKNOWN_BEFORE_PYTHON),
            Ok(Some(description)) => {
                let spec = description.spec();
                print_line(name, width, first_sentence(&spec.description));
            }
            Err(error) => say!("  {}\n      invalid: {error}", path.display()),
        },
    );
    print_scenarios("");
    let algorithms = Algorithm::catalog();
    let tabular = TabularAlgorithm::catalog();
    say!("Algorithms (`algorithm:` in a scenario)");
    for info in &algorithms {
        print_line(info.name, NAME_WIDTH, first_sentence(&info.purpose));
    }
    say!("\nTabular algorithms (`algorithm:` in a tabular scenario)");
    for choice in &tabular {
        let name = choice.form.split('(').next().unwrap_or_default();
        print_line(name, NAME_WIDTH, first_sentence(&choice.meaning));
    }
    say!(
        "\n`seedbed list environments` and `seedbed list algorithms` print details, `seedbed list --show NAME` a file"
    );
}

/// What is printed of an environment of Gymnasium whose file does not have what Python says of it.
const UNKNOWN_BEFORE_PYTHON: &str =
    "an environment of Gymnasium; `seedbed check` asks Python what it is";

/// Reads a task. `None` if this would run Python: a list starts no programs.
fn read_task(path: &Path) -> Result<Option<TaskDescription>, InputError> {
    let text = input_files::read_text(path)?;
    let kind = seedbed_input::file_kind(&path.display().to_string(), &text);
    if matches!(kind, Ok(FileKind::Gymnasium)) && !seedbed_env::gymnasium::is_complete(&text) {
        return Ok(None);
    }
    input_files::read_task(path).map(|(description, _)| Some(description))
}

/// Width of the column of algorithms.
const NAME_WIDTH: usize = 16;

fn print_line(name: &str, width: usize, description: &str) {
    say!("{}", format!("  {name:<width$} {description}").trim_end());
}

/// The text up to the end of its first sentence or, without an end, its first clause.
fn first_sentence(text: &str) -> &str {
    let end = text.find(". ").or_else(|| text.find("; "));
    end.map_or(text, |end| &text[..end]).trim_end_matches('.')
}

pub(super) fn print_markdown(only_kind: Option<ListKind>) -> Result<(), CliError> {
    if only_kind != Some(ListKind::Algorithms) {
        let message = "--markdown prints algorithms only: `seedbed list algorithms --markdown`";
        return Err(CliError::Usage(message.to_owned()));
    }
    say!("{}", algorithms_page::page().trim_end());
    Ok(())
}

fn print_environments(part: &str) -> usize {
    print_files(
        "Environments",
        Directory::Environments,
        part,
        |path, name, _| match read_task(path) {
            Ok(None) => say!("  {name}\n      {UNKNOWN_BEFORE_PYTHON}"),
            Ok(Some(description)) => print_environment(name, description.spec()),
            Err(error) => say!("  {}\n      invalid: {error}", path.display()),
        },
    )
}

/// `name`: what a scenario calls the environment
fn print_environment(name: &str, spec: &seedbed_env::TaskSpec) {
    say!("  {name}\n      {}", spec.description);
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

fn print_scenarios(part: &str) -> usize {
    print_files(
        "Scenarios",
        Directory::Scenarios,
        part,
        |path, name, width| match describe(path) {
            Ok(description) => say!("  {name:<width$} {description}"),
            Err(error) => say!("  {name}\n      invalid: {error}"),
        },
    )
}

/// One-line description of a scenario or a study.
fn describe(path: &Path) -> Result<String, InputError> {
    match seedbed_input::file_kind(&path.display().to_string(), &input_files::read_text(path)?)? {
        FileKind::Study => describe_study(path),
        FileKind::Tuning => {
            let tuning = Tuning::read(path)?.value;
            let search = describe_tuning(&tuning);
            Ok(format!("tuning: {}; {search}", tuning.title))
        }
        FileKind::TabularScenario => describe_tabular(path),
        FileKind::Scenario
        | FileKind::Environment
        | FileKind::TabularEnvironment
        | FileKind::Gymnasium => Ok(describe_scenario(&Plan::load(path, &[])?)),
    }
}

/// What a study is. Its cells are not read, unless some have results of others.
fn describe_study(path: &Path) -> Result<String, InputError> {
    let study = Study::read(path)?.value;
    let runs = if study.cells.iter().any(|cell| cell.results.is_some()) {
        describe_runs(&StudyPlan::load_before_results(path, false)?)
    } else {
        describe_own_runs(u64::from(study.repeats.get()))
    };
    let cells = pluralize(study.cell_count(), "cell");
    Ok(format!("study: {}; {cells}, {runs}", study.title))
}

fn describe_scenario(plan: &Plan) -> String {
    let agents = pluralize(plan.scenario.agents.count.get() as usize, "agent");
    let task = &plan.description.spec().name;
    let stop = &plan.scenario.stop;
    if let Some(steps) = stop.max_env_steps() {
        return format!("{agents} in {task}, {steps} env steps");
    }
    let episodes = pluralize(stop.max_episodes() as usize, "episode");
    format!("{agents} in {task}, at most {episodes} each")
}

/// Files of one place, which are listed together.
struct Group {
    place: String,
    /// What a file is called in a command, and its path.
    files: Vec<(String, PathBuf)>,
}

/// Prints the files of a directory whose name contains `part`, and returns their number: those in the
/// working directory and its parent directories, which are also looked up by name, and the built-in ones.
/// The second argument of `print_file` is what the file is called in a command, the third the length of
/// the longest such text of a group.
fn print_files(
    title: &str,
    directory: Directory,
    part: &str,
    print_file: impl Fn(&Path, &str, usize),
) -> usize {
    let mut count = 0;
    for mut group in groups(directory) {
        group.files.retain(|(name, _)| name.contains(part));
        if group.files.is_empty() {
            continue;
        }
        count += group.files.len();
        say!("{title} ({})", group.place);
        let lengths = group.files.iter().map(|(name, _)| name.chars().count());
        let max_length = lengths.max().unwrap_or(0);
        for (name, path) in &group.files {
            print_file(path, name, max_length);
        }
        say!("");
    }
    count
}

/// The files of each directory upwards, and the built-in files that none of them replaces.
fn groups(directory: Directory) -> Vec<Group> {
    let mut groups = Vec::new();
    let mut names_on_disk = Vec::new();
    for folder in
        seedbed_input::folders_upwards(&input_files::working_directory(), directory.name())
    {
        let folder = input_files::relative_path(&folder);
        let paths = files_of(directory, &folder);
        names_on_disk.extend(paths.iter().filter_map(|path| name_in(&folder, path)));
        groups.push(Group {
            place: folder.join("").display().to_string(),
            files: paths
                .into_iter()
                .map(|path| (shown_name(directory, &folder, &path), path))
                .collect(),
        });
    }
    let files: Vec<(String, PathBuf)> = directory
        .builtin_files()
        .filter(|(name, _)| !names_on_disk.iter().any(|on_disk| on_disk == name))
        .map(|(name, file)| (name.to_owned(), file.full_path()))
        .collect();
    if !files.is_empty() {
        groups.push(Group {
            place: "built in; use them by name in any directory".to_owned(),
            files,
        });
    }
    groups
}

/// What a file on the disk is called: a scenario by its path, for a command; an environment by its name,
/// for a scenario.
fn shown_name(directory: Directory, folder: &Path, path: &Path) -> String {
    let name = match directory {
        Directory::Environments => name_in(folder, path),
        Directory::Scenarios => None,
    };
    name.unwrap_or_else(|| path.display().to_string())
}

/// The name of a file in a folder: its path below the folder, without `.ron`, with `/`.
fn name_in(folder: &Path, path: &Path) -> Option<String> {
    let name = path.strip_prefix(folder).ok()?.with_extension("");
    let parts: Vec<&str> = name.iter().filter_map(|part| part.to_str()).collect();
    Some(parts.join("/"))
}

/// Prints algorithms and other fields of a scenario whose name contains `part`; returns their number.
fn print_algorithms(part: &str) -> usize {
    let algorithms = Algorithm::catalog();
    let algorithms = print_section(
        "Algorithms (`algorithm:` in a scenario)",
        algorithms.iter().filter(|info| info.name.contains(part)),
        |info| {
            say!("  {}\n      {}", info.name, info.purpose);
            info.parameters.iter().for_each(print_parameter);
        },
    );
    let tabular = TabularAlgorithm::catalog();
    let tabular = print_section(
        "Tabular algorithms (`algorithm:` in a tabular scenario)",
        tabular.iter().filter(|choice| choice.form.contains(part)),
        |choice| {
            say!("  {}", choice.form);
            print_wrapped(&choice.meaning, "      ");
        },
    );
    let fields = Scenario::catalog();
    let fields = print_section(
        "Other fields of a scenario",
        fields.iter().filter(|field| field.name.contains(part)),
        print_parameter,
    );
    algorithms + tabular + fields
}

/// Prints entries below a title, and an empty line; nothing if there are none. Returns their number.
fn print_section<T>(title: &str, entries: impl Iterator<Item = T>, print: impl Fn(T)) -> usize {
    let mut count = 0;
    for entry in entries {
        if count == 0 {
            say!("{title}");
        }
        print(entry);
        count += 1;
    }
    if count > 0 {
        say!("");
    }
    count
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

/// The files of a directory. Tasks may be beside the scenarios that use them, in folders of their own.
fn files_of(directory: Directory, folder: &Path) -> Vec<PathBuf> {
    let tasks = Directory::Environments.name();
    let mut files = ron_files(folder);
    if directory == Directory::Scenarios {
        let is_task = |path: &PathBuf| {
            let mut parts = path.strip_prefix(folder).unwrap_or(path).iter();
            parts.any(|part| part == tasks)
        };
        files.retain(|path| !is_task(path));
    }
    files
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
        .filter(|path| seedbed_input::is_ron(path))
        .collect();
    files.sort();
    files
}
