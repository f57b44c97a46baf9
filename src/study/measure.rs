//! What is measured of a run: one number, or one curve.

use serde::{Deserialize, Serialize};

use super::measured::Measured;
use super::statistics::aggregate::{mean, median};
use super::statistics::survival::Lifetime;
use crate::input::numbers::{Count, known_count};

/// One number of a whole team run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Measure {
    /// Episodes of each agent until the team has solved its task; runs that never do are censored.
    EpisodesToSolve,
    /// Steps of the team until then.
    EnvStepsToSolve,
    /// Whether the team has solved its task: 1 or 0.
    Solved,
    /// The share of agents that reached the task's return by themselves, or had no regret, in any single episode.
    Reach,
    /// In which of its episodes the median agent did so for the first time.
    FirstGoal,
    /// Of finite tasks: what the best policy would have earned beyond what each agent's actions did on average, in all its episodes.
    Regret,
    /// The team's mean return over its last episodes.
    FinalReturn {
        /// Episodes of each agent.
        #[serde(default = "default_window")]
        window: Count,
    },
    /// The team's mean return over the episodes up to one.
    ReturnAt {
        /// The last of them, counted from 1.
        episode: Count,
        /// Episodes of each agent.
        #[serde(default = "default_window")]
        window: Count,
    },
    /// How far agents of a team lie apart: the standard deviation over agents of their moving averages of returns, averaged over episodes.
    SpreadOfAgents {
        /// Episodes of the moving average.
        #[serde(default = "default_window")]
        window: Count,
    },
    /// The share of the state space that the team has visited.
    Coverage,
    /// The mean of a curve.
    Mean {
        /// Which.
        of: Curve,
    },
    /// A curve at one episode of each agent.
    At {
        /// Which.
        of: Curve,
        /// Counts from 1.
        episode: Count,
    },
    /// The end of a curve.
    Last {
        /// Which.
        of: Curve,
    },
}

/// What a run has to know for a measure of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// What every run knows.
    Nothing,
    /// When its task counts as solved.
    Threshold,
    /// What a single agent is to reach.
    Goal,
    /// What the best policy earns.
    Tables,
    /// What learning did, round by round.
    Rounds,
}

/// What is followed through a run, one value a round; means over agents, where nothing else is said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Curve {
    /// The team's mean return, one value an episode of each agent.
    #[default]
    Return,
    /// Of finite tasks: the team's mean regret, one value an episode of each agent.
    Regret,
    /// Mean squared error of the value function against its (normalised) target, halved.
    ValueLoss,
    /// The policy's surrogate loss.
    PolicyLoss,
    /// Mean |ρ − 1| + 1 (thesis Fig. 5.4).
    RatioDeviation,
    /// The largest ρ of all agents' samples.
    LargestRatio,
    /// Share of samples with zero policy gradient because of clipping.
    ClippedFraction,
    /// Mean entropy of the policies, nats.
    Entropy,
    /// Mean bonus of a step; 0 without curiosity.
    IntrinsicReward,
    /// Mean squared error of the models of the dynamics; 0 without curiosity.
    PredictionError,
    /// Mean rank correlation between agents' judgements of the same steps; 0 where no two of them judge.
    BonusAgreement,
    /// Part of the state space that an agent has visited so far, 0 to 1.
    Coverage,
    /// How evenly an agent visits it, 0 to 1.
    VisitationEvenness,
    /// Part of the state space that the team has visited so far, 0 to 1.
    TeamCoverage,
    /// How alike the agents' visits are, 0 to 1.
    TeamOverlap,
    /// How many agents, none of whose visits overlap, would differ as much, 1 to K.
    EffectiveAgents,
}

impl Measure {
    /// The number of a run; infinite for what it never reached. `None` where the run cannot tell.
    #[must_use]
    pub fn of(self, run: &Measured) -> Option<f64> {
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

    /// Whether it is a time, which runs may end without reaching.
    #[must_use]
    pub fn is_time(self) -> bool {
        matches!(
            self,
            Self::EpisodesToSolve | Self::EnvStepsToSolve | Self::FirstGoal
        )
    }

    /// What it takes.
    #[must_use]
    pub fn needs(self) -> Needs {
        match self {
            Self::EpisodesToSolve | Self::EnvStepsToSolve | Self::Solved => Needs::Threshold,
            Self::FirstGoal | Self::Reach => Needs::Goal,
            Self::Regret => Needs::Tables,
            Self::Mean { of } | Self::At { of, .. } | Self::Last { of } => of.needs(),
            Self::FinalReturn { .. }
            | Self::ReturnAt { .. }
            | Self::SpreadOfAgents { .. }
            | Self::Coverage => Needs::Nothing,
        }
    }

    /// Whether it is a share from 0 to 1, which means the same in any task.
    #[must_use]
    pub fn is_share(self) -> bool {
        match self {
            Self::Solved | Self::Reach | Self::Coverage => true,
            Self::Mean { of } | Self::At { of, .. } | Self::Last { of } => of.is_share(),
            _ => false,
        }
    }

    /// Whether a smaller number is the better one.
    #[must_use]
    pub fn is_better_below(self) -> bool {
        self.is_time() || self.needs() == Needs::Tables
    }

    /// A time of a run as far as it is known.
    #[must_use]
    pub fn lifetime(self, run: &Measured) -> Option<Lifetime> {
        let value = self.of(run)?;
        let watched = if self == Self::EnvStepsToSolve {
            run.env_steps as f64
        } else {
            run.episodes_per_agent() as f64
        };
        Some(if value.is_finite() {
            Lifetime {
                time: value,
                reached: true,
            }
        } else {
            Lifetime {
                time: watched,
                reached: false,
            }
        })
    }

    /// What it is called, with its unit.
    #[must_use]
    pub fn title(self) -> String {
        match self {
            Self::EpisodesToSolve => "episodes until solved".to_owned(),
            Self::EnvStepsToSolve => "env steps until solved".to_owned(),
            Self::Solved => "share solved".to_owned(),
            Self::Reach => "share of agents that reached the goal".to_owned(),
            Self::FirstGoal => "episode of the first goal".to_owned(),
            Self::Regret => "regret of an agent".to_owned(),
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
                "spread between agents of returns over {} episodes",
                window.get()
            ),
            Self::Coverage => "coverage of the state space".to_owned(),
            Self::Mean { of } => format!("{}, mean of the run", of.title()),
            Self::At { of, episode } => format!("{} at episode {}", of.title(), episode.get()),
            Self::Last { of } => format!("{} at the end", of.title()),
        }
    }
}

impl Curve {
    /// All that come round by round, in the order in which a run keeps them.
    pub const KEPT: [Self; 14] = [
        Self::ValueLoss,
        Self::PolicyLoss,
        Self::RatioDeviation,
        Self::LargestRatio,
        Self::ClippedFraction,
        Self::Entropy,
        Self::IntrinsicReward,
        Self::PredictionError,
        Self::BonusAgreement,
        Self::Coverage,
        Self::VisitationEvenness,
        Self::TeamCoverage,
        Self::TeamOverlap,
        Self::EffectiveAgents,
    ];

    /// What it takes.
    #[must_use]
    pub fn needs(self) -> Needs {
        match self {
            Self::Return
            | Self::Coverage
            | Self::TeamCoverage
            | Self::TeamOverlap
            | Self::EffectiveAgents => Needs::Nothing,
            Self::Regret => Needs::Tables,
            _ => Needs::Rounds,
        }
    }

    fn is_share(self) -> bool {
        matches!(
            self,
            Self::ClippedFraction
                | Self::Coverage
                | Self::VisitationEvenness
                | Self::TeamCoverage
                | Self::TeamOverlap
        )
    }

    /// What it is called.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Return => "return",
            Self::Regret => "regret of an episode",
            Self::ValueLoss => "value loss",
            Self::PolicyLoss => "policy loss",
            Self::RatioDeviation => "deviation in ρ",
            Self::LargestRatio => "largest ρ",
            Self::ClippedFraction => "clipped fraction",
            Self::Entropy => "entropy of the policy, nats",
            Self::IntrinsicReward => "intrinsic reward",
            Self::PredictionError => "prediction error",
            Self::BonusAgreement => "agreement on bonuses",
            Self::Coverage => "coverage of an agent",
            Self::VisitationEvenness => "evenness of visits",
            Self::TeamCoverage => "coverage of the team",
            Self::TeamOverlap => "overlap of agents",
            Self::EffectiveAgents => "effective agents",
        }
    }
}

/// Of each agent: the first episode, counted from 1, that reached the return by itself; infinite where none did.   → `[K]`
fn first_goals(run: &Measured) -> Vec<f64> {
    run.first_goals()
        .into_iter()
        .map(|episode| episode.map_or(f64::INFINITY, f64::from))
        .collect()
}

fn share_reached(run: &Measured) -> f64 {
    let goals = first_goals(run);
    goals.iter().filter(|episode| episode.is_finite()).count() as f64 / goals.len() as f64
}

/// The mean of the `window` values up to the `end`-th, or up to the last; of fewer where there are fewer.
fn window_mean(values: &[f64], end: usize, window: Count) -> Option<f64> {
    let end = end.min(values.len());
    let start = end.saturating_sub(window.get() as usize);
    (start < end).then(|| mean(&values[start..end]))
}

/// Moving averages over full windows.   `values: [n]` → `[n + 1 − window]`, or none
#[must_use]
pub fn moving_average(values: &[f64], window: usize) -> Vec<f64> {
    values.windows(window.max(1)).map(mean).collect()
}

fn spread(run: &Measured, window: usize) -> Option<f64> {
    let smooth: Vec<Vec<f64>> = run
        .returns
        .iter()
        .map(|returns| moving_average(&widened(returns), window))
        .collect();
    let episodes = smooth.iter().map(Vec::len).min().unwrap_or(0);
    let deviation = |episode: usize| {
        let now: Vec<f64> = smooth.iter().map(|agent| agent[episode]).collect();
        let centre = mean(&now);
        mean(
            &now.iter()
                .map(|value| (value - centre).powi(2))
                .collect::<Vec<f64>>(),
        )
        .sqrt()
    };
    (episodes > 0).then(|| mean(&(0..episodes).map(deviation).collect::<Vec<f64>>()))
}

/// In double precision.
pub(super) fn widened(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&value| f64::from(value)).collect()
}

fn default_window() -> Count {
    known_count(25)
}
