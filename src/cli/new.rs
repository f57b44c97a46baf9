//! `seedbed init` and `seedbed new`: files to start from.

use std::fs::{self, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Component, Path, PathBuf};

use super::{CliError, NewArgs, NewKind};
use seedbed::input_files::{self, Directory};
use seedbed::scenario::{self, Scenario};
use seedbed_env::gymnasium::{self, ADD_TIME_LIMIT, GymnasiumTask};
use seedbed_input::InputError;

const TASK: &str = include_str!("templates/task.ron");
const SCENARIO: &str = include_str!("templates/scenario.ron");
const STUDY: &str = include_str!("templates/study.ron");
const README: &str = include_str!("templates/README.md");

/// Beginning of `--env` for environments of Gymnasium.
pub(super) const GYMNASIUM: &str = "gymnasium:";

/// Name of the task and of the scenario in a new workspace.
const FIRST_NAME: &str = "short_pole";

/// What a new study is about.
struct StudySubject {
    title: &'static str,
    measure: &'static str,
    claim: &'static str,
}

/// For tasks with a threshold.
const EPISODES: StudySubject = StudySubject {
    title: "Does a larger team learn faster?",
    measure: "EpisodesToSolve",
    claim: r#"        (text: "Eight agents need fewer episodes of each agent than four.", source: "ours",
            compare: ("K 8", "K 4"), direction: Less, smallest: 5, confirmatory: true, expected: Deviation(8)),"#,
};

/// For tasks without a threshold.
const RETURNS: StudySubject = StudySubject {
    title: "Does a larger team learn more?",
    measure: "FinalReturn()",
    claim: r#"        // smallest: the smallest difference in the return that matters to you.
        (text: "Teams of eight agents have larger returns at the end than teams of four.", source: "ours",
            compare: ("K 8", "K 4"), direction: More, smallest: 10, confirmatory: true),"#,
};

/// A file that is to be written.
struct NewFile {
    path: PathBuf,
    text: String,
}

/// Writes a task, a scenario, a study and a README to a directory.
pub(super) fn init(folder: &Path) -> Result<(), CliError> {
    let folder = folder.strip_prefix(".").unwrap_or(folder);
    let files = [
        task(&folder.join("envs"), FIRST_NAME),
        scenario(
            &folder.join("scenarios"),
            FIRST_NAME,
            &format!("{FIRST_NAME:?}"),
        ),
        study(
            &folder.join("scenarios"),
            "team_size",
            FIRST_NAME,
            &EPISODES,
        ),
        NewFile {
            path: folder.join("README.md"),
            text: README.replace("{name}", FIRST_NAME),
        },
    ];
    write_all(&files)?;
    say!("\nNext:");
    if folder != Path::new("") {
        say!(
            "  cd {}",
            seedbed::text::shell_word(&folder.display().to_string())
        );
    }
    say!("  seedbed run {FIRST_NAME}");
    say!("  seedbed explore recordings/{FIRST_NAME}");
    say!("  seedbed plot recordings/{FIRST_NAME} --out run.png");
    say!("  seedbed film recordings/{FIRST_NAME}");
    Ok(())
}

/// Writes a task, a scenario or a study to the nearest `envs` or `scenarios`.
pub(super) fn new(args: &NewArgs) -> Result<(), CliError> {
    check_name(&args.name)?;
    let file = match args.kind {
        NewKind::Task => new_task(args)?,
        NewKind::Scenario => {
            let environment = args.environment.as_deref().unwrap_or("cartpole");
            let folder = nearest(Directory::Scenarios);
            let environment = if let Some(id) = environment.strip_prefix(GYMNASIUM) {
                let (text, task) = read_gymnasium(&args.name, &folder, id)?;
                if let Err(error) = task {
                    note!("{}", not_tried(&error));
                }
                text
            } else {
                check_exists(environment, Directory::Environments)?;
                format!("{environment:?}")
            };
            scenario(&folder, &args.name, &environment)
        }
        NewKind::Study => {
            let scenario = args.scenario.as_deref().unwrap_or("cartpole_team");
            let path = input_files::find_argument(Path::new(scenario), &[Directory::Scenarios])?;
            let subject = if has_no_threshold(&path) {
                RETURNS
            } else {
                EPISODES
            };
            study(
                &nearest(Directory::Scenarios),
                &args.name,
                scenario,
                &subject,
            )
        }
    };
    write_all(&[file])
}

/// What is wrong with the environment of a new scenario, which may lack settings therefore.
fn not_tried(error: &InputError) -> String {
    let reason = error.message.lines().next().unwrap_or_default();
    let help = error.help.as_ref();
    let help = help.map_or(String::new(), |help| format!("; {help}"));
    format!(
        "warning    the environment could not be tried, so the scenario may lack what it needs, such as `time_limit`: {reason}{help}"
    )
}

/// A task to start from, or an environment of Gymnasium with all that Python says of it.
fn new_task(args: &NewArgs) -> Result<NewFile, CliError> {
    let folder = nearest(Directory::Environments);
    let Some(environment) = args.environment.as_deref() else {
        return Ok(task(&folder, &args.name));
    };
    let Some(id) = environment.strip_prefix(GYMNASIUM) else {
        return Err(CliError::Usage(format!(
            "--env {environment}: expected `{GYMNASIUM}ID` for a new task, such as `{GYMNASIUM}CartPole-v1`"
        )));
    };
    let task = read_gymnasium(&args.name, &folder, id)?.1?;
    Ok(NewFile {
        path: folder.join(format!("{}.ron", args.name)),
        text: task.text_with_path(),
    })
}

/// The text of an environment of Gymnasium for a file in `folder`, with a time limit if it needs one, and what Python
/// says of it.
pub(super) fn read_gymnasium(
    name: &str,
    folder: &Path,
    id: &str,
) -> Result<(String, Result<GymnasiumTask, InputError>), CliError> {
    check_python_file(folder, id)?;
    let id = id_from(folder, id);
    // Paths that begin with `..` lead nowhere from a directory that does not exist.
    fs::create_dir_all(folder).map_err(|error| {
        CliError::Runtime(format!("cannot write {}: {error}", folder.display()))
    })?;
    let read = |settings: &str| {
        let text = format!("Gymnasium(id: {id:?}{settings})");
        let parsed = gymnasium::parse(name, "--env", folder, &format!("{text}\n"));
        (text, parsed.map(|(task, _)| task))
    };
    Ok(match read("") {
        (_, Err(error)) if error.help.as_deref() == Some(ADD_TIME_LIMIT) => {
            note!(
                "note       the environment says no time limit: change `time_limit: 1000` if its episodes may be longer"
            );
            read(", time_limit: 1000")
        }
        read => read,
    })
}

/// An error if an id names a Python file that exists neither in the working directory nor in `folder`.
fn check_python_file(folder: &Path, id: &str) -> Result<(), CliError> {
    let named = id.rsplit_once(':');
    let Some((file, _)) = named.filter(|(file, _)| is_python_file(file)) else {
        return Ok(());
    };
    if Path::new(file).is_file() || folder.join(file).is_file() {
        return Ok(());
    }
    Err(CliError::Usage(format!(
        "{GYMNASIUM}{id}: there is no file {file}"
    )))
}

/// The id of an environment as a file in `folder` names it: a Python file is looked up from the working directory
/// first.
fn id_from(folder: &Path, id: &str) -> String {
    let Some((file, function)) = id.rsplit_once(':') else {
        return id.to_owned();
    };
    let is_here = is_python_file(file) && Path::new(file).is_file();
    match relative_from(folder, Path::new(file)) {
        Some(path) if is_here => format!("{}:{function}", path.display()),
        _ => id.to_owned(),
    }
}

fn is_python_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|it| it == "py")
}

/// The path of a file relative to a directory, both relative to the working directory.
fn relative_from(folder: &Path, file: &Path) -> Option<PathBuf> {
    let [folder, file] = [folder, file].map(|path| std::path::absolute(path).ok());
    let (folder, file) = (folder?, file?);
    let shared = folder.components().zip(file.components());
    let shared = shared.take_while(|(one, other)| one == other).count();
    let up = folder
        .components()
        .skip(shared)
        .map(|_| Component::ParentDir);
    Some(up.chain(file.components().skip(shared)).collect())
}

fn task(folder: &Path, name: &str) -> NewFile {
    NewFile {
        path: folder.join(format!("{name}.ron")),
        text: TASK.replace("{name}", name),
    }
}

/// `environment`: as in a scenario, with quotes if it is a name
fn scenario(folder: &Path, name: &str, environment: &str) -> NewFile {
    NewFile {
        path: folder.join(format!("{name}.ron")),
        text: SCENARIO
            .replace("{name}", name)
            .replace("\"{environment}\"", environment),
    }
}

fn study(folder: &Path, name: &str, scenario: &str, subject: &StudySubject) -> NewFile {
    let path = folder.join(format!("{name}.ron"));
    NewFile {
        text: STUDY
            .replace("{path}", &format!("scenarios/{name}.ron"))
            .replace("{scenario}", scenario)
            .replace("{title}", subject.title)
            .replace("{measure}", subject.measure)
            .replace("{claim}", subject.claim),
        path,
    }
}

/// Whether runs of a scenario can never count as solved. What is wrong with a scenario is told when the study is
/// checked.
fn has_no_threshold(path: &Path) -> bool {
    let Ok(document) = input_files::read::<Scenario>(path) else {
        return false;
    };
    let task = scenario::read_task(&document, path);
    task.is_ok_and(|(task, _)| document.value.stop.threshold(task.spec()).is_none())
}

/// The nearest directory of this kind in the working directory or above it; one in the working
/// directory if there is none.
fn nearest(directory: Directory) -> PathBuf {
    let folders =
        seedbed_input::folders_upwards(&input_files::working_directory(), directory.name());
    match folders.first() {
        Some(folder) => input_files::relative_path(folder),
        None => PathBuf::from(directory.name()),
    }
}

/// An error unless a name can be a file's name and a word in a command.
fn check_name(name: &str) -> Result<(), CliError> {
    let is_valid = name
        .chars()
        .all(|c| c.is_alphanumeric() || c == '_' || c == '-');
    if is_valid && !name.is_empty() && !name.starts_with('-') {
        return Ok(());
    }
    Err(CliError::Usage(format!(
        "cannot use `{name}` as a name: expected letters, digits, `_` and `-`, without a directory or `.ron`"
    )))
}

fn check_exists(name: &str, directory: Directory) -> Result<(), CliError> {
    input_files::find_argument(Path::new(name), &[directory])?;
    Ok(())
}

/// Writes all files, or none if one of them exists.
fn write_all(new_files: &[NewFile]) -> Result<(), CliError> {
    let existing = new_files
        .iter()
        .find(|file| file.path.symlink_metadata().is_ok());
    if let Some(file) = existing {
        return Err(already_exists(&file.path));
    }
    for file in new_files {
        write(file)?;
        say!("wrote {}", file.path.display());
    }
    Ok(())
}

fn write(file: &NewFile) -> Result<(), CliError> {
    let failed = |error: &std::io::Error| {
        CliError::Runtime(format!("cannot write {}: {error}", file.path.display()))
    };
    if let Some(folder) = file.path.parent() {
        fs::create_dir_all(folder).map_err(|error| failed(&error))?;
    }
    let mut options = OpenOptions::new();
    let opened = options.write(true).create_new(true).open(&file.path);
    let mut opened = opened.map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => already_exists(&file.path),
        _ => failed(&error),
    })?;
    opened
        .write_all(file.text.as_bytes())
        .map_err(|error| failed(&error))
}

fn already_exists(path: &Path) -> CliError {
    CliError::Usage(format!(
        "{} exists already; nothing was overwritten",
        path.display()
    ))
}
