//! What is known of a run in numbers: its score in a measure, and its cost.

use crate::experiment::measure::{Curve, Measure};
use crate::experiment::run_result::RunResult;
use crate::study::external::Unknown;
use seedbed_stats::survival::TimeToEvent;

/// Value of a measure for one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunScore {
    /// Run seed.
    pub run_seed: u64,
    /// Value of the measure; infinite for a time that was not reached.
    pub value: f64,
    /// For a time that was not reached, the end of the run, and so for a task that a run of others did not solve
    /// before an early end; otherwise infinite.
    pub observed_until: f64,
    /// Magnitude of what was added up for the value, to which its rounding error is proportional.
    pub magnitude: f64,
}

impl RunScore {
    /// Score of a run in a measure; `None` if the run does not have this measure.
    #[must_use]
    pub fn of(measure: Measure, run_seed: u64, run: &RunResult) -> Option<Self> {
        let value = measure.of(run)?;
        let time = if measure.is_time() {
            measure.time_to_event(run)
        } else {
            None
        };
        let observed_until = match time {
            Some(time) if !time.observed => time.time,
            _ => f64::INFINITY,
        };
        Some(Self {
            run_seed,
            value,
            observed_until,
            magnitude: measure.magnitude(run, value),
        })
    }

    pub(super) fn time_to_event(self) -> TimeToEvent {
        if self.value.is_finite() {
            TimeToEvent::observed(self.value)
        } else {
            TimeToEvent::censored(self.observed_until)
        }
    }
}

/// Converts scores of times to times for survival analysis. Times that were not reached are
/// censored.
#[must_use]
pub fn times_to_event(scores: &[RunScore]) -> Vec<TimeToEvent> {
    scores.iter().map(|score| score.time_to_event()).collect()
}

/// Cost of one run, until it solved its task or, if it did not, until its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunCost {
    /// Whether the run solved its task; `None` if no threshold is set.
    pub solved: Option<bool>,
    /// Episodes of each agent; `None` if unknown.
    pub episodes: Option<f64>,
    /// Environment steps of the team; `None` if unknown.
    pub env_steps: Option<f64>,
    /// Gradient steps of all networks of the team; `None` if unknown.
    pub gradient_steps: Option<f64>,
    /// Whether the policy loss was not 0 in some round; `None` without a policy loss.
    pub had_policy_gradient: Option<bool>,
}

impl RunCost {
    pub(super) fn of(run: &RunResult, unknown: Unknown) -> Self {
        let policy_losses = run.curve(Curve::PolicyLoss);
        Self {
            solved: run.threshold.map(|_| run.solved.is_some()),
            episodes: (!unknown.episodes).then(|| episodes(run)),
            env_steps: (!unknown.env_steps).then(|| env_steps(run)),
            gradient_steps: (!unknown.gradient_steps).then(|| gradient_steps(run)),
            had_policy_gradient: (!policy_losses.is_empty())
                .then(|| policy_losses.iter().any(|loss| *loss != 0.0)),
        }
    }
}

fn episodes(run: &RunResult) -> f64 {
    run.solved
        .map_or(run.episodes_per_agent() as f64, |solved| {
            f64::from(solved.episodes)
        })
}

fn env_steps(run: &RunResult) -> f64 {
    run.solved.map_or(run.env_steps, |solved| solved.env_steps) as f64
}

fn gradient_steps(run: &RunResult) -> f64 {
    let last_episode = run.solved.map_or(u32::MAX, |solved| solved.episodes);
    let rounds = run.episodes_of_curve(Curve::GradientSteps);
    let steps = rounds.iter().zip(run.curve(Curve::GradientSteps));
    let until_solved = steps.filter(|(episodes, _)| **episodes <= last_episode);
    // `sum` of nothing is −0.
    until_solved.fold(0.0, |sum, (_, steps)| sum + steps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::run_result::Milestone;

    /// A run of ten rounds of one episode, each with 5 steps and 3 gradient steps.
    fn run(solved: Option<u32>) -> RunResult {
        let values = |curve: &Curve| match curve {
            Curve::GradientSteps => vec![3.0; 10],
            _ => Vec::new(),
        };
        RunResult {
            returns: vec![vec![0.0; 10]],
            threshold: Some((1.0, 1)),
            solved: solved.map(|episodes| Milestone {
                episodes,
                env_steps: u64::from(episodes) * 5,
            }),
            env_steps: 50,
            episodes: (1..=10).collect(),
            curves: Curve::WITH_ROUND_VALUES.iter().map(values).collect(),
            ..RunResult::default()
        }
    }

    #[test]
    fn costs_end_when_the_task_is_solved() {
        let solved = run(Some(4));
        assert_eq!(
            (
                episodes(&solved),
                env_steps(&solved),
                gradient_steps(&solved)
            ),
            (4.0, 20.0, 12.0)
        );
        let unsolved = run(None);
        assert_eq!(
            (
                episodes(&unsolved),
                env_steps(&unsolved),
                gradient_steps(&unsolved)
            ),
            (10.0, 50.0, 30.0)
        );
        let without_networks = gradient_steps(&RunResult::default());
        assert!(without_networks == 0.0 && without_networks.is_sign_positive());
    }
}
