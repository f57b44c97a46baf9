//! Measures of runs, as one number per run.

use std::fmt;
use std::ops::Not;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::experiment::run_result::RunResult;
pub use crate::plotting::trailing_means;
pub use crate::run::facts::metrics::Curve;
use crate::run::facts::metrics::{Range, RunKind};
use crate::scenario::Rounding;
use seedbed_input::numbers::{Count, ranged_count};
use seedbed_input::{FORMER_NAMES, settings_of};
use seedbed_stats::aggregate::{mean, median, quantile};
use seedbed_stats::survival::TimeToEvent;

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

    /// Value of this measure for a run: infinite for a time that was not reached, `None` if the run
    /// does not have this measure.
    #[must_use]
    pub fn of(self, run: &RunResult) -> Option<f64> {
        let time_or_infinity =
            |time: Option<f64>| run.threshold.map(|_| time.unwrap_or(f64::INFINITY));
        match self {
            Self::EpisodesToSolve => {
                time_or_infinity(run.solved.map(|solved| f64::from(solved.episodes)))
            }
            Self::EnvStepsToSolve => {
                time_or_infinity(run.solved.map(|solved| solved.env_steps as f64))
            }
            Self::Solved => run
                .threshold
                .map(|_| f64::from(u8::from(run.solved.is_some()))),
            Self::Reach => run.has_goal().then(|| share_of_agents_with_goal(run)),
            Self::FirstGoal => run.has_goal().then(|| median(&first_goals(run))),
            Self::Regret => {
                (!run.regrets.is_empty()).then(|| run.curve(Curve::Regret).iter().sum())
            }
            Self::FinalReturn { window, .. } if self.is_known_of(run) => match self.moment() {
                Some(Moment::EnvSteps(steps)) => {
                    window_return(&run.until(steps.into())?, usize::MAX, window.get() as usize)
                }
                _ => window_return(run, usize::MAX, window.get() as usize),
            },
            Self::ReturnAt {
                episode, window, ..
            } if self.is_known_of(run) => {
                window_return(run, episode.get() as usize, window.get() as usize)
            }
            Self::SpreadOfAgents { window } => {
                mean_over_agents_statistic(run, window, standard_deviation)
            }
            Self::PercentileOfAgents { percent, window } => {
                let share = f64::from(percent.get()) / 100.0;
                mean_over_agents_statistic(run, window, |returns| quantile(returns, share))
            }
            Self::RegretAbove { regret } => Self::Regret
                .of(run)
                .map(|value| f64::from(u8::from(is_above(value, regret.get().into())))),
            Self::Coverage => Self::Last {
                of: Curve::TeamCoverage,
            }
            .of(run),
            Self::Mean { of: Curve::Return } => window_return(run, usize::MAX, usize::MAX),
            Self::Mean { of } => (!run.curve(of).is_empty()).then(|| mean(&run.curve(of))),
            Self::At { of, .. } if self.is_known_of(run) => match self.moment()? {
                Moment::Episode(episode) => run.curve_at(of, episode),
                Moment::EnvSteps(steps) => run.curve_at(of, run.episodes_at(steps.into())?),
            },
            Self::FinalReturn { .. } | Self::ReturnAt { .. } | Self::At { .. } => None,
            Self::Last { of: Curve::Return } => window_return(run, usize::MAX, 1),
            Self::Last { of } => run.curve(of).last().copied(),
        }
    }

    /// Magnitude of what was added up for the value of a run, to which its rounding error is
    /// proportional.
    #[must_use]
    pub fn magnitude(self, run: &RunResult, value: f64) -> f64 {
        let largest = |values: &[f64]| values.iter().fold(0.0, |one: f64, v| one.max(v.abs()));
        match self {
            Self::Mean { of } if of != Curve::Return => largest(&run.curve(of)),
            Self::FinalReturn { .. }
            | Self::ReturnAt { .. }
            | Self::SpreadOfAgents { .. }
            | Self::PercentileOfAgents { .. }
            | Self::Mean { .. }
            | Self::At {
                of: Curve::Return, ..
            }
            | Self::Last { of: Curve::Return } => {
                let agents = run.returns.iter();
                agents.map(|returns| largest(returns)).fold(0.0, f64::max)
            }
            _ => value.abs(),
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

    /// Whether this measure of a given moment is known: the run has reached the moment, or the value at the end
    /// of the run is held.
    fn is_known_of(self, run: &RunResult) -> bool {
        self.needed_moment().is_none_or(|moment| match moment {
            Moment::Episode(episode) => run.episodes_per_agent() >= episode as usize,
            Moment::EnvSteps(steps) => run.reaches_step(steps.into()),
        })
    }

    /// Whether this measure needs the environment steps at the end of each episode.
    #[must_use]
    pub fn counts_env_steps(self) -> bool {
        self == Self::EnvStepsToSolve || matches!(self.moment(), Some(Moment::EnvSteps(_)))
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
            Self::EpisodesToSolve | Self::EnvStepsToSolve | Self::FirstGoal
        )
    }

    /// Requirement that a run must fulfill for this measure.
    #[must_use]
    pub fn needs(self) -> Needs {
        match self {
            Self::EpisodesToSolve | Self::EnvStepsToSolve | Self::Solved => Needs::Threshold,
            Self::FirstGoal | Self::Reach => Needs::Goal,
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
        matches!(self, Self::Solved | Self::RegretAbove { .. })
    }

    /// Whether this measure is a share from 0 to 1, which can be compared between tasks.
    #[must_use]
    pub fn is_share(self) -> bool {
        match self {
            Self::Solved | Self::RegretAbove { .. } | Self::Reach | Self::Coverage => true,
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
            Self::EpisodesToSolve | Self::EnvStepsToSolve | Self::FirstGoal => [1.0, end],
            Self::Solved | Self::RegretAbove { .. } | Self::Reach | Self::Coverage => [0.0, 1.0],
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

    /// Time of a run for survival analysis, censored if it was not reached.
    #[must_use]
    pub fn time_to_event(self, run: &RunResult) -> Option<TimeToEvent> {
        let value = self.of(run)?;
        let observed_until = if self == Self::EnvStepsToSolve {
            run.env_steps as f64
        } else {
            run.episodes_per_agent() as f64
        };
        Some(if value.is_finite() {
            TimeToEvent::observed(value)
        } else {
            TimeToEvent::censored(observed_until)
        })
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

/// Mean return of the team over the last `window` of the first `end` episodes. Agents of runs of
/// others each count with their own episodes, of which there may be different numbers.
fn window_return(run: &RunResult, end: usize, window: usize) -> Option<f64> {
    if !run.has_different_lengths() {
        return window_mean(&run.team_returns(), end, window);
    }
    let agents = run.returns.iter();
    let means: Option<Vec<f64>> = agents
        .map(|returns| window_mean(returns, end, window))
        .collect();
    means.map(|means| mean(&means))
}

/// Requirement that a run must fulfill for a curve.
fn needs_of_curve(curve: Curve) -> Needs {
    match curve.metric().runs {
        RunKind::All => Needs::Nothing,
        RunKind::Training => Needs::Rounds,
        RunKind::Tabular => Needs::Tables,
    }
}

/// First episode in which each agent reached the goal, counted from 1; infinite for agents that
/// never did. → `[K]`
fn first_goals(run: &RunResult) -> Vec<f64> {
    run.first_goals()
        .into_iter()
        .map(|episode| episode.map_or(f64::INFINITY, f64::from))
        .collect()
}

fn share_of_agents_with_goal(run: &RunResult) -> f64 {
    let goals = first_goals(run);
    goals.iter().filter(|episode| episode.is_finite()).count() as f64 / goals.len() as f64
}

/// Mean of the last `window` of the first `end` values, or of fewer values if there are fewer.
/// `None` without values.
fn window_mean(values: &[f64], end: usize, window: usize) -> Option<f64> {
    let end = end.min(values.len());
    let start = end.saturating_sub(window);
    (start < end).then(|| mean(&values[start..end]))
}

/// Moving averages over windows of `window` values.   `values: [n]` → `[n + 1 − window]`, or empty
#[must_use]
fn moving_average(values: &[f64], window: usize) -> Vec<f64> {
    values.windows(window.max(1)).map(mean).collect()
}

/// Mean over episodes of a statistic over agents of the moving averages of their returns.
fn mean_over_agents_statistic(
    run: &RunResult,
    window: Count,
    statistic: impl Fn(&[f64]) -> f64,
) -> Option<f64> {
    let window = window.get() as usize;
    let mut moving_averages: Vec<Vec<f64>> = Vec::with_capacity(run.returns.len());
    for returns in &run.returns {
        moving_averages.push(moving_average(returns, window));
    }
    let episodes = moving_averages.iter().map(Vec::len).min().unwrap_or(0);
    let mut statistics = Vec::with_capacity(episodes);
    for episode in 0..episodes {
        let returns_at_episode: Vec<f64> =
            moving_averages.iter().map(|agent| agent[episode]).collect();
        statistics.push(statistic(&returns_at_episode));
    }
    (episodes > 0).then(|| mean(&statistics))
}

fn standard_deviation(values: &[f64]) -> f64 {
    let average = mean(values);
    let squared_deviations: Vec<f64> = values
        .iter()
        .map(|value| (value - average).powi(2))
        .collect();
    mean(&squared_deviations).sqrt()
}

fn default_window() -> Count {
    ranged_count(25)
}

/// Whether a value is a number above `limit`, by more than the rounding of sums.
fn is_above(value: f64, limit: f64) -> bool {
    value - limit > Rounding::Double.error(value.abs().max(limit.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_input::numbers::ranged_count;

    /// Five episodes with returns 1 to 5: their mean is 3, that of the last two 4.5.
    #[test]
    fn episodes_after_the_end_are_unknown_unless_held() {
        let run = RunResult {
            returns: vec![(1..=5).map(f64::from).collect()],
            ..RunResult::default()
        };
        let return_at = |episode, window, held| {
            let measure = Measure::ReturnAt {
                episode: ranged_count(episode),
                window: ranged_count(window),
                held,
            };
            measure.of(&run)
        };
        assert_eq!(return_at(5, 25, false), Some(3.0));
        assert_eq!(return_at(8, 25, false), None);
        assert_eq!(return_at(8, 2, true), Some(4.5));
        let at = |episode, held| {
            let measure = Measure::At {
                of: Curve::Return,
                episode: Some(ranged_count(episode)),
                steps: None,
                held,
            };
            measure.of(&run)
        };
        assert_eq!(at(4, false), Some(4.0));
        assert_eq!(at(6, false), None);
        assert_eq!(at(6, true), Some(5.0));
    }

    /// Two agents whose episodes end at steps 10, 30, 50 and 20, 40: at step 45 both have finished two, with mean
    /// returns 2 and 5. The longest episode took 20 steps, so that step 65 may be one of a run of 50 steps whose
    /// last episodes are not finished.
    #[test]
    fn measures_at_equal_steps_need_the_ends_of_episodes() {
        let run = RunResult {
            returns: vec![vec![1.0, 4.0, 9.0], vec![3.0, 6.0]],
            episode_ends: vec![vec![10, 30, 50], vec![20, 40]],
            env_steps: 50,
            rounding: Rounding::Double,
            ..RunResult::default()
        };
        let value = |measure: &str| ron::from_str::<Measure>(measure).unwrap().of(&run);
        for (measure, expected) in [
            ("At(of: Return, steps: 45)", Some(5.0)),
            ("At(of: Return, steps: 39)", Some(2.0)),
            ("At(of: Return, steps: 19)", None),
            ("At(of: Return, steps: 65)", Some(5.0)),
            ("At(of: Return, steps: 71)", None),
            ("At(of: Return, steps: 71, held: true)", Some(5.0)),
            ("FinalReturn(window: 2, steps: 45)", Some(3.5)),
            ("FinalReturn(window: 1, steps: 50)", Some(7.5)),
            ("FinalReturn(window: 1, steps: 71)", None),
            ("FinalReturn(window: 1, steps: 71, held: true)", Some(7.5)),
        ] {
            assert_eq!(value(measure), expected, "{measure}");
        }
        let unknown = RunResult {
            episode_ends: Vec::new(),
            ..run
        };
        let measure: Measure = ron::from_str("FinalReturn(steps: 40)").unwrap();
        assert_eq!(measure.of(&unknown), None);
    }

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

    /// Agents with 30, 40 and 27 episodes, whose last 25 have the means 173, 183 and 143: 166⅓. Cut to
    /// 27 episodes, the first two would count with their returns of 0.
    #[test]
    fn agents_count_with_their_own_last_episodes() {
        let agent = |zeros: usize, value: f64| [vec![0.0; zeros], vec![value; 25]].concat();
        let mut run = RunResult {
            returns: vec![agent(5, 173.0), agent(15, 183.0), agent(2, 143.0)],
            rounding: crate::scenario::Rounding::Double,
            ..RunResult::default()
        };
        let last: Measure = ron::from_str("FinalReturn()").unwrap();
        assert_eq!(last.of(&run), Some(499.0 / 3.0));
        assert_eq!(
            Measure::Last { of: Curve::Return }.of(&run),
            Some(499.0 / 3.0)
        );
        let mean_of_all = [
            173.0 * 25.0 / 30.0,
            183.0 * 25.0 / 40.0,
            143.0 * 25.0 / 27.0,
        ];
        assert_eq!(
            Measure::Mean { of: Curve::Return }.of(&run),
            Some(mean(&mean_of_all))
        );
        run.rounding = crate::scenario::Rounding::SingleRewards;
        assert_eq!(last.of(&run), Some(499.0 / 3.0));
    }

    #[test]
    fn statistics_over_agents_are_averaged_over_episodes() {
        let run = RunResult {
            returns: (0..5_u8)
                .map(|agent| vec![f64::from(agent), 2.0 * f64::from(agent)])
                .collect(),
            ..RunResult::default()
        };
        let window = ranged_count(1);
        let percentile = Measure::PercentileOfAgents {
            percent: ranged_count(75),
            window,
        };
        assert_eq!(percentile.of(&run), Some(4.5));
        let spread = Measure::SpreadOfAgents { window }.of(&run).unwrap();
        assert!((spread - 1.5 * 2.0_f64.sqrt()).abs() < 1e-12);
    }

    /// Two agents with regrets of 3 + 4 and 5 + 6: 9 on average.
    #[test]
    fn a_regret_is_above_smaller_numbers_only() {
        let run = RunResult {
            regrets: vec![vec![3.0, 4.0], vec![5.0, 6.0]],
            curves: vec![Vec::new(); Curve::WITH_ROUND_VALUES.len()],
            ..RunResult::default()
        };
        let above = |regret| {
            Measure::RegretAbove {
                regret: ranged_count(regret),
            }
            .of(&run)
        };
        assert_eq!((above(8), above(9)), (Some(1.0), Some(0.0)));
    }

    #[test]
    fn a_sum_that_is_rounded_up_is_not_above() {
        assert!(0.1 + 0.2 > 0.3 && !is_above(0.1 + 0.2, 0.3));
        assert!(is_above(0.3001, 0.3) && !is_above(f64::NAN, 0.3));
        assert!(is_above(f64::INFINITY, 3.0));
    }
}
