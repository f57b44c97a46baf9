//! `seedbed run`.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::progress::{Bar, Silent};
use super::{Failure, RunArgs};
use crate::run::folder::{Contents, RunFolder};
use crate::run::summary::{FINAL_WINDOW, Summary};
use crate::run::{self, Ending, Observer, Options, Plan};

pub(super) fn run(args: &RunArgs) -> Result<(), Failure> {
    let mut overrides = args.overrides.clone();
    overrides.extend(args.seed.map(|seed| format!("seed={seed}")));
    let plan = Plan::load(&args.scenario, &overrides)?;
    let folder = args.out.as_ref().map_or_else(|| plan.default_folder(), RunFolder::new);
    make_room(args, &folder)?;
    let options = Options { folder, resume: args.resume, threads: args.threads.unwrap_or(0), recording: !args.no_recording };
    let started = Instant::now();
    let ending =
        if args.quiet { execute(&plan, &options, &mut Silent)? } else { execute(&plan, &options, &mut Bar::new(&plan))? };
    match ending {
        Ending::Interrupted { rounds } => Err(Failure::Work(format!(
            "interrupted after {rounds} rounds; go on with\n  seedbed run {} --resume{}",
            args.scenario.display(),
            args.out.as_ref().map(|out| format!(" --out {}", out.display())).unwrap_or_default()
        ))),
        Ending::Finished(summary) => {
            if !args.quiet {
                print(&summary, &options.folder, args.no_recording, started.elapsed().as_secs_f64());
            }
            Ok(())
        }
    }
}

/// Sees to it that nothing is overwritten unasked.
fn make_room(args: &RunArgs, folder: &RunFolder) -> Result<(), Failure> {
    let shown = folder.path().display();
    let elsewhere = "keep both with --seed N or --out DIR, replace it with --overwrite";
    match folder.contents() {
        Contents::FinishedRun if args.resume => {
            Err(Failure::Input(format!("the run in {shown} is finished; there is nothing to resume")))
        }
        Contents::FinishedRun if !args.overwrite => Err(Failure::Input(format!("{shown} holds a finished run; {elsewhere}"))),
        Contents::UnfinishedRun if !args.resume && !args.overwrite => {
            Err(Failure::Input(format!("{shown} holds a run that was interrupted; go on with --resume, {elsewhere}")))
        }
        Contents::Nothing | Contents::Other if args.resume => {
            Err(Failure::Input(format!("{shown} holds no checkpoint to resume from; start afresh without --resume")))
        }
        Contents::Other if !args.overwrite => Err(Failure::Input(format!("{shown} is not empty; {elsewhere}"))),
        _ if args.overwrite => folder.clear().map_err(|error| Failure::Work(format!("cannot clear {shown}: {error}"))),
        _ => Ok(()),
    }
}

fn execute(plan: &Plan, options: &Options, observer: &mut dyn Observer) -> Result<Ending, Failure> {
    Ok(run::execute(plan, options, observer, &interruption())?)
}

/// Set by the first Ctrl-C; the second ends the process at once.
fn interruption() -> Arc<AtomicBool> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    let handler = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        eprintln!("\nstopping after this round; press Ctrl-C again to stop at once");
    });
    if let Err(error) = handler {
        eprintln!("warning: Ctrl-C will end the run without a checkpoint ({error})");
    }
    interrupted
}

fn print(summary: &Summary, folder: &RunFolder, no_recording: bool, seconds: f64) {
    let Summary { agents, episodes_per_agent, env_steps, final_return, .. } = summary;
    let rate = *env_steps as f64 / seconds;
    println!(
        "finished   {episodes_per_agent} episodes of {agents} agents, {env_steps} env steps in {seconds:.1} s ({rate:.0} a second)"
    );
    println!("solved     {}", solved(summary));
    println!("return     {final_return:.1}, mean over the team's last {} episodes", FINAL_WINDOW.min(*episodes_per_agent));
    println!("coverage   {}", coverage(summary));
    println!("results    {}", folder.path().display());
    if !no_recording {
        let recording = folder.recording();
        println!("recording  {} ({}); look at it with", recording.display(), size(&recording));
        println!("             rerun {}", recording.display());
    }
}

fn solved(summary: &Summary) -> String {
    match (summary.solved_at, summary.episodes_until_solved) {
        (None, _) => "nothing says when this task counts as solved".to_owned(),
        (Some(at), Some(episodes)) => {
            format!("after {episodes} episodes per agent (mean return of {} over {} episodes)", at.r#return, at.window)
        }
        (Some(at), None) => format!("no: a mean return of {} over {} episodes was not reached", at.r#return, at.window),
    }
}

fn coverage(summary: &Summary) -> String {
    const SHOWN: usize = 8;
    let percent = |fraction: &f64| format!("{:.1} %", 100.0 * fraction);
    let agents: Vec<String> = summary.coverage.iter().take(SHOWN).map(percent).collect();
    let more = if summary.coverage.len() > SHOWN { " …" } else { "" };
    format!("{} of the state space by agent{more}; {} together", agents.join(", "), percent(&summary.team_coverage))
}

fn size(path: &Path) -> String {
    let bytes = path.metadata().map_or(0, |metadata| metadata.len());
    indicatif::HumanBytes(bytes).to_string()
}
