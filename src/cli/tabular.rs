//! Tabular scenarios on the command line: `run`, `bench`, `check` and `list` come here with them.

use std::convert::Infallible;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

use super::bench::{Columns, Table, interval_in_words};
use super::run::make_room;
use super::{BenchArgs, Failure, RunArgs, counted};
use crate::env::tabular::Task;
use crate::input::InputError;
use crate::run::RunError;
use crate::run::folder::RunFolder;
use crate::study::statistics::aggregate::mean;
use crate::study::statistics::comparison::holm;
use crate::study::statistics::paired::{differences, signed_rank};
use crate::study::statistics::{LEAST_RUNS, estimate_of_sample};
use crate::tabular::TabularScenario;
use crate::tabular::recording::{Film, MOST_AGENTS};
use crate::tabular::results::{Results, Summary};
use crate::tabular::scenario::{self, is_meant};
use crate::tabular::team::{Step, Team};

/// Such as `100 agents in BipolarChain, SeedSampling`.
pub(super) fn described(path: &Path) -> Result<String, InputError> {
    let scenario = scenario::load(path, &[])?.value;
    let agents = counted(scenario.agents.count.get() as usize, "agent");
    Ok(format!(
        "{agents} in {}, {}",
        scenario.task.name(),
        scenario.algorithm.name()
    ))
}

pub(super) fn run(args: &RunArgs, overrides: &[String]) -> Result<(), Failure> {
    let scenario = scenario::load(&args.scenario, overrides)?.value;
    if args.serve.is_some() {
        let shown = args.scenario.display();
        return Err(Failure::Input(format!(
            "{shown} is of a finite task, whose recording is not served; leave out --serve"
        )));
    }
    let name = stem(&args.scenario);
    let folder = RunFolder::new(
        args.out
            .clone()
            .unwrap_or_else(|| default_folder(&name, scenario.seed)),
    );
    let claim = make_room(args, &folder)?;
    let started = Instant::now();
    let path = folder.recording();
    let mut film = Film::of(
        &name,
        &scenario,
        (!args.no_recording).then_some(path.as_path()),
    )
    .map_err(RunError::from)?;
    let results = play(&name, &scenario, &bar(&scenario, args.quiet), |step| {
        film.take_in(step)
    })
    .map_err(RunError::from)?;
    film.finish().map_err(RunError::from)?;
    let fault = |error: std::io::Error| {
        Failure::Work(format!(
            "cannot write to {}: {error}",
            folder.path().display()
        ))
    };
    results.write(&scenario, &folder).map_err(fault)?;
    claim.release().map_err(fault)?;
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
            "recording  {}; look at it with\n             rerun {}",
            path.display(),
            path.display()
        );
    } else if !args.no_recording {
        say!("recording  none, for the team has more than {MOST_AGENTS} agents");
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

/// Plays a scenario to its end; `bar` counts episodes, `watch` sees every step.
fn play<E>(
    name: &str,
    scenario: &TabularScenario,
    bar: &ProgressBar,
    mut watch: impl FnMut(&Step) -> Result<(), E>,
) -> Result<Results, E> {
    let mut team = Team::new(scenario);
    let mut episodes = Vec::new();
    while let Some(step) = team.advance() {
        watch(&step)?;
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
        counted(*episodes_per_agent as usize, "episode"),
        counted(*agents as usize, "agent"),
    );
    say!("finished   {episodes} of {team}, {env_steps} env steps in {seconds:.1} s");
    say!("optimal    {optimal_value:.3} an episode");
    say!("regret     {regret_per_agent:.3} per agent, {cumulative_regret:.1} in all");
    let share = 100.0 * summary.episodes_without_regret;
    say!("best       {share:.1} % of episodes were without regret");
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

/// What the runs of one scenario came to, in the order of their seeds.
struct Bench {
    name: String,
    task: Task,
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
    ("K", 6),
    ("regret", 8),
    ("95 % interval", 18),
    ("least", 8),
    ("most", 8),
    ("no regret", 9),
    ("steps/s", 9),
];

pub(super) fn bench(args: &BenchArgs) -> Result<(), Failure> {
    let other = args.scenarios.iter().find(|path| !is_meant(path));
    if let Some(other) = other {
        return Err(Failure::Input(format!(
            "{} is no tabular scenario; these are only compared with each other",
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
    let seeds = counted(args.seeds as usize, "seed");
    say!(
        "Regret per agent, of {seeds} from {} on: mean with its 95 % interval, least and most; episodes without",
        args.first_seed
    );
    say!("regret; actions a second of one thread. Each seed draws a task of its own.\n");
    table.head(&REGRET);
    let mut benches = Vec::new();
    for (name, scenario) in scenarios {
        let bench = play_all(name, &scenario, args)?;
        table.row(&REGRET, &bench.name, &cells(&bench));
        benches.push(bench);
    }
    compare(&table, &benches);
    if (args.seeds as usize) < LEAST_RUNS {
        say!(
            "\nn = {} is too few for an interval, which takes at least {LEAST_RUNS} seeds.",
            args.seeds
        );
    }
    Ok(())
}

fn play_all(name: String, scenario: &TabularScenario, args: &BenchArgs) -> Result<Bench, Failure> {
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
    let pool = pool.map_err(|error| Failure::Work(error.to_string()))?;
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

fn cells(bench: &Bench) -> [String; 7] {
    let regrets = bench.regrets();
    let regret = estimate_of_sample(&regrets, mean);
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
        interval_in_words(regret.interval, shown),
        shown(regrets.iter().copied().fold(f64::INFINITY, f64::min)),
        shown(regrets.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
        format!("{:.0} %", 100.0 * mean(&best)),
        format!("{:.0}", steps as f64 / bench.seconds),
    ]
}

const PAIRED: Columns<3> = [
    ("difference", 10),
    ("95 % interval", 20),
    ("p after Holm", 12),
];

/// Each of the others against the first, if it is about the same tasks, seed by seed: equal seeds draw equal tasks.
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
        "\nAgainst {}, seed by seed: the mean difference in regret (below 0 is better), and p of Wilcoxon's",
        first.name
    );
    say!("signed-rank test.\n");
    table.head(&PAIRED);
    let against: Vec<Vec<f64>> = others
        .iter()
        .map(|other| differences(&other.regrets(), &first.regrets()))
        .collect();
    let p = holm(
        &against
            .iter()
            .map(|differences| signed_rank(differences).p)
            .collect::<Vec<f64>>(),
    );
    for ((other, differences), p) in others.iter().zip(&against).zip(p) {
        let difference = estimate_of_sample(differences, mean);
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
                interval_in_words(difference.interval, shown),
                p,
            ],
        );
    }
}

/// Three digits behind the point for what is small.
fn shown(value: f64) -> String {
    if value.abs() < 10.0 {
        format!("{value:.3}")
    } else {
        format!("{value:.1}")
    }
}
