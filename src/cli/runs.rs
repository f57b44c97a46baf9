//! `seedbed runs`: lists runs with their main results.

use std::cmp::Ordering;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use clap::{Args, ValueEnum};
use jiff::{Timestamp, Unit, tz::TimeZone};
use serde::Serialize;

use super::{CliError, pluralize};
use seedbed::review::overview::{self, RunOverview, RunState};
use seedbed::text::{align_columns, terminal_line, without_trailing_zeros};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed runs                                  all runs in recordings/
  seedbed runs --filter cartpole --sort return --reverse
  seedbed runs --state unsolved
  seedbed runs sweep --json | jq '.[] | select(.team_coverage > 0.5) | .path'

`return` is the mean over agents of the mean return of each one's own last 25 episodes; copies of an environment in which \
one learner acts count as one. `solved` is the number of episodes per agent \
until the task was solved, `coverage` the share of the state space that the team visited, `took` the time from the \
first to the last file of the run. A run that cannot be read is listed as `unreadable`, with a warning; the exit status is 0.")]
pub(super) struct RunsArgs {
    /// Directory with runs, at any depth
    #[arg(value_name = "DIR", default_value = "recordings")]
    folder: PathBuf,
    /// Sort by this column
    #[arg(long, value_enum, value_name = "COLUMN", default_value = "written")]
    sort: SortKey,
    /// Reverse the order
    #[arg(long)]
    reverse: bool,
    /// Only runs with this text in their path, scenario or environment
    #[arg(long, value_name = "TEXT")]
    filter: Option<String>,
    /// Only runs in this state
    #[arg(long, value_enum)]
    state: Option<StateFilter>,
    /// Print a JSON array with one object per run
    #[arg(long)]
    json: bool,
}

/// A column by which runs are sorted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SortKey {
    /// Path of the run
    Path,
    /// Number of agents
    Agents,
    /// Mean return of the last 25 episodes
    Return,
    /// Episodes until solved; unsolved runs last
    Solved,
    /// Coverage of the team
    Coverage,
    /// When the run was finished, latest last
    Written,
    /// Duration of the run
    Took,
}

/// Which runs are listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum StateFilter {
    /// Finished runs
    Finished,
    /// Runs in progress, and interrupted runs
    Unfinished,
    /// Finished runs that solved their task
    Solved,
    /// Finished runs that did not solve their task
    Unsolved,
}

/// A run in the JSON output.
#[derive(Serialize)]
struct JsonRun<'a> {
    #[serde(flatten)]
    run: &'a RunOverview,
    /// When the last result was written, as in RFC 3339.
    written: Option<String>,
}

pub(super) fn runs(args: &RunsArgs) -> Result<(), CliError> {
    if !args.folder.is_dir() {
        return Err(CliError::Usage(format!(
            "no directory {}; runs are written to recordings/ in the working directory, unless `seedbed run --out` \
             names another one",
            args.folder.display()
        )));
    }
    let mut runs = overview::find_runs(&args.folder);
    let found = runs.len();
    runs.retain(|run| is_listed(run, args));
    runs.sort_by(|one, other| compare(one, other, args.sort));
    if args.reverse {
        runs.reverse();
    }
    if args.json {
        print_json(&runs);
    } else {
        print_table(&runs, found, args);
    }
    Ok(())
}

fn is_listed(run: &RunOverview, args: &RunsArgs) -> bool {
    let has_state = match args.state {
        None => true,
        Some(StateFilter::Finished) => run.state == RunState::Finished,
        Some(StateFilter::Unfinished) => run.state == RunState::Unfinished,
        Some(StateFilter::Solved) => run.is_solved() == Some(true),
        Some(StateFilter::Unsolved) => run.is_solved() == Some(false),
    };
    let has_text = args.filter.as_ref().is_none_or(|text| {
        let names = [&run.results.scenario, &run.results.environment];
        run.path.to_string_lossy().contains(text)
            || names.into_iter().flatten().any(|name| name.contains(text))
    });
    has_state && has_text
}

/// Order of two runs. Runs without a value in the column are last; equal runs are sorted by path.
fn compare(one: &RunOverview, other: &RunOverview, key: SortKey) -> Ordering {
    let value = |run: &RunOverview| -> Option<f64> {
        match key {
            SortKey::Path => None,
            SortKey::Agents => run.results.agents.map(|agents| agents as f64),
            SortKey::Return => run.results.final_return,
            SortKey::Solved => run.results.episodes_until_solved.map(|count| count as f64),
            SortKey::Coverage => run.results.team_coverage,
            SortKey::Written => run.written.map(seconds_since_epoch),
            SortKey::Took => run.seconds,
        }
    };
    let by_value = match (value(one), value(other)) {
        (Some(one), Some(other)) => one.total_cmp(&other),
        (one, other) => other.is_some().cmp(&one.is_some()),
    };
    by_value.then_with(|| one.path.cmp(&other.path))
}

fn seconds_since_epoch(time: SystemTime) -> f64 {
    time.duration_since(SystemTime::UNIX_EPOCH)
        .unwrap_or_default()
        .as_secs_f64()
}

fn print_json(runs: &[RunOverview]) {
    let rows: Vec<JsonRun<'_>> = runs
        .iter()
        .map(|run| JsonRun {
            run,
            written: run.written.and_then(timestamp).map(|time| time.to_string()),
        })
        .collect();
    say!(
        "{}",
        serde_json::to_string_pretty(&rows).expect("numbers and texts can be serialized")
    );
}

/// The time in whole seconds.
fn timestamp(time: SystemTime) -> Option<Timestamp> {
    Timestamp::try_from(time).ok()?.round(Unit::Second).ok()
}

fn print_table(runs: &[RunOverview], found: usize, args: &RunsArgs) {
    if runs.is_empty() {
        let folder = args.folder.display();
        match found {
            0 => say!("no runs in {folder}"),
            _ => say!(
                "no run of {} in {folder} is selected",
                pluralize(found, "run")
            ),
        }
        return;
    }
    let header = [
        "run", "task", "seed", "K", "episodes", "return", "solved", "coverage", "written", "took",
    ];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    rows.extend(runs.iter().map(row));
    for line in align_columns(&rows) {
        say!("{line}");
    }
    for run in runs {
        if let Some(error) = &run.error {
            let path = terminal_line(&run.path.to_string_lossy());
            note!("warning: {path} cannot be read: {error}");
        }
    }
}

fn row(run: &RunOverview) -> Vec<String> {
    let results = &run.results;
    vec![
        run.path.display().to_string(),
        results.environment.clone().unwrap_or_else(dash),
        or_dash(results.seed),
        match (results.agents, results.copies) {
            (Some(learners), Some(copies)) => format!("{learners} in {copies} copies"),
            (agents, _) => or_dash(agents),
        },
        or_dash(results.episodes_per_agent),
        result_text(run),
        solved_text(run),
        results
            .team_coverage
            .map_or_else(dash, |share| format!("{:.1} %", 100.0 * share)),
        run.written.map_or_else(dash, local_time),
        run.seconds.map_or_else(dash, duration),
    ]
}

/// The mean return or, of a tabular run, the regret.
fn result_text(run: &RunOverview) -> String {
    match (run.results.final_return, run.results.regret_per_agent) {
        (Some(value), _) => number(value),
        (None, Some(regret)) => format!("regret {}", number(regret)),
        (None, None) => dash(),
    }
}

fn solved_text(run: &RunOverview) -> String {
    match (run.state, run.is_solved()) {
        (RunState::Unfinished, _) => "unfinished".to_owned(),
        (RunState::Unreadable, _) => "unreadable".to_owned(),
        (RunState::RecordingOnly, _) => "recording only".to_owned(),
        (RunState::Finished, Some(true)) => or_dash(run.results.episodes_until_solved),
        (RunState::Finished, Some(false)) => "no".to_owned(),
        (RunState::Finished, None) => dash(),
    }
}

fn number(value: f64) -> String {
    let decimals = if value.abs() >= 100.0 { 1 } else { 3 };
    without_trailing_zeros(&format!("{value:.decimals$}")).to_owned()
}

fn local_time(time: SystemTime) -> String {
    timestamp(time).map_or_else(dash, |time| {
        let local = time.to_zoned(TimeZone::system());
        local.strftime("%Y-%m-%d %H:%M").to_string()
    })
}

/// For example `0.8 s`, `5 min 3 s` or `2 h 10 min`.
fn duration(seconds: f64) -> String {
    let whole = Duration::from_secs_f64(seconds.max(0.0)).as_secs();
    match whole {
        0..60 => format!("{seconds:.1} s"),
        60..3600 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

fn or_dash(value: Option<u64>) -> String {
    value.map_or_else(dash, |value| value.to_string())
}

fn dash() -> String {
    "–".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_two_units_at_most() {
        let texts = [0.84, 59.0, 303.0, 7_800.0].map(duration);
        assert_eq!(texts, ["0.8 s", "59.0 s", "5 min 3 s", "2 h 10 min"]);
    }

    #[test]
    fn runs_without_a_value_are_last() {
        let run = |path: &str, value: Option<f64>| RunOverview {
            path: path.into(),
            state: RunState::Finished,
            error: None,
            results: overview::Results {
                final_return: value,
                ..overview::Results::default()
            },
            written: None,
            seconds: None,
        };
        let mut runs = [run("c", None), run("b", Some(2.0)), run("a", Some(1.0))];
        runs.sort_by(|one, other| compare(one, other, SortKey::Return));
        let paths = runs.map(|run| run.path.display().to_string());
        assert_eq!(paths, ["a", "b", "c"]);
    }
}
