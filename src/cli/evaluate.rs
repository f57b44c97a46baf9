//! `seedbed evaluate`.

use super::{ActionsArg, CliError, EvaluateArgs, PlayArgs, warn_if_unverified};
use seedbed::run::evaluate::{self, EvaluationSettings};
use seedbed::run::folder::run_folder;
use seedbed_input::numbers::Positive;
use seedbed_learn::agent::action_selection::ActionSelection;

pub(super) fn evaluate(args: &EvaluateArgs) -> Result<(), CliError> {
    let settings = evaluation_settings(args.episodes, &args.play)?;
    let folder = run_folder(&args.run);
    warn_if_unverified(&folder)?;
    let (plan, episodes) = evaluate::evaluate(&folder, &settings)?;
    let (task, count) = (&plan.description.spec().name, args.episodes);
    say!(
        "{task}: {count} episode{} per agent, {}\n",
        if count == 1 { "" } else { "s" },
        describe_actions(settings.action_selection)
    );
    let episode_results: Vec<EpisodeResult> = episodes
        .iter()
        .map(|episode| EpisodeResult {
            agent: episode.agent,
            r#return: episode.total_reward(),
            length: episode.length(),
        })
        .collect();
    print_table(&episode_results);
    Ok(())
}

/// What the table of returns needs to know about an episode.
pub(super) struct EpisodeResult {
    pub(super) agent: u32,
    pub(super) r#return: f64,
    /// Number of environment steps.
    pub(super) length: usize,
}

/// Prints one row of return statistics per agent, and one row for a team of several agents.
/// `episodes` are in agent order.
pub(super) fn print_table(episodes: &[EpisodeResult]) {
    say!("| agent | mean return | std. dev. | min | max | mean length |");
    say!("|---|---|---|---|---|---|");
    let mut agents = 0;
    for of_agent in episodes.chunk_by(|one, next| one.agent == next.agent) {
        say!("| {} {}", of_agent[0].agent, statistics_cells(of_agent));
        agents += 1;
    }
    if agents > 1 {
        say!("| team {}", statistics_cells(episodes));
    }
}

/// Settings of an evaluation of `episodes` episodes per agent.
pub(super) fn evaluation_settings(
    episodes: u32,
    args: &PlayArgs,
) -> Result<EvaluationSettings<'_>, CliError> {
    Ok(EvaluationSettings {
        episodes,
        action_selection: action_selection(args.actions, args.temperature)?,
        environment: args.environment.as_deref(),
        seed: args.seed,
    })
}

/// How actions are chosen; `None`: as in training.
fn action_selection(
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
        Some(ActionSelection::Correlated { .. }) => "actions with correlated noise".to_owned(),
        Some(ActionSelection::Greedy) => "greedy actions".to_owned(),
        Some(ActionSelection::Tempered { temperature }) => {
            format!("actions at temperature {}", temperature.get())
        }
    }
}

fn statistics_cells(episodes: &[EpisodeResult]) -> String {
    let returns: Vec<f64> = episodes.iter().map(|episode| episode.r#return).collect();
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
    let mean_length = episodes
        .iter()
        .map(|episode| episode.length as f64)
        .sum::<f64>()
        / count;
    format!("| {mean:.2} | {deviation:.2} | {min:.2} | {max:.2} | {mean_length:.1} |")
}
