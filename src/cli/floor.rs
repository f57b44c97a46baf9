//! `seedbed floor`.

use std::fmt::Write as _;
use std::path::Path;

use super::preview::task;
use super::progress::PartsProgress;
use super::{CliError, FloorArgs};
use seedbed::open_loop::{self, OpenLoopError, OpenLoopPlan, OpenLoopRun};
use seedbed::storage;
use seedbed_env::TaskDescription;
use seedbed_learn::agent::action_selection::ActionNoise;
use seedbed_stats::MIN_RUNS;
use seedbed_stats::aggregate::mean;
use seedbed_stats::bootstrap::bootstrap_estimate;

/// Number of episodes for each run seed, unless the attempts need more.
const DEFAULT_EPISODES: u32 = 1000;

pub(super) fn floor(args: &FloorArgs) -> Result<(), CliError> {
    let task = task(&args.environment)?;
    let plan = plan(args, &task)?;
    say!(
        "{}: {} run seeds, {} episodes each; at the goal: a return of at least {}\n",
        task.spec().name,
        plan.runs,
        plan.episodes,
        shortest(plan.goal)
    );
    say!("{}", header(&args.attempts));
    let mut table = csv_header(&args.attempts);
    let kinds = open_loop::kinds_of_noise();
    let progress = PartsProgress::new(
        "run seeds with a kind of noise",
        kinds.len() * plan.runs as usize,
    );
    for noise in kinds {
        let runs = open_loop::play(&task, noise, &plan, || progress.part_finished());
        let runs = runs.map_err(|error| match error {
            OpenLoopError::Task(error) => CliError::from(error),
            OpenLoopError::Environment(_) => CliError::Runtime(error.to_string()),
        })?;
        progress.suspend(|| say!("{}", row(noise, &runs, &args.attempts)));
        add_csv_rows(&mut table, noise, &runs, plan.first_seed, &args.attempts);
    }
    let intervals = if plan.runs as usize >= MIN_RUNS {
        " with 95 % intervals (bootstrap)".to_owned()
    } else {
        format!(", without intervals, which need at least {MIN_RUNS} of them")
    };
    say!("\nMeans over run seeds{intervals}; the largest return of all episodes.");
    match &args.csv {
        Some(path) => write_csv(path, &table),
        None => Ok(()),
    }
}

fn plan(args: &FloorArgs, task: &TaskDescription) -> Result<OpenLoopPlan, CliError> {
    let threshold = task.spec().reward_threshold.map(f64::from);
    let goal = args.goal.or(threshold).ok_or_else(|| {
        CliError::Usage(format!(
            "the task `{}` has no `reward_threshold`, which would say what reaches the goal: give a return with --goal",
            task.spec().name
        ))
    })?;
    if goal.is_nan() {
        return Err(CliError::Usage("--goal: expected a number".to_owned()));
    }
    let attempts = args.attempts.iter().copied().max().unwrap_or(1);
    let episodes = args.episodes.unwrap_or(attempts.max(DEFAULT_EPISODES));
    if episodes < attempts {
        return Err(CliError::Usage(format!(
            "--episodes {episodes}: expected at least as many as --attempts, {attempts}"
        )));
    }
    Ok(OpenLoopPlan {
        first_seed: args.seed,
        runs: args.runs,
        episodes,
        goal,
    })
}

fn header(attempts: &[u32]) -> String {
    let mut columns = "| noise | episodes at the goal |".to_owned();
    for count in attempts {
        let _ = write!(columns, " goal found in {count} episodes |");
    }
    columns += " mean return | largest return |";
    let rules = "|---".repeat(4 + attempts.len());
    format!("{columns}\n{rules}|")
}

fn row(noise: Option<ActionNoise>, runs: &[OpenLoopRun], attempts: &[u32]) -> String {
    let mut cells = format!("| {} | {} |", name_of(noise), mean_cell(runs, share));
    for &count in attempts {
        let found = |run: &OpenLoopRun| run.probability_to_find(count).unwrap_or(f64::NAN);
        let _ = write!(cells, " {} |", mean_cell(runs, found));
    }
    let returns: Vec<f64> = runs.iter().map(|run| run.mean_return).collect();
    let best = runs.iter().map(|run| run.best_return);
    let _ = write!(
        cells,
        " {:.3} | {:.3} |",
        mean(&returns),
        best.fold(f64::NEG_INFINITY, f64::max)
    );
    cells
}

fn name_of(noise: Option<ActionNoise>) -> String {
    noise.map_or_else(|| "uniform".to_owned(), |noise| noise.to_string())
}

/// A return as it was written: thresholds of tasks have single precision.
fn shortest(goal: f64) -> String {
    let single = goal as f32;
    if f64::from(single) == goal {
        single.to_string()
    } else {
        goal.to_string()
    }
}

/// Share of a run's episodes that reached the goal.
fn share(run: &OpenLoopRun) -> f64 {
    f64::from(run.goals) / f64::from(run.episodes)
}

/// Mean over runs and its interval, if there are several.
fn mean_cell(runs: &[OpenLoopRun], value: impl Fn(&OpenLoopRun) -> f64) -> String {
    let values: Vec<f64> = runs.iter().map(value).collect();
    let estimate = bootstrap_estimate(&values, mean);
    let Some([low, high]) = estimate.interval.ends() else {
        return format!("{:.4}", estimate.value);
    };
    format!("{:.4} ({low:.4} to {high:.4})", estimate.value)
}

fn csv_header(attempts: &[u32]) -> String {
    let mut line = "noise,run_seed,episodes,goals,mean_return,best_return".to_owned();
    for count in attempts {
        let _ = write!(line, ",found_in_{count}");
    }
    line + "\n"
}

fn add_csv_rows(
    table: &mut String,
    noise: Option<ActionNoise>,
    runs: &[OpenLoopRun],
    first_seed: u64,
    attempts: &[u32],
) {
    for (seed, run) in (first_seed..).zip(runs) {
        let (mean, best) = (run.mean_return, run.best_return);
        let _ = write!(
            table,
            "\"{}\",{seed},{},{},{mean},{best}",
            name_of(noise),
            run.episodes,
            run.goals
        );
        for &count in attempts {
            let found = run.probability_to_find(count).unwrap_or(f64::NAN);
            let _ = write!(table, ",{found}");
        }
        table.push('\n');
    }
}

fn write_csv(path: &Path, table: &str) -> Result<(), CliError> {
    storage::files::replace(path, table.as_bytes())
        .map_err(|error| CliError::Runtime(format!("cannot write {}: {error}", path.display())))?;
    say!("table      {}", path.display());
    Ok(())
}
