//! `seedbed bench`: when several seeds of a scenario solved their task, how fast they ran, and which scenario was first.

use std::time::Instant;

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{BenchArgs, Failure, counted, tabular};
use crate::input::InputError;
use crate::run::trainer::Trainer;
use crate::run::{Plan, RunError};
use crate::study::statistics::aggregate::median;
use crate::study::statistics::comparison::holm;
use crate::study::statistics::improvement::probability_of_improvement;
use crate::study::statistics::paired::{differences, signed_rank};
use crate::study::statistics::survival::{Lifetime, kaplan_meier};
use crate::study::statistics::{Estimate, Interval, LEAST_RUNS, estimate_of_sample};

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
    if args.scenarios.iter().any(|path| tabular::is_meant(path)) {
        return tabular::bench(args);
    }
    let plans: Result<Vec<Plan>, InputError> = args.scenarios.iter().map(|path| Plan::load(path, &args.overrides)).collect();
    let pool = ThreadPoolBuilder::new().num_threads(args.jobs.map_or(0, usize::from)).build();
    let pool = pool.map_err(|error| Failure::Work(error.to_string()))?;
    let plans = plans?;
    let table = Table { name_width: plans.iter().map(|plan| plan.name.chars().count()).max().unwrap_or(0).max(8) };
    let benches = train_all(&table, &plans, args, &pool)?;
    if args.whole {
        explore(&table, &benches);
    }
    if let Some((first, others)) = benches.split_first().filter(|(_, others)| !others.is_empty()) {
        compare(&table, first, others);
    }
    if (args.seeds as usize) < LEAST_RUNS {
        say!("\nn = {} is too few for an interval, which takes at least {LEAST_RUNS} seeds.", args.seeds);
    }
    Ok(())
}

/// Scenario by scenario; says of each what came of it as soon as that is known.
fn train_all(table: &Table, plans: &[Plan], args: &BenchArgs, pool: &ThreadPool) -> Result<Vec<Bench>, RunError> {
    let seeds = counted(args.seeds as usize, "seed");
    say!("Episodes per agent until solved, of {seeds} from {} on: Kaplan-Meier median with its 95 % interval.", args.first_seed);
    say!("Env steps are the team's until then, in the median; steps/s are those of one thread.\n");
    table.head(&SOLVING);
    let mut benches = Vec::new();
    for plan in plans {
        let bench = train(plan, args, pool)?;
        table.row(&SOLVING, &bench.name, &solving(&bench));
        benches.push(bench);
    }
    Ok(benches)
}

fn train(plan: &Plan, args: &BenchArgs, pool: &ThreadPool) -> Result<Bench, RunError> {
    let seeds = args.first_seed..args.first_seed.saturating_add(args.seeds);
    let outcomes: Result<Vec<Outcome>, RunError> =
        pool.install(|| seeds.into_par_iter().map(|seed| outcome(plan, seed, args.whole)).collect());
    let scenario = &plan.scenario;
    let (agents, most_episodes) = (scenario.agents.count.get(), scenario.most_episodes());
    Ok(Bench { name: plan.name.clone(), agents, most_episodes, outcomes: outcomes? })
}

/// Trains once, on one thread and without a recording, until the task is solved or, where `whole`, to the scenario's end.
fn outcome(plan: &Plan, seed: u64, whole: bool) -> Result<Outcome, RunError> {
    let mut plan = plan.clone();
    plan.scenario.seed = seed;
    let mut trainer = Trainer::new(&plan.scenario, &plan.description, 1)?;
    let (mut solved, mut reached) = (None, vec![None; trainer.agents().len()]);
    let started = Instant::now();
    while trainer.measures().episodes_per_agent() < plan.scenario.most_episodes() as usize && (whole || solved.is_none()) {
        let rows = trainer.advance()?.rows;
        for row in rows.episodes.iter().filter(|row| trainer.threshold().is_some_and(|wanted| row.r#return >= wanted.r#return)) {
            reached[row.agent as usize].get_or_insert(u64::from(row.episode) + 1);
        }
        if solved.is_none() && trainer.is_solved() {
            solved = Some(so_far(&trainer));
        }
    }
    let seconds = started.elapsed().as_secs_f64();
    let (episodes, env_steps) = solved.unwrap_or_else(|| so_far(&trainer));
    let (coverage, all_env_steps) = (trainer.measures().team_coverage(), trainer.measures().env_steps());
    Ok(Outcome { solved: solved.is_some(), episodes, env_steps, reached, coverage, all_env_steps, seconds })
}

/// Episodes of each agent, and steps of the team.
fn so_far(trainer: &Trainer) -> (u64, u64) {
    (trainer.measures().episodes_per_agent() as u64, trainer.measures().env_steps())
}

/// Columns after the scenario's name, with their widths.
pub(super) type Columns<const N: usize> = [(&'static str, usize); N];

const SOLVING: Columns<8> =
    [("K", 4), ("solved", 7), ("median", 7), ("95 % interval", 15), ("least", 6), ("most", 6), ("env steps", 10), ("steps/s", 8)];

/// Seeds that did not solve the task are censored: known to take longer than they were given.
fn solving(bench: &Bench) -> [String; 8] {
    let outcomes = &bench.outcomes;
    let curve = kaplan_meier(&lifetimes(outcomes, |outcome| outcome.episodes));
    let env_steps = kaplan_meier(&lifetimes(outcomes, |outcome| outcome.env_steps)).median();
    let at_most = format!("> {}", bench.most_episodes);
    let shown = |end: f64| if end.is_finite() { format!("{end}") } else { at_most.clone() };
    let times = || outcomes.iter().map(|outcome| if outcome.solved { outcome.episodes as f64 } else { f64::INFINITY });
    let (steps, seconds) = outcomes.iter().fold((0, 0.0), |(steps, seconds), o| (steps + o.all_env_steps, seconds + o.seconds));
    [
        bench.agents.to_string(),
        format!("{}/{}", outcomes.iter().filter(|outcome| outcome.solved).count(), outcomes.len()),
        curve.median().map_or(at_most.clone(), |median| format!("{median:.1}")),
        interval_in_words(curve.median_interval(), shown),
        shown(times().fold(f64::INFINITY, f64::min)),
        shown(times().fold(0.0, f64::max)),
        env_steps.map_or("unknown".to_owned(), |median| format!("{median:.0}")),
        format!("{:.0}", steps as f64 / seconds),
    ]
}

fn lifetimes(outcomes: &[Outcome], time: impl Fn(&Outcome) -> u64) -> Vec<Lifetime> {
    outcomes.iter().map(|outcome| Lifetime { time: time(outcome) as f64, reached: outcome.solved }).collect()
}

const EXPLORING: Columns<4> = [("agents", 8), ("reached", 9), ("in episode", 10), ("coverage", 8)];

/// What whole runs came to, agent by agent.
fn explore(table: &Table, benches: &[Bench]) {
    say!("\nAgents that reached the return by themselves, in which of their episodes (the median), and the share of the");
    say!("state space that their team visited.\n");
    table.head(&EXPLORING);
    for bench in benches {
        table.row(&EXPLORING, &bench.name, &exploring(bench));
    }
}

/// Agents that never reached it count as slower than all that did.
fn exploring(bench: &Bench) -> [String; 4] {
    let reached: Vec<Option<u64>> = bench.outcomes.iter().flat_map(|outcome| outcome.reached.iter().copied()).collect();
    let episodes: Vec<f64> = reached.iter().map(|episode| episode.map_or(f64::INFINITY, |episode| episode as f64)).collect();
    let middle = median(&episodes);
    let coverage = bench.outcomes.iter().map(|outcome| outcome.coverage).sum::<f64>() / bench.outcomes.len() as f64;
    [
        reached.len().to_string(),
        reached.iter().flatten().count().to_string(),
        if middle.is_finite() { format!("{middle:.1}") } else { format!("> {}", bench.most_episodes) },
        format!("{:.0} %", 100.0 * coverage),
    ]
}

const PAIRED: Columns<5> =
    [("difference", 10), ("95 % interval", 17), ("P(faster)", 9), ("95 % interval", 13), ("p after Holm", 12)];

/// Each of the `others` against the `first`, seed by seed.
fn compare(table: &Table, first: &Bench, others: &[Bench]) {
    say!("\nAgainst {}, seed by seed: the median difference in episodes (below 0 is faster), how likely", first.name);
    say!("a run is faster than one of the former, and p of Wilcoxon's signed-rank test.\n");
    table.head(&PAIRED);
    let comparisons: Vec<Comparison> = others.iter().map(|other| comparison(&other.outcomes, &first.outcomes)).collect();
    let p = holm(&comparisons.iter().map(|comparison| comparison.p).collect::<Vec<f64>>());
    for ((other, comparison), p) in others.iter().zip(&comparisons).zip(p) {
        table.row(&PAIRED, &other.name, &comparison.in_words(p));
    }
    if [first].into_iter().chain(others).any(|bench| bench.outcomes.iter().any(|outcome| !outcome.solved)) {
        say!("\nA pair of scenarios is compared up to where the first unsolved run of either ended; what was not solved by then");
        say!("counts as infinitely slow.");
    }
}

/// One scenario against another.
struct Comparison {
    difference: Estimate,
    faster: Estimate,
    p: f64,
}

/// A run that was given fewer episodes may be unsolved for that reason alone. So both scenarios are judged by the time of which
/// everything is known: up to the end of the first run that did not solve the task.
fn comparison(outcomes: &[Outcome], reference: &[Outcome]) -> Comparison {
    let unsolved = outcomes.iter().chain(reference).filter(|outcome| !outcome.solved);
    let horizon = unsolved.map(|outcome| outcome.episodes).min().unwrap_or(u64::MAX);
    let time = |outcome: &Outcome| {
        if outcome.solved && outcome.episodes <= horizon { outcome.episodes as f64 } else { f64::INFINITY }
    };
    let times = |outcomes: &[Outcome]| outcomes.iter().map(time).collect::<Vec<f64>>();
    let speeds = |outcomes: &[Outcome]| vec![outcomes.iter().map(|outcome| -time(outcome)).collect::<Vec<f64>>()];
    let differences = differences(&times(outcomes), &times(reference));
    Comparison {
        difference: estimate_of_sample(&differences, median),
        faster: probability_of_improvement(&speeds(outcomes), &speeds(reference)),
        p: signed_rank(&differences).p,
    }
}

impl Comparison {
    fn in_words(&self, p: f64) -> [String; 5] {
        let signed =
            |value: f64| if value.is_finite() { format!("{value:.1}") } else { format!("{value}").replace("inf", "∞") };
        let share = |value: f64| format!("{value:.2}");
        [
            signed(self.difference.value),
            interval_in_words(self.difference.interval, signed),
            share(self.faster.value),
            interval_in_words(self.faster.interval, share),
            if p < 0.0001 { "< 0.0001".to_owned() } else { format!("{p:.4}") },
        ]
    }
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
        self.row(columns, "scenario", &columns.map(|(title, _)| title.to_owned()));
        let rules: Vec<String> = columns.iter().map(|(_, width)| format!("{}:|", "-".repeat(width + 1))).collect();
        say!("|{}|{}", "-".repeat(self.name_width + 2), rules.concat());
    }

    pub(super) fn row<const N: usize>(&self, columns: &Columns<N>, name: &str, cells: &[String; N]) {
        let cells: Vec<String> = cells.iter().zip(columns).map(|(cell, (_, width))| format!(" {cell:>width$} |")).collect();
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
            Outcome { solved, episodes, env_steps: steps, reached, coverage: 0.25, all_env_steps: steps, seconds: 1.0 }
        };
        words.split_whitespace().map(outcome).collect()
    }

    fn row(most_episodes: u32, words: &str) -> [String; 8] {
        solving(&Bench { name: "x".to_owned(), agents: 4, most_episodes, outcomes: outcomes(words) })
    }

    /// The ends are `lifelines`' for these data, which stand in `tests/statistics/reference.json`: seven of ten solved.
    #[test]
    fn unsolved_runs_are_censored() {
        let cells = row(600, "299 410 512 600+ 480 333 600+ 345 600+ 391");
        assert_eq!(cells[..7], ["4", "7/10", "445.0", "299 to > 600", "299", "> 600", "4450"]);
    }

    /// Of two agents a run, the first reached the return in a tenth of the episodes, if its run was solved: 3, 4, 5 and three never.
    #[test]
    fn agents_that_never_reached_the_return_come_last() {
        let bench = |words| Bench { name: "x".to_owned(), agents: 2, most_episodes: 60, outcomes: outcomes(words) };
        assert_eq!(exploring(&bench("30 40 50")), ["6", "3", "> 60", "25 %"]);
        assert_eq!(exploring(&bench("30 40 60+")), ["6", "2", "> 60", "25 %"]);
    }

    #[test]
    fn a_scenario_that_solves_nothing_says_no_more_than_that() {
        assert_eq!(row(60, "60+ 60+ 60+ 60+ 60+")[1..7], ["0/5", "> 60", "> 60", "> 60", "> 60", "unknown"]);
        assert_eq!(row(60, "40 50 60+")[1..7], ["2/3", "50.0", "n = 3: none", "40", "> 60", "500"]);
    }

    /// Differences −10, −20, −30, −40, −50 have median −30; all of one sign has p = 2/2⁵. Of the 25 pairs 10 beats five of 20 to
    /// 100 and so on: each of 10, 20, 30, 40, 50 is below 5, 4½, 4, 3½, 3 of them, which makes 20 in 25.
    #[test]
    fn pairs_are_compared_seed_by_seed() {
        let comparison = comparison(&outcomes("10 20 30 40 50"), &outcomes("20 40 60 80 100"));
        assert_eq!((comparison.difference.value, comparison.faster.value, comparison.p), (-30.0, 0.8, 0.0625));
        let Interval::Known { low, high } = comparison.difference.interval else { panic!("five are enough") };
        assert!((-50.0..-30.0).contains(&low) && (-30.0..=-10.0).contains(&high), "{low} to {high}");
    }

    /// Of the second nothing is known after 50 episodes, when it was not solved yet; the first took 80 or 90 and was not either.
    #[test]
    fn a_run_with_fewer_episodes_does_not_lose_for_that() {
        let tie = comparison(&outcomes("80 90 80 90 80"), &outcomes("50+ 50+ 50+ 50+ 50+"));
        assert_eq!((tie.difference.value, tie.faster.value, tie.p), (0.0, 0.5, 1.0));
        let won = comparison(&outcomes("30 30 30 30 80"), &outcomes("50+ 50+ 50+ 50+ 50+"));
        assert_eq!((won.difference.value, won.faster.value), (f64::NEG_INFINITY, 0.9));
        assert_eq!(won.in_words(won.p)[..3], ["-∞", "-∞ to 0.0", "0.90"]);
    }
}
