//! Measures of runs: which there are, what they need, and their names.

mod value;

use std::fmt;
use std::ops::Not;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub use crate::plotting::trailing_means;
pub use crate::run::facts::metrics::Curve;
use crate::run::facts::metrics::{Range, RunKind};
use seedbed_input::numbers::{Count, ranged_count};
use seedbed_input::{FORMER_NAMES, InputError, settings_of};

/// A number of environment steps of a team.
pub type EnvSteps = Count<4_000_000_000>;

/// A measure: one number per run of a whole team.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, remote = "Self")]
pub enum Measure {
    /// Number of episodes per agent until the team solves its task. Runs that do not solve it are
    /// censored.
    EpisodesToSolve,
    /// Number of steps of the team until it solves its task. Runs that do not solve it are
    /// censored.
    EnvStepsToSolve,
    /// 1 if the team solved its task, otherwise 0.
    Solved,
    /// Share of agents that reached the goal in at least one of their own episodes: the reward
    /// threshold of the task or, in tabular tasks, a regret of 0.
    Reach,
    /// First episode in which an agent reached the goal (see `Reach`), median over agents.
    FirstGoal,
    /// 1 if any agent of the team reached the goal (see `Reach`), otherwise 0.
    Found,
    /// First episode in which any agent of the team reached the goal. Runs that do not find it are censored.
    EpisodesToFind,
    /// Number of steps of the team at the end of this episode. Runs that do not find the goal are censored.
    EnvStepsToFind,
    /// Number of episodes from the first in which any agent reached the goal to the one in which half of the agents had
    /// reached it; 1 if it is the same. Unknown of runs that do not find the goal.
    EpisodesToSpread,
    /// In tabular tasks, regret summed over the episodes of an agent, mean over agents. The regret
    /// of an episode is the expected return of the optimal policy minus the expected return of the
    /// agent's actions.
    Regret,
    /// Mean return of the team over the last episodes. Agents of runs of others may have finished
    /// different numbers of episodes: each counts with its own last episodes. In runs of seedbed,
    /// episodes count that every agent has finished.
    FinalReturn {
        /// Number of episodes of each agent.
        #[serde(default = "default_window")]
        window: Count,
        /// Episodes that end later do not count: environment steps of the team. Unknown of runs that ended
        /// before, unless it is held.
        #[serde(default, with = "given", skip_serializing_if = "Option::is_none")]
        steps: Option<EnvSteps>,
        /// Whether runs that ended before keep the mean of their last episodes.
        #[serde(default, skip_serializing_if = "Not::not")]
        held: bool,
    },
    /// Mean return of the team over the episodes up to a given episode. Unknown of runs that ended
    /// before, unless it is held.
    ReturnAt {
        /// Last of these episodes, counted from 1.
        episode: Count,
        /// Number of episodes of each agent.
        #[serde(default = "default_window")]
        window: Count,
        /// Whether runs that ended before keep the mean of their last episodes.
        #[serde(default, skip_serializing_if = "Not::not")]
        held: bool,
    },
    /// Difference between the agents of a team: standard deviation over agents of the moving
    /// averages of their returns, averaged over episodes.
    SpreadOfAgents {
        /// Number of episodes of the moving average.
        #[serde(default = "default_window")]
        window: Count,
    },
    /// Return of better or worse agents of a team: percentile over agents of the moving averages of
    /// their returns, averaged over episodes.
    PercentileOfAgents {
        /// Percentile, interpolated linearly between agents: 50 is the median agent.
        percent: Count<99>,
        /// Number of episodes of the moving average.
        #[serde(default = "default_window")]
        window: Count,
    },
    /// In tabular tasks, 1 if the regret is above a number, otherwise 0: how often a run goes badly.
    RegretAbove {
        /// The number.
        regret: Count,
    },
    /// Share of the state space that the team has visited.
    Coverage,
    /// Mean of a curve.
    Mean {
        /// Curve.
        of: Curve,
    },
    /// Value of a curve after each agent has finished a given number of episodes, or after a given number of
    /// environment steps of the team. Unknown of runs that ended before, unless it is held.
    At {
        /// Curve.
        of: Curve,
        /// Number of episodes. Either this or `steps` is given.
        #[serde(default, with = "given", skip_serializing_if = "Option::is_none")]
        episode: Option<Count>,
        /// Number of environment steps of the team.
        #[serde(default, with = "given", skip_serializing_if = "Option::is_none")]
        steps: Option<EnvSteps>,
        /// Whether runs that ended before keep their last value.
        #[serde(default, skip_serializing_if = "Not::not")]
        held: bool,
    },
    /// Last value of a curve.
    Last {
        /// Curve.
        of: Curve,
    },
}

/// Optional fields that are written without `Some`, as in the names of columns.
mod given {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[expect(clippy::ref_option, reason = "Serde passes a reference")]
    pub(super) fn serialize<T: Serialize, S: Serializer>(
        value: &Option<T>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        match value {
            Some(value) => value.serialize(serializer),
            None => serializer.serialize_none(),
        }
    }

    pub(super) fn deserialize<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<T>, D::Error> {
        T::deserialize(deserializer).map(Some)
    }
}

/// The moment of a run at which something is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// Each agent has finished this number of episodes.
    Episode(u32),
    /// The team has made this number of environment steps.
    EnvSteps(u32),
}

impl fmt::Display for Moment {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Episode(episode) => write!(formatter, "episode {episode}"),
            Self::EnvSteps(steps) => write!(formatter, "environment step {steps} of the team"),
        }
    }
}

impl<'de> Deserialize<'de> for Measure {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let measure = Self::deserialize(deserializer)?;
        let Self::At { episode, steps, .. } = measure else {
            return Ok(measure);
        };
        match (episode, steps) {
            (None, None) => Err(D::Error::custom(
                "expected `episode` or `steps`, for example `At(of: Return, episode: 100)`",
            )),
            (Some(_), Some(_)) => Err(D::Error::custom(
                "expected either `episode` or `steps`, found both",
            )),
            _ => Ok(measure),
        }
    }
}

impl Serialize for Measure {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

/// The error of reading a measure, with help if it is the name of a curve.
#[must_use]
pub fn explain_curve(error: InputError) -> InputError {
    let name = error
        .unexpected_variant()
        .filter(|_| error.message.contains("`EpisodesToSolve`"));
    let Some(curve) = name.filter(|name| ron::from_str::<Curve>(name).is_ok()) else {
        return error;
    };
    let help = format!(
        "`{curve}` is a curve: write `Last(of: {curve})`, `Mean(of: {curve})` or `At(of: {curve}, episode: 100)`"
    );
    InputError {
        help: Some(help),
        ..error
    }
}

/// Requirement that a run must fulfill for a measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// No requirement.
    Nothing,
    /// A threshold at which the task counts as solved.
    Threshold,
    /// A goal for a single agent.
    Goal,
    /// A tabular task, whose optimal policy is known.
    Tables,
    /// Rounds in which agents learn.
    Rounds,
}

impl Measure {
    /// The mean return of the last episodes of a whole run.
    #[must_use]
    pub fn final_return(window: Count) -> Self {
        Self::FinalReturn {
            window,
            steps: None,
            held: false,
        }
    }

    /// The moment at which this measure is taken; `None` if it is of a whole run.
    #[must_use]
    pub fn moment(self) -> Option<Moment> {
        match self {
            Self::ReturnAt { episode, .. } => Some(Moment::Episode(episode.get())),
            Self::At { episode, steps, .. } => {
                let episode = episode.map(|episode| Moment::Episode(episode.get()));
                episode.or(steps.map(|steps| Moment::EnvSteps(steps.get())))
            }
            Self::FinalReturn { steps, .. } => steps.map(|steps| Moment::EnvSteps(steps.get())),
            _ => None,
        }
    }

    /// The moment at which this measure is unknown of runs that ended before.
    #[must_use]
    pub fn needed_moment(self) -> Option<Moment> {
        let (Self::FinalReturn { held, .. } | Self::ReturnAt { held, .. } | Self::At { held, .. }) =
            self
        else {
            return None;
        };
        self.moment().filter(|_| !held)
    }

    /// Whether this measure needs the environment steps at the end of each episode.
    #[must_use]
    pub fn counts_env_steps(self) -> bool {
        self.is_time_in_env_steps() || matches!(self.moment(), Some(Moment::EnvSteps(_)))
    }

    /// The measure as in the text of claims on which locks depend: its settings without defaults, such as
    /// `At(episode = 230, of = TeamCoverage)`.
    #[must_use]
    pub(crate) fn canonical_text(self) -> String {
        let text = ron::to_string(&self).expect("plain data always serializes");
        let settings = settings_of::<Self>(&text).text(&FORMER_NAMES);
        let mut values = settings.lines();
        // The path of the measure itself is empty.
        let name = values.next().unwrap_or_default().trim_start_matches(" = ");
        let fields: Vec<&str> = values.collect();
        if fields.is_empty() {
            return name.to_owned();
        }
        format!("{name}({})", fields.join(", "))
    }

    /// Whether this measure is a time, which a run may not reach.
    #[must_use]
    pub fn is_time(self) -> bool {
        matches!(
            self,
            Self::EpisodesToSolve
                | Self::EnvStepsToSolve
                | Self::FirstGoal
                | Self::EpisodesToFind
                | Self::EnvStepsToFind
                | Self::EpisodesToSpread
        )
    }

    /// Whether this measure is a time in environment steps of the team, not in episodes.
    #[must_use]
    pub fn is_time_in_env_steps(self) -> bool {
        matches!(self, Self::EnvStepsToSolve | Self::EnvStepsToFind)
    }

    /// Whether this measure is a time since an agent first found the goal, not since the run began.
    #[must_use]
    pub fn is_since_first_find(self) -> bool {
        matches!(self, Self::EpisodesToSpread)
    }

    /// Requirement that a run must fulfill for this measure.
    #[must_use]
    pub fn needs(self) -> Needs {
        match self {
            Self::EpisodesToSolve | Self::EnvStepsToSolve | Self::Solved => Needs::Threshold,
            Self::FirstGoal
            | Self::Reach
            | Self::Found
            | Self::EpisodesToFind
            | Self::EnvStepsToFind
            | Self::EpisodesToSpread => Needs::Goal,
            Self::Regret | Self::RegretAbove { .. } => Needs::Tables,
            Self::Mean { of } | Self::At { of, .. } | Self::Last { of } => needs_of_curve(of),
            Self::FinalReturn { .. }
            | Self::ReturnAt { .. }
            | Self::SpreadOfAgents { .. }
            | Self::PercentileOfAgents { .. }
            | Self::Coverage => Needs::Nothing,
        }
    }

    /// The curve whose values this measure needs; `None` if it needs no curve.
    #[must_use]
    pub fn curve(self) -> Option<Curve> {
        match self {
            Self::Mean { of } | Self::At { of, .. } | Self::Last { of } => Some(of),
            Self::Coverage => Some(Curve::TeamCoverage),
            _ => None,
        }
    }

    /// Whether this measure counts visits, on the axes of the observations.
    #[must_use]
    pub fn is_of_visits(self) -> bool {
        let curve = self.curve();
        curve.is_some_and(|curve| curve.metric().is_of_visits())
    }

    /// Whether this measure needs the returns of single episodes, or counts episodes.
    #[must_use]
    pub fn counts_episodes(self) -> bool {
        let is_at_a_step = matches!(self, Self::At { steps: Some(_), .. });
        !is_at_a_step
            && !matches!(
                self,
                Self::Solved | Self::EnvStepsToSolve | Self::Mean { .. } | Self::Last { .. }
            )
    }

    /// Whether this measure is 0 or 1 for each run.
    #[must_use]
    pub fn is_yes_or_no(self) -> bool {
        matches!(self, Self::Solved | Self::Found | Self::RegretAbove { .. })
    }

    /// Whether this measure is a share from 0 to 1, which can be compared between tasks.
    #[must_use]
    pub fn is_share(self) -> bool {
        match self {
            Self::Solved
            | Self::Found
            | Self::RegretAbove { .. }
            | Self::Reach
            | Self::Coverage => true,
            Self::Mean { of } | Self::At { of, .. } | Self::Last { of } => {
                of.metric().range == Range::Share
            }
            _ => false,
        }
    }

    /// The smallest and the largest possible value of a run of `agents` agents; of a time, if it was reached
    /// in a run that ended after `end` episodes or steps.
    #[must_use]
    pub fn possible_values(self, agents: u32, end: f64) -> [f64; 2] {
        const ANY: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
        match self {
            Self::EpisodesToSolve
            | Self::EnvStepsToSolve
            | Self::FirstGoal
            | Self::EpisodesToFind
            | Self::EnvStepsToFind
            | Self::EpisodesToSpread => [1.0, end],
            Self::Solved
            | Self::Found
            | Self::RegretAbove { .. }
            | Self::Reach
            | Self::Coverage => [0.0, 1.0],
            Self::Regret | Self::SpreadOfAgents { .. } => [0.0, f64::INFINITY],
            Self::FinalReturn { .. } | Self::ReturnAt { .. } | Self::PercentileOfAgents { .. } => {
                ANY
            }
            Self::Mean { of } | Self::At { of, .. } | Self::Last { of } => {
                match of.metric().range {
                    Range::Any => ANY,
                    Range::NotNegative => [0.0, f64::INFINITY],
                    Range::FromOne => [1.0, f64::INFINITY],
                    Range::Share => [0.0, 1.0],
                    Range::Correlation => [-1.0, 1.0],
                    Range::Agents => [1.0, f64::from(agents)],
                }
            }
        }
    }

    /// Whether smaller values are better.
    #[must_use]
    pub fn is_smaller_better(self) -> bool {
        self.is_time() || self.needs() == Needs::Tables
    }

    /// Name in reports, with its unit.
    #[must_use]
    pub fn title(self) -> String {
        match self {
            Self::EpisodesToSolve => "episodes until solved".to_owned(),
            Self::EnvStepsToSolve => "env steps until solved".to_owned(),
            Self::Solved => "share solved".to_owned(),
            Self::Reach => "share of agents that reached the goal".to_owned(),
            Self::FirstGoal => "episode of the first goal".to_owned(),
            Self::Found => "share of teams of which any agent reached the goal".to_owned(),
            Self::EpisodesToFind => "episodes until any agent reached the goal".to_owned(),
            Self::EnvStepsToFind => "env steps until any agent reached the goal".to_owned(),
            Self::EpisodesToSpread => {
                "episodes from the first agent at the goal to half of the agents".to_owned()
            }
            Self::Regret => "regret per agent".to_owned(),
            Self::FinalReturn { window, held, .. } => {
                let episodes = match window.get() {
                    1 => "return of the last episode".to_owned(),
                    window => format!("return over the last {window} episodes"),
                };
                match self.moment() {
                    Some(moment) => format!("{episodes} up to {moment}{}", held_text(held)),
                    None => episodes,
                }
            }
            Self::ReturnAt {
                episode,
                window,
                held,
            } => format!(
                "return over {} episodes up to episode {}{}",
                window.get(),
                episode.get(),
                held_text(held)
            ),
            Self::SpreadOfAgents { window } => format!(
                "spread of returns between agents, over {} episodes",
                window.get()
            ),
            Self::PercentileOfAgents { percent, window } => format!(
                "return of the agent at the {}th percentile of its team, over {} episodes",
                percent.get(),
                window.get()
            ),
            Self::RegretAbove { regret } => {
                format!("share of runs with a regret above {}", regret.get())
            }
            Self::Coverage => "coverage of the state space".to_owned(),
            Self::Mean { of } => format!("{}, mean of the run", of.metric().label()),
            Self::At { of, held, .. } => {
                let moment = self
                    .moment()
                    .map_or(String::new(), |moment| format!(" at {moment}"));
                format!("{}{moment}{}", of.metric().label(), held_text(held))
            }
            Self::Last { of } => format!("{} at the end", of.metric().label()),
        }
    }
}

fn held_text(held: bool) -> &'static str {
    if held {
        ", held after the end of a run"
    } else {
        ""
    }
}

/// Requirement that a run must fulfill for a curve.
fn needs_of_curve(curve: Curve) -> Needs {
    match curve.metric().runs {
        RunKind::All => Needs::Nothing,
        RunKind::Training => Needs::Rounds,
        RunKind::Tabular => Needs::Tables,
    }
}

fn default_window() -> Count {
    ranged_count(25)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_measured_at_one_moment() {
        let error = |measure: &str| {
            ron::from_str::<Measure>(measure)
                .unwrap_err()
                .code
                .to_string()
        };
        assert!(error("At(of: Return)").contains("expected `episode` or `steps`"));
        assert!(error("At(of: Return, episode: 1, steps: 2)").contains("found both"));
    }

    /// Names of columns were written before measures could be held.
    #[test]
    fn measures_that_are_not_held_are_written_as_before() {
        let measure: Measure = ron::from_str("At(of: TeamCoverage, episode: 230)").unwrap();
        assert_eq!(
            ron::to_string(&measure).unwrap(),
            "At(of:TeamCoverage,episode:230)"
        );
    }

    #[test]
    fn the_text_in_locks_has_no_defaults() {
        for (measure, expected) in [
            ("Solved", "Solved"),
            ("FinalReturn(window: 25)", "FinalReturn"),
            (
                "At(of: TeamCoverage, episode: 230, held: false)",
                "At(episode = 230, of = TeamCoverage)",
            ),
            (
                "ReturnAt(episode: 9, held: true)",
                "ReturnAt(episode = 9, held = true)",
            ),
        ] {
            let measure: Measure = ron::from_str(measure).unwrap();
            assert_eq!(measure.canonical_text(), expected);
        }
    }
}
