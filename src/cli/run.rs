//! `seedbed run`.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use super::progress::{AbortAfter, NoProgress, RunProgress};
use super::{CliError, RunArgs, pluralize, tabular};
use crate::record::RecorderFactory;
use crate::record::recording::{self, LiveTarget, RecordingFile, Server, Viewer};
use crate::record::table::TableFiles;
use crate::run::folder::{Contents, FolderLock, RunFolder};
use crate::run::summary::{FINAL_WINDOW, Summary};
use crate::run::{self, Factories, Observer, Options, Plan, RunError, RunOutcome};
use crate::tabular::scenario::is_meant;
use crate::text::shell_word;

pub(super) fn run(args: &RunArgs) -> Result<(), CliError> {
    let mut overrides = args.overrides.clone();
    overrides.extend(args.seed.map(|seed| format!("seed={seed}")));
    if is_meant(&args.scenario) {
        return tabular::run(args, &overrides);
    }
    let plan = Plan::load(&args.scenario, &overrides)?;
    let folder = args
        .out
        .as_ref()
        .map_or_else(|| plan.default_folder(), RunFolder::new);
    let audience = audience(args)?;
    let lock = lock_output_dir(args, &folder)?;
    let threads = args.threads.map_or(0, usize::from);
    let options = Options {
        folder,
        resume: args.resume,
        threads,
    };
    if let (Some(LiveTarget::Serve(server)), false) = (&audience, args.quiet) {
        say!(
            "serving    {0}; connect a viewer with: rerun --connect {0}",
            server.address()
        );
    }
    let started = Instant::now();
    let mut observer = observer(args, &plan);
    let ending = run::execute(
        &plan,
        &options,
        factories(args, &options, audience),
        &mut *observer,
        &interruption("stopping after this round"),
    );
    drop(observer);
    match ending.map_err(|error| with_resume_hint(error, args, &options.folder))? {
        RunOutcome::Interrupted { rounds } => Err(CliError::Runtime(format!(
            "interrupted after {}; resume with\n  {}",
            pluralize(rounds as usize, "round"),
            resume_command(args)
        ))),
        RunOutcome::Finished(summary) => {
            lock.release()
                .map_err(|error| CliError::Runtime(error.to_string()))?;
            if !args.quiet {
                print(&summary, &options.folder, started.elapsed().as_secs_f64());
            }
            Ok(())
        }
    }
}

/// The tables, and the recording unless the user wants none. A resumed run continues with the
/// recorders that it began with, so it is handed both.
fn factories(args: &RunArgs, options: &Options, live: Option<LiveTarget>) -> Factories {
    let folder = &options.folder;
    let mut factories: Factories = vec![Box::new(TableFiles {
        folder: folder.path().to_owned(),
    })];
    if args.resume || (recording::AVAILABLE && !args.no_recording) {
        let path = folder.recording();
        factories.push(Box::new(RecordingFile { path, live }));
    }
    factories
}

/// A recording at `path` that no viewer is shown while it is written.
pub(super) fn recording(path: &Path) -> Box<dyn RecorderFactory> {
    Box::new(RecordingFile {
        path: path.to_owned(),
        live: None,
    })
}

fn observer(args: &RunArgs, plan: &Plan) -> Box<dyn Observer> {
    let shown: Box<dyn Observer> = if args.quiet {
        Box::new(NoProgress)
    } else {
        Box::new(RunProgress::new(plan))
    };
    match args.abort_after_rounds {
        Some(rounds) => Box::new(AbortAfter::new(rounds, shown)),
        None => shown,
    }
}

/// The viewer or server that shows the recording during the run.
fn audience(args: &RunArgs) -> Result<Option<LiveTarget>, CliError> {
    let viewer = args
        .live
        .as_deref()
        .map(Viewer::connect)
        .transpose()?
        .map(LiveTarget::Push);
    let visitors = args
        .serve
        .map(Server::bind)
        .transpose()?
        .map(LiveTarget::Serve);
    Ok(viewer.or(visitors))
}

/// The error, with the command that resumes from the newest checkpoint if writing failed and there
/// is one.
fn with_resume_hint(error: RunError, args: &RunArgs, folder: &RunFolder) -> CliError {
    let is_write_error = matches!(
        error,
        RunError::Record(_) | RunError::Checkpoint(_) | RunError::File { .. }
    );
    match CliError::from(error) {
        CliError::Runtime(message)
            if is_write_error && !args.resume && folder.contents() == Contents::UnfinishedRun =>
        {
            CliError::Runtime(format!(
                "{message}\nthe newest checkpoint is kept; resume with\n  {}",
                resume_command(args)
            ))
        }
        error => error,
    }
}

/// The command line of this process, with `--resume`.
fn resume_command(args: &RunArgs) -> String {
    let mut words: Vec<String> = std::env::args()
        .filter(|word| word != "--overwrite")
        .map(|word| shell_word(&word).into_owned())
        .collect();
    if !args.resume {
        words.push("--resume".to_owned());
    }
    words.join(" ")
}

/// Locks the output directory for this process; refuses to overwrite a run without `--overwrite`.
pub(super) fn lock_output_dir(args: &RunArgs, folder: &RunFolder) -> Result<FolderLock, CliError> {
    let shown = folder.path().display();
    let before = folder.contents();
    let elsewhere = if args.out.is_some() {
        "another --out"
    } else {
        "another --seed or --out"
    };
    let choice = format!("{elsewhere} to keep both, or --overwrite to replace it");
    let refusal = match (before, args.resume, args.overwrite) {
        (Contents::OtherFiles, _, _) => Some(format!(
            "{shown} is not empty and does not contain a seedbed run; choose {elsewhere}"
        )),
        (Contents::FinishedRun, true, _) => Some(format!(
            "the run in {shown} is finished; there is nothing to resume"
        )),
        (Contents::Nothing | Contents::RunWithoutCheckpoint, true, _) => Some(format!(
            "{shown} contains no checkpoint to resume from; start a new run without --resume"
        )),
        (Contents::FinishedRun, false, false) => {
            Some(format!("{shown} contains a finished run; choose {choice}"))
        }
        (Contents::UnfinishedRun, false, false) => Some(format!(
            "{shown} contains an interrupted run; choose --resume to continue it, {choice}"
        )),
        _ => None,
    };
    if let Some(refusal) = refusal {
        return Err(CliError::Usage(refusal));
    }
    let write_error =
        |error: std::io::Error| CliError::Runtime(format!("cannot write to {shown}: {error}"));
    let lock = folder.lock().map_err(write_error)?;
    let lock = lock.ok_or_else(|| {
        CliError::Usage(format!(
            "another seedbed process is writing to {shown}; choose {elsewhere}"
        ))
    })?;
    if !args.resume && before != Contents::Nothing {
        folder.clear().map_err(write_error)?;
    }
    Ok(lock)
}

/// Flag that the first Ctrl-C sets after printing `message`; the second ends the process immediately.
/// There is one flag per process.
pub(super) fn interruption(message: &'static str) -> Arc<AtomicBool> {
    static INTERRUPTED: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    let interrupted = INTERRUPTED.get_or_init(|| {
        let interrupted = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&interrupted);
        let handler = ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
            eprintln!("\n{message}; press Ctrl-C again to stop immediately");
        });
        if let Err(error) = handler {
            eprintln!(
                "warning: cannot handle Ctrl-C ({error}); it will end the run without a checkpoint"
            );
        }
        interrupted
    });
    Arc::clone(interrupted)
}

fn print(summary: &Summary, folder: &RunFolder, seconds: f64) {
    let Summary {
        agents,
        episodes_per_agent,
        env_steps,
        final_return,
        ..
    } = summary;
    let rate = *env_steps as f64 / seconds;
    let (episodes, team) = (
        pluralize(*episodes_per_agent, "episode"),
        pluralize(*agents, "agent"),
    );
    say!(
        "finished   {episodes} per agent, {team}, {env_steps} env steps in {seconds:.1} s ({rate:.0} per second)"
    );
    say!("solved     {}", solved(summary));
    let last = pluralize(FINAL_WINDOW.min(*episodes_per_agent), "episode");
    say!("return     {final_return:.1} (mean over all agents and the last {last})");
    say!("coverage   {}", coverage(summary));
    say!("results    {}", folder.path().display());
    let path = folder.recording();
    if path.is_file() {
        say!(
            "recording  {} ({}); open it with",
            path.display(),
            size(&path)
        );
        say!("             rerun {}", path.display());
    } else if !recording::AVAILABLE {
        say!("recording  none: this build has no feature `rerun`");
    }
}

/// Printed for tasks without a threshold.
pub(super) const NO_THRESHOLD: &str = "no threshold set (`reward_threshold` or `stop: Solved`)";

fn solved(summary: &Summary) -> String {
    // Thresholds are stored in single precision; as f64 they would print spurious digits.
    let shown = |threshold: f64| threshold as f32;
    match (summary.solved_at, summary.episodes_until_solved) {
        (None, _) => NO_THRESHOLD.to_owned(),
        (Some(at), Some(episodes)) => {
            let (episodes, window) = (
                pluralize(episodes, "episode"),
                pluralize(at.window, "episode"),
            );
            format!(
                "after {episodes} per agent: mean return over {window} reached {}",
                shown(at.r#return)
            )
        }
        (Some(at), None) => {
            let window = pluralize(at.window, "episode");
            format!(
                "no: mean return over {window} did not reach {}",
                shown(at.r#return)
            )
        }
    }
}

fn coverage(summary: &Summary) -> String {
    const SHOWN: usize = 8;
    let percent = |fraction: &f64| format!("{:.1} %", 100.0 * fraction);
    let agents: Vec<String> = summary.coverage.iter().take(SHOWN).map(percent).collect();
    let more = if summary.coverage.len() > SHOWN {
        " …"
    } else {
        ""
    };
    format!(
        "{}{more} of the state space per agent; {} for the whole team",
        agents.join(", "),
        percent(&summary.team_coverage)
    )
}

fn size(path: &Path) -> String {
    let bytes = path.metadata().map_or(0, |metadata| metadata.len());
    indicatif::HumanBytes(bytes).to_string()
}
