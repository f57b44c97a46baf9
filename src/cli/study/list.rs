//! `seedbed study list`: all runs with their indices and states, and how many are in each state.

use std::collections::BTreeMap;

use jiff::Timestamp;

use seedbed::study::design::plan::StudyPlan;
use seedbed::study::store::run_marks::RunMark;
use seedbed::study::store::{RunState, StudyFolder};
use seedbed::text::terminal_line;

/// Prints all runs with their indices and states.
pub(super) fn print_runs(plan: &StudyPlan, folder: &StudyFolder) {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for run in plan.runs() {
        let (state, mark) = match folder.state_of(&run) {
            RunState::Finished => ("finished", None),
            RunState::Failed => ("failed", None),
            RunState::Running(mark) => ("running", Some(mark)),
            RunState::Interrupted(mark) => ("interrupted", mark),
            RunState::Damaged => ("damaged", None),
            RunState::ToRun => ("to run", None),
        };
        *counts.entry(state).or_default() += 1;
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
    let counts: Vec<String> = counts
        .iter()
        .map(|(state, n)| format!("{n} {state}"))
        .collect();
    note!("runs       {}", counts.join(", "));
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
