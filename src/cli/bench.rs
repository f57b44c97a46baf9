//! `seedbed bench`: when several seeds of a scenario solved their task, and how fast they ran.

use std::time::Instant;

use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

use super::{BenchArgs, Failure};
use crate::input::InputError;
use crate::run::trainer::Trainer;
use crate::run::{Plan, RunError};

/// What one run came to.
struct Outcome {
    /// Of each agent, and steps of the team, until the task was solved.
    solved: Option<(usize, u64)>,
    /// Of each agent: its first episode that reached the return by itself, counted from 1.
    reached: Vec<Option<u64>>,
    env_steps: u64,
    team_coverage: f64,
    seconds: f64,
}

pub(super) fn bench(args: &BenchArgs) -> Result<(), Failure> {
    let plans: Result<Vec<Plan>, InputError> = args.scenarios.iter().map(|path| Plan::load(path, &args.overrides)).collect();
    let pool = ThreadPoolBuilder::new().num_threads(args.jobs.map_or(0, usize::from)).build();
    let pool = pool.map_err(|error| Failure::Work(error.to_string()))?;
    let plans = plans?;
    say!(
        "Episodes of each agent until the team solved its task, of {} seeds from {} on; how many agents",
        args.seeds,
        args.first_seed
    );
    say!("reached the return by themselves, and in which episode; the team's coverage; env steps/s of one thread.\n");
    say!("| scenario | K | solved | median | least | most | env steps | reached | in episode | coverage | steps/s |");
    say!("|---|---|---|---|---|---|---|---|---|---|---|");
    for plan in plans {
        let seeds = args.first_seed..args.first_seed.saturating_add(args.seeds);
        let outcomes: Result<Vec<Outcome>, RunError> =
            pool.install(|| seeds.into_par_iter().map(|seed| outcome(&plan, seed, args.whole)).collect());
        say!("{}", row(&plan, &outcomes?));
    }
    Ok(())
}

/// Trains once, on one thread and without a recording, until the task is solved or, where `whole`, until the scenario ends.
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
            solved = Some((trainer.measures().episodes_per_agent(), trainer.measures().env_steps()));
        }
    }
    let seconds = started.elapsed().as_secs_f64();
    let (env_steps, team_coverage) = (trainer.measures().env_steps(), trainer.measures().team_coverage());
    Ok(Outcome { solved, reached, env_steps, team_coverage, seconds })
}

/// Seeds that did not solve the task, and agents that did not reach the return, count as slower than all others, so the medians stay
/// honest.
fn row(plan: &Plan, outcomes: &[Outcome]) -> String {
    let solved = outcomes.iter().filter(|outcome| outcome.solved.is_some()).count();
    let episodes = sorted(outcomes.iter().map(|outcome| outcome.solved.map(|(episodes, _)| episodes as u64)));
    let env_steps = sorted(outcomes.iter().map(|outcome| outcome.solved.map(|(_, env_steps)| env_steps)));
    let reached = sorted(outcomes.iter().flat_map(|outcome| outcome.reached.iter().copied()));
    let at_most = format!("> {}", plan.scenario.most_episodes());
    let shown = |episodes: Option<u64>| episodes.map_or(at_most.clone(), |episodes| episodes.to_string());
    let middle = |episodes: &[Option<u64>]| median(episodes).map_or(at_most.clone(), |median| format!("{median:.1}"));
    let (steps, seconds) = outcomes.iter().fold((0, 0.0), |(steps, seconds), o| (steps + o.env_steps, seconds + o.seconds));
    let coverage = outcomes.iter().map(|outcome| outcome.team_coverage).sum::<f64>() / outcomes.len() as f64;
    format!(
        "| {} | {} | {solved}/{} | {} | {} | {} | {} | {}/{} | {} | {:.0} % | {:.0} |",
        plan.name,
        plan.scenario.agents.count.get(),
        outcomes.len(),
        middle(&episodes),
        shown(episodes[0]),
        shown(episodes[episodes.len() - 1]),
        median(&env_steps).map_or("unknown".to_owned(), |median| format!("{median:.0}")),
        reached.iter().flatten().count(),
        reached.len(),
        middle(&reached),
        100.0 * coverage,
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
