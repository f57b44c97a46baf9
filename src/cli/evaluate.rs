//! `seedbed evaluate`.

use super::{ActionsArg, CliError, EvaluateArgs, PlayArgs};
use crate::run::evaluate::{self, Evaluation};
use seedbed_env::input::numbers::Positive;
use seedbed_learn::agent::policy::ActionSelection;

pub(super) fn evaluate(args: &EvaluateArgs) -> Result<(), CliError> {
    let evaluation = evaluation(args.episodes, &args.play)?;
    let (plan, episodes) = evaluate::evaluate(&evaluate::run_folder(&args.run), &evaluation)?;
    let (task, count) = (&plan.description.spec().name, args.episodes);
    say!(
        "{task}: {count} episode{} per agent, {}\n",
        if count == 1 { "" } else { "s" },
        describe_actions(evaluation.actions)
    );
    let rows: Vec<_> = episodes
        .iter()
        .map(|episode| (episode.agent, episode.total_reward(), episode.length()))
        .collect();
    print_table(&rows);
    Ok(())
}

/// Prints one row per agent and one for the team. `episodes` has agent, return and length of each
/// episode, in agent order.
pub(super) fn print_table(episodes: &[(u32, f64, usize)]) {
    say!("| agent | mean return | std. dev. | min | max | mean length |");
    say!("|---|---|---|---|---|---|");
    let mut agents = 0;
    for own in episodes.chunk_by(|one, next| one.0 == next.0) {
        say!("| {} {}", own[0].0, statistics_cells(own));
        agents += 1;
    }
    if agents > 1 {
        say!("| team {}", statistics_cells(episodes));
    }
}

/// Settings of an evaluation of `episodes` episodes per agent.
pub(super) fn evaluation(episodes: u32, args: &PlayArgs) -> Result<Evaluation, CliError> {
    Ok(Evaluation {
        episodes,
        actions: actions(args.actions, args.temperature)?,
        seed: args.seed,
    })
}

fn actions(
    actions: Option<ActionsArg>,
    temperature: Option<f64>,
) -> Result<Option<ActionSelection>, CliError> {
    let tempered = |temperature: f64| {
        let temperature = Positive::try_from(temperature)
            .map_err(|message| CliError::Usage(format!("--temperature: {message}")))?;
        Ok(ActionSelection::Tempered { temperature })
    };
    match (actions, temperature) {
        (_, Some(value)) => tempered(value).map(Some),
        (Some(ActionsArg::Greedy), None) => Ok(Some(ActionSelection::Greedy)),
        (Some(ActionsArg::Sampled), None) => Ok(Some(ActionSelection::Sampled)),
        (None, None) => Ok(None),
    }
}

pub(super) fn describe_actions(actions: Option<ActionSelection>) -> String {
    match actions {
        None => "actions chosen as in training".to_owned(),
        Some(ActionSelection::Sampled) => "sampled actions".to_owned(),
        Some(ActionSelection::Greedy) => "greedy actions".to_owned(),
        Some(ActionSelection::Tempered { temperature }) => {
            format!("actions at temperature {}", temperature.get())
        }
    }
}

fn statistics_cells(episodes: &[(u32, f64, usize)]) -> String {
    let returns: Vec<f64> = episodes.iter().map(|episode| episode.1).collect();
    let count = returns.len() as f64;
    let mean = returns.iter().sum::<f64>() / count;
    let deviation = (returns
        .iter()
        .map(|value| (value - mean).powi(2))
        .sum::<f64>()
        / count)
        .sqrt();
    let (min, max) = returns
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| {
            (low.min(x), high.max(x))
        });
    let length = episodes.iter().map(|episode| episode.2 as f64).sum::<f64>() / count;
    format!("| {mean:.2} | {deviation:.2} | {min:.2} | {max:.2} | {length:.1} |")
}
