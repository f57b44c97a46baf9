//! Tabular scenarios on the command line: their part of `run`, `bench`, `check` and `list`.

use std::convert::Infallible;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

use super::bench::{Columns, Table, format_interval};
use super::run::{lock_output_dir, recording};
use super::{BenchArgs, CliError, RunArgs, pluralize};
use crate::record::recording::AVAILABLE;
use crate::run::RunError;
use crate::run::folder::RunFolder;
use crate::tabular::TabularScenario;
use crate::tabular::recording::{Film, MAX_AGENTS};
use crate::tabular::results::{Results, Summary};
use crate::tabular::scenario::{self, is_meant};
use crate::tabular::team::{Step, TabularTeam};
use seedbed_env::input::InputError;
use seedbed_env::tabular::TaskFamily;
use seedbed_stats::aggregate::mean;
use seedbed_stats::hypothesis::holm_correction;
use seedbed_stats::paired::{differences, signed_rank_test};
use seedbed_stats::{MIN_RUNS, bootstrap_sample};

/// Description, e.g. `100 agents in BipolarChain, SeedSampling`.
pub(super) fn describe(path: &Path) -> Result<String, InputError> {
    let scenario = scenario::load(path, &[])?.value;
    let agents = pluralize(scenario.agents.count.get() as usize, "agent");
    Ok(format!(
        "{agents} in {}, {}",
        scenario.task.name(),
        scenario.algorithm.name()
    ))
}

pub(super) fn run(args: &RunArgs, overrides: &[String]) -> Result<(), CliError> {
    let scenario = scenario::load(&args.scenario, overrides)?.value;
    if args.serve.is_some() {
        let shown = args.scenario.display();
        return Err(CliError::Usage(format!(
            "--serve is not supported for tabular scenarios ({shown})"
        )));
    }
    let name = stem(&args.scenario);
    let folder = RunFolder::new(
        args.out
            .clone()
            .unwrap_or_else(|| default_folder(&name, scenario.seed)),
    );
    let lock = lock_output_dir(args, &folder)?;
    let started = Instant::now();
    let path = folder.recording();
    let mut film = Film::of(
        &name,
        &scenario,
        (AVAILABLE && !args.no_recording).then(|| recording(&path)),
    )
    .map_err(RunError::from)?;
    let results = play(&name, &scenario, &bar(&scenario, args.quiet), |step| {
        film.take_in(step)
    })
    .map_err(RunError::from)?;
    film.finish().map_err(RunError::from)?;
    let write_error = |error: std::io::Error| {
        CliError::Runtime(format!(
            "cannot write to {}: {error}",
            folder.path().display()
        ))
    };
    results.write(&scenario, &folder).map_err(write_error)?;
    lock.release().map_err(write_error)?;
    if !args.quiet {
        print(
            &results.summary,
            folder.path(),
            started.elapsed().as_secs_f64(),
        );
        print_recording(args, &path);
    }
    Ok(())
}

fn print_recording(args: &RunArgs, path: &Path) {
    if path.is_file() {
        say!(
            "recording  {}; open it with\n             rerun {}",
            path.display(),
            path.display()
        );
    } else if !args.no_recording {
        say!("recording  none: only teams of at most {MAX_AGENTS} agents are recorded");
    }
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .map_or_else(|| "run".into(), |stem| stem.to_string_lossy().into_owned())
}

fn default_folder(name: &str, seed: u64) -> PathBuf {
    Path::new("recordings")
        .join(name)
        .join(format!("seed-{seed}"))
}

/// Plays a scenario to its end; `bar` counts episodes, `on_step` is called for every step.
fn play<E>(
    name: &str,
    scenario: &TabularScenario,
    bar: &ProgressBar,
    mut on_step: impl FnMut(&Step) -> Result<(), E>,
) -> Result<Results, E> {
    let mut team = TabularTeam::new(scenario);
    let mut episodes = Vec::new();
    while let Some(step) = team.advance() {
        on_step(&step)?;
        if let Some(episode) = step.ended {
            episodes.push(episode);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    Ok(Results::of(name, scenario, &team, episodes))
}

fn bar(scenario: &TabularScenario, quiet: bool) -> ProgressBar {
    if quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:32} {pos}/{len} episodes · {eta} left");
    let bar = ProgressBar::new(
        u64::from(scenario.agents.count.get()) * u64::from(scenario.episodes.get()),
    );
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

fn print(summary: &Summary, folder: &Path, seconds: f64) {
    let Summary {
        agents,
        episodes_per_agent,
        env_steps,
        optimal_value,
        regret_per_agent,
        cumulative_regret,
        ..
    } = summary;
    let (episodes, team) = (
        pluralize(*episodes_per_agent as usize, "episode"),
        pluralize(*agents as usize, "agent"),
    );
    say!("finished   {episodes} per agent, {team}, {env_steps} env steps in {seconds:.1} s");
    say!("optimal    expected return {optimal_value:.3} per episode");
    say!("regret     {regret_per_agent:.3} per agent, {cumulative_regret:.1} in total");
    let share = 100.0 * summary.episodes_without_regret;
    say!("no regret  in {share:.1} % of episodes");
    say!(
        "visited    {} of {} states",
        summary.states_visited,
        summary.states
    );
    say!(
        "results    {}: regret.csv, visits.csv, summary.json, scenario.ron",
        folder.display()
    );
}

/// Results of all runs of one scenario, in the order of their run seeds.
struct Bench {
    name: String,
    task: TaskFamily,
    agents: u32,
    summaries: Vec<Summary>,
    seconds: f64,
}

impl Bench {
    fn regrets(&self) -> Vec<f64> {
        self.summaries
            .iter()
            .map(|summary| summary.regret_per_agent)
            .collect()
    }
}

const REGRET: Columns<7> = [
    ("agents", 6),
    ("regret", 8),
    ("95 % interval", 18),
    ("min", 8),
    ("max", 8),
    ("no regret", 9),
    ("steps/s", 9),
];

pub(super) fn bench(args: &BenchArgs) -> Result<(), CliError> {
    let other = args.scenarios.iter().find(|path| !is_meant(path));
    if let Some(other) = other {
        return Err(CliError::Usage(format!(
            "cannot compare tabular with other scenarios: {} is not a tabular scenario",
            other.display()
        )));
    }
    let load = |path: &PathBuf| Ok((stem(path), scenario::load(path, &args.overrides)?.value));
    let scenarios: Vec<(String, TabularScenario)> = args
        .scenarios
        .iter()
        .map(load)
        .collect::<Result<_, InputError>>()?;
    let table = Table {
        name_width: scenarios
            .iter()
            .map(|(name, _)| name.chars().count())
            .max()
            .unwrap_or(0)
            .max(8),
    };
    let seeds = pluralize(args.seeds as usize, "run seed");
    say!(
        "Regret per agent over {seeds} from {}: mean with 95 % interval, min and max.",
        args.first_seed
    );
    say!(
        "no regret: share of episodes without regret; steps/s: on one thread. Each run seed draws its own task.\n"
    );
    table.header(&REGRET);
    let mut benches = Vec::new();
    for (name, scenario) in scenarios {
        let bench = play_all(name, &scenario, args)?;
        table.row(&REGRET, &bench.name, &regret_cells(&bench));
        benches.push(bench);
    }
    compare(&table, &benches);
    if (args.seeds as usize) < MIN_RUNS {
        say!(
            "\nNo intervals: {MIN_RUNS} run seeds are needed, found {}.",
            args.seeds
        );
    }
    Ok(())
}

fn play_all(name: String, scenario: &TabularScenario, args: &BenchArgs) -> Result<Bench, CliError> {
    let pool = ThreadPoolBuilder::new()
        .num_threads(args.jobs.map_or(0, usize::from))
        .build();
    let seeds = args.first_seed..args.first_seed.saturating_add(args.seeds);
    let play_one = |seed| {
        let started = Instant::now();
        let scenario = TabularScenario {
            seed,
            ..scenario.clone()
        };
        let Ok(results) = play::<Infallible>(&name, &scenario, &ProgressBar::hidden(), |_| Ok(()));
        (results.summary, started.elapsed().as_secs_f64())
    };
    let pool = pool.map_err(|error| CliError::Runtime(error.to_string()))?;
    let played: Vec<(Summary, f64)> =
        pool.install(|| seeds.into_par_iter().map(play_one).collect());
    let (summaries, seconds): (Vec<Summary>, Vec<f64>) = played.into_iter().unzip();
    Ok(Bench {
        name,
        task: scenario.task.clone(),
        agents: scenario.agents.count.get(),
        summaries,
        seconds: seconds.iter().sum(),
    })
}

fn regret_cells(bench: &Bench) -> [String; 7] {
    let regrets = bench.regrets();
    let regret = bootstrap_sample(&regrets, mean);
    let steps: u64 = bench
        .summaries
        .iter()
        .map(|summary| summary.env_steps)
        .sum();
    let best: Vec<f64> = bench
        .summaries
        .iter()
        .map(|summary| summary.episodes_without_regret)
        .collect();
    [
        bench.agents.to_string(),
        shown(regret.value),
        format_interval(regret.interval, shown),
        shown(regrets.iter().copied().fold(f64::INFINITY, f64::min)),
        shown(regrets.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
        format!("{:.0} %", 100.0 * mean(&best)),
        format!("{:.0}", steps as f64 / bench.seconds),
    ]
}

const PAIRED: Columns<3> = [("difference", 10), ("95 % interval", 20), ("p (Holm)", 12)];

/// Compares every other scenario on the same task with the first, paired by run seed: equal run
/// seeds draw equal tasks.
fn compare(table: &Table, benches: &[Bench]) {
    let Some((first, others)) = benches.split_first() else {
        return;
    };
    let others: Vec<&Bench> = others
        .iter()
        .filter(|other| other.task == first.task)
        .collect();
    if others.is_empty() {
        return;
    }
    say!(
        "\nCompared with {}, paired by run seed: mean difference in regret (below 0: better), and p value of",
        first.name
    );
    say!("Wilcoxon's signed-rank test, corrected by Holm's method.\n");
    table.header(&PAIRED);
    let against: Vec<Vec<f64>> = others
        .iter()
        .map(|other| differences(&other.regrets(), &first.regrets()))
        .collect();
    let p = holm_correction(
        &against
            .iter()
            .map(|differences| signed_rank_test(differences).p)
            .collect::<Vec<f64>>(),
    );
    for ((other, differences), p) in others.iter().zip(&against).zip(p) {
        let difference = bootstrap_sample(differences, mean);
        let p = if p < 0.0001 {
            "< 0.0001".to_owned()
        } else {
            format!("{p:.4}")
        };
        table.row(
            &PAIRED,
            &other.name,
            &[
                shown(difference.value),
                format_interval(difference.interval, shown),
                p,
            ],
        );
    }
}

/// Three decimals for values below 10, otherwise one.
fn shown(value: f64) -> String {
    if value.abs() < 10.0 {
        format!("{value:.3}")
    } else {
        format!("{value:.1}")
    }
}
