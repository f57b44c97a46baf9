//! `seedbed run`.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::interruption::StopRequests;
use super::memory;
use super::progress::{AbortAfter, NoProgress, Observers, RunProgress};
use super::round_questions::RoundQuestions;
use super::{
    CliError, RunArgs, former_names, pluralize, project_log, ranks, warning_without_locks,
};
use seedbed::experiment::{self, Experiment, Loaded, RunEnding, RunReport};
use seedbed::export::live_curves::LiveCurves;
use seedbed::input_files::{self, Directory};
use seedbed::record::recording::{self, LiveTarget, RecordingFile, Server, Viewer};
use seedbed::run::folder::{Contents, RunFolder};
use seedbed::run::ranks::{Exchanged, Ranks, exchanged};
use seedbed::run::recorder::{Attempt, RecorderFactory};
use seedbed::run::training::thread_count;
use seedbed::run::{Observer, Options, RunError};
use seedbed::storage::file_lock::FileLock;
use seedbed::text::shell_word;
use seedbed_env::gymnasium::time_waited;

pub(super) fn run(args: &RunArgs) -> Result<(), CliError> {
    if args.mpi {
        return ranks::with_ranks(|ranks| {
            if ranks.is_first() {
                run_and_record(args, ranks)
            } else {
                follow(args, ranks)
            }
        });
    }
    ranks::check_is_single()?;
    run_and_record(args, Ranks::SINGLE)
}

/// Plays, learns and records for the agents of a rank that does not write the results.
fn follow(args: &RunArgs, ranks: Ranks) -> Result<(), CliError> {
    let (experiment, folder) = ranks.agree(load(args, ranks))?;
    let options = options(args, folder, ranks);
    let stop_requests = StopRequests::listen_silently();
    let interrupted = stop_requests.flag();
    let recording = run_recorder_factory(args, &options.folder, None);
    experiment.run_in_folder(&options, recording, &mut NoProgress, interrupted)?;
    let _own_part = exchanged(ranks);
    Ok(())
}

/// Reads the scenario, and checks what can be checked without touching the run's directory.
fn load(args: &RunArgs, ranks: Ranks) -> Result<(Arc<dyn Experiment>, RunFolder), CliError> {
    let mut overrides = args.overrides.clone();
    overrides.extend(args.seed.map(|seed| format!("seed={seed}")));
    let path = input_files::find_argument(&args.scenario, &[Directory::Scenarios])?;
    if args.ask_after_rounds && input_files::is_stream(&args.scenario) {
        let message =
            "the standard input has the answers of --ask-after-rounds; expected a scenario file";
        return Err(CliError::Usage(message.to_owned()));
    }
    check_can_be_divided(args, None, ranks)?;
    let Loaded {
        experiment,
        former_names,
    } = experiment::load(&path, &overrides)?;
    former_names::warn(&path, &former_names, &args.overrides);
    check_can_be_divided(args, Some(&*experiment), ranks)?;
    let folder = args.out.clone();
    let folder = RunFolder::new(folder.unwrap_or_else(|| experiment.default_folder()));
    check_save_initial(args, &*experiment)?;
    if !args.ignore_memory {
        let needed = experiment.memory() / u64::from(ranks.count());
        let checked = memory::check("this run", needed);
        checked.map_err(|error| at_replay(error, needed, &path, &overrides))?;
    }
    Ok((experiment, folder))
}

/// An error about memory, at the size of the replay buffer if the file says it and most is needed for it.
fn at_replay(error: CliError, needed: u64, path: &Path, overrides: &[String]) -> CliError {
    let message = error.to_string();
    let located = experiment::error_at_replay(path, overrides, needed / 2, &message);
    located.map_or(error, CliError::from)
}

/// An error if the run cannot be divided over the ranks. `experiment`: `None` before it is read
fn check_can_be_divided(
    args: &RunArgs,
    experiment: Option<&dyn Experiment>,
    ranks: Ranks,
) -> Result<(), CliError> {
    if ranks.is_single() {
        return Ok(());
    }
    let obstacle = match experiment {
        None => input_files::is_stream(&args.scenario).then(|| {
            "only one process can read it; expected a file that all processes can read".to_owned()
        }),
        Some(experiment) => experiment.ranks_obstacle(ranks),
    };
    obstacle.map_or(Ok(()), |obstacle| {
        let scenario = args.scenario.display();
        Err(CliError::Usage(format!(
            "cannot divide {scenario} over {} ranks: {obstacle}",
            ranks.count()
        )))
    })
}

fn options(args: &RunArgs, folder: RunFolder, ranks: Ranks) -> Options {
    Options {
        folder,
        resume: args.resume,
        other_versions: args.other_versions,
        threads: args.threads.map_or(0, usize::from),
        save_initial: args.save_initial,
        ranks,
    }
}

/// What rank 0 does, or the only process.
fn run_and_record(args: &RunArgs, ranks: Ranks) -> Result<(), CliError> {
    let prepared = load(args, ranks).and_then(|(experiment, folder)| {
        let live = live_target(args, &*experiment)?;
        let lock = prepare_output_folder(args, &*experiment, &folder)?;
        Ok((experiment, folder, live, lock))
    });
    let (experiment, folder, live, lock) = ranks.agree(prepared)?;
    project_log::add_runs(
        &args.scenario,
        &*experiment,
        std::iter::once(experiment.run_seed()),
    );
    let options = options(args, folder, ranks);
    if let (Some(LiveTarget::Serve(server)), false) = (&live, args.quiet) {
        say!(
            "serving    {0}; connect a viewer with: rerun --connect {0}",
            server.address()
        );
    }
    // Before anything is shown: whoever sees it may stop the run.
    let stop_requests = StopRequests::listen("stopping, at the latest after this round");
    if !args.quiet {
        print_warnings(&*experiment);
    }
    let (started, waited_before) = (Instant::now(), time_waited());
    let mut observer = observer(args, &*experiment, &options.folder)?;
    let recorder_factory = run_recorder_factory(args, &options.folder, live);
    let interrupted = stop_requests.flag();
    let ending = experiment.run_in_folder(&options, recorder_factory, &mut observer, interrupted);
    let steps_before = observer.steps_before;
    drop((observer, stop_requests));
    let ending = ending.map_err(|error| with_resume_hint(error, args, &options.folder))?;
    let seconds = started.elapsed().as_secs_f64();
    let exchanged = exchanged(ranks);
    match ending {
        RunEnding::Interrupted { after, can_resume } => Err(interruption_error(
            &after,
            can_resume,
            args,
            &options.folder,
        )),
        RunEnding::Elsewhere => Ok(()),
        RunEnding::Finished(report) => {
            lock.remove().map_err(|error| {
                CliError::Runtime(format!("the run is finished, but seedbed {error}"))
            })?;
            if args.quiet {
                if let Some(warning) = experiment.repeatability_warning() {
                    note!("warning: {warning}");
                }
            } else {
                let steps = steps_text(report.env_steps, steps_before, seconds);
                print_report(args, &*experiment, &report, &options, &steps);
                print_exchanged(&exchanged, seconds);
                let waited = time_waited().saturating_sub(waited_before);
                print_time_of_environment(waited, seconds, options.threads);
            }
            Ok(())
        }
    }
}

/// Prints why the run may not do what it seems to do, and whether its rounds are long. What cannot be repeated is
/// said at the end.
fn print_warnings(experiment: &dyn Experiment) {
    let said_later = experiment.repeatability_warning();
    let mut warnings = experiment.warnings();
    warnings.retain(|warning| Some(warning) != said_later.as_ref());
    for warning in warnings {
        note!("warning: {warning}");
    }
    if let Some(note) = experiment.round_cost_note() {
        note!("note       {note}");
    }
}

/// Prints how much of the time threads waited for an environment of Gymnasium, if they did.
fn print_time_of_environment(waited: Duration, seconds: f64, threads: usize) {
    if !waited.is_zero() {
        let share = waited.as_secs_f64() / seconds / thread_count(threads) as f64;
        say!(
            "workers    {:.0} % of the time of all threads was the environment's",
            100.0 * share.min(1.0)
        );
    }
}

/// An error if `--save-initial` is given for a scenario whose agents have no networks.
fn check_save_initial(args: &RunArgs, experiment: &dyn Experiment) -> Result<(), CliError> {
    if !args.save_initial || experiment.has_networks() {
        return Ok(());
    }
    Err(CliError::Usage(format!(
        "cannot save initial parameters of {}: tabular scenarios have no networks; run it without \
         --save-initial",
        args.scenario.display()
    )))
}

/// Factory of the recorder that writes the recording; `None` if the user or the build excludes
/// recordings. A resumed run gets the factory in all builds, because it continues with the recorders
/// with which it began.
fn run_recorder_factory(
    args: &RunArgs,
    folder: &RunFolder,
    live: Option<LiveTarget>,
) -> Option<Box<dyn RecorderFactory>> {
    let path = folder.recording_file();
    let is_recorded = !args.no_recording && (args.resume || recording::AVAILABLE);
    is_recorded.then(|| Box::new(RecordingFile { path, live }) as Box<dyn RecorderFactory>)
}

/// Factory of the recorder that writes a recording to `path`, without a live viewer.
pub(super) fn recorder_factory_at(path: &Path) -> Box<dyn RecorderFactory> {
    Box::new(RecordingFile {
        path: path.to_owned(),
        live: None,
    })
}

/// All that follows the run, in the order in which it gets a round.
fn observer(
    args: &RunArgs,
    experiment: &dyn Experiment,
    folder: &RunFolder,
) -> Result<Observers, CliError> {
    let mut observers: Vec<Box<dyn Observer>> = vec![if args.quiet {
        Box::new(NoProgress)
    } else {
        Box::new(RunProgress::new(experiment.name()))
    }];
    if let Some(curves) = &args.tensorboard {
        let begun = LiveCurves::begin(curves, args.resume, |reason| note!("warning: {reason}"));
        let begun = begun.map_err(|error| {
            CliError::Runtime(format!("cannot write to {}: {error}", curves.display()))
        })?;
        observers.push(Box::new(begun));
    }
    if args.ask_after_rounds {
        observers.push(Box::new(RoundQuestions {
            name: experiment.name().to_owned(),
            agents: experiment.agents(),
            folder: folder.path().to_owned(),
        }));
    }
    if let Some(rounds) = args.abort_after_rounds {
        observers.push(Box::new(AbortAfter { rounds }));
    }
    Ok(Observers {
        all: observers,
        steps_before: 0,
    })
}

/// The viewer or server that shows the recording during the run; `None` without `--live` and
/// `--serve`.
fn live_target(
    args: &RunArgs,
    experiment: &dyn Experiment,
) -> Result<Option<LiveTarget>, CliError> {
    let is_live = args.live.is_some() || args.serve.is_some();
    if let (true, Some(obstacle)) = (is_live, experiment.recording_obstacle()) {
        let scenario = args.scenario.display();
        return Err(CliError::Usage(format!(
            "cannot show {scenario} in a viewer: {obstacle}"
        )));
    }
    let viewer = args
        .live
        .as_deref()
        .map(Viewer::connect)
        .transpose()?
        .map(LiveTarget::Push);
    let server = args
        .serve
        .map(Server::bind)
        .transpose()?
        .map(LiveTarget::Serve);
    Ok(viewer.or(server))
}

fn interruption_error(
    after: &str,
    can_resume: bool,
    args: &RunArgs,
    folder: &RunFolder,
) -> CliError {
    CliError::Interrupted(if can_resume {
        let command = resume_command(args, folder);
        format!("interrupted after {after}; resume with\n  {command}")
    } else {
        format!("interrupted after {after}; this run cannot be resumed, start it again")
    })
}

/// The error. If the recording of the run to resume is lost or damaged, the message includes the
/// command that continues without it. If a number is not finite, it includes the command that shows the
/// agents before. If a file could not be written and the run has a checkpoint,
/// the message includes the command that resumes from it.
fn with_resume_hint(error: RunError, args: &RunArgs, folder: &RunFolder) -> CliError {
    let is_write_error = matches!(
        error,
        RunError::Record(_) | RunError::Checkpoint(_) | RunError::File { .. }
    );
    let is_recording_lost = matches!(
        &error,
        RunError::Record(record) if record.attempt == Attempt::Resume
            && record.path == folder.unfinished_recording_file()
    );
    let is_diverged = matches!(error, RunError::Round(_));
    match CliError::from(error) {
        CliError::Runtime(message)
            if is_diverged && folder.contents() == Contents::UnfinishedRun =>
        {
            let path = folder.path().to_string_lossy();
            CliError::Runtime(format!(
                "{message}\nthe state after the round before is kept; look at it with\n  seedbed replay {}",
                shell_word(&path)
            ))
        }
        CliError::Runtime(message) if is_recording_lost => CliError::Runtime(format!(
            "{message}\nthe checkpoint is intact; continue the run without its recording with\n  {}",
            command_without_recording()
        )),
        CliError::Runtime(message)
            if is_write_error && !args.resume && folder.contents() == Contents::UnfinishedRun =>
        {
            CliError::Runtime(format!(
                "{message}\nthe newest checkpoint is kept; resume with\n  {}",
                resume_command(args, folder)
            ))
        }
        error => error,
    }
}

/// The command line of this process, with `--resume`. A scenario that came from a pipe is replaced by
/// its copy in the run's directory.
fn resume_command(args: &RunArgs, folder: &RunFolder) -> String {
    if input_files::is_stream(&args.scenario) {
        let paths = [&folder.scenario_file(), folder.path()]
            .map(|path| path.to_string_lossy().into_owned());
        let [scenario, out] = paths.each_ref().map(|path| shell_word(path));
        return format!("seedbed run {scenario} --out {out} --resume");
    }
    let mut words: Vec<String> = std::env::args()
        .filter(|word| word != "--overwrite")
        .map(|word| shell_word(&word).into_owned())
        .collect();
    if !args.resume {
        words.push("--resume".to_owned());
    }
    words.join(" ")
}

/// The command line of this process, without a recording.
fn command_without_recording() -> String {
    let is_live = |word: &String| word.starts_with("--live") || word.starts_with("--serve");
    let words = std::env::args().filter(|word| !is_live(word));
    let words = words.chain(["--no-recording".to_owned()]);
    let words: Vec<String> = words.map(|word| shell_word(&word).into_owned()).collect();
    words.join(" ")
}

/// Locks the output directory for this process, and clears it unless the run is resumed. An error
/// if a run would be overwritten without `--overwrite`.
fn prepare_output_folder(
    args: &RunArgs,
    experiment: &dyn Experiment,
    folder: &RunFolder,
) -> Result<FileLock, CliError> {
    let elsewhere = if args.out.is_some() {
        "another --out"
    } else {
        "another --seed or --out"
    };
    let contents = folder.contents();
    let path = folder.path().display().to_string();
    // First, since a run that has just begun has no checkpoint yet.
    let begun = (contents == Contents::RunWithoutCheckpoint).then(|| lock(folder, elsewhere));
    let begun = begun.transpose()?;
    if let Some(refusal) = refusal(args, contents, &path, elsewhere) {
        return Err(CliError::Usage(refusal));
    }
    let lock = begun.map_or_else(|| lock(folder, elsewhere), Ok)?;
    if !lock.is_effective() {
        note!("{}", warning_without_locks(folder.path()));
    }
    if !args.resume && contents != Contents::Nothing {
        // Nothing is deleted for a run that cannot begin.
        experiment.check_start()?;
        let cleared = folder.clear();
        cleared.map_err(|error| cannot_write_to(&path, &error))?;
        warn_of_other_files(folder);
    }
    Ok(lock)
}

/// Warns of files that stay beside the new run, such as a picture of the former one.
fn warn_of_other_files(folder: &RunFolder) {
    let names = folder.other_files();
    if !names.is_empty() {
        note!(
            "warning: kept in {}, and not of this run: {}",
            folder.path().display(),
            names.join(", ")
        );
    }
}

/// Locks an output directory for this process.
fn lock(folder: &RunFolder, elsewhere: &str) -> Result<FileLock, CliError> {
    let path = folder.path().display().to_string();
    let lock = folder.lock();
    let lock = lock.map_err(|error| cannot_write_to(&path, &error))?;
    lock.ok_or_else(|| {
        CliError::Usage(format!(
            "another seedbed process is writing to {path}; choose {elsewhere}"
        ))
    })
}

fn cannot_write_to(path: &str, error: &std::io::Error) -> CliError {
    CliError::Runtime(format!("cannot write to {path}: {error}"))
}

/// Why the run must not write to the directory `path` with these contents; `None` if it may.
fn refusal(args: &RunArgs, contents: Contents, path: &str, elsewhere: &str) -> Option<String> {
    let choice = format!("{elsewhere} to keep both, or --overwrite to replace it");
    match (contents, args.resume, args.overwrite) {
        (Contents::OtherFiles, _, _) => Some(format!(
            "{path} is not empty and does not contain a seedbed run; choose {elsewhere}"
        )),
        (Contents::FinishedRun, true, _) => Some(format!(
            "the run in {path} is finished; there is nothing to resume"
        )),
        (Contents::Nothing | Contents::RunWithoutCheckpoint, true, _) => Some(format!(
            "{path} contains no checkpoint to resume from; start a new run without --resume"
        )),
        (Contents::FinishedRun, false, false) => {
            Some(format!("{path} contains a finished run; choose {choice}"))
        }
        (Contents::UnfinishedRun, false, false) => Some(format!(
            "{path} contains an interrupted run; choose --resume to continue it, {choice}"
        )),
        _ => None,
    }
}

fn print_report(
    args: &RunArgs,
    experiment: &dyn Experiment,
    report: &RunReport,
    options: &Options,
    steps: &str,
) {
    let (episodes, team) = (
        pluralize(report.episodes_per_agent, "episode"),
        pluralize(experiment.agents() as usize, "agent"),
    );
    say!("finished   {episodes} per agent, {team}, {steps}");
    for (label, text) in &report.lines {
        say!("{label:<10} {text}");
    }
    let path = options.folder.recording_file();
    if path.is_file() {
        say!(
            "recording  {} ({}); open it with",
            path.display(),
            file_size(&path)
        );
        say!("             rerun {}", path.display());
    } else if let Some(obstacle) = recording_obstacle(args, experiment) {
        say!("recording  none: {obstacle}");
    }
}

/// Environment steps of a run, and the speed of this process. `before`: the steps of processes that it has resumed
fn steps_text(steps: u64, before: u64, seconds: f64) -> String {
    let own = steps.saturating_sub(before);
    let part = if before > 0 {
        format!(", {own} of them")
    } else {
        String::new()
    };
    let rate = own as f64 / seconds;
    format!("{steps} env steps{part} in {seconds:.1} s ({rate:.0} per second)")
}

/// What the exchange between ranks has cost, if there are several.
fn print_exchanged(exchanged: &[Exchanged], seconds: f64) {
    let [first, others @ ..] = exchanged else {
        return;
    };
    if others.is_empty() {
        return;
    }
    let mean =
        |value: fn(&Exchanged) -> f64| others.iter().map(value).sum::<f64>() / others.len() as f64;
    let bytes = mean(|rank| rank.bytes as f64);
    say!(
        "exchange   rank 0 received {}, in {:.2} s, and waited {:.0} % of the time for others",
        indicatif::HumanBytes(first.bytes),
        first.seconds,
        100.0 * first.seconds_waited / seconds
    );
    say!(
        "           other ranks received {}, in {:.2} s, and waited {:.0} % of the time (means)",
        indicatif::HumanBytes(bytes as u64),
        mean(|rank| rank.seconds),
        100.0 * mean(|rank| rank.seconds_waited) / seconds
    );
}

/// Why a run that the user wants to record is not recorded; `None` if it is recorded, or if the
/// user wants no recording.
fn recording_obstacle(args: &RunArgs, experiment: &dyn Experiment) -> Option<String> {
    if args.no_recording {
        None
    } else if recording::AVAILABLE {
        experiment.recording_obstacle()
    } else {
        Some("this build has no feature `rerun`".to_owned())
    }
}

fn file_size(path: &Path) -> String {
    let bytes = path.metadata().map_or(0, |metadata| metadata.len());
    indicatif::HumanBytes(bytes).to_string()
}
