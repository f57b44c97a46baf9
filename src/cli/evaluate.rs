//! `seedbed evaluate`.

use super::{ActionsArg, EvaluateArgs, Failure, PlayArgs};
use crate::agent::policy::ActionSelection;
use crate::input::numbers::Positive;
use crate::run::evaluate::{self, Evaluation};

pub(super) fn evaluate(args: &EvaluateArgs) -> Result<(), Failure> {
    let evaluation = evaluation(args.episodes, &args.play)?;
    let (plan, episodes) = evaluate::evaluate(&evaluate::run_folder(&args.run), &evaluation)?;
    let (task, count) = (&plan.description.spec.name, args.episodes);
    say!(
        "{task}, {count} episode{} of each agent, {}:\n",
        if count == 1 { "" } else { "s" },
        words(evaluation.actions)
    );
    let rows: Vec<_> = episodes
        .iter()
        .map(|episode| (episode.agent, episode.total_reward(), episode.length()))
        .collect();
    print_table(&rows);
    Ok(())
}

/// A row for each agent and for the team.   `episodes`: agent, return and length, in agent order
pub(super) fn print_table(episodes: &[(u32, f64, usize)]) {
    say!("| agent | mean return | deviation | least | most | mean length |");
    say!("|---|---|---|---|---|---|");
    let mut agents = 0;
    for own in episodes.chunk_by(|one, next| one.0 == next.0) {
        say!("| {} {}", own[0].0, row(own));
        agents += 1;
    }
    if agents > 1 {
        say!("| team {}", row(episodes));
    }
}

/// So many episodes of each agent, played as `args` says.
pub(super) fn evaluation(episodes: u32, args: &PlayArgs) -> Result<Evaluation, Failure> {
    Ok(Evaluation {
        episodes,
        actions: actions(args.actions, args.temperature)?,
        seed: args.seed,
    })
}

fn actions(
    actions: Option<ActionsArg>,
    temperature: Option<f64>,
) -> Result<Option<ActionSelection>, Failure> {
    let tempered = |temperature: f64| {
        let temperature = Positive::try_from(temperature)
            .map_err(|message| Failure::Input(format!("--temperature: {message}")))?;
        Ok(ActionSelection::Tempered { temperature })
    };
    match (actions, temperature) {
        (_, Some(value)) => tempered(value).map(Some),
        (Some(ActionsArg::Greedy), None) => Ok(Some(ActionSelection::Greedy)),
        (Some(ActionsArg::Sampled), None) => Ok(Some(ActionSelection::Sampled)),
        (None, None) => Ok(None),
    }
}

pub(super) fn words(actions: Option<ActionSelection>) -> String {
    match actions {
        None => "actions chosen as in training".to_owned(),
        Some(ActionSelection::Sampled) => "sampled actions".to_owned(),
        Some(ActionSelection::Greedy) => "greedy actions".to_owned(),
        Some(ActionSelection::Tempered { temperature }) => {
            format!("actions at temperature {}", temperature.get())
        }
    }
}

fn row(episodes: &[(u32, f64, usize)]) -> String {
    let returns: Vec<f64> = episodes.iter().map(|episode| episode.1).collect();
    let count = returns.len() as f64;
    let mean = returns.iter().sum::<f64>() / count;
    let deviation = (returns
        .iter()
        .map(|value| (value - mean).powi(2))
        .sum::<f64>()
        / count)
        .sqrt();
    let (least, most) = returns
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| {
            (low.min(x), high.max(x))
        });
    let length = episodes.iter().map(|episode| episode.2 as f64).sum::<f64>() / count;
    format!("| {mean:.2} | {deviation:.2} | {least:.2} | {most:.2} | {length:.1} |")
}
