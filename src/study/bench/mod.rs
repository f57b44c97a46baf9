//! Benchmarks: several runs of each of a few scenarios, and comparisons with the first scenario.

mod regret;
mod solving;

use std::fmt::Debug;
use std::ops::Range;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use rayon::ThreadPool;
use rayon::prelude::*;

use self::regret::RegretReport;
use self::solving::SolvingReport;
use crate::experiment::measure::Measure;
use crate::experiment::run_result::{Milestone, RunResult};
use crate::experiment::{Experiment, RunControl, StopRule};
use crate::run::RunError;
use seedbed_stats::Interval;

/// Runs of one experiment, in the order of their run seeds.
#[derive(Clone, Debug)]
pub struct Bench {
    /// Name of the scenario.
    pub name: String,
    /// Everything that defines the task, as text.
    pub task_definition: String,
    /// Number of agents K.
    pub agents: u32,
    /// Maximum number of episodes per agent.
    pub max_episodes: u32,
    /// Results of each run, in the order of run seeds.
    pub outcomes: Vec<Outcome>,
}

/// Results of one run that a benchmark uses.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Whether the task was solved.
    pub solved: bool,
    /// When the task was solved or, if it was not solved, when the run ended.
    pub solved_or_ended_at: Milestone,
    /// First episode of each agent, counted from 1, in which it reached the goal by itself: `[K]`.
    pub first_goals: Vec<Option<u32>>,
    /// Share of the state space that the team visited.
    pub coverage: f64,
    /// Mean over agents of their regrets, summed over episodes; NaN if unknown.
    pub regret: f64,
    /// Share of episodes without regret; NaN if unknown.
    pub share_of_episodes_without_regret: f64,
    /// Environment steps of the team in the whole run.
    pub env_steps: u64,
    /// Duration of the run, in seconds.
    pub seconds: f64,
}

/// What a benchmark prints about runs of an experiment.
#[must_use]
pub fn report_of(experiment: &dyn Experiment) -> &'static dyn BenchReport {
    if experiment.knows_regret() {
        &RegretReport
    } else {
        &SolvingReport
    }
}

/// What a benchmark of one kind of experiment prints.
pub trait BenchReport: Debug + Sync {
    /// Name of the measure that is compared, e.g. `regret`.
    fn measure(&self) -> &'static str;

    /// Lines above the table of results; `seeds` is e.g. `10 run seeds from 0`.
    fn introduction(&self, seeds: &str) -> Vec<String>;

    /// Columns of the table of results, which has one row per scenario.
    fn columns(&self) -> &'static [Column];

    /// Cells of a row of the table of results.
    fn table_row(&self, bench: &Bench) -> Vec<String>;

    /// Table of the agents that reached the goal by themselves, for runs that do not stop when the
    /// task is solved; `None` if their number is unknown.
    fn exploration(&self, _benches: &[Bench]) -> Option<BenchTable> {
        None
    }

    /// Comparison of the other scenarios with the first scenario; `None` if no scenario can be
    /// compared with it.
    fn comparison(&self, benches: &[Bench]) -> Option<BenchTable>;
}

/// Title of a column, and its width in characters. The first column of each table, with the name of
/// the scenario, is not listed.
pub type Column = (&'static str, usize);

/// A table with the lines above and below it.
#[derive(Clone, Debug)]
pub struct BenchTable {
    /// Lines above the table.
    pub above: Vec<String>,
    /// Columns after the scenario's name.
    pub columns: &'static [Column],
    /// Scenario's name and cells of each row.
    pub rows: Vec<(String, Vec<String>)>,
    /// Lines below the table.
    pub below: Vec<String>,
}

impl Bench {
    /// Runs `experiment` once for each of `run_seeds`, on the threads of `pool` with one thread per
    /// run. With `whole`, runs do not stop when the task is solved.
    ///
    /// # Errors
    /// If the task cannot be built, or if a number is not finite.
    pub fn run(
        experiment: &dyn Experiment,
        run_seeds: Range<u64>,
        whole: bool,
        pool: &ThreadPool,
    ) -> Result<Self, RunError> {
        let outcomes: Result<Vec<Outcome>, RunError> = pool.install(|| {
            run_seeds
                .into_par_iter()
                .map(|run_seed| Outcome::run(experiment, run_seed, whole))
                .collect()
        });
        Ok(Self {
            name: experiment.name().to_owned(),
            task_definition: experiment.task_definition(),
            agents: experiment.agents(),
            max_episodes: experiment.max_episodes(),
            outcomes: outcomes?,
        })
    }

    /// Environment steps per second of a run on one thread.
    fn speed(&self) -> f64 {
        let (mut steps, mut seconds) = (0, 0.0);
        for outcome in &self.outcomes {
            steps += outcome.env_steps;
            seconds += outcome.seconds;
        }
        steps as f64 / seconds
    }
}

impl Outcome {
    fn run(experiment: &dyn Experiment, run_seed: u64, whole: bool) -> Result<Self, RunError> {
        let stop_rule = if whole {
            StopRule::Maximum
        } else {
            StopRule::Solved
        };
        let started = Instant::now();
        let never = AtomicBool::new(false);
        let run = experiment
            .measure_once(
                run_seed,
                stop_rule,
                &[],
                RunControl::without_checkpoints(&never),
            )?
            .expect("the run is never interrupted");
        Ok(Self::of(&run, started.elapsed().as_secs_f64()))
    }

    fn of(run: &RunResult, seconds: f64) -> Self {
        let end = Milestone {
            episodes: run.episodes_per_agent() as u32,
            env_steps: run.env_steps,
        };
        Self {
            solved: run.solved.is_some(),
            solved_or_ended_at: run.solved.unwrap_or(end),
            first_goals: run.first_goals(),
            coverage: run.team_coverage(),
            regret: Measure::Regret.of(run).unwrap_or(f64::NAN),
            share_of_episodes_without_regret: run
                .share_of_episodes_without_regret()
                .unwrap_or(f64::NAN),
            env_steps: run.env_steps,
            seconds,
        }
    }
}

fn format_interval(interval: Interval, format: impl Fn(f64) -> String) -> String {
    match interval {
        Interval::Known { low, high } if low == high => format(low),
        Interval::Known { low, high } => format!("{} to {}", format(low), format(high)),
        Interval::TooFewRuns { n } => format!("none (n = {n})"),
    }
}
