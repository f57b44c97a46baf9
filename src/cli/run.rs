//! `seedbed run`.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use super::progress::{Bar, Silent};
use super::{Failure, RunArgs, counted, tabular};
use crate::record::rerun::{Audience, Server, Viewer};
use crate::run::folder::{Claim, Contents, RunFolder};
use crate::run::summary::{FINAL_WINDOW, Summary};
use crate::run::{self, Ending, Observer, Options, Plan, RunError};
use crate::tabular::scenario::is_meant;

pub(super) fn run(args: &RunArgs) -> Result<(), Failure> {
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
    let claim = make_room(args, &folder)?;
    let threads = args.threads.map_or(0, usize::from);
    let options = Options {
        folder,
        resume: args.resume,
        threads,
        recording: !args.no_recording,
    };
    if let (Some(Audience::Visitors(server)), false) = (&audience, args.quiet) {
        say!(
            "serving    {0}; look with: rerun --connect {0}",
            server.address()
        );
    }
    let started = Instant::now();
    let mut observer: Box<dyn Observer> = if args.quiet {
        Box::new(Silent)
    } else {
        Box::new(Bar::new(&plan))
    };
    let ending = run::execute(
        &plan,
        &options,
        audience,
        &mut *observer,
        &interruption("stopping after this round"),
    );
    drop(observer);
    match ending.map_err(|error| with_way_on(error, args, &options.folder))? {
        Ending::Interrupted { rounds } => Err(Failure::Work(format!(
            "interrupted after {}; go on with\n  {}",
            counted(rounds as usize, "round"),
            resuming_command(args)
        ))),
        Ending::Finished(summary) => {
            claim
                .release()
                .map_err(|error| Failure::Work(error.to_string()))?;
            if !args.quiet {
                print(&summary, &options.folder, started.elapsed().as_secs_f64());
            }
            Ok(())
        }
    }
}

/// Who shall look at the recording.
fn audience(args: &RunArgs) -> Result<Option<Audience>, Failure> {
    let viewer = args
        .live
        .as_deref()
        .map(Viewer::connect)
        .transpose()?
        .map(Audience::Viewer);
    let visitors = args
        .serve
        .map(Server::bind)
        .transpose()?
        .map(Audience::Visitors);
    Ok(viewer.or(visitors))
}

/// What failed, and how to go on from the newest checkpoint, if there is one and it helps.
fn with_way_on(error: RunError, args: &RunArgs, folder: &RunFolder) -> Failure {
    let is_of_disk = matches!(
        error,
        RunError::Record(_) | RunError::Checkpoint(_) | RunError::File { .. }
    );
    match Failure::from(error) {
        Failure::Work(said)
            if is_of_disk && !args.resume && folder.contents() == Contents::UnfinishedRun =>
        {
            Failure::Work(format!(
                "{said}\nthe newest checkpoint is kept; go on with\n  {}",
                resuming_command(args)
            ))
        }
        failure => failure,
    }
}

/// What was typed, and `--resume`.
fn resuming_command(args: &RunArgs) -> String {
    let quoted = |word: String| {
        if word.contains([' ', '(', '\'', '"', '*']) {
            format!("'{word}'")
        } else {
            word
        }
    };
    let mut words: Vec<String> = std::env::args()
        .map(quoted)
        .filter(|word| word != "--overwrite")
        .collect();
    if !args.resume {
        words.push("--resume".to_owned());
    }
    words.join(" ")
}

/// Claims the folder, and sees to it that nothing is overwritten unasked.
pub(super) fn make_room(args: &RunArgs, folder: &RunFolder) -> Result<Claim, Failure> {
    let shown = folder.path().display();
    let before = folder.contents();
    let elsewhere = if args.out.is_some() {
        "another --out"
    } else {
        "another --seed or --out"
    };
    let choice = format!("keep both with {elsewhere}, replace it with --overwrite");
    let refusal = match (before, args.resume, args.overwrite) {
        (Contents::Other, _, _) => Some(format!(
            "{shown} is not empty, and what it holds is of no run; choose {elsewhere}"
        )),
        (Contents::FinishedRun, true, _) => Some(format!(
            "the run in {shown} is finished; there is nothing to resume"
        )),
        (Contents::Nothing | Contents::BrokenOffRun, true, _) => Some(format!(
            "{shown} holds no checkpoint to resume from; start afresh without --resume"
        )),
        (Contents::FinishedRun, false, false) => {
            Some(format!("{shown} holds a finished run; {choice}"))
        }
        (Contents::UnfinishedRun, false, false) => Some(format!(
            "{shown} holds a run that was interrupted; go on with --resume, {choice}"
        )),
        _ => None,
    };
    if let Some(refusal) = refusal {
        return Err(Failure::Input(refusal));
    }
    let fault = |error: std::io::Error| Failure::Work(format!("cannot write to {shown}: {error}"));
    let claim = folder.claim().map_err(fault)?;
    let claim = claim.ok_or_else(|| {
        Failure::Input(format!(
            "another seedbed is writing to {shown}; choose {elsewhere}"
        ))
    })?;
    if !args.resume && before != Contents::Nothing {
        folder.clear().map_err(fault)?;
    }
    Ok(claim)
}

/// Set by the first Ctrl-C, which says `what` happens now; the second ends the process at once. One for the whole process.
pub(super) fn interruption(what: &'static str) -> Arc<AtomicBool> {
    static INTERRUPTED: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    let interrupted = INTERRUPTED.get_or_init(|| {
        let interrupted = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&interrupted);
        let handler = ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
            eprintln!("\n{what}; press Ctrl-C again to stop at once");
        });
        if let Err(error) = handler {
            eprintln!("warning: Ctrl-C will end the run without a checkpoint ({error})");
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
        counted(*episodes_per_agent, "episode"),
        counted(*agents, "agent"),
    );
    say!(
        "finished   {episodes} of {team}, {env_steps} env steps in {seconds:.1} s ({rate:.0} a second)"
    );
    say!("solved     {}", solved(summary));
    let last = counted(FINAL_WINDOW.min(*episodes_per_agent), "episode");
    say!("return     {final_return:.1}, mean over the team's last {last}");
    say!("coverage   {}", coverage(summary));
    say!("results    {}", folder.path().display());
    let recording = folder.recording();
    if recording.is_file() {
        say!(
            "recording  {} ({}); look at it with",
            recording.display(),
            size(&recording)
        );
        say!("             rerun {}", recording.display());
    }
}

fn solved(summary: &Summary) -> String {
    // Tasks state their thresholds in single precision, whose digits are fewer.
    let shown = |threshold: f64| threshold as f32;
    match (summary.solved_at, summary.episodes_until_solved) {
        (None, _) => "nothing says when this task counts as solved".to_owned(),
        (Some(at), Some(episodes)) => {
            let (episodes, window) = (counted(episodes, "episode"), counted(at.window, "episode"));
            format!(
                "after {episodes} per agent (mean return of {} over {window})",
                shown(at.r#return)
            )
        }
        (Some(at), None) => {
            let window = counted(at.window, "episode");
            format!(
                "no: a mean return of {} over {window} was not reached",
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
        "{} of the state space by agent{more}; {} together",
        agents.join(", "),
        percent(&summary.team_coverage)
    )
}

fn size(path: &Path) -> String {
    let bytes = path.metadata().map_or(0, |metadata| metadata.len());
    indicatif::HumanBytes(bytes).to_string()
}
