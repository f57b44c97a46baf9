//! `seedbed study`: runs what is missing in a study, and prints the verdicts on its claims.

use std::path::Path;
use std::time::Instant;

use jiff::Timestamp;

use super::execution::{
    describe_run, execute_runs, interruption_error, jobs, keeps_result, lock_folder,
    print_failures, print_finished, warn_of_damaged_files,
};
use super::{CliError, StudyArgs, job_script, memory, merge, pluralize, report, verify};
use seedbed::input_files;
use seedbed::study::design::lock::Lock;
use seedbed::study::design::lock::RegistrationError;
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::design::power::powers;
use seedbed::study::execute::shard::Shard;
use seedbed::study::store::run_marks::RunMark;
use seedbed::study::store::{RunState, StudyFolder};
use seedbed::text::terminal_line;
use seedbed_stats::power::MAX_RUNS;

pub(super) fn study(args: &StudyArgs) -> Result<(), CliError> {
    let plans: Result<Vec<StudyPlan>, CliError> =
        args.studies.iter().map(|path| load(args, path)).collect();
    let plans = plans?;
    check_distinct_folders(&plans)?;
    if plans.len() > 1
        && let Some(option) = option_for_one_study(args)
    {
        let message = format!("{option} can be used with one study only");
        return Err(CliError::Usage(message));
    }
    if !args.execution.ignore_memory && executes_runs(args) {
        plans.iter().try_for_each(|plan| check_memory(args, plan))?;
    }
    let mut failed_runs = 0;
    for plan in &plans {
        let folder = StudyFolder::new(args.out.clone().unwrap_or_else(|| plan.default_folder()));
        failed_runs += execute(args, plan, &folder)?;
    }
    let failure = if args.verify.is_some() {
        "not reproduced"
    } else {
        "failed"
    };
    if failed_runs == 0 {
        Ok(())
    } else {
        Err(CliError::Runtime(format!(
            "{} {failure}",
            pluralize(failed_runs, "run")
        )))
    }
}

/// Does what `args` say with one study. Returns the number of failed runs.
fn execute(args: &StudyArgs, plan: &StudyPlan, folder: &StudyFolder) -> Result<usize, CliError> {
    if args.list {
        print_runs(plan, folder);
    } else if args.power {
        print_power(plan);
    } else if args.register {
        register(plan, folder)?;
    } else if args.script.is_some() {
        job_script::print(args, plan, folder)?;
    } else if !args.merge.is_empty() {
        merge::merge(args, plan, folder, &args.merge)?;
    } else if let Some(index) = args.index {
        return run_one(args, plan, folder, index);
    } else if let Some(shard) = args.shard {
        return run_shard(args, plan, folder, shard);
    } else if let Some(amount) = args.verify {
        return verify::verify(args, plan, folder, amount);
    } else {
        return run_all(args, plan, folder);
    }
    Ok(0)
}

/// Whether any run is executed.
fn executes_runs(args: &StudyArgs) -> bool {
    let prints_only = args.list || args.power || args.register || args.script.is_some();
    !prints_only && args.merge.is_empty()
}

/// The first option that was given and can be used with one study only.
fn option_for_one_study(args: &StudyArgs) -> Option<&'static str> {
    let options = [
        (args.out.is_some(), "--out"),
        (args.index.is_some(), "--index"),
        (args.shard.is_some(), "--shard"),
        (args.script.is_some(), "--script"),
        (!args.merge.is_empty(), "--merge"),
    ];
    let given = options.into_iter().find(|(is_given, _)| *is_given);
    given.map(|(_, option)| option)
}

/// Reads a study and, with `--confirm`, its lock.
fn load(args: &StudyArgs, path: &Path) -> Result<StudyPlan, CliError> {
    input_files::accept_stream(path);
    // Before they exist, results of others can be registered, and are missing in a confirmation.
    let plan = if args.register || args.confirm {
        StudyPlan::load_before_results(path, args.quick)?
    } else {
        StudyPlan::load(path, args.quick)?
    };
    if args.confirm {
        plan.registered().map_err(registration_error)
    } else {
        Ok(plan)
    }
}

pub(super) fn registration_error(error: RegistrationError) -> CliError {
    match error {
        RegistrationError::File(error) => CliError::Runtime(error.to_string()),
        error => CliError::Usage(error.to_string()),
    }
}

/// Registers a study. `folder` may have runs from before.
fn register(plan: &StudyPlan, folder: &StudyFolder) -> Result<(), CliError> {
    let lock =
        Lock::register(plan, |cell| folder.count_runs(&cell.digest)).map_err(registration_error)?;
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
            "seen       {} of results, which --confirm does not use",
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
    say!("next       seedbed study {} --confirm", plan.path.display());
    if confirmatory > 0 {
        say!("");
        print_power(plan);
    }
    Ok(())
}

/// Prints the power of each confirmatory claim.
fn print_power(plan: &StudyPlan) {
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

/// An error if two studies would write to one directory: each would take the other's runs for its
/// own.
fn check_distinct_folders(plans: &[StudyPlan]) -> Result<(), CliError> {
    let repeated_name = plans.iter().enumerate().find(|(index, plan)| {
        plans[..*index]
            .iter()
            .any(|earlier| earlier.name == plan.name)
    });
    repeated_name.map_or(Ok(()), |(_, plan)| {
        let folder = plan.default_folder();
        Err(CliError::Usage(format!(
            "two studies are named `{}` and would both write to {}; run them one at a time with --out",
            plan.name,
            folder.display()
        )))
    })
}

/// An error if the directory belongs to another study, or to this study with another value of
/// `--quick`.
pub(super) fn check_same_study(plan: &StudyPlan, folder: &StudyFolder) -> Result<(), CliError> {
    let manifest = folder.manifest_if_any();
    let Some(manifest) = manifest.map_err(|error| CliError::Usage(error.to_string()))? else {
        return Ok(());
    };
    let is_same = (manifest.name.as_str(), manifest.quick) == (plan.name.as_str(), plan.quick);
    let lock_id = |lock: &Option<Lock>| lock.as_ref().map(|lock| lock.id.clone());
    if is_same && lock_id(&manifest.lock) == lock_id(&plan.lock) {
        return Ok(());
    }
    if is_same {
        return Err(CliError::Usage(format!(
            "{} contains this study with other run seeds (registered: {}); choose another directory with --out",
            folder.path().display(),
            manifest.lock.as_ref().map_or("no", Lock::short_id)
        )));
    }
    let kind = if manifest.quick {
        "quick study"
    } else {
        "study"
    };
    let path = folder.path().display();
    Err(CliError::Usage(format!(
        "{path} contains the {kind} `{}`; choose another directory with --out",
        manifest.name
    )))
}

/// Prints all runs with their indices and states.
fn print_runs(plan: &StudyPlan, folder: &StudyFolder) {
    for run in plan.runs() {
        let (state, mark) = match folder.state_of(&run) {
            RunState::Finished => ("finished", None),
            RunState::Failed => ("failed", None),
            RunState::Running(mark) => ("running", Some(mark)),
            RunState::Interrupted(mark) => ("interrupted", mark),
            RunState::Damaged => ("damaged", None),
            RunState::ToRun => ("to run", None),
        };
        let saved = match state {
            "running" | "interrupted" => folder.saved_progress(&run),
            _ => None,
        };
        let saved = saved.map(|progress| format!("{progress} saved"));
        let mark = mark.map(|mark| describe_mark(&mark));
        let details: Vec<String> = saved.into_iter().chain(mark).collect();
        say!(
            "{:>6}  {state:<11}  {:<15}  {}{}",
            run.index,
            run.label(),
            terminal_line(&run.cell.name),
            in_parentheses(&details.join("; "))
        );
    }
}

fn in_parentheses(details: &str) -> String {
    if details.is_empty() {
        String::new()
    } else {
        format!("  ({details})")
    }
}

/// Who executes or executed a run, e.g. `Slurm job 12_7, process 4711 on node3, since
/// 2026-01-31T12:00:00Z`.
fn describe_mark(mark: &RunMark) -> String {
    let job = mark.slurm_job.as_ref();
    let job = job.map_or_else(String::new, |job| format!("Slurm job {job}, "));
    let started = Timestamp::from_second(i64::try_from(mark.started).unwrap_or(i64::MAX));
    let since = started.map_or_else(|_| String::new(), |started| format!(", since {started}"));
    format!("{job}process {} on {}{since}", mark.process, mark.host)
}

/// Executes a single run; other processes may work in the same directory. Returns the number of
/// failed runs, 0 or 1.
fn run_one(
    args: &StudyArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
    index: usize,
) -> Result<usize, CliError> {
    let runs = plan.runs();
    let Some(run) = runs.get(index) else {
        let message = format!(
            "--index {index}: expected an index from 0 to {}; --list shows all",
            runs.len() - 1
        );
        return Err(CliError::Usage(message));
    };
    check_same_study(plan, folder)?;
    let _lock = lock_folder(folder, false)?;
    folder
        .write_manifest(plan)
        .map_err(|error| CliError::Runtime(error.to_string()))?;
    folder.remove_checkpoints_of_finished(&[*run]);
    let file = folder.result_file(&run.cell.digest, run.run_seed);
    let was_stored = folder
        .stored_run(run)
        .is_some_and(|stored| keeps_result(&args.execution, &stored));
    if !was_stored {
        print_failures(&execute_runs(&args.execution, &[*run], folder, &plan.name)?);
    }
    let Some(stored) = folder.stored_run(run) else {
        return Err(interruption_error(&plan.name));
    };
    let status = if was_stored { "already stored: " } else { "" };
    say!(
        "{}",
        describe_run(run, &format!("{status}{}", file.display()))
    );
    if let (true, Err(reason)) = (was_stored, &stored.outcome) {
        print_failures(&[describe_run(run, reason)]);
    }
    Ok(usize::from(stored.outcome.is_err()))
}

/// Executes the runs of a shard that have no stored result; other processes may work in the same
/// directory. Returns the number of failed runs of the shard.
fn run_shard(
    args: &StudyArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
    shard: Shard,
) -> Result<usize, CliError> {
    check_same_study(plan, folder)?;
    let _lock = lock_folder(folder, false)?;
    folder
        .write_manifest(plan)
        .map_err(|error| CliError::Runtime(error.to_string()))?;
    let runs = shard.runs_of(&plan.distinct_runs());
    folder.remove_checkpoints_of_finished(&runs);
    let mut missing = runs.clone();
    missing.retain(|run| {
        let stored = folder.stored_run(run);
        !stored.is_some_and(|stored| keeps_result(&args.execution, &stored))
    });
    warn_of_damaged_files(&missing, folder);
    say!(
        "study      {}: shard {shard}: {}, {} to run",
        plan.name,
        pluralize(runs.len(), "run"),
        missing.len()
    );
    say!("results    {}", folder.runs_folder().display());
    let started = Instant::now();
    execute_runs(&args.execution, &missing, folder, &plan.name)?;
    if !missing.is_empty() {
        print_finished(missing.len(), jobs(&args.execution), started);
    }
    let failures: Vec<String> = runs
        .iter()
        .filter_map(|run| {
            let failure = folder.stored_run(run)?.outcome.err()?;
            Some(describe_run(run, &failure))
        })
        .collect();
    print_failures(&failures);
    Ok(failures.len())
}

/// Executes all runs that have no stored result, and writes the report. Returns the number of
/// failed runs. A registered study stops at the first look at which all confirmatory claims are
/// decided.
fn run_all(args: &StudyArgs, plan: &StudyPlan, folder: &StudyFolder) -> Result<usize, CliError> {
    check_same_study(plan, folder)?;
    let _lock = lock_folder(folder, true)?;
    folder
        .write_manifest(plan)
        .map_err(|error| CliError::Runtime(error.to_string()))?;
    let looks = match &plan.lock {
        Some(lock) => lock.registered.looks.clone(),
        None => vec![plan.repeats()],
    };
    for (number, &runs_per_cell) in (1..).zip(&looks) {
        if looks.len() > 1 {
            say!(
                "look       {number} of {}: {runs_per_cell} runs per cell",
                looks.len()
            );
        }
        run_missing(args, plan, folder, runs_per_cell)?;
        if number < looks.len() && report::all_claims_are_decided(folder)? {
            say!(
                "decided    all confirmatory claims, at look {number} of {}",
                looks.len()
            );
            break;
        }
    }
    folder.remove_checkpoints_of_finished(&plan.distinct_runs());
    folder.remove_leftovers();
    report::write_and_print(folder)
}

/// Executes the first `runs_per_cell` runs of each cell that have no stored result.
fn run_missing(
    args: &StudyArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
    runs_per_cell: u64,
) -> Result<(), CliError> {
    let mut missing = plan.distinct_runs();
    missing.retain(|run| {
        let stored = folder.stored_run(run);
        run.is_among_first(runs_per_cell)
            && !stored.is_some_and(|stored| keeps_result(&args.execution, &stored))
    });
    let (cells, runs) = (
        pluralize(plan.cells.len(), "cell"),
        pluralize(runs_per_cell as usize, "run"),
    );
    warn_of_damaged_files(&missing, folder);
    let to_read = missing.iter().filter(|run| run.name.is_some()).count();
    let to_run = missing.len() - to_read;
    if plan.cells.iter().any(|cell| cell.source.found().is_none()) {
        say!(
            "study      {}: {cells}, {runs} each, {to_run} to run",
            plan.name
        );
    } else {
        say!("study      {}: {cells}", plan.name);
    }
    print_results_of_others(plan);
    let started = Instant::now();
    let failures = execute_runs(&args.execution, &missing, folder, &plan.name)?;
    if to_run > 0 {
        print_finished(to_run, jobs(&args.execution), started);
    }
    print_failures(&failures);
    Ok(())
}

/// Prints how many runs of others were found, and what is wrong with their files.
fn print_results_of_others(plan: &StudyPlan) {
    for cell in &plan.cells {
        let Some(external) = cell.source.found() else {
            continue;
        };
        say!(
            "of others  {}: {} in {}",
            terminal_line(&cell.name),
            pluralize(external.runs().count(), "run"),
            terminal_line(external.pattern())
        );
        for warning in cell.source.warnings() {
            let cell = terminal_line(&cell.name);
            note!("warning: cell `{cell}`: {}", terminal_line(&warning));
        }
    }
}

/// An error if the runs, as many at once as there are threads, need more memory than there is.
fn check_memory(args: &StudyArgs, plan: &StudyPlan) -> Result<(), CliError> {
    let at_once = if args.index.is_some() {
        1
    } else {
        jobs(&args.execution)
    };
    let runs = plan.cells.iter().map(|cell| cell.source.memory());
    memory::check_runs(runs, at_once, &format!(" of `{}`", plan.name))
}
