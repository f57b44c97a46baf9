//! A checked task of Gymnasium, from which environments are built.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use super::failure::EnvironmentFailure;
use super::file::{DiscreteObservations, GymnasiumFile};
use super::found::{Found, FoundAction};
use super::messages::{Configuration, Description, Probe, ProbeRequest, Request};
use super::notice::with_notice;
use super::worker::Worker;
use super::worker_error::WorkerError;
use crate::{Action, Quantity, TaskSpec};
use seedbed_input::edit::to_ron_string;
use seedbed_input::numbers::{Count, FiniteNumber};
use seedbed_input::{InputError, Located, ValidationError, limits, nearest_name};
use seedbed_settings::sha256;

/// A task of Gymnasium.
#[derive(Clone, Debug, PartialEq)]
pub struct GymnasiumTask {
    /// File that the task was read from.
    pub origin: String,
    /// The task as an agent sees it.
    pub spec: TaskSpec,
    /// The settings, with what was found.
    pub(super) file: GymnasiumFile,
    /// Folder from which paths begin, and in which Python looks for modules.
    folder: PathBuf,
}

/// Help for environments that say no time limit.
pub const ADD_TIME_LIMIT: &str = "add `time_limit: 1000`";

/// Maximum size of a Python file, in bytes.
const MAX_SOURCE_BYTES: u64 = 1 << 24;

/// How many episodes of a probe are played twice.
const REPEATED_EPISODES: u32 = 3;

impl GymnasiumTask {
    /// The task with these settings. `folder`: where its file is. What the settings do not say is asked
    /// from the environment.
    ///
    /// # Errors
    /// Something in the settings is wrong, or the environment cannot be made.
    pub fn new(
        name: &str,
        origin: &str,
        folder: &Path,
        mut file: GymnasiumFile,
    ) -> Result<Self, ValidationError> {
        // Also of a file that is complete: it asks nothing, but its copies are made with them.
        if serde_json::to_value(file.kwargs.value()).is_err() {
            let message = "expected arguments that JSON can express: numbers, texts, lists, maps";
            return Err(file.kwargs.error(message));
        }
        match &file.found {
            None => file.found = Some(ask(&file, folder)?),
            Some(found) => check_source(&file, found, folder)?,
        }
        Ok(Self {
            origin: origin.to_owned(),
            spec: spec(name, &file)?,
            file,
            folder: folder.to_owned(),
        })
    }

    /// The text of the task's file with all that was found. A Python file is named without its folder.
    #[must_use]
    pub fn text(&self) -> String {
        let mut file = self.file.clone();
        if let Some((path, function)) = self.file.function() {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            file.id = format!("{name}:{function}").into();
        }
        to_ron_string("Gymnasium", &file)
    }

    /// Like [`text`](Self::text), with the path of the Python file.
    #[must_use]
    pub fn text_with_path(&self) -> String {
        to_ron_string("Gymnasium", &self.file)
    }

    /// What the environment says of itself.
    ///
    /// # Panics
    /// Never: it is asked when the task is read.
    #[must_use]
    pub fn found(&self) -> &Found {
        self.file
            .found
            .as_ref()
            .expect("asked when the task was read")
    }

    /// The settings of the task.
    #[must_use]
    pub fn settings(&self) -> &GymnasiumFile {
        &self.file
    }

    /// The Python file that makes the environment, if the task names one.
    #[must_use]
    pub fn python_file(&self) -> Option<PathBuf> {
        let (path, _) = self.file.function()?;
        Some(self.folder.join(path))
    }

    /// That results of this task cannot be repeated bit for bit, if the environment is such.
    #[must_use]
    pub fn repeatability_warning(&self) -> Option<String> {
        let difference = self.found().difference.as_ref()?;
        Some(format!(
            "results cannot be repeated bit for bit: episodes of `{}` do not depend on their seed alone \
             ({difference})",
            self.file.id.value()
        ))
    }

    /// The checksum of the files of a package that is not installed and may change at any time, if the environment is
    /// of one.
    #[must_use]
    pub fn package_files(&self) -> Option<&str> {
        let mut versions = self.found().versions.values();
        let files = versions.find(|version| version.starts_with("files "));
        files.map(String::as_str)
    }

    /// How the versions of Python and its packages differ from those with which the task was read; `None` if
    /// they are the same.
    ///
    /// # Errors
    /// The environment cannot be made.
    pub fn version_difference(&self) -> Result<Option<String>, EnvironmentFailure> {
        let started = Worker::start(&self.configuration(1), self.step_timeout());
        let (_, description) = started.map_err(|error| EnvironmentFailure {
            copy: None,
            place: String::new(),
            message: error.message(),
        })?;
        let (then, now) = (&self.found().versions, &description.versions);
        let version = |versions: &BTreeMap<String, String>, name: &str| {
            versions
                .get(name)
                .cloned()
                .unwrap_or_else(|| "no version".to_owned())
        };
        let differing = then
            .keys()
            .chain(now.keys())
            .find(|name| then.get(*name) != now.get(*name));
        Ok(differing.map(|name| {
            format!(
                "{name} {}; now it is {}",
                version(then, name),
                version(now, name)
            )
        }))
    }

    /// Number of worker processes for `copies` copies on `threads` threads.
    pub(crate) fn worker_count(&self, copies: usize, threads: usize) -> usize {
        let asked = self.file.workers.map(|count| count.get() as usize);
        asked.unwrap_or(threads).clamp(1, copies.max(1))
    }

    pub(super) fn configuration(&self, copies: usize) -> Configuration {
        configuration(&self.file, &self.folder, copies)
    }

    pub(super) fn step_timeout(&self) -> Duration {
        Duration::from_secs_f64(self.file.step_timeout.get())
    }

    /// Why results of `description`, which a worker gives now, are not those of this task.
    pub(super) fn difference_from(&self, description: &Description) -> Option<String> {
        let found = self.found();
        let source = description.source.as_ref().map(|source| &source.sha256);
        if found.source_sha256.is_some() && source != found.source_sha256.as_ref() {
            return Some(
                "its Python code has changed since `found` was written into the task's file; remove that field, so \
                 that Python is asked again. Results of before are those of another task"
                    .to_owned(),
            );
        }
        let has_same_shape = description.observations.len() == found.observations.len()
            && description.actions.len() == found.actions.len();
        (!has_same_shape)
            .then(|| "its observations or actions have changed since the task was read".to_owned())
    }
}

/// Reads a task file in `folder`. Returns the task and the text of its file with all that the
/// environment says of itself.
///
/// # Errors
/// Something in the text is wrong, or the environment cannot be made.
pub fn parse(
    name: &str,
    origin: &str,
    folder: &Path,
    text: &str,
) -> Result<(GymnasiumTask, String), InputError> {
    let document = seedbed_input::parse::<GymnasiumFile>(origin, text.to_owned())?;
    let task = GymnasiumTask::new(name, origin, folder, document.value.clone());
    let task = task.map_err(|error| document.locate(error))?;
    let is_complete = document.value.found.is_some() && document.value.function().is_none();
    let text = if is_complete {
        document.text
    } else {
        task.text()
    };
    Ok((task, text))
}

/// An error if the Python file of the task is another one than that of which `found` tells.
fn check_source(file: &GymnasiumFile, found: &Found, folder: &Path) -> Result<(), ValidationError> {
    let (Some((path, _)), Some(expected)) = (file.function(), &found.source_sha256) else {
        return Ok(());
    };
    // A file that cannot be read is reported when the environment is made.
    let source = limits::read_text(&folder.join(path), MAX_SOURCE_BYTES).ok();
    if source.is_none_or(|source| sha256(source) == *expected) {
        return Ok(());
    }
    let message = format!("`{}` has changed since `found` was written", path.display());
    let help = "remove the field `found`, so that Python is asked again; results of before are those of another task";
    Err(file.id.error(message).with_help(help))
}

fn configuration(file: &GymnasiumFile, folder: &Path, copies: usize) -> Configuration {
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let folder = folder.canonicalize().unwrap_or_default();
    let id = match file.function() {
        Some((path, function)) => format!("{}:{function}", folder.join(path).display()),
        None => file.id.to_string(),
    };
    Configuration {
        id,
        kwargs: serde_json::to_value(file.kwargs.value()).unwrap_or_default(),
        copies,
        time_limit: file.time_limit.map(Count::get),
        render: false,
        discrete: match file.discrete {
            DiscreteObservations::OneHot => "one_hot",
            DiscreteObservations::Number => "number",
        },
        log_info: file.log_info.to_vec(),
        path: vec![folder.display().to_string()],
    }
}

/// Asks the environment what the settings do not say. The same question is asked once per process.
fn ask(file: &GymnasiumFile, folder: &Path) -> Result<Found, ValidationError> {
    static ANSWERS: Mutex<BTreeMap<String, Found>> = Mutex::new(BTreeMap::new());
    let configuration = configuration(file, folder, 1);
    let question = serde_json::to_string(&(&configuration, file.probe_steps))
        .expect("plain data always serializes");
    let mut answers = ANSWERS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(found) = answers.get(&question) {
        return Ok(found.clone());
    }
    let found = ask_worker(file, &configuration)?;
    answers.insert(question, found.clone());
    Ok(found)
}

fn ask_worker(
    file: &GymnasiumFile,
    configuration: &Configuration,
) -> Result<Found, ValidationError> {
    let timeout = Duration::from_secs_f64(file.step_timeout.get());
    let (mut worker, description) =
        Worker::start(configuration, timeout).map_err(|error| located(file, &error))?;
    if file.time_limit.is_none() && description.time_limit.is_none() {
        return Err(no_time_limit(file));
    }
    let notice = format!(
        "`{}` plays {} steps with random actions to find the ranges of its observations; fewer with `probe_steps`",
        file.id.value(),
        file.probe_steps.get()
    );
    let probed = with_notice(notice, || {
        let request = ProbeRequest {
            steps: file.probe_steps.get(),
            seed: 0,
            seeds: REPEATED_EPISODES,
        };
        worker.allow(timeout * request.steps);
        worker.ask(Request::Probe, &request)
    });
    let probe: Probe = probed.map_err(|error| located(file, &error))?;
    Found::new(description, &probe).map_err(|message| file.id.error(message))
}

fn located(file: &GymnasiumFile, error: &WorkerError) -> ValidationError {
    let located = match error {
        WorkerError::Python(error) if error.kind == "info" => file.log_info.error(&error.message),
        error => file
            .id
            .error(format!("the environment fails: {}", error.message())),
    };
    match error.help() {
        Some(help) => located.with_help(help),
        None => located,
    }
}

fn no_time_limit(file: &GymnasiumFile) -> ValidationError {
    let message = "the environment says no time limit; each episode needs one";
    file.id.error(message).with_help(ADD_TIME_LIMIT)
}

/// The task as an agent sees it.
fn spec(name: &str, file: &GymnasiumFile) -> Result<TaskSpec, ValidationError> {
    let found = file.found.as_ref().expect("asked before");
    let time_limit = file.time_limit.or(found.time_limit);
    let time_limit = time_limit.ok_or_else(|| no_time_limit(file))?;
    let actions: Vec<Action> = found.actions.iter().map(action).collect();
    let quantities = quantities(file, found)?;
    Ok(TaskSpec {
        name: name.to_owned(),
        description: if file.description.is_empty() {
            format!("`{}` of Gymnasium", file.id.value())
        } else {
            file.description.clone()
        },
        control_step: found.control_step.get(),
        time_limit: time_limit.get(),
        reward_threshold: file
            .reward_threshold
            .or(found.reward_threshold)
            .map(FiniteNumber::get_f32),
        info: logged(file, &quantities, &actions)?,
        ..TaskSpec::new(name, quantities, actions)
    })
}

/// The entries of `info` that are recorded. Their range is that of their values.
fn logged(
    file: &GymnasiumFile,
    observations: &[Quantity],
    actions: &[Action],
) -> Result<Vec<Quantity>, ValidationError> {
    let actions = actions.iter().map(|action| &action.quantity);
    let mut used: Vec<&str> = observations
        .iter()
        .chain(actions)
        .map(|other| &*other.name)
        .collect();
    let mut logged = Vec::new();
    for name in file.log_info.iter() {
        if used.contains(&&**name) {
            return Err(file
                .log_info
                .error(format!("the name `{name}` is given twice")));
        }
        used.push(name);
        let unit = file.units.get(name).map_or("", String::as_str);
        logged.push(Quantity::new(name, unit, [0.0, 0.0]));
    }
    Ok(logged)
}

/// The observed numbers with the names, units and ranges that the settings give them.
fn quantities(file: &GymnasiumFile, found: &Found) -> Result<Vec<Quantity>, ValidationError> {
    let count = found.observations.len();
    if !file.names.is_empty() && file.names.len() != count {
        return Err(file.names.error(format!(
            "expected a name for each of the {count} observed numbers, found {}",
            file.names.len()
        )));
    }
    let mut quantities = Vec::new();
    for (index, observation) in found.observations.iter().enumerate() {
        let name = file.names.get(index).unwrap_or(&observation.name);
        if quantities
            .iter()
            .any(|other: &Quantity| other.name == *name)
        {
            return Err(file
                .names
                .error(format!("the name `{name}` is given twice")));
        }
        let range = file.ranges.get(name).unwrap_or(&observation.range).get();
        let unit = file.units.get(name).map_or("", String::as_str);
        quantities.push(Quantity::new(name, unit, range.map(|bound| bound as f32)));
    }
    let names = || quantities.iter().map(|quantity| &*quantity.name);
    check_names(&file.units, || {
        names().chain(file.log_info.iter().map(|name| &**name))
    })?;
    check_names(&file.ranges, names)?;
    Ok(quantities)
}

/// Checks that the keys of a map are names of observed numbers.
fn check_names<'a, T, N: Iterator<Item = &'a str>>(
    map: &Located<BTreeMap<String, T>>,
    names: impl Fn() -> N,
) -> Result<(), ValidationError> {
    let Some(unknown) = map.keys().find(|key| names().all(|name| name != **key)) else {
        return Ok(());
    };
    let error = map.error(format!("no observed number is named `{unknown}`"));
    Err(match nearest_name(unknown, names()) {
        Some(name) => error.with_help(format!("did you mean `{name}`?")),
        None => error.with_help("`seedbed check` shows all names"),
    })
}

fn action(found: &FoundAction) -> Action {
    match found {
        FoundAction::Discrete { name, count } => {
            let values: Vec<f32> = (0..count.get()).map(|index| index as f32).collect();
            Action::discrete(name, "", &values)
        }
        FoundAction::Continuous { name, range } => {
            Action::continuous(name, "", range.get().map(|bound| bound as f32))
        }
    }
}
