//! `seedbed bench`: when several seeds of a scenario solved their task, how fast they ran, and which scenario was first.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{BenchArgs, Failure, counted, tabular};
use crate::input::InputError;
use crate::run::{Plan, RunError};
use crate::study::comparison::{Comparison, Score, compare, lifetimes};
use crate::study::file::Test;
use crate::study::measured::{Measured, Until, train};
use crate::study::statistics::aggregate::median;
use crate::study::statistics::comparison::holm;
use crate::study::statistics::survival::kaplan_meier;
use crate::study::statistics::{Interval, LEAST_RUNS};
use crate::tabular::scenario::is_meant;

/// What one run came to.
#[derive(Clone)]
struct Outcome {
    solved: bool,
    /// Of each agent until it solved its task, or else to its end; and steps of the team.
    episodes: u64,
    env_steps: u64,
    /// Of each agent: its first episode that reached the return by itself, counted from 1.
    reached: Vec<Option<u64>>,
    /// Share of the state space that the team visited.
    coverage: f64,
    all_env_steps: u64,
    seconds: f64,
}

/// What the runs of one scenario came to, in the order of their seeds.
struct Bench {
    name: String,
    agents: u32,
    most_episodes: u32,
    outcomes: Vec<Outcome>,
}

pub(super) fn bench(args: &BenchArgs) -> Result<(), Failure> {
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
    let pool = pool.map_err(|error| Failure::Work(error.to_string()))?;
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
        explore(&table, &benches);
    }
    if let Some((first, others)) = benches
        .split_first()
        .filter(|(_, others)| !others.is_empty())
    {
        compare_all(&table, first, others);
    }
    if (args.seeds as usize) < LEAST_RUNS {
        say!(
            "\nn = {} is too few for an interval, which takes at least {LEAST_RUNS} seeds.",
            args.seeds
        );
    }
    Ok(())
}

/// Scenario by scenario; says of each what came of it as soon as that is known.
fn train_all(
    table: &Table,
    plans: &[Plan],
    args: &BenchArgs,
    pool: &ThreadPool,
) -> Result<Vec<Bench>, RunError> {
    let seeds = counted(args.seeds as usize, "seed");
    say!(
        "Episodes per agent until solved, of {seeds} from {} on: Kaplan-Meier median with its 95 % interval.",
        args.first_seed
    );
    say!("Env steps are the team's until then, in the median; steps/s are those of one thread.\n");
    table.head(&SOLVING);
    let mut benches = Vec::new();
    for plan in plans {
        let bench = bench_of(plan, args, pool)?;
        table.row(&SOLVING, &bench.name, &solving(&bench));
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
    let (agents, most_episodes) = (scenario.agents.count.get(), scenario.most_episodes());
    Ok(Bench {
        name: plan.name.clone(),
        agents,
        most_episodes,
        outcomes: outcomes?,
    })
}

/// Trains once, on one thread and without a recording, until the task is solved or, where `whole`, to the scenario's end.
fn outcome(plan: &Plan, seed: u64, whole: bool) -> Result<Outcome, RunError> {
    let mut plan = plan.clone();
    plan.scenario.seed = seed;
    let until = if whole {
        Until::MostEpisodes
    } else {
        Until::Solved
    };
    let started = Instant::now();
    let run = train(&plan, until, &[], &AtomicBool::new(false))?.expect("nothing interrupts it");
    Ok(Outcome::of(&run, started.elapsed().as_secs_f64()))
}

impl Outcome {
    fn of(run: &Measured, seconds: f64) -> Self {
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
        let (value, watched) = if self.solved {
            (time as f64, f64::INFINITY)
        } else {
            (f64::INFINITY, time as f64)
        };
        Score {
            seed,
            value,
            watched,
        }
    }
}

/// Times of runs, in the order of their seeds.
fn scores(outcomes: &[Outcome], time: impl Fn(&Outcome) -> u64) -> Vec<Score> {
    (0..)
        .zip(outcomes)
        .map(|(seed, outcome)| outcome.score(seed, time(outcome)))
        .collect()
}

/// Columns after the scenario's name, with their widths.
pub(super) type Columns<const N: usize> = [(&'static str, usize); N];

const SOLVING: Columns<8> = [
    ("K", 4),
    ("solved", 7),
    ("median", 7),
    ("95 % interval", 15),
    ("least", 6),
    ("most", 6),
    ("env steps", 10),
    ("steps/s", 8),
];

/// Seeds that did not solve the task are censored: known to take longer than they were given.
fn solving(bench: &Bench) -> [String; 8] {
    let outcomes = &bench.outcomes;
    let curve = kaplan_meier(&lifetimes(&scores(outcomes, |outcome| outcome.episodes)));
    let env_steps =
        kaplan_meier(&lifetimes(&scores(outcomes, |outcome| outcome.env_steps))).median();
    let at_most = format!("> {}", bench.most_episodes);
    let shown = |end: f64| {
        if end.is_finite() {
            format!("{end}")
        } else {
            at_most.clone()
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
            .map_or(at_most.clone(), |median| format!("{median:.1}")),
        interval_in_words(curve.median_interval(), shown),
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

/// What whole runs came to, agent by agent.
fn explore(table: &Table, benches: &[Bench]) {
    say!(
        "\nAgents that reached the return by themselves, in which of their episodes (the median), and the share of the"
    );
    say!("state space that their team visited.\n");
    table.head(&EXPLORING);
    for bench in benches {
        table.row(&EXPLORING, &bench.name, &exploring(bench));
    }
}

/// Agents that never reached it count as slower than all that did.
fn exploring(bench: &Bench) -> [String; 4] {
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
            format!("> {}", bench.most_episodes)
        },
        format!("{:.0} %", 100.0 * coverage),
    ]
}

const PAIRED: Columns<5> = [
    ("difference", 10),
    ("95 % interval", 17),
    ("P(faster)", 9),
    ("95 % interval", 13),
    ("p after Holm", 12),
];

/// Each of the `others` against the `first`, seed by seed.
fn compare_all(table: &Table, first: &Bench, others: &[Bench]) {
    say!(
        "\nAgainst {}, seed by seed: the median difference in episodes (below 0 is faster), how likely",
        first.name
    );
    say!("a run is faster than one of the former, and p of Wilcoxon's signed-rank test.\n");
    table.head(&PAIRED);
    let comparisons: Vec<Comparison> = others
        .iter()
        .map(|other| comparison(&other.outcomes, &first.outcomes))
        .collect();
    let p = holm(
        &comparisons
            .iter()
            .map(|comparison| comparison.p)
            .collect::<Vec<f64>>(),
    );
    for ((other, comparison), p) in others.iter().zip(&comparisons).zip(p) {
        table.row(&PAIRED, &other.name, &in_words(comparison, p));
    }
    if [first]
        .into_iter()
        .chain(others)
        .any(|bench| bench.outcomes.iter().any(|outcome| !outcome.solved))
    {
        say!(
            "\nA pair of scenarios is compared up to where the first unsolved run of either ended; what was not solved by then"
        );
        say!("counts as infinitely slow; how far apart two such runs are is unknown.");
    }
}

/// One scenario against another.
fn comparison(outcomes: &[Outcome], reference: &[Outcome]) -> Comparison {
    let episodes = |outcome: &Outcome| outcome.episodes;
    compare(
        &scores(outcomes, episodes),
        &scores(reference, episodes),
        true,
        Test::Paired,
    )
    .expect("both have the same seeds")
}

fn in_words(comparison: &Comparison, p: f64) -> [String; 5] {
    let signed = |value: f64| match (value.is_finite(), value.is_nan()) {
        (true, _) => format!("{value:.1}"),
        (_, true) => "unknown".to_owned(),
        _ => format!("{value}").replace("inf", "∞"),
    };
    let share = |value: f64| format!("{value:.2}");
    [
        signed(comparison.effect.value),
        interval_in_words(comparison.effect.interval, signed),
        share(comparison.below.value),
        interval_in_words(comparison.below.interval, share),
        if p < 0.0001 {
            "< 0.0001".to_owned()
        } else {
            format!("{p:.4}")
        },
    ]
}

pub(super) fn interval_in_words(interval: Interval, shown: impl Fn(f64) -> String) -> String {
    match interval {
        Interval::Known { low, high } if low == high => shown(low),
        Interval::Known { low, high } => format!("{} to {}", shown(low), shown(high)),
        Interval::TooFewRuns { n } => format!("n = {n}: none"),
    }
}

/// Tables with the scenario's name in the first column.
pub(super) struct Table {
    pub(super) name_width: usize,
}

impl Table {
    pub(super) fn head<const N: usize>(&self, columns: &Columns<N>) {
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

    /// Numbers of episodes; a `+` marks a run that did not solve its task. Each took 10 env steps an episode, and a second.
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

    fn row(most_episodes: u32, words: &str) -> [String; 8] {
        solving(&Bench {
            name: "x".to_owned(),
            agents: 4,
            most_episodes,
            outcomes: outcomes(words),
        })
    }

    /// The ends are `lifelines`' for these data, which stand in `tests/statistics/reference.json`: seven of ten solved.
    #[test]
    fn unsolved_runs_are_censored() {
        let cells = row(600, "299 410 512 600+ 480 333 600+ 345 600+ 391");
        assert_eq!(
            cells[..7],
            ["4", "7/10", "445.0", "299 to > 600", "299", "> 600", "4450"]
        );
    }

    /// Of two agents a run, the first reached the return in a tenth of the episodes, if its run was solved: 3, 4, 5 and three never.
    #[test]
    fn agents_that_never_reached_the_return_come_last() {
        let bench = |words| Bench {
            name: "x".to_owned(),
            agents: 2,
            most_episodes: 60,
            outcomes: outcomes(words),
        };
        assert_eq!(exploring(&bench("30 40 50")), ["6", "3", "> 60", "25 %"]);
        assert_eq!(exploring(&bench("30 40 60+")), ["6", "2", "> 60", "25 %"]);
    }

    #[test]
    fn a_scenario_that_solves_nothing_says_no_more_than_that() {
        assert_eq!(
            row(60, "60+ 60+ 60+ 60+ 60+")[1..7],
            ["0/5", "> 60", "> 60", "> 60", "> 60", "unknown"]
        );
        assert_eq!(
            row(60, "40 50 60+")[1..7],
            ["2/3", "50.0", "n = 3: none", "40", "> 60", "500"]
        );
    }

    /// Four of five pairs are faster by more than can be told, but of the fifth nothing is known, and redrawn it may be most of them.
    #[test]
    fn comparisons_are_put_in_words() {
        let won = comparison(
            &outcomes("30 30 30 30 80"),
            &outcomes("50+ 50+ 50+ 50+ 50+"),
        );
        assert_eq!(in_words(&won, won.p)[..3], ["-∞", "-∞ to ∞", "0.90"]);
        let none = comparison(
            &outcomes("80 80 80 80 80"),
            &outcomes("50+ 50+ 50+ 50+ 50+"),
        );
        assert_eq!(in_words(&none, none.p)[..3], ["unknown", "-∞ to ∞", "0.50"]);
    }
}
