//! `seedbed bench`: episodes until solved and speed over several run seeds, and comparisons with
//! the first scenario.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{BenchArgs, CliError, pluralize, tabular};
use crate::run::{Plan, RunError};
use crate::study::comparison::{Comparison, Score, compare, times_to_event};
use crate::study::file::Test;
use crate::study::run_result::{RunResult, StopRule, train};
use crate::tabular::scenario::is_meant;
use seedbed_env::input::InputError;
use seedbed_stats::aggregate::median;
use seedbed_stats::hypothesis::holm_correction;
use seedbed_stats::survival::kaplan_meier;
use seedbed_stats::{Interval, MIN_RUNS};

/// Result of one run.
#[derive(Clone)]
struct Outcome {
    solved: bool,
    /// Episodes per agent until solved, or until the end of the run.
    episodes: u64,
    /// Environment steps of the team until then.
    env_steps: u64,
    /// First episode of each agent whose own return reached the threshold, counted from 1: `[K]`.
    reached: Vec<Option<u64>>,
    /// Share of the state space that the team visited.
    coverage: f64,
    all_env_steps: u64,
    seconds: f64,
}

/// Results of all runs of one scenario, in the order of their run seeds.
struct Bench {
    name: String,
    agents: u32,
    max_episodes: u32,
    outcomes: Vec<Outcome>,
}

pub(super) fn bench(args: &BenchArgs) -> Result<(), CliError> {
    if args.scenarios.iter().any(|path| is_meant(path)) {
        return tabular::bench(args);
    }
    let plans: Result<Vec<Plan>, InputError> = args
        .scenarios
        .iter()
        .map(|path| Plan::load(path, &args.overrides))
        .collect();
    let pool = ThreadPoolBuilder::new()
        .num_threads(args.jobs.map_or(0, usize::from))
        .build();
    let pool = pool.map_err(|error| CliError::Runtime(error.to_string()))?;
    let plans = plans?;
    let table = Table {
        name_width: plans
            .iter()
            .map(|plan| plan.name.chars().count())
            .max()
            .unwrap_or(0)
            .max(8),
    };
    let benches = train_all(&table, &plans, args, &pool)?;
    if args.whole {
        print_exploration(&table, &benches);
    }
    if let Some((first, others)) = benches
        .split_first()
        .filter(|(_, others)| !others.is_empty())
    {
        compare_all(&table, first, others);
    }
    if (args.seeds as usize) < MIN_RUNS {
        say!(
            "\nNo intervals: {MIN_RUNS} run seeds are needed, found {}.",
            args.seeds
        );
    }
    Ok(())
}

/// Trains one scenario after the other and prints the results of each as soon as it is finished.
fn train_all(
    table: &Table,
    plans: &[Plan],
    args: &BenchArgs,
    pool: &ThreadPool,
) -> Result<Vec<Bench>, RunError> {
    let seeds = pluralize(args.seeds as usize, "run seed");
    say!(
        "Episodes per agent until solved, over {seeds} from {}: Kaplan–Meier median with 95 % interval, min, max.",
        args.first_seed
    );
    say!(
        "env steps: median number of steps of the whole team until solved; steps/s: on one thread.\n"
    );
    table.header(&SOLVING);
    let mut benches = Vec::new();
    for plan in plans {
        let bench = bench_of(plan, args, pool)?;
        table.row(&SOLVING, &bench.name, &solving_cells(&bench));
        benches.push(bench);
    }
    Ok(benches)
}

fn bench_of(plan: &Plan, args: &BenchArgs, pool: &ThreadPool) -> Result<Bench, RunError> {
    let seeds = args.first_seed..args.first_seed.saturating_add(args.seeds);
    let outcomes: Result<Vec<Outcome>, RunError> = pool.install(|| {
        seeds
            .into_par_iter()
            .map(|seed| outcome(plan, seed, args.whole))
            .collect()
    });
    let scenario = &plan.scenario;
    let (agents, max_episodes) = (scenario.agents.count.get(), scenario.max_episodes());
    Ok(Bench {
        name: plan.name.clone(),
        agents,
        max_episodes,
        outcomes: outcomes?,
    })
}

/// Trains once, on one thread and without a recording, until the task is solved or, if `whole`, for
/// the scenario's maximum number of episodes.
fn outcome(plan: &Plan, seed: u64, whole: bool) -> Result<Outcome, RunError> {
    let mut plan = plan.clone();
    plan.scenario.seed = seed;
    let until = if whole {
        StopRule::MaxEpisodes
    } else {
        StopRule::Solved
    };
    let started = Instant::now();
    let run =
        train(&plan, until, &[], &AtomicBool::new(false))?.expect("the run is never interrupted");
    Ok(Outcome::of(&run, started.elapsed().as_secs_f64()))
}

impl Outcome {
    fn of(run: &RunResult, seconds: f64) -> Self {
        let so_far = (run.episodes_per_agent() as u64, run.env_steps);
        let (episodes, env_steps) = run
            .solved
            .map_or(so_far, |solved| (solved.episodes.into(), solved.env_steps));
        let reached = run
            .first_goals()
            .into_iter()
            .map(|episode| episode.map(u64::from))
            .collect();
        let (solved, coverage) = (run.solved.is_some(), run.team_coverage());
        Self {
            solved,
            episodes,
            env_steps,
            reached,
            coverage,
            all_env_steps: run.env_steps,
            seconds,
        }
    }

    fn score(&self, seed: u64, time: u64) -> Score {
        let (value, observed_until) = if self.solved {
            (time as f64, f64::INFINITY)
        } else {
            (f64::INFINITY, time as f64)
        };
        Score {
            seed,
            value,
            observed_until,
        }
    }
}

/// Times of runs, in the order of their run seeds.
fn scores(outcomes: &[Outcome], time: impl Fn(&Outcome) -> u64) -> Vec<Score> {
    (0..)
        .zip(outcomes)
        .map(|(seed, outcome)| outcome.score(seed, time(outcome)))
        .collect()
}

/// Titles and widths of the columns after the scenario's name.
pub(super) type Columns<const N: usize> = [(&'static str, usize); N];

const SOLVING: Columns<8> = [
    ("agents", 6),
    ("solved", 7),
    ("median", 7),
    ("95 % interval", 15),
    ("min", 6),
    ("max", 6),
    ("env steps", 10),
    ("steps/s", 8),
];

/// Cells of the table of solving times. Unsolved runs are censored: they would take longer than the
/// episodes they were given.
fn solving_cells(bench: &Bench) -> [String; 8] {
    let outcomes = &bench.outcomes;
    let curve = kaplan_meier(&times_to_event(&scores(outcomes, |outcome| {
        outcome.episodes
    })));
    let env_steps = kaplan_meier(&times_to_event(&scores(outcomes, |outcome| {
        outcome.env_steps
    })))
    .median();
    let beyond_end = format!("> {}", bench.max_episodes);
    let shown = |end: f64| {
        if end.is_finite() {
            format!("{end}")
        } else {
            beyond_end.clone()
        }
    };
    let times = || {
        outcomes.iter().map(|outcome| {
            if outcome.solved {
                outcome.episodes as f64
            } else {
                f64::INFINITY
            }
        })
    };
    let (steps, seconds) = outcomes.iter().fold((0, 0.0), |(steps, seconds), o| {
        (steps + o.all_env_steps, seconds + o.seconds)
    });
    [
        bench.agents.to_string(),
        format!(
            "{}/{}",
            outcomes.iter().filter(|outcome| outcome.solved).count(),
            outcomes.len()
        ),
        curve
            .median()
            .map_or(beyond_end.clone(), |median| format!("{median:.1}")),
        format_interval(curve.median_interval(), shown),
        shown(times().fold(f64::INFINITY, f64::min)),
        shown(times().fold(0.0, f64::max)),
        env_steps.map_or("unknown".to_owned(), |median| format!("{median:.0}")),
        format!("{:.0}", steps as f64 / seconds),
    ]
}

const EXPLORING: Columns<4> = [
    ("agents", 8),
    ("reached", 9),
    ("in episode", 10),
    ("coverage", 8),
];

/// Prints which agents reached the threshold by themselves.
fn print_exploration(table: &Table, benches: &[Bench]) {
    say!(
        "\nAgents with an episode of their own that reached the threshold, the median number of that episode, and"
    );
    say!("the mean share of the state space that the team visited.\n");
    table.header(&EXPLORING);
    for bench in benches {
        table.row(&EXPLORING, &bench.name, &exploration_cells(bench));
    }
}

/// Agents that never reached the threshold count as slower than all that did.
fn exploration_cells(bench: &Bench) -> [String; 4] {
    let reached: Vec<Option<u64>> = bench
        .outcomes
        .iter()
        .flat_map(|outcome| outcome.reached.iter().copied())
        .collect();
    let episodes: Vec<f64> = reached
        .iter()
        .map(|episode| episode.map_or(f64::INFINITY, |episode| episode as f64))
        .collect();
    let middle = median(&episodes);
    let coverage = bench
        .outcomes
        .iter()
        .map(|outcome| outcome.coverage)
        .sum::<f64>()
        / bench.outcomes.len() as f64;
    [
        reached.len().to_string(),
        reached.iter().flatten().count().to_string(),
        if middle.is_finite() {
            format!("{middle:.1}")
        } else {
            format!("> {}", bench.max_episodes)
        },
        format!("{:.0} %", 100.0 * coverage),
    ]
}

const PAIRED: Columns<5> = [
    ("difference", 10),
    ("95 % interval", 17),
    ("P(faster)", 9),
    ("95 % interval", 13),
    ("p (Holm)", 12),
];

/// Compares each of the `others` with the `first`, paired by run seed.
fn compare_all(table: &Table, first: &Bench, others: &[Bench]) {
    say!(
        "\nCompared with {}, paired by run seed: median difference in episodes (below 0: faster), probability",
        first.name
    );
    say!(
        "that a run is faster, and p value of Wilcoxon's signed-rank test, corrected by Holm's method.\n"
    );
    table.header(&PAIRED);
    let comparisons: Vec<Comparison> = others
        .iter()
        .map(|other| comparison(&other.outcomes, &first.outcomes))
        .collect();
    let p = holm_correction(
        &comparisons
            .iter()
            .map(|comparison| comparison.p)
            .collect::<Vec<f64>>(),
    );
    for ((other, comparison), p) in others.iter().zip(&comparisons).zip(p) {
        table.row(&PAIRED, &other.name, &comparison_cells(comparison, p));
    }
    if [first]
        .into_iter()
        .chain(others)
        .any(|bench| bench.outcomes.iter().any(|outcome| !outcome.solved))
    {
        say!(
            "\nTwo scenarios are compared up to the episode at which the first unsolved run of either ended. Runs that were"
        );
        say!(
            "not solved by then count as infinitely slow; the difference between two such runs is unknown."
        );
    }
}

/// Compares the runs of one scenario with those of another.
fn comparison(outcomes: &[Outcome], reference: &[Outcome]) -> Comparison {
    let episodes = |outcome: &Outcome| outcome.episodes;
    compare(
        &scores(outcomes, episodes),
        &scores(reference, episodes),
        true,
        Test::Paired,
    )
    .expect("both have the same run seeds")
}

fn comparison_cells(comparison: &Comparison, p: f64) -> [String; 5] {
    let signed = |value: f64| match (value.is_finite(), value.is_nan()) {
        (true, _) => format!("{value:.1}"),
        (_, true) => "unknown".to_owned(),
        _ => format!("{value}").replace("inf", "∞"),
    };
    let share = |value: f64| format!("{value:.2}");
    [
        signed(comparison.effect.value),
        format_interval(comparison.effect.interval, signed),
        share(comparison.probability_below.value),
        format_interval(comparison.probability_below.interval, share),
        if p < 0.0001 {
            "< 0.0001".to_owned()
        } else {
            format!("{p:.4}")
        },
    ]
}

pub(super) fn format_interval(interval: Interval, shown: impl Fn(f64) -> String) -> String {
    match interval {
        Interval::Known { low, high } if low == high => shown(low),
        Interval::Known { low, high } => format!("{} to {}", shown(low), shown(high)),
        Interval::TooFewRuns { n } => format!("none (n = {n})"),
    }
}

/// Table with the scenario's name in the first column.
pub(super) struct Table {
    pub(super) name_width: usize,
}

impl Table {
    pub(super) fn header<const N: usize>(&self, columns: &Columns<N>) {
        self.row(
            columns,
            "scenario",
            &columns.map(|(title, _)| title.to_owned()),
        );
        let rules: Vec<String> = columns
            .iter()
            .map(|(_, width)| format!("{}:|", "-".repeat(width + 1)))
            .collect();
        say!("|{}|{}", "-".repeat(self.name_width + 2), rules.concat());
    }

    pub(super) fn row<const N: usize>(
        &self,
        columns: &Columns<N>,
        name: &str,
        cells: &[String; N],
    ) {
        let cells: Vec<String> = cells
            .iter()
            .zip(columns)
            .map(|(cell, (_, width))| format!(" {cell:>width$} |"))
            .collect();
        say!("| {name:<0$} |{1}", self.name_width, cells.concat());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Outcomes from numbers of episodes; `+` marks an unsolved run. Each run took one second and 10
    /// environment steps per episode.
    fn outcomes(words: &str) -> Vec<Outcome> {
        let outcome = |word: &str| {
            let episodes = word.trim_end_matches('+').parse().unwrap();
            let (solved, steps) = (!word.ends_with('+'), 10 * episodes);
            let reached = vec![solved.then_some(episodes / 10), None];
            Outcome {
                solved,
                episodes,
                env_steps: steps,
                reached,
                coverage: 0.25,
                all_env_steps: steps,
                seconds: 1.0,
            }
        };
        words.split_whitespace().map(outcome).collect()
    }

    fn row(max_episodes: u32, words: &str) -> [String; 8] {
        solving_cells(&Bench {
            name: "x".to_owned(),
            agents: 4,
            max_episodes,
            outcomes: outcomes(words),
        })
    }

    /// The interval is that of `lifelines` for these data, which are in `crates/seedbed-stats/tests/reference/reference.json`:
    /// seven of ten solved.
    #[test]
    fn unsolved_runs_are_censored() {
        let cells = row(600, "299 410 512 600+ 480 333 600+ 345 600+ 391");
        assert_eq!(
            cells[..7],
            ["4", "7/10", "445.0", "299 to > 600", "299", "> 600", "4450"]
        );
    }

    /// Two agents per run; the first reached the threshold after a tenth of the episodes if its run
    /// was solved: 3, 4, 5 and three never.
    #[test]
    fn agents_that_never_reached_the_threshold_come_last() {
        let bench = |words| Bench {
            name: "x".to_owned(),
            agents: 2,
            max_episodes: 60,
            outcomes: outcomes(words),
        };
        assert_eq!(
            exploration_cells(&bench("30 40 50")),
            ["6", "3", "> 60", "25 %"]
        );
        assert_eq!(
            exploration_cells(&bench("30 40 60+")),
            ["6", "2", "> 60", "25 %"]
        );
    }

    #[test]
    fn unsolved_scenarios_have_no_median() {
        assert_eq!(
            row(60, "60+ 60+ 60+ 60+ 60+")[1..7],
            ["0/5", "> 60", "> 60", "> 60", "> 60", "unknown"]
        );
        assert_eq!(
            row(60, "40 50 60+")[1..7],
            ["2/3", "50.0", "none (n = 3)", "40", "> 60", "500"]
        );
    }

    /// Four of five pairs are faster by an unknown amount. Nothing is known of the fifth, which may
    /// be drawn several times in a bootstrap sample.
    #[test]
    fn comparisons_are_formatted() {
        let won = comparison(
            &outcomes("30 30 30 30 80"),
            &outcomes("50+ 50+ 50+ 50+ 50+"),
        );
        assert_eq!(
            comparison_cells(&won, won.p)[..3],
            ["-∞", "-∞ to ∞", "0.90"]
        );
        let none = comparison(
            &outcomes("80 80 80 80 80"),
            &outcomes("50+ 50+ 50+ 50+ 50+"),
        );
        assert_eq!(
            comparison_cells(&none, none.p)[..3],
            ["unknown", "-∞ to ∞", "0.50"]
        );
    }
}
