//! Why training cannot continue: numbers that are not finite, and environments that fail.

use std::fmt::{self, Display, Formatter};
use std::path::Path;

use seedbed_env::TaskSpec;
use seedbed_env::file::find_field;
use seedbed_env::gymnasium::EnvironmentFailure;
use seedbed_learn::experience::Episode;

/// Training cannot continue.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RoundFailure {
    /// An observation or a reward is not finite.
    #[error(
        "non-finite {what} (agent {agent}, episode {episode}, step {step}): {value}, after the \
         observation {observation}; {place}"
    )]
    Simulation {
        /// The agent.
        agent: u32,
        /// Number of the agent's episode, from 0.
        episode: u32,
        /// Number of the step that leads to it, from 0; that of an episode's first observation is 0,
        /// too.
        step: usize,
        /// The name of the observation, or `reward`.
        what: NonFinite,
        /// The number.
        value: String,
        /// The observation before: each name with its value.
        observation: String,
        /// Where its formula is, or what to check.
        place: String,
    },
    /// An environment that runs in another process cannot go on.
    #[error(transparent)]
    Environment(#[from] EnvironmentFailure),
    /// A parameter of a network is not finite.
    #[error(
        "non-finite network parameters (agent {agent}, round {round}): the algorithm's step sizes \
         or the deviation of `agents.seeds` are too large"
    )]
    Learning {
        /// The agent that learned.
        agent: u32,
        /// Number of the round, from 0.
        round: u32,
    },
}

/// What is not finite.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NonFinite {
    /// The observation of this name.
    Observation(String),
    /// The reward.
    Reward,
}

impl Display for NonFinite {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Observation(name) => write!(formatter, "observation `{name}`"),
            Self::Reward => formatter.write_str("reward"),
        }
    }
}

impl RoundFailure {
    /// The error with the place of the formula in `text`, the text of the task's file at `path`.
    #[must_use]
    pub fn located_in(mut self, path: &Path, text: &str) -> Self {
        if let Self::Simulation { what, place, .. } = &mut self {
            let (field, entry) = match what {
                NonFinite::Observation(name) => ("observations", Some(name.as_str())),
                NonFinite::Reward => ("reward", None),
            };
            if let Some(found) = find_field(text, field, entry) {
                let path = path.display();
                let (line, column) = (found.line, found.column);
                *place = format!("check `{field}` in {path}:{line}:{column}: {}", found.value);
            }
        }
        self
    }
}

/// Checks that all numbers of an episode are finite.
pub(super) fn check_episode(spec: &TaskSpec, episode: &Episode) -> Result<(), RoundFailure> {
    let width = spec.observation_width();
    let observations = &episode.observations;
    let reward = episode.rewards.iter().position(|x| !x.is_finite());
    let observation = observations.iter().position(|x| !x.is_finite());
    // The first step with such a number. An observation that is not finite may be the reason why the
    // reward of its step is not.
    let row = observation.map(|index| index / width);
    let (step, what, value) = match (row, reward) {
        (Some(row), reward) if reward.is_none_or(|step| row <= step + 1) => {
            let index = observation.unwrap_or_default();
            let name = spec.observations[index % width].name.clone();
            let step = row.saturating_sub(1);
            (step, NonFinite::Observation(name), observations[index])
        }
        (_, Some(step)) => (step, NonFinite::Reward, episode.rewards[step]),
        (_, None) => return Ok(()),
    };
    let names = spec.observations.iter().map(|quantity| &quantity.name);
    let before = observations[step * width..][..width].iter();
    let before = names.zip(before).map(|(name, x)| format!("{name} = {x}"));
    Err(RoundFailure::Simulation {
        agent: episode.agent,
        episode: episode.episode,
        step,
        what,
        value: value.to_string(),
        observation: before.collect::<Vec<_>>().join(", "),
        place: "check what computes it in the task".to_owned(),
    })
}
