//! `seedbed study register` and `seedbed study power`: what is fixed before the runs, and how many are needed.

use super::plans::registration_error;
use crate::cli::{CliError, pluralize, project_log};
use seedbed::run_log::RunLog;
use seedbed::study::design::lock::Lock;
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::design::power::powers;
use seedbed::study::store::StudyFolder;
use seedbed::text::terminal_line;
use seedbed_stats::power::MAX_RUNS;

/// Registers a study. `folder` may have runs from before.
pub(super) fn register(plan: &StudyPlan, folder: &StudyFolder) -> Result<(), CliError> {
    let log = RunLog::of_file(&plan.path);
    let lock = Lock::register(plan, &log, |cell| folder.run_seeds(cell.digest()))
        .map_err(registration_error)?;
    project_log::warn_if_failed(log.add_lock(&lock));
    let confirmatory = plan
        .study()
        .claims
        .iter()
        .filter(|claim| claim.confirmatory)
        .count();
    say!(
        "registered {}: {}, {}, {} runs each",
        plan.name,
        pluralize(confirmatory, "confirmatory claim"),
        pluralize(plan.cells.len(), "cell"),
        plan.repeats()
    );
    for results in &lock.registered.results_of_others {
        say!(
            "of others  {}: {}; not fixed: {}",
            terminal_line(&results.cell),
            pluralize(results.runs as usize, "run"),
            results.not_fixed
        );
    }
    let seen_files = lock.registered.seen_files.len();
    if seen_files > 0 {
        say!(
            "seen       {} of results, which `confirm` does not use",
            pluralize(seen_files, "file")
        );
    }
    print_history(&lock);
    say!(
        "lock       {} ({})",
        Lock::path(&plan.path).display(),
        lock.short_id()
    );
    say!("next       seedbed study confirm {}", plan.path.display());
    if confirmatory > 0 {
        say!("");
        print_power(plan);
        warn_of_low_power(plan);
    }
    Ok(())
}

/// Prints what was registered and tried before.
fn print_history(lock: &Lock) {
    let ancestors = lock.registered.ancestors.len();
    if ancestors > 0 {
        say!(
            "history    {} before this one",
            pluralize(ancestors, "lock")
        );
    }
    for related in &lock.registered.related {
        say!(
            "beside     {} ({}) has cells in common, and stays registered",
            terminal_line(&related.study),
            related.short_id()
        );
    }
    let runs_before = lock.registered.seen_before.iter();
    let runs_before: usize = runs_before.map(|(_, runs)| runs).sum();
    let others = lock
        .registered
        .run_log
        .as_ref()
        .map_or(0, |log| log.others_in_tasks);
    if runs_before + others > 0 {
        say!(
            "tried      {} with the settings of its cells, {others} with other settings in its tasks",
            pluralize(runs_before, "run")
        );
    }
    for claim in lock.withdrawn_claims() {
        say!("withdrawn  {claim}");
    }
}

/// Power below which most people would not begin a study.
const USUAL_POWER: f64 = 0.8;

/// Warns if a claim is likely to stay open, with the number of runs that it needs. The lock is written: registering again
/// replaces it.
fn warn_of_low_power(plan: &StudyPlan) {
    let powers = powers(plan.study());
    let low = powers.iter().filter_map(|(index, power)| {
        let found = power.power.filter(|found| *found < USUAL_POWER)?;
        Some((
            found,
            power.runs_needed[0],
            &plan.study().claims[*index].text,
        ))
    });
    for (found, needed, claim) in low {
        let needed = needed.map_or(format!("more than {MAX_RUNS}"), |runs| runs.to_string());
        note!(
            "warning: power {found:.2}: {:.0} % of such studies would leave this claim open although it is as expected; \
             {needed} runs per cell have a power of {USUAL_POWER}: {claim}",
            100.0 * (1.0 - found)
        );
    }
}

/// Prints the power of each confirmatory claim.
pub(super) fn print_power(plan: &StudyPlan) {
    let powers = powers(plan.study());
    say!("power      {}: {} runs per cell", plan.name, plan.repeats());
    say!(
        "{:>7} {:>8} {:>8} {:>8}  claim",
        "level",
        "power",
        "n (0.8)",
        "n (0.9)"
    );
    for (index, power) in &powers {
        let runs = |runs: Option<usize>| match runs {
            Some(runs) => runs.to_string(),
            None if power.expected.is_none() => "?".to_owned(),
            None => format!("> {MAX_RUNS}"),
        };
        say!(
            "{:>7.4} {:>8} {:>8} {:>8}  {}",
            power.level,
            power
                .power
                .map_or("?".to_owned(), |power| format!("{power:.2}")),
            runs(power.runs_needed[0]),
            runs(power.runs_needed[1]),
            plan.study().claims[*index].text
        );
    }
    if powers.iter().any(|(_, power)| power.power.is_some()) {
        say!(
            "power      probability that a claim is found supported if the effect is `smallest`, or what `expected: \
             Shares(…)` says; of a claim of no effect, if there is none"
        );
    }
    if powers.iter().any(|(_, power)| power.expected.is_none()) {
        say!(
            "Claims with `?` do not say what is expected: `expected: Shares(0.95, 0.7)` or `expected: Deviation(20)`."
        );
    }
}
