//! `seedbed evaluate`.

use super::{ActionsArg, EvaluateArgs, Failure};
use crate::agent::policy::ActionSelection;
use crate::experience::Episode;
use crate::input::numbers::Positive;
use crate::run::evaluate::{self, Evaluation};

pub(super) fn evaluate(args: &EvaluateArgs) -> Result<(), Failure> {
    let evaluation = Evaluation { episodes: args.episodes, actions: actions(args)?, seed: args.seed };
    let (plan, episodes) = evaluate::evaluate(&evaluate::run_folder(&args.run), &evaluation)?;
    let (task, count) = (&plan.description.spec.name, args.episodes);
    say!("{task}, {count} episode{} of each agent, {}:\n", if count == 1 { "" } else { "s" }, words(evaluation.actions));
    say!("| agent | mean return | deviation | least | most | mean length |");
    say!("|---|---|---|---|---|---|");
    for own in episodes.chunk_by(|one, next| one.agent == next.agent) {
        say!("| {} {}", own[0].agent, row(own));
    }
    if plan.scenario.agents.count.get() > 1 {
        say!("| team {}", row(&episodes));
    }
    Ok(())
}

fn actions(args: &EvaluateArgs) -> Result<Option<ActionSelection>, Failure> {
    let temperature = |temperature: f64| {
        let temperature =
            Positive::try_from(temperature).map_err(|message| Failure::Input(format!("--temperature: {message}")))?;
        Ok(ActionSelection::Tempered { temperature })
    };
    match (args.actions, args.temperature) {
        (_, Some(value)) => temperature(value).map(Some),
        (Some(ActionsArg::Greedy), None) => Ok(Some(ActionSelection::Greedy)),
        (Some(ActionsArg::Sampled), None) => Ok(Some(ActionSelection::Sampled)),
        (None, None) => Ok(None),
    }
}

fn words(actions: Option<ActionSelection>) -> String {
    match actions {
        None => "actions chosen as in training".to_owned(),
        Some(ActionSelection::Sampled) => "sampled actions".to_owned(),
        Some(ActionSelection::Greedy) => "greedy actions".to_owned(),
        Some(ActionSelection::Tempered { temperature }) => format!("actions at temperature {}", temperature.get()),
    }
}

fn row(episodes: &[Episode]) -> String {
    let returns: Vec<f64> = episodes.iter().map(Episode::total_reward).collect();
    let count = returns.len() as f64;
    let mean = returns.iter().sum::<f64>() / count;
    let deviation = (returns.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt();
    let (least, most) = returns.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)));
    let length = episodes.iter().map(|episode| episode.length() as f64).sum::<f64>() / count;
    format!("| {mean:.2} | {deviation:.2} | {least:.2} | {most:.2} | {length:.1} |")
}
