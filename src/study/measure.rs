//! Measures: what is measured of a run, as one number or one curve.

use serde::{Deserialize, Serialize};

use super::run_result::RunResult;
pub use crate::record::metrics::Curve;
use crate::record::metrics::{Range, Runs};
use seedbed_env::input::numbers::{Count, known_count};
use seedbed_stats::aggregate::{mean, median};
use seedbed_stats::survival::TimeToEvent;

/// One number of a whole team run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Measure {
    /// Episodes of each agent until the team has solved its task; runs that never solve it are
    /// censored.
    EpisodesToSolve,
    /// Steps of the team until it has solved its task; censored likewise.
    EnvStepsToSolve,
    /// Whether the team has solved its task: 1 or 0.
    Solved,
    /// Share of agents that reached the task's return, or in tabular tasks had no regret, in any of
    /// their own episodes.
    Reach,
    /// Episode in which an agent did so for the first time, median over agents.
    FirstGoal,
    /// Of tabular tasks: what the best policy would have earned beyond what an agent's actions earn
    /// on average, summed over its episodes; mean over agents.
    Regret,
    /// Mean return of the team over its last episodes.
    FinalReturn {
        /// Number of episodes of each agent.
        #[serde(default = "default_window")]
        window: Count,
    },
    /// Mean return of the team over some episodes up to a given one.
    ReturnAt {
        /// Last of these episodes, counted from 1.
        episode: Count,
        /// Number of episodes of each agent.
        #[serde(default = "default_window")]
        window: Count,
    },
    /// Spread between the agents of a team: the standard deviation over agents of their moving
    /// averages of returns, averaged over episodes.
    SpreadOfAgents {
        /// Number of episodes of the moving average.
        #[serde(default = "default_window")]
        window: Count,
    },
    /// Share of the state space that the team has visited.
    Coverage,
    /// Mean of a curve.
    Mean {
        /// Curve.
        of: Curve,
    },
    /// Value of a curve when each agent has finished a number of episodes.
    At {
        /// Curve.
        of: Curve,
        /// Number of episodes.
        episode: Count,
    },
    /// Last value of a curve.
    Last {
        /// Curve.
        of: Curve,
    },
}

/// What a run must have for a measure of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Nothing that some runs lack.
    Nothing,
    /// A threshold from which its task counts as solved.
    Threshold,
    /// A goal for a single agent.
    Goal,
    /// A tabular task, of which the best policy is known.
    Tables,
    /// Rounds in which agents learn.
    Rounds,
}

impl Measure {
    /// Value of a run; infinite for a time that it never reached. `None` if it was not measured.
    #[must_use]
    pub fn of(self, run: &RunResult) -> Option<f64> {
        let time = |time: Option<f64>| run.threshold.map(|_| time.unwrap_or(f64::INFINITY));
        match self {
            Self::EpisodesToSolve => time(run.solved.map(|solved| f64::from(solved.episodes))),
            Self::EnvStepsToSolve => time(run.solved.map(|solved| solved.env_steps as f64)),
            Self::Solved => run
                .threshold
                .map(|_| f64::from(u8::from(run.solved.is_some()))),
            Self::Reach => run.has_goal().then(|| share_reached(run)),
            Self::FirstGoal => run.has_goal().then(|| median(&first_goals(run))),
            Self::Regret => {
                (!run.regrets.is_empty()).then(|| run.curve(Curve::Regret).iter().sum())
            }
            Self::FinalReturn { window } => window_mean(&run.team_returns(), usize::MAX, window),
            Self::ReturnAt { episode, window } => {
                window_mean(&run.team_returns(), episode.get() as usize, window)
            }
            Self::SpreadOfAgents { window } => spread(run, window.get() as usize),
            Self::Coverage => Self::Last {
                of: Curve::TeamCoverage,
            }
            .of(run),
            Self::Mean { of } => (!run.curve(of).is_empty()).then(|| mean(&run.curve(of))),
            Self::At { of, episode } => run.curve_at(of, episode.get()),
            Self::Last { of } => run.curve(of).last().copied(),
        }
    }

    /// Whether it is a time, which a run may end without reaching.
    #[must_use]
    pub fn is_time(self) -> bool {
        matches!(
            self,
            Self::EpisodesToSolve | Self::EnvStepsToSolve | Self::FirstGoal
        )
    }

    /// What a run must have for this measure.
    #[must_use]
    pub fn needs(self) -> Needs {
        match self {
            Self::EpisodesToSolve | Self::EnvStepsToSolve | Self::Solved => Needs::Threshold,
            Self::FirstGoal | Self::Reach => Needs::Goal,
            Self::Regret => Needs::Tables,
            Self::Mean { of } | Self::At { of, .. } | Self::Last { of } => needs_of_curve(of),
            Self::FinalReturn { .. }
            | Self::ReturnAt { .. }
            | Self::SpreadOfAgents { .. }
            | Self::Coverage => Needs::Nothing,
        }
    }

    /// Whether it is a share from 0 to 1, which means the same in every task.
    #[must_use]
    pub fn is_share(self) -> bool {
        match self {
            Self::Solved | Self::Reach | Self::Coverage => true,
            Self::Mean { of } | Self::At { of, .. } | Self::Last { of } => {
                of.metric().range == Range::Share
            }
            _ => false,
        }
    }

    /// Whether smaller values are better.
    #[must_use]
    pub fn is_better_below(self) -> bool {
        self.is_time() || self.needs() == Needs::Tables
    }

    /// Time of a run, censored if it was not reached.
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
            Self::FinalReturn { window } if window.get() == 1 => {
                "return of the last episode".to_owned()
            }
            Self::FinalReturn { window } => {
                format!("return over the last {} episodes", window.get())
            }
            Self::ReturnAt { episode, window } => {
                format!(
                    "return over {} episodes up to episode {}",
                    window.get(),
                    episode.get()
                )
            }
            Self::SpreadOfAgents { window } => format!(
                "spread of returns between agents, over {} episodes",
                window.get()
            ),
            Self::Coverage => "coverage of the state space".to_owned(),
            Self::Mean { of } => format!("{}, mean of the run", of.metric().label()),
            Self::At { of, episode } => {
                format!("{} at episode {}", of.metric().label(), episode.get())
            }
            Self::Last { of } => format!("{} at the end", of.metric().label()),
        }
    }
}

/// What a run has to know for a curve of it.
fn needs_of_curve(curve: Curve) -> Needs {
    match curve.metric().runs {
        Runs::All => Needs::Nothing,
        Runs::Training => Needs::Rounds,
        Runs::Tabular => Needs::Tables,
    }
}

/// First episode of each agent, counted from 1, in which it reached the goal; infinite if none did.
/// → `[K]`
fn first_goals(run: &RunResult) -> Vec<f64> {
    run.first_goals()
        .into_iter()
        .map(|episode| episode.map_or(f64::INFINITY, f64::from))
        .collect()
}

fn share_reached(run: &RunResult) -> f64 {
    let goals = first_goals(run);
    goals.iter().filter(|episode| episode.is_finite()).count() as f64 / goals.len() as f64
}

/// Mean of the last `window` of the first `end` values, or of all if there are fewer.
fn window_mean(values: &[f64], end: usize, window: Count) -> Option<f64> {
    let end = end.min(values.len());
    let start = end.saturating_sub(window.get() as usize);
    (start < end).then(|| mean(&values[start..end]))
}

/// Moving averages over full windows.   `values: [n]` → `[n + 1 − window]`, or empty
#[must_use]
pub fn moving_average(values: &[f64], window: usize) -> Vec<f64> {
    values.windows(window.max(1)).map(mean).collect()
}

fn spread(run: &RunResult, window: usize) -> Option<f64> {
    let mut smooth: Vec<Vec<f64>> = Vec::with_capacity(run.returns.len());
    for returns in &run.returns {
        smooth.push(moving_average(&widened(returns), window));
    }
    let episodes = smooth.iter().map(Vec::len).min().unwrap_or(0);
    let mut deviations = Vec::with_capacity(episodes);
    for episode in 0..episodes {
        let now: Vec<f64> = smooth.iter().map(|agent| agent[episode]).collect();
        deviations.push(standard_deviation(&now));
    }
    (episodes > 0).then(|| mean(&deviations))
}

fn standard_deviation(values: &[f64]) -> f64 {
    let center = mean(values);
    let squares: Vec<f64> = values
        .iter()
        .map(|value| (value - center).powi(2))
        .collect();
    mean(&squares).sqrt()
}

/// Values in double precision.
pub(super) fn widened(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&value| f64::from(value)).collect()
}

fn default_window() -> Count {
    known_count(25)
}
