//! `seedbed bench`: when several seeds of a scenario solved their task, and how fast they ran.

use std::time::Instant;

use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

use super::{BenchArgs, Failure, counted};
use crate::input::InputError;
use crate::run::trainer::Trainer;
use crate::run::{Plan, RunError};

/// What one run came to.
struct Outcome {
    episodes: Option<usize>,
    env_steps: u64,
    seconds: f64,
}

pub(super) fn bench(args: &BenchArgs) -> Result<(), Failure> {
    let plans: Result<Vec<Plan>, InputError> = args.scenarios.iter().map(|path| Plan::load(path, &args.overrides)).collect();
    let pool = ThreadPoolBuilder::new().num_threads(args.jobs.map_or(0, usize::from)).build();
    let pool = pool.map_err(|error| Failure::Work(error.to_string()))?;
    let plans = plans?;
    say!("Episodes per agent until solved, of {} from {} on:\n", counted(args.seeds as usize, "seed"), args.first_seed);
    say!("| scenario | K | solved | median | least | most | median env steps of the team | env steps/s of one thread |");
    say!("|---|---|---|---|---|---|---|---|");
    for plan in plans {
        let seeds = args.first_seed..args.first_seed.saturating_add(args.seeds);
        let outcomes: Result<Vec<Outcome>, RunError> =
            pool.install(|| seeds.into_par_iter().map(|seed| outcome(&plan, seed)).collect());
        say!("{}", row(&plan, &outcomes?));
    }
    Ok(())
}

/// Trains once, on one thread and without a recording, until the task is solved or the scenario ends.
fn outcome(plan: &Plan, seed: u64) -> Result<Outcome, RunError> {
    let mut plan = plan.clone();
    plan.scenario.seed = seed;
    let mut trainer = Trainer::new(&plan.scenario, &plan.description, 1)?;
    let started = Instant::now();
    while !trainer.is_done() && !trainer.is_solved() {
        trainer.advance()?;
    }
    let seconds = started.elapsed().as_secs_f64();
    let episodes = trainer.is_solved().then(|| trainer.measures().episodes_per_agent());
    Ok(Outcome { episodes, env_steps: trainer.measures().env_steps(), seconds })
}

/// Seeds that did not solve the task count as slower than all that did, so the medians stay honest.
fn row(plan: &Plan, outcomes: &[Outcome]) -> String {
    let solved = outcomes.iter().filter(|outcome| outcome.episodes.is_some()).count();
    let episodes = sorted(outcomes.iter().map(|outcome| outcome.episodes.map(|episodes| episodes as u64)));
    let env_steps = sorted(outcomes.iter().map(|outcome| outcome.episodes.map(|_| outcome.env_steps)));
    let at_most = format!("> {}", plan.scenario.most_episodes());
    let shown = |episodes: Option<u64>| episodes.map_or(at_most.clone(), |episodes| episodes.to_string());
    let (steps, seconds) = outcomes.iter().fold((0, 0.0), |(steps, seconds), o| (steps + o.env_steps, seconds + o.seconds));
    format!(
        "| {} | {} | {solved}/{} | {} | {} | {} | {} | {:.0} |",
        plan.name,
        plan.scenario.agents.count.get(),
        outcomes.len(),
        median(&episodes).map_or(at_most.clone(), |median| format!("{median:.1}")),
        shown(episodes[0]),
        shown(episodes[episodes.len() - 1]),
        median(&env_steps).map_or("unknown".to_owned(), |median| format!("{median:.0}")),
        steps as f64 / seconds
    )
}

/// From small to large, those that never came last.
fn sorted(values: impl Iterator<Item = Option<u64>>) -> Vec<Option<u64>> {
    let mut values: Vec<Option<u64>> = values.collect();
    values.sort_unstable_by_key(|value| value.unwrap_or(u64::MAX));
    values
}

/// The middle of sorted values, if it is known.
fn median(values: &[Option<u64>]) -> Option<f64> {
    let (low, high) = (values[(values.len() - 1) / 2], values[values.len() / 2]);
    Some((low? + high?) as f64 / 2.0)
}
