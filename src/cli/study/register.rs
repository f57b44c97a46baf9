//! `seedbed study register` and `seedbed study power`: what is fixed before the runs, and how many are needed.

use super::plans::registration_error;
use crate::cli::{CliError, pluralize};
use seedbed::study::design::lock::Lock;
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::design::power::powers;
use seedbed::study::store::StudyFolder;
use seedbed::text::terminal_line;
use seedbed_stats::power::MAX_RUNS;

/// Registers a study. `folder` may have runs from before.
pub(super) fn register(plan: &StudyPlan, folder: &StudyFolder) -> Result<(), CliError> {
    let lock = Lock::register(plan, |cell| folder.count_runs(cell.digest()))
        .map_err(registration_error)?;
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
    let ancestors = lock.registered.ancestors.len();
    if ancestors > 0 {
        say!(
            "history    {} before this one",
            pluralize(ancestors, "lock")
        );
    }
    for claim in lock.withdrawn_claims() {
        say!("withdrawn  {claim}");
    }
    say!(
        "lock       {} ({})",
        Lock::path(&plan.path).display(),
        lock.short_id()
    );
    say!("next       seedbed study confirm {}", plan.path.display());
    if confirmatory > 0 {
        say!("");
        print_power(plan);
    }
    Ok(())
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
